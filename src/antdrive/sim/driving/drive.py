"""Drive loop and driver: follow the guide, apply the rules, detect arrival and failure."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from antdrive.base import Pose
from antdrive.robots import PurePursuit, PursuitState, RobotSpec, TrackedPath, Twist
from antdrive.sim.driving.localising import Exact
from antdrive.sim.driving.parts import Decider, Ending, Guide, Localiser, Moment, Plant, Rule, Scanning, Step
from antdrive.sim.driving.plants import Bullet, Drive
from antdrive.sim.driving.rules import SIGHT_LIMIT, WAITING_SPEED, Pursuit
from antdrive.sim.log.ending import STUCK_PROGRESS, STUCK_TIME, arrived, control_periods, outcome_at, stopped
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.physics.engine import Engine, State
from antdrive.worlds import Task

PROGRESS_HZ = 10  # calls of `progress` per simulated second
#: Progress callback, called with the completed fraction of the route.
Progress = Callable[[float], None]


def ignore_progress(fraction: float) -> None:
    """Ignore the progress of a drive."""


def no_scan(tick: int, pose: Pose, estimate: Pose) -> Pose:
    """Return the estimate unchanged, for a robot without scans."""
    return estimate


def drive(
    plant: Plant,
    decider: Decider,
    localiser: Localiser,
    scan: Scanning = no_scan,
    *,
    hz: int,  # control periods per second
    limit: float,  # time limit [s]
    progress: Progress = ignore_progress,
) -> Ending:
    """Drive until the decider ends the drive, the robot touches something, or the time limit passes."""
    if plant.touched:
        return Ending(Outcome.COLLIDED)
    periods = control_periods(limit, hz)
    for tick in range(periods):
        ending = _control_period(tick, plant, decider, localiser, scan)
        if tick % (hz // PROGRESS_HZ or 1) == 0:
            progress(decider.fraction)
        if ending:
            return decider.with_reason(ending, tick)
    return decider.with_reason(Ending(Outcome.TIMED_OUT), periods)


def _control_period(tick: int, plant: Plant, decider: Decider, localiser: Localiser, scan: Scanning) -> Ending | None:
    """Run one control period: sense, decide, act. Return the ending, or None while the drive continues."""
    state = plant.state
    estimate = scan(tick, state.pose, localiser.sense(state))
    pose = localiser.settle(estimate)
    ending = decider.arrives(tick, estimate, state) or decider.decide(tick, pose, state)
    if ending:
        return ending
    step = decider.step
    plant.advance(step, localiser.actuate(step.command))
    return Ending(Outcome.COLLIDED) if plant.touched else decider.gives_up(plant.state)


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


class Driver(Decider):
    """Decider that drives a robot along a path, one step per control period.

    Attributes:
        path: the current path
        step: the current step
    """

    def __init__(
        self, guide: Guide, rules: Sequence[Rule], path: TrackedPath, task: Task, robot: RobotSpec, hz: int
    ) -> None:
        self.path, self.step = path, Step()
        self._guide, self._rules, self._task, self._hz = guide, tuple(rules), task, hz
        self._clock = StuckClock()
        self._patience = round(STUCK_TIME * hz)
        self._full_turn = full_turn(robot, hz)

    @property
    def fraction(self) -> float:
        """Completed fraction of the route."""
        return self.step.pursuit.arc / self.path.length

    def arrives(self, tick: int, estimate: Pose, state: State) -> Ending | None:
        """End the drive of a robot that stands at the goal, once it has had a command."""
        task = self._task
        at_goal = tick > 0 and arrived(estimate, state[3:], self.step.command, task.goal, task.goal_tolerance)
        return self._arrival(estimate, state) if at_goal else None

    def decide(self, tick: int, pose: Pose, state: State) -> Ending | None:
        """Choose the step of one control period, or end the drive."""
        guide, before = self._guide, self.step
        waiting = before.avoids and abs(state.speed) < WAITING_SPEED
        trigger = guide.trigger(tick, pose, waiting, self.path, before.pursuit.arc)
        if trigger:
            self._follow(guide.replan(tick, pose, trigger))
        if guide.plan_error:
            return self._invalid_plan(tick)
        if guide.blocked:
            return Ending(Outcome.BLOCKED, guide.blocked)
        self.path = guide.refreshed(self.path, pose)
        now, step = Moment(tick, pose, state, self.path, self.step, self._clock), self.step
        for rule in self._rules:
            step = rule.apply(now, step)
        self.step = step
        ending = self._end_of_route(tick, pose, state, before.command)
        self._clock = self._clock.after(self.step.pursuit, step.avoids or step.waits or guide.scan_turning)
        return ending

    def gives_up(self, state: State) -> Ending | None:
        """End the drive of a robot without progress. Turning on the spot adds the time of a full turn to the limit."""
        clock = self._clock
        if clock.driving < self._patience and clock.turning < self._patience + self._full_turn:
            return None
        return Ending(Outcome.STUCK, clock.reason)

    def with_reason(self, ending: Ending, tick: int) -> Ending:
        """Add the guide's failure note to the reason of a robot that got stuck or timed out."""
        if ending.outcome not in (Outcome.STUCK, Outcome.TIMED_OUT):
            return ending
        return Ending(ending.outcome, "; ".join(filter(None, (ending.reason, self._guide.failure_note(tick)))))

    def _follow(self, path: TrackedPath | None) -> bool:
        """Switch to a new path, and return whether there is one."""
        if path is None:
            return False
        self.path = path
        self.step = self.step._replace(pursuit=PursuitState(limiter=self.step.pursuit.limiter))
        self._clock = self._clock._replace(farthest=0.0)
        return True

    def _end_of_route(self, tick: int, pose: Pose, state: State, last: Twist) -> Ending | None:
        """End the drive of a robot that stands at the end of its route, unless it can still reach the goal."""
        path, (command, pursuit, *_) = self.path, self.step
        if path.length - pursuit.arc > path.goal_distance or any(command) or not stopped(state[3:], last):
            return None
        ending, guide, task = self._arrival(pose, state), self._guide, self._task
        if math.dist(pose[:2], task.goal) <= task.goal_tolerance:
            return None  # the robot stays, and has arrived in the next control period
        if self._follow(guide.missed(tick, pose)) or guide.may_wait:
            return None
        return self._invalid_plan(tick) if guide.plan_error else ending

    def _invalid_plan(self, tick: int) -> Ending:
        """Return the ending after an invalid plan."""
        return Ending(Outcome.INVALID_PLAN, f"on the way, at t = {tick / self._hz:g} s: {self._guide.plan_error}")

    def _arrival(self, pose: Pose, state: State) -> Ending:
        """Return the ending of a robot that stops at an estimated pose without contact."""
        task, true = self._task, (state.x, state.y)
        left, believed = math.dist(true, task.goal), math.dist(pose[:2], task.goal)
        outcome = outcome_at(true, task.goal, task.goal_tolerance)
        if outcome is Outcome.SUCCEEDED:
            return Ending(outcome)
        why = f"the route ends here, {left:.3f} m from the goal; the tolerance is {task.goal_tolerance:g} m"
        if believed <= task.goal_tolerance:
            why = (
                f"the robot believed that it was at the goal, {believed:.2f} m from it, but was {left:.3f} m from it "
                f"(the tolerance is {task.goal_tolerance:g} m): its estimate was wrong by {math.dist(pose[:2], true):.2f} m"
            )
        return Ending(outcome, why)


def full_turn(robot: RobotSpec, hz: int) -> int:
    """Return the number of control periods of a full turn on the spot."""
    return round(2 * math.pi / robot.max_yaw_rate * hz)


class OnePath(Guide):
    """Guide that keeps one path."""

    def __init__(self) -> None:
        self.log, self.walls = [], []


def follow(
    engine: Engine,
    controller: PurePursuit,
    path: TrackedPath,
    task: Task,
    *,
    limit: float,
    control_hz: int = 60,
    localiser: Localiser | None = None,
    rules: Sequence[Rule] = (),
    progress: Progress = ignore_progress,
) -> Drive:
    """Drive along a path from the start of a task, for at most `limit` [s]; `rules` apply after pursuit."""
    pursuit = Pursuit(controller, full_turn(engine.robot, control_hz))
    driver = Driver(OnePath(), (pursuit, *rules), path, task, engine.robot, control_hz)
    plant = Bullet(engine, task.start, control_hz)
    ending = drive(plant, driver, localiser or Exact(), hz=control_hz, limit=limit, progress=progress)
    return plant.finish(ending)
