"""New routes while driving: around movers, or back to the goal after straying from the route.

How a planner replans:

- Most planners use their own replanner on the grid. Cells that movers will cover soon are blocked, grown
  exactly as the grid's obstacles are; cells that movers have left are cleared.
- Planners that need the world plan again in a world with discs in the movers' places.
- Planners in space and time plan again when the robot is late.
- Cell-by-cell planners choose one cell after the other; see `antdrive.sim.driving.cellwise`.
"""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.planners import (
    PlanResult,
    PlanStatus,
    Query,
    TimedPlan,
    answered,
    blaming,
    capabilities_of,
    replanner_for,
    smooth,
)
from antdrive.robots import TrackedPath
from antdrive.sim.driving.blockage import Blockage
from antdrive.sim.driving.blocking import closed_cells, with_obstacles
from antdrive.sim.driving.movers_ahead import MoversOnMap
from antdrive.sim.driving.parts import Others
from antdrive.sim.driving.replan_causes import LATE, MISSED, STRAYED, WAITED
from antdrive.sim.driving.routes import OneRoute, RoutePlanner
from antdrive.sim.driving.schedule import Schedule
from antdrive.sim.driving.traffic import Traffic, Zone
from antdrive.sim.log.streams import random_stream
from antdrive.sim.policy import ReplanPolicy
from antdrive.worlds import Disc, Grid, Route, Task, rasterise

if TYPE_CHECKING:
    from antdrive.planners import Replanner


@dataclass(frozen=True)
class Replan:
    """One attempt to find a new route."""

    t: float  # simulated time of the attempt [s]
    trigger: str  # what set it off, such as `OBSTRUCTED`
    solved: bool  # whether a new route was found
    cost: float  # length of the new plan [m]; inf without one
    work: int  # the planner's effort, in units of `PlanResult.work_unit`
    route: Floats  # the new route (N, 2) [m]; empty without one
    wall_s: float  # wall time that the attempt took [s]

    @classmethod
    def failed(cls, t: float, trigger: str) -> Replan:
        """An attempt for which nothing was planned."""
        return cls(t, trigger, False, math.inf, 0, np.empty((0, 2)), 0.0)


