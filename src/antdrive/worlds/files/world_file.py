"""World files (tasks in YAML) and the package's catalogue of worlds."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeAlias

import yaml
from pydantic import BaseModel, Field

from antdrive.base.atomic import write_text
from antdrive.base.caches import cached
from antdrive.base.checks import OneLine, SchemaVersion, check, file_schema, resolve, suggest, yaml_flow
from antdrive.base.document import MAX_BYTES, MAX_VALUES, Document, count_values, parse_document, read_yaml
from antdrive.base.errors import FieldError, InputError, input_error, visible
from antdrive.base.files import format_size
from antdrive.base.records import STRICT
from antdrive.worlds.limits import MAX_CELLS, MAX_COORDINATE, MAX_PHASE, MIN_PERIOD, Coordinate, Size
from antdrive.worlds.movers import Mover, mover_from_dict, mover_to_dict
from antdrive.worlds.world import Disc, Task, World

Pair: TypeAlias = tuple[Coordinate, Coordinate]
Triple: TypeAlias = tuple[Coordinate, Coordinate, Coordinate]
Start = Annotated[Triple, Field(description="write [x, y, yaw] in metres and radians")]
Goal = Annotated[Pair, Field(description="write [x, y] in metres")]

FOREIGN_SUFFIXES = (".sdf", ".world", ".map")  # files of other programs; `antdrive worlds import` converts them
_BARN_NAME = re.compile(r"world_\d+\.world")  # of the BARN set
_CATALOG = Path(__file__).parent.with_name("catalog")


class WalkEntry(BaseModel):
    """A random walk: one step each period, from a cell's centre to a random free neighbour's."""

    model_config = STRICT

    cell: Size = Field(description="side of a cell [m]")
    period: float = Field(ge=MIN_PERIOD, le=MAX_COORDINATE, description="time for one step [s]")
    start: Pair | None = Field(
        None, description="write [x, y] of a point in the first cell; by default a random free cell"
    )
    seed: int | None = Field(None, ge=0, lt=2**63, description="random seed; by default the run's")


class MoverEntry(BaseModel):
    """A moving cylinder, with exactly one of keyframes, velocity and walk."""

    model_config = STRICT

    radius: Size = Field(description="the radius as built [m]")
    height: Size = Field(1.0, description="the height [m]")
    phase: float = Field(0.0, ge=0, le=MAX_PHASE, description="time into the motion at the start of a run [s]")
    keyframes: list[Triple] | None = Field(None, max_length=10_000, description="write [t, x, y] for each")
    loop: Literal["pingpong", "teleport", "once"] | None = Field(None, description="behaviour after the last keyframe")
    interpolation: Literal["linear", "catmull-rom"] | None = Field(None, description="motion between keyframes")
    position: Pair | None = Field(None, description="write [x, y], the centre at the start")
    velocity: Pair | None = Field(None, description="write [vx, vy] in m/s; the mover bounces off the walls")
    walk: WalkEntry | None = Field(None, description="write {cell: 0.5, period: 1.0}")


class EndsEntry(BaseModel):
    """Another start and goal in the same world, chosen by `--task NAME`."""

    model_config = STRICT

    name: OneLine = Field(min_length=1, max_length=100, description="the name for --task")
    start: Triple | None = Field(
        None, description="write [x, y, yaw] in metres and radians; by default the world's own"
    )
    goal: Goal
    goal_tolerance: Size | None = Field(None, description="how close to the goal the robot must stop [m]")


class WorldFile(BaseModel):
    """A world file: a world with a start and a goal."""

    model_config = STRICT

    # "schema" is also a method of BaseModel, hence the alias.
    schema_: SchemaVersion = Field(alias="schema", description="write schema: 1")
    name: OneLine = Field(min_length=1, max_length=200, description="the world's name; by default the file's name")
    source: str | None = Field(None, description="origin of the world, free text")
    bounds: tuple[Coordinate, Coordinate, Coordinate, Coordinate] = Field(
        description="write [xmin, ymin, xmax, ymax] in metres"
    )
    start: Start
    goal: Goal
    goal_tolerance: Size = Field(0.25, description="how close to the goal the robot must stop [m]")
    cell: Size = Field(0.5, description="default grid resolution for planners [m]")
    obstacles: list[Disc] = Field([], description="upright cylinders")
    time_limit: Size | None = Field(None, description="simulated time allowed [s]; by default computed from the route")
    movers: list[MoverEntry] = Field([], max_length=1000, description="moving cylinders")
    tasks: list[EndsEntry] = Field([], max_length=10_000, description="other starts and goals, by name")
    frame: Triple | None = Field(
        None,
        description="write [x, y, yaw]: the pose of the world's origin in its source map, in metres and radians; used by exports",
    )


def list_worlds() -> Mapping[str, Path]:
    """Return the files of the package's worlds by name."""
    return dict(_files_of(_CATALOG))


