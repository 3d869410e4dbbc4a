"""What goes wrong in a run is its result and not the campaign's end; logs are kept by rule; auto margins are chosen once."""

from __future__ import annotations

import dataclasses
import errno
from pathlib import Path
from typing import Any

import pytest

from antdrive import Rollout, load_task, save_task
from antdrive.base.errors import InputError
from antdrive.planners import PlannerError
from antdrive.robots import load_robot
from antdrive.runs.campaigns import expand, job, make_campaign, running, sweeping
from antdrive.runs.campaigns.running import Driving, log_path
from antdrive.runs.campaigns.sweeping import calibrated, sweep
from antdrive.runs.margins.prediction import Calibration
from antdrive.runs.margins.trial import Conditions

BASE = {"worlds": ["empty", "no-path"], "planners": ["astar"]}


@pytest.mark.parametrize(
    ("raised", "outcome", "reason"),
    [
        (PlannerError("mine", "raised ValueError"), "planner_fault", str(PlannerError("mine", "raised ValueError"))),
        (ZeroDivisionError("oh"), "crashed", "ZeroDivisionError: oh"),
    ],
)
def test_what_a_run_raises_is_its_result(
    raised: Exception, outcome: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(scenario: Any) -> None:
        raise raised

    monkeypatch.setattr(running, "run", fails)
    row = Driving()(expand(make_campaign(BASE)).jobs[0]).row
    assert (row["outcome"], row["reason"], row["succeeded"], row["certified"]) == (outcome, reason, False, None)


@pytest.mark.parametrize(("keep", "kept"), [("none", 0), ("failed", 0), ("all", 1)])
def test_logs_are_kept_by_rule_and_hold_what_the_row_says(keep: Any, kept: int, tmp_path: Path) -> None:
    rows = sweep({**BASE, "rollouts": keep}, tmp_path, jobs=0).table.to_pylist()
    assert [row["outcome"] for row in rows] == ["succeeded", "no_path"]
    assert [row["certified"] for row in rows] == [True, None]
    assert [row["spl"] is None for row in rows] == [False, True]
    logs = list(tmp_path.rglob("*.npz"))
    assert len(logs) == kept
    if kept:
        assert rows[0]["rollout"] == log_path(rows[0]["key"])
        assert Rollout.load(tmp_path / rows[0]["rollout"]).digest == rows[0]["digest"]


@pytest.mark.parametrize("folder", ["", None])
def test_a_log_that_cannot_be_written_is_no_crash_of_the_run(
    folder: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(log: Rollout, path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Rollout, "save", full)
    driving = Driving("all", None if folder is None else str(tmp_path))
    with pytest.raises(InputError, match=r"^rollouts/.*\.npz: cannot be written \(No space left on device\)$"):
        driving(expand(make_campaign(BASE)).jobs[0])


def test_a_planner_that_this_machine_lacks_ends_the_campaign(monkeypatch: pytest.MonkeyPatch) -> None:
    one = expand(make_campaign(BASE)).jobs[0]
    case = dataclasses.replace(one.case, planner_source="elsewhere")
    with pytest.raises(InputError, match="no planner is called 'elsewhere'"):
        Driving()(one._replace(case=case))


def test_the_log_of_a_failed_drive_is_kept(tmp_path: Path) -> None:
    hit = {
        **BASE,
        "worlds": "empty",
        "settings": {"unseen": [{"x": 3.0, "y": 3.0, "radius": 0.2}]},
        "rollouts": "failed",
    }
    (row,) = sweep(hit, tmp_path, jobs=0).table.to_pylist()
    assert row["outcome"] == "collided"
    assert (tmp_path / row["rollout"]).exists()
    assert "--unseen 3.0,3.0,0.2" in row["command"]


def test_an_auto_margin_is_chosen_once_for_each_robot_and_its_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def choose(conditions: Conditions) -> Calibration:
        asked.append((conditions.robot.name, conditions.noise))
        return Calibration(
            margin=0.07, loss=0.05, largest=0.04, reserve=0.01, probability=1e-3, drives=100, key=conditions.key
        )

    monkeypatch.setattr(sweeping, "choose_margin", choose)
    campaign = {**BASE, "robots": ["turtlebot", "jackal"], "noise": [0, 1], "margin": [0.03, "auto"], "seeds": 2}
    jobs = calibrated(expand(make_campaign(campaign)).jobs)
    assert sorted(asked) == [("jackal", 0.0), ("jackal", 1.0), ("turtlebot", 0.0), ("turtlebot", 1.0)]
    assert len({one.key for one in jobs}) == len(jobs) == 2 * 2 * 2 * 2 * 2
    auto = [one for one in jobs if one.case.fields["margin"] == "auto"]
    assert {one.case.scenario(one.seed).margin for one in auto} == {0.07}
    assert all(one.case.scenario(one.seed).chosen is not None for one in auto)
    assert {sweeping.grid_table([one])["margin"][0].as_py() for one in auto} == {0.07}


def test_a_robot_of_ones_own_comes_along_with_the_folder(tmp_path: Path) -> None:
    source = tmp_path / "mine.yaml"
    catalogue = Path(job.__file__).parents[2] / "robots" / "catalog" / "turtlebot.yaml"
    source.write_text(catalogue.read_text().replace("mass: ", "mass: 1"))
    save_task(load_task("empty"), tmp_path / "w.yaml")
    campaign = make_campaign({"worlds": "w.yaml", "planners": "astar", "robots": "mine.yaml"}, tmp_path)
    (row,) = sweep(campaign, tmp_path / "out", jobs=0).table.to_pylist()
    word = row["command"].split("--robot ")[1].split()[0]
    assert load_robot(tmp_path / "out" / word) == load_robot(source)
