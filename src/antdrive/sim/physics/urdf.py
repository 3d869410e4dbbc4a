"""URDF description of a robot for the physics engine.

The robot rolls on spheres, within 0.1 % of the commanded twist at 240 Hz (`python -m benchmarks.physics`); URDF cylinders
were measured to be 5 % off. The casters hang 0.5 mm above the floor, because coplanar casters would carry most of the
weight. No sphere protrudes from the footprint: where a sphere of the wheel's radius would, a smaller sphere stands under the
wheel's middle, geared to the wheel's speed and force on the floor. The mass is centred on the axle for any footprint.
"""

from __future__ import annotations

import atexit
import functools
import hashlib
import math
import os
import shutil
import tempfile
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from antdrive.base.errors import FieldError
from antdrive.base.types import Point
from antdrive.robots.spec import RobotSpec, yaw_inertia

GROUND_CLEARANCE = 0.005  # height of the chassis above the floor [m]
CASTER_GAP = 5e-4  # height of wheels and casters above the floor at placement [m]
# Without it, Bullet derives a visual shape from the collision shape, which takes 0.2 ms for a sphere.
DRAWN = '<visual><geometry><box size="0.01 0.01 0.01"/></geometry></visual>'
CHASSIS_FILE = "chassis.obj"
MESH_MARGIN = 0.001  # collision margin of Bullet's meshes in URDF files [m]
INSIDE = 0.99  # wheels and casters fill at most this fraction of the room up to the footprint's edge


class _Ball(NamedTuple):
    """Sphere under the chassis: a driven wheel or a fixed, frictionless caster."""

    name: str
    radius: float  # [m]
    x: float  # centre, from the axle's centre [m]
    y: float
    z: float
    friction: float
    joint: str  # URDF joint type


def rolling_radius(robot: RobotSpec) -> float:
    """Return the radius of the spheres that represent the driven wheels: the wheels' own where the footprint permits [m]."""
    return min(robot.wheel_radius, INSIDE * robot.wheel_room)


def robot_urdf(robot: RobotSpec, com_drop: float) -> str:
    """Return the robot as URDF text. The base frame is the axle's centre.

    A chassis that is neither a disc nor a rectangle is the mesh `CHASSIS_FILE`, which `chassis_mesh` returns.
    """
    foot = robot.footprint
    if foot.rounding and not foot.is_disc and len(foot.corners) != 1:
        raise FieldError("footprint", "must be a disc or a rectangle; physics has no rectangles with round corners")
    r, wheel = robot.wheel_radius, rolling_radius(robot)
    (front_x, front), (rear_x, rear) = _caster(robot, 1), _caster(robot, -1)
    balls = (
        _Ball("left_wheel", wheel, 0.0, robot.track / 2, wheel - r, robot.wheel_friction, "continuous"),
        _Ball("right_wheel", wheel, 0.0, -robot.track / 2, wheel - r, robot.wheel_friction, "continuous"),
        _Ball("front_caster", front, front_x, 0.0, front - r + CASTER_GAP, 0.0, "fixed"),
        _Ball("rear_caster", rear, rear_x, 0.0, rear - r + CASTER_GAP, 0.0, "fixed"),
    )
    parts = [f"<robot name={quoteattr(robot.name)}>", *_chassis(robot, com_drop)]
    for ball in balls:
        parts += _link(ball, 0.02 * robot.mass)
    return "\n".join([*parts, "</robot>"])


def chassis_mesh(robot: RobotSpec) -> str | None:
    """Return the chassis as Wavefront OBJ in the base frame; None for discs and rectangles, which are simpler shapes.

    Bullet moves a mesh's surface outwards by its collision margin, so the mesh is smaller by that margin.
    """
    foot = robot.footprint
    if len(foot.corners) < 3 or foot.box is not None:
        return None
    low = GROUND_CLEARANCE - robot.wheel_radius + MESH_MARGIN
    levels = (low, low + robot.height - 2 * MESH_MARGIN)
    corners = _moved_inwards(foot.corners, MESH_MARGIN)
    count = len(corners)
    lines = [f"v {x!r} {y!r} {z!r}" for z in levels for x, y in corners]
    for k in range(count):
        after = (k + 1) % count
        lines.append(f"f {k + 1} {after + 1} {count + after + 1}")
        lines.append(f"f {k + 1} {count + after + 1} {count + k + 1}")
    for k in range(1, count - 1):
        lines.append(f"f 1 {k + 2} {k + 1}")
        lines.append(f"f {count + 1} {count + k + 1} {count + k + 2}")
    return "\n".join(["o chassis", *lines, ""])


