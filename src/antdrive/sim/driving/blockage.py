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
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point, Pose
from antdrive.base.plane import format_position
from antdrive.base.records import unchecked_copy
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
    movers: PerceivedMovers,
    ends: Floats,
    duration: float,
    grid: Grid,
    only: npt.NDArray[np.int64] | None = None,
    wider: float = 0.0,
) -> list[Disc]:
    """Return the discs that movers cover within `duration` [s].

    `only` selects movers by number; `wider` [m] is added to their radii.

    Discs shrink where their inflation would cover one of the `ends` (N, 2) [m], so movers close neither end. The
    first end is the robot's position.
    """
    times = np.linspace(0.0, duration, 1 + math.ceil(duration / STEP))
    positions, radii = movers.predict(times), movers.near.radii
    if only is not None:
        wanted = np.isin(movers.near.numbers, only)
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


def obstructs_route(discs: list[Disc], tracked: TrackedPath, arc: float, reach: float, inflate: float) -> bool:
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
    return unchecked_copy(task, world=world)


class Search(NamedTuple):
    """Failed searches in a row behind the same standing movers."""

    failures: int = 0
    since: float = -math.inf  # time of the first [s]
    due: float = -math.inf  # earliest time of the next [s]
    movers: npt.NDArray[np.int64] = np.empty(0, dtype=np.int64)  # those that stood still at the first (M,)
    places: Floats = np.empty((0, 2))  # their positions then (M, 2) [m]


class Gap(NamedTuple):
    """Gap beside a standing mover that is too narrow for avoidance."""

    at: Point  # the mover's position [m]
    width: float  # clearance of plans from its surface [m]
    passed: bool = False  # whether the robot passes it at the safety margin
    refused: bool = False  # whether the robot had to wait again while it passed


