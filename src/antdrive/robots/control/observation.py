"""Observations and commands: what a controller knows, and what it may ask for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from antdrive.base import Floats, Point, Pose
from antdrive.robots.spec import RobotSpec
from antdrive.worlds import World

NO_MOVERS: Floats = np.empty((0, 5))
NO_MOVERS.setflags(write=False)


class Twist(NamedTuple):
    """A velocity of the robot.

    Attributes:
        speed: forward speed [m/s]
        yaw_rate: counter-clockwise yaw rate [rad/s]
    """

    speed: float
    yaw_rate: float


class Observation(NamedTuple):
    """What a controller knows in one control period.

    Attributes:
        tick: the number of the control period
        t: time since the start [s]
        pose: estimated pose when the command takes effect [m, m, rad]
        twist: measured velocity
        command: the command of the previous period, which later rules may have changed
        scan: ranges of a lidar scan (beams,) [m]; None if none was made in this period
        movers: perceived movers: position [m, m], velocity [m/s, m/s] and radius [m] (M, 5)
    """

    tick: int
    t: float
    pose: Pose
    twist: Twist
    command: Twist
    scan: Floats | None = None
    movers: Floats = NO_MOVERS


@dataclass(frozen=True, kw_only=True)
class Briefing:
    """What a controller is given before it follows a path.

    Attributes:
        robot: the robot
        goal: the goal [m, m]
        tolerance: goal tolerance [m]
        map: the static obstacles; None for a mapless robot
        hz: control periods per second
    """

    robot: RobotSpec
    goal: Point
    tolerance: float
    map: World | None
    hz: int


@dataclass(frozen=True, kw_only=True)
class ControllerCapabilities:
    """Capabilities of a controller.

    Attributes:
        turns: follows routes of lines with turns on the spot (`Route.turns`), which plans for footprints need
        avoids_movers: keeps clear of movers itself; for other controllers local avoidance changes the commands
    """

    turns: bool = False
    avoids_movers: bool = False