def _moved_inwards(corners: tuple[Point, ...], by: float) -> list[Point]:
    """Return the corners of a convex, counter-clockwise polygon with its edges moved inwards [m]."""
    moved = []
    for (ax, ay), (bx, by_), (cx, cy) in zip(
        (corners[-1], *corners[:-1]), corners, (*corners[1:], corners[0]), strict=True
    ):
        first, second = math.atan2(by_ - ay, bx - ax), math.atan2(cy - by_, cx - bx)
        half = (second - first) % (2 * math.pi) / 2
        inwards = first + half + math.pi / 2
        away = by / math.cos(half)
        moved.append((bx + away * math.cos(inwards), by_ + away * math.sin(inwards)))
    return moved


def _caster(robot: RobotSpec, way: int) -> tuple[float, float]:
    """Return the x position of the front (1) or rear (-1) caster, and its radius [m]."""
    foot, most = robot.footprint, 0.8 * robot.wheel_radius
    if not foot.corners:
        half_length, half_width = foot.half_length + foot.rounding, foot.half_width + foot.rounding
        x = 0.75 * half_length
        return way * x, min(most, INSIDE * half_length - x, INSIDE * half_width)
    x = way * 0.75 * foot.reach(0.0 if way > 0 else math.pi)
    return x, min(most, INSIDE * foot.depth(x, 0.0))


def _chassis(robot: RobotSpec, com_drop: float) -> list[str]:
    """Return the chassis: a cylinder, a box or a mesh of the footprint's size, with 92 % of the mass."""
    foot, bottom = robot.footprint, GROUND_CLEARANCE - robot.wheel_radius
    inertia_z = yaw_inertia(robot.mass, robot.footprint)
    xmin, ymin, xmax, ymax = foot.bounds
    size_x, size_y = xmax - xmin, ymax - ymin
    x, y, z = (xmin + xmax) / 2, (ymin + ymax) / 2, bottom + robot.height / 2
    inertia_x = robot.mass * (size_y**2 + robot.height**2) / 12
    inertia_y = robot.mass * (size_x**2 + robot.height**2) / 12
    if foot.is_disc or len(foot.corners) == 1:
        shape = f'<cylinder radius="{foot.rounding!r}" length="{robot.height!r}"/>'
        inertia_x = inertia_y = robot.mass * (3 * foot.rounding**2 + robot.height**2) / 12
    elif foot.box is not None:
        shape = f'<box size="{size_x!r} {size_y!r} {robot.height!r}"/>'
    else:
        shape, x, y, z = f'<mesh filename="{CHASSIS_FILE}"/>', 0.0, 0.0, 0.0
    place = f"{x!r} {y!r} {z!r}" if foot.corners else f"0 0 {z!r}"
    return [
        '<link name="chassis">',
        f'<inertial><origin xyz="0 0 {-com_drop!r}"/><mass value="{robot.mass * 0.92!r}"/>',
        f'<inertia ixx="{inertia_x!r}" iyy="{inertia_y!r}" izz="{inertia_z!r}" ixy="0" ixz="0" iyz="0"/></inertial>',
        f'<collision><origin xyz="{place}"/><geometry>{shape}</geometry></collision>',
        DRAWN,
        '<contact><lateral_friction value="0.3"/></contact>',
        "</link>",
    ]


def _link(ball: _Ball, mass: float) -> list[str]:
    """Return a wheel or caster of a mass [kg] with its joint."""

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


def urdf_file(text: str, mesh: str | None) -> Path:
    """Return a file with a robot's URDF text, beside that of its mesh. The process keeps it for its next drive.

    To make and remove a folder takes 5 ms on some file systems.
    """
    name = hashlib.sha256(f"{text}{mesh}".encode()).hexdigest()[:16]
    folder = Path(_folder(os.getpid())) / name
    file = folder / "robot.urdf"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        if mesh is not None:
            (folder / CHASSIS_FILE).write_text(mesh, encoding="utf-8")
        part = folder / "part"
        part.write_text(text, encoding="utf-8")
        part.replace(file)
    return file


@functools.cache
def _folder(process: int) -> str:
    """Make the folder of a process, which it removes at its end."""
    folder = tempfile.mkdtemp(prefix="antdrive-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
