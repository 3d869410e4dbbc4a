"""Scenarios whose margin is chosen: under which conditions, and for how long the choice counts."""

import dataclasses

import pytest

from antdrive.base.errors import FieldError
from antdrive.planners import load_planner
from antdrive.robots import PurePursuit
from antdrive.runs.margins import choice
from antdrive.runs.margins.trial import Conditions, Loss
from antdrive.sim import Scenario


@pytest.fixture(autouse=True)
def made_up(monkeypatch, tmp_path):
    """An empty cache, and drives that all lose 2 cm for each unit of noise."""
    monkeypatch.setattr(choice, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(choice, "_driving", lambda c, *_: lambda margin: [Loss(0.02 * c.noise, 0.02 * c.noise)] * 80)


def test_a_margin_is_chosen_for_the_scenarios_own_settings(jackal):
    controller = PurePursuit(lookahead_time=0.3)
    s = choice.with_chosen_margin(
        Scenario.of("empty", "astar", jackal, noise=2, smoothing="taut", controller=controller)
    )
    assert s.chosen is not None
    assert s.margin == s.chosen.margin
    assert 0.05 <= s.margin <= 0.056
    assert Conditions.of(s) == Conditions(robot=jackal, controller=controller, noise=2.0, smoothing="taut")
    assert s.inflate == jackal.radius + s.margin


def test_a_choice_counts_as_long_as_its_conditions_hold(small_scenario):
    s = choice.with_chosen_margin(small_scenario)
    assert s.chosen is not None
    assert dataclasses.replace(s, seed=5).chosen == s.chosen
    assert dataclasses.replace(s, planner=load_planner("ants")).chosen == s.chosen
    assert dataclasses.replace(s, margin=s.margin + 0.001).chosen is None
    assert dataclasses.replace(s, noise=1.0).chosen is None
    assert dataclasses.replace(s, smoothing="none").chosen is None
    assert small_scenario.chosen is None


def test_plans_in_space_and_time_are_not_smoothed(turtlebot):
    assert Conditions.of(Scenario.of("plaza-moving", "sipp", turtlebot)).smoothing == "none"
    assert Conditions.of(Scenario.of("plaza-moving", "astar", turtlebot)).smoothing == "clearance"


def test_words_are_no_margin(small_scenario):
    with pytest.raises(FieldError, match="margin: must be a number, got 'wide'"):
        Scenario.of(small_scenario.task, margin="wide")
