"""What planners share that are not bound to the grid's eight directions: straight lines, ends, cells beside a line."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.planners.plan import Cells, Query
from antdrive.worlds import Floats, Point

if TYPE_CHECKING:  # brings the compiler with it
    from antdrive.planners.anyangle._kernels_lines import Terrain

ROOM = 5e-10  # m: an end that falls short of the clearance by no more than this just has it


class Ends(NamedTuple):
    """Where a line that keeps its clearance starts and stops [m], and what the driven line has beyond that."""

    first: Point
    last: Point
    before: tuple[Point, ...] = ()  # the exact start, where it has too little room itself
    after: tuple[Point, ...] = ()  # the exact goal, where it is driven to but not within the clearance

    def joined(self, xy: npt.ArrayLike) -> Floats:
        """The driven line (M, 2) [m] around a polyline from `first` to `last`."""
        parts = [np.reshape(part, (-1, 2)) for part in (self.before, xy, self.after)]
        return np.vstack(parts).astype(np.float64)


def ends(query: Query, *, touching: bool = False) -> Ends:
    """The exact start and goal of the query's task, else the centres of its end cells.

    An end with too little room is left, or reached, on the straight line to the centre of its cell, which
    `Query.between` has found clear; a goal that lies closer to something than the clearance asks is reached at
    that centre. `touching` also accepts ends whose room is just the clearance.
    """
    (start, goal) = (_point(xy) for xy in query.grid.xy([query.start, query.goal]))
    if query.task is None:
        return Ends(start, goal)
    from antdrive.worlds.geometry import point_clearance

    inflate = query.grid.inflate
    exact_start, exact_goal = _point(query.task.start[:2]), _point(query.task.goal)
    room = [float(r) for r in point_clearance(query.task.world, [exact_start, exact_goal])]
    fits = [r >= inflate - ROOM if touching else r > inflate for r in room]
    return Ends(
        exact_start if fits[0] else start,
        exact_goal if fits[1] else goal,
        () if fits[0] else (exact_start,),
        (exact_goal,) if not fits[1] and room[1] >= inflate - ROOM else (),
    )


def terrain(query: Query) -> Terrain:
    """Where straight lines may run: among the discs of the query's world, or over the free cells of a bare grid."""
    from antdrive.planners.anyangle._kernels_lines import Terrain

    grid, task = query.grid, query.task
    discs = np.empty((0, 3)) if task is None else task.world.discs
    discs[:, 2] += grid.inflate
    bounds = np.zeros(4) if task is None else np.asarray(task.world.bounds, dtype=np.float64)
    x0, y0 = grid.origin
    return Terrain(discs, bounds, float(grid.inflate), grid.free, float(x0), float(y0), float(grid.cell), task is None)


def clear_line(query: Query, start: Point, goal: Point) -> bool:
    """Whether the straight line between two points [m] keeps the clearance; contact alone is too close.

    With a world this is the exact distance to discs and walls. On a bare grid the line must keep to free cells:
    none that it touches, be it by a corner, is blocked.
    """
    from antdrive.planners.anyangle import _kernels_lines as _kernels_anyangle

    return bool(_kernels_anyangle.clear_line(terrain(query), *map(float, (*start, *goal))))


def cells_along(query: Query, waypoints: npt.ArrayLike) -> Cells:
    """A path of allowed moves from start to goal beside a polyline in fractional cells; empty if there is none.

    It is the shortest one within a corridor about the polyline, which widens until it holds a path.
    """
    from antdrive.planners.anyangle import _kernels_lines as _kernels_anyangle
    from antdrive.planners.graph import _kernels_search

    line = np.ascontiguousarray(waypoints, dtype=np.float64).reshape(-1, 2)
    line = np.vstack([query.start, line, query.goal]).astype(np.float64)
    moves, width = query.grid.moves, 1.0
    while True:
        within = width < max(query.grid.shape)
        near = _kernels_anyangle.corridor_moves(moves, line, width) if within else moves
        near.setflags(write=False)  # as a grid's own are, for which the search is compiled
        cells, _, _, _ = _kernels_search.shortest_path(near, *query.start, *query.goal, True)
        if len(cells) or not within:
            return np.asarray(cells, dtype=np.int32)
        width *= 2.0


def cells_under(query: Query, waypoints: npt.ArrayLike) -> Cells:
    """The cells beneath a polyline in fractional cells, each a neighbour of the one before; they need not be free."""
    line = np.asarray(waypoints, dtype=np.float64).reshape(-1, 2)
    line = np.vstack([query.start, line, query.goal])
    parts = [line[:1]]
    for a, b in itertools.pairwise(line):
        steps = max(1, math.ceil(np.abs(b - a).max()))
        parts.append(a + np.linspace(0.0, 1.0, steps + 1)[1:, None] * (b - a))
    cells = np.floor(np.vstack(parts) + 0.5).astype(np.int32)
    cells = np.clip(cells, 0, np.array(query.grid.shape, dtype=np.int32) - 1)
    fresh = np.ones(len(cells), dtype=np.bool_)
    fresh[1:] = np.any(np.diff(cells, axis=0) != 0, axis=1)
    return np.asarray(cells[fresh], dtype=np.int32)


def _point(xy: npt.ArrayLike) -> Point:
    x, y = np.asarray(xy, dtype=np.float64)
    return float(x), float(y)
