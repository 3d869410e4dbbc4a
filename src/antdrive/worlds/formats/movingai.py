"""Maps and problems of the MovingAI benchmarks (N. Sturtevant, *Benchmarks for grid-based pathfinding*, 2012).

A `.map` file begins with the map's top line, which becomes the last row: rows run upwards, as in `Grid`.
"""

from __future__ import annotations

import glob
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.atomic import atomic_write, write_text
from antdrive.base.errors import FieldError, few, input_error
from antdrive.base.files import read_bytes
from antdrive.base.types import Point, Pose
from antdrive.worlds.files.world_file import require_no_movers
from antdrive.worlds.formats.cellmap import CellMap, cell_map, file_task
from antdrive.worlds.limits import MAX_CELLS
from antdrive.worlds.world import Task

if TYPE_CHECKING:  # importing Grid loads the compiler
    from antdrive.worlds.grid import Grid

MapCell: TypeAlias = tuple[int, int]  # (row, col)

PASSABLE = b".GS"  # ground (. and G), swamp (S), passable from ground
BLOCKED = b"@OTW"  # out of bounds (@ and O), trees (T), water (W)

MAX_BYTES = 100_000_000
MOST_NAMES = 3  # of .scen files in a message


@dataclass(frozen=True)
class MapProblem:
    """A planning problem on a map, with the length of the shortest path.

    Attributes:
        start: (row, col); row 0 is the map's last line
        goal: (row, col)
        optimal: length of the shortest octile path without corner cutting [cells], rounded as in the file
        printed: the same length as text in the file
        map_name: the map's file name
        bucket: length / 4, rounded down
    """

    start: MapCell
    goal: MapCell
    optimal: float
    printed: str
    map_name: str
    bucket: int


def import_movingai_map(path: str | os.PathLike[str]) -> Grid:
    """Import a `.map` file as a grid with cells of 1 m; diagonals require both orthogonal neighbours free.

    Raises:
        InputError: the file is unreadable or not a MovingAI map.
    """
    from antdrive.worlds.grid import Grid

    return Grid.from_free(_read_cells(path))


def import_movingai_task(
    path: str | os.PathLike[str],
    *,
    start: Pose | None = None,
    goal: Point | None = None,
    problem: int | None = None,
    resolution: float = 1.0,
    overhang: float | None = None,
    cell: float | None = None,
    goal_tolerance: float | None = None,
    scen: str | os.PathLike[str] | None = None,
    anywhere: bool = False,
) -> Task:
    """Import a `.map` file as a world of discs; see `map_task`. `import_movingai_map` keeps the map's own cells.

    Args:
        path: the `.map` file; its lower left corner becomes (0, 0)
        start: the robot's start pose [m, m, rad]; required without a problem, unless `anywhere`
        goal: the goal position [m]; required without a problem, unless `anywhere`
        problem: index, from 0, of the `.scen` file's problem that gives start and goal
        resolution: side of the map's cells [m]
        overhang: largest protrusion of discs beyond blocked cells [m]; see `map_task`
        cell: the task's grid resolution [m]; by default the map's
        goal_tolerance: largest distance from the goal at the stop [m]; by default 0.25
        scen: the `.scen` file of the problem; by default the only one beside the map that begins with the map's name
        anywhere: whether start and goal, if neither is given, lie on the largest connected ground

    Raises:
        InputError: a file or an option is invalid, the problem does not exist, or `map_task` refuses the map.
    """
    file = Path(path)
    if not (math.isfinite(resolution) and resolution > 0):
        raise input_error("resolution", f"must be greater than 0, got {resolution:g}")
    cells = CellMap(_read_cells(file), resolution)
    source = f"the MovingAI map {file.name}"
    if problem is not None:
        if start is not None or goal is not None:
            raise input_error("problem", "has its own start and goal; give either the problem or start and goal")
        scen = _scen_of(file) if scen is None else Path(scen)
        problems = import_movingai_problems(scen)
        if not 0 <= problem < len(problems):
            raise input_error(str(scen), f"has the problems 0 to {len(problems) - 1}, got {problem}")
        chosen = problems[problem]
        (r0, c0), (r1, c1) = chosen.start, chosen.goal
        for key, (r, c) in (("start", chosen.start), ("goal", chosen.goal)):
            if r < len(cells.free) and c < cells.free.shape[1] and not cells.free[r, c]:
                at = f"x = {c}, y = {len(cells.free) - 1 - r}"
                why = f"the {key} {at} is on a blocked cell of {file.name}; y counts from its first line"
                raise input_error(f"{scen}: problem {problem}", why)
        start = (c0 + 0.5) * resolution, (r0 + 0.5) * resolution, math.atan2(r1 - r0, c1 - c0)
        goal = (c1 + 0.5) * resolution, (r1 + 0.5) * resolution
        source += f", problem {problem} of optimal length {chosen.printed} on its cells"
    return file_task(
        file,
        cells,
        start,
        goal,
        source=source,
        overhang=overhang,
        cell=cell,
        goal_tolerance=goal_tolerance,
        anywhere=anywhere,
    )


