"""Models of a Gazebo world: poses, frames, includes, shapes and actors."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree as ET

import numpy as np

from antdrive.base.errors import FieldError, InputError
from antdrive.base.plane import format_point
from antdrive.base.ros import folders_in, ros_package
from antdrive.base.types import Floats, Pose
from antdrive.worlds.formats.meshes import read_mesh
from antdrive.worlds.formats.solids import BAND, FACETS, ROUND, Unsupported, numbers, solid
from antdrive.worlds.formats.xml import parse_xml, pose_matrix
from antdrive.worlds.movers import Keyframed, Loop
from antdrive.worlds.world import Disc

#: Environment variables of folders with models.
VARIABLES = ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "SDF_PATH", "GAZEBO_MODEL_PATH")
FUEL_FOLDERS = ("~/.gz/fuel", "~/.ignition/fuel")  # Fuel's downloads
CLASSIC_FOLDER = "~/.gazebo/models"  # downloads of Gazebo classic
USUAL = re.compile(r"(^|/)(sun|ground[ _]?plane)(/\d+)?/?$", re.IGNORECASE)  # floor and light, under any address
DRIVES = re.compile(
    r"diff_?-?drive|skid_?-?steer|ackermann|mecanum|omni|planar_?move|tracked-?vehicle|velocity-?control|multicopter",
    re.IGNORECASE,
)
ACTOR_RADIUS, ACTOR_HEIGHT = 0.3, 1.8  # of an actor, which has no collision shape [m]
STEEP, FLAT = math.cos(math.radians(45)), math.cos(math.radians(1))  # of the slopes of ground
MAX_MODELS = 20_000  # with those of included files
ORIGIN = np.eye(4)  # the pose of a frame in itself
MAX_NESTING = 50  # of models, and of frames that refer to each other


class _Missing(Unsupported):
    """A model or mesh that is elsewhere; the message is its address."""


@dataclass
class Models:
    """The contents of a world between two heights."""

    band: tuple[float, float]  # the heights above the floor [m]
    floor: float = 0.0  # height of the floor in the file [m]
    discs: list[Disc] = field(default_factory=list)  # upright cylinders and spheres
    solids: list[Floats] = field(default_factory=list)  # convex pieces of all other shapes, (K, V, 3)
    facets: float = 0.0  # largest distance of pieces and discs beyond round shapes [m]
    sloping: float = 0.0  # area of imported meshes' surfaces that are neither flat nor steep [m2]
    planes: list[float] = field(default_factory=list)  # heights of ground planes above the floor [m]
    movers: list[Keyframed] = field(default_factory=list)
    kinds: Counter[str] = field(default_factory=Counter)  # number of imported shapes by kind
    counts: Counter[str] = field(default_factory=Counter)  # of what is assumed or ignored
    unsupported: list[str] = field(default_factory=list)  # parts, each as "name (reason)"
    missing: Counter[str] = field(default_factory=Counter)  # addresses of models and meshes that are elsewhere


@dataclass(frozen=True)
class _SdfModel:
    """A model in a world or in another model."""

    name: str
    model: ET.Element
    placed: ET.Element  # its <include>, or the model itself
    file: Path
    scope: _Scope


class _Scope:
    """The frames of a world or model, to which poses in it refer."""

    def __init__(self, element: ET.Element, bodies: list[_SdfModel]) -> None:
        self.bodies = bodies
        self._bodies = {body.name: body for body in reversed(bodies)}
        self._parts = {
            part.get("name", ""): part for tag in ("link", "frame", "joint") for part in element.findall(tag)
        }
        self._open: set[str] = set()

    def place(self, element: ET.Element, base: str | Floats = "") -> Floats:
        """Return the pose (4, 4) of an element, by default relative to a frame or a pose `base`."""
        pose = element.find("pose")
        base = (None if pose is None else pose.get("relative_to") or pose.get("frame")) or base
        return (self.frame(base) if isinstance(base, str) else base) @ read_pose(pose)

    def of_body(self, body: _SdfModel) -> Floats:
        """Return the pose (4, 4) of a model."""
        place = self.place(body.model if body.placed.find("pose") is None else body.placed)
        frame = body.placed.findtext("placement_frame") or body.model.get("placement_frame") or ""
        return place @ np.linalg.inv(body.scope.frame(frame.strip())) if frame else place

    def frame(self, name: str) -> Floats:
        """Return the pose (4, 4) of a frame."""
        if name in ("", "__model__", "world", "__root__"):
            return ORIGIN
        if name in self._open or len(self._open) > MAX_NESTING:
            raise Unsupported(f"frame {name!r} refers to itself")
        first, _, rest = name.partition("::")
        part, body = self._parts.get(name), self._bodies.get(first)
        if part is None and body is None:
            raise Unsupported(f"frame {name!r} does not exist")
        self._open.add(name)
        try:
            if body is not None:
                return self.of_body(body) @ body.scope.frame(rest)
            assert part is not None
            base = part.get("attached_to") if part.tag == "frame" else part.findtext("child")
            return self.place(part, (base or "").strip())
        finally:
            self._open.remove(name)


@dataclass(frozen=True, eq=False)
class _Wanted:
    """A transform from a <world>'s frame to another frame, of the given pose (4, 4) in it."""

    frame: Floats

    def __matmul__(self, pose: Floats) -> Floats:
        """Transform a pose (4, 4). The frame's own pose becomes the exact identity."""
        same = np.array_equal(pose, self.frame)
        return ORIGIN if same else np.asarray(np.linalg.inv(self.frame) @ pose)


