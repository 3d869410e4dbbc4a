"""Steering of the robot Stanley.

S. Thrun et al., *Stanley: The robot that won the DARPA Grand Challenge*, Journal of Field Robotics 23(9), 2006.
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
from antdrive.robots.controllers.coulter import turn_on_spot


@dataclass(frozen=True, kw_only=True)
class Stanley:
    """Stanley's steering: heading error plus the arctangent of the cross-track error.

    The law: `delta = psi + arctan(k e / u)` with the path's heading `psi` relative to the vehicle, the
    cross-track error `e` of the front axle and the speed `u`. A differential drive steers as a vehicle of a virtual wheelbase
    `L` whose rear axle is the robot's: its yaw rate is `u tan(delta) / L`. `softening` is added to the speed, so that a slow
    robot does not steer hard. A robot that faces away from the path by more than `turn_above` turns on the spot. The speed
    is that of `TrackedPath.speed_limit`.

    Known weaknesses: it reacts to the nearest point only, so that it steers late at corners of routes without smoothing; it
    knows no obstacles.

    Attributes:
        gain: k, the rate at which the cross-track error decays [1/s]
        softening: added to the speed [m/s]
        wheelbase: L, the distance of the virtual front axle ahead of the robot [m]
        max_steering: limit of the steering angle [rad]
        turn_above: heading error above which the robot turns on the spot [rad]

    Raises:
        FieldError: an option is out of range.
    """

    gain: Annotated[float, Interval(ge=1e-3, le=100.0)] = 1.5
    softening: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.1
    wheelbase: Annotated[float, Interval(ge=1e-3, le=10.0)] = 0.2
    max_steering: Annotated[float, Interval(ge=0.01, le=1.5)] = 1.0
    turn_above: Annotated[float, Interval(ge=0.01, le=math.pi)] = 1.2

    def __post_init__(self) -> None:
        require_ranges(self)

    def start(self, briefing: Briefing, path: TrackedPath) -> float:
        """Return the state for a new path: progress of the front axle along it [m]."""
        return 0.0

    def step(self, now: Observation, path: TrackedPath, arc: float) -> tuple[Twist, float]:
        """Return the command of the steering law, and the progress [m]."""
        x, y, yaw = now.pose
        front = x + self.wheelbase * math.cos(yaw), y + self.wheelbase * math.sin(yaw), yaw
        arc, here = path.nearest(front, arc), path.nearest(now.pose, max(arc - self.wheelbase, 0.0))
        px, py, along = path.pose_at(arc)
        heading = float(wrap_angle(along - yaw))
        if not path.speed_limit(here):
            return Twist(0.0, 0.0), arc
        if abs(heading) > self.turn_above:
            return turn_on_spot(heading, path), arc
        aside = (py - front[1]) * math.cos(along) - (px - front[0]) * math.sin(along)  # the path is to the left
        steering = heading + math.atan2(self.gain * aside, max(now.command.speed, 0.0) + self.softening)
        curvature = math.tan(min(max(steering, -self.max_steering), self.max_steering)) / self.wheelbase
        speed = path.speed_limit(here, curvature)
        return Twist(speed, curvature * speed), arc
