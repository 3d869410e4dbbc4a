"""Guides, which provide a driver's path, with the schedules of plans in space and time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.base.plane import arc_lengths
from antdrive.planners import TimedPlan
from antdrive.robots import Observation, TrackedPath
from antdrive.sim.driving.blockage import Blockage
from antdrive.sim.driving.parts import Drive, Ending, Step, StuckClock
from antdrive.sim.driving.recovery import ScanTurn
from antdrive.sim.driving.route_planner import RoutePlanner
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ReplanRecord, finite_or_none
from antdrive.sim.policy import Trigger
from antdrive.worlds import Route

NO_ROUTE: Floats = np.empty((0, 2))
LOOKAHEAD = 0.4  # lookahead of the schedule's speed limit [s]
MAX_LAG = 0.5  # a robot farther behind its schedule is late [m]
ROUNDING = 1e-6  # arc lengths this close are one [m]


@dataclass(frozen=True, eq=False)
class Schedule:
    """Target arc length over time, linear in between.

    On a route with turns it begins at the first cell, to which the robot drives at once.
    """

    t: Floats  # times (N,) [s]
    arc: Floats  # distances along the route at those times (N,) [m]
    # Distances along the route at which the robot stops to turn on the spot (C,) [m].
    corners: Floats = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, plan: TimedPlan, route: Route) -> Schedule:
        """Create the schedule of a timed plan along the route through its cells."""
        covered, t = arc_lengths(plan.xy), np.stack([plan.arrive, plan.leave], axis=1).ravel()
        if route.turns is not None:
            lead = route.arc[np.hypot(*(route.xy[:2] - plan.xy[0]).T).argmin()]
            return cls(t, np.repeat(lead + covered, 2), route.arc[route.turns != 0.0])
        share = covered / covered[-1] if covered[-1] > 0 else covered
        return cls(t, np.repeat(share * route.length, 2))

    def due(self, t: float) -> float:
        """Return the target arc length [m] at time `t` [s]."""
        return float(np.interp(t, self.t, self.arc))

    def late(self, t: float, arc: float) -> bool:
        """Return whether a robot at `arc` [m] is more than `MAX_LAG` behind at time `t` [s]."""
        return self.due(t) - max(arc, self.arc.item(0)) > MAX_LAG

    def speed_limit(self, t: float, arc: float) -> float:
        """Return the speed [m/s] that keeps a robot at `arc` [m] at time `t` [s] from getting ahead.

        It is infinite at the end, and up to a corner that is due: the sooner the robot is there, the sooner it turns.
        """
        due = self.due(t + LOOKAHEAD)
        nearing = arc < due - ROUNDING and bool((np.abs(self.corners - due) < ROUNDING).any())
        if nearing or t + LOOKAHEAD >= self.t[-1]:
            return math.inf
        return max(0.0, due - arc) / LOOKAHEAD


@dataclass(frozen=True, eq=False)
class Follow:
    """Path to follow."""

    path: TrackedPath
    schedule: Schedule | None = None  # target position over time; None without a timed plan
    blockage: Blockage | None = None  # standing movers that the robot may pass more closely


@dataclass(frozen=True, eq=False)
class Wait(Follow):
    """Stop on the way, since there is no path or a scan turn is due."""

    scan_turn: ScanTurn | None = None


class GiveUp(NamedTuple):
    """End of the drive."""

    ending: Ending | None = None  # None: as the referee judges a robot that stands


class Moment(NamedTuple):
    """Input of guide and rules in one control period."""

    observed: Observation  # with the estimated pose when the command takes effect
    way: Follow  # the current way; the guide gets the last one
    before: Step  # the step of the previous control period
    clock: StuckClock  # time without progress
    waiting: bool = False  # whether the robot stands to let a mover pass

    @property
    def tick(self) -> int:
        """The number of the control period."""
        return self.observed.tick

    @property
    def pose(self) -> Pose:
        """Estimated pose when the command takes effect."""
        return self.observed.pose


class Rule(Protocol):
    """Control rule that refines the step of the rules before it."""

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the step, modified if the rule requires it."""


class Guide:
    """Path provider during a drive. This one keeps the path that it is given.

    Attributes:
        log: searches for a new route
        walls: their wall times [s]
    """

    footprint_margin: float | None = None  # clearance of plans that keep the footprint clear [m]; None: the disc

    def __init__(self) -> None:
        self.log: list[ReplanRecord] = []
        self.walls: list[float] = []

    def path(self, now: Moment, *, at_end: bool = False) -> Follow | Wait | GiveUp:
        """Return the way of a control period; `at_end`: of a robot that its rules stop at the end of the route, off the goal."""
        return GiveUp() if at_end else now.way

    def failure_note(self, tick: int) -> str:
        """Return the guide's addition to the reason of a drive that is stuck or timed out; may be empty."""
        return ""

    def logged(self, log: Drive, per_tick: int) -> dict[str, Any]:
        """Return the guide's arrays for the log."""
        return {}


class RouteGuide(Guide):
    """Guide with a route planner. The defaults keep the first route.

    Attributes:
        schedule: that of the timed plan; None without one
        blockage: failed searches behind standing movers; None if it does not replan among them
    """

    schedule: Schedule | None = None
    blockage: Blockage | None = None
    _last: Follow | None = None
    _may_wait = False  # whether a robot at the end of its route may wait for a new one

    def __init__(self, planner: RoutePlanner) -> None:
        super().__init__()
        self._routes, self._hz = planner, planner.hz

    @property
    def footprint_margin(self) -> float | None:  # type: ignore[override]
        """Clearance of plans that keep the footprint clear [m]; None while all keep the disc clear."""
        return self._routes.footprint_margin

    def path(self, now: Moment, *, at_end: bool = False) -> Follow | Wait | GiveUp:
        """Return the way of a control period, along a new route if one is due and found."""
        path = now.way.path
        if at_end and self._may_wait:
            return self._way(path)
        trigger = Trigger.MISSED if at_end else self.trigger(now)
        found = self.replan(now, trigger) if trigger else None
        if at_end and not found and self._may_wait:
            return self._way(path)
        if error := self._routes.plan_error:
            return GiveUp(Ending(Outcome.INVALID_PLAN, f"on the way, at t = {now.observed.t:g} s: {error}"))
        if at_end:
            return self._way(found) if found else GiveUp()
        if self.blockage is not None and self.blockage.reason:
            return GiveUp(Ending(Outcome.BLOCKED, self.blockage.reason))
        return self._way(self._refreshed(found or path, now.pose))

    def trigger(self, now: Moment) -> str:
        """Return why a new path is due; empty if none is."""
        return ""

    def replan(self, now: Moment, trigger: str) -> TrackedPath | None:
        """Return a new path; None if there is none."""
        return None

    def _refreshed(self, path: TrackedPath, pose: Pose) -> TrackedPath:
        """Return the path with the latest obstacles near the robot."""
        return path

    def _way(self, path: TrackedPath) -> Follow:
        if self._last is None or path is not self._last.path:
            self._last = Follow(path, self.schedule, self.blockage)
        return self._last

    def note(
        self, t: float, trigger: str, wall_s: float = 0.0, work: int = 0, cost: float = math.inf, xy: Floats = NO_ROUTE
    ) -> None:
        """Log a search for a new route (N, 2) [m] and the plan's cost [m]."""
        points = tuple(map(tuple, np.round(xy, 4).tolist()))
        self.log.append(
            ReplanRecord(
                t=t, trigger=str(trigger), solved=len(xy) > 0, cost_m=finite_or_none(cost), work=work, route=points
            )
        )
        self.walls.append(wall_s)
