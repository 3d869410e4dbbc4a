"""Gazebo worlds (SDF, `.sdf` and `.world`): static upright cylinders, in and out."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

from antdrive.base.atomic import written_whole
from antdrive.base.errors import FieldError, input_error
from antdrive.base.plane import out_of_map
from antdrive.base.types import Bounds, Point, Pose
from antdrive.worlds.formats.checks import require_no_movers
from antdrive.worlds.formats.sdf_models import Models, read_models
from antdrive.worlds.formats.xml import parse_xml
from antdrive.worlds.world import Disc, Task, World

MARGIN = 1.0  # room left around the cylinders when no bounds are given [m]
CELL = 0.25  # grid resolution of a task when none is given [m]
TOLERANCE = 0.25  # goal tolerance when none is given [m]
WALL_THICKNESS, WALL_HEIGHT = 0.2, 1.0  # of an exported world's bounds [m]

#: An exported world has an element of our own, as SDF allows, with all of the task that SDF cannot hold.
TASK_TAG, NAMESPACE = "antdrive:task", "urn:antdrive:task:1"
#: The model of an exported world's walls. The import ignores it, as the bounds are in the task element.
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
) -> Task:
    """The upright cylinders of a Gazebo world as a task.

    Poses of models, links and collisions are composed; those in <state> replace the models' own, as in Gazebo.
    A cylinder's height is that of its top above z = 0. Ground planes, models without collision geometry and
    everything below the floor are ignored. A world that `export_sdf` wrote brings its own values for everything
    that is left out here; one that lies in a map is imported with its `frame`.

    Args:
        path: the SDF file
        start: the robot's first pose in the file's coordinates [m, m, rad]; by default at the lower left, towards the goal
        goal: in the file's coordinates [m]; by default at the upper right
        bounds: the walls' inner faces, in the world's own frame [m]; by default with 1 m of room around the cylinders and
            the given ends
        cell: the task's grid resolution [m]; by default 0.25
        goal_tolerance: how close to the goal the robot must stop [m]; by default 0.25
        skip_unsupported: leave out moving and included models and collision shapes other than upright cylinders,
            instead of refusing the file

    Raises:
        InputError: the file cannot be read, or a model in it is not supported.
    """
    file = Path(path)
    world = _world_element(file)
    kept = _KeptTask.take(file, world)
    frame = kept.numbers("frame", 3) or (0.0, 0.0, 0.0)
    models = read_models(world, frame)
    if models.unsupported and not skip_unsupported:
        raise input_error(str(file), _about_unsupported(models))
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
    """A start or a goal in the file's coordinates as it is in the world's frame."""
    return tuple(out_of_map(frame, [end])[0].tolist()) if end is not None and any(frame) else end


def _world_element(file: Path) -> ET.Element:
    root = parse_xml(file)
    world = root.find("world") if root.tag == "sdf" else None
    if world is None:
        raise input_error(str(file), f"must be an <sdf> with a <world> in it, got <{root.tag}>")
    return world


@dataclass(frozen=True)
class _KeptTask:
    """What an exported world keeps of its task; empty for any other world."""

    file: Path
    values: Mapping[str, str]

    @classmethod
    def take(cls, file: Path, world: ET.Element) -> _KeptTask:
        """The kept values of a <world>, from which the exported walls are removed."""
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
        """The numbers under a key as a tuple; None where there is no such key."""
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
        """The one number under a key."""
        (number,) = self.numbers(key, 1) or (default,)
        return number


def _about_unsupported(models: Models) -> str:
    more = len(models.unsupported) - 5
    names = ", ".join(models.unsupported[:5]) + (f" and {more} more" if more > 0 else "")
    return f"only static models of upright cylinders can be imported; leave out or skip {names}"


def _bounds_around(file: Path, discs: list[Disc], start: Pose | None, goal: Point | None) -> Bounds:
    """Bounds with `MARGIN` around the cylinders, of which there must be one, and the given ends."""
    if not discs:
        raise input_error(str(file), "holds no upright cylinder; give the bounds")
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

    Everything is where it is in the map that the world was made from: models have the pose of the world's `frame`, and
    their links the places in the world. Name, frame, bounds, start and goal are kept in an element `antdrive:task`, which
    Gazebo ignores. `import_sdf` reads it and returns an equal task, every number to the last bit.

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
    with written_whole(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _task_element(task: Task) -> str:
    values = {
        "name": task.world.name,
        "bounds": _numbers(task.world.bounds),
        "start": _numbers(task.start),
        "goal": _numbers(task.goal),
        "goal_tolerance": repr(float(task.goal_tolerance)),
        "cell": repr(float(task.cell)),
    }
    if any(task.frame):
        values["frame"] = _numbers(task.frame)
    if task.time_limit is not None:
        values["time_limit"] = repr(float(task.time_limit))
    if task.world.source is not None:
        values["source"] = task.world.source
    attributes = " ".join(f"{key}={quoteattr(_xml_text(value))}" for key, value in values.items())
    return f"<{TASK_TAG} xmlns:antdrive={quoteattr(NAMESPACE)} {attributes}/>"


def _model(name: str, frame: Pose | None, place: str, *parts: Sequence[str]) -> str:
    """A static model; each part is a shape and, where it differs from the model's, its pose."""
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
    """Shape and pose of each of the four walls."""
    xmin, ymin, xmax, ymax = (float(v) for v in task.world.bounds)
    thick, high = WALL_THICKNESS, WALL_HEIGHT
    x, y, wide, deep = (xmin + xmax) / 2, (ymin + ymax) / 2, xmax - xmin + 2 * thick, ymax - ymin
    for size, spot in (
        ((thick, deep, high), (xmin - thick / 2, y)),
        ((thick, deep, high), (xmax + thick / 2, y)),
        ((wide, thick, high), (x, ymin - thick / 2)),
        ((wide, thick, high), (x, ymax + thick / 2)),
    ):
        yield f"<box><size>{_numbers(size)}</size></box>", f"{_numbers((*spot, high / 2))} 0 0 0"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _xml_text(text: str) -> str:
    """The text with spaces for the characters that XML cannot hold."""
    return "".join(
        c if c in "\t\r\n" or " " <= c < "\ud800" or "\ue000" <= c < "\ufffe" or c > "\uffff" else " " for c in text
    )
