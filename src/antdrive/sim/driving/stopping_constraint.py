"""Stopping constraint: a mapless robot can always stop on ground observed as free."""

from __future__ import annotations

import math
from collections.abc import Callable

from antdrive.base import Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.control.observation import REST
from antdrive.sim.driving.guide import Moment
from antdrive.sim.driving.parts import SIGHT_LIMIT, Step
from antdrive.sim.driving.rules import stopping_time
from antdrive.sim.driving.survey import Survey

SLOWEST = 0.02  # below this speed `SHORT` applies to the turn as well [m/s]
SHORT = 0.01  # reserve of the observed free path [m], [rad]
ON_THE_SPOT = 1e-6  # arcs of a smaller radius are turns on the spot [m]


class StoppingConstraint:
    """Rule: limit the command so that the robot can stop on observed free ground.

    Every command is checked, since even a creeping robot reaches an obstacle. A command passes, or is slowed on its own arc,
    only if the robot can then stop on that arc over free ground. Otherwise the robot brakes as hard as it can on its current
    arc, which the previous control period checked.
    """

    def __init__(
        self,
        survey: Survey,
        robot: RobotSpec,
        hz: int,
        reaction: float,
        note: Callable[[float, Twist | None, bool], None],
    ) -> None:
        self._survey, self._robot, self._period, self._reaction = survey, robot, 1 / hz, reaction
        self._note = note

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the command, slowed where it leads beyond observed free ground."""
        command, slowed = self.limit(now.pose, now.before.command, step.command)
        stands = abs(command.speed) < SLOWEST and abs(command.yaw_rate) < SLOWEST
        idle = stands and not (slowed or step.avoids or step.waits)
        self._note(now.observed.t, step.command if slowed and stands else None, idle)
        if not slowed:
            return step
        return step._replace(command=command, pursuit=step.pursuit._replace(limiter=SIGHT_LIMIT))

    def limit(self, pose: Pose, last: Twist, command: Twist) -> tuple[Twist, bool]:
        """Return the command, slowed where it leads beyond observed free ground, and whether it was slowed."""
        share = self._allowed(pose, command)
        if share >= 1:
            return command, False
        slower, kept = _scaled(command, share), self._braked(last)
        if kept == REST or _slows_no_more(slower, kept):
            return slower, True
        return kept, True

    def _allowed(self, pose: Pose, command: Twist) -> float:
        """Return the largest fraction of a command, at most 1, from which the robot stops on observed free ground."""
        speed, rate = abs(command.speed), abs(command.yaw_rate)
        if command == REST:
            return 1.0
        stop = stopping_time(command, self._robot)
        going = self._reaction + stop / 2  # time at constant speed that covers the stopping distance [s]
        if speed <= ON_THE_SPOT * rate:
            clear = self._survey.clear_way(pose, 0.0, command.yaw_rate, rate * going + SHORT) - SHORT
            seen = clear / rate
        else:
            short = SHORT if speed >= SLOWEST else SHORT * speed / max(speed, rate)
            seen = (self._survey.clear_way(pose, *command, speed * going + short) - short) / speed
        if seen >= going * (1 - 1e-12):
            return 1.0
        # The fraction s with s (reaction + s stop / 2) = seen, in a form that keeps all digits where `stop` is short.
        reaction, seen = self._reaction, max(seen, 0.0)
        return 2 * seen / (math.sqrt(reaction**2 + 2 * seen * stop) + reaction)

    def _braked(self, last: Twist) -> Twist:
        """Return the next command of a robot that brakes as hard as it can on its arc."""
        stop = stopping_time(last, self._robot)
        return _scaled(last, 1 - self._period / stop) if stop > self._period else REST


def _scaled(twist: Twist, share: float) -> Twist:
    """Return a twist scaled on the same arc."""
    return Twist(twist.speed * share, twist.yaw_rate * share) if share > 0 else REST


def _slows_no_more(twist: Twist, kept: Twist) -> bool:
    """Return whether a twist has the direction of a braking twist, and at least its speed."""
    if kept.speed:
        return twist.speed * math.copysign(1.0, kept.speed) >= abs(kept.speed)
    return twist.yaw_rate * math.copysign(1.0, kept.yaw_rate) >= abs(kept.yaw_rate)
