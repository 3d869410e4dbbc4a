"""Bounds between rows hold for all motions that the reach allows, and are proved able to fail."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.proof import Track, prove
from antdrive.proof.distances import to_outline, to_world
from antdrive.robots import load_robot
from antdrive.robots.spec import Footprint
from antdrive.worlds import Disc, World

FINE = 200  # samples between two rows
ROBOTS = {name: load_robot(name) for name in ("turtlebot", "jackal", "turtlebot3-waffle", "warehouse")}


def motion(robot, seconds, rng, hold=0.02):
    """A drive within the robot's limits, commanded in steps: fine times (N,) and poses (N, 3)."""
    dt, v, w, x, y, yaw = 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0
    rows, goal = [], (0.0, 0.0)
    for k in range(round(seconds / dt)):
        if k % 300 == 0:
            goal = robot.max_speed * rng.uniform(-0.3, 1.0), robot.max_yaw_rate * rng.uniform(-1, 1)
        if k % round(hold / dt) == 0:
            v += float(np.clip(goal[0] - v, -robot.max_acceleration * hold, robot.max_acceleration * hold))
            most = min(robot.max_yaw_rate, robot.max_lateral_acceleration / max(abs(v), 1e-9))
            w = float(np.clip(goal[1], w - robot.max_yaw_acceleration * hold, w + robot.max_yaw_acceleration * hold))
            w = float(np.clip(w, -most, most))
        rows.append((x, y, yaw))
        x, y, yaw = x + v * math.cos(yaw) * dt, y + v * math.sin(yaw) * dt, yaw + w * dt
    return np.arange(len(rows)) * dt, np.array(rows)


def among(pose, robot, rng, count=12):
    """A world with cylinders near a drive, none of which it overlaps."""
    spots = pose[rng.integers(0, len(pose), count), :2] + rng.normal(0, 1.2 * robot.radius, (count, 2))
    discs = [Disc(x, y, 0.05) for x, y in spots.tolist()]
    apart = [to_world(robot.footprint, pose, World("one", (-99, -99, 99, 99), (disc,))).min() for disc in discs]
    near = tuple(disc for disc, least in zip(discs, apart, strict=True) if least > 0)
    return World("beside", (-99.0, -99.0, 99.0, 99.0), near)


@pytest.mark.parametrize("name", ROBOTS)
@given(seed=st.integers(0, 2**32 - 1), step=st.integers(10, 250))
def test_the_bound_is_never_above_the_true_least_clearance(name, seed, step):
    rng, robot = np.random.default_rng(seed), ROBOTS[name]
    t, fine = motion(robot, 3.0, rng)
    world = among(fine, robot, rng)
    rows = np.arange(0, len(t), step)
    proof = prove(Track.limited(t[rows], fine[rows], robot), world)
    true = to_world(robot.footprint, fine, world)
    for k in range(len(rows) - 1):
        assert proof.between[k] <= true[rows[k] : rows[k + 1] + 1].min() + 1e-9


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("rebound", [0.0, 0.5, 1.0])
@given(seed=st.integers(0, 2**32 - 1), step=st.integers(10, 150), pieces=st.integers(1, 8))
def test_a_contact_between_two_rows_is_not_missed_even_if_the_robot_bounces_back(name, rebound, seed, step, pieces):
    """It does so along its way, by a part of its speed; the first contact is in the last step that is looked at."""
    rng, robot = np.random.default_rng(seed), ROBOTS[name]
    t, fine = motion(robot, 2.0, rng)
    end = int(rng.integers(step, len(t)))
    back = fine[end - np.rint(rebound * np.arange(min(end, len(t) - end))).astype(int)]
    hit = np.concatenate([fine[:end], back])
    rows = np.arange(0, min(end - 1 + step, len(hit)), step)
    at = np.unique(np.concatenate([t[rows], np.linspace(0, t[rows[-1]], 1 + pieces * (len(rows) - 1))]))
    world = among(hit, robot, rng)
    proof = prove(Track.limited(t[rows], hit[rows], robot, at=at), world)
    true = to_world(robot.footprint, hit, world)[: rows[-1] + 1]
    near = np.clip(np.searchsorted(at, t[: len(true)], side="right") - 1, 0, len(at) - 2)
    assert (proof.between[near] <= true + 1e-9).all()


