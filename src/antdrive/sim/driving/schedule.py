"""Following a plan in time: neither ahead of its schedule nor, without a new plan, far behind it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from antdrive.base import Floats
from antdrive.base.plane import arc_lengths
from antdrive.planners.graph.sipp import TimedPlan
from antdrive.robots import Twist
from antdrive.worlds import Route

LOOKAHEAD = 0.4  # the speed limit leads to where the schedule is this much later [s]
MAX_LAG = 0.5  # a robot farther behind its schedule than this is late [m]


@dataclass(frozen=True, eq=False)
class Schedule:
    """Where along its route the robot should be at each time; linear in between."""

    t: Floats  # times (N,) [s]
    arc: Floats  # distances along the route at those times (N,) [m]

    @classmethod
    def of(cls, plan: TimedPlan, route: Route) -> Schedule:
        """The schedule of a timed plan, along the route through the plan's cells."""
        covered = arc_lengths(plan.xy)
        share = covered / covered[-1] if covered[-1] > 0 else covered
        return cls(np.stack([plan.arrive, plan.leave], axis=1).ravel(), np.repeat(share * route.length, 2))

    def due(self, t: float) -> float:
        """How far along the route [m] the robot should be at time `t` [s]."""
        return float(np.interp(t, self.t, self.arc))

    def late(self, t: float, arc: float) -> bool:
        """Whether a robot at distance `arc` [m] at time `t` [s] is more than `MAX_LAG` behind."""
        return self.due(t) - arc > MAX_LAG

    def speed_limit(self, t: float, arc: float) -> float:
        """The speed [m/s] that keeps a robot at `arc` [m] from getting ahead at time `t` [s]; inf at the end."""
        if t + LOOKAHEAD >= self.t[-1]:
            return math.inf
        return max(0.0, self.due(t + LOOKAHEAD) - arc) / LOOKAHEAD


def slow_down(command: Twist, last: Twist, limit: float, max_change: float) -> Twist:
    """A command slowed down to a speed limit on the same curve, as far as the robot can brake."""
    if command.speed <= 0:
        return command
    v = max(min(command.speed, limit), min(command.speed, last.speed - max_change))
    return Twist(v, command.yaw_rate * v / command.speed)
