"""Shortest path in the plane among inflated discs: a lower bound for every planner.

A shortest path among discs consists of lines tangent to two discs and of arcs along their rims, as
described for polygons by Lozano-Pérez & Wesley (*An algorithm for planning collision-free paths among
polyhedral obstacles*, CACM 22, 1979) and for curved obstacles by Liu & Arimoto (*Path planning using a
tangent graph for mobile robots among polygonal and curved obstacles*, IJRR 11, 1992).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats, InputError, Point
from antdrive.base.errors import require
from antdrive.planners.anyangle.lines import RouteEnds, cells_along, cells_under, route_ends
from antdrive.planners.graph.search import AStar
from antdrive.planners.plan import Capabilities, GridPlanner, PlanResult, PlanStatus, Query, path_cost
from antdrive.worlds import Task

#: Above this number of discs, a path on the grid bounds the search; below, the bound does not pay off.
MANY_DISCS = 1000
NO_GAP = "no path from start to goal keeps the clearance from discs and walls"


@dataclass(frozen=True)
class Line:
    """A straight piece of a path."""

    start: Point  # first point [m]
    end: Point  # last point [m]

    @property
    def length(self) -> float:
        """Length [m]."""
        return math.dist(self.start, self.end)


@dataclass(frozen=True)
class Arc:
    """A piece of a path along the rim of a disc."""

    centre: Point  # the centre of the disc [m]
    radius: float  # the radius of the inflated disc [m]
    begin: float  # the angle of the first point about the centre [rad]
    sweep: float  # the angle from the first point to the last, positive counter-clockwise [rad]

    @property
    def length(self) -> float:
        """Length [m]."""
        return self.radius * abs(self.sweep)

    def at(self, angle: float, stretch: float = 1.0) -> Point:
        """Return the point `angle` [rad] after the first, at `stretch` radii from the centre [m]."""
        direction = self.begin + math.copysign(angle, self.sweep)
        reach = self.radius * stretch
        return self.centre[0] + reach * math.cos(direction), self.centre[1] + reach * math.sin(direction)

    @property
    def start(self) -> Point:
        """First point [m]."""
        return self.at(0.0)

    @property
    def end(self) -> Point:
        """Last point [m]."""
        return self.at(abs(self.sweep))


@dataclass(frozen=True)
class TangentPath:
    """A smooth path of lines and arcs: each piece continues the last in position and direction.

    Attributes:
        pieces: the lines and arcs in order
        work: number of tangents checked
    """

    pieces: tuple[Line | Arc, ...]
    work: int = 0

    @property
    def length(self) -> float:
        """Length [m]."""
        return math.fsum(piece.length for piece in self.pieces)

    def polyline(self, bulge: float, discs: npt.ArrayLike, bounds: Bounds, inflate: float) -> Floats:
        """Return the path as a polyline (M, 2) [m]; its corners lie outside the arcs, so it never cuts into a disc.

        Args:
            bulge: maximum distance of corners from the arcs [m]; smaller in narrow gaps
            discs: the discs to clear: x, y, radius [m] (N, 3)
            bounds: the walls to clear [m]
            inflate: the clearance to keep [m]
        """
        points = [self.pieces[0].start]
        for piece in self.pieces:
            if isinstance(piece, Arc):
                points += _around(piece, bulge, np.asarray(discs, dtype=np.float64), bounds, inflate)
            points.append(piece.end)
        return np.array(points)


def shortest(
    discs: npt.ArrayLike, bounds: Bounds, inflate: float, start: Point, goal: Point, *, expected: float = math.inf
) -> TangentPath | None:
    """Return the shortest path that stays `inflate` [m] from all discs (N, 3: x, y, radius) and inside the bounds.

    None if there is no such path. Contact closes a gap: nothing passes between two discs exactly 2 `inflate`
    apart. Both ends need the clearance; exactly the clearance suffices. `expected` is an estimate of the length that
    speeds up the search [m].
    """
    from antdrive.planners.anyangle import _kernels_tangent

    inflated = np.array(discs, dtype=np.float64).reshape(-1, 3)
    inflated[:, 2] += inflate
    xmin, ymin, xmax, ymax = map(float, bounds)  # integers would compile every kernel again
    box = np.array([xmin + inflate, ymin + inflate, xmax - inflate, ymax - inflate])
    if not (box[0] <= box[2] and box[1] <= box[3]):
        return None
    both = np.array([start, goal], dtype=np.float64)
    for x, y in both:
        rim = np.hypot(inflated[:, 0] - x, inflated[:, 1] - y) - inflated[:, 2]
        if min(x - box[0], y - box[1], box[2] - x, box[3] - y, *rim) < -_kernels_tangent.EPS:
            return None
    inflated = np.ascontiguousarray(inflated[_kernels_tangent.keep_outer(inflated, box)])
    links, checked = np.empty((0, 6)), 0
    for limit in dict.fromkeys((expected, math.inf)):
        links, _, more = _kernels_tangent.shortest_path(inflated, box, both, limit)
        checked += more
        if len(links):
            break
    if not len(links):
        return None
    pieces = _pieces(links, inflated) or [Line(start, goal)]  # the ends may coincide
    return TangentPath(tuple(pieces), int(checked))


@dataclass(frozen=True, kw_only=True)
class Tangent(GridPlanner):
    """The shortest path in the plane: a lower bound for every planner.

    A* on the tangents between inflated discs (Liu & Arimoto 1992); the result is exact. It plans among the discs
    of the query's world, so it may find a path that the grid is too coarse for. `cells` are then the cells under
    the path, and `cost` is infinite. Ends that lack the clearance connect through their cells' centres, as for
    all planners.

    Known weaknesses, measured (docs/notebook/planner-quality.md): the path grazes discs at exactly the clearance,
    which leaves a driving robot no margin. The number of tangents grows with the square of the number of discs.
    Among 400 discs a plan takes 23 to 52 ms, in a building of 11,937 cylinders 0.69 s; there, planning on a grid
    of 480,000 cells takes less than 10 ms.

    Attributes:
        bulge: maximum distance of the driven polyline's corners from an arc [m]
    """

    bulge: float = 1e-3

    capabilities: ClassVar[Capabilities] = Capabilities(needs_world=True, deterministic=True)

    def __post_init__(self) -> None:
        require("bulge", self.bulge, above=0)

    def untimed(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path, without its planning time and options."""
        return self.search(query, rng)  # the cells of the ends need not be free

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find the shortest path among the discs of the query's world.

        Raises:
            InputError: the query has no task, so there is no world to plan in.
        """
        if query.task is None:
            raise InputError("query: has no task; the tangent planner needs the discs of a world")
        grid, world = query.grid, query.task.world
        ends = route_ends(query, touching=True)
        reason = _unusable_ends(query, query.task, ends)
        path = None
        if not reason:
            most = _expected(query, ends, rng) if len(world.discs) > MANY_DISCS else math.inf
            path = shortest(world.discs, world.bounds, grid.inflate, ends.start, ends.goal, expected=most)
        if path is None:
            return PlanResult(status=PlanStatus.NO_PATH, reason=reason or NO_GAP, work_unit=WORK_UNIT)
        xy = ends.with_leads(path.polyline(self.bulge, world.discs, world.bounds, grid.inflate))
        waypoints = grid.fractional(xy)
        cells = cells_along(query, waypoints) if query.blocked_end is None else np.empty((0, 2), dtype=np.int32)
        cost = path_cost(cells, grid.cell) if len(cells) else math.inf
        if not len(cells):
            cells = cells_under(query, waypoints)
        return PlanResult(
            status=PlanStatus.SOLVED,
            cells=cells,
            cost=cost,
            waypoints=waypoints,
            length=path.length + ends.lead_length,
            work=path.work,
            work_unit=WORK_UNIT,
        )


WORK_UNIT = "tangents checked"


def _expected(query: Query, ends: RouteEnds, rng: np.random.Generator) -> float:
    """Return the length of the shortest path on the grid, including the leads to its ends [m]; infinite without one."""
    answer = AStar().plan(query, rng)
    if not answer.solved:
        return math.inf
    first, last = query.grid.xy(answer.cells[[0, -1]])
    return answer.cost + math.dist(first, ends.start) + math.dist(last, ends.goal) + 1e-6


def _unusable_ends(query: Query, task: Task, ends: RouteEnds) -> str:
    """Return a sentence for each end with neither the clearance nor a usable free cell; or empty."""
    from antdrive.worlds.geometry import point_clearance, segment_clearance

    unusable = []
    legs = (
        ("start", task.start[:2], ends.start, query.start, math.inf),
        ("goal", task.goal, ends.goal, query.goal, task.goal_tolerance),
    )
    for key, exact, used, cell, within in legs:
        if math.dist(exact, used) < 1e-9:
            continue
        own = float(point_clearance(task.world, [exact])[0])
        clear = segment_clearance(task.world, [exact], [used])[0] >= min(query.grid.inflate, own) - 1e-9
        if not (query.grid.free[cell] and clear and math.dist(exact, used) <= within):
            unusable.append(f"the {key} has too little room and no free cell near it can be reached")
    return "; ".join(unusable)


def _pieces(links: Floats, discs: Floats) -> list[Line | Arc]:
    """Return the kernel's lines and the arcs between them, without empty pieces."""
    pieces: list[Line | Arc] = []
    for k, (ax, ay, bx, by, disc, turn) in enumerate(links):
        if math.dist((ax, ay), (bx, by)) > 0.0:
            pieces.append(Line((float(ax), float(ay)), (float(bx), float(by))))
        if disc < 0:
            break
        x, y, radius = (float(v) for v in discs[int(disc)])
        begin = math.atan2(by - y, bx - x)
        leave = math.atan2(links[k + 1, 1] - y, links[k + 1, 0] - x)
        sweep = (turn * (leave - begin)) % math.tau
        if 1e-9 < sweep < math.tau - 1e-7:
            pieces.append(Arc((x, y), radius, begin, float(turn * sweep)))
    return pieces


