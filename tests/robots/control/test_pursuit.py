"""The controller in closed loop with perfect wheels, without physics."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots import LIMITERS, PurePursuit, PursuitState, Twist
from antdrive.robots.control._kernels_path import clearance_below
from antdrive.worlds import Disc, Route, World, point_clearance
from antdrive.worlds._kernels import segment_clearance
from tests.robots.control.profiles import profile

OPEN = World("open", (-20, -20, 20, 20))
DT = 1 / 60


def follow(robot, route, pose, world=OPEN, margin=0.05):
    controller = PurePursuit()
    tracked = controller.prepare(route, world, robot, margin, DT)
    pose = (float(pose[0]), float(pose[1]), float(pose[2]))  # for whole numbers the kernel would be compiled again
    command, state = Twist(0.0, 0.0), PursuitState()
    poses, commands, states = [pose], [command], [state]
    for _ in range(60 * 120):
        command, state = controller.pursue(tracked, pose, command, state)
        x, y, yaw = pose
        middle = yaw + command.yaw_rate * DT / 2
        pose = (
            x + command.speed * math.cos(middle) * DT,
            y + command.speed * math.sin(middle) * DT,
            yaw + command.yaw_rate * DT,
        )
        poses.append(pose)
        commands.append(command)
        states.append(state)
        if LIMITERS[state.limiter] == "done" and command.speed == 0:
            break
    return np.array(poses), np.array(commands), states


STAIRCASE = Route(np.array([(0.5 * ((i + 1) // 2), 0.5 * (i // 2)) for i in range(13)]))


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, math.pi, -2.5])
def test_the_robot_arrives_from_any_heading_within_its_limits(robot, yaw, request):
    spec = request.getfixturevalue(robot)
    poses, commands, states = follow(spec, STAIRCASE, (0, 0, yaw))
    assert math.dist(poses[-1][:2], STAIRCASE.xy[-1]) < 0.06
    v, w = commands.T
    assert v.max() <= spec.max_speed + 1e-9
    assert v.min() >= 0
    assert np.abs(w).max() <= spec.max_yaw_rate + 1e-9
    assert np.abs(np.diff(v)).max() <= spec.max_acceleration * DT + 1e-9
    assert np.abs(np.diff(w)).max() <= spec.max_yaw_acceleration * DT + 1e-9
    rim = np.abs(v) + np.abs(w) * spec.track / 2
    assert rim.max() <= spec.max_wheel_speed * spec.wheel_radius + 1e-9
    arcs = [state.arc for state in states]
    assert arcs == sorted(arcs)


def test_the_robot_rotates_in_place_if_the_route_starts_behind_it(turtlebot):
    poses, _, states = follow(turtlebot, Route(np.array([(0.0, 0.0), (-3.0, 0.0)])), (0, 0, 0))
    assert states[1].turning
    assert poses[:, 0].max() < 0.01  # it does not drive a curve
    assert poses[-1, 0] == pytest.approx(-3, abs=0.02)


def test_the_robot_converges_to_a_straight_route(jackal):
    poses, commands, _ = follow(jackal, Route(np.array([(0.0, 0.0), (10.0, 0.0)])), (0, 0.1, 0))
    assert np.abs(poses[len(poses) // 2 :, 1]).max() < 0.005
    assert commands[:, 0].max() == pytest.approx(2.0)


def test_corners_are_cut_only_where_there_is_room(jackal):
    """The same corner without and with a thin post on its inside."""
    route = Route(np.array([(0.0, 0.0), (3.0, 0.0), (5.0, 2.0)]))
    margin = 0.05
    keep = jackal.radius + margin + 0.01  # the route just keeps its clearance to the post
    post = World("post", OPEN.bounds, (Disc(3 - keep * math.tan(math.pi / 8), keep, 0.01),))
    free, _, _ = follow(jackal, route, (0, 0, 0), OPEN, margin)
    guarded, _, _ = follow(jackal, route, (0, 0, 0), post, margin)
    # Without the post, the corner is cut where the post would stand.
    assert point_clearance(post, free[:, :2]).min() < jackal.radius + 0.2 * margin
    assert point_clearance(post, guarded[:, :2]).min() > jackal.radius + 0.35 * margin


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_robot_far_from_its_route_does_not_creep_back_to_a_corner(side, turtlebot):
    """The route stops at its corner; the robot beside it can drive back at speed and still brake before the corner."""
    route = Route(np.array([(0.0, 0.0), (2.0, 0.0), (0.0, -0.8 * side)]))
    controller = PurePursuit()
    tracked = controller.prepare(route, OPEN, turtlebot, 0.05, DT)
    pose, command, state = (2.05, 0.8 * side, -math.pi / 2 * side), Twist(0.0, 0.0), PursuitState(arc=1.95)
    fastest = 0.0
    for period in range(60 * 4):
        command, state = controller.pursue(tracked, pose, command, state)
        pose = (
            pose[0] + command.speed * math.cos(pose[2]) * DT,
            pose[1] + command.speed * math.sin(pose[2]) * DT,
            pose[2] + command.yaw_rate * DT,
        )
        fastest = max(fastest, command.speed)
        away = math.dist(pose[:2], route.xy[1])
        assert command.speed**2 <= 2 * turtlebot.max_acceleration * away + 0.1**2, f"too fast at period {period}"
        if away < 0.15:
            break
    assert away < 0.15
    assert fastest > 0.3


def bends(radius, bulge=5e-4):
    """A straight line, half a circle to the left, half to the right and a straight line, as in smoothed routes."""
    points, curvature = [(0.0, 0.0)], [0.0]
    for centre, begin, turn in (((3.0, radius), -math.pi / 2, 1), ((3.0, 3 * radius), -math.pi / 2, -1)):
        count = math.ceil(math.pi / (2 * math.acos(radius / (radius + bulge))))
        for i in range(count):
            angle = begin + turn * math.pi * (i + 0.5) / count
            reach = radius / math.cos(math.pi / count / 2)
            points.append((centre[0] + reach * math.cos(angle), centre[1] + reach * math.sin(angle)))
            curvature.append(turn / radius)
    points += [(3.0, 4 * radius), (6.0, 4 * radius)]
    curvature += [0.0, 0.0]
    return Route(np.array(points), np.array(curvature))


def cross_track(poses, route):
    a, along = route.xy[:-1], np.diff(route.xy, axis=0)
    offset = poses[:, None, :2] - a
    f = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    return np.linalg.norm(offset - f[:, :, None] * along, axis=2).min(axis=1)


@pytest.mark.parametrize(("radius", "speed"), [(0.5, 1.0), (2.0, 2.0)])
def test_bends_of_known_curvature_are_followed_and_not_cut(radius, speed, jackal):
    """Their speed is the limit of the lateral acceleration. Steering for the carrot alone cuts them."""
    route = bends(radius)
    poses, commands, _ = follow(jackal, route, (0, 0, 0))
    fast = commands[:, 0] > 0.7 * speed
    assert fast.sum() > 100
    error = float(np.percentile(cross_track(poses[fast], route), 95))
    assert error < 0.01
    cut, commands, _ = follow(jackal, Route(route.xy), (0, 0, 0))
    assert float(np.percentile(cross_track(cut[commands[:, 0] > 0.4], route), 95)) > 2 * error


def test_a_drive_takes_as_long_as_its_speed_profile_predicts(jackal):
    route = bends(0.8)
    _, commands, _ = follow(jackal, route, (0, 0, 0))
    assert len(commands) * DT == pytest.approx(profile(route, jackal, braking=0.7).duration, rel=0.05)


def test_a_standing_robot_turns_to_the_route_first_and_a_moving_one_does_not_stop_for_it(jackal):
    straight = Route(np.array([(0.0, 0.0), (5.0, 0.0)]))
    poses, _, states = follow(jackal, straight, (0, 0, 0.5))
    assert states[1].turning
    assert np.abs(poses[:, 1]).max() < 0.02  # otherwise it would leave the route
    controller = PurePursuit()
    tracked = controller.prepare(straight, OPEN, jackal, 0.05, DT)
    _, state = controller.pursue(tracked, (1.0, 0.0, 0.5), Twist(1.0, 0.0), PursuitState(1.0))
    assert not state.turning


def test_the_robot_is_slow_between_close_obstacles_and_the_limiter_is_clearance(jackal):
    gate = World("gate", OPEN.bounds, tuple(Disc(5, side * (jackal.radius + 0.02 + 0.3), 0.3) for side in (1, -1)))
    poses, commands, states = follow(
        jackal, Route(np.array([(0.0, 0.0), (10.0, 0.0)]), np.zeros(2)), (0, 0, 0), gate, 0.02
    )
    inside = np.abs(poses[:, 0] - 5) < 0.1
    assert commands[inside, 0].max() < 1.5
    assert {LIMITERS[states[i].limiter] for i in np.flatnonzero(inside)} <= {"route", "clearance"}
    assert commands[:, 0].max() == pytest.approx(2.0)


@settings(max_examples=25)
@given(
    turns=st.lists(st.sampled_from([-135, -90, -45, 0, 45, 90, 135]), min_size=1, max_size=6),
    step=st.sampled_from([0.15, 0.4, 1.0]),
)
def test_any_grid_like_route_is_driven_to_its_end(turns, step):
    from antdrive.robots import load_robot

    heading, xy = 0.0, [(0.0, 0.0), (step, 0.0)]
    for turn in turns:
        heading += math.radians(turn)
        xy.append((xy[-1][0] + step * math.cos(heading), xy[-1][1] + step * math.sin(heading)))
    poses, _, _ = follow(load_robot("jackal"), Route(np.array(xy)), (0, 0, 0))
    assert math.dist(poses[-1][:2], xy[-1]) < 0.06


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("lookahead_time", 0.0, "between 0.001 and 100"),
        ("lookahead_margin", 1.5, "between 0 and 1"),
        ("braking", 0.0, "greater than 0 and at most 1"),
        ("lookahead_max", 0.01, "at least lookahead_min"),
        ("rotate_in_place_above", 3.0, "between rotate_in_place_until and pi/2"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(key, value, message):
    with pytest.raises(ValueError, match=f"{key}: .*{message}"):
        PurePursuit(**{key: value})


def test_a_path_may_be_sampled_more_coarsely(turtlebot):
    world = World("post", (-20, -20, 20, 20), (Disc(1.6, 0.9, 0.2),))
    fine = PurePursuit().prepare(STAIRCASE, world, turtlebot, 0.05, DT)
    coarse = PurePursuit().prepare(STAIRCASE, world, turtlebot, 0.05, DT, spacing=0.06)
    assert coarse.tuning.spacing == 0.06
    assert len(coarse.samples.speed) == int(STAIRCASE.length / 0.06) + 2
    np.testing.assert_allclose(
        coarse.samples.lookahead[:-1], fine.samples.lookahead[::3][: len(coarse.samples.speed) - 1]
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_obstacles_that_are_not_sorted_by_place_prepare_the_same_path(turtlebot, seed):
    rng = np.random.default_rng(seed)
    posts = tuple(Disc(*rng.uniform(-3, 5, 2).tolist(), 0.1) for _ in range(60))
    world = World("posts", (-20, -20, 20, 20), posts)
    ways = [PurePursuit().prepare(STAIRCASE, world, turtlebot, 0.05, DT, indexed=indexed) for indexed in (True, False)]
    for sorted_by_place, unsorted in zip(*(way.samples for way in ways), strict=True):
        assert np.array_equal(sorted_by_place, unsorted, equal_nan=True)


@given(st.integers(0, 10_000))
def test_skipped_discs_change_no_clearance(seed):
    """The oracle samples the segment, and is too large by half the distance between samples at most."""
    rng = np.random.default_rng(seed)
    discs, bounds = (
        np.column_stack((rng.uniform(0, 9, (40, 2)), rng.uniform(0.01, 0.5, 40))),
        np.array([0.0, 0.0, 9.0, 9.0]),
    )
    a, b = rng.uniform(0, 9, 2), rng.uniform(0, 9, 2)
    points = a + np.linspace(0, 1, 2000)[:, None] * (b - a)
    away = np.hypot(*(points[:, None] - discs[:, :2]).transpose(2, 0, 1)) - discs[:, 2]
    expected = min(away.min(), points.min(), (9 - points).min())
    found = segment_clearance(*a, *b, discs, bounds)
    assert expected - np.hypot(*(b - a)) / 3998 - 1e-12 <= found <= expected + 1e-12
    for most in (expected - 0.1, expected + 0.1):
        below = clearance_below(most, *a, *b, discs, bounds)
        assert below == found if found < most else below >= most


def test_driving_backwards_mirrors_driving_forwards(turtlebot):
    controller = PurePursuit()
    tracked = controller.prepare(STAIRCASE, OPEN, turtlebot, 0.05, DT)
    ahead, _ = controller.pursue(tracked, (0.2, 0.1, 0.4), Twist(0.1, 0.2), PursuitState())
    backwards = replace(tracked, backwards=True)
    behind, _ = controller.pursue(backwards, (0.2, 0.1, 0.4 - math.pi), Twist(-0.1, 0.2), PursuitState())
    assert behind == pytest.approx(Twist(-ahead.speed, ahead.yaw_rate))
    assert ahead.speed > 0.05
