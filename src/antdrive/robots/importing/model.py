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
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from antdrive.base.checks import suggest
from antdrive.base.errors import InputError, input_error
from antdrive.base.files import open_regular, read_bytes
from antdrive.base.optional import optional
from antdrive.base.ros import ros_package
from antdrive.base.types import Floats
from antdrive.worlds.formats.meshes import read_mesh
from antdrive.worlds.formats.xml import MAX_BYTES, numbers_in, parse_xml, pose_matrix

STAND_IN = f"{os.sep}missing package "  # start of the path of a missing package


def package_folder(source: Path, name: str, packages: Mapping[str, Path]) -> Path | None:
    """Return a package's folder, the given one first; None if missing."""
    return packages.get(name) or ros_package(name, source)


def expanded(path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> tuple[str, Missing]:
    """Expand a xacro file to URDF text; also return what was left out for want of a package.

    Missing packages are replaced by empty ones. Their macros expand to nothing.
    """
    read_bytes(path, MAX_BYTES, "a xacro file")
    xacrodoc = optional("xacrodoc", "urdf", "xacro files need it")
    asked, missing = _Arguments(arguments), Missing()
    try:
        with _patched(path, packages, missing):
            document = xacrodoc.XacroDoc.from_file(str(path), walk_up=False, subargs=asked, resolve_packages=False)
        text = str(document.to_urdf_string())
    except InputError:
        raise
    except Exception as error:  # xacro's expressions can raise any exception
        why = f"{_in_one_line(error)}{_help(error)}{missing.remedy}"
        raise input_error(str(path), f"xacro cannot expand it: {why}") from None
    unknown = next((name for name in arguments if name not in asked.names), None)
    if unknown is not None:
        advice = suggest(unknown, sorted(asked.names)) if asked.names else "it has none"
        raise InputError(f"--arg {unknown}: {path.name} has no such argument; {advice}")
    return text, missing


class OtherDriveError(InputError):
    """A robot that does not drive differentially, whatever its file lacks."""


@dataclass
class Missing:
    """Packages that were not found, and the macros that are missing with them."""

    packages: list[str] = field(default_factory=list)
    macros: list[str] = field(default_factory=list)  # that expanded to nothing
    included: bool = False  # whether a file of one of them was included

    @property
    def remedy(self) -> str:
        """How to give them; empty if none is missing."""
        if not self.packages:
            return ""
        names = ", ".join(self.packages)
        return f"; Package not found: {names}; give its folder with --package {self.packages[0]}=FOLDER"

    @contextlib.contextmanager
    def named(self) -> Iterator[None]:
        """Add the remedy to errors about a robot that lacks parts."""
        try:
            yield
        except OtherDriveError:
            raise
        except InputError as error:
            raise InputError(f"{error}{self.remedy}") from None

    @property
    def notes(self) -> list[str]:
        """What was left out, one line for all packages."""
        if not self.packages:
            return []
        left = f"; omitted with them: {', '.join(dict.fromkeys(self.macros))}" if self.macros else ""
        return [f"packages not found: {', '.join(self.packages)}{left}; --package NAME=FOLDER adds them"]


@contextlib.contextmanager
def _patched(path: Path, packages: Mapping[str, Path], missing: Missing) -> Iterator[None]:
    """Let xacro find files beside the including one, open regular files alone and pass over missing packages."""
    xacro, finder, reader = (sys.modules[name] for name in ("xacro", "xacrodoc.packages", "xacrodoc.xacrodoc"))
    expand_macro = vars(xacro)["handle_macro_call"]

    def find(name: str) -> str:
        folder = package_folder(path, name, packages)
        if folder is None and name not in missing.packages:
            missing.packages.append(name)
        return str(folder.resolve() if folder else STAND_IN + name)

    def open_text(name: str, mode: str = "r") -> io.TextIOBase:
        if os.fspath(name).startswith(STAND_IN):
            missing.included = True
            return io.StringIO("<robot/>")
        if not os.path.exists(name):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), name)  # which xacro explains
        return io.TextIOWrapper(open_regular(Path(name), MAX_BYTES, "a xacro file"), encoding="utf-8")

    def expand_known(node: Any, macros: Any, symbols: Any) -> bool:
        try:
            return bool(expand_macro(node, macros, symbols))
        except Exception as error:
            if not missing.included or str(error) != f"unknown macro name: {node.tagName}":
                raise
            missing.macros.append(node.tagName.removeprefix("xacro:"))
            vars(xacro)["replace_node"](node, by=None)
            return True

    changes = [(xacro, "open", open_text), (reader, "open", open_text), (finder, "get_path", find)]
    changes.append((xacro, "handle_macro_call", expand_known))
    before = [(module, name, vars(module).get(name, open)) for module, name, _ in changes]
    vars(xacro)["init_stacks"](str(path.resolve()))
    try:
        for module, name, new in changes:
            vars(module)[name] = new
        yield
    finally:
        for module, name, old in before:
            vars(module)[name] = old


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


