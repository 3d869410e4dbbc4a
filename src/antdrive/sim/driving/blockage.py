"""Blocked routes: ground that movers will cover, gaps beside standing movers, and goals that movers cut off.

Plans keep the safety margin from movers; local avoidance keeps a larger clearance. A replan could therefore send a
waiting robot back into the same narrow gap. The guide notes the mover and plans with the clearance of avoidance. If no
other route exists and all movers have stood still since, the robot passes at the safety margin, as it passes a
cylinder. If it has to wait again, it does not retry.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point, Pose
from antdrive.base.plane import format_position
from antdrive.base.records import derived
from antdrive.planners import Query
from antdrive.planners.graph.search import reachable
from antdrive.robots import TrackedPath
from antdrive.sim.driving.perceived_movers import PerceivedMovers
from antdrive.sim.policy import ReplanPolicy
from antdrive.worlds import Disc, Grid, Task, rasterise
from antdrive.worlds.world import PointWorld

STEP = 0.25  # longest time between predicted positions [s]
MIN_RADIUS = 0.01  # smaller discs are omitted [m]
STILL = 0.05  # a mover that stays within this distance stands still [m]
GAP_RANGE = 3.0  # length of the route ahead that is checked for gaps [m]
GAP_STEP = 0.05  # spacing of the checked points [m]
GAP_SLACK = 0.05  # avoidance may refuse gaps up to this much wider than its clearance [m]
STANDING_STEP = 1.0  # time step of the check whether a prediction starts to move [s]


def covered_discs(
    predictor: PerceivedMovers,
    tick: int,
    ends: Floats,
    duration: float,
    grid: Grid,
    only: npt.NDArray[np.int64] | None = None,
    wider: float = 0.0,
) -> list[Disc]:
    """Return the discs that movers cover within `duration` [s] of a tick.

    `only` selects movers by number; `wider` [m] is added to their radii.

    Discs shrink where their inflation would cover one of the `ends` (N, 2) [m], so movers close neither end. The
    first end is the robot's position.
    """
    x, y = ends[0].tolist()
    times = np.linspace(0.0, duration, 1 + math.ceil(duration / STEP))
    positions, radii = predictor.predict(tick, (x, y), times)
    if only is not None:
        wanted = np.isin(predictor.within_range(tick, (x, y)), only)
        positions, radii = positions[:, wanted], radii[wanted]
    room = np.hypot(*np.moveaxis(positions[:, :, None] - ends, -1, 0)).min(axis=-1) - grid.inflate - grid.cell
    radius = np.minimum(radii + wider, room)
    return [
        Disc(float(positions[k, m, 0]), float(positions[k, m, 1]), float(radius[k, m]))
        for k, m in np.argwhere(radius > MIN_RADIUS).tolist()
    ]


def blocked_cells(grid: Grid, discs: Sequence[Disc]) -> npt.NDArray[np.bool_]:
    """Return which free cells (R, C) have their centre within a disc grown by the grid's inflation."""
    rows, cols = grid.shape
    x = grid.origin[0] + grid.cell * np.arange(cols)
    y = grid.origin[1] + grid.cell * np.arange(rows)
    blocked = np.zeros(grid.shape, dtype=np.bool_)
    for disc in discs:
        reach = disc.radius + grid.inflate
        c0, c1 = np.searchsorted(x, (disc.x - reach, disc.x + reach))
        r0, r1 = np.searchsorted(y, (disc.y - reach, disc.y + reach))
        near = np.hypot(x[None, c0:c1] - disc.x, y[r0:r1, None] - disc.y) <= reach
        blocked[r0:r1, c0:c1] |= near
    return blocked & grid.free


def closed_cells(
    query: Query, discs: Sequence[Disc], blocked: npt.NDArray[np.bool_] | None = None
) -> npt.NDArray[np.bool_]:
    """Return the cells (R, C) closed by discs and those of a zone, except the start and the goal."""
    closed = blocked_cells(query.grid, discs)
    if blocked is not None:
        closed |= blocked
    closed[query.start] = closed[query.goal] = False
    return closed


def close_route(discs: list[Disc], tracked: TrackedPath, arc: float, reach: float, inflate: float) -> bool:
    """Return whether a disc is closer than `inflate` [m] to the route within `reach` [m] beyond an arc length [m]."""
    ahead = np.arange(arc, min(arc + reach, tracked.length), 0.1)
    if not discs or not len(ahead):
        return False
    movers = np.array([(disc.x, disc.y, disc.radius) for disc in discs])
    gaps = np.hypot(*np.moveaxis(points_at(tracked, ahead)[:, None] - movers[None, :, :2], -1, 0)) - movers[:, 2]
    return bool((gaps < inflate).any())


