"""New routes while driving: around movers, or back to where the robot was going.

A replan takes the planner's own replanner: what movers cover soon is blocked, grown exactly as the grid's obstacles are, and
what they have left is cleared. Planners of the plane plan anew among discs in the movers' places. One of space and time plans
anew where the robot is late. hasan's ant decides at every cell.
"""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from antdrive.planners import (
    Planner,
    PlanResult,
    Query,
    SafeIntervals,
    TimedPlan,
    online_for,
    plan_in_time,
    replanner_for,
    smooth,
)
from antdrive.robots import PurePursuit, RobotSpec, TrackedPath
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.schedule import Schedule
from antdrive.worlds import Disc, Floats, Grid, Pose, Route, Task, rasterise, segment_clearance
from antdrive.worlds.errors import FieldError
from antdrive.worlds.plane import polyline_length

if TYPE_CHECKING:
    from antdrive.planners import Replanner


MISSED = "missed the goal"
DECISION = "decision"  # of a robot that decides at every cell
DECIDE = 0.2  # between two decisions of a robot that decides cell by cell, at least [s]


@dataclass(frozen=True, kw_only=True)
class ReplanPolicy:
    """When the robot looks for a new route.

    Raises:
        ValueError: a setting outside its range.
    """

    around: bool = True  # movers count as obstacles; else the route is only renewed where the robot has left it
    within: float = 3.0  # a mover that is expected on the route so near ahead is a cause [m]
    patience: float = 2.0  # and so is having waited so long [s]
    strayed: float = 0.75  # and being so far off the route [m]
    beside: float = 0.25  # and so much farther from its end than what is left of it [m]
    pause: float = 1.0  # the least time between two replans [s]
    ahead: float = 1.0  # what a mover covers in this time is blocked [s]

    def __post_init__(self) -> None:
        for key in ("within", "patience", "strayed", "beside", "pause", "ahead"):
            if not 0 <= getattr(self, key) < math.inf:
                raise FieldError(key, f"must be at least 0, got {getattr(self, key):g}")


