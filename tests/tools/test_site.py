"""The check of the site that was built finds what is broken, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.site import MOST, problems_of

INDEX = '<a href="a/b.html#here">b</a><a href="#top">up</a><a href="https://elsewhere.org">out</a><img src="p.png">'


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "a").mkdir()
    (tmp_path / "index.html").write_text(INDEX)
    (tmp_path / "a" / "b.html").write_text('<h1 id="here">b</h1><a href="../index.html">back</a>')
    (tmp_path / "p.png").write_bytes(b"png")
    return tmp_path


def test_a_whole_site_has_no_problem(site: Path) -> None:
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
def test_what_is_broken_is_told(site: Path, element: str, says: str) -> None:
    (site / "index.html").write_text(INDEX + element)
    assert [one for one in problems_of(site) if says in one]


def test_a_heavy_first_page_and_a_heavy_film_are_told(site: Path) -> None:
    (site / "p.png").write_bytes(bytes(MOST))
    (site / "long.mp4").write_bytes(bytes(MOST + 1))
    assert sorted(one.partition(":")[0] for one in problems_of(site)) == ["index.html", "long.mp4"]


def test_a_folder_without_a_site_is_told(tmp_path: Path) -> None:
    assert problems_of(tmp_path) == [f"{tmp_path}: has no index.html"]
