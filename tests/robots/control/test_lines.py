"""Line tracking in closed loop with perfect wheels: straights, turns on the spot, backwards, limits."""

import math
from dataclasses import replace

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base.errors import FieldError
from antdrive.base.plane import wrap_angle
from antdrive.robots import LIMITERS, Avoidance, AvoidanceState, PurePursuit, PursuitState, Twist, load_robot
from antdrive.robots.control import _kernels_lines
from antdrive.robots.control.speed_limits import BACKWARDS
from antdrive.worlds import Disc, Route, World
from tests.robots.control.test_pursuit import DT, OPEN, follow

ROBOTS = {name: load_robot(name) for name in ("jackal", "husky", "warehouse")}


def polyline(legs, turns):
    """A route of lines from the origin, first along x."""
    heading, xy = 0.0, [(0.0, 0.0)]
    for leg, turn in zip(legs, turns, strict=True):
        xy.append((xy[-1][0] + leg * math.cos(heading), xy[-1][1] + leg * math.sin(heading)))
        heading += turn
    return Route(np.array(xy), turns=np.array([0.0, *turns[:-1], 0.0]))


@settings(max_examples=25)
@given(
    name=st.sampled_from(sorted(ROBOTS)),
    legs=st.lists(st.floats(0.1, 2.5), min_size=1, max_size=4),
    turns=st.lists(st.floats(0.03, 4.5), min_size=4, max_size=4),
    signs=st.lists(st.sampled_from([-1, 1]), min_size=4, max_size=4),
)
def test_the_robot_keeps_to_the_lines_and_turns_the_given_way(name, legs, turns, signs):
    robot, turns = ROBOTS[name], [turn * sign for turn, sign in zip(turns, signs, strict=True)][: len(legs)]
    route = polyline(legs, turns)
    poses, commands, states = follow(robot, route, (0, 0, 0))
    v, w = commands.T
    assert math.dist(poses[-1][:2], route.xy[-1]) < 0.02
    assert v.min() >= 0
    assert v.max() <= robot.max_speed + 1e-9
    assert np.abs(np.diff(v)).max() <= robot.max_acceleration * DT + 1e-9
    assert np.abs(np.diff(w)).max() <= robot.max_yaw_acceleration * DT + 1e-9
    arcs = np.array([state.arc for state in states])
    assert (np.diff(arcs) >= 0).all()
    assert poses[-1][2] == pytest.approx(sum(turns[:-1]), abs=0.02)  # not one full turn more or less
    k = np.clip(np.searchsorted(route.arc, arcs, side="right") - 1, 0, len(legs) - 1)
    away = poses[:, :2] - route.xy[k]
    facing = route.facing[k]
    assert np.abs(away[:, 1] * np.cos(facing) - away[:, 0] * np.sin(facing)).max() < 0.008
    moving = v > 0.1
    assert np.abs(wrap_angle(poses[moving, 2] - facing[moving])).max() < 0.03


def test_the_robot_backs_out_slowly_and_then_turns():
    route = Route([(0, 0), (-0.4, 0), (-0.4, 2)], turns=[0.0, math.pi / 2, 0.0], backwards_until=0.4)
    poses, commands, _ = follow(ROBOTS["husky"], route, (0, 0, 0))
    assert commands[:, 0].min() == pytest.approx(-BACKWARDS, abs=0.01)
    assert math.dist(poses[-1][:2], (-0.4, 2)) < 0.02
    assert poses[-1][2] == pytest.approx(math.pi / 2, abs=0.02)
    assert np.abs(poses[commands[:, 0] < 0, 1]).max() < 0.005


def test_the_robot_may_back_off_and_drive_on_along_the_same_line():
    route = Route([(0, 0), (-0.4, 0), (1, 0)], turns=np.zeros(3), backwards_until=0.4)
    poses, commands, _ = follow(ROBOTS["jackal"], route, (0, 0, 0))
    assert poses[:, 0].min() == pytest.approx(-0.4, abs=0.01)
    assert poses[-1] == pytest.approx((1, 0, 0), abs=0.02)
    assert (np.diff(np.sign(commands[:, 0])) != 0).sum() <= 4


def test_the_robot_is_slow_beside_obstacles_and_stops_before_one_on_its_line():
    beside = World("beside", OPEN.bounds, (Disc(3.0, 0.49, 0.25),))
    across = World("across", OPEN.bounds, (Disc(3.0, 0.0, 0.25),))
    route, robot = Route([(0, 0), (6, 0)], turns=np.zeros(2)), ROBOTS["jackal"]
    commands = follow(robot, route, (0, 0, 0), beside)[1]
    assert 0.5 < commands[100:-100, 0].min() < 1.1
    controller, pose, command, state = PurePursuit(), (2.0, 0.0, 0.0), Twist(1.0, 0.0), PursuitState(2.0)
    tracked = controller.prepare(route, across, robot, 0.03, DT)
    while pose[0] < 2.49 and command.speed > controller.creep_speed:
        command, state = controller.pursue(tracked, pose, command, state)
        pose = (pose[0] + command.speed * DT, 0.0, 0.0)
    assert command.speed <= controller.creep_speed
    assert LIMITERS[state.limiter] == "braking"


