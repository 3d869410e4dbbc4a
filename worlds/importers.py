"""Worlds of other simulators and benchmarks."""

from __future__ import annotations

import math
import os
from pathlib import Path

from worlds.documents import input_error
from worlds.sdf import parse_xml, read_models
from worlds.world import Bounds, Disc, Point, Pose, Task, World

MARGIN = 1.0  # room left around the cylinders when no bounds are given [m]

#: The protocol of the BARN challenge (D. Perille et al., *Benchmarking metric ground navigation*, SSRR 2020).
BARN_START: Pose = (-2.25, 3.0, math.pi / 2)
BARN_GOAL: Point = (-2.25, 13.0)
BARN_TOLERANCE = 1.0  # [m]
#: Cylinders wall three sides of every BARN world and touch these bounds; the goal's side is open.
BARN_BOUNDS: Bounds = (-4.5, 0.0, 0.0, 14.4)
#: The lattice on which BARN's cylinders stand [m]; cells that lie on it lose no passage to rounding.
BARN_CELL = 0.15


def import_sdf(
    path: str | os.PathLike[str],
    *,
    start: Pose | None = None,
    goal: Point | None = None,
    bounds: Bounds | None = None,
    cell: float = 0.25,
    goal_tolerance: float = 0.25,
    skip_unsupported: bool = False,
) -> Task:
    """The upright cylinders of a Gazebo world (SDF, `.world`) as a task.

    Poses of models, links and collisions are composed; those in <state> win over the models' own, as in
    Gazebo. A cylinder's height is that of its top above z = 0. Ground planes, models without collision
    geometry and what lies below the floor are passed over. Without `bounds` the cylinders get 1 m of
    room on all sides; without `start` and `goal` the robot crosses that from the lower left to the upper
    right corner.

    Raises:
        InputError: the file cannot be read, or holds what a world cannot: moving or included models, or
            collision shapes other than upright cylinders. `skip_unsupported` leaves such models out instead.
    """
    file = Path(path)
    root = parse_xml(file)
    world = root.find("world") if root.tag == "sdf" else None
    if world is None:
        raise input_error(str(file), f"must be an <sdf> with a <world> in it, got <{root.tag}>")
    found = read_models(world)
    if found.unsupported and not skip_unsupported:
        more = len(found.unsupported) - 5
        names = ", ".join(found.unsupported[:5]) + (f" and {more} more" if more > 0 else "")
        raise input_error(
            str(file), f"only static models of upright cylinders can be imported; leave out or skip {names}"
        )
    if bounds is None and not found.discs:
        raise input_error(str(file), "holds no upright cylinder; give the bounds")
    box = bounds if bounds is not None else _around(found.discs, start, goal)
    xmin, ymin, xmax, ymax = box
    end = goal if goal is not None else (xmax - MARGIN / 2, ymax - MARGIN / 2)
    if start is None:
        x, y = xmin + MARGIN / 2, ymin + MARGIN / 2
        start = (x, y, math.atan2(end[1] - y, end[0] - x))
    try:
        made = World(file.stem, box, tuple(found.discs), f"imported from {file.name}")
        return Task(made, start, end, goal_tolerance, cell)
    except ValueError as error:
        raise input_error(str(file), str(error)) from None


def import_barn(path: str | os.PathLike[str], *, cell: float = BARN_CELL) -> Task:
    """A world of the BARN set with the challenge's start, goal and tolerance.

    Raises:
        InputError: the file cannot be read or is no such world.
    """
    return import_sdf(
        path, start=BARN_START, goal=BARN_GOAL, bounds=BARN_BOUNDS, cell=cell, goal_tolerance=BARN_TOLERANCE
    )


def _around(discs: list[Disc], start: Pose | None, goal: Point | None) -> Bounds:
    """Bounds with `MARGIN` around the cylinders and the given ends."""
    spots = [(d.x, d.y, d.radius) for d in discs]
    spots += [(end[0], end[1], 0.0) for end in (start, goal) if end is not None]
    return (
        min(x - r for x, _, r in spots) - MARGIN,
        min(y - r for _, y, r in spots) - MARGIN,
        max(x + r for x, _, r in spots) + MARGIN,
        max(y + r for _, y, r in spots) + MARGIN,
    )
