"""The pose filter is the least-squares solution, and as certain as it is accurate."""

import dataclasses
import math

import numpy as np
import pytest

from antdrive.robots import Noise, Odometry, Twist
from antdrive.robots.noise import SLIP_TIME
from antdrive.robots.spec import SAMPLE_RATE
from antdrive.sim.driving.localising import Exact, Fixes, Fused, Reckoned
from antdrive.sim.driving.senses import NoisySenses, positioning
from antdrive.sim.physics.engine import State
from antdrive.sim.sensing.pose_filter import PoseFilter

PERIOD, TRACK, STEPS, EVERY = 0.05, 0.4, 40, 4
#: So small that the curvature of the motion does not matter.
SMALL = Noise(pose_xy=1e-5, pose_yaw=2e-5, encoder=2e-5, slip=4e-5)
GYRO = Odometry(speed_scale=1e-5, yaw_scale=2e-5, gyro_bias=5e-6, speed_noise=2e-5, gyro_noise=2e-5)
TWISTS = [(1.0, 0.8 * math.sin(0.3 * k)) for k in range(STEPS)]


def true_poses(draws, gyro):
    """The poses of a robot that measures `TWISTS`, by independent standard normal draws of all its errors."""
    draws = iter(draws)
    scale, turn, bias = (next(draws) * (level if gyro else 0) for level in (1e-5, 2e-5, 5e-6))
    keep, slip, poses, (x, y, yaw) = math.exp(-PERIOD / SLIP_TIME), np.zeros(2), [], (0.0, 0.0, 0.0)
    for speed, rate in TWISTS:
        slip = keep * slip + 4e-5 * math.sqrt(1 - keep**2) * np.array([next(draws), next(draws)])
        seen = np.array([speed - rate * TRACK / 2, speed + rate * TRACK / 2])
        left, right = seen * (1 + slip - 2e-5 * np.array([next(draws), next(draws)]))
        v, w = (left + right) / 2, (right - left) / TRACK
        louder, sample_v, sample_w = 2e-5 / math.sqrt(SAMPLE_RATE * PERIOD), next(draws), next(draws)
        if gyro:
            v, w = v - speed * (scale + louder * sample_v), rate * (1 - turn) - bias - louder * sample_w
        middle = yaw + w * PERIOD / 2
        x, y, yaw = x + v * PERIOD * math.cos(middle), y + v * PERIOD * math.sin(middle), yaw + w * PERIOD
        poses.append((x, y, yaw))
    return np.array(poses)


@pytest.mark.parametrize("gyro", [GYRO, None])
def test_it_is_the_least_squares_solution_for_all_errors_of_a_drive(gyro):
    """In information form, in one batch, with derivatives by differences."""
    count, rng = 3 + 6 * STEPS, np.random.default_rng(0)
    plain = true_poses(np.zeros(count), gyro)
    jacobian = np.stack([true_poses(row, gyro) - plain for row in np.eye(count)], axis=-1)  # (K, 3, draws)
    truth, levels = true_poses(rng.standard_normal(count), gyro), np.array([1e-5, 1e-5, 2e-5])
    fixes = truth + levels * rng.standard_normal(truth.shape)
    made, pose = PoseFilter(SMALL, gyro, TRACK, PERIOD), (0.0, 0.0, 0.0)
    for k, twist in enumerate(TWISTS):
        pose = made.predict(pose, Twist(*twist))
        if k % EVERY == 0:
            pose = made.correct(pose, tuple(fixes[k]))
    seen = (jacobian / levels[:, None])[::EVERY].reshape(-1, count)
    covariance = np.linalg.inv(np.eye(count) + seen.T @ seen)
    best = covariance @ seen.T @ ((fixes - plain) / levels)[::EVERY].ravel()
    expected = jacobian[-1] @ covariance @ jacobian[-1].T
    deviation = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(np.array(pose), plain[-1] + jacobian[-1] @ best, atol=0.01 * deviation.min())
    np.testing.assert_allclose(made.covariance[:3, :3], expected, atol=0.01 * np.outer(deviation, deviation).min())
    assert np.abs(np.array(pose) - plain[-1]).max() > deviation.min()  # the fixes mattered


def fused_drive(robot, seed, rate, seconds=5.0):
    """The last error of the estimate of a robot that weaves, with its covariance."""
    hz, start = 60, (1.0, 2.0, 0.5)
    levels = dataclasses.replace(robot.noise, pose_rate=rate)
    senses = NoisySenses(levels, robot.track, 1 / hz, seed, Odometry())
    made = Fused(start, 1 / hz, levels, robot.track, Odometry())
    (x, y, yaw), twist = start, Twist(0.0, 0.0)
    for k in range(round(seconds * hz)):
        made.update(*senses.read(State(x, y, yaw, *twist)))
        twist = senses.actuate(Twist(0.8, 1.2 * math.sin(0.05 * k)))
        middle = yaw + twist.yaw_rate / hz / 2
        x, y = x + twist.speed / hz * math.cos(middle), y + twist.speed / hz * math.sin(middle)
        yaw += twist.yaw_rate / hz
    estimate = made.update(*senses.read(State(x, y, yaw, *twist)))
    return np.array(estimate) - (x, y, yaw), made.covariance


@pytest.mark.parametrize("rate", [1.0, 20.0])
def test_its_covariance_is_that_of_its_errors(rate, jackal):
    """The mean of the normalised squared error of 50 drives, chi-squared with 150 degrees of freedom, in its 99.9 %."""
    errors = [fused_drive(jackal, seed, rate) for seed in range(50)]
    squared = [float(error @ np.linalg.solve(covariance, error)) for error, covariance in errors]
    assert 3 - 3.3 * math.sqrt(6 / 50) < np.mean(squared) < 3 + 3.3 * math.sqrt(6 / 50)


def test_heading_is_several_times_better_than_fixes_and_wheels_alone(jackal):
    fused = np.std([fused_drive(jackal, seed, 20.0)[0][2] for seed in range(12)])
    assert fused < jackal.noise.pose_yaw / 2


def test_exact_fixes_are_the_estimate_and_scans_do_not_move_it(jackal):
    exact = dataclasses.replace(jackal.noise, pose_xy=0.0, pose_yaw=0.0)
    error, covariance = fused_drive(dataclasses.replace(jackal, noise=exact), 3, 60.0)
    assert np.abs(error).max() < 1e-5
    assert np.linalg.eigvalsh(covariance).min() > 0
    robot = dataclasses.replace(jackal, noise=exact)
    assert not positioning("fixes", robot, 1.0, 1.0, 1 / 60, (0.0, 0.0, 0.0), 0, mapless=True)[1].matched


@pytest.mark.parametrize(
    ("kind", "noise", "mapless", "made", "matched"),
    [
        ("fixes", 1.0, True, Fused, True),
        ("fixes", 1.0, False, Fixes, False),
        ("fixes", 0.0, True, Exact, False),
        ("odometry", 1.0, True, Reckoned, False),
        ("matching", 1.0, True, Reckoned, True),
        ("true", 1.0, True, Exact, False),
    ],
)
def test_scans_correct_estimates_that_drift_or_jump(kind, noise, mapless, made, matched, jackal):
    _, localiser = positioning(kind, jackal, noise, 1.0, 1 / 60, (0.0, 0.0, 0.0), 0, mapless=mapless)
    assert type(localiser) is made
    assert localiser.matched is matched
