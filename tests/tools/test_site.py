"""The site's checks find what is broken and nothing else; pictures are made and shown; data lie where they are said to."""

import importlib
import re
import shutil
from pathlib import Path

import pytest

from antdrive.robots import list_robots
from antdrive.worlds import list_worlds
from tools import site as browser
from tools.formulas import HTML, typeset
from tools.pictures import BY_HAND, DRAWN, FROM_PAPERS, PICTURES, main
from tools.pictures import SHOWN as DRIVEN
from tools.shared_data import data_folder
from tools.site import FIRST, MOST, problems_of

ROOT = Path(__file__).resolve().parents[2]


def test_the_environment_names_the_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("ANTDRIVE_DATA", str(tmp_path))
    assert data_folder() == tmp_path
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("ANTDRIVE_DATA", "~/maps")
    assert data_folder() == tmp_path / "maps"


@pytest.mark.parametrize("value", [None, ""])
def test_by_default_it_lies_beside_the_checkout(monkeypatch, value):
    if value is None:
        monkeypatch.delenv("ANTDRIVE_DATA", raising=False)
    else:
        monkeypatch.setenv("ANTDRIVE_DATA", value)
    assert data_folder().resolve() == ROOT.parent / "shared" / "data"


SHOWN = re.compile(r"\]\((?:\.\./|docs/)?pictures/([\w./-]+)\)")


def test_every_picture_of_antdrive_is_made_by_a_command_and_shown_on_a_page():
    made = {f"worlds/{name}.webp" for name in list_worlds()} | {f"robots/{name}.svg" for name in list_robots()}
    assert [*DRAWN] == ["worlds", "robots"]
    made |= {f"{name}.webp" for name in DRIVEN} | {*FROM_PAPERS, *BY_HAND, "rooms.svg", "drive.html"}
    pages = [ROOT / "README.md", *(page for page in (ROOT / "docs").rglob("*.md") if "_gallery" not in page.parts)]
    shown = {name for page in pages for name in SHOWN.findall(page.read_text())}
    assert (
        made
        == shown
        == {path.relative_to(PICTURES).as_posix() for path in PICTURES.rglob("*.*") if path.suffix != ".json"}
    )


def test_a_picture_that_nothing_makes_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["sunset"])
    assert ended.value.code == 2
    assert "sunset: no such picture; choose from hero, view, plaza" in capsys.readouterr().err


INDEX = '<a href="a/b.html#here">b</a><a href="#top">up</a><a href="https://elsewhere.org">out</a><img src="p.png">'


@pytest.fixture
def site(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "index.html").write_text(INDEX)
    (tmp_path / "a" / "b.html").write_text('<h1 id="here">b</h1><a href="../index.html">back</a>')
    (tmp_path / "p.png").write_bytes(b"png")
    return tmp_path


def test_a_whole_site_has_no_problem(site):
    assert problems_of(site) == []


@pytest.mark.parametrize(
    ("element", "says"),
    [
        ('<a href="a/c.html">', "a/c.html: there is no such file"),
        ('<a href="a/b.html#there">', "a/b.html#there: there is no such place in it"),
        ('<a href="#nowhere">', "#nowhere: there is no such place in it"),
        ('<img src="q.png">', "q.png: there is no such file"),
        ('<script src="https://cdn.org/x.js"></script>', "loads https://cdn.org/x.js from elsewhere"),
    ],
)
def test_what_is_broken_is_told(site, element, says):
    (site / "index.html").write_text(INDEX + element)
    assert [one for one in problems_of(site) if says in one]


def test_a_heavy_first_page_and_a_heavy_film_are_told(site):
    (site / "p.png").write_bytes(bytes(FIRST))
    (site / "long.mp4").write_bytes(bytes(MOST + 1))
    assert sorted(one.partition(":")[0] for one in problems_of(site)) == ["index.html", "long.mp4"]


def test_a_folder_without_a_site_is_told(tmp_path):
    assert problems_of(tmp_path) == [f"{tmp_path}: has no index.html"]


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
def found(tmp_path_factory):
    """A site's faults by page, and the folder of its pictures."""
    if not any(map(shutil.which, browser.BROWSERS)):
        pytest.skip("no chromium on this machine")
    from playwright import sync_api as playwright

    site = tmp_path_factory.mktemp("site")
    shots = tmp_path_factory.mktemp("shots")
    links = f"<a href={next(iter(browser.ASKED.values()))}.html>first</a>"  # for each query
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


def test_a_page_without_faults_has_none(found):
    assert found[0]["clean.html"] == []


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(found, name):
    assert any(FAULTS[name][1] in line for line in found[0][name]), found[0][name]


def test_a_search_whose_first_result_is_another_page_is_a_fault(found):
    wrong = [line.split(" ")[1].strip("'") for line in found[0]["search.html"]]
    assert wrong == [words.split(" ")[0] for words in list(browser.ASKED)[1:]]


def test_searches_of_the_built_site_find_their_pages():
    site = ROOT / "docs" / "_build" / "html"
    scorer = "_static/scorer.js"
    if not (site / scorer).exists() or (site / scorer).read_text() != (ROOT / "docs" / scorer).read_text():
        pytest.skip("no site of today for chromium to search: make docs")
    if missing := browser.missing_browser():
        pytest.skip(missing)
    assert browser.look(site, None, pages=False) == []


@pytest.mark.parametrize(
    ("plain", "shown"),
    [
        ("p ~ tau^alpha eta^beta (eq. 1)", r"p ∝ τ\ :sup:`α`\  η\ :sup:`β`\  (eq. 1)"),
        ("[m/s^2], d_goal^2", r"[m/s\ :sup:`2`\ ], d\ :sub:`goal`\ \ :sup:`2`\ "),
        (":ivar k_att: gain, 50 x 50 cells, v <= 2", ":ivar k_att: gain, 50 × 50 cells, v ≤ 2"),
        ("`k_att^2`, max_steps, a sqrt(2)", "`k_att^2`, max_steps, a √2"),
    ],
)
def test_formulas_of_docstrings_are_typeset(plain, shown):
    assert typeset(plain) == shown


def test_formulas_are_typeset_in_markdown():
    assert typeset("clamped to tau_max [m/s^2]", HTML) == "clamped to τ<sub>max</sub> [m/s<sup>2</sup>]"


def test_a_class_named_by_its_package_leads_to_its_own_page(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_ext"))
    (tmp_path / "reference" / "api" / "robots").mkdir(parents=True)
    (tmp_path / "reference" / "api" / "robots" / "Lidar.rst").touch()
    text = "[`Lidar`](reference/api/robots.md), [`x`](reference/api/robots.md)"
    adapted = importlib.import_module("antdrive_links").adapted(text, tmp_path / "a.md", tmp_path)
    assert adapted == "[`Lidar`](reference/api/robots/Lidar.rst), [`x`](reference/api/robots.md)"


def test_pages_have_pictures(found):
    assert {path.name for path in found[1].glob("clean-*")} == {
        f"clean-{theme}-{width}.png" for theme, width in browser.KEPT
    }
