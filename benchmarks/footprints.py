"""BARN's worlds that a robot's footprint crosses: `python -m benchmarks.footprints [lattice]`.

Prints Markdown.

- lattice: worlds that the independent lattice (`benchmarks/lattice.py`) crosses, by the circumscribed disc and by the outline
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

from antdrive.runs.pool import call_all
from benchmarks.drives import barn_tasks
from benchmarks.lattice import Flood, Point, Shape, flood
from benchmarks.markdown import command_line, print_tables, table
from tools.shared_data import BARN

SMALLEST = ("lattice --worlds 1 --jobs 1",)
MARGIN = 0.03  # [m]
CELL = 0.05  # [m]
SIZES = {"husky": (0.99, 0.67, 0.0), "warehouse": (0.90, 0.60, 0.15)}  # length, width, middle ahead of the axle [m]
SEARCHES = {"disc": 8, "8 headings": 8, "16 headings": 16}


def rectangle(length: float, width: float, ahead: float) -> list[Point]:
    """Return the corners of a rectangle whose middle is `ahead` of the axle [m]."""
    ends = ahead - length / 2, ahead + length / 2
    return [(x, y) for x in ends for y in (-width / 2, width / 2)]


def shape(robot: str, search: str) -> Shape:
    """Return the outline of a robot, or its disc, with the margin."""
    corners = rectangle(*SIZES[robot])
    if search == "disc":
        return Shape([(0.0, 0.0)], MARGIN + max(math.hypot(x, y) for x, y in corners))
    return Shape(corners, MARGIN)


def flooded(task: Any, robot: str, search: str) -> Flood:
    """Flood one world."""
    world = task.world
    args = (shape(robot, search), world.discs, world.bounds, task.start, task.goal, task.goal_tolerance)
    return flood(*args, cell=CELL, headings=SEARCHES[search])


@cache
def crossed(source: Path, worlds: int, jobs: int, robot: str, search: str) -> dict[str, bool]:
    """Return by world whether the lattice crosses it."""
    tasks = dict(list(barn_tasks(source).items())[: worlds or None])
    floods = call_all((partial(flooded, task, robot, search) for task in tasks.values()), jobs)
    return {name: one.crossed for name, one in zip(tasks, floods, strict=True)}


def lattice(given: argparse.Namespace) -> Iterator[str]:
    """Yield the worlds crossed by each outline."""
    rows = []
    for robot, (length, width, ahead) in SIZES.items():
        found = [crossed(given.barn, given.worlds, given.jobs, robot, search) for search in SEARCHES]
        counts = [f"{sum(one.values())} of {len(one)}" for one in found]
        rows.append([f"`{robot}`, {length:.2f} × {width:.2f} m, middle {ahead:g} m ahead of the axle", *counts])
    yield from table(("robot", *SEARCHES), rows)


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "lattice"),
        barn=(BARN, "folder or archive of BARN's world_*.world files"),
        worlds=(0, "how many of BARN's worlds; 0: all"),
        jobs=(2, "processes; 0: this one"),
    )
    print_tables(given.tables, {"lattice": lattice}, given)


if __name__ == "__main__":
    main()
