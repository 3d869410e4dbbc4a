"""The widest disc that gets from a start to a goal, and the narrowest place on its way. Exact.

As a disc grows, its way closes when it fills the gap between two obstacles, or the room at an end. So the widest disc is
found among these sizes, by halving, with the exact planner among discs to tell whether a size still passes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point
from antdrive.planners.anyangle.tangent import shortest
from antdrive.worlds import Task, point_clearance

MOST_OBSTACLES = 1000  # in larger worlds the search takes too long
CLOSER = 1e-7  # a gap passes discs that are smaller by this; contact closes it [m]


@dataclass(frozen=True)
class Passage:
    """The narrowest place on the way of the widest disc that gets from the start to the goal."""

    radius: float  # of that disc [m]
    at: Point  # the narrowest place: x, y [m]
    # the two obstacles that form it, counting the world's obstacles and then its left, lower, right and upper
    # wall; empty where an end has the least room
    between: tuple[int, ...] = ()


def feasible(task: Task, clearance: float) -> bool:
    """Whether a path exists from start to goal that keeps a clearance [m], by the exact shortest path."""
    world = task.world
    return shortest(world.discs, world.bounds, clearance, task.start[:2], task.goal) is not None


def widest_passage(task: Task, most: float) -> Passage | None:
    """The narrowest place on the way of the widest disc from the task's start to its goal.

    None if not even a point gets there, or in worlds of more than `MOST_OBSTACLES`.
    """
    world = task.world
    if len(world.obstacles) > MOST_OBSTACLES:
        return None
    radii, places, pairs = _candidates(task, most)
    low, high = 0, len(radii)  # the sizes before `low` pass, those from `high` on do not
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if feasible(task, max(radii[middle] - CLOSER, 0.0)) else (low, middle)
    if low == 0:
        return None
    x, y = places[low - 1].tolist()
    return Passage(float(radii[low - 1]), (x, y), tuple(int(k) for k in pairs[low - 1] if k >= 0))


def _candidates(task: Task, most: float) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """The radii (C,) up to `most` at which something closes; where (C, 2); between what (C, 2), or -1."""
    discs, (xmin, ymin, xmax, ymax) = task.world.discs, task.world.bounds
    x, y, r = discs.T
    count = len(discs)
    first, second = np.triu_indices(count, 1)
    dx, dy = x[second] - x[first], y[second] - y[first]
    away = np.hypot(dx, dy)
    gap = away - r[first] - r[second]
    fraction = (r[first] + gap / 2) / np.where(away > 0, away, 1.0)
    radii = [gap / 2]
    places = [np.stack([x[first] + fraction * dx, y[first] + fraction * dy], axis=1)]
    pairs = [np.stack([first, second], axis=1)]
    walls = (x - r - xmin, y - r - ymin, xmax - x - r, ymax - y - r)
    middles = (
        np.stack([xmin + walls[0] / 2, y], axis=1),
        np.stack([x, ymin + walls[1] / 2], axis=1),
        np.stack([xmax - walls[2] / 2, y], axis=1),
        np.stack([x, ymax - walls[3] / 2], axis=1),
    )
    for k, (room, middle) in enumerate(zip(walls, middles, strict=True)):
        radii.append(room / 2)
        places.append(middle)
        pairs.append(np.stack([np.arange(count), np.full(count, count + k)], axis=1))
    for ex, ey in (task.start[:2], task.goal):
        room = min(ex - xmin, ey - ymin, xmax - ex, ymax - ey, *(np.hypot(x - ex, y - ey) - r))
        radii.append(np.array([room]))
        places.append(np.array([[ex, ey]]))
        pairs.append(np.array([[-1, -1]]))
    middle = np.array([(xmin + xmax) / 2, (ymin + ymax) / 2])
    radii.append(np.array([min(task.world.size) / 2]))
    places.append(middle[None])
    pairs.append(np.array([[count, count + 2] if xmax - xmin < ymax - ymin else [count + 1, count + 3]]))
    all_radii, all_places, all_pairs = np.concatenate(radii), np.concatenate(places), np.concatenate(pairs)
    order = np.argsort(all_radii, kind="stable")
    order = order[(all_radii[order] > CLOSER) & (all_radii[order] <= most)]
    # A gap with something else in its middle is none.
    order = order[(point_clearance(task.world, all_places[order]) >= all_radii[order] - CLOSER)]
    return all_radii[order], all_places[order], all_pairs[order].astype(np.int64)
