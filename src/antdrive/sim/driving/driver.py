"""Driver: follow the guide, apply the rules, arrive or give up."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from antdrive.base import Pose
from antdrive.robots import LIMITERS, PursuitState, RobotSpec, Twist
from antdrive.robots.control.observation import REST, Briefing, Observation
from antdrive.robots.noise import moved_by
from antdrive.sim.driving.guide import Follow, GiveUp, Guide, Moment, Rule, Wait
from antdrive.sim.driving.parts import EXPLORING_LIMITERS, SILENT, Drive, Ending, Note, Step, StuckClock, at_goal
from antdrive.sim.driving.perceived_movers import PerceivedMovers
from antdrive.sim.driving.rules import WAITING_SPEED
from antdrive.sim.driving.survey import Scans
from antdrive.sim.log.ending import STUCK_TIME, stopped
from antdrive.sim.log.outcome import Outcome

PROGRESS_HZ = 10  # reports of progress per simulated second


#: Progress callback, called with the completed fraction of the route.
Progress = Callable[[float], None]


def ignore_progress(fraction: float) -> None:
    """Ignore the progress of a drive."""


class Driver:
    """Mind that drives a robot along a path, one step per control period.

    Attributes:
        briefing: what the robot knows before the drive
        guide: provides the path
        rules: compute the command, in order
        scans: reads the lidar; None: unused
        way: the current way
        step: the current step
        last: its last command and note
        progress: called with the completed fraction of the route
    """

    way: Follow
    last: tuple[Twist | None, Note] = None, SILENT

    def __init__(
        self,
        briefing: Briefing,
        guide: Guide,
        rules: Sequence[Rule],
        scans: Scans | None = None,
        movers: PerceivedMovers | None = None,
    ) -> None:
        self.briefing, self.guide, self.rules, self.scans, self.step = briefing, guide, tuple(rules), scans, Step()
        self._movers, self._clock, self._hz = movers, StuckClock(), briefing.hz
        self._patience = round(STUCK_TIME * briefing.hz)
        self._full_turn = full_turn(briefing.robot, briefing.hz)
        self._progress_periods = briefing.hz // PROGRESS_HZ or 1
        self.progress: Progress = ignore_progress

    def act(self, now: Observation) -> tuple[Twist | None, Note]:
        """Return the command of one control period, None to stay where the robot stands, and a note on it."""
        if now.command != self.step.command:  # another one than this mind's
            self.step = self.step._replace(command=now.command)
        guide, known, before, believed = self.guide, self.briefing, self.step, now.pose
        if now.scan is not None and self.scans is not None:
            believed = self.scans.read(now.tick, believed, now.scan)
        if at_goal(now, believed, known.goal, known.tolerance):
            return self._told(None, Note(believed))
        pose = moved_by(believed, now.pending, 1 / self._hz)
        seen = now if pose is now.pose else now._replace(pose=pose, pending=())
        if self._movers is not None:
            self._movers.read(seen)
        waiting = before.avoids and abs(now.twist.speed) < WAITING_SPEED
        moment = Moment(seen, self.way, before, self._clock, waiting)
        way = guide.path(moment)
        if isinstance(way, GiveUp):
            return self._told(None, Note(believed, ending=way.ending))
        if way is not self.way:
            self._follow(way)
            moment = Moment(seen, way, self.step, self._clock)
        step = self.step
        for rule in self.rules:
            step = rule.apply(moment, step)
        self.step = step
        if self._at_end_of_route(pose, now.standing, before.command):
            way = guide.path(moment, at_end=True)
            if isinstance(way, GiveUp):
                return self._told(None, Note(believed, ending=way.ending))
            self._follow(way)
        turns = isinstance(way, Wait) and way.scan_turn is not None
        self._clock = self._clock.after(self.step.pursuit, step.avoids or step.waits or turns)
        if now.tick % self._progress_periods == 0:
            self.progress(self.step.pursuit.arc / self.way.path.length)
        return self._told(step.command, Note(believed, step.pursuit.limiter, self._gives_up()))

    def _told(self, command: Twist | None, note: Note) -> tuple[Twist | None, Note]:
        self.last = command, note
        return self.last

    @property
    def limiters(self) -> tuple[str, ...]:
        """Names of the rules that limit the speed."""
        return EXPLORING_LIMITERS if self.briefing.map is None else LIMITERS

    def logged(self, log: Drive, per_tick: int) -> dict[str, Any]:
        """Return what guide and mover tracking add to a log."""
        tracking = self.scans.tracking if self.scans else None
        return self.guide.logged(log, per_tick) | (tracking.logged(log, per_tick) if tracking else {})

    def _gives_up(self) -> Ending | None:
        """End the drive of a robot without progress. Turning on the spot adds the time of a full turn to the limit."""
        clock = self._clock
        if clock.driving < self._patience and clock.turning < self._patience + self._full_turn:
            return None
        return Ending(Outcome.STUCK, clock.reason)

    def with_reason(self, ending: Ending, tick: int) -> Ending:
        """Add the guide's failure note to the reason of a robot that got stuck or timed out."""
        if ending.outcome not in (Outcome.STUCK, Outcome.TIMED_OUT):
            return ending
        return Ending(ending.outcome, "; ".join(filter(None, (ending.reason, self.guide.failure_note(tick)))))

    def _follow(self, way: Follow) -> None:
        """Follow a way, whose route may be new."""
        if way.path.route is not self.way.path.route:
            self.step = self.step._replace(pursuit=PursuitState(limiter=self.step.pursuit.limiter))
            self._clock = self._clock._replace(farthest=0.0)
        self.way = way

    def _at_end_of_route(self, pose: Pose, standing: bool, last: Twist) -> bool:
        """Return whether the robot stands at the end of its route, and not at the goal, where it arrives in the next period."""
        path, (command, pursuit, *_), known = self.way.path, self.step, self.briefing
        if path.length - pursuit.arc > path.goal_distance or any(command) or not (standing and stopped(REST, last)):
            return False
        return math.dist(pose[:2], known.goal) > known.tolerance


def full_turn(robot: RobotSpec, hz: int) -> int:
    """Return the number of control periods of a full turn on the spot."""
    return round(2 * math.pi / robot.max_yaw_rate * hz)
