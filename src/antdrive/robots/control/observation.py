"""Observations, briefings and commands of a robot. Nothing here holds what is true."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point, Pose
from antdrive.robots.spec import RobotSpec
from antdrive.worlds import World


class Twist(NamedTuple):
    """A velocity of the robot.

    Attributes:
        speed: forward speed [m/s]
        yaw_rate: counter-clockwise yaw rate [rad/s]
    """

    speed: float
    yaw_rate: float


def finite_twist(command: Any) -> Twist | None:
    """Return a command of two finite numbers, speed [m/s] and yaw rate [rad/s]; None for anything else."""
    if not isinstance(command, tuple | list | np.ndarray):
        return None
    try:
        speed, yaw_rate = (math.nan if isinstance(one, str | bytes) else float(one) for one in command)
    except (TypeError, ValueError, OverflowError):
        return None
    return Twist(speed, yaw_rate) if math.isfinite(speed) and math.isfinite(yaw_rate) else None


REST = Twist(0.0, 0.0)


class Movers(NamedTuple):
    """Movers that a robot perceives in a control period."""

    numbers: npt.NDArray[np.int64]  # (P,)
    positions: Floats  # (P, 2) [m]
    velocities: Floats  # (P, 2) [m/s]
    radii: Floats  # (P,) [m]


NOBODY = Movers(np.empty(0, dtype=np.int64), np.empty((0, 2)), np.empty((0, 2)), np.empty(0))


class FirstSight(NamedTuple):
    """What a mapless robot is given at its start."""

    ground: World  # what stands around the start
    ranges: Floats  # the first scan (beams,) [m]


class Observation(NamedTuple):
    """What a robot knows in one control period.

    Attributes:
        tick: the number of the control period
        t: time since the start [s]
        pose: estimated pose; for a controller, when its command takes effect
        twist: velocity as odometry measures it
        command: the last command
        pending: the commands that have not reached the motors yet, oldest first
        scan: ranges of a scan (beams,) [m]; None if none was due
        movers: perceived movers; a session gives those within 2 m beyond the range, too
        standing: whether the robot neither drives nor turns
    """

    tick: int
    t: float
    pose: Pose
    twist: Twist
    command: Twist = REST
    pending: tuple[Twist, ...] = ()
    scan: Floats | None = None
    movers: Movers = NOBODY
    standing: bool = True


@dataclass(frozen=True, eq=False)
class Briefing:
    """What a robot knows before its drive.

    Attributes:
        robot: the robot
        start: the first pose: x, y [m] and yaw [rad], known exactly
        goal: the goal [m]
        tolerance: distance to the goal at which the robot has arrived [m]
        hz: control periods per second
        map: the static obstacles; None for a mapless robot
        sight: what a mapless robot is given at its start
        matching: whether scans may correct the observed poses
        movers: number of all movers
        motions: positions (K, M, 2) [m] at times (K,) [s], if it is given them
    """

    robot: RobotSpec
    start: Pose
    goal: Point
    tolerance: float
    hz: int
    map: World | None = None
    sight: FirstSight | None = None
    matching: bool = False
    movers: int = 0
    motions: Callable[[Floats], Floats] | None = None


@dataclass(frozen=True, kw_only=True)
class ControllerCapabilities:
    """Capabilities of a controller.

    Attributes:
        turns: follows routes of lines with turns on the spot (`Route.turns`), which plans for footprints need
        avoids_movers: keeps clear of movers itself; for other controllers local avoidance changes the commands
    """

    turns: bool = False
    avoids_movers: bool = False
