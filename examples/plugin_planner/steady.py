"""A controller that steers in proportion to the bearing of a point ahead."""

from __future__ import annotations

import math
from dataclasses import dataclass

from antdrive.base import wrap_angle
from antdrive.robots import Briefing, Observation, TrackedPath, Twist


@dataclass(frozen=True, kw_only=True)
class Steady:
    """Proportional steering towards a point of the path.

    Attributes:
        gain: yaw rate per bearing [1/s]
        lookahead: distance to the point [m]
    """

    gain: float = 2.0
    lookahead: float = 0.4

    def start(self, briefing: Briefing, path: TrackedPath) -> float:
        """Return the progress along a new path [m]."""
        return 0.0

    def step(self, now: Observation, path: TrackedPath, arc: float) -> tuple[Twist, float]:
        """Return the command, and the progress [m]."""
        x, y, yaw = now.pose
        arc = path.nearest(now.pose, arc)
        ahead = path.carrot(now.pose, arc, self.lookahead)
        bearing = float(wrap_angle(math.atan2(ahead[1] - y, ahead[0] - x) - yaw))
        return Twist(path.speed_limit(arc) * max(0.0, math.cos(bearing)), self.gain * bearing), arc