def _scen_of(file: Path) -> Path:
    """Return a map's `.scen` file: NAME.map.scen, or the only NAME-*.scen, as MAPF's benchmarks call them."""
    usual = file.with_name(f"{file.name}.scen")
    others = [] if usual.exists() else sorted(file.parent.glob(f"{glob.escape(file.stem)}*.scen"))
    if len(others) > 1:
        names = few((other.name for other in others), MOST_NAMES)
        raise FieldError("scen", f"choose one of {names}")
    return others[0] if others else usual


def _read_cells(path: str | os.PathLike[str]) -> npt.NDArray[np.bool_]:
    """Read the free cells of a `.map` file, (R, C), the file's last line first."""
    source, lines = _read_lines(path)
    numbered = iter(enumerate(lines, 1))
    rows, cols = _read_header(source, numbered)
    cells = list(numbered)
    while cells and not cells[-1][1]:
        cells.pop()
    if len(cells) != rows:
        raise input_error(source, f"must have {rows} lines of cells, as its height says, got {len(cells)}")
    for number, line in cells:
        if len(line) != cols:
            raise input_error(f"{source}:{number}", f"must have {cols} cells, as the width says, got {len(line)}")
    picture = np.frombuffer(b"".join(line for _, line in cells), dtype=np.uint8).reshape(rows, cols)
    known = np.isin(picture, np.frombuffer(PASSABLE + BLOCKED, dtype=np.uint8))
    if not known.all():
        row, col = np.argwhere(~known)[0]
        letters = " ".join((PASSABLE + BLOCKED).decode())
        odd = _quote(bytes(picture[row, col : col + 1]))
        raise input_error(f"{source}:{cells[row][0]}", f"cell {col + 1} must be one of {letters}, got {odd}")
    return np.isin(picture, np.frombuffer(PASSABLE, dtype=np.uint8))[::-1]


def _read_header(source: str, lines: Iterable[tuple[int, bytes]]) -> tuple[int, int]:
    """Read rows and columns from the numbered lines up to the line `map`."""
    header: dict[str, str] = {}
    for number, line in lines:
        words = line.decode("ascii", "replace").split()
        if words == ["map"]:
            break
        if len(words) != 2 or words[0] not in ("type", "height", "width") or words[0] in header:
            problem = f"the header must be type, height, width and map, got {_quote(line)}"
            raise input_error(f"{source}:{number}", problem)
        header[words[0]] = words[1]
    else:
        raise input_error(source, "has no line `map` before its cells")
    if header.get("type") != "octile":
        raise input_error(source, f"the type must be octile, got {header.get('type', 'none')!r}")
    rows, cols = (_size(source, key, header.get(key)) for key in ("height", "width"))
    if rows * cols > MAX_CELLS:
        raise input_error(source, f"has {rows} x {cols} cells; the limit is {MAX_CELLS}")
    return rows, cols


def _size(source: str, key: str, text: str | None) -> int:
    if text is None:
        raise input_error(source, f"has no {key}")
    if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) > 0):
        raise input_error(source, f"the {key} must be a whole number above 0, got {text!r}")
    return int(text)


