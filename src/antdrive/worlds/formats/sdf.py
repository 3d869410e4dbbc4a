"""Import and export of Gazebo worlds (SDF) with static upright cylinders."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import numpy as np

from antdrive.base.atomic import write_text
from antdrive.base.errors import FieldError, input_error
from antdrive.base.plane import map_to_world
from antdrive.base.types import Bounds, Floats, Point, Pose
from antdrive.worlds.files.world_file import require_no_movers
from antdrive.worlds.formats.xml import parse_xml, rotation_matrix
from antdrive.worlds.world import Disc, Task, World

MAX_TILT = 1e-3  # largest tilt of an upright cylinder [rad]


class Unsupported(Exception):
    """A model that is not made of upright cylinders; the message is the reason."""


@dataclass
class Models:
    """The models of a world."""

    discs: list[Disc] = field(default_factory=list)  # the upright cylinders
    unsupported: list[str] = field(default_factory=list)  # all other parts, each as "name (reason)"


def read_models(world: ET.Element, frame: Pose = (0.0, 0.0, 0.0)) -> Models:
    """Read the models of a <world>.

    Ground planes and models without collision geometry are ignored. As in Gazebo, the poses in a <state> replace the
    models' own: model and link poses in the state are in the world's frame, and its <scale> applies to the cylinders.
    """
    models = Models()
    wanted = _Wanted(frame)
    states = {s.get("name", ""): s for s in world.findall("state/model")}
    for model in world.findall("model"):
        name = model.get("name", "without a name")
        _add_cylinders(models, model, name, wanted, False, states.get(name))
    for include in world.iter("include"):
        uri = (include.findtext("uri") or "").strip()
        if uri.rpartition("/")[2] not in ("sun", "ground_plane"):
            models.unsupported.append(f"{uri or 'include'} (included from another file)")
    for tag in ("actor", "population", "state/insertions/model"):
        models.unsupported.extend(f"{e.get('name', tag)} ({tag})" for e in world.findall(tag))
    return models


class _Wanted:
    """A transform from a <world>'s frame to another frame."""

    def __init__(self, frame: Pose) -> None:
        x, y, yaw = frame
        self._same = not any(frame)
        self._frame = _matrix(x, y, 0.0, 0.0, 0.0, yaw)
        self._back = np.linalg.inv(self._frame)

    def __matmul__(self, pose: Floats) -> Floats:
        """Transform a pose (4, 4). The frame's own pose becomes the exact identity."""
        if self._same:
            return pose
        return np.eye(4) if np.array_equal(pose, self._frame) else np.asarray(self._back @ pose)


def _add_cylinders(
    models: Models, model: ET.Element, name: str, frame: Floats | _Wanted, static: bool, state: ET.Element | None
) -> None:
    """Add a model's cylinders and those of its nested models; `frame` is the parent's pose (4, 4) or the world's.

    Each collision stands for itself: an unsupported one is named, and the others stay.
    """
    static = static or (model.findtext("static") or "").strip().lower() in ("1", "true")
    try:
        if model.get("placement_frame"):
            raise Unsupported("has a placement_frame")
        pose = frame @ _pose(model)
        scale, links = np.ones(3), {}
        if state is not None:
            pose = frame @ _pose(state) if state.find("pose") is not None else pose
            scale = _numbers(state.findtext("scale") or "1 1 1", 3, "scale")
            links = {
                link.get("name"): frame @ _pose(link) for link in state.findall("link") if link.find("pose") is not None
            }
    except Unsupported as reason:
        models.unsupported.append(f"{name} ({reason})")
        return
    for link in model.findall("link"):
        for collision in link.findall("collision"):
            part = "::".join((name, *(element.get("name") or element.tag for element in (link, collision))))
            try:
                place = links[link.get("name")] if link.get("name") in links else pose @ _pose(link)
                found = list(_shape(collision, place @ _pose(collision), scale))
                if found and not static:
                    raise Unsupported("not static")
                models.discs.extend(found)
            except Unsupported as reason:
                models.unsupported.append(f"{part} ({reason})")
    for inner in model.findall("model"):
        _add_cylinders(models, inner, f"{name}::{inner.get('name', 'without a name')}", pose, static, None)


