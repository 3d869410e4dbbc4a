"""Properties of the controller's kernels that drives do not test."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots.control._kernels_obstacles import ObstacleIndex, index_discs
from antdrive.robots.control._kernels_path import PathSamples
from antdrive.robots.control._kernels_pursuit import full_braking, pursue, stopping_clearance, turn_in
from antdrive.robots.control.pursuit import obstacles_around
from tests.robots.control.test_rules import LIMITS, TUNING

WIDE = np.array([-50.0, -50.0, 50.0, 50.0])
NO_DISCS = np.empty((0, 3))


def among(discs):
    return obstacles_around(np.zeros(2), discs, WIDE)


@pytest.mark.parametrize(("v", "w"), [(1.0, 0.0), (1.0, 0.8), (0.6, -1.5), (2.0, 1e-9), (0.3, 3.0)])
def test_the_stopping_arc_is_that_of_a_period_and_of_braking(v, w):
    """Against the arc in a thousand small steps, from a rest of v dt + v^2 / 2a metres."""
    period, deceleration = 0.1, 1.0
    length = v * period + v**2 / (2 * deceleration)
    s = np.linspace(0, length, 1001)
    yaw = 0.4 + w / v * (s[1:] + s[:-1]) / 2
    x = 1.0 + np.concatenate([[0.0], np.cumsum(np.cos(yaw) * np.diff(s))])
    y = 2.0 + np.concatenate([[0.0], np.cumsum(np.sin(yaw) * np.diff(s))])
    for along in (0.0, 0.5, 0.9, 1.0):
        k = round(along * 1000)
        aside = 0.4 + w / v * s[k] + math.pi / 2
        disc = np.array([[x[k] + 0.3 * math.cos(aside), y[k] + 0.3 * math.sin(aside), 0.1]])
        expected = np.hypot(x - disc[0, 0], y - disc[0, 1]).min() - 0.1
        found = stopping_clearance(1.0, 2.0, 0.4, v, w, deceleration, period, among(disc), math.inf)
        assert found == pytest.approx(expected, abs=1e-4), along


def test_between_two_samples_the_shorter_lookahead_counts():
    """The robot is 2 cm beside a straight route; the arc to a carrot at 0.2 m has a curvature of 1/m."""
    xy, arc = np.array([(0.0, 0.0), (4.0, 0.0)]), np.array([0.0, 4.0])
    count = 202
    for first, second in ((1.0, 0.2), (0.2, 1.0)):
        lookahead = np.full(count, second)
        lookahead[: int(1.01 / TUNING.spacing) + 1] = first
        path = PathSamples(xy, arc, lookahead, np.full(count, 9.0), np.full(count, math.nan), np.zeros(count))
        obstacles = ObstacleIndex(*index_discs(NO_DISCS, WIDE, 10.0, 1.0), WIDE, WIDE[:2], 10.0)
        v, w, *_ = pursue(1.01, 0.02, 0.0, 0.5, 0.0, 0.9, False, path, obstacles, LIMITS, TUNING)
        assert w / v == pytest.approx(-2 * 0.02 / 0.2**2, rel=1e-6)


def room_to_stop(v, w, disc):
    """The clearance of a robot at the origin that drives for a period, then brakes on its curve; in small steps."""
    length = v * TUNING.period + v * v / (2 * LIMITS.acceleration)
    s = np.linspace(0, length, 2001)
    yaw = w / v * (s[1:] + s[:-1]) / 2
    x, y = (np.concatenate([[0.0], np.cumsum(f(yaw) * np.diff(s))]) for f in (np.cos, np.sin))
    return float(np.hypot(x - disc[0], y - disc[1]).min() - disc[2])


@given(
    v=st.floats(0.2, 1.0),
    bend=st.floats(-2.5, 2.5),
    curvature=st.floats(-3, 3),
    disc=st.tuples(st.floats(0.3, 1.0), st.floats(-0.6, 0.6), st.floats(0.05, 0.2)),
    required=st.floats(0.0, 0.4),
)
def test_a_braking_robot_leaves_its_curve_only_where_that_is_not_clear_and_only_for_a_clearer_one(
    v, bend, curvature, disc, required
):
    discs, w = np.array([disc]), bend * v
    new_v, new_w = full_braking(0, 0, 0, v, w, curvature, required, among(discs), LIMITS, TUNING)
    assert new_v == v - LIMITS.acceleration * TUNING.period
    held, found = (room_to_stop(new_v, yaw_rate, discs[0]) for yaw_rate in (bend * new_v, new_w))
    if held > required + 1e-4:
        assert new_w == pytest.approx(bend * new_v, abs=1e-12)
    assert found >= held - 1e-4
    assert abs(new_w - w) <= LIMITS.yaw_acceleration * TUNING.period + 1e-12 or new_w == pytest.approx(bend * new_v)


def test_a_braking_robot_whose_curve_leads_into_a_pillar_steers_away_from_it():
    """On the bend to the left it stops 225 mm from the pillar's surface, straight ahead 314 mm."""
    pillar = np.array([[0.6, 0.4, 0.1]])
    clear = full_braking(0, 0, 0, 1.0, 0.8, 0.0, 0.2, among(pillar), LIMITS, TUNING)
    assert clear == pytest.approx((0.9, 0.72))
    assert full_braking(0, 0, 0, 1.0, 0.8, 0.0, 0.25, among(pillar), LIMITS, TUNING) == pytest.approx((0.9, 0.0))
    right = np.array([[0.6, -0.3, 0.1]])
    assert full_braking(0, 0, 0, 1.0, 0.8, 0.0, 0.9, among(right), LIMITS, TUNING) == pytest.approx((0.9, 0.72))
    assert full_braking(0, 0, 0, 0.1, 0.08, 0.0, 0.9, among(pillar), LIMITS, TUNING) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("posts", "turns"),
    [
        ([], True),
        ([(0.75, 0.5, 0.1)], False),  # on its left, where the turned stopping arc ends
        ([(0.75, 0.0, 0.1)], True),  # ahead: it stops farther from the post if it turns
        ([(0.75, -0.5, 0.1)], True),
    ],
)
def test_a_robot_that_brakes_for_a_rotation_turns_in_where_it_then_stops_with_room(posts, turns):
    tuning = TUNING._replace(turn_in_clearance=0.5)
    discs = np.array(posts).reshape(-1, 3)
    turned = turn_in(0.0, 0.0, 0.0, 0.9, 0.5, 1.5, 0.45, among(discs), LIMITS, tuning)
    assert turned == pytest.approx(1.0 / 0.9 if turns else 0.45)  # its lateral acceleration is 1 m/s^2
