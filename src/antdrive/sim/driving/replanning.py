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
from antdrive.base.errors import FieldError
from antdrive.planners import (
    Planner,
    PlanResult,
    PlanStatus,
    Query,
    TimedPlan,
    answered,
    ask,
    blaming,
    capabilities_of,
    checked,
    replanner_for,
    smooth,
)
from antdrive.robots import PurePursuit, RobotSpec, TrackedPath
from antdrive.sim.driving.blockage import Blockage
from antdrive.sim.driving.blocking import blocked_cells, close_route, covered_discs, with_obstacles
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.schedule import Schedule
from antdrive.sim.driving.traffic import Traffic, Zone
from antdrive.worlds import Disc, Grid, Route, Task, rasterise

if TYPE_CHECKING:
    from antdrive.planners import Replanner

# Triggers, as the log records them.
STRAYED = "strayed"
LATE = "late"
WAITED = "waited"
OBSTRUCTED = "obstructed"
TRAFFIC = "traffic"
MISSED = "missed the goal"


@dataclass(frozen=True, kw_only=True)
class ReplanPolicy:
    """When the robot looks for a new route.

    Attributes:
        around_movers: whether predicted movers count as obstacles; if not, the robot replans only after it has
            strayed from its route
        obstruction_range: replan when a mover is predicted on the route within this distance ahead [m]
        max_wait: replan when the robot has waited for movers for this long [s]
        max_deviation: replan when the robot is farther off its route than this [m]
        max_shortfall: replan when the straight-line distance to the route's end exceeds the remaining route
            by this much [m]
        min_interval: the shortest time between two replans [s]
        prediction_time: whatever movers are predicted to cover within this time is blocked [s]
        patience: the drive ends as blocked when movers that stand still have closed every way for this long [s]
        max_traffic: where more movers a second than this would meet a standing robot, routes lead round the ground that
            movers roam [1/s]
        max_detour: how many times as long as the straight line to the goal such a route may be

    Raises:
        ValueError: a setting is out of range.
    """

    around_movers: bool = True
    obstruction_range: float = 3.0
    max_wait: float = 2.0
    max_deviation: float = 0.75
    max_shortfall: float = 0.25
    min_interval: float = 1.0
    prediction_time: float = 1.0
    patience: float = 30.0
    max_traffic: float = 0.07
    max_detour: float = 2.5

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self)[1:]:
            value = getattr(self, field.name)
            if not 0 <= value < math.inf:
                raise FieldError(field.name, f"must be at least 0 and finite, got {value:g}")


@dataclass(frozen=True)
class Replan:
    """One attempt to find a new route.

    Attributes:
        t: simulated time of the attempt [s]
        trigger: what set it off, such as `OBSTRUCTED`
        solved: whether a new route was found
        cost: length of the new plan [m]; inf without one
        work: the planner's effort, in units of `PlanResult.work_unit`
        route: the new route (N, 2) [m]; empty without one
        wall_s: wall time that the attempt took [s]
    """

    t: float
    trigger: str
    solved: bool
    cost: float
    work: int
    route: Floats
    wall_s: float


