"""Route planner of a drive: grids, queries, checked plans and prepared routes."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds
from antdrive.base.caches import Keyed, bits, cached
from antdrive.planners import (
    AStar,
    Planner,
    PlanResult,
    PlanStatus,
    Query,
    capabilities_of,
    planner_errors,
    replanner_for,
    request_plan,
    require_result,
    validated,
)
from antdrive.planners.plan import Capabilities, Cell
from antdrive.robots import Footprint, PurePursuit, RobotSpec, TrackedPath, outline_of
from antdrive.sim.driving.blockage import closed_cells, with_obstacles
from antdrive.sim.log.streams import random_stream
from antdrive.worlds import Disc, Grid, MoverMotion, Route, Task, World, rasterise
from antdrive.worlds.limits import MAX_CELLS
from antdrive.worlds.raster import Raster
from antdrive.worlds.world import by_geometry

if TYPE_CHECKING:
    from antdrive.planners import Replanner
    from antdrive.sim.driving.movers_ahead import Zone


LONGER = 1.1  # the disc's way may be this much longer than the footprint's
FINE = 0.05  # largest cell of plans for a footprint [m]
# Grids and replanners kept for repair: two margins of the disc for each of two bounds, and up to four of the footprint.
KEPT = 8


class _Kept(NamedTuple):
    """A replanner with what it was told last."""

    replanner: Replanner
    goal: Cell
    closed: npt.NDArray[np.int64]  # flat cells (K,), in ascending order
    grid: Grid
    updates: int  # of the raster of the grid


NO_CELLS = np.empty(0, dtype=np.int64)


@dataclass(eq=False, kw_only=True)
class RoutePlanner:
    """Route planner of one drive, for the first route and all replans.

    Attributes:
        rng: the random stream of replans
        plan_error: error of the planner's first invalid plan; empty if all plans were valid
        footprint_margin: margin of the first plan that kept the footprint clear [m]; None while there is none
    """

    planner: Planner  # finds the paths
    planner_label: str  # its name in records
    task: Task  # the world as the robot knows it, start and goal
    robot: RobotSpec  # drives the routes
    controller: PurePursuit  # follows them
    margin: float  # clearance on top of the robot's radius [m]
    outline_margins: tuple[float, ...]  # clearances of plans for the footprint, in turn until there is a path [m]
    usual_margin: float  # the default for robot, noise and smoothing [m]
    cell: float  # side of the grid cells [m]
    smoothing: str  # how plans become routes
    footprint: str  # the shape that plans keep clear: disc, exact, or auto
    hz: int  # control periods per second
    seed: int  # the seed of the drive's random numbers
    noise: float  # factor on the robot's documented noise
    motions: tuple[MoverMotion, ...] = ()  # motions of the movers, for space-time planners
    mapless: bool = False  # whether plans use the occupancy map instead of the given one
    whole: bool = True  # whether the planner plans whole routes, rather than cell by cell

    def __post_init__(self) -> None:
        self.plan_error = ""
        self.footprint_margin: float | None = None
        self._rasters: dict[tuple[Bounds, float], Raster] = {}
        self.restart()

    def restart(self) -> None:
        """Discard all replanners, and restart the random stream of replans."""
        self.rng = random_stream(self.seed, "replanner")
        self._kept: dict[tuple[float, float, bool, Bounds], _Kept] = {}

    @property
    def inflate(self) -> float:
        """Distance that plans keep between the robot's centre and every surface [m]."""
        return self.robot.radius + self.margin

    @property
    def outlined_cell(self) -> float:
        """Side of the cells of plans for the footprint [m]; iterative planners, and large worlds, have larger ones."""
        fits = math.prod(side + FINE for side in self.task.world.size) <= MAX_CELLS * FINE**2
        return min(self.cell, FINE) if fits else self.cell

    @functools.cached_property
    def can(self) -> Capabilities:
        """The planner's capabilities."""
        return capabilities_of(self.planner)

    @property
    def tries_footprint(self) -> bool:
        """Whether plans may keep the footprint clear instead of the disc."""
        return self.footprint != "disc" and not self.robot.footprint.is_disc and self.plans_footprints

    @property
    def plans_footprints(self) -> bool:
        """Whether the planner plans for footprints; one that decides cell by cell knows no headings."""
        return self.can.turns and self.whole

    @property
    def shapes(self) -> tuple[bool, ...]:
        """The shapes to plan for in turn, until there is a path: the disc (False), the footprint (True)."""
        return {"disc": (False,), "auto": (False, True), "exact": (True,)}[
            self.footprint if self.tries_footprint else "disc"
        ]

    def chosen_grid(self) -> Grid:
        """Return the grid of the first plan.

        With footprint `auto` it is the disc's, unless its shortest path is longer than the footprint's by more than `LONGER`.
        Iterative planners may not arrive on the footprint's finer grid, so they try cells of the task's size first, and the
        finer only where the disc has no path.
        """
        world = by_geometry(self.task.world)
        disc = grid_of(world, self.cell, self.inflate)
        if not self.tries_footprint:
            return disc
        length = self._shortest(disc) if self.footprint == "auto" else math.inf
        cells = [self.outlined_cell]
        if self.can.iterative:
            cells = [self.cell, *(cells if length == math.inf else ())]
        inner = self.robot.footprint.inner_radius + self.outline_margins[-1]
        # No path of the footprint is shorter than that of the disc within it.
        if length <= LONGER * self._shortest(grid_of(world, self.cell, inner)) < math.inf:
            return disc
        for cell, margin in itertools.product(dict.fromkeys(cells), self.outline_margins):
            outlined = outlined_grid_of(world, cell, self.robot.footprint, margin)
            if self._shortest(outlined) * LONGER < length:
                return outlined
        return disc if self.footprint == "auto" else outlined

    def _shortest(self, grid: Grid) -> float:
        """Return the length of the shortest path on a grid [m]."""
        return AStar().plan(Query.between(grid, self.task), random_stream(0, "optimum")).cost

    def query(self, grid: Grid, task: Task, start_time: float = 0.0) -> Query:
        """Return the planner's query at a time [s]."""
        query = Query.between(grid, task)
        timed = bool(self.motions) or start_time
        return dataclasses.replace(query, motions=self.motions, start_time=start_time) if timed else query

    def plan(self, query: Query, rng: np.random.Generator, label: str = "") -> PlanResult:
        """Plan, and check the planner's answer."""
        return self.validated(query, request_plan(self.planner, query, rng, label))

    def validated(self, query: Query, answer: PlanResult) -> PlanResult:
        """Return the answer if it is valid; else note the error and return an invalid plan."""
        plan = validated(query, answer, self.robot.radius)
        if plan.solved and query.grid.turns and self.footprint_margin is None:
            self.footprint_margin = max(query.grid.turns.outline.reach - self.robot.footprint.rounding, 0.0)
        if plan.status is PlanStatus.INVALID:
            self.plan_error = self.plan_error or plan.reason
        return plan

    def around(self, task: Task, grid: Grid, discs: Sequence[Disc] = (), zone: Zone | None = None) -> PlanResult:
        """Replan around discs and a zone.

        Planners that need the world get one with additional discs. Others repair with a replanner and closed cells. Without a
        map and movers to avoid, planners without their own replanner plan from scratch.
        """
        can, moving = self.can, bool(discs) or zone is not None
        if can.needs_world and (not self.mapless or moving):
            task = with_obstacles(task, [*discs, *(zone.discs if zone is not None else ())])
            grid = rasterise(task.world, grid.cell, grid.inflate)
        query = Query.between(grid, task)
        unreachable = PlanResult(status=PlanStatus.NO_PATH, reason=query.unreachable)
        if query.unreachable and self.mapless:
            return unreachable
        if can.needs_world or (self.mapless and not (moving or can.own_replanner)):
            return self.plan(query, self.rng)
        closed = (
            np.flatnonzero(closed_cells(query, discs, zone.blocked if zone is not None else None))
            if moving
            else NO_CELLS
        )
        with planner_errors(self.planner):
            # Without a map, movers change so many cells that repair is no faster than a new search.
            answer = self._replanner(query, closed, kept=not (self.mapless and moving)).result()
            answer = require_result(self.planner, answer)
        # A replanner knows cells only; it cannot tell that the first cell is unreachable for the robot.
        return unreachable if query.unreachable else self.validated(query, answer)

    def observed(self, world: World, margin: float) -> Grid:
        """Return the grid of a map's discs for the disc, updated where they changed; valid until the next call."""
        key = world.bounds, self.robot.radius + margin
        if key not in self._rasters:
            if len(self._rasters) >= KEPT:  # bounds change with a robot that leaves them
                del self._rasters[next(iter(self._rasters))]
            self._rasters[key] = Raster(world.bounds, self.cell, key[1])
        self._rasters[key].update(world.discs)
        return self._rasters[key].grid

    def _replanner(self, query: Query, closed: npt.NDArray[np.int64], *, kept: bool) -> Replanner:
        """Return a replanner with the closed flat cells, kept per grid or new."""
        grid = query.grid
        key = grid.cell, grid.inflate, bool(grid.turns), bounds_of(grid)
        raster = next((raster for raster in self._rasters.values() if raster.grid is grid), None)
        last = self._kept.get(key) if kept else None
        if last is None or last.goal != query.goal:
            replanner, before = replanner_for(self.planner, query, self.rng), NO_CELLS
            if kept and len(self._kept) >= KEPT:
                del self._kept[next(iter(self._kept))]
        else:
            replanner, before = last.replanner, last.closed
            if self.mapless:
                known = raster is not None and last.grid is grid
                replanner.change(grid, raster.changed_since(last.updates) if raster is not None and known else None)
        for tell, some, others in ((replanner.clear, before, closed), (replanner.block, closed, before)):
            if len(some) and len(cells := np.setdiff1d(some, others)):
                tell(np.column_stack(np.divmod(cells, grid.shape[1])))
        replanner.move(query.start, *query.start_headings[:1])
        if kept:
            self._kept[key] = _Kept(replanner, query.goal, closed, grid, raster.updates if raster is not None else 0)
        return replanner

    def prepared(self, route: Route, world: World, margin: float, *options: Any, **settings: Any) -> TrackedPath:
        """Prepare a route for the controller, among the obstacles of a world."""
        period, tolerance = 1 / self.hz, self.task.goal_tolerance
        settings["noise"] = self.noise
        return self.controller.prepare(route, world, self.robot, margin, period, tolerance, *options, **settings)


