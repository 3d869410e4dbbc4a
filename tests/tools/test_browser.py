"""The browser finds each kind of fault of a site; needs playwright and a Chromium, as `python -m tools.site --browser` does."""

from __future__ import annotations

from typing import Any

import pytest

from tools import site as browser

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

CLEAN = "<!doctype html><html data-theme=light><body style='background:#fff;color:#000'><p>Words to read</p>{}</body></html>"
FAULTS = {
    "console.html": ("<script>console.error('thrown')</script>", "console: thrown"),
    "exception.html": ("<script>null.x</script>", "exception: "),
    "picture.html": ("<img src=gone.png>", "gone.png: does not load"),
    "film.html": ("<video src=gone.mp4></video>", "gone.mp4: does not play"),
    "wide.html": ("<div style='width:3000px'>wide</div>", "is 3"),
    "pale.html": ("<p style='color:#ddd'>pale</p>", "contrast 1.4: p "),
    "covered.html": ("<div style='background:#111'><p>dark</p></div>", "contrast 1.1: p "),
}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A site's faults by page, and the folder of its pictures."""
    site = tmp_path_factory.mktemp("site")
    shots = tmp_path_factory.mktemp("shots")
    links = "".join(f"<a href={page}.html>{page}</a>" for page in list(browser.ASKED.values())[:-1])
    (site / "search.html").write_text(CLEAN.format(f"<div id=search-results>{links}</div>"))
    (site / "clean.html").write_text(CLEAN.format("<p hidden style='color:#fff'>not shown</p>"))
    for name, (body, _) in FAULTS.items():
        (site / name).write_text(CLEAN.format(body))
    with playwright.sync_playwright() as started:
        opened = browser.opened(started)
        looking = browser.Looking(opened, site, shots)
        result = {name: looking.page(site / name) for name in ("clean.html", *FAULTS)}
        result["search.html"] = looking.search(wait=300)
        opened.close()
    return result, shots


def test_a_page_without_faults_has_none(found: Any) -> None:
    assert found[0]["clean.html"] == []


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(found: Any, name: str) -> None:
    assert any(FAULTS[name][1] in line for line in found[0][name]), found[0][name]


def test_what_the_search_does_not_find_is_found(found: Any) -> None:
    (last,) = list(browser.ASKED.items())[-1:]
    assert [line.rpartition(":")[0] for line in found[0]["search.html"]] == [
        f"search.html: {last[0]!r} does not find {last[1]}"
    ]


def test_pages_have_pictures(found: Any) -> None:
    assert {path.name for path in found[1].glob("clean-*")} == {
        f"clean-{theme}-{width}.png" for theme, width in browser.KEPT
    }