def _help(error: Exception) -> str:
    """Return a hint on how to fix the error; empty if unknown."""
    kinds = {type(cause).__name__ for cause in _causes(error)}
    if "FileNotFoundError" in kinds:
        return "; if its package is in another folder, give that with --package NAME=FOLDER"
    return "; give it with --arg NAME=VALUE" if "ArgException" in kinds else ""


def _in_one_line(error: Exception) -> str:
    """Return xacro's message without class name, repetition and line breaks."""
    text = " ".join(str(error).replace("\\n", " ").split()) or type(error).__name__
    text = re.sub(r"^<class '[^']*'>: | \[Errno \d+\].*", "", text)
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
SIDE = re.compile(r"^(?:front|rear|back|middle)?_?(left|right)(?=\w*joint$)", re.IGNORECASE)  # tags of a drive plugin
SUBSTITUTION = re.compile(r"\$\((?:find|arg|env|optenv|eval|dirname|cwd)\b")  # of xacro
MAX_LINKS = 10_000
MAX_COORDINATE = 1e6  # [m]


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
    stated: float  # the same, for continuous joints, too; inf if not given
    has_axis: bool  # whether the file states the axis
    # speed limit in <ros2_control> [rad/s]: inf if unlimited, None without a velocity interface
    commanded: float | None = None

    @property
    def turns(self) -> bool:
        """Whether it is a hinge."""
        return self.kind in ("continuous", "revolute")

    @property
    def called(self) -> str:
        """Its name and its child link's."""
        return f"{self.name} {self.child}"


@dataclass(frozen=True, eq=False)
class CollisionPiece:
    """A piece of collision geometry, in the root's frame."""

    link: str  # its link
    kind: str  # box, cylinder, sphere or mesh
    points: Floats  # points whose convex hull contains it (N, 3)
    radius: float | None = None  # of a cylinder or sphere [m]

    @property
    def bottom(self) -> float:
        """Height of its lowest point [m]."""
        return float(self.points[:, 2].min())


@dataclass(frozen=True, eq=False)
class UrdfModel:
    """A robot in a URDF file."""

    source: Path  # the file
    name: str  # the robot's name
    joints: dict[str, UrdfJoint]  # by name
    places: dict[str, Floats]  # each link's frame in the root's frame (4, 4)
    pieces: tuple[CollisionPiece, ...]  # collision geometry
    looks: tuple[CollisionPiece, ...]  # visual geometry of turning links that collide as spheres or not at all
    masses: dict[str, float]  # of the links with a mass [kg]
    drive: dict[str, str]  # values of Gazebo's drive plugins by tag, without repeated tags
    sides: tuple[tuple[str, ...], tuple[str, ...]]  # joints of these plugins' left and right wheels
    missing_meshes: tuple[str, ...]
    root: ET.Element  # the file, without xacro
    links: dict[str, ET.Element]  # of it, by name
    missing: Missing  # packages

    def above(self, link: str) -> Iterator[UrdfJoint]:
        """Yield the joints from a link to the root."""
        while link in self._holders:
            yield self._holders[link]
            link = self._holders[link].parent

    @cached_property
    def _holders(self) -> dict[str, UrdfJoint]:
        return {joint.child: joint for joint in self.joints.values()}

    @cached_property
    def motors(self) -> set[str]:
        """Joints with any command in <ros2_control>."""
        return {joint.get("name", "") for joint in self.root.findall("ros2_control/joint[command_interface]")}

    @cached_property
    def by_link(self) -> Mapping[str, list[CollisionPiece]]:
        """Collision geometry by link, with that of the links fixed to it."""
        return self._grouped(self.pieces)

    @cached_property
    def drawn(self) -> Mapping[str, list[CollisionPiece]]:
        """Visual geometry by link."""
        return self._grouped(self.looks)

    def _grouped(self, pieces: Iterable[CollisionPiece]) -> dict[str, list[CollisionPiece]]:
        """Group pieces by link, and also by the moving link that theirs is fixed to."""
        found: dict[str, list[CollisionPiece]] = {name: [] for name in self.places}
        bodies: dict[str, str] = {}
        for name in self.places:  # parents first
            holder = self._holders.get(name)
            bodies[name] = bodies[holder.parent] if holder is not None and holder.kind == "fixed" else name
        for piece in pieces:
            for name in {piece.link, bodies[piece.link]}:
                found[name].append(piece)
        return found

    def points(self, link: str) -> Floats:
        """Return the points of a link's collision geometry (N, 3), of its drawn one if it has no other."""
        return np.vstack([np.empty((0, 3)), *(piece.points for piece in self.by_link[link] or self.drawn[link])])

    def bottom(self, link: str) -> float:
        """Return a link's lowest point [m]; inf without geometry."""
        return float(self.points(link)[:, 2].min(initial=math.inf))

    @cached_property
    def lowest(self) -> CollisionPiece | None:
        """The piece of collision geometry that reaches lowest; None without any."""
        return min(self.pieces, key=lambda piece: piece.bottom, default=None)

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
    root, missing = _root_element(path, arguments, packages)
    with missing.named():
        reader, visual = (_Shapes(path, meshes, without, packages) for without in (without_meshes, True))
        return _model(path, root, reader, visual, missing)


