"""Scan matching takes back drift, and nothing else."""

import math

import numpy as np
import pytest

from antdrive.base import Floats
from antdrive.robots import RobotSpec
from antdrive.sim.sensing import OccupancyMap, Scanner
from antdrive.sim.sensing.matching import ScanMatcher, sliding_left_out
from antdrive.worlds import Disc, World

WORLD = World("room", (0.0, 0.0, 6.0, 5.0), (Disc(2.0, 3.5, 0.3), Disc(4.0, 1.5, 0.2), Disc(3.2, 4.1, 0.15)))
POSE = (2.0, 1.5, 0.4)


def looked(robot: RobotSpec, world: World = WORLD) -> tuple[OccupancyMap, Floats]:
    """A map of some scans from one place, and another scan from there, with noise."""
    assert robot.lidar is not None
    scanner, rng = Scanner.of(robot.lidar, world), np.random.default_rng(0)
    seen = OccupancyMap(robot.lidar, 0.05, POSE[:2])
    for _ in range(8):
        seen.insert(POSE, scanner.scan(POSE, rng=rng))
    return seen, scanner.scan(POSE, rng=rng)


@pytest.mark.parametrize("off", [(0.01, 0.0, 0.0), (0.0, -0.012, 0.0), (0.0, 0.0, 0.008), (-0.008, 0.008, -0.006)])
def test_a_pose_that_has_drifted_is_corrected(off: tuple[float, float, float], jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    seen, ranges = looked(jackal)
    drifted = (POSE[0] + off[0], POSE[1] + off[1], POSE[2] + off[2])
    for _ in range(3):  # as one scan after the other does
        drifted = ScanMatcher(jackal.lidar).corrected(seen, drifted, ranges)
    x, y, yaw = drifted
    assert math.hypot(x - POSE[0], y - POSE[1]) < 0.005
    assert abs(yaw - POSE[2]) < 0.002


def test_walls_that_are_far_away_hold_a_pose_where_that_is_asked_for(jackal: RobotSpec) -> None:
    """In the middle of a hall of 24 m nothing is nearer than 11 m."""
    assert jackal.lidar is not None
    hall, here = World("hall", (-12.0, -12.0, 12.0, 12.0)), (0.5, -0.4, 0.3)
    scanner, rng = Scanner.of(jackal.lidar, hall), np.random.default_rng(0)
    seen = OccupancyMap(jackal.lidar, 0.05, here[:2], horizon=16.0)
    for _ in range(8):
        seen.insert(here, scanner.scan(here, rng=rng))
    drifted, ranges = (0.512, -0.4, 0.303), scanner.scan(here, rng=rng)
    assert ScanMatcher(jackal.lidar).corrected(seen, drifted, ranges) == drifted
    pose = drifted
    for _ in range(3):
        pose = ScanMatcher(jackal.lidar, far=15.0).corrected(seen, pose, ranges)
    assert math.dist(pose[:2], here[:2]) < 0.006
    assert abs(pose[2] - here[2]) < 0.001


def test_an_empty_map_corrects_nothing(jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    _, ranges = looked(jackal)
    assert ScanMatcher(jackal.lidar).corrected(OccupancyMap(jackal.lidar, 0.05, POSE[:2]), POSE, ranges) == POSE


def test_a_correction_that_is_too_large_is_not_believed(jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    seen, ranges = looked(jackal)
    far = (POSE[0] + 0.05, POSE[1], POSE[2])
    assert ScanMatcher(jackal.lidar).corrected(seen, far, ranges) == far


def test_a_shift_along_the_only_wall_in_sight_is_left_out() -> None:
    before, after = (0.0, 0.0, 0.0), (0.01, 0.02, 0.003)
    wall = np.column_stack([np.full(60, 2.0), np.linspace(-1, 1, 60)])
    assert sliding_left_out(before, after, wall) == pytest.approx((0.01, 0.0, 0.003))
    turned = wall @ np.array([[0.6, 0.8], [-0.8, 0.6]])  # faces the direction (0.6, 0.8)
    x, y, _ = sliding_left_out(before, after, turned)
    assert (x, y) == pytest.approx((0.022 * 0.6, 0.022 * 0.8))
    corner = np.vstack([wall, np.column_stack([np.linspace(1.97, 0, 60), np.ones(60)])])
    assert sliding_left_out(before, after, corner) == pytest.approx(after)
    posts = np.repeat(np.random.default_rng(0).uniform(-3, 3, (12, 2)), 5, axis=0)
    posts += 0.02 * np.arange(60)[:, None] % 0.1
    assert sliding_left_out(before, after, posts) == pytest.approx(after)
    assert sliding_left_out(before, after, np.full((60, 2), np.nan)) == after
