"""Maps of ROS's map_server (wiki.ros.org/map_server, Nav2's nav2_map_server): a YAML file and an image.

A pixel of shade s, from 0 (black) to 1 (white), is occupied with probability p = 1 - s, or p = s where `negate` is set.
Its cell is free when p < free_thresh, occupied when p > occupied_thresh, and unknown in between; the image's last row is
the lowest. In mode `scale`, pixels that are not opaque are unknown. In mode `raw`, the shades 0..100 (of 255) are p in
percent, never negated, and higher shades are unknown.

Map savers write unknown cells as shade 205 (p = 0.1961), which the `free_thresh` of 0.25 that newer ones write makes free.
By default, such cells are unknown where 205 is the image's usual grey: more cells have it than all other greys.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from antdrive.base.atomic import atomic_write, write_text
from antdrive.base.checks import OneLine, check, yaml_flow, yaml_number
from antdrive.base.document import read_document
from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.files import open_regular, require_new
from antdrive.base.plane import end_in_world, world_to_map
from antdrive.base.records import STRICT
from antdrive.base.types import Floats, Point, Pose
from antdrive.worlds.files.world_file import Goal, Start, Triple, require_no_movers
from antdrive.worlds.formats.cellmap import CellMap, Cells, cell_map, file_task
from antdrive.worlds.limits import MAX_CELLS, Size
from antdrive.worlds.world import Task

FORMATS = ("PPM", "PNG", "BMP")  # Pillow's "PPM" includes PBM and PGM
MODES = {"1": "L", "P": "RGB"}  # black-and-white images are read as grey, palettes as colours
FREE, OCCUPIED, UNKNOWN = 254, 0, 205  # the shades that map savers write
OF_SHADE = f"of shade {UNKNOWN}, map savers' unknown,"

_RULES: ConfigDict = {**STRICT, "extra": "ignore"}
Fraction = Annotated[float, Field(ge=0, le=1)]


class KeptEnds(BaseModel):
    """Start, goal and tolerance in a map file, written by `export_map_server`."""

    model_config = _RULES

    start: Start
    goal: Goal
    goal_tolerance: Size = 0.25


class KeptTask(KeptEnds):
    """A named start and goal in a map file."""

    name: OneLine = Field(min_length=1, max_length=100)


class KeptTasks(KeptEnds):
    """All tasks in a map file."""

    tasks: list[KeptTask] = Field([], max_length=10_000)


class MapFile(BaseModel):
    """A map's YAML file. Unknown keys are ignored, as in map_server."""

    model_config = _RULES

    image: str = Field(min_length=1, description="the image file, relative to the YAML file's folder")
    resolution: Size = Field(description="the side of a cell [m]")
    origin: Triple = Field(description="write [x, y, yaw] of the lower left corner in metres and radians")
    negate: bool = Field(description="write 0, or 1 where black is free")
    occupied_thresh: Fraction = Field(description="cells more likely occupied than this are occupied; 0.65 is usual")
    free_thresh: Fraction = Field(description="cells less likely occupied than this are free; 0.196 is usual")
    mode: Literal["trinary", "scale", "raw"] = "trinary"
    antdrive: KeptTasks | None = None

    @field_validator("negate", mode="before")
    @classmethod
    def _zero_or_one(cls, negate: Any) -> Any:
        return bool(negate) if type(negate) is int and negate in (0, 1) else negate

    @field_validator("free_thresh")
    @classmethod
    def _below(cls, free: float, info: ValidationInfo) -> float:
        occupied = info.data.get("occupied_thresh")
        if occupied is not None and not free <= occupied:
            raise ValueError(f"must not be above occupied_thresh, {occupied:g}, got {free:g}")
        return free


@dataclass(frozen=True, eq=False)
class ServedMap:
    """A map as map_server serves it."""

    cells: CellMap  # unknown cells are free only on request
    unknown: int  # number of cells neither free nor occupied
    remarks: tuple[str, ...]  # what is unusual about the files
    ends: KeptTasks | None  # tasks, if antdrive wrote the map
    # pose of the cells' frame in the map's frame; nonzero for a rotated map, whose cells begin at the origin
    frame: Pose = (0.0, 0.0, 0.0)


