"""The robot in physics is no larger than its footprint, and rolls as far as its wheels turn."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from antdrive.base import FieldError
from antdrive.robots import Footprint, RobotSpec, list_robots, load_robot
from antdrive.sim import Engine
from antdrive.worlds import Disc, World

OPEN = World("open", (-50, -50, 50, 50))


@st.composite
def robots(draw):
    """Robots of all sizes, with wheels that may reach the footprint's edge."""
    size = draw(st.floats(0.05, 5.0))
    kind = draw(st.sampled_from(["disc", "rectangle", "rectangle off the axle", "disc off the axle", "polygon"]))
    half_length, half_width = size, size if "disc" in kind else size * draw(st.floats(0.3, 3.0))
    off = (0.3 * half_length * draw(st.floats(-1, 1)), 0.0) if "off" in kind else (0.0, 0.0)
    if "disc" in kind:
        foot = Footprint.disc(size, off)
    elif "rectangle" in kind:
        foot = Footprint.rectangle(2 * half_length, 2 * half_width, off)
    else:
        angles = [2 * math.pi * (k + draw(st.floats(-0.15, 0.15))) / 7 for k in range(7)]
        foot = Footprint.polygon([(half_length * math.cos(a) + 0.1 * size, half_width * math.sin(a)) for a in angles])
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


def reach(robot):
    """How far any part of the robot that PyBullet has loaded reaches beyond the footprint, seen from above [m]."""
    with Engine(OPEN, robot) as engine:
        p, body, client = engine._p, engine._robot, engine._client
        worst = -math.inf
        assert p.getNumJoints(body, physicsClientId=client) == 4
        for link in range(-1, 4):
            (shape,) = p.getCollisionShapeData(body, link, physicsClientId=client)
            x, y = shape[5][:2] if link < 0 else p.getJointInfo(body, link, physicsClientId=client)[14][:2]
            worst = max(worst, *(outside(robot.footprint, x + dx, y + dy) for dx, dy in outline(p, shape)))
        if shapes_are_meshes(robot):  # PyBullet tells a mesh's size only
            low, high = p.getAABB(body, -1, physicsClientId=client)
            xmin, ymin, xmax, ymax = robot.footprint.bounds
            worst = max(worst, xmin - low[0] - BOX, ymin - low[1] - BOX, high[0] - xmax - BOX, high[1] - ymax - BOX)
        return worst


BOX = 0.021  # Bullet's boxes around shapes are up to twice its contact threshold of 0.01 m and a margin larger [m]


def shapes_are_meshes(robot):
    return len(robot.footprint.corners) > 2 and robot.footprint.box is None


def outline(p, shape):
    """Points of a collision shape's outline from above, around its own centre [m]."""
    kind, size = shape[2], shape[3]
    if kind == p.GEOM_BOX:
        return [(sx * size[0] / 2, sy * size[1] / 2) for sx in (-1, 1) for sy in (-1, 1)]
    if kind == p.GEOM_MESH:
        return [(0.0, 0.0)]
    assert kind in (p.GEOM_SPHERE, p.GEOM_CYLINDER)
    radius = size[0] if kind == p.GEOM_SPHERE else size[1]
    return [(radius * math.cos(a), radius * math.sin(a)) for a in (2 * math.pi * k / 180 for k in range(180))]


def outside(foot, x, y):
    """How far a point is from the footprint, <= 0 inside [m]."""
    if foot.corners:
        here = np.array([complex(*corner) for corner in foot.corners])
        if len(here) == 1:
            return abs(here[0] - complex(x, y)) - foot.rounding
        edge = np.roll(here, -1) - here
        return float((-(np.conj(edge) * (complex(x, y) - here)).imag / abs(edge)).max())
    if foot.is_disc:
        return math.hypot(x, y) - foot.rounding
    return max(abs(x) - foot.half_length, abs(y) - foot.half_width)


@pytest.mark.parametrize("name", list_robots())
def test_robots_of_the_catalogue_are_no_larger_in_physics_than_their_footprint(name):
    assert reach(load_robot(name)) <= 1e-9


@given(robots())
def test_no_robot_is_larger_in_physics_than_its_footprint(robot):
    assert reach(robot) <= 1e-9 * robot.radius


@pytest.mark.parametrize("gap", [0.6, 0.02])  # metres beyond the wheels: spheres of their size, and small ones
def test_small_spheres_roll_like_wheels(gap):
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


BESIDE = {
    "rectangle": Footprint.rectangle(0.6, 0.43, (0.08, 0.0)),
    "polygon": Footprint.polygon([(0.3, 0.1), (0.2, 0.23), (-0.25, 0.23), (-0.25, -0.23), (0.2, -0.23), (0.3, -0.1)]),
    "disc": Footprint.disc(0.3, (0.05, 0.01)),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", BESIDE)
def test_what_physics_touches_is_what_the_closed_form_touches(kind, jackal):
    """Posts all around a body that is not centred on the axle, 1 mm in it or 1 mm from it; distances agree within 0.1 mm."""
    robot, pose = replace(jackal, footprint=BESIDE[kind]), (0.4, -0.3, 0.5)
    away, radius = np.arange(0.2, 0.8, 1e-4), 0.02
    posts, gaps = [], []
    for k, bearing in enumerate(np.linspace(0.0, 2 * math.pi, 21)[:-1]):
        way = complex(math.cos(bearing), math.sin(bearing))
        apart = np.array([outside(robot.footprint, *_xy(r * way)) for r in away])
        if len(robot.footprint.corners) > 1:  # beyond a corner the distance is that to the corner
            corners = np.array([complex(*corner) for corner in robot.footprint.corners])
            edge = (corners + np.linspace(0, 1, 500)[:, None] * (np.roll(corners, -1) - corners)).ravel()
            near = (apart > 0) & (apart < 2 * radius)
            apart[near] = [np.abs(edge - r * way).min() for r in away[near]]
        gaps.append(0.001 if k % 2 else -0.001)
        centre = complex(*pose[:2]) + way * np.exp(1j * pose[2]) * away[np.abs(apart - radius - gaps[-1]).argmin()]
        posts.append(Disc(centre.real, centre.imag, radius))
    with Engine(World("w", OPEN.bounds, tuple(posts)), robot) as engine:
        engine.place(pose)
        assert {contact.obstacle for contact in engine.contacts()} == {k for k, gap in enumerate(gaps) if gap < 0}
        np.testing.assert_allclose(_nearest(engine, len(posts)), gaps, atol=1e-4)


def _xy(place):
    return place.real, place.imag


def _nearest(engine, count):
    """The distances of the chassis from the first obstacles, as PyBullet tells them."""
    p, near = engine._p, []
    for obstacle in list(engine._bodies.index)[:count]:
        points = p.getClosestPoints(engine._robot, obstacle, 0.02, linkIndexA=-1, physicsClientId=engine._client)
        near.append(min(point[8] for point in points))
    return near