@functools.cache
def _files_of(catalog: Path) -> Mapping[str, Path]:
    return dict(sorted((path.stem, path) for path in catalog.glob("*.yaml")))


def load_task(world: str | os.PathLike[str], name: str | None = None, home: Path | None = None) -> Task:
    """Load a task from a world file or the catalogue.

    Args:
        world: a catalogue name or a path; catalogue names take precedence
        name: one of the file's `tasks`; None: the world's own start and goal
        home: base of relative paths; None: the working directory

    Raises:
        InputError: the world or the task does not exist, or the file is invalid.
    """
    tasks = _tasks_of(world, home)
    if name not in tasks:
        known = [known for known in tasks if known is not None]
        hint = suggest(name or "", known) if known else "the world has no named tasks"
        raise InputError(visible(f"{os.fspath(world)}: no task {name!r:.60}; {hint}"), "task")
    return tasks[name]


def load_tasks(world: str | os.PathLike[str]) -> Mapping[str, Task]:
    """Load the tasks under a world's key `tasks`, by name; the world is that of `load_task`.

    Raises:
        InputError: the world does not exist, or its file is invalid.
    """
    return {name: task for name, task in _tasks_of(world).items() if name is not None}


def _tasks_of(world: str | os.PathLike[str], home: Path | None = None) -> Mapping[str | None, Task]:
    """Return a world's tasks by name; None is the key of its own start and goal."""
    try:
        path = resolve("world", world, list_worlds(), home)
    except FieldError as error:
        raise InputError(visible(error.problem), error.key) from None
    if path.suffix.lower() in FOREIGN_SUFFIXES:
        barn = " --barn" if _BARN_NAME.fullmatch(path.name) else ""  # without it another task would be imported
        raise input_error(str(path), f"not a world file; convert it with: antdrive worlds import {path}{barn}")
    return _tasks_in(read_yaml(path), os.fspath(path), path.stem)


@cached(16)
def _tasks_in(text: str, source: str, stem: str) -> Mapping[str | None, Task]:
    """Parse the tasks of a world file."""
    document = parse_document(text, source)
    if isinstance(document.data, dict):
        if {"image", "resolution", "origin"} <= document.data.keys():
            raise document.error((), f"a map_server map; convert it with: antdrive worlds import {source}")
        document.data.setdefault("name", "".join(filter(str.isprintable, stem))[:200] or "world")
    return _tasks_in_document(document)


def _tasks_in_document(document: Document) -> dict[str | None, Task]:
    entry = check(WorldFile, document)
    own = _to_task(document, entry)
    tasks: dict[str | None, Task] = {None: own}
    return tasks | _named_tasks(document, entry, own)


def _named_tasks(document: Document, entry: WorldFile, own: Task) -> dict[str | None, Task]:
    """Return the tasks under the key `tasks`."""
    named: dict[str | None, Task] = {}
    for i, ends in enumerate(entry.tasks):
        if ends.name in named:
            raise document.error(("tasks", i, "name"), f"{ends.name!r} names two tasks; rename one")
        tolerance = ends.goal_tolerance or own.goal_tolerance
        try:
            start = ends.start or own.start
            named[ends.name] = dataclasses.replace(own, start=start, goal=ends.goal, goal_tolerance=tolerance)
        except FieldError as error:
            raise document.field_error(error, "tasks", i) from None
    return named


