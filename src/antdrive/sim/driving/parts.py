"""Commands of a drive, notes on them, its ending, and rows of its log."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point, Pose
from antdrive.robots import LIMITERS, PursuitState, Twist
from antdrive.robots.control.observation import REST, Observation
from antdrive.sim.log.ending import STUCK_PROGRESS, STUCK_TIME, arrived
from antdrive.sim.log.outcome import Outcome

EXPLORING_LIMITERS = (*LIMITERS, "sight")  # names of the limiting rules of a mapless robot
SIGHT_LIMIT = EXPLORING_LIMITERS.index("sight")


class Ending(NamedTuple):
    """Outcome of a drive, with details."""

    outcome: Outcome  # how the drive ended
    reason: str = ""  # details beyond the outcome's sentence; may be empty


class Note(NamedTuple):
    """What a robot tells of a command."""

    pose: Pose | None = None  # the pose in which it believes, such as one corrected by a scan; None: as observed
    limiter: int = 0  # the rule that limited the speed, an index into the record's `limiters`
    ending: Ending | None = None  # why it gives up: at once without a command, else after the control period


SILENT = Note()


def at_goal(now: Observation, believed: Pose, goal: Point, tolerance: float) -> bool:
    """Return whether a robot stands at the goal by the pose in which it believes, once it has had a command."""
    return now.tick > 0 and now.standing and arrived(believed, REST, now.command, goal, tolerance)


class Step(NamedTuple):
    """Command and controller state of one control period."""

    command: Twist = REST  # the commanded twist
    # the controller's state: progress along the path, and the rule that limited the speed
    pursuit: PursuitState = PursuitState()
    speed_limit: float = math.inf  # speed limit of the schedule [m/s]
    avoids: bool = False  # whether avoidance chose the command, even if a later rule slowed it
    waits: bool = False  # whether the robot waits on purpose, which does not count as being stuck


class StuckClock(NamedTuple):
    """Time without progress along the route. Waiting for a mover does not count."""

    farthest: float = 0.0  # farthest arc length that the robot has reached [m]
    driving: int = 0  # control periods since then with a driving command
    turning: int = 0  # control periods since then with a turn on the spot
    held: int = 0  # number of these periods limited by the stopping constraint

    def after(self, pursuit: PursuitState, waiting: bool) -> StuckClock:
        """Return the clock after one more control period."""
        if pursuit.arc > self.farthest + STUCK_PROGRESS:
            return StuckClock(pursuit.arc)
        if waiting:
            return self
        held = self.held + (pursuit.limiter == SIGHT_LIMIT)
        if pursuit.turning:
            return StuckClock(self.farthest, self.driving, self.turning + 1, held)
        return StuckClock(self.farthest, self.driving + 1, self.turning, held)

    @property
    def reason(self) -> str:
        """Reason for the outcome `STUCK`."""
        why = f"no progress along the route for {STUCK_TIME:g} s"
        if 2 * self.held > self.driving + self.turning:
            return f"{why}; its sight held it: it had seen no free ground where it was to go"
        return why


@dataclass(frozen=True, eq=False)
class Drive:
    """Log of a drive: T rows, one per physics step; row 0 is the start."""

    outcome: Outcome  # how the drive ended
    reason: str  # details beyond the outcome's sentence; may be empty
    t: Floats  # times since the start (T,) [s]
    pose: Floats  # true poses of the axle's centre (T, 3) [m, m, rad]
    twist: Floats  # measured speeds and yaw rates (T, 2) [m/s, rad/s]
    command: Floats  # commands in force before each row (T, 2) [m/s, rad/s]
    clearance: Floats  # distances from the footprint to the nearest obstacle, mover or wall (T,) [m]
    limiter: np.ndarray[tuple[int], np.dtype[np.uint8]]  # limiting rule (T,), an index into `LIMITERS`
    movers: Floats  # positions of the movers (T, M, 2) [m]
    contacts: Floats  # one row per contact (K, 4): row, obstacle, distance [m], force [N]
    actuated: Floats  # motor targets (T, 2) [m/s, rad/s]
    physics: str  # why contacts in physics are no evidence, see `Engine.audit`; else empty


def table_logged(
    taken: Iterable[tuple[int, npt.NDArray[Any]]], columns: int, log: Drive, per_tick: int
) -> npt.NDArray[np.float32]:
    """Return a table (K, columns) of a log: entries noted in control periods; each begins with the log row of its period."""
    kept = [(tick * per_tick, lines) for tick, lines in taken if tick * per_tick < len(log.t)]
    tables = [np.column_stack((np.full(len(lines), row), lines)) for row, lines in kept]
    return np.concatenate(tables or [np.empty((0, columns))]).astype(np.float32)