def _shape(collision: ET.Element, pose: Floats, scale: Floats) -> Iterator[Disc]:
    """Yield the cylinder of a collision; nothing for a floor or a cylinder wholly below z = 0."""
    shape = collision.find("geometry/*")
    if shape is None or shape.tag == "empty":
        return
    if shape.tag == "plane":
        normal = pose[:3, :3] @ _numbers(shape.findtext("normal") or "0 0 1", 3, "normal")
        if math.hypot(normal[0], normal[1]) > MAX_TILT * abs(normal[2]):
            raise Unsupported("a plane that is not horizontal")
        return
    if shape.tag != "cylinder":
        raise Unsupported(shape.tag)
    if math.hypot(pose[0, 2], pose[1, 2]) > MAX_TILT:
        raise Unsupported("a tilted cylinder")
    radius, length = (float(_numbers(shape.findtext(tag) or "", 1, tag)[0]) for tag in ("radius", "length"))
    if abs(scale[0] - scale[1]) > 1e-9 or not (scale > 0).all():
        raise Unsupported("scaled to an ellipse")
    radius, length = radius * float(scale[0]), length * float(scale[2])
    if not (radius > 0 and length > 0):
        raise Unsupported(f"a cylinder of radius {radius:g} and length {length:g}")
    x, y, z = (float(v) for v in pose[:3, 3])
    top = z + length / 2
    if top > 0:
        yield Disc(x, y, radius, top)


def _pose(element: ET.Element) -> Floats:
    """Return the transform (4, 4) of an element's <pose>: x y z [m] roll pitch yaw [rad], about fixed axes."""
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    for key in ("frame", "relative_to", "rotation_format"):
        if pose.get(key) and (key, pose.get(key)) != ("rotation_format", "euler_rpy"):
            raise Unsupported(f"a pose with {key}={pose.get(key)!r}")
    x, y, z, *angles = _numbers(pose.text or "", 6, "pose")
    if (pose.get("degrees") or "").lower() in ("1", "true"):
        angles = [math.radians(a) for a in angles]
    return _matrix(x, y, z, *angles)


