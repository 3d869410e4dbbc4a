"""The exact widest disc that fits from start to goal, and its bottleneck.

A growing disc closes the gaps between obstacles in the order of their widths. It no longer passes once closed gaps form
a loop around the start or the goal. Union-find with the parity of crossings detects that loop: n gaps take O(n log n).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antdrive.base.types import Floats, Point
from antdrive.worlds import _kernels_passage
from antdrive.worlds.geometry import point_clearance
from antdrive.worlds.world import Task, World

CLOSER = 1e-7  # the widest disc is wider than this, or not even a point passes [m]
ROUNDING = 5e-10  # an end may lack this much clearance; a gap wider than the disc by no more is closed [m]
FIRST = 1 / 16  # gaps are listed up to this fraction of the ends' room first


@dataclass(frozen=True)
class Passage:
    """The bottleneck on the path of the widest disc from start to goal."""

    radius: float  # radius of that disc [m]
    at: Point  # position of the bottleneck [m]
    # indices of the two obstacles that form it: the world's obstacles, then its left, lower, right and upper wall;
    # empty if the bottleneck is an end
    between: tuple[int, ...] = ()


def feasible(task: Task, clearance: float) -> bool:
    """Return whether a path from start to goal keeps a clearance [m]; contact closes a gap."""
    ends = task.start[:2], task.goal
    room = float(point_clearance(task.world, ends).min())
    return room >= clearance - ROUNDING and _closing(task.world, *ends, clearance + ROUNDING) is None


def widest_passage(task: Task) -> Passage | None:
    """Return the bottleneck on the path of the widest disc from the task's start to its goal.

    None if not even a point passes.
    """
    ends = task.start[:2], task.goal
    rooms = point_clearance(task.world, ends)
    most, fraction = float(rooms.min()), FIRST
    passage = Passage(most, ends[int(rooms.argmin())])
    while most > CLOSER and fraction <= 1 and not passage.between:
        passage = _closing(task.world, *ends, fraction * most) or passage
        fraction *= 2
    return passage if passage.radius > CLOSER else None


def _closing(world: World, start: Point, goal: Point, most: float) -> Passage | None:
    """Return the gap that separates start from goal when closed after all narrower ones; None if wider than 2 `most`."""
    discs, bounds = world.discs, np.asarray(world.bounds, dtype=np.float64)
    order = np.argsort(discs[:, 0] - discs[:, 2], kind="stable")
    narrow = _kernels_passage.gaps(discs, order, bounds, 2 * most)
    narrow = narrow[np.lexsort((narrow[:, 2], narrow[:, 1], narrow[:, 0]))]
    k = _kernels_passage.separating(narrow, discs, bounds, np.asarray(start), np.asarray(goal))
    if k < 0:
        return None
    i, j = narrow[k, 1:].astype(int).tolist()
    return Passage(float(narrow[k, 0]) / 2, _middle(discs, bounds, i, j, narrow[k, 0]), (i, j))


def _middle(discs: Floats, bounds: Floats, i: int, j: int, width: float) -> Point:
    """Return the middle of the gap between disc i and disc or wall j [m]."""
    here, wall = discs[i, :2], j - len(discs)
    there = discs[j, :2] if wall < 0 else np.where(np.arange(2) == wall % 2, bounds[wall], here)
    away = there - here
    x, y = (here + away * ((discs[i, 2] + width / 2) / (np.hypot(*away) or 1.0))).tolist()
    return x, y
