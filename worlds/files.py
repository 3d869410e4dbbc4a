"""World files: tasks read from YAML and written to it, and the catalogue that comes with the package."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import BaseModel, ConfigDict, Field, field_validator

from worlds.atomic import written_whole
from worlds.checks import SchemaVersion, check, suggest, yaml_number
from worlds.documents import Document, input_error, read_document
from worlds.world import Disc, Task, World

LIMIT = 1e6  # farthest coordinate and largest size [m]: beyond it something was mistyped
MAX_CELLS = 25_000_000  # as in worlds.grid, which is not imported here because it loads the compiler

Coordinate = Annotated[float, Field(ge=-LIMIT, le=LIMIT)]
Size = Annotated[float, Field(gt=0, le=LIMIT)]

_CATALOG = Path(__file__).with_name("catalog")
_RULES = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class DiscEntry(BaseModel):
    """An upright cylinder. The radius is as built, never inflated."""

    model_config = _RULES

    x: Coordinate = Field(description="the centre's x [m]")
    y: Coordinate = Field(description="the centre's y [m]")
    radius: Size = Field(description="the radius as built [m]")
    height: Size = Field(1.0, description="the height [m]")


class TaskFile(BaseModel):
    """A world with a start and a goal, as written in a file."""

    model_config = _RULES

    # "schema" is also a method of BaseModel, hence the alias.
    schema_: SchemaVersion = Field(alias="schema", description="write schema: 1")
    name: str = Field(min_length=1, max_length=200, description="what the world is called, by default the file's name")
    source: str | None = Field(None, description="where the world comes from, free text")
    bounds: list[Coordinate] = Field(min_length=4, max_length=4, description="write [xmin, ymin, xmax, ymax] in metres")
    start: list[Coordinate] = Field(min_length=3, max_length=3, description="write [x, y, yaw] in metres and radians")
    goal: list[Coordinate] = Field(min_length=2, max_length=2, description="write [x, y] in metres")
    goal_tolerance: Size = Field(0.25, description="the robot must stop this close to the goal [m]")
    cell: Size = Field(0.5, description="grid resolution a planner uses unless told otherwise [m]")
    obstacles: list[DiscEntry] = Field([], description="upright cylinders")
    movers: list[Any] = Field([], max_length=0, description="moving cylinders; none in this version")

    @field_validator("name")
    @classmethod
    def _one_line(cls, name: str) -> str:
        if not name.isprintable():
            raise ValueError("must be one line of printable characters")
        return name

    @field_validator("movers", mode="before")
    @classmethod
    def _no_movers(cls, movers: Any) -> Any:
        if movers != []:
            raise ValueError("moving obstacles are not supported in this version; remove the key")
        return movers


def catalogue() -> Mapping[str, Path]:
    """The worlds that come with the package, by name."""
    return {path.stem: path for path in sorted(_CATALOG.glob("*.yaml"))}


def load_task(world: str | os.PathLike[str]) -> Task:
    """The task in a world file, or in the catalogue under a name.

    A text without a folder or a suffix is taken for a name of the catalogue first.

    Raises:
        InputError: there is no such world or something in the file is wrong.
    """
    known = catalogue()
    path = known[world] if isinstance(world, str) and world in known else Path(world)
    if not os.path.lexists(path):
        hint = suggest(path.stem, known)
        raise input_error(os.fspath(world), f"no such file, nor a world of the catalogue; {hint}")
    document = read_document(path)
    if isinstance(document.data, dict):
        document.data.setdefault("name", "".join(filter(str.isprintable, path.stem))[:200] or "world")
    return _to_task(document)


def save_task(task: Task, path: str | Path) -> None:
    """Write a task as a world file, whole or not at all.

    Raises:
        InputError: the file cannot be written.
        ValueError: the task holds what a world file cannot, such as an empty name.
    """
    _to_task(Document("task", task_to_dict(task)))
    with written_whole(path) as part:
        part.write_text(_to_yaml(task), encoding="utf-8")


def task_to_dict(task: Task) -> dict[str, Any]:
    """A task as plain data, in the same form as in a file and ready for JSON."""
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
        "obstacles": [
            {"x": float(d.x), "y": float(d.y), "radius": float(d.radius), "height": float(d.height)}
            for d in world.obstacles
        ],
    }


def task_from_dict(data: Mapping[str, Any], source: str = "task") -> Task:
    """The task in plain data, as `task_to_dict` gives it; `source` is what errors call it.

    Raises:
        InputError: something in it is wrong.
    """
    return _to_task(Document(source, dict(data)))


def task_schema() -> dict[str, Any]:
    """The JSON Schema of a world file, for editors."""
    schema = TaskFile.model_json_schema(by_alias=True)
    schema["required"] = [key for key in schema["required"] if key != "name"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "antdrive world"}


def _to_task(document: Document) -> Task:
    entry = check(TaskFile, document)
    xmin, ymin, xmax, ymax = entry.bounds
    if (xmax - xmin) / entry.cell * (ymax - ymin) / entry.cell > MAX_CELLS:
        raise document.error(("cell",), f"{entry.cell:g} m cuts these bounds into more than {MAX_CELLS} cells")
    x, y, yaw = entry.start
    discs = tuple(Disc(d.x, d.y, d.radius, d.height) for d in entry.obstacles)
    try:
        world = World(entry.name, (xmin, ymin, xmax, ymax), discs, entry.source)
        return Task(world, (x, y, yaw), (entry.goal[0], entry.goal[1]), entry.goal_tolerance, entry.cell)
    except ValueError as error:
        key, _, problem = str(error).partition(": ")
        raise document.error((key,), problem) from None


def _to_yaml(task: Task) -> str:
    data = task_to_dict(task)
    obstacles = data.pop("obstacles")
    lines = []
    for key, value in data.items():
        if isinstance(value, list):
            lines.append(f"{key}: [{', '.join(map(yaml_number, value))}]\n")
        elif isinstance(value, float):
            lines.append(f"{key}: {yaml_number(value)}\n")
        else:
            lines.append(yaml.safe_dump({key: value}, allow_unicode=True, width=100))
    lines.append("obstacles:\n" if obstacles else "obstacles: []\n")
    for disc in obstacles:
        lines.append(f"  - {{{', '.join(f'{key}: {yaml_number(value)}' for key, value in disc.items())}}}\n")
    return "".join(lines)
