"""The robot's URDF description for the physics engine.

The robot rolls on spheres, within 0.01 % of the commanded twist; URDF cylinders were measured to be off by 5 %. The
casters hang 0.5 mm above the floor, because coplanar casters would carry most of the weight. No sphere reaches beyond
the footprint: where a wheel is thinner than a sphere of its radius, a smaller sphere stands under the wheel's middle and
is geared so that speed and force on the floor are the wheel's.
"""

from __future__ import annotations

from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from antdrive.robots.feasible import yaw_inertia
from antdrive.robots.spec import RobotSpec
from antdrive.worlds.errors import FieldError

GROUND_CLEARANCE = 0.005  # height of the chassis above the floor [m]
CASTER_GAP = 5e-4  # height of wheels and casters above the floor when the robot is placed [m]
# For a link that is not to be drawn Bullet makes a visual shape from the collision shape, which takes 0.2 ms for a sphere.
DRAWN = '<visual><geometry><box size="0.01 0.01 0.01"/></geometry></visual>'
INSIDE = 0.99  # the share of the room up to the footprint's edge that wheels and casters fill at most


class _Ball(NamedTuple):
    """A sphere under the chassis: a driven wheel or a fixed, frictionless caster."""

    name: str
    radius: float  # [m]
    x: float  # centre, from the axle's centre [m]
    y: float
    z: float
    friction: float
    joint: str  # URDF joint type


def rolling_radius(robot: RobotSpec) -> float:
    """Radius of the spheres that stand for the driven wheels: the wheels' own where the footprint has room for it [m]."""
    return min(robot.wheel_radius, INSIDE * robot.wheel_room)


def robot_urdf(robot: RobotSpec, com_drop: float) -> str:
    """The robot as URDF text. The base frame is the axle's centre.

    Args:
        com_drop: how far the centre of mass hangs below the axle's centre [m]

    Raises:
        FieldError: the footprint is neither a disc nor a rectangle.
    """
    if robot.footprint.rounding and not robot.footprint.is_disc:
        raise FieldError("footprint", "must be a disc or a rectangle; physics has no rectangles with round corners")
    r, wheel = robot.wheel_radius, rolling_radius(robot)
    half_length, half_width = _size(robot)[0] / 2, _size(robot)[1] / 2
    caster_x = 0.75 * half_length
    caster = min(0.8 * r, INSIDE * half_length - caster_x, INSIDE * half_width)
    balls = (
        _Ball("left_wheel", wheel, 0.0, robot.track / 2, wheel - r, robot.wheel_friction, "continuous"),
        _Ball("right_wheel", wheel, 0.0, -robot.track / 2, wheel - r, robot.wheel_friction, "continuous"),
        _Ball("front_caster", caster, caster_x, 0.0, caster - r + CASTER_GAP, 0.0, "fixed"),
        _Ball("rear_caster", caster, -caster_x, 0.0, caster - r + CASTER_GAP, 0.0, "fixed"),
    )
    parts = [f"<robot name={quoteattr(robot.name)}>", *_chassis(robot, com_drop)]
    for ball in balls:
        parts += _link(ball, 0.02 * robot.mass)
    return "\n".join([*parts, "</robot>"])


def _size(robot: RobotSpec) -> tuple[float, float]:
    """Length and width of the footprint [m]."""
    foot = robot.footprint
    return 2 * (foot.half_length + foot.rounding), 2 * (foot.half_width + foot.rounding)


def _chassis(robot: RobotSpec, com_drop: float) -> list[str]:
    """The chassis: a cylinder or a box of the footprint's size, with 92 % of the mass."""
    foot, bottom = robot.footprint, GROUND_CLEARANCE - robot.wheel_radius
    inertia_z = yaw_inertia(robot)
    if foot.is_disc:
        shape = f'<cylinder radius="{foot.rounding!r}" length="{robot.height!r}"/>'
        inertia_x = inertia_y = robot.mass * (3 * foot.rounding**2 + robot.height**2) / 12
    else:
        size_x, size_y = _size(robot)
        shape = f'<box size="{size_x!r} {size_y!r} {robot.height!r}"/>'
        inertia_x = robot.mass * (size_y**2 + robot.height**2) / 12
        inertia_y = robot.mass * (size_x**2 + robot.height**2) / 12
    return [
        '<link name="chassis">',
        f'<inertial><origin xyz="0 0 {-com_drop!r}"/><mass value="{robot.mass * 0.92!r}"/>',
        f'<inertia ixx="{inertia_x!r}" iyy="{inertia_y!r}" izz="{inertia_z!r}" ixy="0" ixz="0" iyz="0"/></inertial>',
        f'<collision><origin xyz="0 0 {bottom + robot.height / 2!r}"/><geometry>{shape}</geometry></collision>',
        DRAWN,
        '<contact><lateral_friction value="0.3"/></contact>',
        "</link>",
    ]


def _link(ball: _Ball, mass: float) -> list[str]:
    """A wheel or caster of a mass [kg] and the joint that holds it."""
    inertia = 0.4 * mass * ball.radius**2
    return [
        f'<link name="{ball.name}">',
        f'<inertial><mass value="{mass!r}"/>',
        f'<inertia ixx="{inertia!r}" iyy="{inertia!r}" izz="{inertia!r}" ixy="0" ixz="0" iyz="0"/></inertial>',
        f'<collision><geometry><sphere radius="{ball.radius!r}"/></geometry></collision>',
        DRAWN,
        f'<contact><lateral_friction value="{ball.friction!r}"/><rolling_friction value="0"/>',
        '<spinning_friction value="0"/></contact>',
        "</link>",
        f'<joint name="{ball.name}_joint" type="{ball.joint}"><parent link="chassis"/><child link="{ball.name}"/>',
        f'<origin xyz="{ball.x!r} {ball.y!r} {ball.z!r}"/><axis xyz="0 1 0"/></joint>',
    ]
