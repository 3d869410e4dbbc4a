"""The robot as URDF, for programs that draw it, and where its parts are."""

from __future__ import annotations

import math

from antdrive.robots.spec import RobotSpec
from antdrive.views.export.frames import BASE

GAP = 0.005  # height of the body above the floor [m]
WHEEL_WIDTH = 0.3  # in wheel radii
#: How XML writes the characters that an attribute cannot hold. The standard library's function loads all of urllib.
ESCAPES = {ord(c): f"&#{ord(c)};" for c in '&<>"\n\r\t'}
BODY_COLOUR, WHEEL_COLOUR = "0.16 0.44 0.72 1", "0.15 0.15 0.15 1"


def wheel_places(robot: RobotSpec) -> dict[str, tuple[float, float, float]]:
    """Where the wheels are in the robot's frame: x, y and z [m] by link."""
    return {
        f"{side}_wheel": (0.0, sign * robot.track / 2, robot.wheel_radius)
        for side, sign in (("left", 1), ("right", -1))
    }


def description(robot: RobotSpec) -> str:
    """The robot's shape as URDF text. The frame of the root link is on the floor, under the axle's centre.

    The body is the footprint, a cylinder or the box around it; the wheels stand inside it.
    """
    body, x, y = _body(robot)
    origin = f'<origin xyz="{x!r} {y!r} {GAP + robot.height / 2!r}"/>'
    parts = [
        f'<robot name="{robot.name.translate(ESCAPES)}">',
        f'<link name="{BASE}">',
        f"<visual>{origin}<geometry>{body}</geometry>{_colour('body', BODY_COLOUR)}</visual>",
        f"<collision>{origin}<geometry>{body}</geometry></collision>",
        "</link>",
    ]
    wheel = f'<cylinder radius="{robot.wheel_radius!r}" length="{WHEEL_WIDTH * robot.wheel_radius!r}"/>'
    lying = f'<origin rpy="{math.pi / 2!r} 0 0"/>'
    for link, place in wheel_places(robot).items():
        parts += [
            f'<link name="{link}">',
            f"<visual>{lying}<geometry>{wheel}</geometry>{_colour('wheel', WHEEL_COLOUR)}</visual>",
            "</link>",
            f'<joint name="{link}_joint" type="fixed"><parent link="{BASE}"/><child link="{link}"/>',
            f'<origin xyz="{" ".join(map(repr, place))}"/></joint>',
        ]
    return "\n".join([*parts, "</robot>"])


def _body(robot: RobotSpec) -> tuple[str, float, float]:
    """The body's geometry, and its middle in the robot's frame, x and y [m]; a polygon is described by the box around it."""
    foot, height = robot.footprint, robot.height
    if foot.is_disc or len(foot.corners) == 1:
        x, y = foot.corners[0] if foot.corners else (0.0, 0.0)
        return f'<cylinder radius="{foot.rounding!r}" length="{height!r}"/>', x, y
    xmin, ymin, xmax, ymax = foot.bounds
    size = f"{xmax - xmin!r} {ymax - ymin!r} {height!r}"
    return f'<box size="{size}"/>', (xmin + xmax) / 2, (ymin + ymax) / 2


def _colour(name: str, rgba: str) -> str:
    return f'<material name="{name}"><color rgba="{rgba}"/></material>'