def _matrix(x: float, y: float, z: float, *angles: float) -> Floats:
    """Return the transform (4, 4) of a position [m] and of roll, pitch and yaw about fixed axes [rad]."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_matrix(*angles), (x, y, z)
    return matrix


def _numbers(text: str, count: int, key: str) -> Floats:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        raise Unsupported(f"{key} must be {count} numbers, got {text.strip()[:40]!r}")
    return values


MARGIN = 1.0  # from the cylinders to the default bounds [m]
CELL = 0.25  # default grid resolution of a task [m]
TOLERANCE = 0.25  # default goal tolerance [m]
WALL_THICKNESS, WALL_HEIGHT = 0.2, 1.0  # of an exported world's bounds [m]

#: A custom element, as SDF allows, for the parts of a task that SDF cannot hold.
TASK_TAG, NAMESPACE = "antdrive:task", "urn:antdrive:task:1"
#: The model of an exported world's walls, ignored on import: the task element has the bounds.
WALLS = "antdrive_walls"


def import_sdf(
    path: str | os.PathLike[str],
    *,
    start: Pose | None = None,
    goal: Point | None = None,
    bounds: Bounds | None = None,
    cell: float | None = None,
    goal_tolerance: float | None = None,
    skip_unsupported: bool = False,
    on_skipped: Callable[[list[str]], None] | None = None,
) -> Task:
    """Import the upright cylinders of a Gazebo world as a task.

    Poses of models, links and collisions are composed; those in <state> replace the models' own, as in Gazebo.
    A cylinder's height is its top's above z = 0. Ground planes, models without collision geometry and everything below
    the floor are ignored. Worlds written by `export_sdf` have their own defaults, including the `frame`.

    Args:
        path: the SDF file
        start: the robot's start pose in the file's coordinates [m, m, rad]; by default at the lower left, towards the goal
        goal: the goal position in the file's coordinates [m]; by default at the upper right
        bounds: the walls' inner faces, in the world's own frame [m]; by default 1 m around the cylinders, start and goal
        cell: the task's grid resolution [m]; by default 0.25
        goal_tolerance: largest distance from the goal at the stop [m]; by default 0.25
        skip_unsupported: skip moving and included models and other collision shapes instead of refusing the file
        on_skipped: called with what is skipped, each part as "model::link::collision (reason)"

    Raises:
        InputError: the file is unreadable, or a model in it is not supported.
    """
    file = Path(path)
    world = _world_element(file)
    kept = _KeptTask.take(file, world)
    frame = kept.numbers("frame", 3) or (0.0, 0.0, 0.0)
    models = read_models(world, frame)
    if models.unsupported and not skip_unsupported:
        raise input_error(str(file), _about_unsupported(models))
    if on_skipped is not None:
        on_skipped(models.unsupported)
    start = _in_world(frame, start) or kept.numbers("start", 3)
    goal = _in_world(frame, goal) or kept.numbers("goal", 2)
    bounds = bounds or kept.numbers("bounds", 4)
    if bounds is None:
        bounds = _bounds_around(file, models.discs, start, goal)
    goal = goal or (bounds[2] - MARGIN / 2, bounds[3] - MARGIN / 2)
    if start is None:
        x, y = bounds[0] + MARGIN / 2, bounds[1] + MARGIN / 2
        start = x, y, math.atan2(goal[1] - y, goal[0] - x)
    try:
        return Task(
            World(kept.text("name", file.stem), bounds, tuple(models.discs), kept.source),
            start,
            goal,
            kept.number("goal_tolerance", TOLERANCE) if goal_tolerance is None else goal_tolerance,
            kept.number("cell", CELL) if cell is None else cell,
            kept.number("time_limit", None),
            frame=frame,
        )
    except FieldError as error:
        raise input_error(str(file), str(error)) from None


def _in_world(frame: Pose, end: Any) -> Any:
    """Transform a start or a goal from the file's coordinates to the world's frame."""
    return tuple(map_to_world(frame, [end])[0].tolist()) if end is not None and any(frame) else end


def _world_element(file: Path) -> ET.Element:
    root = parse_xml(file)
    world = root.find("world") if root.tag == "sdf" else None
    if world is None:
        raise input_error(str(file), f"must be an <sdf> with a <world> in it, got <{root.tag}>")
    return world


@dataclass(frozen=True)
class _KeptTask:
    """The task element of an exported world; empty for other worlds."""

    file: Path
    values: Mapping[str, str]

    @classmethod
    def take(cls, file: Path, world: ET.Element) -> _KeptTask:
        """Return the task values of a <world>, and remove its exported walls."""
        element = next((e for e in world if e.tag == TASK_TAG), None)
        if element is None:
            return cls(file, {})
        for model in [m for m in world.findall("model") if m.get("name") == WALLS]:
            world.remove(model)
        return cls(file, dict(element.attrib))

    @property
    def source(self) -> str | None:
        return self.values.get("source") if self.values else f"imported from {self.file.name}"

    def text(self, key: str, default: str) -> str:
        return self.values.get(key, default)

    def numbers(self, key: str, count: int) -> Any:
        """Return the numbers under a key as a tuple; None without the key."""
        if key not in self.values:
            return None
        try:
            numbers = tuple(float(word) for word in self.values[key].split())
        except ValueError:
            numbers = ()
        if len(numbers) != count:
            problem = f"must be {count} numbers, got {self.values[key][:40]!r}"
            raise input_error(str(self.file), TASK_TAG, key, problem)
        return numbers

    def number(self, key: str, default: Any) -> Any:
        """Return the number under a key."""
        (number,) = self.numbers(key, 1) or (default,)
        return number


def _about_unsupported(models: Models) -> str:
    more = len(models.unsupported) - 5
    names = ", ".join(models.unsupported[:5]) + (f" and {more} more" if more > 0 else "")
    return f"only static models of upright cylinders can be imported; remove or skip {names}"


def _bounds_around(file: Path, discs: list[Disc], start: Pose | None, goal: Point | None) -> Bounds:
    """Return bounds `MARGIN` around the cylinders, start and goal; raise InputError without cylinders."""
    if not discs:
        raise input_error(str(file), "has no upright cylinder; give the bounds")
    spots = [(d.x, d.y, d.radius) for d in discs]
    spots += [(end[0], end[1], 0.0) for end in (start, goal) if end is not None]
    return (
        min(x - r for x, _, r in spots) - MARGIN,
        min(y - r for _, y, r in spots) - MARGIN,
        max(x + r for x, _, r in spots) + MARGIN,
        max(y + r for _, y, r in spots) + MARGIN,
    )


def export_sdf(task: Task, path: str | Path) -> None:
    """Write a world for Gazebo (SDF 1.6): static cylinders, the bounds as four walls, a floor and a sun.

    Positions are in the world's source map: models have the pose of the world's `frame`, and links the positions in
    the world. The task is stored in an element `antdrive:task`, which Gazebo ignores; `import_sdf` restores it bit for bit.

    Raises:
        InputError: the file cannot be written, or the world has movers.
    """
    require_no_movers(task, path)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<sdf version="1.6">',
        f"<world name={quoteattr(_xml_text(task.world.name))}>",
        _task_element(task),
        '<light name="sun" type="directional"><cast_shadows>true</cast_shadows><pose>0 0 10 0 0 0</pose>'
        "<direction>-0.5 0.1 -0.9</direction></light>",
        _model("ground_plane", None, "0 0 0", ["<plane><normal>0 0 1</normal><size>1000 1000</size></plane>"]),
        _model(WALLS, task.frame, "0 0 0", *_walls(task)),
        *(_cylinder(i, task.frame, disc) for i, disc in enumerate(task.world.obstacles)),
        "</world>",
        "</sdf>",
    ]
    write_text(path, "\n".join(lines) + "\n")


def _task_element(task: Task) -> str:
    values = {
        "name": task.world.name,
        "bounds": _words(task.world.bounds),
        "start": _words(task.start),
        "goal": _words(task.goal),
        "goal_tolerance": repr(float(task.goal_tolerance)),
        "cell": repr(float(task.cell)),
    }
    if any(task.frame):
        values["frame"] = _words(task.frame)
    if task.time_limit is not None:
        values["time_limit"] = repr(float(task.time_limit))
    if task.world.source is not None:
        values["source"] = task.world.source
    attributes = " ".join(f"{key}={quoteattr(_xml_text(value))}" for key, value in values.items())
    return f"<{TASK_TAG} xmlns:antdrive={quoteattr(NAMESPACE)} {attributes}/>"


def _model(name: str, frame: Pose | None, place: str, *parts: Sequence[str]) -> str:
    """Return a static model; each part is a shape and, unless it is the model's, its pose."""
    bodies = []
    for n, (shape, *at) in enumerate(parts):
        inside = "".join(f"<pose>{p}</pose>" for p in at) + f"<geometry>{shape}</geometry>"
        bodies.append(f'<collision name="c{n}">{inside}</collision><visual name="v{n}">{inside}</visual>')
    pose, link = f"<pose>{place} 0 0 0</pose>", ""
    if frame is not None and any(frame):
        x, y, yaw = (float(v) for v in frame)
        pose, link = f"<pose>{x!r} {y!r} 0 0 0 {yaw!r}</pose>", pose
    return f'<model name="{name}"><static>true</static>{pose}<link name="link">{link}{"".join(bodies)}</link></model>'


