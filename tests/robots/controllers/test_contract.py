"""Properties of every controller in the registry, including controllers added to `CONTROLLERS`."""

import dataclasses
import math

import numpy as np
import pytest

from antdrive.base import FieldError, InputError
from antdrive.robots import (
    CONTROLLERS,
    Briefing,
    Controller,
    Observation,
    PurePursuit,
    Twist,
    load_controller,
    load_robot,
)
from antdrive.robots.control.controller import Following
from antdrive.worlds import Disc, Route, World

HZ = 60
ROBOT = load_robot("turtlebot")
EMPTY = World("empty", (0.0, 0.0, 8.0, 8.0))
ROUTES = {
    "straight": [(1.0, 1.0), (5.0, 1.0)],
    "bend": [(1.0, 1.0), (4.0, 1.0), (4.0, 4.0)],
    "corner back": [(1.0, 1.0), (4.0, 1.0), (2.0, 3.0)],
}


def path_of(points, world=EMPTY):
    return PurePursuit().prepare(Route(np.array(points)), world, ROBOT, 0.05, 1 / HZ)


def driven(controller, path, pose=(1.0, 1.0, 0.0), limit=40.0, goal=(5.0, 1.0)):
    """The poses and commands of a robot that executes commands exactly."""
    following = Following(controller, "tested", Briefing(ROBOT, pose, goal, 0.1, HZ))
    command, poses, commands = Twist(0.0, 0.0), [pose], []
    for tick in range(round(limit * HZ)):
        command = following.command(Observation(tick, tick / HZ, pose, command, command), path)
        half = pose[2] + command.yaw_rate / HZ / 2
        pose = (
            pose[0] + command.speed / HZ * math.cos(half),
            pose[1] + command.speed / HZ * math.sin(half),
            pose[2] + command.yaw_rate / HZ,
        )
        poses.append(pose)
        commands.append(command)
        if not any(command) and math.dist(pose[:2], path.route.xy[-1]) < 0.1:
            break
    return np.array(poses), np.array(commands)


@pytest.mark.parametrize("yaw", [0.0, 2.0, math.pi])
@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_controller_stops_at_the_end_of_the_route(name, route, yaw):
    poses, commands = driven(CONTROLLERS[name], path_of(ROUTES[route]), (1.0, 1.0, yaw))
    assert math.dist(poses[-1, :2], ROUTES[route][-1]) < 0.1
    assert not commands[-1].any()


@pytest.mark.parametrize("name", CONTROLLERS)
def test_commands_keep_the_robots_limits(name):
    _, commands = driven(CONTROLLERS[name], path_of(ROUTES["bend"]))
    change = np.abs(np.diff(commands, axis=0)) * HZ
    assert np.abs(commands[:, 0]).max() <= ROBOT.max_speed + 1e-9
    assert np.abs(commands[:, 1]).max() <= ROBOT.max_yaw_rate + 1e-9
    assert change[:, 1].max() <= ROBOT.max_yaw_acceleration + 1e-6
    assert change[:, 0].max() <= 1.05 * ROBOT.max_acceleration


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_controller_is_a_frozen_record_whose_drives_repeat(name):
    controller = CONTROLLERS[name]
    assert isinstance(controller, Controller)
    with pytest.raises(dataclasses.FrozenInstanceError):
        controller.anything = 1
    one, two = (driven(controller, path_of(ROUTES["bend"]))[0] for _ in range(2))
    assert one.tobytes() == two.tobytes()


@pytest.mark.parametrize("name", CONTROLLERS)
def test_options_are_set_by_text_and_checked(name):
    option = dataclasses.fields(CONTROLLERS[name])[0].name
    usual = getattr(CONTROLLERS[name], option)
    assert getattr(load_controller(name, **{option: str(usual / 2)}), option) == usual / 2
    with pytest.raises(InputError, match=rf"controller\.{option}: must be .*got '?fast"):
        load_controller(name, **{option: "fast"})
    with pytest.raises((InputError, FieldError), match=option):
        load_controller(name, **{option: -1.0})


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_robot_drives_backwards_as_it_drives_forwards(name):
    path = path_of(ROUTES["straight"])
    ahead, _ = driven(CONTROLLERS[name], path, limit=2.0)
    back, _ = driven(CONTROLLERS[name], dataclasses.replace(path, backwards=True), (1.0, 1.0, math.pi), limit=2.0)
    np.testing.assert_allclose(ahead[:, :2], back[:, :2], atol=1e-9)


def test_a_route_of_its_own_obstacles_is_followed_by_all():
    world = World("one", (0.0, 0.0, 8.0, 8.0), (Disc(3.0, 1.6, 0.2),))
    path = path_of(ROUTES["straight"], world)
    for name, controller in CONTROLLERS.items():
        poses, _ = driven(controller, path)
        gap = np.hypot(poses[:, 0] - 3.0, poses[:, 1] - 1.6).min() - 0.2 - ROBOT.radius
        assert gap > 0, name
