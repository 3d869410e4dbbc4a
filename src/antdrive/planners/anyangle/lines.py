"""Straight lines, their ends and the cells along them, for any-angle planners."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point
from antdrive.base.plane import polyline_length
from antdrive.planners.plan import Cells, Query
from antdrive.worlds.route import longest_line

if TYPE_CHECKING:  # importing kernels loads the compiler
    from antdrive.planners.anyangle._kernels_lines import Terrain

CONTACT = 5e-10  # an end that lacks no more than this of the clearance has exactly the clearance [m]


class RouteEnds(NamedTuple):
    """The ends of the part of a route that keeps the clearance, with straight leads from and to the exact ends."""

    start: Point  # start of the part that keeps the clearance [m]
    goal: Point  # end of that part [m]
    # the exact start if it lacks the clearance; a straight line leads to `start`
    lead_in: tuple[Point, ...] = ()
    # the exact goal if it has exactly the clearance; a straight line leads there from `goal`
    lead_out: tuple[Point, ...] = ()

    @property
    def lead_length(self) -> float:
        """Total length of both leads [m]."""
        return polyline_length([*self.lead_in, self.start]) + polyline_length([self.goal, *self.lead_out])

    def with_leads(self, xy: npt.ArrayLike) -> Floats:
        """Add both leads to a polyline from `start` to `goal`; returns the route (M, 2) [m]."""
        parts = [np.reshape(part, (-1, 2)) for part in (self.lead_in, xy, self.lead_out)]
        return np.vstack(parts).astype(np.float64)


def route_ends(query: Query, *, touching: bool = False) -> RouteEnds:
    """Return the exact start and goal of the query's task; without a task, the centres of its end cells.

    From a start with less than the clearance, the robot leaves on the straight line to the centre of its cell, which
    `Query.between` has checked. For such a goal, the route ends at the centre of its cell. A goal with exactly the
    clearance is reached from that centre.
    """
    (start, goal) = (_point(xy) for xy in query.grid.xy([query.start, query.goal]))
    if query.task is None:
        return RouteEnds(start, goal)
    from antdrive.worlds.geometry import point_clearance

    inflate = query.grid.inflate
    exact_start, exact_goal = _point(query.task.start[:2]), _point(query.task.goal)
    clearances = [float(r) for r in point_clearance(query.task.world, [exact_start, exact_goal])]
    fits = [r >= inflate - CONTACT if touching else r > inflate for r in clearances]
    return RouteEnds(
        exact_start if fits[0] else start,
        exact_goal if fits[1] else goal,
        () if fits[0] else (exact_start,),
        (exact_goal,) if not fits[1] and clearances[1] >= inflate - CONTACT else (),
    )


def terrain(query: Query) -> Terrain:
    """Return the terrain for straight lines: the discs of the query's world or, without a task, its free cells."""
    from antdrive.planners.anyangle._kernels_lines import Terrain

    grid, task = query.grid, query.task
    discs = np.empty((0, 3)) if task is None else task.world.discs
    discs[:, 2] += grid.inflate
    bounds = np.zeros(4) if task is None else np.asarray(task.world.bounds, dtype=np.float64)
    x0, y0 = grid.origin
    return Terrain(discs, bounds, float(grid.inflate), grid.free, float(x0), float(y0), float(grid.cell), task is None)


def clear_line(query: Query, start: Point, goal: Point) -> bool:
    """Return whether the straight line between two points [m] keeps the clearance; contact counts as too close.

    With a world, the exact distance to discs and walls decides. On a bare grid, every cell that the line touches,
    even at a corner, must be free.
    """
    from antdrive.planners.anyangle import _kernels_lines

    return bool(_kernels_lines.clear_line(terrain(query), *map(float, (*start, *goal))))


def cells_along(query: Query, waypoints: npt.ArrayLike) -> Cells:
    """Return a path of allowed moves along a polyline in fractional cells; empty if there is none.

    It is the shortest path within a corridor around the polyline; the corridor widens until it contains a path.
    If the line loops or runs beside itself, that path would take a shortcut. The path then goes leg by leg, from the
    cell of one waypoint to that of the next.
    """
    line = np.ascontiguousarray(waypoints, dtype=np.float64).reshape(-1, 2)
    whole = np.vstack([query.start, line, query.goal]).astype(np.float64)
    cells = _shortest_beside(query, whole)
    leads = math.dist(query.start, line[0]) + math.dist(line[-1], query.goal)
    if not len(cells) or polyline_length(line) <= longest_line(polyline_length(cells), leads, 1.0):
        return cells
    parts = [cells[:1]]
    for cell in [*_passed(query, line), query.goal]:
        leg = _shortest_beside(query, np.array([parts[-1][-1], cell], dtype=np.float64))
        if len(leg) > 1:  # 1: the same cell as the last; 0: unreachable
            parts.append(leg[1:])
    return np.asarray(np.vstack(parts), dtype=np.int32)


def _passed(query: Query, line: Floats) -> list[tuple[int, int]]:
    """Return the cells of a line's points (M, 2) in fractional cells, without blocked cells."""
    cells = np.clip(np.floor(line + 0.5).astype(np.int64), 0, np.array(query.grid.shape) - 1)
    return [(int(row), int(col)) for row, col in cells if query.grid.free[row, col]]


def _shortest_beside(query: Query, line: Floats) -> Cells:
    """Return the shortest path between the first and last cell of a line within a corridor around it."""
    from antdrive.planners.anyangle import _kernels_lines
    from antdrive.planners.graph import _kernels_search

    moves, width, graph = query.grid.moves, 1.0, query.grid.graph
    start, goal = (row * graph.cols + col for row, col in line[[0, -1]].astype(int).tolist())
    while True:
        within = width < max(query.grid.shape)
        near = _kernels_lines.corridor_moves(moves, line, width) if within else moves
        near.setflags(write=False)  # the search is compiled for read-only moves, like a grid's
        cells, _, _, _ = _kernels_search.shortest_path(graph._replace(mask=near.ravel()), start, goal, True)
        if len(cells) or not within:
            return np.asarray(cells, dtype=np.int32)
        width *= 2.0


def cells_under(query: Query, waypoints: npt.ArrayLike) -> Cells:
    """Return the cells under a polyline in fractional cells, each a neighbour of the last; they need not be free."""
    line = np.asarray(waypoints, dtype=np.float64).reshape(-1, 2)
    line = np.vstack([query.start, line, query.goal])
    parts = [line[:1]]
    for a, b in itertools.pairwise(line):
        steps = max(1, math.ceil(2 * np.abs(b - a).max()))  # with steps of a whole cell, rounding may skip one
        parts.append(a + np.linspace(0.0, 1.0, steps + 1)[1:, None] * (b - a))
    cells = np.floor(np.vstack(parts) + 0.5).astype(np.int32)
    cells = np.clip(cells, 0, np.array(query.grid.shape, dtype=np.int32) - 1)
    fresh = np.ones(len(cells), dtype=np.bool_)
    fresh[1:] = np.any(np.diff(cells, axis=0) != 0, axis=1)
    return np.asarray(cells[fresh], dtype=np.int32)


def _point(xy: npt.ArrayLike) -> Point:
    x, y = np.asarray(xy, dtype=np.float64)
    return float(x), float(y)
