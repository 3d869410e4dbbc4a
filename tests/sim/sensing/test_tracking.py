"""Movers seen through a lidar alone are found, measured and followed; what stands still is not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import Lidar
from antdrive.sim.sensing import (
    KnownGround,
    MappedGround,
    MoverTracker,
    OccupancyMap,
    Scanner,
    _kernels_tracking,
)
from antdrive.worlds import Disc, World

CIRCLE = Lidar(beams=360, field_of_view=2 * math.pi, min_range=0.1, max_range=8.0, rate=20.0)
POSTS = np.array([[2.5, 1.8, 0.2], [2.5, -2.2, 0.3], [-1.0, 2.0, 0.4]])
BOUNDS = (-4.0, -4.0, 6.0, 4.0)


def watched(lidar, start, velocity, radii, seconds, speed=0.0, seed=0):
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
        grid.insert(pose, ranges, omitted=theirs)
    return tracker.movers(), places, grid


@pytest.mark.parametrize(
    ("velocity", "radius"), [((-0.8, 0.3), 0.3), ((0.0, 0.9), 0.2), ((-1.2, 0.0), 0.5), ((0.3, -0.3), 0.15)]
)
@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_a_mover_is_known_after_half_a_second(jackal, velocity, radius, speed):
    start = np.array([[3.0, -0.5]])
    found, where, _ = watched(jackal.lidar, start, np.array([velocity]), np.array([radius]), 0.5, speed)
    assert len(found.radii) == 1
    assert math.hypot(*(found.positions - where)[0]) < 0.1
    assert math.hypot(*(found.velocities - velocity)[0]) < 0.2
    assert found.radii[0] == pytest.approx(radius, abs=0.06)


def test_two_movers_keep_their_own_tracks_where_they_pass(jackal):
    start, velocity = np.array([[2.0, -1.2], [3.0, 1.2]]), np.array([[0.0, 0.8], [0.0, -0.8]])
    found, where, _ = watched(jackal.lidar, start, velocity, np.array([0.25, 0.25]), 2.5)
    assert len(found.radii) == 2
    order = np.argsort(found.positions[:, 0])
    assert np.hypot(*(found.positions[order] - where).T).max() < 0.1
    assert np.hypot(*(found.velocities[order] - velocity).T).max() < 0.2


def test_a_mover_that_is_never_seen_from_edge_to_edge_counts_when_it_has_come_a_long_way(jackal):
    """One mover hides a side of another all the time. What stands half hidden behind the first is no mover."""
    start, velocity = np.array([[2.2, -0.45], [3.6, -0.1]]), np.array([[-0.3, 0.06], [-0.8, 0.0]])
    radii = np.array([0.3, 0.3])
    found, where, _ = watched(jackal.lidar, start, velocity, radii, 0.9)
    assert len(found.radii) == 2
    order = np.argsort(found.positions[:, 0])
    assert np.hypot(*(found.positions[order] - where).T).max() < 0.1
    assert np.hypot(*(found.velocities[order] - velocity).T).max() < 0.2
    stands, *_ = watched(jackal.lidar, start, velocity * [[1.0], [0.0]], radii, 0.9)
    assert len(stands.radii) == 1


def test_a_slow_lidar_all_around_follows_as_well(turtlebot):
    found, where, _ = watched(turtlebot.lidar, np.array([[-2.0, -1.0]]), np.array([[0.4, 0.2]]), np.array([0.3]), 2.0)
    assert len(found.radii) == 1
    assert math.hypot(*(found.positions - where)[0]) < 0.1
    assert math.hypot(*(found.velocities - (0.4, 0.2))[0]) < 0.2


def test_what_stands_still_is_no_mover(jackal):
    none = np.empty((0, 2))
    found, _, grid = watched(jackal.lidar, none, none, np.empty(0), 2.0, speed=0.7)
    assert len(found.radii) == 0
    assert len(grid.discs()) > 50


def test_a_mover_leaves_nothing_in_the_map(jackal):
    _, where, grid = watched(jackal.lidar, np.array([[3.0, -1.5]]), np.array([[0.0, 0.8]]), np.array([0.3]), 3.0)
    discs = grid.discs()
    way = np.hypot(discs[:, 0] - 3.0, np.maximum(0, np.abs(discs[:, 1] + 0.3) - 1.2)) < 0.4
    assert not way.any()
    assert where[0, 1] == pytest.approx(0.9)


def test_a_mover_that_beams_pass_through_is_gone_and_a_hidden_one_is_remembered():
    lidar = Lidar(beams=360, field_of_view=2 * math.pi, min_range=0.1, max_range=8.0, rate=20.0)
    scanner, grid, tracker = Scanner(lidar, POSTS, bounds=BOUNDS), OccupancyMap(lidar), MoverTracker(lidar)
    for k in range(58):
        there = np.array([[2.0, 0.02 * k - 0.8]]) if 10 <= k < 40 else np.array([[90.0, 90.0]])
        ranges = scanner.scan((0, 0, 0), there, np.array([0.3]))
        grid.insert((0, 0, 0), ranges, omitted=tracker.update(MappedGround(grid, 40), (0, 0, 0), ranges, k / 20))
        assert k in range(10, 20) or k in (40, 41) or len(tracker.movers().radii) == (20 <= k < 40)
    known = KnownGround(lidar, World("hall", BOUNDS, tuple(Disc(*row) for row in POSTS.tolist())))
    tracker, screen = MoverTracker(lidar), Scanner(lidar, np.vstack([POSTS, [1.0, 0.0, 0.4]]), bounds=BOUNDS)
    for k in range(100):
        there = np.array([[2.0, 0.02 * min(k, 30) - 1.2]])
        ranges = (scanner if k < 20 else screen).scan((0, 0, 0), there, np.array([0.1]))
        tracker.update(known, (0, 0, 0), ranges, k / 20)
        mine = np.abs(tracker.movers().positions[:, 0] - 2.0) < 0.3
        assert mine.sum() == (2 <= k < 80)  # hidden by a screen from the 20th scan on, and for 3 s remembered
        assert tracker.movers().met[mine].tolist() == ([k < 20] if mine.any() else [])


@pytest.mark.parametrize(("hidden", "tracks"), [(6, 1), (14, 2)])
def test_an_unconfirmed_mover_is_remembered_for_half_a_second(hidden, tracks):
    """It is scanned twice, and then hidden by a screen on the map for so many scans at 20 Hz."""
    lidar, screen, mover = replace(CIRCLE, resolution=0.0), (1.0, 0.0, 0.4), (2.0, 0.0, 0.2)
    known = KnownGround(lidar, World("hall", BOUNDS, (Disc(*screen),)))
    tracker = MoverTracker(lidar)
    for k in range(hidden + 4):
        discs = [mover] if k < 2 or k >= 2 + hidden else [mover, screen]
        tracker.update(known, (0, 0, 0), Scanner(lidar, np.array(discs), bounds=BOUNDS).scan((0, 0, 0)), k / 20)
    assert tracker.tracks_begun == tracks


def test_coarse_ranges_of_what_is_on_the_map_are_explained():
    lidar = replace(CIRCLE, resolution=0.2)
    known = KnownGround(lidar, World("hall", BOUNDS, tuple(Disc(*row) for row in POSTS.tolist())))
    hits = known.hits((0, 0, 0), Scanner(lidar, POSTS, bounds=BOUNDS).scan((0, 0, 0)))
    assert len(hits.beams) > 300
    assert hits.explained.all()


def test_hits_beyond_the_map_s_horizon_do_not_count():
    ranges = Scanner(CIRCLE, POSTS, bounds=BOUNDS).scan((0, 0, 0))
    hits = MappedGround(OccupancyMap(CIRCLE, horizon=3.0), 40).hits((0, 0, 0), ranges)
    assert 2.0 < ranges[hits.beams].max() <= 3.0 < ranges[np.isfinite(ranges)].max()


def test_the_errors_of_whole_and_partly_hidden_movers_differ_by_a_factor():
    lidar = replace(CIRCLE, sigma=0.04, resolution=0.01)
    rules = MoverTracker(lidar).rules[True]
    assert (rules.whole, rules.part) == pytest.approx([error**2 + 0.04**2 + 0.01**2 / 12 for error in (0.01, 0.03)])


def followed(turned, seed, expecting, count=240, scale=0.01, dt=0.02):
    """Return how far a track's velocity is off the truth after each measured centre (count,) [m/s]; it turns in the middle."""
    rng, track, place = np.random.default_rng(seed), np.zeros(1, dtype=_kernels_tracking.TRACK), np.zeros(2)
    track["spread"], track["variance"], off = 1.0, scale**2, []
    for k in range(count):
        heading = turned if k >= count // 2 else 0.0
        velocity = 1.8 * np.array([math.cos(heading), math.sin(heading)])
        place = place + dt * velocity
        _kernels_tracking.predict(track, 1, dt, 9.0, 9.0 * dt**4 / 4, 9.0 * dt**3 / 2)
        x, y = place + rng.normal(0.0, scale, 2)
        if expecting:
            _kernels_tracking.expect_turn(track[0], x, y, scale**2, dt, 2.0)
        _kernels_tracking.filter_in(track[0], x, y, scale**2)
        off.append(math.hypot(track[0]["vx"] - velocity[0], track[0]["vy"] - velocity[1]))
    return np.array(off)


