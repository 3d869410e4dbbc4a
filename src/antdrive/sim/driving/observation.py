"""Observations of a robot, and its notes on commands. Nothing here holds what is true."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Pose
from antdrive.robots import Twist
from antdrive.sim.driving.parts import Ending

if TYPE_CHECKING:
    from antdrive.worlds import World


class Movers(NamedTuple):
    """Movers that a robot is given in a control period."""

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
    """What a robot knows in one control period."""

    tick: int  # the number of the control period
    pose: Pose  # estimated pose
    pending: tuple[Twist, ...]  # the commands that have not reached the motors yet, oldest first
    twist: Twist  # measured speed and yaw rate
    scan: Floats | None = None  # ranges of a scan (beams,) [m]; None if none was due
    movers: Movers = NOBODY  # movers that it is given


class Note(NamedTuple):
    """What a robot tells of a command."""

    pose: Pose | None = None  # the pose in which it believes, such as one corrected by a scan; None: as observed
    limiter: int = 0  # the rule that limited the speed, an index into the record's `limiters`
    ending: Ending | None = None  # why it gives up: at once without a command, else after the control period


SILENT = Note()
