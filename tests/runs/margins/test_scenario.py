"""Scenarios whose margin is chosen: under which conditions, and for how long the choice counts."""

import dataclasses
from pathlib import Path

import pytest
from joblib import Parallel, delayed

from antdrive.base.errors import FieldError
from antdrive.planners import load_planner
from antdrive.robots import PurePursuit, RobotSpec
from antdrive.runs.margins import choice
from antdrive.runs.margins.trial import Conditions, Loss
from antdrive.sim import Scenario


@pytest.fixture(autouse=True)
def made_up(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """An empty cache, and drives that all lose 2 cm for each unit of noise."""
    monkeypatch.setattr(choice, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(choice, "_driving", lambda c, *_: lambda margin: [Loss(0.02 * c.noise, 0.02 * c.noise)] * 80)


def test_a_margin_is_chosen_for_the_scenarios_own_settings(jackal: RobotSpec) -> None:
    controller = PurePursuit(lookahead_time=0.3)
    s = Scenario.of("empty", "astar", jackal, margin="auto", noise=2, smoothing="taut", controller=controller)
    assert s.chosen is not None
    assert s.margin == s.chosen.margin
    assert 0.05 <= s.margin <= 0.056
    assert s.conditions == Conditions(robot=jackal, controller=controller, noise=2.0, smoothing="taut")
    assert s.inflate == jackal.radius + s.margin


def test_a_choice_counts_as_long_as_its_conditions_hold(small_scenario: Scenario) -> None:
    s = small_scenario.with_chosen_margin()
    assert s.chosen is not None
    assert dataclasses.replace(s, seed=5).chosen == s.chosen
    assert dataclasses.replace(s, planner=load_planner("ants")).chosen == s.chosen
    assert dataclasses.replace(s, margin=s.margin + 0.001).chosen is None
    assert dataclasses.replace(s, noise=1.0).chosen is None
    assert dataclasses.replace(s, smoothing="none").chosen is None
    assert small_scenario.chosen is None


def test_plans_in_space_and_time_are_not_smoothed(turtlebot: RobotSpec) -> None:
    assert Scenario.of("plaza-moving", "sipp", turtlebot).conditions.smoothing == "none"
    assert Scenario.of("plaza-moving", "astar", turtlebot).conditions.smoothing == "clearance"


def test_words_other_than_auto_are_no_margin(small_scenario: Scenario) -> None:
    with pytest.raises(FieldError, match="margin: must be a number, got 'wide'"):
        Scenario.of(small_scenario.task, margin="wide")  # type: ignore[arg-type]
    with pytest.raises(FieldError, match="calibration: must be a Calibration"):
        dataclasses.replace(small_scenario, calibration=0.03)  # type: ignore[arg-type]


def threads_within_a_pool(conditions: Conditions) -> int:
    """How many threads drove in a process of a pool."""
    import threading

    used = set()

    def drive(conditions: Conditions, margin: float, seed: int) -> Loss:
        used.add(threading.get_ident())
        return Loss(0.0, 0.0)

    choice.loss_on_course = drive
    choice._driving(conditions, 2, None)(0.05)
    return len(used)


@pytest.mark.slow
def test_within_a_process_of_a_pool_one_thread_drives(small_scenario: Scenario) -> None:
    calls = [delayed(threads_within_a_pool)(small_scenario.conditions) for _ in range(2)]
    assert Parallel(2)(calls) == [1, 1]