def import_map_server(
    path: str | os.PathLike[str],
    *,
    start: Pose | None = None,
    goal: Point | None = None,
    unknown_is_free: bool | None = None,
    overhang: float | None = None,
    cell: float | None = None,
    goal_tolerance: float | None = None,
    anywhere: bool = False,
) -> Task:
    """Import a map_server map as a world of discs; see `map_task`.

    A rotated map becomes an axis-aligned world; the task's `frame` is its pose in the map.

    Args:
        path: the YAML file
        start: the robot's start pose in the map [m, m, rad]; required unless `export_map_server` wrote the map or `anywhere`
        goal: the goal position in the map [m]; required unless `export_map_server` wrote the map or `anywhere`
        unknown_is_free: whether unknown cells and those of shade 205 are free or blocked; by default blocked, but the few
            of shade 205 in an image of many greys are free if `free_thresh` says so
        overhang: largest protrusion of discs beyond blocked cells [m]; see `map_task`
        cell: the task's grid resolution [m]; by default the map's
        goal_tolerance: largest distance from the goal at the stop [m]; by default 0.25
        anywhere: whether start and goal, if neither is given, lie on the largest connected ground

    Raises:
        InputError: a file is invalid, or `map_task` refuses the map.
    """
    file = Path(path)
    served = read_map(file, unknown_is_free=unknown_is_free)
    ends = served.ends
    if ends is not None:
        start, goal = start or ends.start, goal or ends.goal
        goal_tolerance = goal_tolerance or ends.goal_tolerance
    source = f"the map_server map {file.name}"
    if served.unknown:
        source += f" with {served.unknown} unknown cells taken for {'free' if unknown_is_free else 'blocked'}"
    start, goal = end_in_world(served.frame, start), end_in_world(served.frame, goal)
    task = file_task(
        file,
        served.cells,
        start,
        goal,
        source=source,
        overhang=overhang,
        cell=cell,
        goal_tolerance=goal_tolerance,
        anywhere=anywhere,
    )
    world = dataclasses.replace(task.world, source="; ".join((str(task.world.source), *served.remarks)))
    return dataclasses.replace(task, world=world, frame=served.frame)


def kept_tasks(path: str | os.PathLike[str], task: Task) -> dict[str, Task]:
    """Return the named tasks in a map file by name; empty unless `export_map_server` wrote it."""
    document = read_document(path)
    entry = check(MapFile, document)
    tasks = {}
    for i, kept in enumerate(entry.antdrive.tasks if entry.antdrive else ()):
        start, goal = end_in_world(task.frame, kept.start), end_in_world(task.frame, kept.goal)
        try:
            tasks[kept.name] = dataclasses.replace(task, start=start, goal=goal, goal_tolerance=kept.goal_tolerance)
        except FieldError as error:
            raise document.field_error(error, "antdrive", "tasks", i) from None
    return tasks


def read_map(path: str | os.PathLike[str], *, unknown_is_free: bool | None = None) -> ServedMap:
    """Read a map from its YAML file and image; `unknown_is_free` is that of `import_map_server`."""
    document = read_document(path)
    if isinstance(document.data, dict) and "image" not in document.data:
        raise document.error((), "image: missing; a map_server map names its image")
    origin = document.data.get("origin") if isinstance(document.data, dict) else None
    if isinstance(origin, list) and len(origin) == 3 and str(origin[2]).lstrip("+-.").lower() == "nan":
        raise document.error(
            ("origin", 2), f"the yaw must be a number, got {origin[2]}; write 0 if the map is not rotated"
        )
    entry = check(MapFile, document)
    image, remarks = Path(path).parent / entry.image, []
    beside = Path(path).parent / re.split(r"[\\/]", entry.image)[-1]
    if not os.path.exists(image) and os.path.isfile(beside):
        remarks.append(f"its image is {beside.name} beside it, for there is no {entry.image}")
        image = beside
    try:
        level, shade, opaque = _levels(image, average_alpha=entry.mode == "trinary")
    except ValueError as error:
        raise document.error(("image",), str(error)) from None
    p = level / 100 if entry.mode == "raw" else (level if entry.negate else 255 - level) / 255
    known = p <= 1.0 if entry.mode == "raw" else opaque | (entry.mode == "trinary")
    free, occupied = known & (p < entry.free_thresh), known & (p > entry.occupied_thresh)
    saved = free & (shade == UNKNOWN) & (entry.mode != "raw")
    if count := np.count_nonzero(saved):
        greys = np.count_nonzero((shade > OCCUPIED) & (shade < FREE))
        as_unknown = 2 * count > greys if unknown_is_free is None else not unknown_is_free
        how = "taken for unknown, though" if as_unknown else "free, for"
        limit = f"free_thresh {entry.free_thresh:g} makes them free"
        remarks.append(f"{count} cells ({count / saved.size:.2%}) {OF_SHADE} are {how} {limit}")
        free &= ~saved | (not as_unknown)
    unknown = (~free & ~occupied)[::-1]
    cells = np.array(free[::-1] | unknown if unknown_is_free else free[::-1])
    cells.setflags(write=False)
    x, y, yaw = entry.origin
    frame, corner = ((x, y, yaw), (0.0, 0.0)) if yaw else ((0.0, 0.0, 0.0), (x, y))
    cell_grid = CellMap(cells, entry.resolution, corner, frame, unknown)
    return ServedMap(cell_grid, int(unknown.sum()), tuple(remarks), entry.antdrive, frame)


