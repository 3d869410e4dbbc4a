"""The exact widest disc that fits from start to goal, and its bottleneck.

A growing disc closes the gaps between obstacles in the order of their widths. It no longer passes once closed gaps form
a loop around the start or the goal. Union-find with the parity of crossings detects that loop: n gaps take O(n log n).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from antdrive.base.types import Floats, Point
from antdrive.worlds import _kernels_passage
from antdrive.worlds.geometry import point_clearance, segment_clearance
from antdrive.worlds.world import PointWorld, Task, World

CLOSER = 1e-7  # the widest disc is wider than this, or not even a point passes [m]
ROUNDING = 5e-10  # an end may lack this much clearance; a gap wider than the disc by no more is closed [m]
FIRST = 1 / 16  # gaps are listed up to this fraction of the ends' room first
RINGS, RAYS = 8, 180  # of positions around an end
AROUND = np.array([(math.cos(ray), math.sin(ray)) for ray in np.arange(RAYS) * (2 * math.pi / RAYS)])
PLACES = 4  # largest number of positions kept in place of an end
HALVINGS = 30  # of the step towards the roomiest position

#: How far the ends of a path may be from start and goal [m].
Reach = tuple[float, float]
AT_THE_ENDS: Reach = (0.0, 0.0)


@dataclass(frozen=True)
class Passage:
    """The bottleneck on the path of the widest disc from start to goal."""

    radius: float  # radius of that disc [m]
    at: Point  # position of the bottleneck [m]
    # indices of the two obstacles that form it: the world's obstacles, then its left, lower, right and upper wall;
    # empty if the bottleneck is an end
    between: tuple[int, ...] = ()
    end: str = ""  # "start" or "goal" if the bottleneck is the roomiest position for that end


def feasible(task: Task, clearance: float, reach: Reach = AT_THE_ENDS) -> bool:
    """Return whether a path from start to goal keeps a clearance [m]; contact closes a gap.

    Within `reach` of an end with less clearance, the path may begin or end where a straight line joins the end. That line
    keeps the end's clearance.
    """
    gaps = _Gaps(task.world)
    return any(
        min(room, other) >= clearance - ROUNDING and gaps.closing(start, goal, clearance + ROUNDING) is None
        for (room, start), (other, goal) in _ends(task, reach)
    )


def widest_passage(task: Task, reach: Reach = AT_THE_ENDS) -> Passage | None:
    """Return the bottleneck on the path of the widest disc from the task's start to its goal.

    None if not even a point passes. `reach` is that of `feasible`.
    """
    gaps, best = _Gaps(task.world), None
    for (room, start), (other, goal) in _ends(task, reach):
        least = best.radius if best else CLOSER
        if min(room, other) > least and not (best and gaps.closing(start, goal, least + ROUNDING)):
            best = _widest(gaps, start, goal, room, other)
    return best if best and best.radius > CLOSER else None


def _widest(gaps: _Gaps, start: Point, goal: Point, room: float, other: float) -> Passage:
    """Return the bottleneck between two positions with their clearances [m]."""
    most, fraction = min(room, other), FIRST
    passage = Passage(most, start, (), "start") if room <= other else Passage(most, goal, (), "goal")
    while most > CLOSER and fraction <= 1 and not passage.between:
        passage = gaps.closing(start, goal, fraction * most) or passage
        fraction *= 2
    return passage


def _ends(task: Task, reach: Reach) -> itertools.product[tuple[tuple[float, Point], ...]]:
    """Return all pairs of positions in place of start and goal, each with its clearance, the roomiest first."""
    return itertools.product(_places(task.world, task.start[:2], reach[0]), _places(task.world, task.goal, reach[1]))


def _places(world: World, end: Point, reach: float) -> list[tuple[float, Point]]:
    """Return the roomiest positions joined to an end within a distance, and the end, each with its clearance [m].

    Positions that a wide line joins count once.
    """
    own = float(point_clearance(world, [end])[0])
    discs = world.discs
    near = np.hypot(discs[:, 0] - end[0], discs[:, 1] - end[1]) - discs[:, 2] <= max(own, 0.0) + 2 * reach
    around = _Around(PointWorld.of("around", world.bounds, discs[near]), end, own, reach)
    points = np.reshape(end + reach / RINGS * np.arange(1, RINGS + 1)[:, None, None] * AROUND, (-1, 2))
    rooms = around.rooms(points)
    places: list[tuple[float, Point]] = []
    for k in np.argsort(-rooms, kind="stable").tolist() if reach > 0 else ():
        x, y = points[k].tolist()
        if rooms[k] <= own + CLOSER or len(places) == PLACES:
            break
        if not any(around.line((x, y), at) >= rooms[k] - CLOSER for _, at in places):
            places.append(around.roomiest((x, y), float(rooms[k])))
    return sorted([*places, (own, end)], reverse=True)


@dataclass(frozen=True)
class _Around:
    """The surroundings of an end, with its clearance [m] and how far a path may end from it [m]."""

    world: World
    end: Point
    own: float
    reach: float

    def rooms(self, points: Floats) -> Floats:
        """Return the clearance of positions (N,) [m]; minus infinity for those that no line joins to the end."""
        lines = segment_clearance(self.world, points, np.broadcast_to(self.end, points.shape))
        usable = (lines >= self.own - CLOSER) & (np.hypot(*(points - self.end).T) <= self.reach)
        return np.where(usable, point_clearance(self.world, points), -math.inf)

    def line(self, one: Point, other: Point) -> float:
        """Return the clearance of a straight line [m]."""
        return float(segment_clearance(self.world, [one], [other])[0])

    def roomiest(self, at: Point, room: float) -> tuple[float, Point]:
        """Climb from a position to the roomiest around it; return the clearance and the position [m]."""
        step = self.reach / RINGS
        for _ in range(HALVINGS):
            away = at + step * AROUND - self.end
            far = np.hypot(*away.T)[:, None]
            points = self.end + away * np.minimum(1.0, (self.reach - CLOSER) / np.maximum(far, CLOSER))
            rooms = self.rooms(points)
            k = int(rooms.argmax())
            if rooms[k] > room:
                at, room = (float(points[k, 0]), float(points[k, 1])), float(rooms[k])
            else:
                step /= 2
        return room, at


class _Gaps:
    """The gaps of a world by rising width, listed once up to the widest that is asked for."""

    def __init__(self, world: World) -> None:
        self._discs, self._bounds = world.discs, np.asarray(world.bounds, dtype=np.float64)
        self._most, self._rows = -math.inf, np.empty((0, 3))

    def closing(self, start: Point, goal: Point, most: float) -> Passage | None:
        """Return the gap that separates start from goal when closed after all narrower ones; None if wider than 2 `most`."""
        discs, bounds = self._discs, self._bounds
        if most > self._most:
            order = np.argsort(discs[:, 0] - discs[:, 2], kind="stable")
            rows = _kernels_passage.gaps(discs, order, bounds, 2 * most)
            self._most, self._rows = most, rows[np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))]
        narrow = self._rows[: np.searchsorted(self._rows[:, 0], 2 * most, side="right")]
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
