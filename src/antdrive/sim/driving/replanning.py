"""Replanning during a drive: around movers, or to the goal after a deviation from the route.

Triggers: `trigger` queries `MoversAhead` for movers; thresholds are those of `antdrive.sim.policy`. Mapless robots use
`antdrive.sim.driving.exploring`. Methods:

- Most planners use their own replanner on the grid. Cells that movers will cover soon are blocked, grown like the
  grid's obstacles; cells that movers have left are cleared.
- Planners that need the world get one with discs in place of movers.
- Space-time planners plan again when the robot is late.
- Cell-by-cell planners choose one cell after the other, as hasan's robot does.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.base.kernel_cache import clock, compiled
from antdrive.base.plane import polyline_length
from antdrive.planners import (
    AStar,
    PlanResult,
    Query,
    agent_for,
    check_step,
    planner_errors,
    smooth,
)
from antdrive.robots import TrackedPath
from antdrive.sim.driving.blockage import Blockage, blocked_cells, covered_discs, points_at, with_obstacles
from antdrive.sim.driving.guide import Moment
from antdrive.sim.driving.movers_ahead import MoversAhead, Traffic
from antdrive.sim.driving.perceived_movers import PerceivedMovers
from antdrive.sim.driving.route_planner import RoutePlanner
from antdrive.sim.driving.routes import OneRoute
from antdrive.sim.policy import ReplanPolicy, Trigger
from antdrive.worlds import Disc, Grid, Route, segment_clearance


class Replanning(OneRoute):
    """Guide that follows the first route until movers or deviations require another.

    It knows the world's obstacles, and the movers that the robot perceives.

    Attributes:
        policy: when to replan
    """

    blockage: Blockage

    def __init__(
        self, planner: RoutePlanner, policy: ReplanPolicy, movers: PerceivedMovers, clearance: float = 0.0
    ) -> None:
        super().__init__(planner)
        self.policy = policy
        self._movers, self._clearance = movers, clearance
        self._task = dataclasses.replace(planner.task, world=dataclasses.replace(planner.task.world, movers=()))
        self._timed = bool(planner.motions)
        self._replanned_at = -math.inf

    def route(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        """Return the route of a plan, and its path for the controller."""
        self._grid, policy = grid, self.policy
        movers, robot, task = self._movers, self._routes.robot, self._task
        self.blockage = Blockage(task, grid, movers, policy, self._clearance)
        learns = policy.around_movers and movers.uncertain and not self._timed
        traffic = Traffic(movers, robot.radius, task.world.bounds, self._hz) if learns else None
        self._ahead = MoversAhead(movers, policy, task.goal, grid, traffic, self.blockage)
        return super().route(grid, plan)

    def trigger(self, now: Moment) -> str:
        """Return why a new route is due; empty if none is."""
        t, policy, pose, tracked, arc = now.observed.t, self.policy, now.pose, now.way.path, now.before.pursuit.arc
        self._ahead.observe(now.waiting)
        if self.blockage.pause() or t - self._replanned_at < policy.min_interval:
            return ""
        deviation = math.dist(points_at(tracked, np.array([arc]))[0], pose[:2])
        shortfall = math.dist(tracked.route.xy[-1], pose[:2]) - (tracked.length - arc)
        if deviation > policy.max_deviation or shortfall > policy.max_shortfall:
            return Trigger.STRAYED
        if self._timed:
            return Trigger.LATE if self.schedule is None or self.schedule.late(t, arc) else ""
        due = self._ahead.trigger(tracked, arc) if policy.around_movers else ""
        if due == Trigger.WAITED:
            self.blockage.note_gaps(tracked, arc)
        return due

    @compiled()
    def replan(self, now: Moment, trigger: str) -> TrackedPath | None:
        """Return a new path; None if there is none."""
        t, pose = now.observed.t, now.pose
        self._replanned_at = t
        self._ahead.reset_wait()
        spent = clock()
        # Near the goal, local avoidance is enough.
        around_movers = self.policy.around_movers and trigger != Trigger.MISSED and not self._timed
        discs = self._ahead.discs() if around_movers else []
        try:
            task = dataclasses.replace(self._task, start=pose)
        except ValueError:  # the estimated pose lies outside the world or in an obstacle
            self.note(t, trigger)
            return None
        if self._timed:
            plan = self._routes.plan(self._routes.query(self._grid, task, t), self._routes.rng)
        else:
            zones = self._ahead.zones(self._grid) if around_movers and self._ahead.heavy else []
            around = functools.partial(self._routes.around, task, self._grid)
            beside = self._ahead.plan_around_zones(zones, discs, around)
            plan, discs = beside or self._unless_waiting(pose, trigger, discs, around)
        if not plan.solved and around_movers and self.blockage.may_pass():
            discs = self._ahead.discs()
            plan = self._routes.around(task, self._grid, discs)
        route = None
        if plan.solved and len(plan.cells) and not self._routes.plan_error:
            # A timed plan has times for its cells only, so its route must follow them.
            smoothing = "none" if self._timed else self._routes.smoothing
            route = smooth(plan, self._grid, with_obstacles(task, discs), kind=smoothing)
            self._track(plan, route)
        wall_s = spent()
        if route is None:
            self.note(t, trigger, wall_s, plan.work)
            self.blockage.failed(pose)
            return None
        self.note(t, trigger, wall_s, plan.work, plan.cost, route.xy)
        self.blockage.route_found()
        return self._prepare(route)

    def _unless_waiting(
        self, pose: Pose, trigger: str, discs: list[Disc], around: Callable[[list[Disc]], PlanResult]
    ) -> tuple[PlanResult, list[Disc]]:
        """Return a plan around discs, and these; without them if waiting is quicker."""
        plan, asked = around(discs), (trigger, self._routes.robot.max_speed)
        straight = math.dist(pose[:2], self._task.goal)
        if plan.solved and self._ahead.waiting_is_quicker(*asked, plan.cost, straight):
            free = around([])
            if self._ahead.waiting_is_quicker(*asked, plan.cost, free.cost):
                return free, []
        return plan, discs

    def _prepare(self, route: Route) -> TrackedPath:
        return self._routes.prepared(route, self._task.world, self._routes.margin)


DECISION_PAUSE = 0.2  # shortest time between two decisions [s]
DECIDE_BEFORE = 0.6  # a decision is due when fewer cells than this remain on the route
STRAIGHT_BACK = 1.5  # within this many cells of its cell's centre the robot returns straight
AT_CELL = 0.25  # a robot within this many cells of its cell's centre need not drive through it


class CellByCell(Replanning):
    """Guide that decides cell by cell: the route ends at the next cell."""

    def route(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        """Return the route of the whole plan, which the first decision replaces."""
        self._query = Query.between(grid, self._task)
        self._online = agent_for(self._routes.planner, self._query, self._routes.rng)
        with planner_errors(self._routes.planner):
            self._arrived = bool(self._online.arrived)
        self._goal = self._query.goal
        self._noted_at = -math.inf
        return super().route(grid, plan)

    @property
    def _may_wait(self) -> bool:  # type: ignore[override]
        return not self._arrived

    def trigger(self, now: Moment) -> str:
        """Return `Trigger.DECISION` shortly before the robot reaches its cell, and repeatedly while it waits; else empty."""
        if now.tick == 0:
            return Trigger.DECISION
        since, path = now.observed.t - self._replanned_at, now.way.path
        if self._arrived or since < DECISION_PAUSE:
            return ""
        if since >= self.policy.max_wait:  # movers keep the robot from its cell
            self._note_no_path(now)
        if self.blockage.reason:
            return ""
        return Trigger.DECISION if path.length - now.before.pursuit.arc < DECIDE_BEFORE * self._grid.cell else ""

    @compiled()
    def replan(self, now: Moment, trigger: str) -> TrackedPath | None:
        """Return the path to the next cell; None if the robot waits."""
        if trigger == Trigger.MISSED:
            return super().replan(now, trigger)
        t, pose, spent = now.observed.t, now.pose, clock()
        self._replanned_at = t
        covered = covered_discs(self._movers, np.array([pose[:2]]), 0.0, self._grid)
        with planner_errors(self._routes.planner):
            here, propagated = self._online.cell, self._online.stats.propagated
            to = self._online.step(np.argwhere(blocked_cells(self._grid, covered)))
            work = int(self._online.stats.propagated - propagated)
            self._arrived = bool(self._online.arrived)
        self._routes.plan_error = self._routes.plan_error or check_step(self._query, here, to)
        if self._routes.plan_error:
            self.note(t, trigger)
            return None
        xy = self._line(now, here, to)
        if to is not None:
            self.blockage.route_found()
        else:
            self._note_no_path(now)
        if to is not None and bool(np.ptp(xy, axis=0).any()):
            self.note(t, trigger, spent(), work, polyline_length(xy), xy)
            return self._prepare(Route(xy))
        if now.tick == 0:  # the robot waits in place and must not follow the plan's whole route
            heading = np.array([(0.0, 0.0), (math.cos(pose[2]), math.sin(pose[2]))])
            return self._prepare(Route(np.array(pose[:2]) + 1e-4 * heading))
        return None

    def _note_no_path(self, now: Moment) -> None:
        """Record an attempt without progress; log the one at which the robot gives up."""
        t = now.observed.t
        if self.blockage.pause() or t - self._noted_at < self.policy.min_interval:
            return
        self._noted_at = t
        self.blockage.failed(now.pose)
        if self.blockage.reason:
            self.note(t, Trigger.DECISION)

    def _line(self, now: Moment, here: tuple[int, int], to: tuple[int, int] | None) -> Floats:
        """Return the line from the robot to the next cell (2 or 3, 2) [m], through the centre of its own cell if necessary."""
        pose, ends = now.pose, self._grid.xy(np.array([here, to or here]))
        if to == self._goal and self._clear(ends[0], self._task.goal):
            ends[1] = self._task.goal
        near = math.dist(pose[:2], ends[0]) <= AT_CELL * self._grid.cell or now.tick == 0
        if near and self._clear(pose[:2], ends[1]):
            return np.vstack([pose[:2], ends[1:]])
        return np.vstack([self._way_back(pose, ends[0]), ends[1:]])

    def _way_back(self, pose: Pose, centre: Floats) -> Floats:
        """Return the line from the robot to the centre of its own cell (N, 2) [m], around obstacles if it is far away."""
        straight = np.array([pose[:2], centre])
        far = math.dist(pose[:2], centre) > STRAIGHT_BACK * self._grid.cell
        if not far or self._clear(pose[:2], centre):
            return straight
        try:
            task = dataclasses.replace(self._task, start=pose, goal=(float(centre[0]), float(centre[1])))
        except ValueError:  # the estimated pose lies outside the world or in an obstacle
            return straight
        plan = AStar().plan(Query.between(self._grid, task), self._routes.rng)
        return smooth(plan, self._grid, task, kind="taut").xy if plan.solved else straight

    def _clear(self, a: tuple[float, ...] | Floats, b: tuple[float, ...] | Floats) -> bool:
        """Return whether the straight line between two points keeps the grid's inflation from every obstacle."""
        clearance = segment_clearance(self._task.world, np.array([a]), np.array([b]))[0]
        return bool(clearance >= self._grid.inflate - 1e-9)
