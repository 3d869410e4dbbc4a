"""Dead reckoning is exact without errors, drifts as its levels say, and repeats bit for bit."""

import math

import numpy as np
import pytest

from antdrive.base import Pose
from antdrive.robots import Odometry
from antdrive.sim.sensing import DeadReckoning


def driven(odometry: Odometry, seed: int = 0, hz: int = 60, start: Pose = (0.0, 0.0, 0.0)) -> Pose:
    """The estimate after 10 s on a circle of 2 m radius at 1 m/s."""
    reckoning = DeadReckoning(odometry, np.random.default_rng(seed), start)
    for _ in range(10 * hz):
        reckoning.advance(1.0, 0.5, 1 / hz)
    return reckoning.pose


def test_without_errors_it_is_the_circle() -> None:
    x, y, yaw = driven(Odometry().scaled(0), hz=240)
    assert (x, y, yaw) == pytest.approx((2 * math.sin(5), 2 - 2 * math.cos(5), 5), abs=1e-4)


def test_it_starts_at_the_pose_given() -> None:
    assert driven(Odometry().scaled(0), start=(1.0, 2.0, 0.5))[2] == pytest.approx(5.5)


def test_the_same_seed_gives_the_same_bits() -> None:
    assert driven(Odometry(), seed=3) == driven(Odometry(), seed=3)
    assert driven(Odometry(), seed=3) != driven(Odometry(), seed=4)


@pytest.mark.parametrize("hz", [20, 120])
def test_the_heading_drifts_by_bias_scale_and_noise_whatever_the_rate(hz: int) -> None:
    level = Odometry()
    errors = [driven(level, seed, hz)[2] - 5 for seed in range(150)]
    # Bias over 10 s, a fraction of 5 rad, and 500 samples of noise at 50 Hz, each for 0.02 s.
    expected = math.hypot(level.gyro_bias * 10, level.yaw_scale * 5, level.gyro_noise * 0.02 * math.sqrt(500))
    assert np.std(errors) == pytest.approx(expected, rel=0.15)


def test_errors_of_a_straight_drive_are_those_of_the_wheels() -> None:
    level = Odometry(gyro_bias=0.0, gyro_noise=0.0)
    ways = []
    for seed in range(200):
        reckoning = DeadReckoning(level, np.random.default_rng(seed))
        for _ in range(100):
            reckoning.advance(1.0, 0.0, 0.02)
        ways.append(reckoning.pose[0])
        assert reckoning.pose[1:] == (0.0, 0.0)
    assert np.std(ways) == pytest.approx(2 * math.hypot(level.speed_scale, level.speed_noise / 10), rel=0.15)


def test_a_robot_that_stands_drifts_by_its_gyro_alone() -> None:
    reckoning = DeadReckoning(Odometry(), np.random.default_rng(2))
    for _ in range(600):
        reckoning.advance(0.0, 0.0, 1 / 60)
    assert reckoning.pose[:2] == (0.0, 0.0)
    assert 0 < abs(reckoning.pose[2]) < 0.2
