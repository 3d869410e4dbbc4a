"""The parts of a drive and what each answers. `antdrive.sim.compose` chooses them; nobody else asks which kind a part is.

One control period: the plant says where the robot is, the localiser estimates it, the map takes a scan and may correct the
estimate, the guide says which path to follow, the rules make the command, and the plant executes it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Pose
from antdrive.robots import PursuitState, TrackedPath, Twist
from antdrive.sim.log.outcome import Outcome

if TYPE_CHECKING:
    from antdrive.planners import PlanResult
    from antdrive.sim.driving.driver import StuckClock
    from antdrive.sim.driving.replanning import Replan
    from antdrive.sim.physics.engine import State
    from antdrive.worlds import Grid, Route


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


class Map(Protocol):
    """The map that a robot drives by: given, given and watched by lidar, or its own."""

    def scan(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """Take a scan from the true pose if one is due; the estimate, which the scan may correct."""


class Others(Protocol):
    """The movers as the robot perceives them: ground truth (`Told`), or tracks (`Tracked`)."""

    @property
    def guesses(self) -> bool:
        """Whether movers may do something else than is predicted."""

    def predict(self, tick: int, robot: tuple[float, float], ahead: Floats) -> tuple[Floats, Floats]:
        """The positions (K, M, 2) [m] of the perceived movers at times ahead (K,) [s], and their radii (M,) [m]."""

    def perceived(self, tick: int, robot: tuple[float, float]) -> tuple[npt.NDArray[np.int64], Floats]:
        """The numbers (P,) of the perceived movers, and the positions of all by number (M, 2) [m]."""

    def within_range(self, tick: int, robot: tuple[float, float]) -> npt.NDArray[np.int64]:
        """The numbers (P,) of the perceived movers."""

    def radius_of(self, mover: int) -> float:
        """The radius of a mover [m]."""

    def name_of(self, mover: int) -> str:
        """What people call a mover."""


class Guide(Protocol):
    """Says which path to follow during a drive. What is implemented here holds where it is always the same."""

    log: list[Replan]  # the attempts to find a new route
    wrong: str = ""  # what is wrong with a plan that the planner gave during the drive; empty if nothing is
    blocked: str = ""  # which mover closes every way, once the robot has no patience left; empty before

    @property
    def may_wait(self) -> bool:
        """Whether a robot at the end of its route may wait there for a way on."""
        return False

    @property
    def scans(self) -> bool:
        """Whether the robot makes a scan turn."""
        return False

    def update(self, tick: int, pose: Pose, waiting: bool, path: TrackedPath, arc: float) -> TrackedPath | None:
        """A new path, if one is due and there is one."""
        return None

    def refreshed(self, path: TrackedPath, pose: Pose) -> TrackedPath:
        """The same path with the obstacles near the robot that are known by now."""
        return path

    def replan(self, tick: int, pose: Pose, trigger: str) -> TrackedPath | None:
        """A new path, if there is one."""
        return None

    def missed(self, tick: int, pose: Pose) -> TrackedPath | None:
        """A new path for a robot that stands at the end of its route, but not at the goal."""
        return None

    def closer(self, tick: int, robot: tuple[float, float]) -> Floats | float:
        """How much closer than usual the robot may pass each perceived mover (P,) [m]."""
        return 0.0

    def no_way(self, tick: int) -> str:
        """What the guide adds to the reason of a drive that gets stuck or times out; may be empty."""
        return ""


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

    def explained(self, ending: Ending, tick: int) -> Ending:
        """The ending with what the decider knows of its reason."""
        return ending
