"""Never outrun your sight: a robot without a map can always stop on ground that it has seen."""

from __future__ import annotations

import math

from antdrive.robots import RobotSpec, Twist
from antdrive.sim.driving.survey import Survey
from antdrive.worlds import Pose

SLOWEST = 0.02  # slower commands turn on the spot [m/s]
SHORT = 0.01  # what can be seen of a way is taken for shorter by this [m], [rad]


class Caution:
    """Keeps the distance in which the robot can stop within what it has seen.

    Args:
        survey: what the robot has seen
        robot: how hard it brakes
        hz: control periods per second
        reaction: how long the robot goes on as commanded after something comes into sight [s]
    """

    def __init__(self, survey: Survey, robot: RobotSpec, hz: int, reaction: float) -> None:
        self._survey, self._robot, self._period, self._reaction = survey, robot, 1 / hz, reaction

    def limit(self, pose: Pose, last: Twist, command: Twist) -> tuple[Twist, bool]:
        """The command, slower where it leads out of sight; and whether it was.

        Args:
            pose: where the command takes effect
            last: the command before
            command: what the controller wants
        """
        if abs(command.speed) < SLOWEST:
            return self._turn(pose, last, command)
        allowed = self._allowed(pose, command)
        if abs(command.speed) <= allowed:
            return command, False
        slowest = max(0.0, abs(last.speed) - self._robot.max_acceleration * self._period)
        if allowed >= slowest or last.speed * command.speed <= 0:
            return _slower(command, max(allowed, slowest)), True
        return _slower(last, slowest), True

    def _turn(self, pose: Pose, last: Twist, command: Twist) -> tuple[Twist, bool]:
        """A command to turn on the spot, slower where the footprint would sweep over ground that was not seen."""
        rate, brake = abs(command.yaw_rate), self._robot.max_yaw_acceleration
        if rate == 0.0 or abs(last.speed) > SLOWEST:
            return command, False
        needed = rate * self._reaction + rate * rate / (2 * brake)
        clear = self._survey.clear_turn(pose, command.yaw_rate, needed + SHORT) - SHORT
        if clear >= needed:
            return command, False
        allowed = max(self._stoppable(clear, brake), abs(last.yaw_rate) - brake * self._period)
        return command._replace(yaw_rate=math.copysign(min(rate, allowed), command.yaw_rate)), True

    def _allowed(self, pose: Pose, command: Twist) -> float:
        """The highest speed along the command's arc from which the robot stops on ground that it has seen [m/s]."""
        speed, brake = abs(command.speed), self._robot.max_acceleration
        needed = speed * self._reaction + speed * speed / (2 * brake)
        clear = self._survey.clear_distance(pose, *command, needed + SHORT) - SHORT
        if clear >= needed:
            return speed
        return self._stoppable(clear, brake)

    def _stoppable(self, clear: float, brake: float) -> float:
        """The speed from which a robot that reacts late stops in a way; for turns with angles."""
        return brake * (math.sqrt(self._reaction**2 + 2 * max(clear, 0.0) / brake) - self._reaction)


def _slower(twist: Twist, speed: float) -> Twist:
    """A twist on the same arc at another speed."""
    if twist.speed == 0.0:
        return Twist(0.0, 0.0)
    return Twist(math.copysign(speed, twist.speed), twist.yaw_rate * speed / abs(twist.speed))
