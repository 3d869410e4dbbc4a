"""Avoidance keeps its clearance from obstacles, with the loss by noise, whatever movers do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots import Avoidance, AvoidanceState, PurePursuit, PursuitState, Twist, footprint_clearance, load_robot
from antdrive.robots.control import _kernels_avoidance as kernels
from antdrive.robots.control.avoidance import _weights
from antdrive.robots.default_margin import LINE_ROUNDING, RESERVE, clearances_off_route, default_margin, line_margin
from antdrive.worlds import Disc, Route, World

KEPT, PERIOD, PERIODS = 0.05, 1 / 20, 40
#: A corridor with a niche and a column.
POSTS = [(x, y) for x in np.arange(-4, 4.01, 0.2) for y in (-0.9, 0.9) if not (y > 0 and 1 < x < 2.2)]
WORLD = World("corridor", (-5, -3, 5, 3), tuple(Disc(float(x), y, 0.12) for x, y in [*POSTS, (-1.5, 0.6)]))
ROUTE = Route(np.array([(-4.0, 0.0), (4.0, 0.0)]))


def driven(robot, pose, movers, margin=5 * KEPT):
    """Return the poses of a robot that avoids movers (M, 5) without noise: x, y, velocity and radius."""
    controller, avoidance = PurePursuit(), Avoidance()
    tracked = controller.prepare(ROUTE, WORLD, robot, margin, PERIOD)  # the controller stops at a fifth of its margin
    twist, before, state, poses = Twist(0.0, 0.0), PursuitState(arc=4.0 + pose[0]), AvoidanceState(), [pose]
    for k in range(PERIODS):
        wanted, after = controller.pursue(tracked, pose, twist, before)
        times = k * PERIOD + avoidance.prediction_times
        places = movers[:, :2] + times[:, None, None] * movers[:, 2:4]
        twist, avoids, state = avoidance.avoid(
            tracked, robot, pose, twist, before, wanted, state, places, movers[:, 4].copy(), losses=(KEPT, KEPT)
        )
        before = before if avoids else after
        x, y, yaw = pose
        middle, way = yaw + twist.yaw_rate * PERIOD / 2, twist.speed * PERIOD
        pose = x + way * math.cos(middle), y + way * math.sin(middle), yaw + twist.yaw_rate * PERIOD
        poses.append(pose)
    return np.array(poses)


@pytest.mark.parametrize("name", ["warehouse", "turtlebot4"])
@settings(max_examples=5, deadline=None)
@given(
    place=st.tuples(st.floats(-1.0, 3.0), st.floats(-0.35, 0.35), st.floats(-math.pi, math.pi)),
    movers=st.lists(
        st.tuples(st.floats(-2, 2), st.floats(-0.5, 0.5), st.floats(0, 1.2), st.floats(0.15, 0.4)),
        min_size=1,
        max_size=4,
    ),
)
def test_no_motion_off_the_route_comes_closer_to_obstacles_than_the_loss(name, place, movers):
    """Movers come from 1.5 m away, towards the robot or past it."""
    robot = load_robot(name)
    table = [
        (place[0] + math.copysign(1.5, along), place[1] + aside, -math.copysign(speed, along), -aside / 3, radius)
        for along, aside, speed, radius in movers
    ]
    poses = driven(robot, place, np.array(table))
    clearance = footprint_clearance(WORLD, robot.footprint, poses)
    assert clearance.min() >= min(KEPT, clearance[0]) - 0.002


def blocked(robot, pose, v, w):
    """Return whether a constant twist of a robot at rest is refused because of obstacles, off the route."""
    tracked, avoidance = PurePursuit().prepare(ROUTE, WORLD, robot, 0.03, PERIOD), Avoidance()
    tuning = tracked.tuning._replace(period=avoidance.step)
    weights = _weights(avoidance, robot.radius, robot.footprint, losses=(KEPT, KEPT))
    keeps = kernels.least_clearance(*pose, False, False, tracked.obstacles, tuning, weights)
    candidate = np.array([kernels.TWO_TWISTS, v, w, math.inf, 0.0, 0.0])
    motion = tracked.samples, tracked.obstacles, tracked.limits, tuning, weights.step, 0, True, keeps
    return kernels.follow(*pose, 0.0, 0.0, 4.0, False, candidate, *motion, np.empty((26, 5))).blocked


def test_a_rectangle_without_room_for_its_circle_does_not_turn_into_a_wall():
    robot = load_robot("warehouse")
    assert blocked(robot, (0.0, -0.3, 0.0), 0.0, -1.0)
    assert not blocked(robot, (0.0, -0.3, 0.0), 0.0, 0.0)


def test_a_robot_closer_to_a_wall_than_the_loss_comes_no_closer():
    robot = load_robot("turtlebot4")
    beside = -0.78 + robot.radius + KEPT / 2
    assert blocked(robot, (0.0, beside, -math.pi / 2), 0.05, 0.0)
    assert not blocked(robot, (0.0, beside, -math.pi / 2), -0.05, 0.0)
    assert not blocked(robot, (0.0, beside, -math.pi / 2), 0.0, 0.0)


@pytest.mark.parametrize("name", ["warehouse", "husky", "jackal", "turtlebot4"])
def test_motions_off_the_route_keep_the_loss_that_margins_hold(name):
    robot, controller = load_robot(name), PurePursuit()
    circle, outline = clearances_off_route(robot, controller, 1.0)
    assert 0.01 < circle < default_margin(robot, controller, 1.0, "none")
    assert 0.01 < outline < line_margin(robot, controller, 1.0)
    assert clearances_off_route(robot, controller, 0.0) == (RESERVE, RESERVE + LINE_ROUNDING)


def test_the_controller_takes_over_only_a_speed_that_it_can_brake():
    """No mover is near, but the last decision of avoidance has brought the robot to full speed towards a wall."""
    robot, avoidance = load_robot("warehouse"), Avoidance()
    tracked = PurePursuit().prepare(ROUTE, WORLD, robot, 0.03, PERIOD)
    tuning = tracked.tuning._replace(period=avoidance.step)
    weights = _weights(avoidance, robot.radius, robot.footprint)
    places = np.full((len(avoidance.prediction_times), 1, 2), 100.0)
    chosen = []
    for decided in ((), (kernels.TWO_TWISTS, 1.5, 0.0, 0.4, 1.5, 0.0)):
        state = AvoidanceState(decided, 0.0)
        table = avoidance._candidates(robot, state, math.inf, math.inf, math.inf, False)
        here = (-3.0, 0.0, 0.5, 1.5, 0.0, 1.0, False)
        situation = here, table, tracked.samples, tracked.obstacles, tracked.limits, tuning, weights
        chosen.append(kernels.choose(*here, *situation[1:], places, np.array([0.2]))[0])
    assert chosen[0] == 0
    assert chosen[1] != 0


@pytest.mark.parametrize("pose", [(0.0, 0.35, 0.2), (0.0, -0.3, -0.2), (-1.5, -0.3, 0.0)])
def test_a_robot_that_would_halt_without_room_for_its_circle_makes_room(pose):
    robot = load_robot("husky")
    poses = driven(robot, pose, np.empty((0, 5)))
    clearance = footprint_clearance(WORLD, robot.footprint, poses)
    assert np.hypot(*(poses[-1] - poses[0])[:2]) > 0.5
    assert clearance.min() >= min(KEPT, clearance[0]) - 0.002


@pytest.mark.parametrize(("left", "speed_limit"), [(0.15, math.inf), (3.0, 0.0)])
def test_a_robot_that_may_stand_makes_no_room(left, speed_limit):
    """At the end of its route, and where an earlier rule lets it stand, as a scan turn does."""
    robot, avoidance, still = load_robot("husky"), Avoidance(), Twist(0.0, 0.0)
    tracked = PurePursuit(goal_distance=0.2).prepare(ROUTE, WORLD, robot, 0.03, PERIOD, 0.5)
    here = (4.0 - left, 0.35, 0.2), still, PursuitState(arc=8.0 - left), still
    nobody = np.empty((len(avoidance.prediction_times), 0, 2)), np.empty(0)
    answer = avoidance.avoid(tracked, robot, *here, AvoidanceState(), *nobody, speed_limit=speed_limit)
    assert answer[:2] == (still, False)


@pytest.mark.parametrize("pose", [(-3.0, 0.45, -0.3), (-2.6, 0.45, 0.35), (-3.0, 0.45, 1.57)])
def test_the_controllers_motion_off_its_route_keeps_the_loss_too(pose):
    """Its own stopping clearance is less; on the route the margin holds the loss."""
    robot = load_robot("jackal")
    poses = driven(robot, pose, np.empty((0, 5)), margin=0.03)
    clearance = footprint_clearance(WORLD, robot.footprint, poses)
    assert clearance[np.abs(poses[:, 1]) > 0.12].min() >= min(KEPT, clearance[0]) - 0.002
