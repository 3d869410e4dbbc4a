"""Interfaces of a drive's parts. `antdrive.sim.compose` selects the implementations.

One control period: the plant returns the robot's state, the localiser estimates the pose, a due scan enters the map
and may correct the estimate, the guide provides the path, the rules compute the command, and the plant executes it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point, Pose
from antdrive.robots import LIMITERS, PursuitState, TrackedPath, Twist
from antdrive.sim.log.ending import STUCK_PROGRESS, STUCK_TIME
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ReplanRecord, finite_or_none

if TYPE_CHECKING:
    from antdrive.planners import PlanResult
    from antdrive.sim.driving.schedule import Schedule
    from antdrive.worlds import Grid, Route

EXPLORING_LIMITERS = (*LIMITERS, "sight")  # names of the limiting rules of a mapless robot
SIGHT_LIMIT = EXPLORING_LIMITERS.index("sight")
NO_ROUTE: Floats = np.empty((0, 2))


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


class Step(NamedTuple):
    """Command and controller state of one control period."""

    command: Twist = Twist(0.0, 0.0)  # the commanded twist
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


class Moment(NamedTuple):
    """Input of the rules in one control period."""

    tick: int  # the number of the control period
    pose: Pose  # estimated pose when the command takes effect
    path: TrackedPath  # the current path
    before: Step  # the step of the previous control period
    clock: StuckClock  # time without progress


class Rows(Protocol):
    """Rows of a log, one per physics step."""

    @property
    def t(self) -> Floats:
        """Times since the start (T,) [s]."""

    @property
    def pose(self) -> Floats:
        """True poses (T, 3) [m, m, rad]."""

    @property
    def actuated(self) -> Floats:
        """Motor targets (T, 2) [m/s, rad/s]."""


class Logs(Protocol):
    """Part that adds arrays to the log."""

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Return arrays by their names in `Rollout`; `per_tick` is the number of rows per control period."""


def table_logged(
    taken: Iterable[tuple[int, npt.NDArray[Any]]], columns: int, log: Rows, per_tick: int
) -> npt.NDArray[np.float32]:
    """Return a table (K, columns) of a log: entries noted in control periods; each begins with the log row of its period."""
    kept = [(tick * per_tick, lines) for tick, lines in taken if tick * per_tick < len(log.t)]
    tables = [np.column_stack((np.full(len(lines), row), lines)) for row, lines in kept]
    return np.concatenate(tables or [np.empty((0, columns))]).astype(np.float32)


class Guide(Protocol):
    """Path provider during a drive. The defaults keep one path."""

    log: list[ReplanRecord]  # searches for a new route
    walls: list[float]  # their wall times [s]
    schedule: Schedule | None = None  # target position over time; None without a timed plan

    @property
    def plan_error(self) -> str:
        """Why a plan made during the drive is invalid; empty if all are valid."""
        return ""

    @property
    def footprint_margin(self) -> float | None:
        """Clearance of plans that keep the footprint clear [m]; None while all keep the disc clear."""
        return None

    @property
    def blocked(self) -> str:
        """Description of the mover that blocks every route, once the robot's patience is over; else empty."""
        return ""

    @property
    def may_wait(self) -> bool:
        """Whether a robot at the end of its route may wait for a new one."""
        return False

    @property
    def scan_turning(self) -> bool:
        """Whether the robot makes a scan turn."""
        return False

    def trigger(self, tick: int, pose: Pose, waiting: bool, path: TrackedPath, arc: float) -> str:
        """Return why a new path is due; empty if none is."""
        return ""

    def refreshed(self, path: TrackedPath, pose: Pose) -> TrackedPath:
        """Return the path with the latest obstacles near the robot."""
        return path

    def replan(self, tick: int, pose: Pose, trigger: str) -> TrackedPath | None:
        """Return a new path; None if there is none."""
        return None

    def missed(self, tick: int, pose: Pose) -> TrackedPath | None:
        """Return a new path for a robot that stands at the end of its route, but not at the goal; None if there is none."""
        return None

    def clearance_reduction(self, tick: int, position: Point) -> Floats | float:
        """Return how much closer than usual the robot may pass each perceived mover (P,) [m]."""
        return 0.0

    def failure_note(self, tick: int) -> str:
        """Return the guide's addition to the reason of a drive that is stuck or timed out; may be empty."""
        return ""

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Return the guide's arrays for the log."""
        return {}

    def note(
        self, t: float, trigger: str, wall_s: float = 0.0, work: int = 0, cost: float = math.inf, xy: Floats = NO_ROUTE
    ) -> None:
        """Log a search for a new route (N, 2) [m] and the plan's cost [m]."""
        points = tuple(map(tuple, np.round(xy, 4).tolist()))
        self.log.append(
            ReplanRecord(
                t=t, trigger=str(trigger), solved=len(xy) > 0, cost_m=finite_or_none(cost), work=work, route=points
            )
        )
        self.walls.append(wall_s)


class RouteGuide(Guide, Protocol):
    """Guide that also plans the first route."""

    def first(self) -> tuple[Grid, PlanResult]:
        """Plan from the start; return the grid and the checked plan."""

    def accept(self, grid: Grid, plan: PlanResult) -> tuple[Grid, PlanResult]:
        """Check an external plan on the grid of `first`."""

    def route(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        """Return the route of a plan, and its path for the controller."""


class Rule(Protocol):
    """Control rule that refines the step of the rules before it."""

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the step, modified if the rule requires it."""