class ReplanMonitor:
    """Decides during one drive when a new route is due, and finds it.

    It knows the world's obstacles, and of its movers what the robot perceives.

    Attributes:
        policy: when to replan
        log: the attempts so far
        schedule: where the robot should be at each time; None unless the route comes from a plan in space
            and time
        blockage: whether movers that stand still close every way
        wrong: what is wrong with a plan that the planner has given on the way; empty if none was. The drive then ends
    """

    def __init__(
        self,
        policy: ReplanPolicy,
        planner: Planner,
        grid: Grid,
        task: Task,
        rng: np.random.Generator,
        *,
        predictor: Predictor,
        robot: RobotSpec,
        controller: PurePursuit,
        margin: float,
        smoothing: str,
        hz: int,
        keeps: float = 0.0,
    ) -> None:
        self.policy, self.log, self.wrong = policy, list[Replan](), ""
        self.schedule: Schedule | None = None
        self._planner, self._grid, self._rng, self._predictor, self._hz = planner, grid, rng, predictor, hz
        self._task = dataclasses.replace(task, world=dataclasses.replace(task.world, movers=()))
        self._robot, self._controller, self._margin, self._smoothing = robot, controller, margin, smoothing
        self._timed = capabilities_of(planner).needs_motions
        self._replanner: Replanner | None = None
        self._blocked = np.zeros(grid.shape, dtype=np.bool_)
        self._replanned_at = -math.inf
        self._waiting_since = math.nan
        learns = policy.around_movers and predictor.guesses and not self._timed
        self._traffic = Traffic(predictor, robot.radius, task.world.bounds, hz) if learns else None
        self.blockage = Blockage(
            self._task, grid, predictor, hz, interval=policy.min_interval, patience=policy.patience, keeps=keeps
        )

    @property
    def may_wait(self) -> bool:
        """Whether a robot at the end of its route may wait there for a way on."""
        return False

    def track(self, plan: PlanResult, route: Route) -> None:
        """Note that the robot sets out on a route that was made from a plan."""
        self.schedule = Schedule.of(plan, route) if self._timed and isinstance(plan, TimedPlan) else None

    def trigger(self, tick: int, pose: Pose, waiting: bool, tracked: TrackedPath, arc: float) -> str:
        """Why a new route is due now; empty if none is."""
        now, policy = tick / self._hz, self.policy
        if self._traffic is not None:
            self._traffic.look(tick, pose[:2])
        if not waiting:
            self._waiting_since = math.nan
        elif math.isnan(self._waiting_since):
            self._waiting_since = now
        if self.blockage.pause(tick, pose[:2]) or now - self._replanned_at < policy.min_interval:
            return ""
        deviation = math.dist(_point_at(tracked.route, arc), pose[:2])
        shortfall = math.dist(tracked.route.xy[-1], pose[:2]) - (tracked.length - arc)
        if deviation > policy.max_deviation or shortfall > policy.max_shortfall:
            return STRAYED
        if self._timed:
            return LATE if self.schedule is None or self.schedule.late(now, arc) else ""
        if policy.around_movers and now - self._waiting_since >= policy.max_wait:
            self.blockage.gaps.note(tick, pose[:2], tracked, arc, self.blockage.standing(tick, pose[:2]))
            return WAITED
        if policy.around_movers and self._obstructed(tick, pose, tracked, arc):
            return OBSTRUCTED
        return TRAFFIC if self._in_traffic(tick, pose, tracked, arc) else ""

    def replan(self, tick: int, pose: Pose, trigger: str) -> TrackedPath | None:
        """A new path from a pose [m, m, rad], prepared for the controller; None if there is none."""
        now = tick / self._hz
        self._replanned_at, self._waiting_since = now, math.nan
        started = time.perf_counter()
        # A robot that has missed the goal is near it, where avoiding movers is enough.
        around_movers = self.policy.around_movers and trigger != MISSED and not self._timed
        discs = self._discs(tick, pose) if around_movers else []
        try:
            task = dataclasses.replace(self._task, start=pose)
        except ValueError:  # the estimated pose lies outside the world or in an obstacle
            self.log.append(Replan(now, trigger, False, math.inf, 0, np.empty((0, 2)), 0.0))
            return None
        if self._timed:
            plan = self._plan_in_time(task, now)
        else:
            plan, discs = self._plan_around(task, discs, self._zones(tick, pose) if around_movers else [])
        if not plan.solved and around_movers and self.blockage.may_pass(tick, pose[:2]):
            discs = self._discs(tick, pose)
            plan = self._plan(task, discs)
        route = None
        if plan.solved and len(plan.cells) and not self.wrong:
            # A timed plan's times are those of its cells, so its route must follow the cells.
            smoothing = "none" if self._timed else self._smoothing
            route = smooth(plan, self._grid, with_obstacles(task, discs), kind=smoothing)
            self.track(plan, route)
        cost, xy = (plan.cost, route.xy) if route else (math.inf, np.empty((0, 2)))
        wall_s = time.perf_counter() - started
        self.log.append(Replan(now, trigger, route is not None, cost, plan.work, xy, wall_s))
        if route:
            self.blockage.found()
        else:
            self.blockage.failed(tick, pose)
        return self._prepare(route) if route else None

    def _prepare(self, route: Route) -> TrackedPath:
        task = self._task
        return self._controller.prepare(route, task.world, self._robot, self._margin, 1 / self._hz, task.goal_tolerance)

    def _plan_in_time(self, task: Task, now: float) -> PlanResult:
        query = Query.between(self._grid, task)
        query = dataclasses.replace(query, motions=self._predictor.trajectories.motions, start_time=now)
        return self._checked(query, ask(self._planner, query, self._rng))

    def _checked(self, query: Query, answer: PlanResult) -> PlanResult:
        """The answer, if it is right; else note what is wrong with it."""
        plan = checked(query, answer)
        if plan.status is PlanStatus.INVALID:
            self.wrong = self.wrong or plan.reason
        return plan

    def _plan_around(self, task: Task, discs: list[Disc], zones: list[Zone]) -> tuple[PlanResult, list[Disc]]:
        """A plan around the first zone where it is not too long, else around discs; and what it goes around."""
        here = task.start[:2]
        for zone in zones:
            # Movers that are far away will have moved on: they must not close the only way to the goal.
            near = [d for d in discs if math.dist((d.x, d.y), here) <= self.policy.obstruction_range and zone.holds(d)]
            plan = self._plan(task, near, zone)
            if plan.cost <= self.policy.max_detour * math.dist(here, task.goal):
                return plan, near + zone.discs
        return self._plan(task, discs), discs

    def _plan(self, task: Task, discs: list[Disc], zone: Zone | None = None) -> PlanResult:
        """A plan around discs, and a zone: by the planner itself if it needs the world, else by its replanner."""
        if capabilities_of(self._planner).needs_world:
            around = with_obstacles(task, discs + zone.discs if zone is not None else discs)
            grid = rasterise(around.world, self._grid.cell, self._grid.inflate)
            query = Query.between(grid, around)
            return self._checked(query, ask(self._planner, query, self._rng))
        query = Query.between(self._grid, task)
        if self._replanner is None:
            self._replanner = replanner_for(self._planner, query, self._rng)
        blocked = blocked_cells(self._grid, discs)
        if zone is not None:
            blocked |= zone.blocked
        blocked[query.start] = blocked[query.goal] = False
        with blaming(self._planner):
            self._replanner.clear(np.argwhere(self._blocked & ~blocked))
            self._replanner.block(np.argwhere(blocked & ~self._blocked))
            self._blocked = blocked
            self._replanner.move(query.start)
            answer = self._replanner.result()
        answer = answered(self._planner, answer)
        if query.unreachable:  # a replanner knows cells only, not that the robot cannot get to the first of them
            return PlanResult(status=PlanStatus.NO_PATH, reason=query.unreachable)
        return self._checked(query, answer)

    def _discs(self, tick: int, pose: Pose) -> list[Disc]:
        """What movers will cover soon; they close neither the robot's position nor the goal."""
        ends = np.array([pose[:2], self._task.goal])
        soon = covered_discs(self._predictor, tick, ends, self.policy.prediction_time, self._grid)
        return soon + self.blockage.gaps.discs(tick, ends)

    def _zones(self, tick: int, pose: Pose) -> list[Zone]:
        """The ground that movers roam, largest first, if there is so much traffic that the robot should go round it."""
        if self._traffic is None or self._traffic.rate(tick, pose[:2]) <= self.policy.max_traffic:
            return []
        return self._traffic.zones(tick, pose[:2], self._task.goal, self._grid)

    def _in_traffic(self, tick: int, pose: Pose, tracked: TrackedPath, arc: float) -> bool:
        """Whether the route ahead leads through ground that movers roam, as has just been seen."""
        if self._traffic is None or not self._traffic.grown(self._grid.cell):
            return False
        zones = self._zones(tick, pose)
        if not zones:
            return False
        return zones[-1].crossed(tracked, arc)

    def _obstructed(self, tick: int, pose: Pose, tracked: TrackedPath, arc: float) -> bool:
        """Whether a mover will soon cover a point of the route ahead."""
        discs = self._discs(tick, pose)
        return close_route(discs, tracked, arc, self.policy.obstruction_range, self._grid.inflate)


def _point_at(route: Route, arc: float) -> tuple[float, float]:
    """The point of a route at a distance from its start [m]."""
    x, y = (float(np.interp(arc, route.arc, route.xy[:, k])) for k in (0, 1))
    return x, y
