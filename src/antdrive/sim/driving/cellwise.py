"""Driving cell by cell, as hasan's robot does: each decision goes no farther than the next cell."""

from __future__ import annotations

import dataclasses
import math
import time

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.base.plane import polyline_length
from antdrive.planners import PLANNERS, PlanResult, Query, agent_for, blaming, check_step, smooth
from antdrive.robots import TrackedPath
from antdrive.sim.driving.blocking import blocked_cells, covered_discs
from antdrive.sim.driving.replan_causes import MISSED
from antdrive.sim.driving.replanning import Replan, Replanning
from antdrive.sim.log.record import DECISION
from antdrive.worlds import Grid, Route, segment_clearance

DECISION_PAUSE = 0.2  # the shortest time between two decisions [s]
DECIDE_BEFORE = 0.6  # a decision is due when less than this many cells of the route remain
STRAIGHT_BACK = 1.5  # a robot within this many cells of its cell's centre goes back to it straight
AT_CELL = 0.25  # a robot this close to its cell's centre, in cells, need not drive through it


class CellByCell(Replanning):
    """Decide cell by cell: the route never goes beyond the next cell."""

    def route(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        """Set out; the whole route of the plan, which the robot leaves at its first decision."""
        self._query = Query.between(grid, self._task)
        self._online = agent_for(self._planner, self._query, self._rng)
        self._goal = self._query.goal
        self._noted_at = -math.inf
        return super().route(grid, plan)

    @property
    def may_wait(self) -> bool:
        """Whether a robot at the end of its route may wait there for a way on."""
        return not self._online.arrived

    def trigger(self, tick: int, pose: Pose, waiting: bool, tracked: TrackedPath, arc: float) -> str:
        """A decision is due shortly before the robot reaches its cell, and repeatedly while it waits."""
        if tick == 0:
            return DECISION
        since = tick / self._hz - self._replanned_at
        if self._online.arrived or since < DECISION_PAUSE:
            return ""
        if since >= self.policy.max_wait:  # movers keep the robot from its cell
            self._note_no_way(tick, pose)
        if self.blockage.reason:
            return ""
        return DECISION if tracked.length - arc < DECIDE_BEFORE * self._grid.cell else ""

    def replan(self, tick: int, pose: Pose, trigger: str) -> TrackedPath | None:
        """The path to the next cell, prepared for the controller; None if the robot waits."""
        if trigger == MISSED:  # a robot that has not arrived waits: its next decision will be due soon
            return super().replan(tick, pose, trigger) if self._online.arrived else None
        now, started = tick / self._hz, time.perf_counter()
        self._replanned_at = now
        covered = covered_discs(self._predictor, tick, np.array([pose[:2]]), 0.0, self._grid)
        with blaming(self._planner):
            here, propagated = self._online.cell, self._online.stats.propagated
            to = self._online.step(np.argwhere(blocked_cells(self._grid, covered)))
        self._routes.wrong = self._routes.wrong or check_step(self._query, here, to)
        if self._routes.wrong:
            self.log.append(Replan.failed(now, trigger))
            return None
        xy = self._line(pose, here, to, tick)
        if to is not None:
            self.blockage.found()
        else:
            self._note_no_way(tick, pose)
        if to is not None and bool(np.ptp(xy, axis=0).any()):
            cost = polyline_length(xy)
            work = self._online.stats.propagated - propagated
            self.log.append(Replan(now, trigger, True, cost, work, xy, time.perf_counter() - started))
            return self._prepare(Route(xy))
        if tick == 0:  # the robot waits where it is, and must not set out on the plan for the whole way
            heading = np.array([(0.0, 0.0), (math.cos(pose[2]), math.sin(pose[2]))])
            return self._prepare(Route(np.array(pose[:2]) + 1e-4 * heading))
        return None

    def _note_no_way(self, tick: int, pose: Pose) -> None:
        """Take note that the robot does not get on; the attempt at which it gives up is logged."""
        now = tick / self._hz
        if self.blockage.pause(tick, pose[:2]) or now - self._noted_at < self.policy.min_interval:
            return
        self._noted_at = now
        self.blockage.failed(tick, pose)
        if self.blockage.reason:
            self.log.append(Replan.failed(now, DECISION))

    def _line(self, pose: Pose, here: tuple[int, int], to: tuple[int, int] | None, tick: int) -> Floats:
        """From the robot to the next cell (2 or 3, 2) [m], by the centre of its own cell where it must."""
        ends = self._grid.xy(np.array([here, to or here]))
        if to == self._goal and self._clear(ends[0], self._task.goal):
            ends[1] = self._task.goal
        near = math.dist(pose[:2], ends[0]) <= AT_CELL * self._grid.cell or tick == 0
        if near and self._clear(pose[:2], ends[1]):
            return np.vstack([pose[:2], ends[1:]])
        return np.vstack([self._way_back(pose, ends[0]), ends[1:]])

    def _way_back(self, pose: Pose, centre: Floats) -> Floats:
        """From the robot to the centre of its own cell (N, 2) [m]; around obstacles if avoiding movers took it far away."""
        straight = np.array([pose[:2], centre])
        far = math.dist(pose[:2], centre) > STRAIGHT_BACK * self._grid.cell
        if not far or self._clear(pose[:2], centre):
            return straight
        try:
            task = dataclasses.replace(self._task, start=pose, goal=(float(centre[0]), float(centre[1])))
        except ValueError:  # the estimated pose lies outside the world or in an obstacle
            return straight
        plan = PLANNERS["astar"].plan(Query.between(self._grid, task), self._rng)
        return smooth(plan, self._grid, task, kind="taut").xy if plan.solved else straight

    def _clear(self, a: tuple[float, ...] | Floats, b: tuple[float, ...] | Floats) -> bool:
        """Whether the straight line between two points keeps the grid's inflation from every obstacle."""
        clearance = segment_clearance(self._task.world, np.array([a]), np.array([b]))[0]
        return bool(clearance >= self._grid.inflate - 1e-9)