class SdfReader:
    """A reader of a world and its included models."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._root, self._mesh = functools.cache(parse_xml), functools.cache(read_mesh)
        self._model = functools.cache(_model_file)

    def read(self, world: ET.Element, frame: Pose, band: tuple[float, float], floor: float = 0.0) -> Models:
        """Read the models of a <world>, or of an <sdf>, in a frame with a pose in the file: x, y [m] and yaw [rad].

        As in Gazebo, the poses in a <state> replace the models' own: model and link poses in the state are in the world's
        frame, and its <scale> applies to the shapes.
        """
        self.models, self._count = Models(band, floor), 0
        x, y, yaw = frame
        wanted, models = _Wanted(pose_matrix((x, y, floor), (0.0, 0.0, yaw))), self.models
        states = {state.get("name", ""): state for state in world.findall("state/model")}
        removed = {(name.text or "").strip() for name in world.findall("state/deletions/name")}
        for element in (world, *world.findall("state/insertions")):
            scope = self._scope(element, self._file, (_real(self._file),))
            if self._count > MAX_MODELS:
                raise InputError(f"has more than {MAX_MODELS} models, with the included ones")
            for body in scope.bodies:
                if body.name not in removed:
                    with self._naming(body.name):
                        self._add(scope, body, body.name, wanted, False, states.get(body.name))
        for actor in world.findall("actor"):
            with self._naming(actor.get("name", "actor")):
                self._actor(actor, wanted)
        models.unsupported += [f"{e.get('name', 'population')} (population)" for e in world.findall("population")]
        return models

    def _scope(self, element: ET.Element, file: Path, trail: tuple[Path, ...]) -> _Scope:
        return _Scope(element, list(self._bodies(element, file, trail)))

    def _bodies(self, element: ET.Element, file: Path, trail: tuple[Path, ...]) -> Iterator[_SdfModel]:
        """Yield the models of a world or a model, with the included ones."""
        for child in element:
            self._count += child.tag in ("model", "include")
            if self._count > MAX_MODELS:
                return
            if child.tag == "model":
                yield _SdfModel(
                    child.get("name", "without a name"), child, child, file, self._scope(child, file, trail)
                )
            if child.tag != "include":
                continue
            uri, name = ((child.findtext(tag) or "").strip() for tag in ("uri", "name"))
            with self._naming(name or uri or "include"):
                if USUAL.search(uri):
                    continue
                found = self._model(uri, file)
                if found is None:
                    raise _Missing(uri or "an <include> without <uri>")
                if found in trail or len(trail) > MAX_NESTING:
                    raise Unsupported(f"{found} includes itself")
                root = self._root(found)
                model = root if root.tag == "model" else root.find("model")
                if root.tag == "robot" or (model is None and root.find("light") is not None):
                    self.models.counts[f"left out: {root.tag.replace('sdf', 'light')} {name or uri}"] += 1
                elif model is None:
                    raise Unsupported(f"{found.name} has no <model>")
                else:
                    inner = self._scope(model, found, (*trail, found))
                    yield _SdfModel(name or model.get("name", uri), model, child, found, inner)

    @contextlib.contextmanager
    def _naming(self, part: str) -> Iterator[None]:
        """Name a part that is missing or unsupported, and go on."""
        try:
            yield
        except _Missing as missing:
            self.models.missing[str(missing)] += 1
        except (Unsupported, InputError, FieldError) as reason:
            self.models.unsupported.append(f"{part} ({reason})")

    def _add(
        self, scope: _Scope, body: _SdfModel, name: str, frame: Floats | _Wanted, static: bool, state: ET.Element | None
    ) -> None:
        """Add a model's shapes and those of its nested models; `frame` is the parent's pose (4, 4) or the world's.

        Each collision stands for itself: an unsupported one is named, and the others stay.
        """
        models, model = self.models, body.model
        static = static or any(_true(element.findtext("static")) for element in (model, body.placed))
        pose = frame @ scope.of_body(body)
        scale, links = np.ones(3), {}
        if state is not None:
            pose = frame @ read_pose(state.find("pose")) if state.find("pose") is not None else pose
            scale = numbers(state.findtext("scale") or "1 1 1", 3, "scale")
            placed = [link for link in state.findall("link") if link.find("pose") is not None]
            links = {link.get("name"): frame @ read_pose(link.find("pose")) for link in placed}
        if not (scale > 0).all():
            raise Unsupported(f"scaled by {scale.min():g}")
        plugins = [plugin for element in (model, body.placed) for plugin in element.findall("plugin")]
        if any(DRIVES.search(f"{plugin.get('name')} {plugin.get('filename')}") for plugin in plugins):
            at = format_point((float(pose[0, 3]), float(pose[1, 3])), 2)
            models.counts[f"left out: robot {name} at {at}"] += 1
            return
        before, collisions = sum(models.kinds.values()), 0
        for link in model.findall("link"):
            for collision in link.findall("collision"):
                collisions += 1
                part = "::".join((name, *(element.get("name") or element.tag for element in (link, collision))))
                with self._naming(part):
                    if link.get("name") in links:
                        place = links[link.get("name")] @ read_pose(collision.find("pose"))
                    else:
                        place = pose @ body.scope.place(collision, body.scope.place(link))
                    self._shape(collision, place @ np.diag([*scale, 1.0]), body.file)
        if not (collisions or body.scope.bodies):
            models.counts["models without collision shapes"] += 1
        if sum(models.kinds.values()) > before and not static:
            models.counts["bodies that could move, taken to stand still"] += 1
        for inner in body.scope.bodies:
            with self._naming(f"{name}::{inner.name}"):
                self._add(body.scope, inner, f"{name}::{inner.name}", pose, static, None)

    def _shape(self, collision: ET.Element, place: Floats, file: Path) -> None:
        geometry = collision.find("geometry")
        if geometry is None or not len(geometry):
            return
        models, kind = self.models, geometry[0].tag
        found = solid(geometry, place, models.band, lambda shape: self._triangles(shape, file))
        if isinstance(found, float):
            models.planes.append(found)
            if found > max(models.band[0], BAND[0]):
                raise Unsupported(f"a plane {found:g} m above the floor")
            return
        if isinstance(found, str):
            models.counts[found] += 1
            return
        models.kinds[kind] += 1
        if isinstance(found, Disc):
            models.discs.append(found)
            models.facets = max(models.facets, FACETS * found.radius * (kind != "cylinder"))
            return
        models.solids.append(found)
        if kind == "mesh":
            normals = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
            upward, size = normals[:, 2], np.linalg.norm(normals, axis=1)
            models.sloping += float(upward[(upward > STEEP * size) & (upward < FLAT * size)].sum()) / 2
        if kind in ROUND:
            models.facets = max(models.facets, FACETS * float(np.ptp(found.reshape(-1, 3), axis=0).max()) / 2)

    def _triangles(self, shape: ET.Element, file: Path) -> Floats:
        """Return the triangles of a <mesh>, (K, 3, 3) [m]."""
        uri = (shape.findtext("uri") or shape.findtext("filename") or "").strip()
        paths = list(_candidates(uri, file))
        found = next((path for path in paths if os.path.isfile(path)), None)
        if found is None:
            beside = (other for path in paths if os.path.isdir(path.parent) for other in path.parent.glob("*"))
            found = next((other for other in beside if other.name.lower() == paths[0].name.lower()), None)
            if found is None:
                raise _Missing(uri or "a <mesh> without <uri>")
            self.models.counts["meshes whose names differ in capitals"] += 1
        if shape.get("optimization"):
            raise Unsupported(f"a mesh with optimization={shape.get('optimization')!r}")
        if shape.find("submesh") is not None:
            raise Unsupported("a part of a mesh")
        points, faces = self._mesh(found)
        if not len(faces):
            raise Unsupported(f"{found.name} has no triangles")
        return (points * numbers(shape.findtext("scale") or "1 1 1", 3, "scale"))[faces]

    def _actor(self, actor: ET.Element, wanted: _Wanted) -> None:
        """Add an actor with a trajectory as a mover."""
        frames: list[tuple[float, float, float]] = []
        begin = float(numbers(actor.findtext("script/delay_start") or "0", 1, "delay_start")[0])
        for trajectory in actor.findall("script/trajectory"):
            for waypoint in trajectory.findall("waypoint"):
                time = begin + float(numbers(waypoint.findtext("time"), 1, "time")[0])
                x, y = (wanted @ read_pose(waypoint.find("pose")))[:2, 3].tolist()
                if not frames or frames[-1] != (time, x, y):
                    frames.append((time, x, y))
            begin = frames[-1][0] if frames else begin
        if not frames:
            self.models.counts["actors without a trajectory, left out"] += 1
            return
        if len(frames) == 1:
            frames.append((frames[0][0] + 1.0, *frames[0][1:]))
        loop: Loop = "teleport" if _true(actor.findtext("script/loop") or "true") else "once"
        mover = Keyframed(radius=ACTOR_RADIUS, height=ACTOR_HEIGHT, keyframes=tuple(frames), loop=loop)
        self.models.movers.append(mover)


def _true(text: str | None) -> bool:
    return (text or "").strip().lower() in ("1", "true")


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _candidates(uri: str, source: Path) -> Iterator[Path]:
    """Yield where a model or mesh may be: Fuel's downloads, ROS packages, the variables' folders, folders above the file."""
    scheme, _, rest = uri.rpartition("://")
    rest = unquote(rest)
    if scheme in ("http", "https"):
        server, _, owner, _, name, *files = (*rest.split("/"), *[""] * 5)
        inside = "/".join(files).rstrip("/").partition("files/")[2]
        for home in FUEL_FOLDERS:
            folder = Path(os.path.expanduser(home), server, owner.lower(), "models", name.lower())
            versions = [path for path in folder.glob("*") if path.name.isdecimal()] if os.path.isdir(folder) else []
            yield from (path / inside for path in sorted(versions, key=lambda path: -int(path.name)))
        rest = f"{name}/{inside}"
    if not rest.strip("/"):
        return
    package, _, inside = rest.partition("/")
    folder_of_package = ros_package(package, source) if scheme in ("package", "model") else None
    if folder_of_package is not None:
        yield folder_of_package / inside
    for folder in (*folders_in(*VARIABLES), *_real(source).parents, Path(os.path.expanduser(CLASSIC_FOLDER))):
        yield from (folder / rest, folder / "models" / rest)


def _model_file(uri: str, source: Path) -> Path | None:
    """Return the file of an included model; None if there is none."""
    for path in _candidates(uri, source):
        if os.path.isfile(path) and path.suffix.lower() in (".sdf", ".world", ".urdf", ".xml"):
            return _real(path)
        config = path / "model.config"
        entries = parse_xml(config).iter("sdf") if os.path.isfile(config) else ()
        named = sorted(((e.get("version", ""), (e.text or "").strip()) for e in entries), reverse=True)
        for _, name in (*named, ("", "model.sdf")):
            if os.path.isfile(path / name):
                return _real(path / name)
    return None


def read_pose(pose: ET.Element | None) -> Floats:
    """Return the transform (4, 4) of a <pose>: x y z [m] roll pitch yaw [rad] about fixed axes."""
    if pose is None or not (pose.text or "").strip():
        return ORIGIN
    if pose.get("rotation_format", "euler_rpy") != "euler_rpy":
        raise Unsupported(f"a pose with rotation_format={pose.get('rotation_format')!r}")
    x, y, z, *angles = numbers(pose.text, 6, "pose")
    if _true(pose.get("degrees")):
        angles = [math.radians(a) for a in angles]
    return pose_matrix((x, y, z), angles)
