"""Plain pure pursuit.

R. C. Coulter, *Implementation of the pure pursuit path tracking algorithm*, CMU-RI-TR-92-01, Carnegie Mellon University, 1992.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from antdrive.base.plane import wrap_angle
from antdrive.base.records import require_ranges
from antdrive.robots.control.observation import Briefing, Observation, Twist
from antdrive.robots.control.pursuit import TrackedPath


def turn_on_spot(bearing: float, path: TrackedPath) -> Twist:
    """Return the command of a turn on the spot that stops at a bearing of 0 [rad].

    The yaw rate is sqrt(a |bearing|), half of the square of the one from which the robot can stop in time.
    """
    return Twist(0.0, math.copysign(math.sqrt(path.limits.yaw_acceleration * abs(bearing)), bearing))


@dataclass(frozen=True, kw_only=True)
class Coulter:
    """Plain pure pursuit: the arc to a point of the path at a fixed lookahead.

    With the carrot at (x, y) in the robot's frame and at distance L, the arc through both has the curvature
    `k = 2 y / L^2`. The paper assumes a vehicle that already faces along the path; here a robot turns
    on the spot while the carrot is more than `turn_above` to its side. The speed is that of `TrackedPath.speed_limit`.

    Known weaknesses: it cuts corners by up to the lookahead, knows no obstacles, and weaves where the lookahead is short for
    the speed.

    Attributes:
        lookahead: distance to the carrot [m]
        turn_above: bearing of the carrot above which the robot turns on the spot [rad]

    Raises:
        FieldError: an option is out of range.
    """

    lookahead: Annotated[float, Interval(ge=1e-3, le=100.0)] = 0.5
    turn_above: Annotated[float, Interval(ge=0.01, le=math.pi)] = 1.2

    def __post_init__(self) -> None:
        require_ranges(self)

    def start(self, briefing: Briefing, path: TrackedPath) -> float:
        """Return the state for a new path: progress along it [m]."""
        return 0.0

    def step(self, now: Observation, path: TrackedPath, arc: float) -> tuple[Twist, float]:
        """Return the command on the arc to the carrot, and the progress [m]."""
        x, y, yaw = now.pose
        arc = path.nearest(now.pose, arc)
        ahead = path.carrot(now.pose, arc, self.lookahead)
        bearing = float(wrap_angle(math.atan2(ahead[1] - y, ahead[0] - x) - yaw))
        if not path.speed_limit(arc):
            return Twist(0.0, 0.0), arc
        if abs(bearing) > self.turn_above:
            return turn_on_spot(bearing, path), arc
        away = max(math.dist(ahead, (x, y)), 1e-6)
        curvature = 2 * math.sin(bearing) / away
        speed = path.speed_limit(arc, curvature)
        return Twist(speed, curvature * speed), arc
