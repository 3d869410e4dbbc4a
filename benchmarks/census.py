"""Public robots, maps and worlds, imported as their owners would: python -m benchmarks.census FOLDER.

FOLDER holds the repositories of `census.csv` as FOLDER/OWNER+NAME; `python -m benchmarks.census --clone FOLDER | sh` makes them
with git. No file of theirs is kept here: each has its own licence. GAZEBO_MODEL_PATH names FOLDER/osrf+gazebo_models, which
Gazebo downloads by itself.

Every row runs `antdrive robots import` or `antdrive worlds import` in FOLDER, with the row's arguments, and is judged by what is
expected of it. A map must cover no free cell, and every blocked cell beside the ground that start or goal is connected to. In a
world, a random task on the largest ground is driven and must be certified. `--only M` takes the rows whose number begins with M:
R are robots, M maps and W worlds. `--page FILE` writes the tables of `docs/notebook/census.md`.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from antdrive import sweep
from antdrive.base.errors import InputError
from antdrive.robots import load_robot
from antdrive.worlds import cell_map, load_task, save_task
from antdrive.worlds.formats.cellmap import largest_ground
from antdrive.worlds.formats.map_server import read_map
from benchmarks.markdown import command_line, table

SMALLEST = ("--clone somewhere",)
ROWS = Path(__file__).with_suffix(".csv")
KINDS = {"R": "Robots", "M": "Maps", "W": "Worlds"}
LIMIT = 300  # of a command [s]
ROBOT, FASTER = "turtlebot3-burger", "jackal"  # drive in worlds; the second where cells are larger than CELL
CELL, MOST_CELLS = 0.1, 4_000_000  # of the drives' grids [m]
LONGEST, SHARES = (
    25.0,
    (0.5, 0.25, 0.1),
)  # least distance of start and goal: at most [m], and shares of the world's diagonal
SLACK = 1e-6  # of the checks of cells [m]
RIGHT, AFTER, REFUSED = "right at once", "right after remedy", "refused rightly"
WRONGLY, MISLEADS, SILENT = "refused wrongly", "reason misleads", "silently wrong"
DRIVE, BROKEN, ABSENT = "drive fails", "breaks off", "not fetched"
GOOD = (RIGHT, AFTER, REFUSED)


class Row(NamedTuple):
    """A file, and what is expected of its import.

    `expected` is import, refuse or both; `word` is a pattern that the output or the written file must have; `remedy` has the
    arguments that a refusal names.
    """

    id: str
    name: str
    repository: str
    commit: str
    licence: str
    path: str
    arguments: str
    expected: str
    word: str
    remedy: str

    @property
    def folder(self) -> str:
        """The folder of the repository in FOLDER."""
        return self.repository.replace("/", "+")


class Outcome(NamedTuple):
    """How an import ended."""

    row: Row
    kind: str  # one of the words above
    said: str  # the first line that says why
    seconds: float


def read_rows(file: Path = ROWS) -> list[Row]:
    """Read the rows of a census."""
    with file.open(newline="", encoding="utf-8") as lines:
        return [Row(**line) for line in csv.DictReader(lines)]


def clone_lines(rows: Sequence[Row], folder: str) -> Iterator[str]:
    """Yield the shell commands that fetch the repositories of some rows."""
    for repository, commit in dict.fromkeys((row.repository, row.commit) for row in rows):
        where = shlex.quote(f"{folder}/{repository.replace('/', '+')}")
        yield f"git clone https://github.com/{repository} {where} && git -C {where} checkout --quiet {commit}"


def outcome(row: Row, folder: Path) -> Outcome:
    """Import a row's file and judge what happens."""
    began = time.perf_counter()
    path = folder / row.folder / row.path
    kind, said = judged(row, folder) if path.is_file() else (ABSENT, row.path)
    return Outcome(row, kind, said, time.perf_counter() - began)


def judged(row: Row, folder: Path) -> tuple[str, str]:
    """Return the kind of a row's outcome and a line that explains it."""
    with tempfile.TemporaryDirectory() as scratch:
        written = Path(scratch) / "imported.yaml"
        code, said = imported(row, row.arguments, folder, written)
        remedied = code == 2 and row.remedy and "refuse" not in row.expected
        if remedied:
            code, said = imported(row, f"{row.arguments} {row.remedy}", folder, written)
        said = said.replace(f"{row.folder}/{row.path}: ", "").replace("antdrive: ", "").replace(scratch, "")
        lines = said.strip().splitlines() or [""]
        if code not in (0, 2):
            return BROKEN, lines[-1]
        text = said + (written.read_text(encoding="utf-8") if code == 0 else "")
        has_word = re.search(row.word, text, re.IGNORECASE) is not None
        if code == 2:
            if "refuse" not in row.expected:
                return WRONGLY, lines[-1]
            return REFUSED if has_word else MISLEADS, lines[-1]
        if "import" not in row.expected:
            return SILENT, f"imported: {lines[0]}"
        if not has_word:
            return SILENT, f"says nothing of {row.word}: {lines[0]}"
        kind, why = checked(row, folder, written)
        return (AFTER if remedied and kind == RIGHT else kind), why or lines[0]


