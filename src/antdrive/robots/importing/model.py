"""URDF models, with all joints at zero. Lengths in metres.

xacro files are expanded without ROS. Packages not given are searched for beside the file and in its parent folders.
"""

from __future__ import annotations

import contextlib
import errno
import io
import math
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as ET

import numpy as np

from antdrive.base.checks import suggest
from antdrive.base.errors import InputError, input_error
from antdrive.base.files import open_regular, read_bytes
from antdrive.base.optional import optional
from antdrive.base.types import Floats
from antdrive.robots.importing.sensors import UrdfSensor, lidar_sensors
from antdrive.worlds.formats.meshes import read_mesh
from antdrive.worlds.formats.xml import MAX_BYTES, parse_xml

MAX_PACKAGES = 100  # referenced by one file


def package_folder(source: Path, name: str, packages: Mapping[str, Path]) -> Path | None:
    """Return a package's folder: the given one, or one of that name beside or above the file; None if missing."""
    if name in packages:
        return packages[name]
    above = source.resolve().parents
    return next((folder for parent in above for folder in (parent / name,) if folder.is_dir()), None)


def expanded(path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> str:
    """Expand a xacro file to URDF text."""
    read_bytes(path, MAX_BYTES, "a xacro file")
    xacrodoc = optional("xacrodoc", "urdf", "xacro files need it")
    known = dict(packages)
    for _ in range(MAX_PACKAGES):
        xacrodoc.packages.reset()
        xacrodoc.packages.update_package_cache(known)
        asked = _Arguments(arguments)
        try:
            with _refusing_pipes():
                document = xacrodoc.XacroDoc.from_file(str(path), subargs=asked, resolve_packages=False)
            text = str(document.to_urdf_string())
        except InputError:
            raise
        except Exception as error:  # xacro's expressions can raise any exception
            missing = _missing_package(error)
            folder = None if missing is None or missing in known else package_folder(path, missing, known)
            if missing is None or folder is None:
                raise input_error(str(path), f"xacro cannot expand it: {_in_one_line(error)}{_help(error)}") from None
            known[missing] = folder
            continue
        unknown = next((name for name in arguments if name not in asked.names), None)
        if unknown is not None:
            advice = suggest(unknown, sorted(asked.names)) if asked.names else "it has none"
            raise InputError(f"--arg {unknown}: {path.name} has no such argument; {advice}")
        return text
    raise input_error(str(path), f"refers to more than {MAX_PACKAGES} packages")


@contextlib.contextmanager
def _refusing_pipes() -> Iterator[None]:
    """Replace `open` in xacro's modules by a function that opens regular files alone."""

    def open_text(path: str, mode: str = "r") -> io.TextIOBase:
        if not os.path.exists(path):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)  # which xacro explains
        return io.TextIOWrapper(open_regular(path, MAX_BYTES, "a xacro file"), encoding="utf-8")

    modules = [sys.modules[name] for name in ("xacro", "xacrodoc.xacrodoc", "xacrodoc.packages") if name in sys.modules]
    for module in modules:
        vars(module)["open"] = open_text
    try:
        yield
    finally:
        for module in modules:
            del vars(module)["open"]


class _Arguments(dict[str, str]):
    """Arguments for xacro that record which names it asks for; it writes declared defaults among them."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.names: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.names.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.names.add(name)
        return super().__getitem__(name)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an exception and its causes."""
    while error is not None:
        yield error
        inner = getattr(error, "exc", None)
        error = inner if isinstance(inner, BaseException) else error.__context__


def _missing_package(error: Exception) -> str | None:
    causes = (cause for cause in _causes(error) if type(cause).__name__ == "PackageNotFoundError")
    return next((str(cause.args[0]) for cause in causes if cause.args), None)


def _help(error: Exception) -> str:
    """Return a hint on how to fix the error; empty if unknown."""
    if _missing_package(error) is not None:
        return "; give its folder with --package NAME=FOLDER"
    missing = next((cause for cause in _causes(error) if type(cause).__name__ == "ArgException"), None)
    return "" if missing is None else "; give it with --arg NAME=VALUE"


