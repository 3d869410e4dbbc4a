"""Frames, joints and URDF of an exported robot, its specification's own or those of a URDF file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree

import numpy as np

from antdrive.base.types import Floats
from antdrive.robots.lidar import Lidar
from antdrive.robots.spec import RobotSpec

FOOTPRINT, BASE, LIDAR = "base_footprint", "base_link", "base_scan"
WHEEL_LINKS = ("left_wheel", "right_wheel")
SCANNERS = re.compile("laser|lidar|scan", re.IGNORECASE)  # names of a lidar's link
COINCIDENT, NEAR = 0.001, 0.01  # largest distance of coincident frames, and of a lidar from its link [m]
LEVEL = 0.99  # minimum vertical component of the axis of a lidar's link

GAP = 0.005  # height of the body above the floor [m]
WHEEL_WIDTH = 0.3  # in wheel radii
#: XML escapes of attributes. The standard library's function loads all of urllib.
ESCAPES = {ord(c): f"&#{ord(c)};" for c in '&<>"\n\r\t'}
BODY_COLOUR, WHEEL_COLOUR = "0.16 0.44 0.72 1", "0.15 0.15 0.15 1"


@dataclass(frozen=True, eq=False)
class RobotFrames:
    """Frames and joints of a robot."""

    text: str  # URDF
    base: str  # frame that odometry moves: on the floor below the axle's centre, x forward
    links: tuple[tuple[str, str, Floats], ...]  # static transforms (4, 4): parent, child, child's frame in its parent's
    joints: tuple[str, str]  # of the left and the right driven wheel
    signs: tuple[float, float]  # 1 for a joint that turns about the robot's y axis, -1 about the opposite one
    scan: str  # frame of the scans
    scanner: Floats  # this frame in the frame `base` (4, 4)
    namespace: str = ""  # prefix of topics and of all frames but `map`, such as /robot1; empty: none

    def frame(self, name: str) -> str:
        """Return a frame's name with the namespace."""
        return f"{self.namespace}/{name}".lstrip("/")

    def under(self, namespace: str) -> RobotFrames:
        """Return the robot in a namespace; the URDF keeps its names, as with the `frame_prefix` of robot_state_publisher."""
        made = replace(self, namespace=namespace)
        links = tuple((made.frame(parent), made.frame(child), place) for parent, child, place in self.links)
        return replace(made, base=made.frame(self.base), scan=made.frame(self.scan), links=links)


def frames_of_spec(robot: RobotSpec) -> RobotFrames:
    """Return the frames of a robot's specification."""
    places = {link: _frame(place) for link, place in wheel_places(robot).items()}
    places |= {} if robot.lidar is None else {LIDAR: _frame_of(robot.lidar)}
    links = ((FOOTPRINT, BASE, np.eye(4)), *((BASE, link, place) for link, place in places.items()))
    joints = (f"{WHEEL_LINKS[0]}_joint", f"{WHEEL_LINKS[1]}_joint")
    return RobotFrames(description(robot), FOOTPRINT, links, joints, (1.0, 1.0), LIDAR, places.get(LIDAR, np.eye(4)))


def frames_of_urdf(
    robot: RobotSpec,
    path: Path,
    *,
    left: str | None = None,
    right: str | None = None,
    arguments: Mapping[str, str] = MappingProxyType({}),
    packages: Mapping[str, Path] = MappingProxyType({}),
) -> RobotFrames:
    """Return the frames of a URDF or xacro file, all joints at zero; raise InputError if it does not fit the robot.

    The lidar's frame is the link at the lidar's position, or `base_scan` if there is none.
    """
    from antdrive.robots.importing.fitting import fitted_model
    from antdrive.robots.importing.sensors import lidar_sensors

    fit = fitted_model(path, robot, left=left, right=right, arguments=arguments, packages=packages)
    model, places = fit.model, {link: fit.root @ place for link, place in fit.model.places.items()}
    root = next(iter(places))
    own = root == FOOTPRINT and np.allclose(fit.root, np.eye(4), rtol=0.0, atol=COINCIDENT)
    base = FOOTPRINT if own else _unused(FOOTPRINT, places)
    links = [] if own else [(base, root, fit.root)]
    links += [
        (joint.parent, joint.child, np.linalg.inv(places[joint.parent]) @ places[joint.child])
        for joint in model.joints.values()
    ]
    scan, scanner = LIDAR, np.eye(4)
    if robot.lidar is not None:
        scanner = _frame_of(robot.lidar)
        at_lidar = [
            link
            for link, place in places.items()
            if abs(place[2, 2]) >= LEVEL and np.linalg.norm(place[:3, 3] - scanner[:3, 3]) <= NEAR
        ]
        if at_lidar:
            sensors = {sensor.link for sensor in lidar_sensors(model.root, model.places)}
            scan = max(at_lidar, key=lambda link: (link in sensors, SCANNERS.search(link) is not None))
            scanner = places[scan]
        else:
            scan = _unused(LIDAR, places)
            links.append((base, scan, scanner))
    joints = fit.joints[0].name, fit.joints[1].name
    signs = (math.copysign(1.0, axis) for axis in ((fit.root[:3, :3] @ joint.axis)[1] for joint in fit.joints))
    text, turning = ElementTree.tostring(model.root, encoding="unicode"), (next(signs), next(signs))
    return RobotFrames(text, base, tuple(links), joints, turning, scan, scanner)


