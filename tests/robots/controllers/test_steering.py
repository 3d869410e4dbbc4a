"""The steering laws against their closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import Observation, Twist
from antdrive.robots.control.observation import Movers
from antdrive.robots.controllers._kernels_dwa import discs_ahead, free_arc
from antdrive.robots.controllers.coulter import Coulter, turn_on_spot
from antdrive.robots.controllers.dwa import DynamicWindow
from antdrive.robots.controllers.stanley import Stanley
from antdrive.worlds import Disc, World
from tests.robots.controllers.test_contract import EMPTY, ROBOT, path_of

LINE = path_of([(0.5, 2.0), (7.5, 2.0)])
MOVER = Movers(np.zeros(1, int), np.array([[3.45, 2.0]]), np.zeros((1, 2)), np.array([0.2]))
WALLS = np.array([0.0, 0.0, 8.0, 8.0])


def at(pose, speed=0.3, yaw_rate=0.0):
    return Observation(0, 0.0, pose, Twist(speed, yaw_rate), Twist(speed, yaw_rate))


@pytest.mark.parametrize(("aside", "yaw"), [(0.1, 0.0), (-0.2, 0.0), (0.0, 0.3), (0.15, -0.4)])
def test_coulter_drives_the_circle_through_the_carrot(aside, yaw):
    command, _ = Coulter(lookahead=0.5).step(at((3.0, 2.0 - aside, yaw)), LINE, 2.5)
    ahead = math.sqrt(0.25 - aside**2)  # the carrot on the line
    lateral = -math.sin(yaw) * ahead + math.cos(yaw) * aside
    assert command.yaw_rate / command.speed == pytest.approx(2 * lateral / 0.25)


def test_coulter_turns_on_the_spot_towards_a_carrot_behind_it():
    command, _ = Coulter().step(at((3.0, 2.0, 3.0)), LINE, 2.5)
    assert command.speed == 0
    assert command.yaw_rate < 0


def test_a_turn_on_the_spot_slows_as_braking_demands():
    command = turn_on_spot(-0.5, LINE)
    assert command.yaw_rate == pytest.approx(-math.sqrt(0.5 * ROBOT.max_yaw_acceleration))


@pytest.mark.parametrize(("aside", "yaw"), [(0.1, 0.0), (-0.05, 0.1), (0.02, -0.2)])
def test_stanley_steers_by_heading_and_cross_track_error_of_the_front_axle(aside, yaw):
    stanley = Stanley(gain=0.8, softening=0.0, wheelbase=0.3, max_steering=1.4)
    command, _ = stanley.step(at((3.0, 2.0 - aside, yaw), speed=0.4), LINE, 2.5)
    error = aside - 0.3 * math.sin(yaw)
    steering = -yaw + math.atan(0.8 * error / 0.4)
    assert command.yaw_rate / command.speed == pytest.approx(math.tan(steering) / 0.3)


def test_stanleys_steering_is_limited():
    command, _ = Stanley(max_steering=0.3, turn_above=3.0).step(at((3.0, 2.0, 1.0)), LINE, 2.5)
    assert command.yaw_rate / command.speed == pytest.approx(-math.tan(0.3) / Stanley().wheelbase)


def sampled(pose, k, discs, radius, reach, step=1e-4):
    """The length of an arc up to the first contact, by small steps."""
    s = np.arange(0.0, reach, step)
    x = pose[0] + s * np.sinc(k * s / 2 / math.pi) * np.cos(pose[2] + k * s / 2)
    y = pose[1] + s * np.sinc(k * s / 2 / math.pi) * np.sin(pose[2] + k * s / 2)
    away = [np.hypot(x - a, y - b) - r for a, b, r in discs]
    away += [x - WALLS[0], y - WALLS[1], WALLS[2] - x, WALLS[3] - y]
    touching = np.min(away, axis=0) < radius
    return s[touching.argmax()] if touching.any() else reach


def free_arcs(pose, curvatures, discs, radius, reach):
    near = discs_ahead(*pose, discs, WALLS, radius)
    return [free_arc(k, near, reach) for k in curvatures]


def test_free_arcs_end_where_sampled_ones_touch():
    rng = np.random.default_rng(1)
    for _ in range(60):
        pose = (*rng.uniform(1.0, 7.0, 2), rng.uniform(-4.0, 4.0))
        discs = np.column_stack([rng.uniform(0.0, 8.0, (6, 2)), rng.uniform(0.1, 0.5, 6)])
        discs = discs[np.hypot(discs[:, 0] - pose[0], discs[:, 1] - pose[1]) > discs[:, 2] + 0.3]
        k = np.append(rng.uniform(-3.0, 3.0, 8), 0.0)
        exact = free_arcs(pose, k, discs, 0.2, 5.0)
        np.testing.assert_allclose(exact, [sampled(pose, one, discs, 0.2, 5.0) for one in k], atol=2e-3)


def test_a_robot_that_is_too_close_may_leave_but_not_approach():
    discs = np.array([[3.5, 3.0, 0.3]])
    (towards,), (away,) = (free_arcs((3.0, 3.0, yaw), [0.0], discs, 0.25, 2.0) for yaw in (0.0, math.pi))
    assert towards < 2e-3
    assert away == pytest.approx(2.0)


def test_dwa_chooses_only_velocities_from_which_it_can_stop():
    world = World("wall", EMPTY.bounds, (Disc(4.0, 2.0, 0.3),))
    path = path_of([(0.5, 2.0), (7.5, 2.0)], world)
    for x in np.linspace(3.0, 3.45, 10):
        command, _ = DynamicWindow(margin=0.0).step(at((x, 2.0, 0.0), speed=0.2), path, 2.5)
        curvature = command.yaw_rate / command.speed if command.speed else 0.0
        (free,) = free_arcs((x, 2.0, 0.0), [curvature], world.discs, ROBOT.radius, 5.0)
        assert command.speed <= math.sqrt(2 * free * ROBOT.max_acceleration) + 1e-9


def test_dwa_sees_movers_as_discs_at_rest():
    mover = at((3.0, 2.0, 0.0))._replace(movers=MOVER)
    free, _ = DynamicWindow().step(at((3.0, 2.0, 0.0)), LINE, 2.5)
    held, _ = DynamicWindow().step(mover, LINE, 2.5)
    assert held.speed < free.speed


def test_the_speed_limit_falls_to_the_goal_and_in_curves():
    assert LINE.speed_limit(3.0) == pytest.approx(ROBOT.max_speed)
    assert LINE.speed_limit(LINE.length) == 0
    near = LINE.speed_limit(LINE.length - 0.1)
    assert 0 < near < LINE.speed_limit(3.0)
    assert LINE.speed_limit(3.0, 10.0) < ROBOT.max_speed
    assert replace(LINE, goal_distance=0.2).speed_limit(LINE.length - 0.1) == 0