@given(seed=st.integers(0, 2**32 - 1), error=st.floats(0.001, 0.1))
def test_a_track_with_errors_is_proved_only_if_the_true_one_is_clear(seed, error):
    rng, robot = np.random.default_rng(seed), ROBOTS["turtlebot"]
    t, fine = motion(robot, 2.0, rng)
    world = among(fine, robot, rng)
    seen = fine[::33].copy()
    seen[:, :2] += rng.uniform(-1, 1, (len(seen), 2)) * error / math.sqrt(2)  # a disc feels no error of its yaw
    seen[:, 2] += rng.normal(0, 0.2, len(seen))
    proof = prove(Track.limited(t[::33], seen, robot, error=error), world)
    assert proof.bound - error <= to_world(robot.footprint, fine, world).min() + 1e-9


@given(seed=st.integers(0, 2**32 - 1), step=st.integers(15, 120), other=st.integers(15, 120))
def test_two_robots_are_clear_of_each_other_by_their_bound(seed, step, other):
    """Each log has its own stamps; the rows of one are interpolated at those of the other."""
    rng, (one, two) = np.random.default_rng(seed), (ROBOTS["jackal"], ROBOTS["warehouse"])
    (t, a), (_, b) = motion(one, 2.0, rng), motion(two, 2.0, rng)
    b = b + (1.6, rng.uniform(-1, 1), 0.0)
    mine, theirs = slice(0, None, step), slice(0, None, other)
    until = min(t[mine][-1], t[theirs][-1])
    at = np.union1d(t[mine], t[theirs])
    at = at[at <= until]
    tracks = Track.limited(t[mine], a[mine], one, at=at), Track.limited(t[theirs], b[theirs], two, at=at)
    proof = prove(tracks[0], World("hall", (-99.0, -99.0, 99.0, 99.0)), tracks[1:])
    true = to_outline(one.footprint, a, two.footprint, b)
    for k in range(len(at) - 1):
        assert proof.between[k] <= true[(t >= at[k]) & (t <= at[k + 1])].min() + 1e-9


def test_nothing_is_said_where_nothing_is_known():
    robot, t, pose = ROBOTS["turtlebot"], np.arange(4.0), np.zeros((4, 3))
    track = Track.limited(t, pose, robot, unknown=np.array([False, True, False]))
    assert np.isinf(track.reach).tolist() == [False, True, False]
    beyond = Track.limited(t[1:], pose[1:], robot, at=np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0]))
    assert np.isnan(beyond.reach).tolist() == [True, False, False, False, True]
    here = Track.limited(np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0]), np.zeros((6, 3)), robot)
    hall = World("hall", (-9.0, -9.0, 9.0, 9.0))
    assert np.isfinite(prove(here, hall, [beyond]).between).all()
    assert prove(here, hall, [beyond]).between[0] > 0 > prove(here, hall, [beyond]).between[1]


def test_tracks_with_and_without_interpolated_rows_are_proved_together():
    t, pose, hall = np.array([0.0, 1.0]), np.zeros((2, 3)), World("hall", (-9.0, -9.0, 9.0, 9.0))
    at = np.linspace(0.0, 1.0, 9)
    other = Track(at, np.tile([3.0, 0.0, 0.0], (9, 1)), Footprint.disc(0.2), np.zeros(8))
    proof = prove(Track.limited(t, pose, ROBOTS["turtlebot"], at=at), hall, [other])
    assert proof.off.shape == at.shape
    assert proof.bound > 1.0


def test_a_correction_is_no_motion_and_a_gap_is_not_bridged():
    robot, hall = ROBOTS["turtlebot"], World("hall", (-5.0, -5.0, 5.0, 5.0), (Disc(0.0, 1.0, 0.2),))
    t, pose = np.array([0.0, 0.1, 0.2]), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    fastest = robot.max_speed + robot.radius * robot.max_yaw_rate
    assert Track.limited(t, pose, robot).reach[0] == pytest.approx(0.1 * fastest)
    assert Track.limited(t, pose, robot).reach[1] < 0.05 * fastest  # it stood before
    assert prove(Track.limited(t, pose, robot), hall).bound > 0
    assert prove(Track.limited(t * 100, pose, robot), hall).bound < 0


def test_a_teleport_counts_with_the_nearer_row_only():
    foot, t = Footprint.disc(0.2), np.array([0.0, 1.0])
    still = Track(t, np.zeros((2, 3)), foot, np.zeros(1))
    at = np.array([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    hall = World("hall", (-9.0, -9.0, 9.0, 9.0))
    steady, leaping = (Track(t, at, foot, np.full(1, 0.1), np.full(1, jumps)) for jumps in (False, True))
    assert prove(still, hall, [steady]).bound == pytest.approx((0.6 + 2.6 - 0.1) / 2)
    proof = prove(still, hall, [leaping])
    assert (proof.bound, proof.row) == (pytest.approx(0.6 - 0.1), 0)
