"""What a URDF file says, with every link where it is when all joints are at zero. Lengths in metres.

xacro files are expanded without ROS; packages are found beside the file and above it, or where people say.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as ET

import numpy as np

from antdrive.base.errors import InputError, input_error
from antdrive.base.optional import optional
from antdrive.base.types import Floats
from antdrive.robots.importing.sensors import UrdfSensor, lidar_sensors
from antdrive.worlds.formats.xml import parse_xml

MAX_PACKAGES = 100  # that one file may refer to


def package_folder(source: Path, name: str, packages: Mapping[str, Path]) -> Path | None:
    """The folder of a package: as given, or one of that name beside the file or above it; None if there is none."""
    if name in packages:
        return packages[name]
    above = source.resolve().parents
    return next((folder for parent in above for folder in (parent / name,) if folder.is_dir()), None)


def expanded(path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> str:
    """The URDF text of a xacro file."""
    if not path.is_file():
        raise input_error(str(path), "no such file")
    xacrodoc = optional("xacrodoc", "urdf", "xacro files are expanded with it")
    known = dict(packages)
    for _ in range(MAX_PACKAGES):
        xacrodoc.packages.reset()
        xacrodoc.packages.update_package_cache(known)
        try:
            document = xacrodoc.XacroDoc.from_file(str(path), subargs=dict(arguments), resolve_packages=False)
            return str(document.to_urdf_string())
        except Exception as error:  # xacro raises whatever its expressions raise
            missing = _missing_package(error)
            folder = None if missing is None or missing in known else package_folder(path, missing, known)
            if missing is None or folder is None:
                raise input_error(str(path), f"xacro cannot expand it: {_in_one_line(error)}{_help(error)}") from None
            known[missing] = folder
    raise input_error(str(path), f"refers to more than {MAX_PACKAGES} packages")


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """An exception and those that it came from."""
    while error is not None:
        yield error
        inner = getattr(error, "exc", None)
        error = inner if isinstance(inner, BaseException) else error.__context__


def _missing_package(error: Exception) -> str | None:
    found = (cause for cause in _causes(error) if type(cause).__name__ == "PackageNotFoundError")
    return next((str(cause.args[0]) for cause in found if cause.args), None)


def _help(error: Exception) -> str:
    """What a person can do about it."""
    if _missing_package(error) is not None:
        return "; say where it is with --package NAME=FOLDER"
    missing = next((cause for cause in _causes(error) if type(cause).__name__ == "ArgException"), None)
    return "" if missing is None else "; give it with --arg NAME=VALUE"


def _in_one_line(error: Exception) -> str:
    """What xacro says, without the class and the repetition that it begins with, and without line breaks, real or spelt out."""
    text = " ".join(str(error).replace("\\n", " ").split()) or type(error).__name__
    text = re.sub(r"^<class '[^']*'>: ", "", text)
    half = len(text) // 2
    text = text[:half] if text[:half] == text[half + 1 :] else text
    inner = next((str(cause) for cause in _causes(error) if type(cause).__name__ == "ArgException"), "")
    return f"{text}: {inner}" if inner and inner not in text else text


def checked_packages(given: Mapping[str, str]) -> dict[str, Path]:
    """Folders of packages, as people gave them."""
    for name, folder in given.items():
        if not Path(folder).is_dir():
            raise InputError(f"--package {name}={folder}: no such folder")
    return {name: Path(folder) for name, folder in given.items()}


# Around a circle of radius 1, with sides ahead, behind, to the left and to the right: it is as long and as wide as the circle.
CIRCLE = np.exp(2j * math.pi * (np.arange(96) + 0.5) / 96) / math.cos(math.pi / 96)
MAX_LINKS = 10_000


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint of a URDF file."""

    name: str  # its name
    kind: str  # fixed, continuous, revolute, prismatic, floating or planar
    parent: str  # the link that holds it
    child: str  # the link that it moves
    place: Floats  # its frame in that of the model's root (4, 4)
    axis: Floats  # the direction of its axis in the root's frame (3,)
    velocity: float | None  # the limit of its speed [rad/s]; None where the file has none
    effort: float | None  # the limit of its torque [N m]; None where the file has none
    range: float  # how far it turns, from its lower to its upper limit [rad]; inf where it turns freely
    # the greatest speed that <ros2_control> lets it be given, inf without a limit [rad/s]; None where it is not
    # driven by speed there
    commanded: float | None = None


