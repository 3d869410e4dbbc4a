"""The robot in physics is no larger than its footprint, and rolls as far as its wheels turn."""

import math
from typing import Any

import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from antdrive.robots import Footprint, RobotSpec, list_robots, load_robot
from antdrive.sim import Engine
from antdrive.worlds import Disc, FieldError, World

OPEN = World("open", (-50, -50, 50, 50))


@st.composite
def robots(draw: st.DrawFn) -> RobotSpec:
    """Robots of all sizes, with wheels that may reach the footprint's edge."""
    size = draw(st.floats(0.05, 5.0))
    if draw(st.booleans()):
        foot, half_length, half_width = Footprint.disc(size), size, size
    else:
        half_width = size * draw(st.floats(0.3, 3.0))
        foot, half_length = Footprint.rectangle(2 * size, 2 * half_width), size
    wheel = half_length * draw(st.floats(0.1, 1.0))
    track = 2 * half_width * draw(st.floats(0.1, 1.0))
    try:
        return RobotSpec(
            name="any", footprint=foot, height=size, mass=5.0, wheel_radius=wheel, track=track, max_speed=1.0,
            max_yaw_rate=3.0, max_acceleration=1.0, max_yaw_acceleration=8.0, max_lateral_acceleration=1.0,
            max_wheel_speed=25.0, wheel_torque=1.5,
        )  # fmt: skip
    except FieldError:  # the wheels stand outside
        reject()


def reach(robot: RobotSpec) -> float:
    """How far any part of the robot that PyBullet has loaded reaches beyond the footprint, seen from above [m]."""
    with Engine(OPEN, robot) as engine:
        p, body, client = engine._p, engine._robot, engine._client
        worst = -math.inf
        assert p.getNumJoints(body, physicsClientId=client) == 4
        for link in range(-1, 4):
            (shape,) = p.getCollisionShapeData(body, link, physicsClientId=client)
            x, y = (0.0, 0.0) if link < 0 else p.getJointInfo(body, link, physicsClientId=client)[14][:2]
            worst = max(worst, *(outside(robot.footprint, x + dx, y + dy) for dx, dy in outline(p, shape)))
        return worst


def outline(p: Any, shape: tuple[Any, ...]) -> list[tuple[float, float]]:
    """Points of a collision shape's outline from above, around its own centre [m]."""
    kind, size = shape[2], shape[3]
    if kind == p.GEOM_BOX:
        return [(sx * size[0] / 2, sy * size[1] / 2) for sx in (-1, 1) for sy in (-1, 1)]
    assert kind in (p.GEOM_SPHERE, p.GEOM_CYLINDER)
    radius = size[0] if kind == p.GEOM_SPHERE else size[1]
    return [(radius * math.cos(a), radius * math.sin(a)) for a in (2 * math.pi * k / 180 for k in range(180))]


def outside(foot: Footprint, x: float, y: float) -> float:
    """How far a point is from the footprint, <= 0 inside [m]."""
    if foot.is_disc:
        return math.hypot(x, y) - foot.rounding
    return max(abs(x) - foot.half_length, abs(y) - foot.half_width)


@pytest.mark.parametrize("name", list_robots())
def test_robots_of_the_catalogue_are_no_larger_in_physics_than_their_footprint(name: str) -> None:
    assert reach(load_robot(name)) <= 1e-9


@given(robots())
def test_no_robot_is_larger_in_physics_than_its_footprint(robot: RobotSpec) -> None:
    assert reach(robot) <= 1e-9 * robot.radius


def test_the_reach_of_a_robot_is_that_of_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The reach sees a caster that stands 15 mm beyond the footprint."""
    import antdrive.sim.physics.engine as engine

    text = engine.robot_urdf
    monkeypatch.setattr(engine, "robot_urdf", lambda *args: text(*args).replace('xyz="-0.1905 ', 'xyz="-0.20804 '))
    assert reach(load_robot("jackal")) == pytest.approx(0.015, abs=1e-6)


def test_a_robot_with_its_back_at_a_wall_has_no_part_in_the_wall() -> None:
    """The case that was certified with a caster 11 mm inside the wall."""
    world = World("room", (0, 0, 6, 4), (Disc(5, 3, 0.2),))
    jackal = load_robot("jackal")
    with Engine(world, jackal) as engine:
        engine.place((0.258, 2, 0))
        assert engine.contacts() == []
        p, body, client = engine._p, engine._robot, engine._client
        for link in range(4):
            (shape,) = p.getCollisionShapeData(body, link, physicsClientId=client)
            x = p.getLinkState(body, link, physicsClientId=client)[0][0]
            assert x - shape[3][0] > 0


@pytest.mark.parametrize("gap", [0.6, 0.02])  # metres beyond the wheels: spheres of their size, and small ones
def test_small_spheres_roll_like_wheels(gap: float) -> None:
    """Speed on the floor and torque are those of the wheel, whatever the size of the sphere that stands for it."""
    robot = RobotSpec(
        name="cart", footprint=Footprint.rectangle(1.0, 0.6 + 2 * gap), height=0.4, mass=20.0, wheel_radius=0.2, track=0.6,
        max_speed=9.0, max_yaw_rate=3.0, max_acceleration=2.0, max_yaw_acceleration=8.0, max_lateral_acceleration=2.0,
        max_wheel_speed=60.0, wheel_torque=2.0,
    )  # fmt: skip
    with Engine(OPEN, robot) as engine:
        engine.place((-20, 0, 0))
        engine.command(9.0, 0.0)
        for _ in range(120):
            engine.step()
        assert engine.state().speed == pytest.approx(
            0.5 * 2 * 2.0 / 0.2 / 20.0, rel=0.03
        )  # force / mass, half a second
        for _ in range(240 * 11):
            engine.step()
        assert engine.state().speed == pytest.approx(9.0, rel=1e-3)


def test_a_rectangle_with_round_corners_is_refused(jackal: RobotSpec) -> None:
    import dataclasses

    rounded = dataclasses.replace(jackal, footprint=Footprint(0.3, 0.25, 0.1))
    with pytest.raises(FieldError, match="footprint: must be a disc or a rectangle"), Engine(OPEN, rounded):
        pass
