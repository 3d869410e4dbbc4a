"""Robots of low yaw acceleration hold a straight line in spite of noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import Footprint, load_robot
from antdrive.robots.spec import Noise
from antdrive.sim import Scenario, run
from antdrive.sim.log.metrics import tracking_error
from antdrive.worlds import Task, World

LANE = Task(World("lane", (0.0, 0.0, 20.0, 3.0)), (1.0, 1.5, 0.0), (19.0, 1.5), cell=0.25, goal_tolerance=0.05)
NOISE = Noise(pose_xy=0.01, pose_yaw=0.01, pose_rate=20.0, encoder=0.02, slip=0.02, delay=0.1)


def heavy(**values):
    """A carrier of 150 kg at 2 m/s and 1 rad/s^2, with other `values`."""
    usual = {"mass": 150.0, "track": 0.5, "max_speed": 2.0, "max_acceleration": 0.25, "max_yaw_acceleration": 1.0}
    return replace(
        load_robot("husky"), name="heavy", footprint=Footprint.rectangle(0.8, 0.6), wheel_radius=0.1, max_yaw_rate=1.5,
        max_lateral_acceleration=0.6, max_wheel_speed=40.0, wheel_torque=80.0, **{"noise": NOISE, **usual, **values},
    )  # fmt: skip


def farthest(robot, seed):
    """Return the largest distance from the line [m]."""
    done = run(Scenario.of(LANE, "astar", robot, noise=1.0, seed=seed))
    assert done.succeeded, (done.outcome, done.reason)
    return float(np.abs(tracking_error(done.rollout)).max())


@pytest.mark.parametrize("seed", [0, 3])
def test_a_heavy_robot_keeps_within_3_cm_of_a_straight_line(seed):
    assert farthest(heavy(), seed) <= 0.03


def test_a_heavy_robot_is_slower_only_with_noise():
    """Both drives have one route and one margin, in one process."""
    with_noise, without = (
        run(Scenario.of(LANE, "astar", heavy(), noise=noise, margin=0.05)).rollout for noise in (1.0, 0.0)
    )
    assert with_noise.command[:, 0].max() == pytest.approx(1.105, abs=1e-3)
    assert without.command[:, 0].max() > 1.8


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_any_heavy_robot_keeps_within_6_cm_of_a_straight_line(seed):
    rng = np.random.default_rng(seed)
    robot = heavy(
        mass=float(rng.uniform(50, 300)), track=float(rng.uniform(0.4, 0.55)), max_speed=float(rng.uniform(0.5, 2.5)),
        max_acceleration=float(rng.uniform(0.25, 1.0)), noise=replace(NOISE, delay=float(rng.uniform(0.0, 0.2))),
        max_yaw_acceleration=math.exp(rng.uniform(math.log(0.3), math.log(3.0))),
    )  # fmt: skip
    assert farthest(robot, seed) <= 0.06