@dataclass(frozen=True, eq=False)
class CollisionPiece:
    """A piece of collision geometry, in the root's frame."""

    link: str  # the link that it belongs to
    kind: str  # box, cylinder, sphere or mesh
    points: Floats  # points whose convex hull holds it (N, 3)
    centre: Floats  # its middle (3,)
    radius: float | None = None  # of a cylinder or sphere [m]
    length: float | None = None  # of a cylinder [m]


@dataclass(frozen=True, eq=False)
class UrdfModel:
    """A robot as a URDF file describes it."""

    source: Path  # the file
    name: str  # the robot's name in it
    joints: dict[str, UrdfJoint]  # its joints by name
    places: dict[str, Floats]  # the frame of each link in that of the root (4, 4)
    pieces: tuple[CollisionPiece, ...]  # its collision geometry
    masses: dict[str, float]  # the mass of each link that has one [kg]
    # what a Gazebo plugin that drives wheels says, by tag; what it says of several wheels is left out
    drive: dict[str, str]
    missing_meshes: tuple[str, ...]  # meshes that were not found
    lidars: tuple[UrdfSensor, ...] = ()  # the lidars that Gazebo would simulate

    def above(self, link: str) -> Iterator[UrdfJoint]:
        """The joints between a link and the root, from the link on."""
        holders = {joint.child: joint for joint in self.joints.values()}
        while link in holders:
            yield holders[link]
            link = holders[link].parent

    def drive_number(self, *tags: str) -> tuple[str, float | None]:
        """The first of some tags of the drive plugin that has a number greater than 0, and the number; None if none has."""
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
    """The robot in a URDF or xacro file."""
    root = _root_element(path, arguments, packages)
    if root.tag != "robot":
        raise input_error(str(path), f"its root element is <{root.tag}>; a URDF file begins with <robot>")
    links = {_named(path, link): link for link in root.findall("link")}
    if not 0 < len(links) <= MAX_LINKS:
        raise input_error(str(path), f"has {len(links)} links; a robot has 1 to {MAX_LINKS}")
    found = [_joint(path, element) for element in root.findall("joint")]
    commanded = _commanded(path, root, {joint.name for joint in found})
    places, joints = _placed(path, set(links), [replace(joint, commanded=commanded.get(joint.name)) for joint in found])
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
        path, root.get("name", path.stem), joints, places, tuple(pieces), masses, _drive(root), missing_meshes, lidars
    )


def _commanded(path: Path, root: ET.Element, joints: set[str]) -> dict[str, float]:
    """The joints that <ros2_control> drives by their speed, and the greatest speed that each may be given [rad/s]."""
    found = {}
    for joint in root.findall("ros2_control/joint"):
        name = _named(path, joint)
        for interface in joint.findall("command_interface"):
            if interface.get("name") != "velocity":
                continue
            if name not in joints:
                raise input_error(str(path), f"<ros2_control> drives joint {name!r}, which there is not")
            most = next((param.text for param in interface.findall("param") if param.get("name") == "max"), None)
            try:
                found[name] = math.inf if most is None else float(most)
            except ValueError:
                found[name] = math.nan
            if not found[name] > 0:
                raise input_error(
                    str(path), f"joint {name}", f"max in <ros2_control> must be a number above 0, got {most!r}"
                )
    return found


def _drive(root: ET.Element) -> dict[str, str]:
    """What plugins that drive wheels say, by tag. A tag that a plugin repeats, such as the left wheels of a vehicle that
    skids, is left out: it names no one wheel."""
    drive: dict[str, str] = {}
    for plugin in root.findall("gazebo/plugin"):
        tags = Counter(element.tag for element in plugin)
        if any(re.fullmatch(r"left\w*joint", tag, re.IGNORECASE) for tag in tags):
            drive |= {element.tag: (element.text or "").strip() for element in plugin if tags[element.tag] == 1}
    return drive


