"""Observed ground and sightings against plain numpy and by hand; frames and ranges of a log."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base.plane import relative_frame, transform_points
from antdrive.robots import load_robot
from antdrive.robots.clearance import footprint_clearance
from antdrive.sim.log.rollout import millimetres, ranges_of
from antdrive.sim.log.sights import PASSED, first_meetings, mover_sightings, passed, sightings
from antdrive.worlds import Disc, World
from tests.made_up_drive import scanned
from tests.records import changed


@pytest.fixture(scope="module")
def log(made_up_drive):
    return scanned(made_up_drive(size=(6.0, 4.0), obstacles=40))


def visible(log, k, points, *others):
    """Return whether the lidar sees points from scan k: in its field of view, with a clear line of sight."""
    lidar, discs = log.record.robot.lidar, (*log.record.world.discs, *others)
    x, y, yaw = lidar.pose_on(tuple(log.pose[log.scan_rows[k]]))
    to = points - (x, y)
    away = np.hypot(*to.T)
    seen = away < lidar.max_range
    if not lidar.full_circle:
        seen &= np.abs((np.arctan2(to[:, 1], to[:, 0]) - yaw + np.pi) % (2 * np.pi) - np.pi) < lidar.field_of_view / 2
    for cx, cy, radius in discs:
        share = np.clip((to @ (cx - x, cy - y)) / away**2, 0.0, 1.0)
        seen &= np.hypot(x + share * to[:, 0] - cx, y + share * to[:, 1] - cy) > radius
    return seen


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
def test_approaches_are_as_near_as_clearances_say(log, robot):
    """Against the clearance of each cylinder alone in a hall without end."""
    foot = load_robot(robot).footprint
    record = changed(log.record, "robot", footprint=foot)
    poses = log.pose + (0.0, 0.0, 0.3)
    found = {sight.obstacle: sight for sight in sightings(replace(log, pose=poses, record=record), first_meetings(log))}
    for j, disc in enumerate(log.record.world.obstacles):
        apart = footprint_clearance(World("hall", (-99.0, -99.0, 99.0, 99.0), (disc,)), foot, poses)
        if apart.min() > 0:
            assert found[j].nearest == pytest.approx(apart.min())
            assert found[j].nearest_at == log.t[apart.argmin()]
            if math.isfinite(found[j].seen_at):
                assert found[j].seen_from == pytest.approx(apart[np.searchsorted(log.t, found[j].seen_at)])


def test_a_polygon_s_approach_is_to_its_edge(log):
    foot = replace(load_robot("turtlebot").footprint, half_length=0.0, half_width=0.0, rounding=0.0)
    corners = ((0.4, -0.2), (0.4, 0.2), (-0.1, 0.2), (-0.1, -0.2))
    polygon = replace(foot, corners=corners)
    world = replace(log.record.world, obstacles=(Disc(3.0, 2.0, 0.2),))
    record = replace(
        log.record,
        task=replace(log.record.task, world=world),
        robot=replace(log.record.robot, footprint=polygon),
    )
    ahead = np.column_stack([np.linspace(1.0, 2.0, len(log.t)), np.full(len(log.t), 2.0), np.zeros(len(log.t))])
    straight = replace(log, pose=ahead, record=record)
    (sight,) = sightings(straight, np.array([0.0]))
    assert sight.nearest == pytest.approx(3.0 - 2.0 - 0.4 - 0.2)
    assert sight.seen_from == pytest.approx(3.0 - 1.0 - 0.4 - 0.2)
    assert (sight.touched, sight.nearest_at) == (False, log.t[-1])
    hit = replace(straight, contacts=np.array([[len(log.t) - 1, 0, -0.001, 1.0]]))
    (never,) = sightings(hit, np.array([math.inf]))
    assert never.touched
    assert math.isnan(never.seen_from)


def test_passed_is_what_came_within_half_a_metre(log, made_up_drive):
    everything = sightings(log, first_meetings(log))
    listed = passed(log)
    assert {sight.obstacle for sight in listed} == {sight.obstacle for sight in everything if sight.nearest <= PASSED}
    assert 0 < len(listed) < len(everything)
    assert [sight.nearest_at for sight in listed] == sorted(sight.nearest_at for sight in listed)
    plain = listed[0].as_dict()
    assert plain["nearest_m"] == listed[0].nearest
    never = listed[0]._replace(seen_at=math.inf, seen_from=math.nan).as_dict()
    assert never["seen_s"] is never["seen_from_m"] is None
    far = everything[-1]._replace(touched=True)
    assert far.passed  # whatever was touched was passed
    assert passed(made_up_drive()) == []


def test_movers_are_first_seen_when_visible_and_passed_when_nearest(made_up_drive):
    drive = made_up_drive(size=(6.0, 4.0), obstacles=40, movers=2)
    to = drive.pose[:, :2] - (4.5, 2.0)
    nearer = drive.movers[:, 1] - to / 6 - (0.0, 0.3)
    turned = np.stack([drive.movers[:, 0], nearer], axis=1)
    log = scanned(replace(drive, movers=turned))
    rows, found = log.scan_rows, mover_sightings(log)
    assert min(sight.seen_at for sight in found) == 0 < max(sight.seen_at for sight in found)  # behind the other
    for j, sight in enumerate(found):
        angles = np.linspace(0.0, 2 * np.pi, 200)
        rim = 0.121 * np.column_stack([np.cos(angles), np.sin(angles)])
        seen = []  # how many places on the rim the lidar sees; two beams are less than 10 of them apart
        for k, row in enumerate(rows):
            towards = log.pose[row, :2] - log.movers[row, j]
            other = np.append(log.movers[row, 1 - j], 0.12)
            seen.append(int(visible(log, k, log.movers[row, j] + rim[rim @ towards > 0.0144], other).sum()))
        first = int(np.searchsorted(log.t[rows], sight.seen_at))
        assert np.argmax(np.array(seen) > 0) <= first <= np.argmax(np.array(seen) > 10), (seen, first)
        apart = np.hypot(*(log.pose[:, :2] - log.movers[:, j]).T) - 0.18 - 0.12
        assert sight.nearest == pytest.approx(apart.min())
        assert sight.nearest_at == log.t[apart.argmin()]
        assert sight.seen_from == pytest.approx(apart[np.searchsorted(log.t, sight.seen_at)])
    assert {j for j, sight in enumerate(found) if sight.passed} == {s.obstacle for s in passed(log) if s.mover}
    assert [sight.tracked_at for sight in found] == [math.inf, math.inf]


def test_a_mover_is_tracked_from_its_first_track_on(made_up_drive):
    """The estimate is 0.4 m and a quarter turn off, so that tracks lie elsewhere than movers."""
    log = scanned(made_up_drive(size=(6.0, 4.0), movers=2))
    x, y, yaw = log.pose.T
    log = replace(log, estimate=np.column_stack([-y + 0.4, x, yaw + np.pi / 2]))
    at = log.scan_rows[[2, 3, 5]]
    (x, y), noise = log.movers[at, 1].T, (0.05, -0.05)
    tracks = np.zeros((3, 7), dtype=np.float32)
    tracks[:, 0], tracks[:, 1], tracks[:, 2], tracks[:, 3] = at, 4, -y + 0.4 + noise[0], x + noise[1]
    tracks[0, 2] += 0.2  # not yet the mover
    first, second = mover_sightings(replace(log, tracks=tracks))
    assert math.isinf(first.tracked_at)
    assert second.tracked_at == log.t[at[1]]
    plain = second.as_dict()
    assert (plain["mover"], plain["followed_s"], "obstacle" in plain) == (1, second.tracked_at, False)
    touched = np.array([[200.0, len(log.record.world.obstacles) + 1, -0.001, 9.0]])
    assert [sight.touched for sight in mover_sightings(replace(log, contacts=touched))] == [False, True]


RANDOM = np.random.default_rng(5)
OWN, TRUE = RANDOM.uniform(-9, 9, (2, 40, 3))


def flat(points):
    return points[:, 0] + 1j * points[:, 1]


def test_a_frame_lies_so_that_both_poses_are_one():
    frames = relative_frame(OWN, TRUE)
    turn = np.exp(1j * frames[:, 2])
    np.testing.assert_allclose(flat(frames) + turn * flat(OWN), flat(TRUE), atol=1e-12)
    np.testing.assert_allclose(turn * np.exp(1j * OWN[:, 2]), np.exp(1j * TRUE[:, 2]), atol=1e-12)


def test_what_the_robot_sees_lies_as_it_lies_from_the_robot():
    seen = RANDOM.uniform(-9, 9, (40, 2))
    ahead = (flat(seen) - flat(OWN)) * np.exp(-1j * OWN[:, 2])
    there = flat(TRUE) + ahead * np.exp(1j * TRUE[:, 2])
    np.testing.assert_allclose(flat(transform_points(seen, relative_frame(OWN, TRUE))), there, atol=1e-12)


@given(st.lists(st.floats(0.002, 65.0), max_size=20))
def test_ranges_come_back_within_half_a_millimetre(ranges):
    given_ranges = np.array([*ranges, np.inf, -np.inf])
    back = ranges_of(millimetres(given_ranges))
    assert np.array_equal(back[-2:], [np.inf, -np.inf])
    assert np.abs(back[:-2] - given_ranges[:-2]).max(initial=0.0) <= 0.0005 + 1e-12