def save_task(task: Task, path: str | Path, tasks: Mapping[str, Task] = MappingProxyType({})) -> None:
    """Write a task as a world file, atomically.

    Args:
        task: the world with its own start and goal
        path: the file
        tasks: other starts and goals in the same world, by name

    Raises:
        InputError: the file cannot be written, or the task does not fit into a world file (empty name, too many
            obstacles).
    """
    data = task_to_dict(task)
    if tasks:
        data["tasks"] = [{"name": name, **ends_to_dict(other)} for name, other in tasks.items()]
    _tasks_in_document(Document("task", data))
    text = _to_yaml(data)
    size = len(text.encode())
    values = count_values(data)
    if size > MAX_BYTES or values > MAX_VALUES:
        raise input_error(
            os.fspath(path),
            f"not written: {len(task.world.obstacles)} obstacles and {len(task.world.movers)} movers make "
            f"{format_size(size)} and {values} values; the limits are {format_size(MAX_BYTES)} and {MAX_VALUES} values; "
            f"use fewer, larger cylinders (for maps, a larger overhang)",
        )
    write_text(path, text)


def ends_to_dict(task: Task) -> dict[str, Any]:
    """Return a task's start, goal and tolerance as plain data."""
    return {
        "start": [float(v) for v in task.start],
        "goal": [float(v) for v in task.goal],
        "goal_tolerance": float(task.goal_tolerance),
    }


def task_to_dict(task: Task) -> dict[str, Any]:
    """Return a task as JSON-ready data with the keys of a world file."""
    world = task.world
    return {
        "schema": 1,
        "name": world.name,
        **({} if world.source is None else {"source": world.source}),
        "bounds": [float(v) for v in world.bounds],
        "start": [float(v) for v in task.start],
        "goal": [float(v) for v in task.goal],
        "goal_tolerance": float(task.goal_tolerance),
        "cell": float(task.cell),
        **({} if task.time_limit is None else {"time_limit": float(task.time_limit)}),
        **({"frame": [float(v) for v in task.frame]} if any(task.frame) else {}),
        "obstacles": [
            {"x": float(d.x), "y": float(d.y), "radius": float(d.radius), "height": float(d.height)}
            for d in world.obstacles
        ],
        **({"movers": [mover_to_dict(mover) for mover in world.movers]} if world.movers else {}),
    }


def task_from_dict(data: Mapping[str, Any], source: str = "task") -> Task:
    """Return the task in plain `data`: the inverse of `task_to_dict`. `source` names the data in errors.

    Raises:
        InputError: the data are invalid.
    """
    return _to_task(Document(source, dict(data)))


def task_schema() -> dict[str, Any]:
    """Return the JSON Schema of world files, for editors."""
    return file_schema(WorldFile, "antdrive world")


def _to_task(document: Document, entry: WorldFile | None = None) -> Task:
    entry = entry or check(WorldFile, document)
    xmin, ymin, xmax, ymax = entry.bounds
    if (xmax - xmin) / entry.cell * (ymax - ymin) / entry.cell > MAX_CELLS:
        raise document.error(("cell",), f"{entry.cell:g} m cuts these bounds into more than {MAX_CELLS} cells")
    movers = tuple(_to_mover(document, i, mover) for i, mover in enumerate(entry.movers))
    try:
        world = World(entry.name, entry.bounds, tuple(entry.obstacles), entry.source, movers)
        frame = entry.frame or (0.0, 0.0, 0.0)
        return Task(world, entry.start, entry.goal, entry.goal_tolerance, entry.cell, entry.time_limit, frame)
    except FieldError as error:
        raise document.field_error(error) from None


def _to_mover(document: Document, index: int, entry: MoverEntry) -> Mover:
    try:
        return mover_from_dict(entry.model_dump(exclude_unset=True))
    except FieldError as error:
        raise document.field_error(error, "movers", index) from None


def _to_yaml(data: dict[str, Any]) -> str:
    data = dict(data)
    lists = {key: data.pop(key) for key in ("obstacles", "movers", "tasks") if key in data}
    lines = []
    for key, value in data.items():
        if isinstance(value, list | float):
            lines.append(f"{key}: {yaml_flow(value)}\n")
        else:
            lines.append(yaml.safe_dump({key: value}, allow_unicode=True, width=100))
    for key, entries in lists.items():
        lines.append(f"{key}:\n" if entries else f"{key}: []\n")
        # Every JSON string is a YAML string.
        quoted = [{**entry, "name": json.dumps(entry["name"])} if "name" in entry else entry for entry in entries]
        lines += [f"  - {yaml_flow(entry)}\n" for entry in quoted]
    return "".join(lines)


def require_no_movers(task: Task, path: str | Path) -> None:
    """Raise InputError for a task with movers: only world files can hold them."""
    if task.world.movers:
        problem = f"cannot hold {task.world.name}'s movers; export a world without movers"
        raise input_error(str(path), problem)