def test_disturbed_robots_return_to_the_line():
    poses, _, _ = follow(ROBOTS["warehouse"], Route([(0, 0), (6, 0)], turns=np.zeros(2)), (0, 0.15, 0.1))
    assert np.abs(poses[poses[:, 0] > 2.5, 1]).max() < 0.01


@pytest.mark.parametrize("variant", ["ignoring_turn_clearance", "preferring_arcs"])
def test_variants_of_the_path_still_arrive(variant):
    route, robot, controller = polyline([1.0, 1.0], [2.0, 0.0]), ROBOTS["jackal"], PurePursuit()
    tracked = getattr(controller.prepare(route, OPEN, robot, 0.03, DT), variant)
    pose, command, state = (0.0, 0.0, 0.0), Twist(0.0, 0.0), PursuitState()
    for _ in range(1200):
        command, state = controller.pursue(tracked, pose, command, state._replace(turning=False))
        x, y, yaw = pose
        pose = (
            x + command.speed * math.cos(yaw) * DT,
            y + command.speed * math.sin(yaw) * DT,
            yaw + command.yaw_rate * DT,
        )
    assert math.dist(pose[:2], route.xy[-1]) < 0.05


@pytest.mark.parametrize("route", [polyline([1.0, 1.0], [2.0, 0.0]), Route([(0, 0), (2, 0.3), (4, 0)])])
@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_the_packed_path_gives_the_kernel_every_value_in_its_place(route, robot):
    tracked = PurePursuit().prepare(route, World("disc", OPEN.bounds, (Disc(2, 1, 0.25),)), ROBOTS[robot], 0.03, DT)
    numbers = iter(np.linspace(0.1, 0.9, 100).tolist())  # distinct, so that a swap shows
    parts = [
        part._replace(**{key: next(numbers) for key, value in part._asdict().items() if isinstance(value, float)})
        for part in (tracked.samples, tracked.obstacles, tracked.limits, tracked.tuning)
    ]
    samples, obstacles, limits, tuning = parts
    packed = replace(tracked, samples=samples, obstacles=obstacles, limits=limits, tuning=tuning).packed
    for found, meant in zip(_kernels_lines.unpacked(*packed), parts, strict=True):
        assert found._fields == meant._fields
        for value, other in zip(found, meant, strict=True):
            np.testing.assert_array_equal(value, other)


def test_avoidance_stops_the_robot_for_a_mover_on_its_line():
    route, robot, avoidance = Route([(0, 0), (6, 0)], turns=np.zeros(2)), ROBOTS["jackal"], Avoidance()
    controller = PurePursuit()
    tracked = controller.prepare(route, OPEN, robot, 0.03, DT)
    before, last = PursuitState(2.0), Twist(1.0, 0.0)
    wanted, _ = controller.pursue(tracked, (2.0, 0.0, 0.0), last, before)
    places = np.full((len(avoidance.prediction_times), 1, 2), (3.2, 0.0))
    met = avoidance.avoid(
        tracked, robot, (2.0, 0.0, 0.0), last, before, wanted, AvoidanceState(), places, np.array([0.2])
    )
    assert met[1]
    assert met[0] != wanted
    far = avoidance.avoid(
        tracked, robot, (2.0, 0.0, 0.0), last, before, wanted, AvoidanceState(), places + 50, np.array([0.2])
    )
    assert far[0] == wanted


@pytest.mark.parametrize(
    ("key", "value"),
    [("turns", [0.0, 7.0, 0.0]), ("turns", [0.0]), ("backwards_until", 0.3), ("backwards_until", -1.0)],
)
def test_invalid_turns_are_named(key, value):
    fine = Route([(0, 0), (1, 0), (1, 1)], turns=[0.0, math.pi / 2, 0.0])
    with pytest.raises(FieldError) as caught:
        replace(fine, **{key: value})
    assert caught.value.key == key


def test_equal_points_keep_the_turn_of_the_last_one():
    route = Route([(0, 0), (0, 0), (1, 0)], turns=[0.0, 0.5, 0.0])
    assert route.turns.tolist() == [0.5, 0.0]


def test_the_backward_part_ends_exactly_at_a_point():
    route = Route([(0, 0), (-0.3, 0.1), (2, 2)], turns=np.zeros(3), backwards_until=math.hypot(0.3, 0.1) + 1e-12)
    assert route.backwards_until == route.arc[1]


def test_kernels_are_compiled_once_for_smooth_routes_and_lines():
    robot = ROBOTS["jackal"]
    routes = polyline([1.0, 1.0], [1.0, 0.0]), Route([(0, 0), (1, 0), (2, 1)])
    lines, smooth = (PurePursuit().prepare(route, OPEN, robot, 0.03, DT) for route in routes)
    assert numba.typeof(lines.samples) == numba.typeof(smooth.samples)
    assert numba.typeof(lines.packed) == numba.typeof(smooth.packed)
