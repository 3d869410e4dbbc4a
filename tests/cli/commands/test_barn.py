"""`antdrive barn`, without its drives."""

import importlib
from pathlib import Path

import pyarrow
import pytest

from antdrive.base.errors import InputError
from antdrive.runs.campaigns import campaign, sweeping
from antdrive.runs.campaigns.results import SweepResults

RUN = {"world": "world_0", "seed": 0, "map": "none", "robot": "jackal", "planner": "astar"}
ENDS = (
    {"key": "a", "succeeded": True, "outcome": "arrived", "reason": None, "rollout": None},
    {"key": "b", "succeeded": False, "outcome": "collided", "reason": "obstacles[3]", "rollout": "rollouts/b.npz"},
)

films = importlib.import_module("antdrive.views.film.video")


@pytest.fixture
def driven(monkeypatch, tmp_path, compiled):
    """A folder of the challenge whose two runs, one of which failed, count as driven."""
    (tmp_path / "world_0.world").touch()

    def sweep(_campaign, folder, **_settings):
        return SweepResults(
            folder, pyarrow.Table.from_pylist([{**RUN, "arrival_s": 10.0, "barn": 0.5, **end} for end in ENDS]), 2
        )

    # Both modules are imported above: one that is first imported here would keep what the other is given for the test.
    monkeypatch.setattr(campaign, "make_campaign", lambda data, **_words: data)
    monkeypatch.setattr(sweeping, "sweep", sweep)
    return tmp_path


def test_the_table_is_printed_whatever_becomes_of_the_films(driven, antdrive, monkeypatch):
    def full(*_words, **_settings):
        raise InputError("films: cannot be written (No space left on device)")

    monkeypatch.setattr(films, "film_failures", full)
    code, out, err = antdrive("barn", driven, "--film")
    assert (code, err.splitlines()[-1]) == (2, "antdrive: films: cannot be written (No space left on device)")
    assert ["world_0", "2", "1", "10.00"] in [line.split()[:4] for line in out.splitlines()]
    assert "  DWA, 0.5 m/s: github.com/Daffan/the-barn-challenge, res/dwa_out.txt" in out.splitlines()


def test_a_failure_is_listed_with_its_film_or_its_log(driven, antdrive, monkeypatch):
    monkeypatch.setattr(films, "film_failures", lambda *_words, **_settings: {"b": Path("b.mp4")})
    ends = [antdrive("barn", driven, *words)[1].splitlines()[-1] for words in ((), ("--film",))]
    assert ends == [f"  world_0, seed 0: collided  obstacles[3]  {end}" for end in ("rollouts/b.npz", "b.mp4")]