@pytest.mark.parametrize("turned", [1.2, 2.6, -2.6, math.pi])
def test_the_velocity_of_a_mover_that_turns_is_known_after_a_tenth_of_a_second(turned):
    off, before = (np.median([followed(turned, seed, x) for seed in range(30)], axis=0) for x in (True, False))
    assert max(off[119], off[150:].max()) < 0.15
    assert off[124:].max() < 0.5 < before[124]


def test_chance_widens_one_track_in_a_thousand():
    rng, wide = np.random.default_rng(1), 0
    for x, y in rng.normal(0.0, math.sqrt(2) * 0.01, (20_000, 2)):
        track = np.zeros(1, dtype=_kernels_tracking.TRACK)
        track["variance"] = 1e-4
        _kernels_tracking.expect_turn(track[0], x, y, 1e-4, 0.02, 2.0)
        wide += int(track[0]["spread"] > 0.0)
    assert 5 <= wide <= 40


@pytest.mark.parametrize(("moves", "sure", "owner"), [(True, True, 0), (True, False, -1), (False, True, -1)])
def test_only_a_confirmed_mover_owns_points_that_the_map_explains(moves, sure, owner):
    tracks = np.zeros(1, dtype=_kernels_tracking.TRACK)
    tracks["radius"], tracks["moves"], tracks["sure"] = 0.3, moves, sure
    for explained, found in ((True, owner), (False, 0)):
        out = np.empty(1, dtype=np.int64)
        _kernels_tracking.own(tracks, 1, np.array([[0.32, 0.0]]), np.array([explained]), out)
        assert out[0] == found