class Blockage:
    """Failed searches behind standing movers, and the narrow gaps beside such movers.

    Movers in motion may open a route and do not count. While the same movers stand where they stood at the first
    failure, the wait before the next search doubles.

    Attributes:
        failed_searches: those since a route was last found
        reason: which mover blocks the robot and where, once the robot's patience is over; else empty
    """

    def __init__(self, task: Task, grid: Grid, movers: PerceivedMovers, policy: ReplanPolicy, clearance: float) -> None:
        self.failed_searches, self.reason = Search(), ""
        self._gaps: dict[int, Gap] = {}  # by mover
        self._all = np.empty((0, 2))  # positions of all movers when the last gap was noted
        self._task, self._grid, self._movers = task, grid, movers
        self._policy, self._clearance = policy, clearance

    def pause(self) -> bool:
        """Return whether a search now would repeat the last one."""
        if not self.failed_searches.failures:
            return False
        if not self._still_there():
            self.route_found()
            return False
        return self._movers.t < self.failed_searches.due

    def route_found(self) -> None:
        """Forget failed searches: a route exists, or may open soon."""
        self.failed_searches = Search()

    def failed(self, pose: Pose) -> None:
        """Count a search from a pose [m, m, rad] that found no route."""
        now, standing = self._movers.t, self.standing()
        last, interval, patience = self.failed_searches, self._policy.min_interval, self._policy.patience
        if last.failures and not self._closed(pose, np.intersect1d(standing, last.movers)):
            last = Search()
        if not last.failures:
            if not self._closed(pose, standing):
                self.route_found()
                return
            last = Search(since=now, movers=standing, places=self._movers.places[standing])
        due = min(now + interval * 2.0 ** min(last.failures, 30), max(last.since + patience, now + interval))
        self.failed_searches = last._replace(failures=last.failures + 1, due=due)
        if now - last.since >= patience:
            self.reason = self._sentence(pose)

    def may_pass(self) -> bool:
        """Allow passing noted movers at the safety margin after a failure, if all movers have stood still since."""
        if not self.failed_searches.failures:
            return False
        noted = [m for m, gap in self._noted().items() if not (gap.passed or gap.refused)]
        perceived, positions = self._movers.near.numbers, self._movers.places
        if not noted or not np.isin(perceived, self.standing()).all():
            return False
        if len(positions) != len(self._all):  # a new mover is perceived
            return False
        if not (np.hypot(*(positions - self._all)[perceived].T) <= STILL).all():
            return False
        self._gaps |= {m: self._gaps[m]._replace(passed=True) for m in noted}
        return True

    def note_gaps(self, tracked: TrackedPath, arc: float) -> None:
        """Note the standing movers that the route ahead passes too closely for avoidance; noted ones need more each time."""
        standing, near = self.standing(), self._movers.near
        if self._clearance <= self._grid.inflate or not len(standing):
            return
        ahead = np.arange(arc, min(arc + GAP_RANGE, tracked.length), GAP_STEP)
        points, positions = points_at(tracked, ahead), self._movers.places
        noted = self._noted()
        for m in standing.tolist():
            gap = np.hypot(*(points - positions[m]).T).min(initial=np.inf) - near.radii[near.numbers == m][0]
            last = noted.get(m, Gap((math.nan, math.nan), self._clearance))
            if gap < last.width + GAP_SLACK:
                at, width = (float(positions[m, 0]), float(positions[m, 1])), max(last.width, gap + GAP_SLACK)
                self._gaps[m] = Gap(at, width, refused=last.passed or last.refused)
                self._all = positions

    def _noted(self) -> dict[int, Gap]:
        """Return the gaps beside noted movers that stand where they stood; forget the others."""
        positions = self._movers.places
        self._gaps = {m: gap for m, gap in self._gaps.items() if np.hypot(*(positions[m] - gap.at)) <= STILL}
        return self._gaps

    def discs(self, ends: Floats, only: npt.NDArray[np.int64] | None = None) -> list[Disc]:
        """Return the noted movers as discs, enlarged so that plans keep the clearance of avoidance."""
        discs: list[Disc] = []
        for m, gap in sorted(self._noted().items()):
            if not gap.passed and (only is None or m in only):
                wider = gap.width - self._grid.inflate
                discs += covered_discs(self._movers, ends, 0.0, self._grid, np.array([m]), wider)
        return discs

    def clearance_reduction(self) -> Floats:
        """Return how much closer than usual the robot may pass each perceived mover (P,) [m]."""
        perceived = self._movers.near.numbers
        if not any(gap.passed for gap in self._gaps.values()):
            return np.zeros(len(perceived))
        passed = [m for m, gap in self._noted().items() if gap.passed]
        return np.where(np.isin(perceived, passed), self._clearance - self._grid.inflate, 0.0)

    def standing(self) -> npt.NDArray[np.int64]:
        """Return the perceived movers (S,) that are predicted to stand still for as long as the robot's patience."""
        patience = self._policy.patience
        ahead = np.linspace(0.0, patience, 1 + math.ceil(patience / STANDING_STEP))
        positions = self._movers.predict(ahead)
        still = np.hypot(*np.moveaxis(positions - positions[0], -1, 0)).max(axis=0) <= STILL
        return np.asarray(self._movers.near.numbers[still])

    def _still_there(self) -> bool:
        """Return whether all movers of the first failure are perceived where they stood."""
        _, _, _, movers, places = self.failed_searches
        near = np.hypot(*(self._movers.places[movers] - places).T) <= STILL
        return bool(near.all() and np.isin(movers, self._movers.near.numbers).all())

    def _closed(self, pose: Pose, movers: npt.NDArray[np.int64]) -> bool:
        """Return whether these movers alone close every route that is open without them."""
        return bool(len(movers)) and self._way(pose, movers[:0]) and not self._way(pose, movers)

    def _way(self, pose: Pose, movers: npt.NDArray[np.int64], narrow: bool = False) -> bool:
        """Return whether the grid has a route to the goal among these movers; `narrow` also counts refused gaps."""
        task = dataclasses.replace(self._task, start=pose)
        ends: Floats = np.array([pose[:2], task.goal])
        discs = covered_discs(self._movers, ends, 0.0, self._grid, only=movers)
        discs += [] if narrow else self.discs(ends, only=movers)
        world = with_obstacles(task, discs).world
        return reachable(Query.between(rasterise(world, self._grid.cell, self._grid.inflate), task))

    def _sentence(self, pose: Pose) -> str:
        """Name the nearest mover that alone blocks the robot, else the nearest of all, with its position and the time."""
        positions, movers = self._movers.places, self.failed_searches.movers
        order = movers[np.argsort(np.hypot(*(positions[movers] - pose[:2]).T), kind="stable")]
        alone = (m for m in order.tolist() if self._way(pose, order[order != m]))
        mover = next(alone, int(order[0]))
        at = format_position(self._task.frame, *positions[mover].tolist())
        narrow = mover in self._noted() and self._way(pose, order, narrow=True)
        closes = (
            f"leaves a gap too narrow for local avoidance, which keeps the robot's centre {self._clearance:.3g} m from it"
            if narrow
            else "closes the way"
        )
        return (
            f"{self._movers.name_of(mover)} stands still at {at} and {closes}; "
            f"no route to the goal for {self._policy.patience:g} s, in {self.failed_searches.failures} attempts"
        )
