"""Keeping to a plan that says when: not too early, and to be told when too late."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from antdrive.planners.graph.sipp import TimedPlan
from antdrive.robots import Twist
from antdrive.worlds import Floats, Route
from antdrive.worlds.plane import arc_lengths

LOOK = 0.4  # the robot drives so as to be where it should be in this time [s]
LATE = 0.5  # behind by more than this it needs another plan [m]


@dataclass(frozen=True, eq=False)
class Schedule:
    """Where along a route the robot should be at each time."""

    t: Floats  # (N,) [s]
    arc: Floats  # (N,) [m]

    @classmethod
    def of(cls, plan: TimedPlan, route: Route) -> Schedule:
        """A timed plan's, along the route through its cells."""
        covered = arc_lengths(plan.xy)
        share = covered / covered[-1] if covered[-1] > 0 else covered
        return cls(np.stack([plan.arrive, plan.leave], axis=1).ravel(), np.repeat(share * route.length, 2))

    def due(self, t: float) -> float:
        """How far along the route the robot should be [m]."""
        return float(np.interp(t, self.t, self.arc))

    def late(self, t: float, arc: float) -> bool:
        """Whether the robot is too far behind."""
        return self.due(t) - arc > LATE

    def speed(self, t: float, arc: float) -> float:
        """How fast it may go on, so as not to be early [m/s]."""
        return max(0.0, self.due(t + LOOK) - arc) / LOOK if t + LOOK < self.t[-1] else math.inf


def held(command: Twist, last: Twist, speed: float, most: float) -> Twist:
    """A command slowed to a speed, along the same curve, losing no more than `most` [m/s]."""
    v = max(min(command.speed, speed), min(command.speed, last.speed - most))
    return Twist(v, command.yaw_rate * v / command.speed) if command.speed > 0 else command
