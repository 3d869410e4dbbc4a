"""BARN's worlds that a robot's footprint crosses: `python -m benchmarks.footprints [TABLE ...]`.

Prints Markdown.

- lattice: worlds that the independent lattice (`benchmarks/lattice.py`) crosses, by the circumscribed disc and by the outline
- plans: times of `astar` in random worlds, median / worst, after a first world
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from antdrive.planners import Query, load_planner
from antdrive.robots import load_robot
from antdrive.robots.clearance import outline_of
from antdrive.runs.pool import call_all
from antdrive.worlds import Task, rasterise
from antdrive.worlds.headings import Outline, turn_clear
from antdrive.worlds.world import PointWorld
from benchmarks.drives import barn_tasks
from benchmarks.lattice import Flood, Point, Shape, flood
from benchmarks.markdown import command_line, print_tables, table
from tools.shared_data import BARN

SMALLEST = ("lattice --worlds 1 --jobs 1", "plans --random 1")
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


def random_task(seed: int, outline: Outline) -> Task:
    """Return a task of 18 x 8 m among 40 to 160 discs; its ends are 10 m apart, and the outline is clear at the start."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(40, 160))
    discs = np.column_stack([rng.uniform(0, 18, count), rng.uniform(0, 8, count), rng.uniform(0.05, 0.25, count)])
    while True:
        start = float(rng.uniform(0, 18)), float(rng.uniform(0, 8)), float(rng.uniform(-math.pi, math.pi))
        goal = float(rng.uniform(0, 18)), float(rng.uniform(0, 8))
        world = PointWorld.of(f"random {seed}", (0.0, 0.0, 18.0, 8.0), discs)
        clear = turn_clear(*start, 0.0, outline, world.discs, world.bounds)
        if (
            clear
            and math.dist(start[:2], goal) >= 10
            and turn_clear(*goal, 0.0, 0.0, outline, world.discs, world.bounds)
        ):
            return Task(world, start, goal, goal_tolerance=0.2, cell=CELL)


class Times(NamedTuple):
    """Times of one plan [s]: processor time of its parts and of all, and the wall time."""

    labels: float  # from the world to the grid with turns
    ends: float
    search: float
    all: float
    wall: float


def timed(task: Task, outline: Outline) -> tuple[Times, bool]:
    """Return the times of a plan with `astar`, and whether there is a path."""
    astar, rng = load_planner("astar"), np.random.default_rng(0)
    radius = float(np.hypot(*outline.corners.T).max()) + outline.reach
    began, used = time.perf_counter(), [time.process_time()]
    grid = rasterise(task.world, CELL, radius, outline)
    used.append(time.process_time())
    query = Query.between(grid, task)
    used.append(time.process_time())
    plan = astar.plan(query, rng)
    used.append(time.process_time())
    return Times(*np.diff(used).tolist(), used[-1] - used[0], time.perf_counter() - began), plan.solved


def plans(given: argparse.Namespace) -> Iterator[str]:
    """Yield the median and the worst times in random worlds."""
    rows = []
    for robot in SIZES:
        outline = outline_of(load_robot(robot).footprint, MARGIN)
        timed(random_task(given.random, outline), outline)  # loads the kernels
        found = [timed(random_task(seed, outline), outline) for seed in range(given.random)]
        parts = zip(*(times for times, _ in found), strict=True)
        cells = [f"{1e3 * statistics.median(part):.1f} / {1e3 * max(part):.1f}" for part in parts]
        rows.append([f"`{robot}`", f"{sum(solved for _, solved in found)} of {len(found)}", *cells])
    yield from table(("robot", "with a path", *(f"{name} [ms]" for name in Times._fields)), rows)


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "lattice"),
        barn=(BARN, "folder or archive of BARN's world_*.world files"),
        worlds=(0, "how many of BARN's worlds; 0: all"),
        jobs=(2, "processes; 0: this one"),
        random=(60, "random worlds"),
    )
    print_tables(given.tables, {"lattice": lattice, "plans": plans}, given)


if __name__ == "__main__":
    main()