def _levels(path: Path, average_alpha: bool) -> tuple[Floats, Floats, Cells]:
    """Return the brightness and the shade of the pixels, 0..255, and a mask of opaque pixels; all (R, C), top row first.

    Both are means of the channels, the brightness including alpha in map_server's trinary mode.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # MAX_CELLS is lower
            with open_regular(path, kind="an image") as file, Image.open(file, formats=FORMATS) as stored:
                width, height = stored.size
                if width * height > MAX_CELLS:
                    raise ValueError(f"has {height} x {width} pixels; the limit is {MAX_CELLS}")
                image = stored.convert("RGBA" if "transparency" in stored.info else MODES.get(stored.mode, stored.mode))
                if image.mode not in ("L", "LA", "RGB", "RGBA", "I", "I;16", "I;16B"):
                    raise ValueError(f"Pillow reads it as {image.mode}; save it in grey or in colours")
                pixels = np.asarray(image, dtype=np.float64) / (257 if image.mode.startswith("I") else 1)
    except UnidentifiedImageError:
        raise ValueError(f"{path} is not a PGM, PNG or BMP image") from None
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, OverflowError, Image.DecompressionBombError) as error:
        problem = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise ValueError(f"{path} cannot be read: {problem}") from None
    layers = pixels.reshape(height, width, -1)
    if image.mode not in ("LA", "RGBA"):
        shade = layers.mean(axis=2)
        return shade, shade, np.ones((height, width), dtype=np.bool_)
    shade = layers[..., :-1].mean(axis=2)
    return layers.mean(axis=2) if average_alpha else shade, shade, layers[..., -1] == 255


def export_map_server(
    task: Task,
    path: str | Path,
    *,
    resolution: float | None = None,
    tasks: Mapping[str, Task] = MappingProxyType({}),
    replace: bool = False,
) -> Path:
    """Write a world as a map_server map: a YAML file and a PGM image of the same name.

    A cell is occupied if a disc or a wall reaches into it by more than 1 nm; no cell is unknown. Heights are lost. Tasks
    are stored under the key `antdrive`, which map_server ignores and `import_map_server` reads. The map covers the
    world's bounds, in the frame of the world's source map.

    Args:
        task: the world to write
        path: the YAML file
        resolution: side of a cell [m]; by default the task's own
        tasks: other starts and goals in the same world, by name
        replace: whether to replace existing files; the image may be another map's

    Returns:
        The image's path.

    Raises:
        InputError: a file exists or cannot be written, the world has movers, or the resolution is invalid.
    """
    require_no_movers(task, path)
    target = Path(path)
    require_new((target, target.with_suffix(".pgm")), replace=replace)
    cells = cell_map(task.world, task.cell if resolution is None else resolution)
    rows, cols = cells.free.shape
    picture = np.where(cells.free[::-1], FREE, OCCUPIED).astype(np.uint8)
    image = target.with_suffix(".pgm")
    name = image.name.replace("'", "''")
    if not name.isprintable():
        raise input_error(str(target), "the file name of a map must be printable")
    text = (
        f"image: '{name}'\n"
        f"resolution: {yaml_number(cells.resolution)}\n"
        f"origin: {yaml_flow(world_to_map(task.frame, [(*cells.origin, 0.0)])[0].tolist())}\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n"
        "antdrive:\n" + "".join(f"  {line}\n" for line in _ends(task))
    )
    if tasks:
        text += "  tasks:\n"
        text += "".join(
            f"    - {{name: {json.dumps(name)}, {', '.join(_ends(other))}}}\n" for name, other in tasks.items()
        )
    with atomic_write(image) as part:
        part.write_bytes(b"P5\n%d %d\n255\n" % (cols, rows) + picture.tobytes())
    write_text(target, text)
    return image


def _ends(task: Task) -> tuple[str, ...]:
    """Return a task's start, goal and tolerance in its map as YAML entries."""
    return (
        f"start: {yaml_flow(world_to_map(task.frame, [task.start])[0].tolist())}",
        f"goal: {yaml_flow(world_to_map(task.frame, [task.goal])[0].tolist())}",
        f"goal_tolerance: {yaml_number(task.goal_tolerance)}",
    )