@dataclass(frozen=True)
class Replan:
    """One renewal of the route."""

    t: float  # [s]
    cause: str
    solved: bool
    cost: float  # of the new plan [m]; inf without one
    work: int
    route: Floats  # (N, 2) [m]; empty without one
    wall_s: float

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; what it took of wall time is not among them."""
        cost = self.cost if math.isfinite(self.cost) else None
        return {"t": self.t, "cause": self.cause, "solved": self.solved, "cost_m": cost, "work": self.work,
                "route": np.round(self.route, 4).tolist()}  # fmt: skip


class ReplanMonitor:
    """One drive's replanner: it knows the world that stands, and of movers what the robot does."""

    def __init__(
        self, settings: ReplanPolicy, planner: Planner, grid: Grid, task: Task, rng: np.random.Generator, *,
        watch: Predictor, robot: RobotSpec, controller: PurePursuit, margin: float, kind: str, hz: int,
    ) -> None:  # fmt: skip
        self.settings, self.log = settings, list[Replan]()
        self._planner, self._grid, self._rng, self._watch, self._hz = planner, grid, rng, watch, hz
        self._task = dataclasses.replace(task, world=dataclasses.replace(task.world, movers=()))
        self._robot, self._controller, self._margin, self._kind = robot, controller, margin, kind
        self._search: Replanner | None = None
        self._blocked = np.zeros(grid.shape, dtype=np.bool_)
        self._rest = -math.inf  # when the last replan was
        self._wait_began = math.nan
        self._timed = planner if isinstance(planner, SafeIntervals) else None
        self.schedule: Schedule | None = None  # where the route says when

    @property
    def waits(self) -> bool:
        """Whether it may have a way on later where it has none now."""
        return False

    def follows(self, answer: PlanResult, route: Route) -> None:
        """The robot sets out by this plan."""
        self.schedule = Schedule.of(answer, route) if isinstance(answer, TimedPlan) and self._timed else None

    def cause(self, tick: int, pose: Pose, waits: bool, guide: TrackedPath, arc: float) -> str:
        """Why a new route is due; empty if none is."""
        now, s = tick / self._hz, self.settings
        if not waits:
            self._wait_began = math.nan
        elif math.isnan(self._wait_began):
            self._wait_began = now
        if now - self._rest < s.pause:
            return ""
        x, y = _place(guide.route, arc)
        beside = math.dist(guide.route.xy[-1], pose[:2]) - (guide.length - arc)
        if math.dist((x, y), pose[:2]) > s.strayed or beside > s.beside:
            return "strayed"
        if self._timed:
            return "late" if self.schedule is None or self.schedule.late(now, arc) else ""
        if s.around and now - self._wait_began >= s.patience:
            return "waited"
        if s.around and self._obstructed(tick, pose, guide, arc):
            return "obstructed"
        return ""

    def again(self, tick: int, pose: Pose, cause: str) -> TrackedPath | None:
        """A new route from a pose, made ready for following; None where there is none."""
        self._rest, self._wait_began = tick / self._hz, math.nan
        started = time.perf_counter()
        around = self.settings.around and cause != MISSED  # at the goal it is enough to yield
        discs = self._discs(tick, pose) if around and not self._timed else []
        try:
            task = dataclasses.replace(self._task, start=pose)
        except ValueError:  # the robot believes to be where it cannot be
            self.log.append(Replan(tick / self._hz, cause, False, math.inf, 0, np.empty((0, 2)), 0.0))
            return None
        answer = self._in_time(task, tick / self._hz) if self._timed else self._answer(task, discs)
        route = None
        if answer.solved and len(answer.cells):
            kind = "none" if self._timed else self._kind  # times are those of the cells
            route = smooth(answer, self._grid, _with(task, discs), kind=kind)
            self.follows(answer, route)
        self.log.append(
            Replan(
                tick / self._hz, cause, route is not None, answer.cost if route else math.inf, answer.work,
                route.xy if route else np.empty((0, 2)), time.perf_counter() - started,
            )
        )  # fmt: skip
        return self._guide(route) if route else None

    def _guide(self, route: Route) -> TrackedPath:
        task = self._task
        return self._controller.guide(route, task.world, self._robot, self._margin, 1 / self._hz, task.goal_tolerance)

    def _in_time(self, task: Task, now: float) -> PlanResult:
        assert self._timed is not None
        motions = self._watch.traffic.motions
        query = Query.between(self._grid, task)
        return plan_in_time(
            query, motions, speed=self._timed.speed, start_time=now, horizon=self._timed.horizon, stay=self._timed.stay
        )

    def _answer(self, task: Task, discs: list[Disc]) -> PlanResult:
        if getattr(self._planner, "needs_world", False):
            around = _with(task, discs)
            grid = rasterise(around.world, self._grid.cell, self._grid.inflate)
            return self._planner.plan(Query.between(grid, around), self._rng)
        query = Query.between(self._grid, task)
        if self._search is None:
            self._search = replanner_for(self._planner, query, self._rng)
        blocked = self._cells(discs)
        blocked[query.start] = blocked[query.goal] = False
        self._search.clear(np.argwhere(self._blocked & ~blocked))
        self._search.block(np.argwhere(blocked & ~self._blocked))
        self._blocked = blocked
        self._search.move(query.start)
        return self._search.result()

    def _discs(self, tick: int, pose: Pose) -> list[Disc]:
        """What movers cover soon; they close neither of the ends."""
        return self._covered(tick, np.array([pose[:2], self._task.goal]), self.settings.ahead)

    def _covered(self, tick: int, ends: Floats, ahead: float) -> list[Disc]:
        """What movers cover within a time, as discs; none so large that an end (N, 2) lies within its inflation.

        The first of the ends is where the robot is.
        """
        x, y = ends[0].tolist()
        steps = np.linspace(0.0, ahead, 1 + math.ceil(ahead / 0.25))
        places, radii = self._watch.expected(tick, (x, y), steps)
        inflate, cell = self._grid.inflate, self._grid.cell
        room = np.hypot(*np.moveaxis(places[:, :, None] - ends, -1, 0)).min(axis=-1) - inflate - cell
        radius = np.minimum(radii, room)
        return [
            Disc(float(places[k, m, 0]), float(places[k, m, 1]), float(radius[k, m]))
            for k, m in np.argwhere(radius > 0.01).tolist()
        ]

    def _cells(self, discs: list[Disc]) -> npt.NDArray[np.bool_]:
        """The free cells whose centres are closer to a disc than planners keep."""
        grid = self._grid
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

    def _obstructed(self, tick: int, pose: Pose, guide: TrackedPath, arc: float) -> bool:
        """Whether a mover covers a place of the route ahead soon."""
        discs = self._discs(tick, pose)
        if not discs:
            return False
        ahead = np.arange(arc, min(arc + self.settings.within, guide.length), 0.1)
        if not len(ahead):
            return False
        line = np.stack([np.interp(ahead, guide.route.arc, guide.route.xy[:, k]) for k in (0, 1)], axis=1)
        movers = np.array([(d.x, d.y, d.radius) for d in discs])
        gaps = np.hypot(*np.moveaxis(line[:, None] - movers[None, :, :2], -1, 0)) - movers[:, 2]
        return bool((gaps < self._grid.inflate).any())