def imported(row: Row, arguments: str, folder: Path, written: Path) -> tuple[int, str]:
    """Run a row's import in the folder; return its exit code and what it prints."""
    group = "robots" if row.id.startswith("R") else "worlds"
    words = [f"{row.folder}/{row.path}", *shlex.split(arguments), "--out", str(written)]
    command = [sys.executable, "-m", "antdrive", group, "import", *words]
    env = os.environ | {"GAZEBO_MODEL_PATH": str(folder / "osrf+gazebo_models")}
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=LIMIT,
            stdin=subprocess.DEVNULL,
            check=False,
            env=env,
        )
    except subprocess.TimeoutExpired:
        return -1, f"no answer in {LIMIT} s"
    said = done.stdout + done.stderr
    return (-1 if "Traceback" in said or "internal error" in said else done.returncode), said


def checked(row: Row, folder: Path, written: Path) -> tuple[str, str]:
    """Check an imported robot, map or world; return the kind of the outcome and why, or what the robot is."""
    if row.id.startswith("M"):
        over, under = wrong_cells(folder / row.folder / row.path, written, free="--unknown free" in row.arguments)
        return (SILENT, f"{over} free cells covered, {under} blocked ones not") if over or under else (RIGHT, "")
    if row.id.startswith("W"):
        return driven(written)
    spec = load_robot(written)
    sizes = f"radius {spec.radius:.3g} m, wheels {spec.track:.3g} m apart, {spec.mass:.3g} kg"
    return RIGHT, f"{sizes}, {spec.max_speed:.3g} m/s"


def wrong_cells(path: Path, written: Path, free: bool) -> tuple[int, int]:
    """Return how many free cells of a map_server map are covered, and how many blocked ones beside used ground are not.

    A blocked cell is covered if nine points are: its corners, the middles of its sides and its own; a free cell if its middle is.
    """
    cells, task = read_map(path, unknown_is_free=True if free else None).cells, load_task(written)
    labels, _ = ndimage.label(cells.free)
    spots = [cells.cell_at(*end) for end in (task.start[:2], task.goal)]
    used = np.isin(labels, [labels[spot] for spot in spots if spot]) & cells.free
    half, (x0, y0) = cells.resolution / 2, cells.origin
    rows, cols = cells.free.shape
    points = np.zeros((2 * rows + 1, 2 * cols + 1), dtype=np.bool_)
    for x, y, radius in task.world.discs.tolist():
        reach = radius + SLACK
        low, left = (max(0, math.ceil((v - reach) / half)) for v in (y - y0, x - x0))
        high, right = (max(0, math.floor((v + reach) / half) + 1) for v in (y - y0, x - x0))
        dy, dx = (np.arange(a, b) * half - v for a, b, v in ((low, high, y - y0), (left, right, x - x0)))
        window = points[low:high, left:right]
        window |= np.hypot(dy[: len(window), None], dx[None, : window.shape[1]]) <= reach
    whole = np.ones((rows, cols), dtype=np.bool_)
    for i, j in np.ndindex(3, 3):
        whole &= points[i : i + 2 * rows - 1 : 2, j : j + 2 * cols - 1 : 2]
    needed = ndimage.binary_dilation(used, np.ones((3, 3))) & ~cells.free
    xmin, ymin, xmax, ymax = task.world.bounds
    for axis, middles, low, high in (
        (0, y0 + half + 2 * half * np.arange(rows), ymin, ymax),
        (1, x0 + half + 2 * half * np.arange(cols), xmin, xmax),
    ):
        needed &= np.expand_dims((middles > low) & (middles < high), 1 - axis)  # beyond the bounds are walls
    return int((used & points[1::2, 1::2]).sum()), int((needed & ~whole).sum())


