"""Import of the BARN set (D. Perille, A. Truong, X. Xiao, P. Stone, *Benchmarking metric ground navigation*, SSRR 2020)."""

from __future__ import annotations

import math
import os

from antdrive.base.types import Bounds, Point, Pose
from antdrive.worlds.formats.sdf import import_sdf
from antdrive.worlds.world import Task

#: Start, goal and tolerance [m] of the BARN challenge.
BARN_START: Pose = (-2.25, 3.0, math.pi / 2)
BARN_GOAL: Point = (-2.25, 13.0)
BARN_TOLERANCE = 1.0
#: In every BARN world a row of cylinders along each of three sides touches these bounds; the goal's side is open.
BARN_BOUNDS: Bounds = (-4.5, 0.0, 0.0, 14.4)
#: The spacing of the lattice on which BARN's cylinders stand [m]; a grid of these cells loses no passage to rounding.
BARN_CELL = 0.15


def import_barn(path: str | os.PathLike[str], *, cell: float = BARN_CELL) -> Task:
    """Import a `.world` file of the BARN set with the challenge's start, goal and tolerance, and a grid of cells of `cell` [m].

    Raises:
        InputError: the file is unreadable or not a world of static upright cylinders.
    """
    return import_sdf(
        path, start=BARN_START, goal=BARN_GOAL, bounds=BARN_BOUNDS, cell=cell, goal_tolerance=BARN_TOLERANCE
    )
