"""Scans are the exact distances to what collides: brute force and PyBullet's own rays are the oracles."""

import math
from dataclasses import replace

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from antdrive.robots import Lidar
from antdrive.sim import Engine
from antdrive.sim.sensing import Scanner
from antdrive.worlds import Cruising, Disc, Trajectories, World

EXACT = Lidar(beams=180, field_of_view=4.7, min_range=0.0, max_range=12.0, rate=20.0, x=0.05, y=-0.02, yaw=0.3)


def brute_force(lidar, discs, pose):
    """The first intersection of every beam with every disc, from the quadratic equation."""
    x, y, yaw = pose
    eye = np.array(
        [x + lidar.x * math.cos(yaw) - lidar.y * math.sin(yaw), y + lidar.x * math.sin(yaw) + lidar.y * math.cos(yaw)]
    )
    ways = np.array([[math.cos(yaw + a), math.sin(yaw + a)] for a in lidar.angles])
    best = np.full(lidar.beams, np.inf)
    for cx, cy, radius in discs:
        to = eye - (cx, cy)
        b, c = ways @ to, to @ to - radius**2
        root = b**2 - c
        distance = np.where(root >= 0, -b - np.sqrt(np.maximum(root, 0)), np.inf)
        best = np.minimum(best, np.where(c <= 0, 0.0, np.where(distance >= 0, distance, np.inf)))
    return np.where(best <= lidar.max_range, best, np.inf)


numbers = st.floats(-4, 4, allow_nan=False)
discs = st.lists(st.tuples(numbers, numbers, st.floats(0.02, 1.5)), max_size=8)


@hypothesis.given(discs, st.tuples(numbers, numbers, st.floats(-7, 7)), st.sampled_from([0.5, 3.0, 4.7, 2 * math.pi]))
def test_ranges_are_the_first_intersections(found, pose, view):
    lidar = replace(EXACT, field_of_view=view)
    rows = np.array(found).reshape(-1, 3)
    scan, expected = Scanner(lidar, rows).scan(pose), brute_force(lidar, rows, pose)
    # A beam that grazes a disc may meet it or not, by rounding.
    grazing = np.zeros(lidar.beams, dtype=np.bool_)
    clear = np.isclose(scan, expected, atol=1e-6)
    for row in range(len(rows)):
        for change in (-1e-7, 1e-7):
            other = rows.copy()
            other[row, 2] += change
            grazing |= ~np.isclose(brute_force(lidar, other, pose), expected, atol=1e-3)
    assert np.all(clear | grazing)


def test_a_disc_across_the_first_and_the_last_beam_is_seen_by_both():
    lidar = replace(EXACT, field_of_view=2 * math.pi, x=0.0, y=0.0, yaw=0.0)
    ranges = Scanner(lidar, np.array([[-2.0, 0.0, 0.5]])).scan((0.0, 0.0, 0.0))
    assert np.flatnonzero(np.isfinite(ranges)).tolist() == [*range(8), *range(173, 180)]
    assert ranges[0] == pytest.approx(1.5)


def test_pybullets_rays_meet_the_same_world(jackal):
    rng = np.random.default_rng(4)
    posts = tuple(
        Disc(*rng.uniform((-4, -3), (4, 3)).tolist(), radius) for radius in rng.uniform(0.05, 0.6, 40).tolist()
    )
    movers = (Cruising(radius=0.3, position=(1.2, 0.4), velocity=(-0.5, 0.1)),)
    world = World("posts", (-5.0, -4.0, 5.0, 4.0), tuple(d for d in posts if math.hypot(d.x, d.y) > 1.6), movers=movers)
    lidar = replace(EXACT, beams=720, field_of_view=6.0)
    trajectories = Trajectories.of(world, (0.0, 0.0))
    with Engine(world, jackal, trajectories=trajectories) as engine:
        engine.place((0.0, 0.0, 0.5))
        for _ in range(24):
            engine.step()
        pose = (0.1, -0.2, 0.5)
        scan = Scanner.of(lidar, world).scan(pose, engine.mover_positions(), trajectories.radii)
        x, y, yaw = lidar.pose_on(pose)
        angles = yaw - lidar.yaw + lidar.angles
        ends = [(x + 12 * math.cos(a), y + 12 * math.sin(a), lidar.height) for a in angles]
        p, client = engine._p, engine._client
        for body in range(
            p.getNumBodies(physicsClientId=client)
        ):  # obstacles, movers and walls let rays pass otherwise
            number = p.getBodyUniqueId(body, physicsClientId=client)
            mask = 0 if number == engine._robot else -1
            p.setCollisionFilterGroupMask(number, -1, mask, mask, physicsClientId=client)
        hits = p.rayTestBatch([(x, y, lidar.height)] * len(ends), ends, physicsClientId=client)
    oracle = np.array([12 * hit[2] if hit[0] >= 0 else math.inf for hit in hits])
    apart = np.abs(scan - oracle)
    # Bullet's rays against cylinders iterate, to some millimetres where they graze; at an edge one of the two may miss.
    assert np.median(apart) < 1e-3
    assert np.mean(apart > 1e-2) < 0.01
    assert np.isfinite(scan).all()
    assert np.ptp(scan) > 3


