"""`antdrive shrink`."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from antdrive.planners import load_planner
from antdrive.runs.suites import Baseline, load_suite
from antdrive.sim import run
from antdrive.worlds import Disc, load_task


@pytest.fixture
def collided(collided_run, tmp_path):
    """The log of a drive into an unseen cylinder, beside another one and an obstacle out of the way."""
    scenario = collided_run.scenario
    rollout = run(replace(scenario, unseen=(*scenario.unseen, Disc(3.6, 0.4, 0.1)), margin=0.04)).rollout
    return rollout.save(tmp_path / "collided.npz")


@pytest.mark.slow
def test_a_failure_becomes_a_world_and_a_suite(antdrive, collided, tmp_path):
    other = tmp_path / "out" / "small-small" / "shrink.json"
    other.parent.mkdir(parents=True)
    other.write_text('{"fingerprint": "of another failure in this world"}')
    code, out, err = antdrive("shrink", collided, "--json", "--no-figures")
    assert (code, err) == (0, "")
    assert list(other.parent.iterdir()) == [other]
    facts = json.loads(out)
    assert (facts["failure"]["outcome"], facts["failure"]["touched"]) == ("collided", "unseen cylinder")
    assert (facts["complete"], facts["repeats"]) == (True, True)
    (folder,) = (tmp_path / "out").glob("small-small-????????")
    written = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    name = "small-small"
    files = {
        f"{name}.drive.yaml",
        "journal.json",
        "drive.html",
        "shrink.json",
        "result.json",
        "rollout.npz",
        f"worlds/{name}.yaml",
    }
    assert written == files
    assert load_task(folder / "worlds" / f"{name}.yaml").world.obstacles == ()
    suite = folder / f"{name}.drive.yaml"
    assert antdrive("check", suite, "--jobs", "1")[0] == 0, "the suite expects the failure"
    code, out, _ = antdrive("shrink", f"{suite}::{name}", "--out", "again", "--no-figures")
    assert code == 0
    assert "no smaller after" in out


@pytest.mark.slow
def test_the_small_failure_has_a_page_and_a_second_call_asks_the_journal(antdrive, collided):
    assert antdrive("shrink", collided, "--out", "small", "--no-figures")[0] == 0
    code, out, _ = antdrive("shrink", collided, "--out", "small")
    assert code == 0
    assert "smaller after 0 runs" in out
    assert Path("small/drive.html").is_file()


def test_a_log_of_a_planner_that_is_not_registered_cannot_be_shrunk(refused, small_run, tmp_path):
    rollout = run(replace(small_run.scenario, planner_name="mine")).rollout
    mine = rollout.save(tmp_path / "mine.npz")
    assert f"{mine}: record.planner.name: 'mine' is not registered" in refused("shrink", mine)


@pytest.mark.slow
def test_a_planner_from_a_file_goes_with_the_suite(antdrive, tmp_path):
    """The planner of the test has its file beside the first suite; the suite of the small failure finds it there."""
    (tmp_path / "own.py").write_text("from antdrive.planners.graph.search import AStar\nclass Mine(AStar):\n    pass\n")
    (tmp_path / "a.drive.yaml").write_text(
        "schema: 1\nscenarios:\n  hit: {world: empty, planner: 'own.py:Mine', unseen: [{x: 3, y: 3, radius: 0.2}]}\n"
    )
    code, out, err = antdrive(
        "shrink", "a.drive.yaml::hit", "--out", "deep/small", "--no-figures", "--jobs", "2", "--json"
    )
    assert (code, err) == (0, "")
    assert json.loads(out)["repeats"]
    (case,) = load_suite(tmp_path / "deep" / "small" / "empty-small.drive.yaml")
    assert case.entry.planner == "../../own.py:Mine"


@pytest.mark.slow
def test_the_log_of_a_planner_from_a_file_is_shrunk_with_that_file(antdrive, refused, collided_run, tmp_path):
    (tmp_path / "own.py").write_text(
        "from dataclasses import dataclass\nfrom antdrive.planners.graph.search import AStar\n"
        "@dataclass(frozen=True)\nclass Mine(AStar):\n    calm: float = 1.0\nclass Other(AStar):\n    pass\n"
    )
    mine = load_planner("own.py:Mine", calm=0.5)
    rollout = run(replace(collided_run.scenario, planner=mine, planner_name="Mine")).rollout
    rollout.save(tmp_path / "log.npz")
    assert "--planner FILE.py:CLASS" in refused("shrink", "log.npz")
    assert "the log's planner is 'Mine', not 'Other'" in refused("shrink", "log.npz", "-p", "own.py:Other")
    assert "write FILE.py:CLASS or MODULE:CLASS, got 'Mine'" in refused("shrink", "log.npz", "-p", "Mine")
    code, out, err = antdrive("shrink", "log.npz", "-p", "own.py:Mine", "--out", "deep/small", "--no-figures", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["repeats"]
    (case,) = load_suite(next((tmp_path / "deep" / "small").glob("*.drive.yaml")))
    assert case.entry.planner == {"name": "../../own.py:Mine", "calm": 0.5}


@pytest.mark.slow
def test_a_test_that_fails_by_its_bound_is_shrunk_until_it_would_keep_it(antdrive, small):
    """The bound is on the route's length, which no drive changes: two runs of the test itself, and quick ones after it."""
    text = "{schema: 1, scenarios: {a: {world: small.yaml, planner: astar, expect: {spl: '>= 0.999'}}}}"
    (small.parent / "a.drive.yaml").write_text(text)
    code, out, err = antdrive("shrink", "a.drive.yaml::a", "--json", "--no-figures", "--seconds", "1")
    assert (code, err) == (0, "")
    assert json.loads(out)["failure"] == {
        "outcome": "succeeded",
        "touched": "nothing",
        "cause": "spl < 0.999",
        "reason": "",
    }
    (case,) = load_suite(next(Path("out/small-small").glob("*.drive.yaml")))
    assert case.entry.expect == {"outcome": "succeeded", "certified": True, "spl": "< 0.999"}


@pytest.mark.slow
def test_a_test_that_fails_by_its_baseline_is_shrunk_while_it_is_worse(antdrive, small, small_run):
    suite = small.parent / "a.drive.yaml"
    suite.write_text("{schema: 1, scenarios: {a: {world: small.yaml, planner: astar}}}")
    made = Baseline.of(small_run, "a[0]")
    replace(made, metrics={**made.metrics, "spl": 2.0}).save(small.parent / "baselines" / "a" / "a-0.json")
    code, out, err = antdrive("shrink", "a.drive.yaml::a", "--json", "--no-figures", "--seconds", "1")
    assert (code, err) == (0, "")
    assert json.loads(out)["failure"] == {
        "outcome": "succeeded",
        "touched": "nothing",
        "cause": "spl < 1.99",
        "reason": "",
    }


def test_the_folder_of_a_run_stands_for_its_log(refused, small_run, tmp_path):
    small_run.rollout.save(tmp_path / "run" / "rollout.npz")
    assert "small: this run does not fail" in refused("shrink", "run")
    (tmp_path / "none").mkdir()
    (tmp_path / "none" / "result.json").touch()
    assert "none: contains no rollout.npz; its run ended before the robot drove" in refused("shrink", "none")