def _cylinder(number: int, frame: Pose, disc: Disc) -> str:
    x, y, radius, height = (float(v) for v in (disc.x, disc.y, disc.radius, disc.height))
    shape = f"<cylinder><radius>{radius!r}</radius><length>{height!r}</length></cylinder>"
    return _model(f"obstacle_{number}", frame, f"{x!r} {y!r} {height / 2!r}", [shape])


def _walls(task: Task) -> Iterable[tuple[str, str]]:
    """Yield shape and pose of each of the four walls."""
    xmin, ymin, xmax, ymax = (float(v) for v in task.world.bounds)
    thick, high = WALL_THICKNESS, WALL_HEIGHT
    x, y, wide, deep = (xmin + xmax) / 2, (ymin + ymax) / 2, xmax - xmin + 2 * thick, ymax - ymin
    for size, spot in (
        ((thick, deep, high), (xmin - thick / 2, y)),
        ((thick, deep, high), (xmax + thick / 2, y)),
        ((wide, thick, high), (x, ymin - thick / 2)),
        ((wide, thick, high), (x, ymax + thick / 2)),
    ):
        yield f"<box><size>{_words(size)}</size></box>", f"{_words((*spot, high / 2))} 0 0 0"


def _words(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _xml_text(text: str) -> str:
    """Replace the characters that XML cannot hold by spaces."""
    return "".join(
        c if c in "\t\r\n" or " " <= c < "\ud800" or "\ue000" <= c < "\ufffe" or c > "\uffff" else " " for c in text
    )
