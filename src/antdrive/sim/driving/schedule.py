"""Schedules of plans in space and time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from antdrive.base import Floats
from antdrive.base.plane import arc_lengths
from antdrive.planners import TimedPlan
from antdrive.worlds import Route

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
