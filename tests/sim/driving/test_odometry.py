"""Odometry rebuilt from logs: what the robot measured, and how well it knew."""

from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import Twist, load_robot
from antdrive.robots.spec import Noise
from antdrive.sim import run
from antdrive.sim.driving.odometry import odometry_of
from antdrive.sim.driving.senses import NoisySenses
from antdrive.sim.log.consistency import wheel_speeds
from antdrive.sim.physics.engine import State


@pytest.fixture(scope="module")
def by_fixes(small_scenario):
    return run(replace(small_scenario, noise=1.0, seed=5)).rollout


@pytest.fixture(scope="module")
def reckoned(small_scenario):
    return run(replace(small_scenario, map="none", localisation="odometry", seed=5)).rollout


def periods(log):
    return np.arange(0, len(log.t), log.record.physics_hz // log.record.control_hz)


def test_uncorrected_dead_reckoning_is_rebuilt_as_the_robot_had_it(reckoned):
    found, rows = odometry_of(reckoned), periods(reckoned)
    assert np.abs(found.pose - reckoned.estimate)[rows].max() < 1e-9
    assert np.abs(found.pose - reckoned.pose).max() > 1e-3
    assert np.array_equal(found.estimate_covariance, found.pose_covariance)


def test_fixes_do_not_enter_odometry(by_fixes):
    found = odometry_of(by_fixes)
    steps = np.hypot(*np.diff(found.pose[:, :2], axis=0).T) * by_fixes.record.physics_hz
    assert np.abs(steps - np.abs(found.twist[1:, 0])).max() < 1e-3, "odometry is continuous"
    jumps = np.hypot(*np.diff(by_fixes.estimate[:, :2], axis=0).T) * by_fixes.record.physics_hz
    assert jumps.max() > 2 * steps.max()
    assert np.allclose(found.wheels, wheel_speeds(found.twist, by_fixes.record.robot.track))


@pytest.mark.parametrize("drive", ["by_fixes", "reckoned"])
def test_covariances_grow_from_an_exact_start_and_are_positive_semi_definite(drive, request):
    found = odometry_of(request.getfixturevalue(drive))
    assert not found.pose_covariance[0].any()
    yaw = found.pose_covariance[:, 2, 2]
    assert (np.diff(yaw) >= 0).all()
    assert yaw[-1] > 0
    for covariance in (found.pose_covariance, found.twist_covariance, found.estimate_covariance):
        assert np.abs(covariance - covariance.transpose(0, 2, 1)).max() < 1e-12
        assert np.linalg.eigvalsh(covariance).min() > -1e-12


def test_without_noise_odometry_is_the_true_motion(small_run):
    log = small_run.rollout
    found = odometry_of(log)
    assert np.array_equal(found.pose, log.pose)
    assert np.array_equal(found.twist, log.twist)
    assert not any(c.any() for c in (found.pose_covariance, found.twist_covariance, found.estimate_covariance))
    assert np.array_equal(odometry_of(replace(log, actuated=log.command)).pose, log.pose)


def test_the_covariance_is_the_spread_of_the_simulated_errors(by_fixes):
    log = replace(by_fixes, **{name: getattr(by_fixes, name)[:481] for name in ("t", "pose", "twist", "command")})
    log = replace(log, actuated=by_fixes.actuated[:481], estimate=by_fixes.estimate[:481])
    ends = [odometry_of(replace(log, record=replace(log.record, seed=seed))) for seed in range(24)]
    spread = np.std([found.pose[-1] for found in ends], axis=0)
    told = np.sqrt(np.mean([np.diagonal(found.pose_covariance[-1]) for found in ends], axis=0))
    assert np.all(np.abs(np.log(spread / told)) < np.log(1.6))


def test_encoders_and_odometry_are_exact_without_errors():
    robot = load_robot("turtlebot")
    senses = NoisySenses(Noise(), robot.track, 0.02, 0)
    odometry, fix = senses.read(State(1.0, 2.0, 0.5, *senses.actuate(Twist(0.4, 0.2))))
    assert senses.encoders == odometry == pytest.approx((0.4, 0.2))
    assert fix == (1.0, 2.0, 0.5)