def _root_element(path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> ET.Element:
    if path.suffix.lower() != ".xacro":
        if arguments:
            raise InputError(f"--arg {next(iter(arguments))}: {path.name} is no .xacro, and has no arguments")
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
    """The frame (4, 4) that an element's <origin> describes."""
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
    """A joint, with its place and axis in the frame of its parent."""
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
        raise input_error(str(path), f"joint {name}", "its axis is 0 0 0")
    turns = math.inf if kind == "continuous" else upper - lower
    place = _origin(path, element)
    return UrdfJoint(
        name, kind, parent, child, place, axis / np.linalg.norm(axis), velocity or None, effort or None, turns
    )


def _placed(path: Path, links: set[str], found: list[UrdfJoint]) -> tuple[dict[str, Floats], dict[str, UrdfJoint]]:
    """The frame of each link, and the joints with place and axis, in the frame of the root."""
    for joint in found:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise input_error(str(path), f"joint {joint.name}", f"there is no link {link!r}")
    children = [joint.child for joint in found]
    roots = sorted(links - set(children))
    if len(roots) != 1 or len(children) != len(set(children)):
        raise input_error(
            str(path), f"its links must form one tree; links without a parent: {', '.join(roots) or 'none'}"
        )
    places: dict[str, Floats] = {roots[0]: np.eye(4)}
    joints: dict[str, UrdfJoint] = {}
    while len(joints) < len(found):
        ready = [joint for joint in found if joint.parent in places and joint.name not in joints]
        if not ready:
            raise input_error(str(path), "two joints have one name, or joints form a ring")
        for joint in ready:
            place = places[joint.parent] @ joint.place
            places[joint.child] = place
            joints[joint.name] = replace(joint, place=place, axis=place[:3, :3] @ joint.axis)
    return places, joints


class _Shapes:
    """Reads collision geometry, meshes among it."""

    def __init__(self, path: Path, meshes: Path | None, without_meshes: bool, packages: Mapping[str, Path]) -> None:
        self._path, self._meshes, self._without, self._packages = path, meshes, without_meshes, packages
        self.missing_meshes: list[str] = []

    def piece(self, link: str, place: Floats, element: ET.Element) -> Iterator[CollisionPiece]:
        """The piece of a <collision>; none for a mesh that is left out."""
        geometry = element.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
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
        else:
            raise input_error(str(self._path), f"link {link}", f"unknown geometry <{shape.tag}>")
        placed = points @ place[:3, :3].T + place[:3, 3]
        centre = (placed.min(axis=0) + placed.max(axis=0)) / 2
        yield CollisionPiece(link, shape.tag, placed, centre, radius, length)

    def _extent(self, link: str, shape: ET.Element, key: str) -> float:
        value = _number(self._path, shape, key, 0.0)
        return _greater_than_0(self._path, f"link {link}", f"the {key} of a <{shape.tag}>", value)

    def _mesh(self, link: str, shape: ET.Element) -> Floats | None:
        """The vertices (N, 3) of a mesh; None where it is left out."""
        name = shape.get("filename", "")
        file = next((file for file in self._candidates(name) if file.is_file()), None)
        if file is None:
            if not self._without:
                raise input_error(
                    str(self._path),
                    f"link {link}",
                    f"mesh {name} is not found; say where with --meshes FOLDER or --package NAME=FOLDER, or --without-meshes",
                )
            self.missing_meshes.append(f"{link}: {name}")
            return None
        trimesh = optional("trimesh", "urdf", f"mesh {file.name} is read with it")
        try:
            vertices = np.asarray(trimesh.load(str(file), force="mesh").vertices, dtype=np.float64)
        except Exception as error:  # each format has errors of its own
            raise input_error(str(file), f"cannot be read as a mesh: {error or type(error).__name__}") from None
        if not len(vertices) or not np.isfinite(vertices).all():
            raise input_error(str(file), "has no vertices, or some that are not finite")
        return vertices * _unit(file)

    def _candidates(self, name: str) -> Iterator[Path]:
        """Where a mesh may be: package://NAME/meshes/a.stl is below a folder called NAME, or the folder given."""
        bare = name.partition("://")[2] if "://" in name else name
        package, _, inside = bare.partition("/") if name.startswith("package://") else ("", "", bare)
        if package in self._packages:
            yield self._packages[package] / inside
        folders = [self._meshes] if self._meshes is not None else [self._path.parent, *self._path.resolve().parents]
        for folder in folders:
            yield folder / bare
            yield folder / inside
            yield folder / Path(bare).name


def _unit(file: Path) -> float:
    """The unit of a mesh file [m]. COLLADA states it, and trimesh leaves it to its caller; other formats have none.

    The file's up axis is left as it is, as RViz and Gazebo leave it.
    """
    if file.suffix.lower() != ".dae":
        return 1.0
    unit = next((element for element in parse_xml(file).iter() if element.tag.rpartition("}")[2] == "unit"), None)
    return _greater_than_0(file, "<unit>", "meter", _number(file, unit, "meter", 1.0))