def _around(arc: Arc, bulge: float, discs: Floats, bounds: Bounds, inflate: float) -> list[Point]:
    """Return corners around an arc: the intersections of its tangents at successive points.

    The points are evenly spaced, and closer together where a corner would violate the clearance.
    """
    from antdrive.worlds._kernels import segment_clearances

    half = math.acos(arc.radius / (arc.radius + bulge))
    count = max(1, math.ceil(abs(arc.sweep) / (2.0 * half)))
    cuts = np.linspace(0.0, abs(arc.sweep), count + 1)
    while True:
        half_widths, middles = np.diff(cuts) / 2.0, (cuts[1:] + cuts[:-1]) / 2.0
        rim = np.array([arc.at(cut) for cut in cuts])
        corners = np.array([arc.at(m, 1.0 / math.cos(h)) for m, h in zip(middles, half_widths, strict=True)])
        clearances = np.empty((2, len(corners)))
        box = np.asarray(bounds, dtype=np.float64)
        segment_clearances(np.ascontiguousarray(rim[:-1]), corners, discs, box, clearances[0])
        segment_clearances(corners, np.ascontiguousarray(rim[1:]), discs, box, clearances[1])
        tight = (clearances.min(axis=0) < inflate - 1e-9) & (half_widths > 1e-5)
        if not tight.any():
            return [(float(x), float(y)) for x, y in corners]
        cuts = np.sort(np.concatenate((cuts, middles[tight])))
