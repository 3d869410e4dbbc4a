"""Never outrun your sight: a robot without a map can always stop on ground that it has seen."""

from __future__ import annotations

import math
from collections.abc import Callable

from antdrive.base import Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.sim.driving.parts import Moment, Step
from antdrive.sim.driving.rules import SIGHT_LIMIT, stopping_time
from antdrive.sim.driving.survey import Survey

SLOWEST = 0.02  # of slower commands the turn counts, too, where `SHORT` is taken off [m/s]
SHORT = 0.01  # what can be seen of a way is taken for shorter by this [m], [rad]
ON_THE_SPOT = 1e-6  # arcs of a smaller radius than this are turns on the spot [m]
STILL = Twist(0.0, 0.0)


class StoppingConstraint:
    """Slow down where the robot could not stop on ground that it has seen.

    Every command is checked, however slow: a robot that creeps gets to an obstacle as well. A command is let through, or slowed
    down on its own arc, only if the robot can then stop on the arc, over ground that it has seen. Otherwise the robot brakes
    as hard as it can on the arc that it is on, which was checked in the control period before.
    """

    def __init__(
        self, survey: Survey, robot: RobotSpec, hz: int, reaction: float, note: Callable[[int, Twist | None], None]
    ) -> None:
        self._survey, self._robot, self._period, self._reaction = survey, robot, 1 / hz, reaction
        self._note = note

    def apply(self, now: Moment, step: Step) -> Step:
        """The command, slower where it leads out of sight."""
        command, slowed = self.limit(now.pose, now.before.command, step.command)
        stands = abs(command.speed) < SLOWEST and abs(command.yaw_rate) < SLOWEST
        self._note(now.tick, step.command if slowed and stands else None)
        if not slowed:
            return step
        return step._replace(command=command, pursuit=step.pursuit._replace(limiter=SIGHT_LIMIT))

    def limit(self, pose: Pose, last: Twist, command: Twist) -> tuple[Twist, bool]:
        """The command, slower where it leads out of sight; and whether it was."""
        share = self._allowed(pose, command)
        if share >= 1:
            return command, False
        slower, kept = _scaled(command, share), self._braked(last)
        if kept == STILL or _slows_no_more(slower, kept):
            return slower, True
        return kept, True

    def _allowed(self, pose: Pose, command: Twist) -> float:
        """The largest share of a command with which the robot stops on ground that it has seen, at most 1."""
        speed, rate = abs(command.speed), abs(command.yaw_rate)
        if command == STILL:
            return 1.0
        stop = stopping_time(command, self._robot)
        going = (
            self._reaction + stop / 2
        )  # on the way until it stands, the robot gets as far as at full speed in this time
        if speed <= ON_THE_SPOT * rate:
            clear = self._survey.clear_turn(pose, command.yaw_rate, rate * going + SHORT) - SHORT
            seen = clear / rate
        else:
            short = SHORT if speed >= SLOWEST else SHORT * speed / max(speed, rate)
            seen = (self._survey.clear_distance(pose, *command, speed * going + short) - short) / speed
        if seen >= going * (1 - 1e-12):
            return 1.0
        # The share s for which s (reaction + s stop / 2) = seen, in a form that loses no digits where `stop` is short.
        reaction, seen = self._reaction, max(seen, 0.0)
        return 2 * seen / (math.sqrt(reaction**2 + 2 * seen * stop) + reaction)

    def _braked(self, last: Twist) -> Twist:
        """The next command of a robot that brakes as hard as it can on its arc."""
        stop = stopping_time(last, self._robot)
        return _scaled(last, 1 - self._period / stop) if stop > self._period else STILL


def _scaled(twist: Twist, share: float) -> Twist:
    """A twist on the same arc, slower."""
    return Twist(twist.speed * share, twist.yaw_rate * share) if share > 0 else STILL


def _slows_no_more(twist: Twist, kept: Twist) -> bool:
    """Whether a twist goes the same way as one that brakes, and at least as fast."""
    if kept.speed:
        return twist.speed * math.copysign(1.0, kept.speed) >= abs(kept.speed)
    return twist.yaw_rate * math.copysign(1.0, kept.yaw_rate) >= abs(kept.yaw_rate)
