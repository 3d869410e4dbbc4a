"""Speed profiles: results worked out by hand, and the robot's limits on random routes."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots import Noise, PurePursuit, list_robots, load_robot
from antdrive.robots.control._kernels_profile import samples_along, turning_time
from antdrive.robots.control.pursuit import indexed_obstacles
from antdrive.worlds import Route, World, forest, point_clearance
from tests.robots.control.profiles import profile


def straight(length):
    return Route([[0.0, 0.0], [length, 0.0]])


def prepared(robot, noise):
    open_ground = World("open", (-5.0, -5.0, 35.0, 5.0))
    route = Route([[0.0, 0.0], [30.0, 0.0]], np.zeros(2))
    return PurePursuit().prepare(route, open_ground, robot, 0.03, 1 / 60, noise=noise)


def around(radius, sweep, bulge=5e-4):
    """An arc as smoothed routes contain it: a polyline whose vertices lie outside the arc."""
    count = math.ceil(abs(sweep) / (2 * math.acos(radius / (radius + bulge))))
    half = sweep / count / 2
    angles = np.concatenate(([0.0], half * (2 * np.arange(count) + 1), [sweep]))
    reach = np.full(len(angles), radius / math.cos(half))
    reach[[0, -1]] = radius
    curvature = np.full(len(angles), math.copysign(1 / radius, sweep))
    return Route(np.stack((reach * np.cos(angles), reach * np.sin(angles)), axis=1), curvature)


def test_speeds_on_a_straight_line_form_a_trapezoid(turtlebot):
    """0.7 m/s at 1 m/s^2: 0.7 s and 0.245 m to accelerate, and the same to brake."""
    p = profile(straight(2.0), turtlebot, step=0.005)
    assert p.duration == pytest.approx(2.0 / 0.7 + 0.7, abs=1e-4)
    assert p.speed.max() == pytest.approx(0.7)
    assert np.interp(0.125, p.arc, p.speed) == pytest.approx(0.5, abs=1e-3)
    assert np.interp(2.0 - 0.02, p.arc, p.speed) == pytest.approx(0.2, abs=1e-3)
    assert np.interp(1.0, p.arc, p.time) == pytest.approx(p.duration / 2)
    assert p.speed[0] == p.speed[-1] == 0.0
    assert not p.curvature.any()


def test_speeds_on_a_short_line_form_a_triangle_whose_peak_depends_on_the_braking(turtlebot):
    p = profile(straight(0.32), turtlebot, step=0.0025)
    assert p.duration == pytest.approx(2 * math.sqrt(0.32), abs=1e-4)
    assert p.speed.max() == pytest.approx(math.sqrt(0.32), abs=1e-3)
    soft = profile(straight(0.36), turtlebot, step=0.0025, braking=0.5)  # v^2 = 2 s1 = s2, s1 + s2 = 0.36
    assert soft.speed.max() == pytest.approx(math.sqrt(0.24), abs=2e-3)
    assert soft.duration == pytest.approx(math.sqrt(0.24) * 3, abs=1e-3)
    assert profile(straight(1e-4), turtlebot).duration == pytest.approx(0.02, rel=0.01)


def test_a_long_arc_is_driven_at_the_lowest_of_its_speed_limits(turtlebot, jackal):
    def cruise(robot, radius):
        p = profile(around(radius, 3.0), robot)
        return float(np.interp(p.arc[-1] / 2, p.arc, p.speed))

    assert cruise(jackal, 0.5) == pytest.approx(1.0, rel=1e-3)  # sqrt(2 m/s^2 * 0.5 m)
    assert cruise(turtlebot, 0.36) == pytest.approx(0.6, rel=1e-3)  # sqrt(1 * 0.36)
    slow_turner = dataclasses.replace(jackal, max_yaw_rate=1.2)
    assert cruise(slow_turner, 0.5) == pytest.approx(0.6, rel=1e-3)  # 1.2 rad/s * 0.5 m
    weak = dataclasses.replace(jackal, max_wheel_speed=8.0)  # rim 0.784 m/s = v (1 + 0.3756 / 2 / 0.5)
    assert cruise(weak, 0.5) == pytest.approx(0.784 / 1.3756, rel=1e-3)


def test_acceleration_on_an_arc_respects_the_yaw_acceleration(jackal):
    sluggish = dataclasses.replace(jackal, max_yaw_acceleration=1.0)
    p = profile(around(2.0, 2.5), dataclasses.replace(sluggish, max_lateral_acceleration=50.0), blend=0.05)
    a = np.diff(p.speed**2) / 2 / np.diff(p.arc)
    middle = (p.arc[1:] > 0.5) & (p.arc[1:] < 1.0)
    np.testing.assert_allclose(a[middle], 2.0, rtol=2e-3)  # 1 rad/s^2 at a radius of 2 m is 2 m/s^2
    tighter = profile(around(1.0, 2.5), dataclasses.replace(sluggish, max_lateral_acceleration=50.0), blend=0.05)
    a = np.diff(tighter.speed**2) / 2 / np.diff(tighter.arc)
    middle = (tighter.arc[1:] > 0.3) & (tighter.arc[1:] < 0.6)
    np.testing.assert_allclose(a[middle], 1.0, rtol=2e-3)


@pytest.mark.parametrize(("noise", "error"), [(0.5, 0.04), (1.0, 0.08), (2.0, 0.08)])
def test_noise_and_little_yaw_acceleration_lengthen_the_lookahead_and_lower_the_speed(noise, error, jackal):
    """An error is undone in 2 sqrt(error / a), over which the robot drifts by half of the error."""
    heavy = dataclasses.replace(jackal, max_yaw_acceleration=0.25)
    path = prepared(heavy, noise)
    assert path.tuning.lookahead_time == pytest.approx(math.sqrt(2 * error / 0.25))
    assert path.limits.speed * error / 2 * 2 * math.sqrt(error / 0.25) == pytest.approx(0.025)
    assert path.samples.speed.max() == path.limits.speed


def test_a_robot_without_noise_keeps_its_speed_and_lookahead(jackal):
    heavy = dataclasses.replace(jackal, max_yaw_acceleration=0.25)
    for path in (prepared(heavy, 0.0), prepared(dataclasses.replace(heavy, noise=Noise()), 1.0)):
        assert (path.limits.speed, path.tuning.lookahead_time) == (2.0, 0.25)


@pytest.mark.parametrize("name", list_robots())
def test_robots_of_the_catalogue_keep_their_speed_and_lookahead_at_any_noise(name):
    robot = load_robot(name)
    path = prepared(robot, 2.0)
    assert (path.limits.speed, path.tuning.lookahead_time) == (robot.max_speed, PurePursuit().lookahead_time)


def test_at_a_sharp_corner_the_robot_stops_and_rotates_in_place(turtlebot):
    route = Route([[0, 0], [1, 0], [1, 1]])
    p = profile(route, turtlebot, step=0.005)
    leg = 1.0 / 0.7 + 0.7
    turn = (math.pi / 2) / 3.14 + 3.14 / 8.0
    assert p.duration == pytest.approx(2 * leg + turn, abs=2e-3)
    assert turning_time(math.pi / 2, 3.14, 8.0) == pytest.approx(turn)
    assert turning_time(-0.5, 3.14, 8.0) == pytest.approx(2 * math.sqrt(0.5 / 8.0))
    at = np.flatnonzero(p.arc == 1.0)
    assert len(at) == 2
    assert not p.speed[at].any()
    assert np.diff(p.time[at])[0] == pytest.approx(turn)
    assert not p.curvature.any()
    through = profile(route, turtlebot, rotate_in_place_above=2.0)
    assert (through.speed[1:-1] > 0.0).all()
    assert through.duration < p.duration


def test_a_slight_corner_is_rounded_within_the_blend(turtlebot):
    route = Route([[0, 0], [2, 0], [2 + math.cos(0.5), math.sin(0.5)]])
    p = profile(route, turtlebot, blend=0.25, step=0.005)
    peak = np.interp(2.0, p.arc, p.curvature)
    assert peak == pytest.approx(0.5 / 0.25, rel=0.03)  # the area of a triangle is the corner's angle
    assert np.interp(2.0 - 0.26, p.arc, p.curvature) == pytest.approx(0.0, abs=1e-9)
    assert np.sum(np.diff(p.arc) * p.curvature[:-1]) == pytest.approx(0.5, abs=1e-6)
    assert np.interp(2.0, p.arc, p.speed) <= math.sqrt(1.0 / 2.0) * 1.02
    assert p.speed[200:-200].min() > 0.4


def test_the_curvature_of_an_arc_is_exact_and_constant():
    p = profile(around(0.44, -2.5), load_robot("jackal"), blend=0.1)
    inner = (p.arc > 0.15) & (p.arc < p.arc[-1] - 0.15)
    np.testing.assert_allclose(p.curvature[inner], -1 / 0.44, rtol=2e-3)


@given(st.lists(st.tuples(st.floats(0.05, 1.5), st.floats(-1.5, 1.5)), min_size=1, max_size=8), st.booleans())
def test_all_limits_hold_on_random_routes(legs, fast_robot):
    robot = load_robot("jackal" if fast_robot else "turtlebot")
    heading, points = 0.0, [np.zeros(2)]
    for length, turn in legs:
        points.append(points[-1] + length * np.array([math.cos(heading), math.sin(heading)]))
        heading += turn
    p = profile(Route(np.array(points)), robot)
    check(p, robot)


def check(p, robot):
    v, k = p.speed, np.abs(p.curvature)
    assert np.isfinite(p.time).all()
    assert (np.diff(p.time) > 0).all()
    assert v[0] == v[-1] == 0.0
    assert (v <= robot.max_speed + 1e-12).all()
    assert (v * k <= robot.max_yaw_rate + 1e-9).all()
    assert (v * v * k <= robot.max_lateral_acceleration + 1e-9).all()
    assert (v + v * k * robot.track / 2 <= robot.max_wheel_speed * robot.wheel_radius + 1e-9).all()
    ds = np.diff(p.arc)
    moving = ds > 0
    a = (np.diff(v**2)[moving] / 2) / ds[moving]
    assert (np.abs(a) <= robot.max_acceleration + 1e-6).all()
    yaw = np.diff(p.yaw_rate)[moving] / np.diff(p.time)[moving]
    assert (np.abs(yaw) <= 1.25 * robot.max_yaw_acceleration).all()  # the curvature is not quite linear between samples


def test_smoothed_routes_respect_the_limits_and_are_faster_than_cell_paths(jackal):
    from antdrive.planners import AStar, Query
    from antdrive.planners.smoothing.smooth import smooth
    from antdrive.worlds import rasterise

    for seed in range(4):
        task = forest(np.random.default_rng(seed), count=8, radius=(0.5, 1.5), clearance=1.0)
        grid = rasterise(task.world, 0.25, 0.38)
        plan = AStar().plan(Query.between(grid, task), np.random.default_rng(0))
        slow, *fast = (profile(smooth(plan, grid, task, kind=kind), jackal) for kind in ("none", "taut", "clearance"))
        for p in fast:
            check(p, jackal)
            assert p.duration < slow.duration


@given(st.integers(0, 10**6), st.floats(0.05, 0.4))
def test_limits_near_obstacles_are_those_of_the_clearance_among_all_discs(seed, clearance_time):
    rng = np.random.default_rng(seed)
    world, spacing, radius = forest(rng).world, 0.05, 0.2
    (x_min, y_min, x_max, y_max), fastest = world.bounds, 2.0
    route = Route(rng.uniform((x_min, y_min), (x_max, y_max), (4, 2)))
    at = spacing * np.arange(int(route.length / spacing) + 2)
    points = np.stack([np.interp(at, route.arc, values) for values in route.xy.T], axis=1)
    rows = np.array([[0.0, route.length], *5 * [[fastest, fastest]]])
    obstacles, far = indexed_obstacles(world, 1.0), np.full(len(at), math.inf)
    speed = samples_along(
        rows, route.xy, route.arc, far, obstacles, spacing, radius, 1.0, 0.5, clearance_time, math.inf
    )[0]
    near = 0.5 + np.maximum(point_clearance(world, points) - radius, 0.0) / clearance_time
    assert speed == pytest.approx(np.minimum(fastest, near), abs=1e-9)