class CellwiseMonitor(ReplanMonitor):
    """A robot that decides cell by cell, as hasan's does: the route is never longer than the cells decided on."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        query = Query.between(self._grid, self._task)
        self._online = online_for(self._planner, query, self._rng)
        self._goal = query.goal

    @property
    def waits(self) -> bool:
        """Whether it may have a way on later where it has none now."""
        return not self._online.arrived

    def cause(self, tick: int, pose: Pose, waits: bool, guide: TrackedPath, arc: float) -> str:
        """A decision is due before the end of the last is reached, and again and again while the robot waits."""
        if tick == 0:
            return DECISION
        if self._online.arrived or tick / self._hz - self._rest < DECIDE:
            return ""
        return DECISION if guide.length - arc < 0.6 * self._grid.cell else ""

    def again(self, tick: int, pose: Pose, cause: str) -> TrackedPath | None:
        """The way on to the next cell; None: wait."""
        if cause == MISSED:  # or else it waits, and the next decision is due in a while
            return super().again(tick, pose, cause) if self._online.arrived else None
        self._rest, started = tick / self._hz, time.perf_counter()
        here, propagated = self._online.cell, self._online.tally.propagated
        blocked = self._cells(self._covered(tick, np.array([pose[:2]]), 0.0))
        to = self._online.step(np.argwhere(blocked))
        ends = self._grid.xy(np.array([here, to or here]))
        if to == self._goal and self._clear(ends[0], self._task.goal):
            ends[1] = self._task.goal
        near = math.dist(pose[:2], ends[0]) <= 0.25 * self._grid.cell or tick == 0
        xy = np.vstack([pose[:2], ends[1 if near and self._clear(pose[:2], ends[1]) else 0 :]])
        moved = to is not None and bool(np.ptp(xy, axis=0).any())
        cost = polyline_length(xy)
        work = self._online.tally.propagated - propagated
        if moved:
            self.log.append(Replan(tick / self._hz, cause, True, cost, work, xy, time.perf_counter() - started))
        if not moved and tick == 0:  # it waits where it is, and does not set out by the plan of all the way
            xy = np.array(pose[:2]) + 1e-4 * np.array([(0.0, 0.0), (math.cos(pose[2]), math.sin(pose[2]))])
        return self._guide(Route(xy)) if moved or tick == 0 else None

    def _clear(self, a: tuple[float, ...] | Floats, b: tuple[float, ...] | Floats) -> bool:
        """Whether the straight way between two points keeps what planners keep from all that stands."""
        return bool(segment_clearance(self._task.world, np.array([a]), np.array([b]))[0] >= self._grid.inflate - 1e-9)


def _with(task: Task, discs: list[Disc]) -> Task:
    """A task among more discs."""
    obstacles = (*task.world.obstacles, *discs)
    return dataclasses.replace(task, world=dataclasses.replace(task.world, obstacles=obstacles))


def _place(route: Route, arc: float) -> tuple[float, float]:
    x, y = (float(np.interp(arc, route.arc, route.xy[:, k])) for k in (0, 1))
    return x, y
