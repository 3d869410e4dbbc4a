"""Movers seen through a lidar alone are found, measured and followed; what stands still is not."""

import math

import numpy as np
import pytest

from antdrive.robots import Lidar, RobotSpec
from antdrive.sim.sensing import (
    KnownGround,
    MappedGround,
    MoverTracker,
    OccupancyMap,
    Scanner,
    TrackedMovers,
    TrackingPolicy,
)
from antdrive.worlds import Disc, Floats, World

POSTS = np.array([[2.5, 1.8, 0.2], [2.5, -2.2, 0.3], [-1.0, 2.0, 0.4]])
BOUNDS = (-4.0, -4.0, 6.0, 4.0)


def watched(
    lidar: Lidar, start: Floats, velocity: Floats, radii: Floats, seconds: float, speed: float = 0.0, seed: int = 0
) -> tuple[TrackedMovers, Floats, OccupancyMap]:
    """What a robot knows of movers after some time; where they are then; and its map.

    The movers come after a second in which the robot sees the empty hall. The robot drives straight on at a speed.
    """
    scanner, grid, tracker = Scanner(lidar, POSTS, bounds=BOUNDS), OccupancyMap(lidar), MoverTracker(lidar)
    rng = np.random.default_rng(seed)
    away = np.full_like(start, 50.0)
    places = start
    for k in range(round((1 + seconds) * lidar.rate) + 1):
        t = k / lidar.rate
        places = start + velocity * (t - 1) if t >= 1 else away
        pose = (speed * t, 0.0, 0.0)
        ranges = scanner.scan(pose, places, radii, rng)
        theirs = tracker.update(MappedGround(grid, 100), pose, ranges, t)
        grid.insert(pose, ranges, left_out=theirs)
    return tracker.movers(), places, grid


@pytest.mark.parametrize(
    ("velocity", "radius"), [((-0.8, 0.3), 0.3), ((0.0, 0.9), 0.2), ((-1.2, 0.0), 0.5), ((0.3, -0.3), 0.15)]
)
@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_a_mover_is_known_after_half_a_second(
    jackal: RobotSpec, velocity: tuple[float, float], radius: float, speed: float
) -> None:
    assert jackal.lidar is not None
    start = np.array([[3.0, -0.5]])
    found, where, _ = watched(jackal.lidar, start, np.array([velocity]), np.array([radius]), 0.5, speed)
    assert len(found.radii) == 1
    assert math.hypot(*(found.positions - where)[0]) < 0.1
    assert math.hypot(*(found.velocities - velocity)[0]) < 0.2
    assert found.radii[0] == pytest.approx(radius, abs=0.06)


def test_two_movers_keep_their_own_tracks_where_they_pass(jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    start, velocity = np.array([[2.0, -1.2], [3.0, 1.2]]), np.array([[0.0, 0.8], [0.0, -0.8]])
    found, where, _ = watched(jackal.lidar, start, velocity, np.array([0.25, 0.25]), 2.5)
    assert len(found.radii) == 2
    order = np.argsort(found.positions[:, 0])
    assert np.hypot(*(found.positions[order] - where).T).max() < 0.1
    assert np.hypot(*(found.velocities[order] - velocity).T).max() < 0.2


def test_a_slow_lidar_all_around_follows_as_well(turtlebot: RobotSpec) -> None:
    assert turtlebot.lidar is not None
    found, where, _ = watched(turtlebot.lidar, np.array([[-2.0, -1.0]]), np.array([[0.4, 0.2]]), np.array([0.3]), 2.0)
    assert len(found.radii) == 1
    assert math.hypot(*(found.positions - where)[0]) < 0.1
    assert math.hypot(*(found.velocities - (0.4, 0.2))[0]) < 0.2


def test_what_stands_still_is_no_mover(jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    none = np.empty((0, 2))
    found, _, grid = watched(jackal.lidar, none, none, np.empty(0), 2.0, speed=0.7)
    assert len(found.radii) == 0
    assert len(grid.discs()) > 50


def test_a_mover_leaves_nothing_in_the_map(jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    _, where, grid = watched(jackal.lidar, np.array([[3.0, -1.5]]), np.array([[0.0, 0.8]]), np.array([0.3]), 3.0)
    discs = grid.discs()
    way = np.hypot(discs[:, 0] - 3.0, np.maximum(0, np.abs(discs[:, 1] + 0.3) - 1.2)) < 0.4
    assert not way.any()
    assert where[0, 1] == pytest.approx(0.9)


def test_a_mover_that_beams_pass_through_is_gone_and_a_hidden_one_is_remembered() -> None:
    lidar = Lidar(beams=360, field_of_view=2 * math.pi, min_range=0.1, max_range=8.0, rate=20.0)
    scanner, grid, tracker = Scanner(lidar, POSTS, bounds=BOUNDS), OccupancyMap(lidar), MoverTracker(lidar)
    for k in range(58):
        there = np.array([[2.0, 0.02 * k - 0.8]]) if 10 <= k < 40 else np.array([[90.0, 90.0]])
        ranges = scanner.scan((0, 0, 0), there, np.array([0.3]))
        grid.insert((0, 0, 0), ranges, left_out=tracker.update(MappedGround(grid, 40), (0, 0, 0), ranges, k / 20))
        assert k in range(10, 20) or k in (40, 41) or len(tracker.movers().radii) == (20 <= k < 40)
    known = KnownGround(lidar, World("hall", BOUNDS, tuple(Disc(*row) for row in POSTS.tolist())))
    tracker, screen = MoverTracker(lidar), Scanner(lidar, np.vstack([POSTS, [1.0, 0.0, 0.4]]), bounds=BOUNDS)
    for k in range(100):
        there = np.array([[2.0, 0.02 * min(k, 30) - 1.2]])
        ranges = (scanner if k < 20 else screen).scan((0, 0, 0), there, np.array([0.1]))
        tracker.update(known, (0, 0, 0), ranges, k / 20)
        mine = np.abs(tracker.movers().positions[:, 0] - 2.0) < 0.3
        assert mine.sum() == (2 <= k < 80)  # hidden by a screen from the 20th scan on, and for 3 s remembered


def test_the_same_scans_give_the_same_tracks(jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    args = (jackal.lidar, np.array([[3.0, -0.5]]), np.array([[-0.5, 0.2]]), np.array([0.3]), 0.3)
    for a, b in zip(watched(*args)[0], watched(*args)[0], strict=True):
        assert np.array_equal(a, b)


def test_a_policy_refuses_what_finds_nothing() -> None:
    with pytest.raises(ValueError, match="gap: must be greater than 0, got 0"):
        TrackingPolicy(gap=0.0)
