"""`antdrive barn`, without its drives."""

import json

import numpy as np
import pyarrow
import pytest

from antdrive.runs.campaigns import campaign, notation, sweeping  # noqa: F401
from antdrive.runs.campaigns.results import SweepResults

RUN = {"world": "world_0", "seed": 0, "map": "none", "robot": "jackal", "planner": "astar"}
ENDS = (
    {"key": "a", "succeeded": True, "outcome": "arrived", "reason": None, "rollout": None},
    {"key": "b", "succeeded": False, "outcome": "collided", "reason": "obstacles[3]", "rollout": "rollouts/b.npz"},
)


@pytest.fixture
def driven(monkeypatch, tmp_path, compiled):
    """A folder of the challenge whose two runs, one of which failed, count as driven."""
    (tmp_path / "world_0.world").touch()

    def sweep(_campaign, folder, **_settings):
        return SweepResults(
            folder, pyarrow.Table.from_pylist([{**RUN, "arrival_s": 10.0, "barn": 0.5, **end} for end in ENDS]), 2
        )

    # All three modules are imported above: one that is first imported here would keep what another is given for the test.
    monkeypatch.setattr(campaign, "make_campaign", lambda data, **_words: data)
    monkeypatch.setattr(sweeping, "sweep", sweep)
    return tmp_path


def test_the_table_is_printed_and_each_failure_with_its_log(driven, antdrive):
    lines = antdrive("barn", driven)[1].splitlines()
    assert ["world_0", "2", "1", "10.00"] in [line.split()[:4] for line in lines]
    assert "  DWA, 0.5 m/s: github.com/Daffan/the-barn-challenge, res/dwa_out.txt" in lines
    assert lines[-1] == "  world_0, seed 0: collided  obstacles[3]  rollouts/b.npz"


def test_the_localisation_follows_the_map(driven, antdrive, monkeypatch):
    given = []
    monkeypatch.setattr(campaign, "make_campaign", lambda data, **_words: given.extend(data["settings"]))
    for words in ((), ("--map", "given")):
        antdrive("barn", driven, *words)
    assert [each["localisation"] for each in given] == ["matching", "fixes"]


@pytest.fixture
def log(tmp_path):
    """A log with two of its trials, beside the path file of its world: cells straight ahead, OT 5 s."""
    (tmp_path / "paths").mkdir()
    np.save(tmp_path / "paths" / "path_6.npy", np.array([(15.5, 0), (15.5, 29)]))
    path = tmp_path / "log.txt"
    path.write_text("6 1 0 0 15.0 0.3333\n6 0 1 0 3.0 0.0000\n")
    return path


def test_a_log_is_scored_by_both_formulas_and_its_gaps_are_named(log, antdrive):
    code, out, _ = antdrive("barn", "paths", "--score", log)
    lines = out.splitlines()
    assert (code, lines[0]) == (1, f"score 0.1667  {log}: 2 trials, worlds: 1")  # (5/15 + 0) / 2
    assert lines[1] == "  50.0 % succeeded, 50.0 % collided, 0.0 % timed out, mean time 15.0000 s"
    assert lines[2].startswith("  incomplete: 1 of the 50 public worlds; missing: 0, 12, 18")
    assert lines[3] == "  incomplete: worlds with fewer than 10 trials: 6 (2)"
    assert [line.split()[:5] for line in lines[6:8]] == [
        ["2", "to", "8", "OT", "0.1667"],
        ["4", "to", "8", "OT", "0.1250"],  # 5/20
    ]
    facts = json.loads(antdrive("barn", "paths", "--score", log, "--json")[1])
    assert facts["scores"] == {"2 to 8 OT": pytest.approx(1 / 6), "4 to 8 OT": 0.125}
    assert len(facts["published"]) == 5


def test_a_log_that_cannot_be_scored_is_refused_in_one_line(log, refused):
    assert "drives nothing" in refused("barn", "paths", "--score", log, "--with-map")
    log.write_text("6 1 0 0 15.0\n6 1 0 0\n")
    assert "log.txt: line 2: must be WORLD SUCCESS" in refused("barn", "paths", "--score", log)
    (log.parent / "paths" / "path_6.npy").unlink()
    log.write_text("6 1 0 0 15.0\n")
    assert "no path_*.npy here" in refused("barn", "paths", "--score", log)
