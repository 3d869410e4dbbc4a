"""Small changes to a log, each just large enough for one of the certificate's checks."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from antdrive.planners import load_planner
from antdrive.robots import RobotSpec
from antdrive.sim import Outcome, Rollout, Run, Scenario, certify, run
from antdrive.sim.log.certificate import closed_form_clearance
from antdrive.worlds import Task, World

ROWS = ("t", "pose", "twist", "command", "clearance", "limiter", "movers")


@pytest.fixture
def log(small_run: Run) -> Rollout:
    assert small_run.rollout is not None
    assert certify(small_run.rollout).certified
    return with_record(small_run.rollout, digest=None)


def with_record(log: Rollout, **changes: Any) -> Rollout:
    return replace(log, record=replace(log.record, **changes))


def cut(log: Rollout, end: int) -> Rollout:
    return replace(log, **{key: getattr(log, key)[:end] for key in ROWS})


def problems(log: Rollout) -> str:
    return "; ".join(certify(log).problems)


def test_a_log_that_ends_within_the_tolerance_at_speed_is_no_success(log: Rollout) -> None:
    left = np.hypot(*(log.pose[:, :2] - log.record.task.goal).T)
    first = int((left <= log.record.task.goal_tolerance).argmax())
    assert abs(log.twist[first, 0]) > 0.05
    assert "still moves at" in problems(cut(log, first + 1))


@pytest.mark.parametrize("turn", [-0.1, 0.02, math.pi])
def test_a_start_with_another_heading_is_another_start(log: Rollout, turn: float) -> None:
    x, y, yaw = log.record.task.start
    moved = with_record(log, task=replace(log.record.task, start=(x, y, yaw + turn)))
    assert "not the task's start" in problems(moved)


@pytest.mark.parametrize("error", [1e-6, -1e-6])
def test_a_clearance_that_is_a_micrometre_off_is_noticed(log: Rollout, error: float) -> None:
    clearance = log.clearance.copy()
    clearance[300] += error
    assert "closed form says" in problems(replace(log, clearance=clearance))


def test_a_row_five_millimetres_aside_is_noticed(log: Rollout) -> None:
    pose = log.pose.copy()
    pose[300, 1] += 0.005
    aside = replace(log, pose=pose)
    aside = replace(aside, clearance=closed_form_clearance(aside))
    assert "do not follow from the measured speed" in problems(aside)


def test_a_yaw_rate_that_the_heading_does_not_follow_is_noticed(log: Rollout) -> None:
    """The footprint is a disc, so that no clearance shows it."""
    twist = log.twist.copy()
    twist[300:305, 1] += 1.0
    assert "do not follow from the measured speed" in problems(replace(log, twist=twist))


@pytest.mark.parametrize(("apart", "agree"), [(0.008, True), (0.03, False)])
def test_a_contact_that_is_felt_three_centimetres_apart_is_a_disagreement(
    collided_run: Run, apart: float, agree: bool
) -> None:
    """The robot of the log is made thinner, as if physics felt what the closed form does not."""
    log = collided_run.rollout
    assert log is not None
    robot = log.record.robot
    row = int(log.contacts[0, 0])
    shrink = apart - float(log.clearance[max(0, row - 1) : row + 2].min())
    foot = replace(robot.footprint, rounding=robot.footprint.rounding - shrink)
    thin = with_record(log, digest=None, robot=replace(robot, footprint=foot))
    thin = replace(thin, clearance=closed_form_clearance(thin))
    assert any("readings disagree: physics reports a contact" in p for p in certify(thin).problems) is not agree


def test_a_turn_on_the_spot_lowers_the_bound(turtlebot: RobotSpec) -> None:
    """Between two rows a point of the footprint may come nearer by half of radius x turn."""
    task = Task(World("w", (0.0, 0.0, 6.0, 3.0)), (5.0, 1.5, 0.0), (1.0, 1.5), cell=0.1)
    log = run(Scenario(task=task, planner=load_planner("astar"), robot=turtlebot, time_limit=0.8)).rollout
    assert log is not None
    assert np.abs(log.pose[:, :2] - (5.0, 1.5)).max() < 1e-3
    fastest = float(np.abs(np.diff(log.pose[:, 2])).max())
    assert fastest > 0.005
    certificate = certify(log)
    assert certificate.bound < certificate.min_clearance - 0.9 * turtlebot.footprint.radius * fastest / 2
    assert log.outcome is Outcome.TIMED_OUT
    assert certificate.certified
