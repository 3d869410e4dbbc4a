"""The parts of a drive and what each answers. `antdrive.sim.compose` chooses them; nobody else asks which kind a part is.

One control period: the plant says where the robot is, the localiser estimates it, the map takes a scan and may correct the
estimate, the guide says which path to follow, the rules make the command, and the plant executes it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from antdrive.base import Floats, Point, Pose
from antdrive.robots import PursuitState, TrackedPath, Twist
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ReplanRecord, finite_or_none

if TYPE_CHECKING:
    from antdrive.planners import PlanResult
    from antdrive.sim.driving.drive import StuckClock
    from antdrive.sim.driving.rules import Schedule
    from antdrive.sim.physics.engine import State
    from antdrive.worlds import Grid, Route

NO_ROUTE: Floats = np.empty((0, 2))


class Ending(NamedTuple):
    """How a drive ends."""

    outcome: Outcome  # the kind of ending
    reason: str = ""  # what the outcome's sentence leaves open; may be empty


class Step(NamedTuple):
    """What the robot does in one control period."""

    command: Twist = Twist(0.0, 0.0)  # the twist that is commanded
    # the controller's state: how far the robot has got, and what limited its speed
    pursuit: PursuitState = PursuitState()
    speed_limit: float = math.inf  # the speed that the schedule allows [m/s]
    avoids: bool = False  # whether the command avoids a mover, even if another rule then slowed it
    waits: bool = False  # whether the robot waits on purpose, so that the time does not count as being stuck
    arrived: bool = False  # whether the robot stands at the goal, where it gives way to a mover


class Moment(NamedTuple):
    """What the rules know in one control period."""

    tick: int  # the number of the control period
    pose: Pose  # where the robot believes that it will be when the command takes effect
    state: State  # where it is
    path: TrackedPath  # the path that it follows
    before: Step  # what it did in the control period before
    clock: StuckClock  # how long it has made no progress


class Plant(Protocol):
    """A robot that executes twists: in physics (`Bullet`), exactly (`Kinematic`), or as a log has it (`Logged`)."""

    state: State  # where the robot is and how fast

    @property
    def touched(self) -> bool:
        """Whether the robot has touched anything so far."""

    def advance(self, step: Step, actuated: Twist) -> None:
        """Drive for one control period with the twist that the wheels are set to."""


class Rows(Protocol):
    """The rows of a log, one for each physics step."""

    @property
    def t(self) -> Floats:
        """Times since the start (T,) [s]."""

    @property
    def pose(self) -> Floats:
        """True poses (T, 3) [m, m, rad]."""

    @property
    def actuated(self) -> Floats:
        """The twists that the motors were set to (T, 2) [m/s, rad/s]."""


class Logs(Protocol):
    """A part with arrays for the log."""

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """The arrays by the names of `Rollout`, of a drive with so many rows in a control period."""


class Localiser(Protocol):
    """Estimates the robot's pose; it also knows how commands reach the wheels."""

    def sense(self, state: State) -> Pose:
        """The estimated pose of a robot that is in a state. Call once in every control period."""

    def settle(self, estimate: Pose) -> Pose:
        """Go on from an estimate that a scan may have corrected; the pose expected when the next command takes effect."""

    def actuate(self, command: Twist) -> Twist:
        """The twist that the wheels are set to."""


#: Takes a scan in a control period from the true pose if one is due; returns the estimate, which the scan may correct.
Scanning: TypeAlias = Callable[[int, Pose, Pose], Pose]


class Guide(Protocol):
    """Says which path to follow during a drive. What is implemented here holds where it is always the same."""

    log: list[ReplanRecord]  # the attempts to find a new route
    walls: list[float]  # the wall times that they took [s]
    schedule: Schedule | None = None  # where the robot should be at each time; None: at no time in particular

    @property
    def plan_error(self) -> str:
        """What is wrong with a plan that the planner gave during the drive; empty if nothing is."""
        return ""

    @property
    def blocked(self) -> str:
        """Which mover closes every way, once the robot has no patience left; empty before."""
        return ""

    @property
    def may_wait(self) -> bool:
        """Whether a robot at the end of its route may wait there for a way on."""
        return False

    @property
    def scan_turning(self) -> bool:
        """Whether the robot makes a scan turn."""
        return False

    def trigger(self, tick: int, pose: Pose, waiting: bool, path: TrackedPath, arc: float) -> str:
        """Why a new path is due now; empty if none is."""
        return ""

    def refreshed(self, path: TrackedPath, pose: Pose) -> TrackedPath:
        """The same path with the obstacles near the robot that are known by now."""
        return path

    def replan(self, tick: int, pose: Pose, trigger: str) -> TrackedPath | None:
        """A new path, if there is one."""
        return None

    def missed(self, tick: int, pose: Pose) -> TrackedPath | None:
        """A new path for a robot that stands at the end of its route, but not at the goal."""
        return None

    def clearance_reduction(self, tick: int, position: Point) -> Floats | float:
        """How much closer than usual the robot may pass each perceived mover (P,) [m]."""
        return 0.0

    def failure_note(self, tick: int) -> str:
        """What the guide adds to the reason of a drive that gets stuck or times out; may be empty."""
        return ""

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """The guide's arrays for the log; usually none."""
        return {}

    def note(
        self, t: float, trigger: str, wall_s: float = 0.0, work: int = 0, cost: float = math.inf, xy: Floats = NO_ROUTE
    ) -> None:
        """Log an attempt to find a new route (N, 2) [m], and what it cost [m]."""
        points = tuple((x, y) for x, y in np.round(xy, 4).tolist())
        self.log.append(
            ReplanRecord(t=t, trigger=trigger, solved=len(xy) > 0, cost_m=finite_or_none(cost), work=work, route=points)
        )
        self.walls.append(wall_s)


class RouteGuide(Guide, Protocol):
    """A guide that also plans the first route."""

    def first(self) -> tuple[Grid, PlanResult]:
        """Plan from the start; the grid and the checked plan."""

    def accept(self, grid: Grid, plan: PlanResult) -> tuple[Grid, PlanResult]:
        """Check a plan that was made elsewhere on the grid of `first`."""

    def route(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        """Set out on a plan: its route, and the same prepared for the controller."""


class Rule(Protocol):
    """One rule of control. It gets what the rules before it decided."""

    def apply(self, now: Moment, step: Step) -> Step:
        """The step, changed where the rule asks for it."""


class Decider(Protocol):
    """Decides what the robot does: a `Driver`, a rehearsal, or a log."""

    step: Step  # what the robot does now

    @property
    def fraction(self) -> float:
        """The fraction of the route that is done."""
        return 0.0

    def decide(self, tick: int, pose: Pose, state: State) -> Ending | None:
        """Choose the step of one control period, or end the drive."""

    def gives_up(self, state: State) -> Ending | None:
        """End the drive after a control period that led to a state."""
        return None

    def with_reason(self, ending: Ending, tick: int) -> Ending:
        """The ending with what the decider knows of its reason."""
        return ending