def import_movingai_problems(path: str | os.PathLike[str]) -> list[MapProblem]:
    """Import the problems of a `.scen` file, on the cells of `import_movingai_map`.

    Raises:
        InputError: the file is unreadable or not a list of problems.
    """
    source, lines = _read_lines(path)
    head = lines[0].decode("ascii", "replace").split() if lines else []
    if len(head) != 2 or head[0] != "version" or head[1] not in ("1", "1.0"):
        raise input_error(f"{source}:1", f"must be `version 1`, got {_quote(lines[0] if lines else b'')}")
    return [_problem(f"{source}:{number}", line) for number, line in enumerate(lines[1:], 2) if line.strip()]


def _problem(place: str, line: bytes) -> MapProblem:
    words = line.decode("utf-8", "replace").split("\t" if b"\t" in line else None)
    if len(words) != 9:
        raise input_error(
            place, f"must be bucket, map, width, height, start x, y, goal x, y and length, got {len(words)} values"
        )
    try:
        bucket, width, height, x0, y0, x1, y1 = (int(words[i]) for i in (0, 2, 3, 4, 5, 6, 7))
        optimal = float(words[8])
    except ValueError as error:
        raise input_error(place, f"must be whole numbers and a length: {error}") from None
    for key, x, y in (("start", x0, y0), ("goal", x1, y1)):
        if not (0 <= x < width and 0 <= y < height):
            raise input_error(place, f"the {key} ({x}, {y}) is outside the map of width {width} and height {height}")
    if not (math.isfinite(optimal) and optimal >= 0):
        raise input_error(place, f"the length must be a number of at least 0, got {words[8]}")
    start, goal = (height - 1 - y0, x0), (height - 1 - y1, x1)
    return MapProblem(start, goal, optimal, words[8], words[1].replace("\\", "/").rsplit("/", 1)[-1], bucket)


def _read_lines(path: str | os.PathLike[str]) -> tuple[str, list[bytes]]:
    """Return a file's name and its lines without line ends."""
    content = read_bytes(path, MAX_BYTES)
    return os.fspath(path), [line.removesuffix(b"\r") for line in content.removesuffix(b"\n").split(b"\n")]


def _quote(line: bytes) -> str:
    return repr(line[:40].decode("ascii", "backslashreplace"))


def export_movingai_map(task: Task, path: str | Path, *, resolution: float | None = None) -> CellMap:
    """Write a world as a `.map` file and return its cells. The file stores neither resolution nor origin.

    A cell is blocked if a disc or a wall reaches into it by more than 1 nm.

    Args:
        task: the world to write
        path: the `.map` file
        resolution: side of a cell [m]; by default the task's own

    Raises:
        InputError: the file cannot be written, the world has movers, or the resolution is invalid.
    """
    require_no_movers(task, path)
    cells = cell_map(task.world, task.cell if resolution is None else resolution)
    rows, cols = cells.free.shape
    lines = [bytes(row).decode("ascii") for row in np.where(cells.free[::-1], ord("."), ord("@")).astype(np.uint8)]
    text = "\n".join([f"type octile\nheight {rows}\nwidth {cols}\nmap", *lines]) + "\n"
    with atomic_write(path) as part:
        part.write_text(text, encoding="ascii", newline="\n")
    return cells


def export_movingai_problems(problems: Iterable[MapProblem], shape: tuple[int, int], path: str | Path) -> None:
    """Write problems as a `.scen` file.

    Args:
        problems: in order
        shape: rows and columns of the map
        path: the `.scen` file

    Raises:
        InputError: the file cannot be written.
    """
    rows, cols = shape
    lines = ["version 1"]
    for p in problems:
        (r0, c0), (r1, c1) = p.start, p.goal
        values = (p.bucket, p.map_name, cols, rows, c0, rows - 1 - r0, c1, rows - 1 - r1, p.printed)
        lines.append("\t".join(map(str, values)))
    write_text(path, "\n".join(lines) + "\n")