def test_a_map_explains_what_stands_on_it_and_nothing_else():
    circle, limits = {"beams": 360, "field_of_view": 2 * math.pi}, {"min_range": 0.1, "max_range": 8.0}
    lidar = Lidar(**circle, **limits, rate=20.0, sigma=0.005, height=0.3)
    low, tall, new = Disc(1.0, 1.0, 0.2, 0.2), Disc(2.0, 0.0, 0.3), (-1.5, -1.0, 0.25)
    world = World("hall", BOUNDS, (low, tall))
    scanner = Scanner(lidar, np.array([[2.0, 0.0, 0.3], new, [1.0, 1.0, 0.2]]), bounds=BOUNDS)
    truth, believed = (0.0, 0.0, 0.0), (0.02, -0.01, 0.01)
    ranges = scanner.scan(truth, rng=np.random.default_rng(1))
    for pose, errors in ((truth, ()), (believed, (0.02, 0.01))):
        hits = KnownGround(lidar, world, *errors).hits(pose, ranges)
        near = np.hypot(*(hits.points - new[:2]).T) < 0.45
        # The lidar passes over the low cylinder of the map, so what it meets there is something else.
        instead = np.hypot(*(hits.points - (1.0, 1.0)).T) < 0.35
        assert near.sum() > 5
        assert np.array_equal(~hits.explained, near | instead)