def _unused(name: str, links: Mapping[str, Floats]) -> str:
    """Return a frame's name, prefixed if a link has it."""
    return f"antdrive_{name}" if name in links else name


def _frame(at: tuple[float, float, float], yaw: float = 0.0) -> Floats:
    """Return a frame (4, 4) from its position [m] and yaw [rad]."""
    place = np.eye(4)
    place[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    place[:3, 3] = at
    return place


def _frame_of(lidar: Lidar) -> Floats:
    return _frame((lidar.x, lidar.y, lidar.height), lidar.yaw)


def quaternion(place: Floats) -> list[float]:
    """Return a frame's rotation as x, y, z and w."""
    (a, b, c), (d, e, f), (g, h, i) = place[:3, :3].tolist()
    four = np.array(  # four times the outer product of the quaternion with itself
        [
            [1 + a - e - i, b + d, c + g, h - f],
            [b + d, 1 - a + e - i, f + h, c - g],
            [c + g, f + h, 1 - a - e + i, d - b],
            [h - f, c - g, d - b, 1 + a + e + i],
        ]
    )
    row = four[np.argmax(np.diag(four))]
    return list((row / np.linalg.norm(row)).tolist())


def wheel_places(robot: RobotSpec) -> dict[str, tuple[float, float, float]]:
    """Return the wheels' positions in the robot's frame: x, y and z [m] by link."""
    sides = zip(WHEEL_LINKS, (1, -1), strict=True)
    return {link: (0.0, sign * robot.track / 2, robot.wheel_radius) for link, sign in sides}


def description(robot: RobotSpec) -> str:
    """Return a robot's shape as URDF. The root link's frame is on the floor, below the axle's centre.

    The body is the footprint, a cylinder or its bounding box; the wheels are inside.
    """
    body, x, y = _body(robot)
    origin = f'<origin xyz="{x!r} {y!r} {GAP + robot.height / 2!r}"/>'
    parts = [
        f'<robot name="{robot.name.translate(ESCAPES)}">',
        f'<link name="{FOOTPRINT}"/>',
        f'<joint name="base_joint" type="fixed"><parent link="{FOOTPRINT}"/><child link="{BASE}"/></joint>',
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
            f'<joint name="{link}_joint" type="continuous"><parent link="{BASE}"/><child link="{link}"/><axis xyz="0 1 0"/>',
            f'<origin xyz="{" ".join(map(repr, place))}"/></joint>',
        ]
    return "\n".join([*parts, "</robot>"])


def _body(robot: RobotSpec) -> tuple[str, float, float]:
    """Return the body's geometry and its centre x, y [m] in the robot's frame; a polygon becomes its bounding box."""
    foot, height = robot.footprint, robot.height
    if foot.is_disc or len(foot.corners) == 1:
        x, y = foot.corners[0] if foot.corners else (0.0, 0.0)
        return f'<cylinder radius="{foot.rounding!r}" length="{height!r}"/>', x, y
    xmin, ymin, xmax, ymax = foot.bounds
    size = f"{xmax - xmin!r} {ymax - ymin!r} {height!r}"
    return f'<box size="{size}"/>', (xmin + xmax) / 2, (ymin + ymax) / 2


def _colour(name: str, rgba: str) -> str:
    return f'<material name="{name}"><color rgba="{rgba}"/></material>'
