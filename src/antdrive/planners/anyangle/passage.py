"""The exact widest disc that fits from start to goal, and its bottleneck.

A growing disc is blocked when it fills the gap between two obstacles or the free space at an end. These sizes are the
candidates. Bisection finds the largest that passes, using the exact planner among discs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point
from antdrive.planners.anyangle.tangent import shortest
from antdrive.worlds import Task, point_clearance

MOST_OBSTACLES = 1000  # larger worlds take too long
CLOSER = 1e-7  # a disc passes a gap if it is smaller by this; contact closes the gap [m]


@dataclass(frozen=True)
class Passage:
    """The bottleneck on the path of the widest disc from start to goal."""

    radius: float  # radius of that disc [m]
    at: Point  # position of the bottleneck [m]
    # indices of the two obstacles that form it: the world's obstacles, then its left, lower, right and upper wall;
    # empty if the bottleneck is an end
    between: tuple[int, ...] = ()


def feasible(task: Task, clearance: float) -> bool:
    """Return whether a path from start to goal keeps a clearance [m], by the exact shortest path."""
    world = task.world
    return shortest(world.discs, world.bounds, clearance, task.start[:2], task.goal) is not None


def widest_passage(task: Task, most: float) -> Passage | None:
    """Return the bottleneck on the path of the widest disc from the task's start to its goal, up to radius `most` [m].

    None if not even a point passes, or if the world has more than `MOST_OBSTACLES` obstacles.
    """
    world = task.world
    if len(world.obstacles) > MOST_OBSTACLES:
        return None
    radii, places, pairs = _candidates(task, most)
    low, high = 0, len(radii)  # sizes below index `low` pass, those from `high` on do not
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if feasible(task, max(radii[middle] - CLOSER, 0.0)) else (low, middle)
    if low == 0:
        return None
    x, y = places[low - 1].tolist()
    return Passage(float(radii[low - 1]), (x, y), tuple(int(k) for k in pairs[low - 1] if k >= 0))


def _candidates(task: Task, most: float) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """Return the C radii up to `most` at which a gap closes (C,), its place (C, 2) and its obstacles (C, 2), or -1."""
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
    # Discard gaps with another obstacle in the middle.
    order = order[(point_clearance(task.world, all_places[order]) >= all_radii[order] - CLOSER)]
    return all_radii[order], all_places[order], all_pairs[order].astype(np.int64)