def _in_one_line(error: Exception) -> str:
    """Return xacro's message without class name, repetition and line breaks."""
    text = " ".join(str(error).replace("\\n", " ").split()) or type(error).__name__
    text = re.sub(r"^<class '[^']*'>: ", "", text)
    half = len(text) // 2
    text = text[:half] if text[:half] == text[half + 1 :] else text
    inner = next((str(cause) for cause in _causes(error) if type(cause).__name__ == "ArgException"), "")
    return f"{text}: {inner}" if inner and inner not in text else text


def checked_packages(given: Mapping[str, str]) -> dict[str, Path]:
    """Return the given folders of packages as paths; raise InputError for missing ones."""
    for name, folder in given.items():
        if not Path(folder).is_dir():
            raise InputError(f"--package {name}={folder}: no such folder")
    return {name: Path(folder) for name, folder in given.items()}


# Polygon circumscribed about the unit circle, with the same bounding box.
CIRCLE = np.exp(2j * math.pi * (np.arange(96) + 0.5) / 96) / math.cos(math.pi / 96)
MAX_LINKS = 10_000
MAX_COORDINATE = 1e6  # [m]
OTHER_DRIVES = re.compile(
    r"ackermann|tricycle|bicycle|omni(?!cam)|mecanum|holonomic|swerve|planar_?move", re.IGNORECASE
)


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint of a URDF file."""

    name: str
    kind: str  # fixed, continuous, revolute, prismatic, floating or planar
    parent: str  # parent link
    child: str  # child link
    place: Floats  # its frame in the root's frame (4, 4)
    axis: Floats  # its axis in the root's frame (3,)
    velocity: float | None  # speed limit [rad/s]; None if not given
    effort: float | None  # torque limit [N m]; None if not given
    range: float  # from its lower to its upper limit [rad]; inf if it turns freely
    # speed limit in <ros2_control> [rad/s]: inf if unlimited, None without a velocity interface
    commanded: float | None = None


@dataclass(frozen=True, eq=False)
class CollisionPiece:
    """A piece of collision geometry, in the root's frame."""

    link: str  # its link
    kind: str  # box, cylinder, sphere or mesh
    points: Floats  # points whose convex hull contains it (N, 3)
    centre: Floats  # (3,)
    radius: float | None = None  # of a cylinder or sphere [m]
    length: float | None = None  # of a cylinder [m]


@dataclass(frozen=True, eq=False)
class UrdfModel:
    """A robot in a URDF file."""

    source: Path  # the file
    name: str  # the robot's name
    joints: dict[str, UrdfJoint]  # by name
    places: dict[str, Floats]  # each link's frame in the root's frame (4, 4)
    pieces: tuple[CollisionPiece, ...]  # collision geometry
    masses: dict[str, float]  # of the links with a mass [kg]
    drive: dict[str, str]  # values of Gazebo's drive plugins by tag, without repeated tags
    other_drive: str  # a Gazebo plugin that drives other than differentially; empty without one
    missing_meshes: tuple[str, ...]
    lidars: tuple[UrdfSensor, ...]  # the lidars that Gazebo simulates
    text: str  # URDF, without xacro

    def above(self, link: str) -> Iterator[UrdfJoint]:
        """Yield the joints from a link to the root."""
        holders = {joint.child: joint for joint in self.joints.values()}
        while link in holders:
            yield holders[link]
            link = holders[link].parent

    def drive_number(self, *tags: str) -> tuple[str, float | None]:
        """Return the first tag of the drive plugin with a positive number, and the number; None if there is none."""
        for tag in tags:
            try:
                value = float(self.drive.get(tag, ""))
            except ValueError:
                continue
            if 0 < value < math.inf:
                return tag, value
        return "", None