def points_at(tracked: TrackedPath, arcs: Floats) -> Floats:
    """Return the points (N, 2) of a route at arc lengths (N,) [m]."""
    route = tracked.route
    return np.stack([np.interp(arcs, route.arc, route.xy[:, k]) for k in (0, 1)], axis=1)


def with_obstacles(task: Task, discs: Sequence[Disc]) -> Task:
    """Add obstacles to a task's world, in plan view."""
    if not discs:
        return task
    more = np.array([(disc.x, disc.y, disc.radius) for disc in discs])
    world = PointWorld.of(task.world.name, task.world.bounds, np.concatenate((task.world.discs, more)))
    return derived(task, world=world)


class Blockage:
    """Failed searches behind standing movers, and the narrow gaps beside such movers.

    Movers in motion may open a route and do not count. While the same movers stand where they stood at the first
    failure, the wait before the next search doubles.

    Attributes:
        failures: failed searches in a row
        reason: which mover blocks the robot and where, once the robot's patience is over; else empty
    """

    def __init__(
        self, task: Task, grid: Grid, predictor: PerceivedMovers, hz: int, policy: ReplanPolicy, keeps: float
    ) -> None:
        self.failures, self.reason = 0, ""
        self._keeps = keeps
        self._gaps: dict[int, tuple[float, float]] = {}  # positions of the noted movers
        self._widths: dict[int, float] = {}  # clearance of plans from their surfaces [m]
        self._passed: set[int] = set()  # noted movers that the robot passes at the safety margin
        self._refused: set[int] = set()  # passed movers beside which it had to wait again
        self._all = np.empty((0, 2))  # positions of all movers when the last one was noted
        self._task, self._grid, self._predictor, self._hz = task, grid, predictor, hz
        self._interval, self._patience = policy.min_interval, policy.patience
        self._since = self._due = -math.inf
        self._standing: npt.NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._places = np.empty((0, 2))

    def pause(self, tick: int, position: Point) -> bool:
        """Return whether a search now would repeat the last one."""
        if not self.failures:
            return False
        if not self._still_there(tick, position):
            self.route_found()
            return False
        return tick / self._hz < self._due

    def route_found(self) -> None:
        """Reset the count of failed searches: a route exists, or may open soon."""
        self.failures = 0

    def failed(self, tick: int, pose: Pose) -> None:
        """Count a search from a pose [m, m, rad] that found no route."""
        now, position = tick / self._hz, pose[:2]
        standing = self.standing(tick, position)
        if self.failures and not self._closed(tick, pose, np.intersect1d(standing, self._standing)):
            self.route_found()
        if not self.failures:
            if not self._closed(tick, pose, standing):
                return
            self._since, self._standing = now, standing
            self._places = self._predictor.perceived(tick, position)[1][standing]
        self.failures += 1
        if now - self._since >= self._patience:
            self.reason = self._sentence(tick, pose)
        wait = self._interval * 2.0 ** min(self.failures - 1, 30)
        self._due = min(now + wait, max(self._since + self._patience, now + self._interval))

    def may_pass(self, tick: int, position: Point) -> bool:
        """Allow passing noted movers at the safety margin after a failure, if all movers have stood still since."""
        if not self.failures:
            return False
        noted = np.setdiff1d(self._noted(tick, position), [*self._passed, *self._refused])
        perceived, positions = self._predictor.perceived(tick, position)
        if not len(noted) or not np.isin(perceived, self.standing(tick, position)).all():
            return False
        if len(positions) != len(self._all):  # a new mover is perceived
            return False
        if not (np.hypot(*(positions - self._all)[perceived].T) <= STILL).all():
            return False
        self._passed |= set(noted.tolist())
        return True

    def note_gaps(self, tick: int, position: Point, tracked: TrackedPath, arc: float) -> None:
        """Note the standing movers that the route ahead passes too closely for avoidance; noted ones need more each time."""
        standing = self.standing(tick, position)
        if self._keeps <= self._grid.inflate or not len(standing):
            return
        ahead = np.arange(arc, min(arc + GAP_RANGE, tracked.length), GAP_STEP)
        points, positions = points_at(tracked, ahead), self._predictor.perceived(tick, position)[1]
        noted = self._noted(tick, position)
        for m in standing.tolist():
            gap = np.hypot(*(points - positions[m]).T).min(initial=np.inf) - self._predictor.radius_of(m)
            width = self._widths[m] if m in noted else self._keeps
            if gap < width + GAP_SLACK:
                self._widths[m] = max(width, gap + GAP_SLACK)
                self._gaps[m] = (float(positions[m, 0]), float(positions[m, 1]))
                self._all = positions
                if m in self._passed:
                    self._passed.remove(m)
                    self._refused.add(m)

    def _noted(self, tick: int, position: Point) -> npt.NDArray[np.int64]:
        """Return the noted movers (N,) that stand where they stood."""
        positions = self._predictor.perceived(tick, position)[1]
        self._gaps = {m: at for m, at in self._gaps.items() if np.hypot(*(positions[m] - at)) <= STILL}
        self._passed &= self._gaps.keys()
        self._refused &= self._gaps.keys()
        return np.array(sorted(self._gaps), dtype=np.int64)

    def discs(self, tick: int, ends: Floats, only: npt.NDArray[np.int64] | None = None) -> list[Disc]:
        """Return the noted movers as discs, enlarged so that plans keep the clearance of avoidance."""
        noted = self._noted(tick, (float(ends[0, 0]), float(ends[0, 1])))
        wanted = np.setdiff1d(noted if only is None else np.intersect1d(noted, only), list(self._passed))
        discs: list[Disc] = []
        for m in wanted:
            wider = self._widths[int(m)] - self._grid.inflate
            discs += covered_discs(self._predictor, tick, ends, 0.0, self._grid, np.array([m]), wider)
        return discs

    def clearance_reduction(self, tick: int, position: Point) -> Floats:
        """Return how much closer than usual the robot may pass each perceived mover (P,) [m]."""
        perceived = self._predictor.within_range(tick, position)
        if not self._passed:
            return np.zeros(len(perceived))
        passed = np.isin(perceived, self._noted(tick, position)) & np.isin(perceived, list(self._passed))
        return np.where(passed, self._keeps - self._grid.inflate, 0.0)

    def standing(self, tick: int, position: Point) -> npt.NDArray[np.int64]:
        """Return the perceived movers (S,) that are predicted to stand still for as long as the robot's patience."""
        perceived = self._predictor.within_range(tick, position)
        ahead = np.linspace(0.0, self._patience, 1 + math.ceil(self._patience / STANDING_STEP))
        positions, _ = self._predictor.predict(tick, position, ahead)
        return np.asarray(perceived[np.hypot(*np.moveaxis(positions - positions[0], -1, 0)).max(axis=0) <= STILL])

    def _still_there(self, tick: int, position: Point) -> bool:
        """Return whether all movers of the first failure are perceived where they stood."""
        perceived, positions = self._predictor.perceived(tick, position)
        near = np.hypot(*(positions[self._standing] - self._places).T) <= STILL
        return bool(near.all() and np.isin(self._standing, perceived).all())

    def _closed(self, tick: int, pose: Pose, movers: npt.NDArray[np.int64]) -> bool:
        """Return whether these movers alone close every route that is open without them."""
        return bool(len(movers)) and self._way(tick, pose, movers[:0]) and not self._way(tick, pose, movers)

    def _way(self, tick: int, pose: Pose, movers: npt.NDArray[np.int64], narrow: bool = False) -> bool:
        """Return whether the grid has a route to the goal among these movers; `narrow` also counts refused gaps."""
        task = dataclasses.replace(self._task, start=pose)
        ends: Floats = np.array([pose[:2], task.goal])
        discs = covered_discs(self._predictor, tick, ends, 0.0, self._grid, only=movers)
        discs += [] if narrow else self.discs(tick, ends, only=movers)
        world = with_obstacles(task, discs).world
        return reachable(Query.between(rasterise(world, self._grid.cell, self._grid.inflate), task))

    def _sentence(self, tick: int, pose: Pose) -> str:
        """Name the nearest mover that alone blocks the robot, else the nearest of all, with its position and the time."""
        _, positions = self._predictor.perceived(tick, pose[:2])
        order = self._standing[np.argsort(np.hypot(*(positions[self._standing] - pose[:2]).T), kind="stable")]
        alone = (m for m in order.tolist() if self._way(tick, pose, order[order != m]))
        mover = next(alone, int(order[0]))
        at = format_position(self._task.frame, *positions[mover].tolist())
        narrow = mover in self._noted(tick, pose[:2]) and self._way(tick, pose, order, narrow=True)
        closes = (
            f"leaves a gap too narrow for local avoidance, which keeps the robot's centre {self._keeps:.3g} m from it"
            if narrow
            else "closes the way"
        )
        return (
            f"{self._predictor.name_of(mover)} stands still at {at} and {closes}; "
            f"no route to the goal for {self._patience:g} s, in {self.failures} attempts"
        )