class Replanning(OneRoute):
    """Follow the first route until another is due: around movers, or back to the goal.

    It knows the world's obstacles, and of its movers what the robot perceives.

    Attributes:
        policy: when to replan
        log: the attempts so far
        schedule: where the robot should be at each time; None unless the route comes from a plan in space
            and time
    """

    def __init__(self, planner: RoutePlanner, policy: ReplanPolicy, others: Others, keeps: float = 0.0) -> None:
        super().__init__(planner)
        self.policy = policy
        self.schedule: Schedule | None = None
        self._planner, self._rng, self._hz = planner.planner, random_stream(planner.seed, "replanner"), planner.hz
        self._predictor, self._keeps = others, keeps
        self._task = dataclasses.replace(planner.task, world=dataclasses.replace(planner.task.world, movers=()))
        self._timed = capabilities_of(planner.planner).needs_motions
        self._replanner: Replanner | None = None
        self._replanned_at = -math.inf

    def route(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        """Set out on a plan: its route, and the same prepared for the controller."""
        self._grid, policy = grid, self.policy
        self._blocked = np.zeros(grid.shape, dtype=np.bool_)
        self.blockage = Blockage(
            self._task,
            grid,
            self._predictor,
            self._hz,
            interval=policy.min_interval,
            patience=policy.patience,
            keeps=self._keeps,
        )
        others, robot, task = self._predictor, self._routes.robot, self._task
        learns = policy.around_movers and others.guesses and not self._timed
        traffic = Traffic(others, robot.radius, task.world.bounds, self._hz) if learns else None
        self._ahead = MoversOnMap(others, policy, task.goal, grid, self._hz, traffic, self.blockage.gaps)
        route, path = super().route(grid, plan)
        self._track(plan, route)
        return route, path

    def update(self, tick: int, pose: Pose, waiting: bool, path: TrackedPath, arc: float) -> TrackedPath | None:
        """A new path, if one is due and there is one."""
        trigger = self.trigger(tick, pose, waiting, path, arc)
        new = self.replan(tick, pose, trigger) if trigger else None
        self.wrong, self.blocked = self._routes.wrong, self.blockage.reason
        return new

    def missed(self, tick: int, pose: Pose) -> TrackedPath | None:
        """A new path for a robot that stands at the end of its route, but not at the goal."""
        new = self.replan(tick, pose, MISSED)
        self.wrong = self._routes.wrong
        return new

    def closer(self, tick: int, robot: tuple[float, float]) -> Floats:
        """How much closer than usual the robot may pass each perceived mover (P,) [m]."""
        return self.blockage.gaps.closer(tick, robot)

    def _track(self, plan: PlanResult, route: Route) -> None:
        """Note that the robot sets out on a route that was made from a plan."""
        self.schedule = Schedule.of(plan, route) if self._timed and isinstance(plan, TimedPlan) else None

    def trigger(self, tick: int, pose: Pose, waiting: bool, tracked: TrackedPath, arc: float) -> str:
        """Why a new route is due now; empty if none is."""
        now, policy = tick / self._hz, self.policy
        self._ahead.look(tick, pose, waiting)
        if self.blockage.pause(tick, pose[:2]) or now - self._replanned_at < policy.min_interval:
            return ""
        deviation = math.dist(_point_at(tracked.route, arc), pose[:2])
        shortfall = math.dist(tracked.route.xy[-1], pose[:2]) - (tracked.length - arc)
        if deviation > policy.max_deviation or shortfall > policy.max_shortfall:
            return STRAYED
        if self._timed:
            return LATE if self.schedule is None or self.schedule.late(now, arc) else ""
        due = self._ahead.trigger(tick, pose, tracked, arc) if policy.around_movers else ""
        if due == WAITED:
            self.blockage.gaps.note(tick, pose[:2], tracked, arc, self.blockage.standing(tick, pose[:2]))
        return due

    def replan(self, tick: int, pose: Pose, trigger: str) -> TrackedPath | None:
        """A new path from a pose [m, m, rad], prepared for the controller; None if there is none."""
        now = tick / self._hz
        self._replanned_at = now
        self._ahead.wait_anew()
        started = time.perf_counter()
        # A robot that has missed the goal is near it, where avoiding movers is enough.
        around_movers = self.policy.around_movers and trigger != MISSED and not self._timed
        discs = self._ahead.discs(tick, pose) if around_movers else []
        try:
            task = dataclasses.replace(self._task, start=pose)
        except ValueError:  # the estimated pose lies outside the world or in an obstacle
            self.log.append(Replan.failed(now, trigger))
            return None
        if self._timed:
            plan = self._routes.ask(self._routes.query(self._grid, task, now), self._rng)
        else:
            zones = self._ahead.zones(tick, pose, self._grid) if around_movers and self._ahead.heavy(tick, pose) else []
            around = self._ahead.way_round(pose, zones, discs, lambda near, zone: self._plan(task, near, zone))
            plan, discs = around or (self._plan(task, discs), discs)
        if not plan.solved and around_movers and self.blockage.may_pass(tick, pose[:2]):
            discs = self._ahead.discs(tick, pose)
            plan = self._plan(task, discs)
        route = None
        if plan.solved and len(plan.cells) and not self._routes.wrong:
            # A timed plan's times are those of its cells, so its route must follow the cells.
            smoothing = "none" if self._timed else self._routes.smoothing
            route = smooth(plan, self._grid, with_obstacles(task, discs), kind=smoothing)
            self._track(plan, route)
        cost, xy = (plan.cost, route.xy) if route else (math.inf, np.empty((0, 2)))
        wall_s = time.perf_counter() - started
        self.log.append(Replan(now, trigger, route is not None, cost, plan.work, xy, wall_s))
        if route:
            self.blockage.found()
        else:
            self.blockage.failed(tick, pose)
        return self._prepare(route) if route else None

    def _prepare(self, route: Route) -> TrackedPath:
        return self._routes.prepared(route, self._task.world, self._routes.margin)

    def _plan(self, task: Task, discs: list[Disc], zone: Zone | None = None) -> PlanResult:
        """A plan around discs, and a zone: by the planner itself if it needs the world, else by its replanner."""
        if capabilities_of(self._planner).needs_world:
            around = with_obstacles(task, discs + zone.discs if zone is not None else discs)
            grid = rasterise(around.world, self._grid.cell, self._grid.inflate)
            query = Query.between(grid, around)
            return self._routes.ask(query, self._rng)
        query = Query.between(self._grid, task)
        if self._replanner is None:
            self._replanner = replanner_for(self._planner, query, self._rng)
        blocked = closed_cells(query, discs, zone)
        with blaming(self._planner):
            self._replanner.clear(np.argwhere(self._blocked & ~blocked))
            self._replanner.block(np.argwhere(blocked & ~self._blocked))
            self._blocked = blocked
            self._replanner.move(query.start)
            answer = self._replanner.result()
        answer = answered(self._planner, answer)
        if query.unreachable:  # a replanner knows cells only, not that the robot cannot get to the first of them
            return PlanResult(status=PlanStatus.NO_PATH, reason=query.unreachable)
        return self._routes.checked(query, answer)


def _point_at(route: Route, arc: float) -> tuple[float, float]:
    """The point of a route at a distance from its start [m]."""
    x, y = (float(np.interp(arc, route.arc, route.xy[:, k])) for k in (0, 1))
    return x, y