def read_model(
    path: Path,
    *,
    meshes: Path | None = None,
    without_meshes: bool = False,
    arguments: Mapping[str, str] = MappingProxyType({}),
    packages: Mapping[str, Path] = MappingProxyType({}),
) -> UrdfModel:
    """Read a URDF or xacro file."""
    root = _root_element(path, arguments, packages)
    if root.tag != "robot":
        raise input_error(str(path), f"the root element must be <robot>, got <{root.tag}>")
    links = {_named(path, link): link for link in root.findall("link")}
    if not 0 < len(links) <= MAX_LINKS:
        raise input_error(str(path), f"has {len(links)} links; a robot has 1 to {MAX_LINKS}")
    local = [_joint(path, element) for element in root.findall("joint")]
    commanded = _commanded(path, root, {joint.name for joint in local})
    places, joints = _placed(path, set(links), [replace(joint, commanded=commanded.get(joint.name)) for joint in local])
    reader = _Shapes(path, meshes, without_meshes, packages)
    pieces = [
        piece
        for name, link in links.items()
        for element in link.findall("collision")
        for piece in reader.piece(name, places[name] @ _origin(path, element), element)
    ]
    masses = {
        name: _at_least_0(path, f"link {name}", "mass", _number(path, mass, "value", 0.0))
        for name, link in links.items()
        for mass in link.findall("inertial/mass")
    }
    lidars, missing_meshes = lidar_sensors(root, places), tuple(reader.missing_meshes)
    return UrdfModel(
        path,
        root.get("name", path.stem),
        joints,
        places,
        tuple(pieces),
        masses,
        _drive(root),
        _other_drive(root),
        missing_meshes,
        lidars,
        ET.tostring(root, encoding="unicode"),
    )


def _commanded(path: Path, root: ET.Element, joints: set[str]) -> dict[str, float]:
    """Return the speed limits of the velocity-controlled joints in <ros2_control> [rad/s]."""
    speeds = {}
    for joint in root.findall("ros2_control/joint"):
        name = _named(path, joint)
        for interface in joint.findall("command_interface"):
            if interface.get("name") != "velocity":
                continue
            if name not in joints:
                raise input_error(str(path), f"<ros2_control> names joint {name!r}, which does not exist")
            most = next((param.text for param in interface.findall("param") if param.get("name") == "max"), None)
            try:
                speeds[name] = math.inf if most is None else float(most)
            except ValueError:
                speeds[name] = math.nan
            if not speeds[name] > 0:
                raise input_error(
                    str(path), f"joint {name}", f"max in <ros2_control> must be a number above 0, got {most!r}"
                )
    return speeds


def _drive(root: ET.Element) -> dict[str, str]:
    """Return the values of drive plugins by tag.

    Tags that a plugin repeats, such as the left wheels of a skid-steer vehicle, are omitted.
    """
    drive: dict[str, str] = {}
    for plugin in root.findall("gazebo/plugin"):
        tags = Counter(element.tag for element in plugin)
        if any(re.fullmatch(r"left\w*joint", tag, re.IGNORECASE) for tag in tags):
            drive |= {element.tag: (element.text or "").strip() for element in plugin if tags[element.tag] == 1}
    return drive


def _other_drive(root: ET.Element) -> str:
    """Return the name of a plugin for steered or omnidirectional wheels; empty without one."""
    plugins = (plugin for tag in ("gazebo/plugin", "plugin") for plugin in root.findall(tag))
    names = ((plugin.get("name", ""), plugin.get("filename", "")) for plugin in plugins)
    return next((" ".join(filter(None, pair)) for pair in names if any(map(OTHER_DRIVES.search, pair))), "")