def _model(path: Path, root: ET.Element, reader: _Shapes, visual: _Shapes, missing: Missing) -> UrdfModel:
    if root.tag != "robot":
        raise input_error(str(path), f"the root element must be <robot>, got <{root.tag}>")
    links = {_named(path, link): link for link in root.findall("link")}
    local = [_joint(path, element) for element in root.findall("joint")]
    if missing.macros:  # a link of theirs has no shape if it is a child; what hangs on it is omitted if it is a root
        links |= {joint.child: ET.Element("link") for joint in local if joint.child not in links}
        while lost := {joint.child for joint in local if joint.parent not in links}:
            missing.macros += sorted(lost)
            local = [joint for joint in local if joint.child not in lost]
            links = {name: link for name, link in links.items() if name not in lost}
    if not links:
        raise input_error(str(path), "has no links; give the file of the robot, which includes the others")
    if len(links) > MAX_LINKS:
        raise input_error(str(path), f"has {len(links)} links; a robot has 1 to {MAX_LINKS}")
    commanded = _commanded(path, root, {joint.name for joint in local})
    places, joints = _placed(path, set(links), [replace(joint, commanded=commanded.get(joint.name)) for joint in local])
    pieces = [
        piece
        for name, link in links.items()
        for element in link.findall(solid_tag(root))
        for piece in reader.piece(name, places[name] @ _origin(path, element), element)
    ]
    solid = {piece.link for piece in pieces if piece.kind != "sphere"}
    looks: list[CollisionPiece] = []
    for name in (joint.child for joint in joints.values() if joint.kind != "fixed" and joint.child not in solid):
        for element in links[name].findall("visual"):
            with contextlib.suppress(InputError):
                looks += visual.piece(name, places[name] @ _origin(path, element), element)
    masses = {
        name: _positive(path, f"link {name}", "mass", _number(path, mass, "value", 0.0), or_0=True)
        for name, link in links.items()
        for mass in link.findall("inertial/mass")
    }
    name, meshes, shapes = root.get("name", path.stem), tuple(reader.missing_meshes), (tuple(pieces), tuple(looks))
    return UrdfModel(path, name, joints, places, *shapes, masses, *_drive(root), meshes, root, links, missing)


def solid_tag(root: ET.Element) -> str:
    """Return the tag of the geometry that counts: the drawn one if no link has collision geometry."""
    return "visual" if root.find("link/collision/geometry") is None else "collision"


def _commanded(path: Path, root: ET.Element, joints: set[str]) -> dict[str, float]:
    """Return the speed limits of the velocity-controlled joints in <ros2_control> [rad/s]."""
    speeds = {}
    for joint in root.findall("ros2_control/joint"):
        name = _named(path, joint)
        for interface in joint.findall("command_interface[@name='velocity']"):
            if name not in joints:
                raise input_error(str(path), f"<ros2_control> names joint {name!r}, which does not exist")
            most = interface.findtext("param[@name='max']")
            try:
                speeds[name] = math.inf if most is None else float(most)
            except ValueError:
                speeds[name] = math.nan
            if not speeds[name] > 0:
                raise input_error(
                    str(path), f"joint {name}", f"max in <ros2_control> must be a number above 0, got {most!r}"
                )
    return speeds


def _drive(root: ET.Element) -> tuple[dict[str, str], tuple[tuple[str, ...], tuple[str, ...]]]:
    """Return the values of drive plugins by tag, and the joints of their left and right wheels.

    Tags that a plugin repeats, such as the left wheels of a skid-steer vehicle, have no value.
    """
    drive: dict[str, str] = {}
    sides: tuple[list[str], list[str]] = ([], [])
    for plugin in root.findall("gazebo/plugin"):
        wheels = [(SIDE.search(element.tag), (element.text or "").strip()) for element in plugin]
        if not any(side and side[1].lower() == "left" for side, _ in wheels):
            continue
        tags = Counter(element.tag for element in plugin)
        drive |= {element.tag: (element.text or "").strip() for element in plugin if tags[element.tag] == 1}
        for side, name in wheels:
            if side and name:
                sides[side[1].lower() == "right"].append(name)
    left, right = (tuple(dict.fromkeys(names)) for names in sides)
    return drive, (left, right)