@cached(4)
def outlined_grid_of(world: Keyed[World], cell: float, footprint: Footprint, margin: float) -> Grid:
    """Rasterise a world for a footprint with a margin."""
    return rasterise(world.value, cell, footprint.radius + margin, outline_of(footprint, margin))


@cached(16)
def grid_of(world: Keyed[World], cell: float, inflate: float) -> Grid:
    """Rasterise a world."""
    return rasterise(world.value, cell, inflate)


def by_contents(grid: Grid, task: Task) -> Keyed[tuple[Grid, Task]]:
    """Return a grid and a task as a cache key over their bits: cells, numbers, walls and static cylinders."""
    numbers = bits(grid.cell, *grid.origin, grid.inflate, *task.start, *task.goal, task.goal_tolerance)
    turns = grid.turns
    arrays = grid.free, grid.moves, turns.label, turns.moves, turns.joints, turns.outline.corners
    sha = hashlib.sha256()  # the arrays of a large grid take 16 MB
    for array in arrays:
        sha.update(np.ascontiguousarray(array).data)
    return Keyed((grid, task), (numbers, grid.shape, sha.digest(), turns.outline.reach, by_geometry(task.world)))


def bounds_of(grid: Grid) -> Bounds:
    """Return the bounds of a grid's world, except for rounding [m]."""
    rows, cols = grid.shape
    x, y = grid.origin
    half = grid.cell / 2
    return x - half, y - half, x + (cols - 0.5) * grid.cell, y + (rows - 0.5) * grid.cell
