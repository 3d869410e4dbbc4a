"""The controller in a loop with perfect wheels, without physics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots import LIMITERS, Progress, PurePursuit, RobotSpec, Twist
from worlds import Disc, Route, World, point_clearance

OPEN = World("open", (-20, -20, 20, 20))
DT = 1 / 60


def follow(
    robot: RobotSpec,
    route: Route,
    pose: tuple[float, float, float],
    world: World = OPEN,
    margin: float = 0.05,
) -> tuple[np.ndarray, np.ndarray, list[Progress]]:
    controller = PurePursuit()
    guide = controller.guide(route, world, robot, margin, DT)
    command, state = Twist(0, 0), Progress()
    poses, commands, states = [pose], [command], [state]
    for _ in range(60 * 120):
        command, state = controller.step(guide, pose, command, state)
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
def test_it_arrives_from_any_heading_within_the_robots_limits(
    robot: str, yaw: float, request: pytest.FixtureRequest
) -> None:
    spec: RobotSpec = request.getfixturevalue(robot)
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


def test_it_turns_on_the_spot_where_the_route_starts_behind_it(turtlebot: RobotSpec) -> None:
    poses, _, states = follow(turtlebot, Route(np.array([(0.0, 0.0), (-3.0, 0.0)])), (0, 0, 0))
    assert states[1].turning
    assert poses[:, 0].max() < 0.01  # it does not drive a loop
    assert poses[-1, 0] == pytest.approx(-3, abs=0.02)


def test_it_keeps_to_the_middle_of_a_straight_route(jackal: RobotSpec) -> None:
    poses, commands, _ = follow(jackal, Route(np.array([(0.0, 0.0), (10.0, 0.0)])), (0, 0.1, 0))
    assert np.abs(poses[len(poses) // 2 :, 1]).max() < 0.005
    assert commands[:, 0].max() == pytest.approx(2.0)


def test_corners_are_cut_only_where_there_is_room(jackal: RobotSpec) -> None:
    """The same corner with and without a thin post inside it."""
    route = Route(np.array([(0.0, 0.0), (3.0, 0.0), (5.0, 2.0)]))
    margin = 0.05
    keep = jackal.radius + margin + 0.01  # the route keeps its distance, and no more, from the post
    post = World("post", OPEN.bounds, (Disc(3 - keep * math.tan(math.pi / 8), keep, 0.01),))
    free, _, _ = follow(jackal, route, (0, 0, 0), OPEN, margin)
    guarded, _, _ = follow(jackal, route, (0, 0, 0), post, margin)
    assert point_clearance(post, free[:, :2]).min() < jackal.radius + 0.2 * margin  # with nothing there it cuts
    assert point_clearance(post, guarded[:, :2]).min() > jackal.radius + 0.35 * margin


@settings(max_examples=25)
@given(
    turns=st.lists(st.sampled_from([-135, -90, -45, 0, 45, 90, 135]), min_size=1, max_size=6),
    step=st.sampled_from([0.15, 0.4, 1.0]),
)
def test_any_grid_like_route_is_driven_to_its_end(turns: list[int], step: float) -> None:
    from robots import load_robot

    heading, xy = 0.0, [(0.0, 0.0), (step, 0.0)]
    for turn in turns:
        heading += math.radians(turn)
        xy.append((xy[-1][0] + step * math.cos(heading), xy[-1][1] + step * math.sin(heading)))
    poses, _, _ = follow(load_robot("jackal"), Route(np.array(xy)), (0, 0, 0))
    assert math.dist(poses[-1][:2], xy[-1]) < 0.06


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("lookahead_time", 0.0, "between 0.001 and 100"),
        ("guard", 1.5, "between 0 and 1"),
        ("braking", 0.0, "between 0 and 1"),
        ("lookahead_max", 0.01, "at least lookahead_min"),
        ("turn_from", 3.0, "between turn_to and pi/2"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(key: str, value: float, says: str) -> None:
    with pytest.raises(ValueError, match=f"{key}: .*{says}"):
        PurePursuit(**{key: value})