def driven(written: Path) -> tuple[str, str]:
    """Drive one random task on the largest ground of a world file; return the kind of the outcome and why."""
    task = load_task(written)
    cell = max(CELL, math.sqrt(math.prod(task.world.size) / MOST_CELLS))
    start, goal = largest_ground(cell_map(task.world, cell))
    save_task(dataclasses.replace(task, start=start, goal=goal), target := written.with_name("ground.yaml"))
    xmin, ymin, xmax, ymax = task.world.bounds
    why = ""
    for share in SHARES:
        least = min(LONGEST, share * math.hypot(xmax - xmin, ymax - ymin))
        campaign = {
            "worlds": [str(target)],
            "planners": ["astar"],
            "robots": [ROBOT if cell == CELL else FASTER],
            "tasks": {"random": 1, "seed": 1, "min_distance": least},
            "settings": {"cell": cell, "footprint": "disc"},
        }
        try:
            (run,) = sweep(campaign, written.with_name(f"drive-{share}"), jobs=0).table.to_pylist()
        except InputError as error:  # such as no two points so far apart
            why = str(error)
            continue
        driven = f"{len(task.world.discs)} cylinders, {run['driven_length_m']:.1f} m in {run['duration_s']:.0f} s"
        return (RIGHT, f"{driven}, certified") if run["certified"] else (DRIVE, f"{run['outcome']}: {run['reason']}")
    return DRIVE, why


def result_rows(outcomes: Sequence[Outcome], links: bool) -> Iterator[tuple[str, ...]]:
    """Yield the cells of the outcomes' table."""
    for row, kind, said, seconds in outcomes:
        name = row.name
        if links:
            name = f"[{name}](https://github.com/{row.repository}/blob/{row.commit}/{row.path})"
        words = f"{row.arguments} {row.remedy if kind == AFTER else ''}".strip()
        said = said.replace("|", "\\|")
        shown = (f"`{words}`" if words else "", f"**{kind}**" if kind not in GOOD else kind, said[:160])
        yield (row.id, name, row.licence, *shown) if links else (*(row.id, name), *shown[1:], f"{seconds:.1f}")


def summary(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, ...]]:
    """Yield a line for each kind of files: how many outcomes of each kind."""
    kinds = (*GOOD, WRONGLY, MISLEADS, SILENT, DRIVE, BROKEN, ABSENT)
    for letter, name in KINDS.items():
        counts = Counter(one.kind for one in outcomes if one.row.id.startswith(letter))
        if counts:
            yield name.lower(), str(counts.total()), *(str(counts[kind]) for kind in kinds)


def page(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the lines of the notebook's page."""
    yield "# Public robots, maps and worlds"
    yield ""
    yield "Files of public repositories, imported with the arguments that their owners would give. None of them is part of"
    yield "antdrive: each has the licence that its package or its repository states. `python -m benchmarks.census --clone FOLDER`"
    yield "prints the git commands that fetch them. A refusal is right if the file has no differential drive or no whole"
    yield "world, and its line says so. Models of Gazebo's own database are those of `osrf/gazebo_models`."
    yield ""
    yield from table(SUMMARY, summary(outcomes))
    for letter, name in KINDS.items():
        yield f"## {name}"
        yield ""
        yield f"`python -m benchmarks.census FOLDER --only {letter}`"
        yield ""
        mine = [one for one in outcomes if one.row.id.startswith(letter)]
        yield from table("# | file | licence | arguments | outcome | what it says", result_rows(mine, links=True))


SUMMARY = ["files", "N", *GOOD, WRONGLY, MISLEADS, SILENT, DRIVE, BROKEN, ABSENT]


def main() -> int:
    given = command_line(
        __doc__,
        folder=([], "the folder of the repositories"),
        clone=(False, "print the git commands that fetch the repositories into the folder"),
        rows=(str(ROWS), "the table of files"),
        only=("", "take the rows whose number begins so"),
        page=(str, "write a page of tables"),
    )
    (folder,) = given.folder
    rows = read_rows(Path(given.rows))
    if given.clone:
        print("\n".join(clone_lines(rows, folder)))
        return 0
    outcomes = []
    for row in rows:
        if row.expected != "package" and row.id.startswith(given.only):
            outcomes.append(outcome(row, Path(folder).resolve()))
            print(" | ".join(next(result_rows(outcomes[-1:], links=False))), flush=True)
    print()
    print("\n".join(table(SUMMARY, summary(outcomes))))
    if given.page:
        Path(given.page).write_text("\n".join(page(outcomes)).rstrip() + "\n", encoding="utf-8")
    return int(any(one.kind not in GOOD for one in outcomes))


if __name__ == "__main__":
    sys.exit(main())