def test_cylinders_below_the_beams_are_not_seen():
    lidar = replace(EXACT, height=0.5, x=0.0, y=0.0, yaw=0.0)
    world = World("steps", (-5, -5, 5, 5), (Disc(2, 0, 0.3, 0.49), Disc(3, 0, 0.3, 0.5)))
    middle = Scanner.of(lidar, world).scan((0, 0, 0))[lidar.beams // 2 - 1 : lidar.beams // 2 + 1]
    assert middle == pytest.approx(2.7, abs=5e-3)
    assert Scanner(lidar, world.discs).scan((0, 0, 0)).min() == pytest.approx(1.7, abs=5e-3)


def test_movers_are_seen_by_their_heights():
    lidar = replace(EXACT, height=0.5, x=0.0, y=0.0, yaw=0.0)
    places, radii = np.array([[2.0, 0.0], [0.0, 2.0]]), np.array([0.5, 0.5])
    none = np.empty((0, 3))
    seen = Scanner(lidar, none, mover_heights=np.array([0.4, 1.0])).scan((0, 0, 0), places, radii)
    assert np.isinf(seen[lidar.beams // 2])
    assert seen.min() == pytest.approx(1.5, abs=5e-3)
    assert np.isfinite(Scanner(lidar, none).scan((0, 0, 0), places, radii)[lidar.beams // 2])


def test_a_device_rounds_and_says_what_is_too_near_or_too_far():
    lidar = Lidar(beams=4, field_of_view=2 * math.pi, min_range=0.5, max_range=4.0, rate=10.0, resolution=0.01)
    scan = Scanner(lidar, np.empty((0, 3)), bounds=(-0.4, -1.2345, 5.0, 2.0)).scan((0, 0, 0))
    # The first beam of a full circle points backwards, the second to the right.
    assert scan.tolist() == [-math.inf, pytest.approx(1.23), math.inf, pytest.approx(2.0)]


def test_noise_has_the_lidars_sigma_and_repeats_with_the_seed():
    lidar = replace(EXACT, sigma=0.02, beams=4000, max_range=30.0)
    scanner = Scanner(lidar, np.array([[0.0, 0.0, 1.0]]), bounds=(-9.0, -9.0, 9.0, 9.0))
    exact, noisy = scanner.scan((4, 0, 0)), scanner.scan((4, 0, 0), rng=np.random.default_rng(1))
    assert np.std(noisy - exact) == pytest.approx(0.02, rel=0.1)
    assert np.array_equal(noisy, scanner.scan((4, 0, 0), rng=np.random.default_rng(1)))


def test_a_scan_draws_as_many_numbers_whatever_it_meets():
    lidar = replace(EXACT, sigma=0.02)
    after = []
    for world in (np.empty((0, 3)), np.array([[2.0, 0.0, 1.0]])):
        rng = np.random.default_rng(7)
        Scanner(lidar, world).scan((0, 0, 0), rng=rng)
        after.append(rng.random())
    assert after[0] == after[1]


def test_a_lidar_inside_a_disc_or_a_wall_measures_nothing():
    lidar = replace(EXACT, min_range=0.1)
    assert np.all(Scanner(lidar, np.array([[0.0, 0.0, 1.0]])).scan((0.2, 0, 0)) == -math.inf)
    assert np.all(Scanner(lidar, np.empty((0, 3)), bounds=(1, 1, 2, 2)).scan((0, 0, 0)) == -math.inf)


def test_a_lidar_on_its_way_sees_discs_that_come_into_range():
    lidar, rng = replace(EXACT, max_range=2.0), np.random.default_rng(3)
    discs = rng.uniform((-9, -9, 0.05), (9, 9, 0.4), (60, 3))
    discs = discs[np.abs(discs[:, 1]) > 0.6]
    scanner = Scanner(lidar, discs)
    for x in np.arange(-8.0, 8.0, 0.23):
        pose = (x, 0.0, 0.2)
        assert scanner.scan(pose) == pytest.approx(brute_force(lidar, discs, pose))