def _root_element(path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> tuple[ET.Element, Missing]:
    """Return the root of a URDF or xacro file; xacro's elements and substitutions show a xacro file, whatever its name."""
    plain = None if path.suffix.lower() == ".xacro" else parse_xml(path)
    if plain is not None and not any(
        element.tag.startswith("xacro:") or any(map(SUBSTITUTION.search, element.attrib.values()))
        for element in plain.iter()
    ):
        if arguments:
            raise InputError(f"--arg {next(iter(arguments))}: {path.name} is not a .xacro file and has no arguments")
        return plain, Missing()
    text, missing = expanded(path, arguments, packages)
    return parse_xml(path, text), missing


def _named(path: Path, element: ET.Element) -> str:
    name = element.get("name")
    if not name:
        raise input_error(str(path), f"a <{element.tag}> has no name")
    return name


def _numbers(
    path: Path, element: ET.Element | None, key: str, default: tuple[float, ...], most: float = MAX_COORDINATE
) -> Floats:
    if element is None or (text := element.get(key)) is None:
        return np.array(default)
    values = numbers_in(text, len(default), most)
    if values is None:
        count = "a number" if len(default) == 1 else f"{len(default)} numbers"
        size = "" if math.isinf(most) else f" of at most {most:g}"
        raise input_error(str(path), f"<{element.tag} {key}={text!r}>", f"must be {count}{size}")
    return values


def _number(path: Path, element: ET.Element | None, key: str, default: float, most: float = MAX_COORDINATE) -> float:
    return float(_numbers(path, element, key, (default,), most)[0])


def _positive(path: Path, where: str, what: str, value: float, *, or_0: bool = False) -> float:
    if value > 0 or (or_0 and value == 0):
        return value
    raise input_error(str(path), where, f"{what} must be {'at least' if or_0 else 'greater than'} 0, got {value:g}")


def _origin(path: Path, element: ET.Element) -> Floats:
    """Return the frame (4, 4) of an element's <origin>."""
    origin = element.find("origin")
    position, angles = (_numbers(path, origin, key, (0.0, 0.0, 0.0)) for key in ("xyz", "rpy"))
    return pose_matrix(position, angles)


def _joint(path: Path, element: ET.Element) -> UrdfJoint:
    """Read a joint, with frame and axis in its parent's frame."""
    name, kind = _named(path, element), element.get("type", "")
    ends = [element.find(tag) for tag in ("parent", "child")]
    parent, child = ("" if end is None else end.get("link", "") for end in ends)
    limit = element.find("limit")
    lower, upper = (_number(path, limit, key, 0.0, math.inf) for key in ("lower", "upper"))
    velocity, effort = (
        _positive(path, f"joint {name}", f"the limit's {key}", _number(path, limit, key, 0.0, math.inf), or_0=True)
        for key in ("velocity", "effort")
    )
    stated = element.find("axis")
    axis = _numbers(path, stated, "xyz", (1.0, 0.0, 0.0)) if kind != "fixed" else np.array((1.0, 0.0, 0.0))
    if not np.linalg.norm(axis) > 1e-9:
        axis, stated = np.array((1.0, 0.0, 0.0)), None
    sweep = 0.0 if lower == upper else upper - lower
    turns, given = (math.inf, sweep or math.inf) if kind == "continuous" else (sweep, sweep)
    place, axis = _origin(path, element), axis / np.linalg.norm(axis)
    return UrdfJoint(
        name, kind, parent, child, place, axis, velocity or None, effort or None, turns, given, stated is not None
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
        radius = None
        if shape.tag == "box":
            size = _numbers(self._path, shape, "size", (0.0, 0.0, 0.0))
            _positive(self._path, f"link {link}", "the size of a <box>", float(size.min()))
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
        yield CollisionPiece(link, shape.tag, points @ place[:3, :3].T + place[:3, 3], radius)

    def _extent(self, link: str, shape: ET.Element, key: str) -> float:
        value = _number(self._path, shape, key, 0.0)
        return _positive(self._path, f"link {link}", f"the {key} of a <{shape.tag}>", value)

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
        package, _, inside = bare.partition("/") if name.startswith(("package://", "model://")) else ("", "", bare)
        if package and (home := package_folder(self._path, package, self._packages)) is not None:
            yield home / inside
        folders = [self._meshes] if self._meshes is not None else [self._path.parent, *self._path.resolve().parents]
        for folder in folders:
            yield folder / bare
            yield folder / inside
            yield folder / Path(bare).name