def _root_element(path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> ET.Element:
    if path.suffix.lower() != ".xacro":
        if arguments:
            raise InputError(f"--arg {next(iter(arguments))}: {path.name} is not a .xacro file and has no arguments")
        return parse_xml(path)
    text = expanded(path, arguments, packages)
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / f"{path.stem}.urdf"
        plain.write_text(text, encoding="utf-8")
        try:
            return parse_xml(plain)
        except InputError as error:
            raise InputError(str(error).replace(str(plain), str(path))) from None


def _named(path: Path, element: ET.Element) -> str:
    name = element.get("name")
    if not name:
        raise input_error(str(path), f"a <{element.tag}> has no name")
    return name


def _numbers(path: Path, element: ET.Element | None, key: str, default: tuple[float, ...]) -> Floats:
    text = None if element is None else element.get(key)
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.array([math.nan])
    if len(values) != len(default) or not np.isfinite(values).all() or not (np.abs(values) <= 1e6).all():
        tag = "" if element is None else element.tag
        raise input_error(str(path), f"<{tag} {key}={text!r}>", f"must be {len(default)} numbers")
    return values


def _number(path: Path, element: ET.Element | None, key: str, default: float) -> float:
    return float(_numbers(path, element, key, (default,))[0])


def _at_least_0(path: Path, where: str, what: str, value: float) -> float:
    if value < 0:
        raise input_error(str(path), where, f"{what} must be at least 0, got {value:g}")
    return value


def _greater_than_0(path: Path, where: str, what: str, value: float) -> float:
    if not value > 0:
        raise input_error(str(path), where, f"{what} must be greater than 0, got {value:g}")
    return value


def _origin(path: Path, element: ET.Element) -> Floats:
    """Return the frame (4, 4) of an element's <origin>."""
    origin = element.find("origin")
    place = np.eye(4)
    roll, pitch, yaw = _numbers(path, origin, "rpy", (0.0, 0.0, 0.0))
    place[:3, :3] = _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)
    place[:3, 3] = _numbers(path, origin, "xyz", (0.0, 0.0, 0.0))
    return place


def _turn(axis: int, angle: float) -> Floats:
    turn, (a, b) = np.eye(3), ((1, 2), (2, 0), (0, 1))[axis]
    turn[a, a] = turn[b, b] = math.cos(angle)
    turn[a, b], turn[b, a] = -math.sin(angle), math.sin(angle)
    return turn


def _joint(path: Path, element: ET.Element) -> UrdfJoint:
    """Read a joint, with frame and axis in its parent's frame."""
    name, kind = _named(path, element), element.get("type", "")
    ends = [element.find(tag) for tag in ("parent", "child")]
    parent, child = ("" if end is None else end.get("link", "") for end in ends)
    limit = element.find("limit")
    lower, upper = (_number(path, limit, key, 0.0) for key in ("lower", "upper"))
    velocity, effort = (
        _at_least_0(path, f"joint {name}", f"the limit's {key}", _number(path, limit, key, 0.0))
        for key in ("velocity", "effort")
    )
    axis = _numbers(path, element.find("axis"), "xyz", (1.0, 0.0, 0.0))
    if not np.any(axis):
        raise input_error(str(path), f"joint {name}", "the axis must not be 0 0 0")
    turns = math.inf if kind == "continuous" else upper - lower
    place = _origin(path, element)
    return UrdfJoint(
        name, kind, parent, child, place, axis / np.linalg.norm(axis), velocity or None, effort or None, turns
    )


def _placed(path: Path, links: set[str], local: list[UrdfJoint]) -> tuple[dict[str, Floats], dict[str, UrdfJoint]]:
    """Return each link's frame, and the joints with frame and axis, in the root's frame."""
    for joint in local:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise input_error(str(path), f"joint {joint.name}", f"there is no link {link!r}")
    children = [joint.child for joint in local]
    roots = sorted(links - set(children))
    if len(roots) != 1 or len(children) != len(set(children)):
        raise input_error(
            str(path), f"its links must form one tree; links without a parent: {', '.join(roots) or 'none'}"
        )
    places: dict[str, Floats] = {roots[0]: np.eye(4)}
    joints: dict[str, UrdfJoint] = {}
    while len(joints) < len(local):
        ready = [joint for joint in local if joint.parent in places and joint.name not in joints]
        if not ready:
            raise input_error(str(path), "two joints have the same name, or joints form a loop")
        for joint in ready:
            place = places[joint.parent] @ joint.place
            places[joint.child] = place
            joints[joint.name] = replace(joint, place=place, axis=place[:3, :3] @ joint.axis)
    return places, joints