def test_what_may_move_is_no_mark_to_steer_by(jackal):
    scanner, grid = Scanner(jackal.lidar, POSTS, bounds=BOUNDS), OccupancyMap(jackal.lidar)
    tracker = MoverTracker(jackal.lidar)
    for k in range(76):
        there, pose = np.array([[2.0, -0.3 + 0.01 * k]]), (0.0, 0.0, 0.0)
        ranges = scanner.scan(pose, there, np.array([0.2]))
        ground = MappedGround(grid, 100)
        doubted = tracker.suspected(ground, pose, ranges, k / 50)
        points = grid.endpoints(pose, ranges)
        on_mover, on_post = (np.hypot(*(points - at).T) < r + 0.02 for at, r in ((there[0], 0.2), (POSTS[0, :2], 0.2)))
        assert k == 0 or doubted[on_mover].all()
        if k in (20, 75):
            assert doubted[on_post].all() == (k == 20)  # a post is trusted once it has been known for a second
        grid.insert(pose, ranges, tracker.update(ground, pose, ranges, k / 50))


def test_a_post_on_the_map_is_a_mark_even_if_it_seems_to_creep(jackal):
    """The robot stands and believes that it sways by 4 cm, so that all that stands seems to move at up to 0.2 m/s."""
    scanner, grid = Scanner(jackal.lidar, POSTS, bounds=BOUNDS), OccupancyMap(jackal.lidar)
    tracker, doubts = MoverTracker(jackal.lidar), []
    for k in range(120):
        believed = (0.04 * math.sin(0.1 * k), 0.0, 0.0)
        ranges, ground = scanner.scan((0.0, 0.0, 0.0)), MappedGround(grid, 100)
        on_post = np.hypot(*(grid.endpoints((0.0, 0.0, 0.0), ranges) - POSTS[0, :2]).T) < 0.22
        doubts.append(tracker.suspected(ground, believed, ranges, k / 50)[on_post].mean())
        grid.insert(believed, ranges, tracker.update(ground, believed, ranges, k / 50))
    assert doubts[20] == 1.0  # it has only just come into sight
    assert max(doubts[60:]) < 0.2


def test_a_pillar_that_is_passed_does_not_move(jackal):
    """Its far side becomes visible, on ground that beams have grazed."""
    pillars = np.array([[2.0, 1.0, 0.35], [2.0, -1.2, 0.35]])
    scanner, grid = Scanner(jackal.lidar, pillars, bounds=BOUNDS), OccupancyMap(jackal.lidar)
    tracker = MoverTracker(jackal.lidar)
    rng = np.random.default_rng(0)
    for k in range(150):
        pose = (0.03 * k - 0.5, 0.05 * math.sin(0.1 * k), 0.1 * math.cos(0.1 * k))
        ranges = scanner.scan(pose, rng=rng)
        grid.insert(pose, ranges, tracker.update(MappedGround(grid, 100), pose, ranges, k / 50))
        assert not len(tracker.movers().radii), k


def test_there_is_room_for_however_many_tracks_a_scan_begins(jackal):
    """A fence of 80 thin posts around the robot, on a map that is empty: each is an unknown thing of its own."""
    angle = np.linspace(-2.2, 2.2, 80)
    fence = np.column_stack((4.0 * np.cos(angle), 4.0 * np.sin(angle), np.full(80, 0.05)))
    lidar = replace(jackal.lidar, beams=4000, x=0.0)
    empty = KnownGround(lidar, World("empty", (-9.0, -9.0, 9.0, 9.0)))
    tracker, scanner = MoverTracker(lidar), Scanner(lidar, fence)
    tracker.rules = {complete: rules._replace(gap=0.1) for complete, rules in tracker.rules.items()}
    for k in range(12):
        tracker.update(empty, (0.0, 0.0, 0.0), scanner.scan((0.0, 0.0, 0.0)), k / 50)
    assert tracker.tracks_begun == 80
    found = tracker.movers()
    assert len(found.radii) == 80
    assert np.hypot(*(found.positions - fence[:, :2]).T).max() < 0.03
    assert found.numbers.tolist() == list(range(80))


def test_a_distance_is_rounded_as_python_rounds_it():
    """Python's `math.hypot` is exact to half a unit in the last place, which the C library's is not."""
    pairs = np.random.default_rng(0).uniform(-10, 10, (3000, 2)).tolist()
    assert [_kernels_tracking.distance_between(x, y) for x, y in pairs] == [math.hypot(x, y) for x, y in pairs]
    assert _kernels_tracking.distance_between(0.0, 0.0) == 0.0
