"""Grid maps and problems of the MovingAI benchmarks (N. Sturtevant, *Benchmarks for grid-based pathfinding*, 2012)."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.worlds.files.document import input_error

if TYPE_CHECKING:  # a grid brings the compiler with it
    from antdrive.worlds.grid import Grid

MapCell: TypeAlias = tuple[int, int]  # (row, col)

PASSABLE = b".GS"  # ground, the same, swamp that is walked into from the ground
BLOCKED = b"@OTW"  # out of bounds (two letters), trees, water

MAX_CELLS = 25_000_000  # as in worlds.grid
MAX_BYTES = 100_000_000


@dataclass(frozen=True)
class MapProblem:
    """A start and a goal on a map, with the length of the shortest path as the benchmark prints it."""

    start: MapCell  # (row, col) of our grid: row 0 is the map's last line
    goal: MapCell
    optimal: float  # [cells], octile, corners not cut; rounded as `printed` shows
    printed: str  # as it stands in the file
    map_name: str
    bucket: int  # optimal length // 4


def import_movingai_map(path: str | os.PathLike[str]) -> Grid:
    """The grid of a `.map` file, with cells of 1 m and diagonals that need both orthogonal neighbours free.

    The file's first line of cells is its top, so it becomes the last row: rows grow upwards, as everywhere here, and the map
    looks as it does in the benchmark's pictures.

    Raises:
        InputError: the file cannot be read or is not such a map.
    """
    from antdrive.worlds.grid import Grid

    return Grid.from_free(read_movingai_cells(path))


def read_movingai_cells(path: str | os.PathLike[str]) -> npt.NDArray[np.bool_]:
    """The cells of a `.map` file that are free, (R, C), the file's last line first.

    Raises:
        InputError: the file cannot be read or is not such a map.
    """
    source, lines = _read(path)
    header: dict[str, str] = {}
    rest = iter(enumerate(lines, 1))
    for number, line in rest:
        words = line.decode("ascii", "replace").split()
        if words == ["map"]:
            break
        if len(words) != 2 or words[0] not in ("type", "height", "width") or words[0] in header:
            raise input_error(
                f"{source}:{number}", f"the header must be type, height, width and map, got {_quote(line)}"
            )
        header[words[0]] = words[1]
    else:
        raise input_error(source, "has no line `map` before its cells")
    if header.get("type") != "octile":
        raise input_error(source, f"the type must be octile, got {header.get('type', 'none')!r}")
    rows, cols = (_size(source, key, header.get(key)) for key in ("height", "width"))
    if rows * cols > MAX_CELLS:
        raise input_error(source, f"has {rows} x {cols} cells; the limit is {MAX_CELLS}")
    cells = list(rest)
    while cells and not cells[-1][1]:
        cells.pop()
    if len(cells) != rows:
        raise input_error(source, f"must have {rows} lines of cells as its height says, got {len(cells)}")
    for number, line in cells:
        if len(line) != cols:
            raise input_error(f"{source}:{number}", f"must have {cols} cells as the width says, got {len(line)}")
    picture = np.frombuffer(b"".join(line for _, line in cells), dtype=np.uint8).reshape(rows, cols)
    known = np.isin(picture, np.frombuffer(PASSABLE + BLOCKED, dtype=np.uint8))
    if not known.all():
        row, col = np.argwhere(~known)[0]
        letters = " ".join((PASSABLE + BLOCKED).decode())
        odd = _quote(bytes(picture[row, col : col + 1]))
        raise input_error(f"{source}:{cells[row][0]}", f"cell {col + 1} must be one of {letters}, got {odd}")
    return np.isin(picture, np.frombuffer(PASSABLE, dtype=np.uint8))[::-1]


def import_movingai_problems(path: str | os.PathLike[str]) -> list[MapProblem]:
    """The problems of a `.scen` file, their cells turned into those of `import_movingai_map`.

    Raises:
        InputError: the file cannot be read or is not such a list.
    """
    source, lines = _read(path)
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
        raise input_error(place, f"must hold whole numbers and a length: {error}") from None
    for key, x, y in (("start", x0, y0), ("goal", x1, y1)):
        if not (0 <= x < width and 0 <= y < height):
            raise input_error(place, f"the {key} ({x}, {y}) is outside the map of width {width} and height {height}")
    if not (math.isfinite(optimal) and optimal >= 0):
        raise input_error(place, f"the length must be a number that is not negative, got {words[8]}")
    start, goal = (height - 1 - y0, x0), (height - 1 - y1, x1)
    return MapProblem(start, goal, optimal, words[8], words[1].replace("\\", "/").rsplit("/", 1)[-1], bucket)


def _read(path: str | os.PathLike[str]) -> tuple[str, list[bytes]]:
    """The file's name and its lines without their ends."""
    source = os.fspath(path)
    try:
        with Path(path).open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise input_error(source, "no such file") from None
    except IsADirectoryError:
        raise input_error(source, "is a directory; give a file") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise input_error(source, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > MAX_BYTES:
        raise input_error(source, f"is too large; the limit is {MAX_BYTES // 1_000_000} MB")
    return source, [line.removesuffix(b"\r") for line in content.removesuffix(b"\n").split(b"\n")]


def _size(source: str, key: str, text: str | None) -> int:
    if text is None:
        raise input_error(source, f"has no {key}")
    if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) > 0):
        raise input_error(source, f"the {key} must be a whole number above 0, got {text!r}")
    return int(text)


def _quote(line: bytes) -> str:
    return repr(line[:40].decode("ascii", "backslashreplace"))