class _Shapes:
    """A reader of collision geometry, including meshes."""

    def __init__(self, path: Path, meshes: Path | None, without_meshes: bool, packages: Mapping[str, Path]) -> None:
        self._path, self._meshes, self._without, self._packages = path, meshes, without_meshes, packages
        self.missing_meshes: list[str] = []

    def piece(self, link: str, place: Floats, element: ET.Element) -> Iterator[CollisionPiece]:
        """Yield the piece of a <collision>; nothing for a missing mesh."""
        shape = element.find("geometry/*")
        if shape is None:
            raise input_error(str(self._path), f"link {link}", "a <collision> has no geometry")
        radius = length = None
        if shape.tag == "box":
            size = _numbers(self._path, shape, "size", (0.0, 0.0, 0.0))
            _greater_than_0(self._path, f"link {link}", "the size of a <box>", float(size.min()))
            half = size / 2
            points = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
        elif shape.tag == "cylinder":
            radius, length = (self._extent(link, shape, key) for key in ("radius", "length"))
            ring = radius * np.column_stack([CIRCLE.real, CIRCLE.imag])
            points = np.vstack([np.column_stack([ring, np.full(len(ring), z)]) for z in (-length / 2, length / 2)])
        elif shape.tag == "sphere":
            radius = self._extent(link, shape, "radius")
            ring, flat = radius * np.column_stack([CIRCLE.real, CIRCLE.imag]), np.zeros(len(CIRCLE))
            place = place.copy()
            place[:3, :3] = np.eye(3)
            points = np.vstack([np.column_stack([ring, flat]), [[0, 0, radius], [0, 0, -radius]]])
        elif shape.tag == "mesh":
            mesh = self._mesh(link, shape)
            if mesh is None:
                return
            points = mesh * _numbers(self._path, shape, "scale", (1.0, 1.0, 1.0))
            if not (np.abs(points) <= MAX_COORDINATE).all():
                where = f"link {link}", f"mesh {shape.get('filename')}"
                raise input_error(str(self._path), *where, f"reaches beyond {MAX_COORDINATE:g} m")
        else:
            raise input_error(str(self._path), f"link {link}", f"unknown geometry <{shape.tag}>")
        placed = points @ place[:3, :3].T + place[:3, 3]
        centre = (placed.min(axis=0) + placed.max(axis=0)) / 2
        yield CollisionPiece(link, shape.tag, placed, centre, radius, length)

    def _extent(self, link: str, shape: ET.Element, key: str) -> float:
        value = _number(self._path, shape, key, 0.0)
        return _greater_than_0(self._path, f"link {link}", f"the {key} of a <{shape.tag}>", value)

    def _mesh(self, link: str, shape: ET.Element) -> Floats | None:
        """Return a mesh's vertices (N, 3); None if it is missing."""
        name = shape.get("filename", "")
        file = next((file for file in self._candidates(name) if file.exists() and not file.is_dir()), None)
        if file is None:
            if not self._without:
                raise input_error(
                    str(self._path),
                    f"link {link}",
                    f"mesh {name} not found; give --meshes FOLDER, --package NAME=FOLDER or --without-meshes",
                )
            self.missing_meshes.append(f"{link}: {name}")
            return None
        return read_mesh(file)[0]

    def _candidates(self, name: str) -> Iterator[Path]:
        """Yield candidate paths of a mesh; package://NAME/FILE resolves below a folder NAME or the given folder."""
        bare = name.partition("://")[2] if "://" in name else name
        package, _, inside = bare.partition("/") if name.startswith("package://") else ("", "", bare)
        if package in self._packages:
            yield self._packages[package] / inside
        folders = [self._meshes] if self._meshes is not None else [self._path.parent, *self._path.resolve().parents]
        for folder in folders:
            yield folder / bare
            yield folder / inside
            yield folder / Path(bare).name
