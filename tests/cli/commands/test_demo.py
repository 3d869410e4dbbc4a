"""`antdrive demo`."""

import shlex
import sys
from pathlib import Path

import pytest

from antdrive.cli.commands import demo

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def compared(monkeypatch):
    """The words that `antdrive compare` is called with; it fails if they are refused, and otherwise makes the film alone."""
    words: list[dict] = []

    def compare(**given):
        words.append(given)
        given["film"].parent.mkdir(parents=True)
        given["film"].touch()
        return 0

    from antdrive.cli.commands import compare as module

    compare.__signature__, compare.__annotations__ = module.compare.__signature__, module.compare.__annotations__
    monkeypatch.setattr(module, "compare", compare)
    return words


@pytest.mark.parametrize(("platform", "opener"), [("linux", "xdg-open"), ("darwin", "open"), ("win32", 'start ""')])
def test_the_last_line_opens_the_film(antdrive, compared, monkeypatch, platform, opener):
    monkeypatch.setattr(sys, "platform", platform)
    code, out, err = antdrive("demo", "--out", "my films")
    assert (code, err) == (0, "")
    assert out.splitlines()[-1] == f"{opener} 'my films/film.mp4'"


def test_it_compares_ants_with_a_star_and_films_both(antdrive, compared):
    assert antdrive("demo")[0] == 0
    (given,) = compared
    assert (given["worlds"], given["planner"], given["out"]) == (["forest"], ["mmas", "astar"], Path("out/demo"))


def test_a_failure_is_no_film(antdrive, monkeypatch):
    monkeypatch.setattr(demo, "WORDS", "compare no-path --planner mmas --planner astar --no-figures")
    code, out, _ = antdrive("demo")
    assert code == 1
    assert "film.mp4" not in out


def test_make_demo_is_the_command():
    (recipe,) = [
        line for line in (ROOT / "Makefile").read_text().splitlines() if line.startswith("\t") and "demo" in line
    ]
    assert shlex.split(recipe)[1:] == ["demo"]
