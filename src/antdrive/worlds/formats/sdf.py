"""Import of Gazebo worlds (SDF), and export of worlds as static upright cylinders."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

from antdrive.base.atomic import write_text
from antdrive.base.errors import FieldError, InputError, few, input_error
from antdrive.base.plane import end_in_world
from antdrive.base.types import Bounds, Point, Pose
from antdrive.worlds.files.world_file import require_no_movers
from antdrive.worlds.formats.cellmap import cell_map, largest_ground
from antdrive.worlds.formats.sdf_models import ACTOR_RADIUS, VARIABLES, Models, SdfReader
from antdrive.worlds.formats.solids import BAND, cover_pieces, floor_height
from antdrive.worlds.formats.xml import parse_xml
from antdrive.worlds.world import Disc, Task, World

MOST_SLOPING = 25.0  # of an imported world without a remark [m2]
MOST_CELLS = 5_000_000  # of a task's default grid
FINE = 0.1  # default grid resolution of a task with covered shapes [m]
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
    band: tuple[float, float] | None = None,
    resolution: float | None = None,
    overhang: float | None = None,
    skip_unsupported: bool = False,
    on_skipped: Callable[[list[str]], None] | None = None,
) -> Task:
    """Import a Gazebo world, or a model, as a task.

    What collision shapes fill between two heights becomes obstacles. Upright cylinders and spheres become one cylinder
    each. All other shapes are covered: no point of them stays free, and the world's source states the largest protrusion.
    Bodies that could move stand as they are; actors with a trajectory become movers. Robots are left out, with anything
    that has no collision shape. Worlds written by `export_sdf` have their own defaults, including the `frame`.

    Args:
        path: the SDF file
        start: the robot's start pose in the file's coordinates [m, m, rad]; by default on the largest connected ground
        goal: the goal position in the file's coordinates [m]; by default there, too
        bounds: the walls' inner faces, in the world's own frame [m]; by default 1 m around the obstacles, start and goal
        cell: the task's grid resolution [m]; by default 0.25, or 0.1 with covered shapes
        goal_tolerance: largest distance from the goal at the stop [m]; by default 0.25
        band: heights in the file between which shapes are obstacles [m]; by default 0.01 and 2 above the floor, which is
            the highest ground plane, or the top of low plates that cover most of the ground
        resolution: side of the cells on which shapes are covered [m]; by default 0.02, or more in large worlds
        overhang: largest protrusion of cylinders beyond these cells [m]; by default their side
        skip_unsupported: skip unsupported parts and missing models instead of refusing the file
        on_skipped: called with what is skipped, each part as "model::link::collision (reason)"

    Raises:
        InputError: the file is unreadable, or a model in it is missing or not supported.
    """
    file = Path(path)
    world = _world_element(file)
    kept = _KeptTask.take(file, world)
    frame = kept.numbers("frame", 3) or (0.0, 0.0, 0.0)
    if band is not None and not band[0] < band[1]:
        raise FieldError("band", f"must be two heights, LOW,HIGH with LOW < HIGH, got {band[0]:g},{band[1]:g}")
    low, high = band or ((0.0, math.inf) if kept.values else BAND)
    floor = min(float(low), 0.0)
    try:
        reader = SdfReader(file)
        models = reader.read(world, frame, (low - floor, high - floor), floor)
        for plates in (False, True) if band is None and not kept.values else ():
            if rise := floor_height(models.solids) if plates else max(models.planes, default=0.0):
                above = reader.read(world, frame, BAND, models.floor + rise)
                models = above if above.kinds else models
        if (models.unsupported or models.missing) and not skip_unsupported:
            raise InputError(_about_unsupported(models))
        covering, reach = cover_pieces(models.solids, models.band, resolution, overhang)
    except InputError as error:
        raise input_error(str(file), str(error)) from None
    if on_skipped is not None:
        on_skipped([*models.unsupported, *(f"{uri} (not found)" for uri in models.missing)])
    discs = [*models.discs, *covering]
    start = end_in_world(frame, start) or kept.numbers("start", 3)
    goal = end_in_world(frame, goal) or kept.numbers("goal", 2)
    bounds = bounds or kept.numbers("bounds", 4)
    if bounds is None:
        bounds = _bounds_around(file, models, discs, start, goal)
    cell = kept.number("cell", _cell(bounds, FINE if covering else CELL)) if cell is None else cell
    tolerance = kept.number("goal_tolerance", TOLERANCE) if goal_tolerance is None else goal_tolerance
    about = "; ".join([f"imported from {file.name}", *_about(models, len(covering), reach)])
    source = kept.values.get("source") if kept.values else about
    try:
        made = World(kept.values.get("name", file.stem), bounds, tuple(discs), source, tuple(models.movers))
        if start is None or goal is None:
            ground = cell_map(made, _cell(bounds, FINE))
            usual_start, usual_goal = largest_ground(ground, math.ceil(MARGIN / 2 / ground.resolution))
            start, goal = start or usual_start, goal or usual_goal
        return Task(made, start, goal, tolerance, cell, kept.number("time_limit", None), frame=frame)
    except (FieldError, InputError) as error:
        raise input_error(str(file), str(error)) from None


def _about(models: Models, covering: int, reach: float) -> Iterator[str]:
    """Yield what was imported, assumed and ignored."""
    low, high = (height + models.floor for height in models.band)
    if models.floor:
        yield f"the floor is {models.floor:g} m high: a ground plane, or low plates, whose edges are open"
    if covering:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(models.kinds.items()))
        yield f"shapes between {low:g} and {high:g} m: {kinds}"
        yield f"cylinders cover them fully, and reach at most {reach + models.facets:.3g} m beyond them"
    if models.sloping > MOST_SLOPING:
        yield f"sloping ground, taken for obstacles: {models.sloping:.0f} m2"
    if models.movers:
        yield f"actors as movers of radius {ACTOR_RADIUS:g} m, in straight lines: {len(models.movers)}"
    names = {"flat": f"shapes up to {low:g} m, taken for floor", "above": f"shapes above {high:g} m, no obstacles"}
    for what, count in models.counts.items():
        yield what if what.startswith("left out") else f"{names.get(what, what)}: {count}"


def _world_element(file: Path) -> ET.Element:
    root = parse_xml(file)
    if any(element.tag.startswith("xacro:") for element in root.iter()):
        raise input_error(str(file), f"is a xacro file; expand it first: xacro {file.name} > expanded.sdf")
    world = root.find("world") if root.tag == "sdf" else None
    if world is None and (root.tag != "sdf" or root.find("model") is None):
        raise input_error(str(file), f"must be an <sdf> with a <world> or a <model> in it, got <{root.tag}>")
    if len(worlds := [each.get("name", "") for each in root.findall("world")]) > 1:
        raise input_error(str(file), f"has {len(worlds)} worlds ({', '.join(worlds)}); leave one in it")
    return root if world is None else world


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
        return (self.numbers(key, 1) or (default,))[0]


def _about_unsupported(models: Models) -> str:
    """Return in one line what of a world cannot be imported, and what helps."""
    problems, missing, parts = [], models.missing, models.unsupported
    if missing:
        problems.append(f"models and meshes not found ({len(missing)}): {', '.join(missing)}")
        problems.append(f"name their folder in {VARIABLES[0]} (or {', '.join(VARIABLES[1:])})")
    if any("://fuel" in uri for uri in missing):
        problems.append("download Fuel's with: gz fuel download -u URL")
    if parts:
        problems.append(f"parts that cannot be imported ({len(parts)}): {few(parts, 5)}")
    return "; ".join([*problems, "--skip-unsupported leaves them out"])


def _bounds_around(file: Path, models: Models, discs: list[Disc], start: Pose | None, goal: Point | None) -> Bounds:
    """Return bounds `MARGIN` around the obstacles, movers, start and goal; raise InputError without obstacles."""
    spots = [(d.x, d.y, d.radius) for d in discs]
    spots += [(x, y, ACTOR_RADIUS) for mover in models.movers for _, x, y in mover.keyframes]
    if not spots:
        low, high = (height + models.floor for height in models.band)
        why = "; ".join([f"has no obstacles between {low:g} and {high:g} m", *_about(models, 0, 0.0)])
        raise input_error(str(file), f"{why}; choose other heights with --band, or give --bounds for an empty world")
    spots += [(end[0], end[1], 0.0) for end in (start, goal) if end is not None]
    return (
        min(x - r for x, _, r in spots) - MARGIN,
        min(y - r for _, y, r in spots) - MARGIN,
        max(x + r for x, _, r in spots) + MARGIN,
        max(y + r for _, y, r in spots) + MARGIN,
    )


def _cell(bounds: Bounds, cell: float) -> float:
    """Return the default grid resolution, doubled until the grid has at most `MOST_CELLS` cells [m]."""
    area = (bounds[2] - bounds[0]) * (bounds[3] - bounds[1])
    return _cell(bounds, 2 * cell) if MOST_CELLS * cell * cell < area < math.inf else cell


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
