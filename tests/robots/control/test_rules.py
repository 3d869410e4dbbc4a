"""The controller's speed rules and its geometry, each by itself."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from antdrive.robots import list_robots, load_robot
from antdrive.robots.control._kernels_obstacles import arc_clearance
from antdrive.robots.control._kernels_path import brake_backwards, carrot_at, point_at, project
from antdrive.robots.control._kernels_pursuit import (
    CREEP,
    CRUISE,
    CURVATURE,
    GOAL,
    ROUTE,
    YAW_RATE,
    Carrot,
    MotionLimits,
    PursuitTuning,
    brake_for_goal,
    keep_wheels_within,
    reachable_twist,
    reachable_yaw_rate,
    should_rotate,
    slow_for_clearance,
    slow_for_curvature,
    slow_for_yaw_rate,
    speed_limit,
)

BOUNDS = np.array([-50.0, -50.0, 50.0, 50.0])
NO_DISCS = np.empty((0, 3))
CORNER = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
CORNER_ARC = np.array([0.0, 1.0, 2.0])


@given(v=st.floats(-3, 3), w=st.floats(-6, 6), half_track=st.floats(0.05, 0.4), fastest=st.floats(0.1, 2))
def test_saturated_wheels_keep_the_curvature(v, w, half_track, fastest):
    limits = LIMITS._replace(half_track=half_track, rim_speed=fastest)
    new_v, new_w = keep_wheels_within(v, w, 0.0, 0.1, limits)
    assert abs(new_v) + abs(new_w) * half_track <= fastest * (1 + 1e-12)
    assert new_v * w == pytest.approx(v * new_w, abs=1e-9)
    if abs(v) + abs(w) * half_track <= fastest:
        assert (new_v, new_w) == (v, w)


def saturated(share, turn, wanted, limits, period):
    """The speed before, and speed and yaw rate after, of a robot that turns in with wheels at `share` of what they reach."""
    w = turn * share * limits.rim_speed / limits.half_track
    v = share * limits.rim_speed - abs(w) * limits.half_track
    return v, *reachable_twist(v, wanted, v, w, period, limits)


@given(
    share=st.just(1.0) | st.floats(0, 1), turn=st.floats(-1, 1), wanted=st.floats(-9, 9), half_track=st.floats(0.05, 0.4),
    acceleration=st.floats(0.1, 3), yaw_acceleration=st.floats(0.5, 20),
)  # fmt: skip
@example(share=1.0, turn=0.0, wanted=9.0, half_track=0.2, acceleration=1.0, yaw_acceleration=8.0)
def test_wheels_at_their_limit_do_not_make_a_robot_brake_harder_than_certificates_allow(
    share, turn, wanted, half_track, acceleration, yaw_acceleration
):
    limits = LIMITS._replace(
        half_track=half_track, acceleration=acceleration, yaw_acceleration=yaw_acceleration, yaw_rate=99.0
    )
    v, new_v, new_w = saturated(share, turn, wanted, limits, 1 / 60)
    assert abs(new_v) + abs(new_w) * half_track <= limits.rim_speed * (1 + 1e-12)
    assert v - new_v <= 1.4 * acceleration / 60 * (1 + 1e-9) + 1e-12


@given(
    name=st.sampled_from(sorted(list_robots())), share=st.floats(0, 1), turn=st.floats(-1, 1), wanted=st.floats(-9, 9)
)
@example(name="turtlebot3-waffle", share=1.0, turn=0.0, wanted=9.0)  # of all of them it has the least room
def test_the_catalogues_robots_turn_in_with_both_speeds_scaled_together(name, share, turn, wanted):
    """Bit for bit: their wheels leave room enough for that, and so their drives are as they were."""
    robot = load_robot(name)
    limits = MotionLimits(
        robot.max_speed, robot.max_yaw_rate, robot.max_acceleration, robot.max_yaw_acceleration,
        robot.max_lateral_acceleration, robot.track / 2, robot.max_wheel_speed * robot.wheel_radius,
    )  # fmt: skip
    v, *found = saturated(share, turn, wanted, limits, 1 / 60)
    w = turn * share * limits.rim_speed / limits.half_track
    plain_w = reachable_yaw_rate(wanted, w, 1 / 60, limits)
    rim = abs(v) + abs(plain_w) * limits.half_track
    scaled = [v, plain_w]
    if rim > limits.rim_speed:
        scaled = [v * limits.rim_speed / rim, plain_w * limits.rim_speed / rim]
    assert found == scaled


def test_speed_in_curves_is_limited_by_lateral_acceleration_and_yaw_rate():
    for side in (1, -1):
        assert slow_for_curvature(side * 0.5, 2.0, 4.0) == pytest.approx(2.0)  # v^2 * 0.5 = 2
        assert slow_for_curvature(side * 8.0, 9.0, 4.0) == pytest.approx(0.5)  # 8 v = 4 rad/s
    assert slow_for_curvature(0.0, 2.0, 4.0) == math.inf


def test_the_robot_can_brake_within_what_remains():
    assert brake_for_goal(1.0, 2.0) == pytest.approx(2.0)
    assert brake_for_goal(-0.1, 2.0) == 0.0


def test_a_yaw_rate_out_of_reach_limits_the_speed():
    # 0.1 s at 8 rad/s^2 from standing: 0.8 rad/s; on a curve of 4 / m that is 0.2 m/s
    assert slow_for_yaw_rate(4.0, 0.0, 8.0, 0.1) == pytest.approx(0.2)
    assert slow_for_yaw_rate(-4.0, 0.0, 8.0, 0.1) == pytest.approx(0.2)
    assert slow_for_yaw_rate(4.0, -2.0, 8.0, 0.1) == 0.0  # it turns the other way and must stop first


def test_close_obstacles_limit_the_speed():
    assert slow_for_clearance(0.0, 0.5, 0.05) == 0.5
    assert slow_for_clearance(0.05, 0.5, 0.05) == pytest.approx(1.5)
    assert slow_for_clearance(-0.1, 0.5, 0.05) == 0.5


LIMITS = MotionLimits(
    speed=1.0, yaw_rate=3.0, acceleration=1.0, yaw_acceleration=8.0, lateral_acceleration=1.0, half_track=0.1,
    rim_speed=2.0,
)  # fmt: skip
TUNING = PursuitTuning(
    period=0.1, spacing=0.02, lookahead_clearance=0.2, stopping_clearance=0.2, robot_radius=0.2, half_length=0.0,
    half_width=0.0, rounding=0.2, corners=np.empty((0, 2)), lookahead_time=0.25, lookahead_min=0.1, lookahead_max=1.0,
    preferred_lookahead_min=0.3, rotate_above=1.0, rotate_above_at_rest=0.2, rotate_until=0.1, braking=0.5,
    creep_speed=0.04, goal_distance=0.02, min_speed_near_obstacles=0.5, clearance_time=0.05,
    turn_in_clearance=math.inf,
)  # fmt: skip


@pytest.mark.parametrize(
    ("curvature", "route_speed", "remaining", "clear", "speed", "limiter"),
    [
        (0.0, 2.0, 10.0, True, 1.0, CRUISE),
        (2.0, 2.0, 10.0, True, math.sqrt(0.5), CURVATURE),
        (4.0, 2.0, 10.0, True, 0.4, YAW_RATE),  # 8 rad/s^2 for 0.2 s
        (4.0, 0.3, 10.0, True, 0.3, ROUTE),
        (0.0, 2.0, 0.17, True, 0.4, GOAL),  # 0.16 m at 0.5 m/s^2
        (0.0, 2.0, 10.0, False, 0.04, CREEP),
    ],
)
def test_the_lowest_rule_limits_the_speed(curvature, route_speed, remaining, clear, speed, limiter):
    allowed, rule = speed_limit(0.0, curvature, route_speed, 1.0, remaining, clear, LIMITS, TUNING)
    assert allowed == pytest.approx(speed)
    assert rule == limiter


@pytest.mark.parametrize(
    ("rotating", "speed", "bearing", "clear", "rotates"),
    [
        (False, 0.5, 0.9, True, False),
        (False, 0.5, -1.1, True, True),
        (False, 0.0, 0.3, True, True),  # at rest
        (False, 0.0, 0.15, True, False),
        (False, 0.5, 0.15, False, True),  # no arc is clear
        (True, 0.0, 0.15, True, True),  # it goes on until the bearing is below 0.1
        (True, 0.0, 0.05, False, False),
    ],
)
def test_a_robot_rotates_in_place_for_a_large_bearing_until_it_is_small(rotating, speed, bearing, clear, rotates):
    assert should_rotate(rotating, speed, Carrot(0.3, 0.0, 0.3, bearing, clear), TUNING) is rotates


def test_a_command_changes_no_faster_than_the_robot_can():
    assert reachable_twist(1.0, 2.0, 0.2, -0.5, 0.1, LIMITS) == pytest.approx((0.3, 0.3))
    assert reachable_twist(-1.0, 0.1, 0.2, 0.0, 0.1, LIMITS) == pytest.approx((0.1, 0.1))


def test_speeds_are_lowered_backwards_by_braking_distance():
    limit = np.array([2.0, 2.0, 2.0, 0.0])
    brake_backwards(limit, 0.5, 1.0)
    np.testing.assert_allclose(limit, [math.sqrt(3), math.sqrt(2), 1.0, 0.0])


@given(x=st.floats(-0.3, 1.3), y=st.floats(-0.3, 1.3), look=st.floats(0.1, 0.6))
def test_the_carrot_is_at_the_true_lookahead_distance(x, y, look):
    s, segment = project(x, y, 0.0, 10.0, CORNER, CORNER_ARC)
    px, py, _ = point_at(s, segment, CORNER, CORNER_ARC)
    cx, cy = carrot_at(x, y, look, s, segment, CORNER, CORNER_ARC)
    off = math.hypot(px - x, py - y)
    if off < look:
        assert math.hypot(cx - x, cy - y) == pytest.approx(look)
        on_route = min(abs(cy) if cx <= 1 else math.inf, abs(cx - 1) if cy >= 0 else math.inf)
        assert on_route < 1e-9  # the last segment extends beyond y = 1
    else:
        assert (cx, cy) == pytest.approx((px, py))


def test_projection_never_moves_back_and_never_jumps_across_a_hairpin():
    hairpin = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 0.4], [0.0, 0.4]])
    arc = np.array([0.0, 3.0, 3.4, 6.4])
    s, _ = project(1.0, 0.25, 0.9, 1.0, hairpin, arc)  # closer to the second leg, 4.4 m later
    assert s == pytest.approx(1.0)
    s, _ = project(0.2, 0.0, 0.9, 1.0, hairpin, arc)
    assert s == pytest.approx(0.9)


def sampled_arc(yaw, curvature, sweep):
    turn = np.linspace(0, sweep, 4001)
    return np.stack(
        [(np.sin(yaw + turn) - math.sin(yaw)) / curvature, (math.cos(yaw) - np.cos(yaw + turn)) / curvature], axis=1
    )


@given(
    yaw=st.floats(-3.1, 3.1),
    curvature=st.floats(0.2, 5).flatmap(lambda c: st.sampled_from([c, -c])),
    angle=st.floats(0.01, 2.8),
    disc=st.tuples(st.floats(-6, 6), st.floats(-6, 6), st.floats(0.05, 3.0)),
)
def test_an_arcs_clearance_is_that_of_its_points(yaw, curvature, angle, disc):
    sweep = math.copysign(angle, curvature)
    points = sampled_arc(yaw, curvature, sweep)
    discs, bounds = np.array([disc]), np.array([-3.0, -3.0, 3.0, 3.0])
    brute = min(
        np.hypot(points[:, 0] - disc[0], points[:, 1] - disc[1]).min() - disc[2],
        (points - bounds[:2]).min(),
        (bounds[2:] - points).min(),
    )
    exact = arc_clearance(0.0, 0.0, yaw, curvature, sweep, points[-1, 0], points[-1, 1], discs, bounds, math.inf)
    assert exact == pytest.approx(brute, abs=5e-3)
    assert exact <= brute + 1e-9
