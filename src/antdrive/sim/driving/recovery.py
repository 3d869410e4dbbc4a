"""What a robot without a map does where it does not get on: it looks round, backs off along its track, or makes room ahead."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from antdrive.base import Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.lidar import FULL_CIRCLE
from antdrive.sim.driving.survey import Survey
from antdrive.worlds import Route

STALL_TIME = 2.5  # a robot that does not move for this long tries something else [s]
STALL_DISTANCE = 0.06  # [m]
HELD_TIME = 0.5  # a robot that its sight has held for this long looks round [s]
TRAIL = 0.05  # spacing of the points of the driven track [m]
LENGTHS = (0.4, 0.8, 1.5)  # how far the robot backs off, the first time and then [m]
AGAIN = 1.0  # a stall that is nearer to the one before than this is the next at one place [m]
ELSEWHERE = 0.3  # the robot looks round once, and again where it is so far from there [m]
NARROW = math.pi / 2  # a lidar that sees less does not see the ground ahead of the sides of the robot [rad]
OVERLAP = 0.2  # so much more than what its lidar does not see is turned through [rad]
WORTH = 0.3  # less than this is not worth a look [rad]
SPARE_TURN = 0.1  # so much of the turn that is free is left [rad]
TURNED = 0.02  # a heading is reached so near to it [rad]
VIEWS = 3  # every direction stays in view until so many scans have entered the free way of each of their beams
PATIENT = 2.0  # a look that takes longer than it needs by this factor is given up: movers, or its sight, keep the robot from it
WAY = 1.0  # so far ahead the ground is asked for that holds the robot [m], [rad]
WORTH_SEEING = 0.1  # ground that was not seen holds the robot if it could otherwise go on so much farther [m], [rad]
STOPPED = 0.01  # a robot that turns more slowly than this has stopped [rad/s]


class ScanTurn:
    """A turn on the spot, one way and then the other if the first is not free all round.

    Attributes:
        done: whether it is over
    """

    def __init__(self, turns: list[float], yaw: float, rate: float, robot: RobotSpec, hz: int) -> None:
        self._turns, self._yaw, self._rate, self._robot, self._hz = list(turns), yaw, rate, robot, hz
        longest = PATIENT * (sum(map(abs, turns)) / rate + len(turns) * rate / robot.max_yaw_acceleration)
        self._left, self._still, self._periods = self._turns.pop(0), 0, math.ceil(longest * hz)
        self.done = False

    def command(self, pose: Pose, last: Twist) -> Twist:
        """The twist of the next control period, of a robot that turns or stands."""
        self._left -= math.remainder(pose[2] - self._yaw, 2 * math.pi)
        self._yaw = pose[2]
        self._periods -= 1
        self._still = self._still + 1 if abs(last.yaw_rate) < min(STOPPED, 0.5 * self._rate) else 0
        if self._still and (abs(self._left) < TURNED or self._still > HELD_TIME * self._hz):
            if self._turns:
                self._left, self._still = self._turns.pop(0), 1
            else:
                self.done = True
        hardest = self._robot.max_yaw_acceleration
        # Within one control period less, so that the robot does not turn too far before it brakes.
        rate = min(self._rate, math.sqrt(2 * hardest * abs(self._left)), abs(self._left) * self._hz)
        if self._periods < 0 or self.done:
            self.done, rate = True, 0.0
        wanted, step = math.copysign(rate, self._left), hardest / self._hz
        return Twist(0.0, min(max(wanted, last.yaw_rate - step), last.yaw_rate + step))


class Recovery:
    """Notes where the robot does not get on, and says what it does then.

    A robot that has found a new route in vain, or that its sight holds, backs off along its own track; one that has not come from
    anywhere goes ahead, as far as it sees free ground, to have room for a turn. Where its lidar does not see all around, it then
    looks round, and so it does as soon as ground that it has not seen holds it.

    Attributes:
        look: the turn with which the robot looks round now; None: it does not
        route: the last way out that was found; None: none was
        backwards: whether that way leads back along the track
    """

    def __init__(self, survey: Survey, robot: RobotSpec, start: Pose, hz: int) -> None:
        self.scan_turn: ScanTurn | None = None
        self.route: Route | None = None
        self.backwards = False
        self._survey, self._robot, self._hz = survey, robot, hz
        self._trail: list[tuple[float, float]] = []
        self._rest = (0.0, start[:2])
        self._held_since = math.inf
        self._wanted: Twist | None = None
        self._stalls, self._stalled_at = 0, start[:2]
        self._turned_at = (math.inf, math.inf)

    def note_progress(self, now: float, pose: Pose, *, waiting: bool, backwards: bool) -> None:
        """Note where the robot is: whether it moves, and its track unless it follows that back."""
        if waiting or math.dist(self._rest[1], pose[:2]) > STALL_DISTANCE:
            self.note_rest(now, pose)
        if not backwards and (not self._trail or math.dist(self._trail[-1], pose[:2]) >= TRAIL):
            self._trail.append(pose[:2])

    def note_held(self, now: float, held: Twist | None) -> None:
        """Note whether the robot stands because its sight does not let it go on."""
        if held is None:
            self._held_since = math.inf
        elif self._held_since == math.inf:
            self._held_since = now
        self._wanted = held

    def note_rest(self, now: float, pose: Pose) -> None:
        """Count from now on how long the robot has not moved."""
        self._rest = now, pose[:2]

    def stalled(self, now: float) -> bool:
        """Whether the robot has not moved for long."""
        return now - self._rest[0] > STALL_TIME

    def held(self, now: float, pose: Pose) -> bool:
        """Whether ground that was not seen held the robot for long where it has not looked round, or will from the start on."""
        if not self._may_turn(pose):
            return False
        if self._turned_at[0] == math.inf and self._survey.lidar.field_of_view < NARROW:
            return True
        return now - self._held_since > HELD_TIME and self.held_by_unknown(pose)

    def held_by_unknown(self, pose: Pose) -> bool:
        """Whether the robot stands because it has not seen the ground ahead, not because something was hit there."""
        if self._wanted is None:
            return False
        seen, open_ = (
            self._survey.clear_way(pose, self._wanted, WAY, freespace=freespace) for freespace in (False, True)
        )
        return open_ > seen + WORTH_SEEING

    def begin_scan_turn(self, pose: Pose) -> bool:
        """Begin to look round; whether there is anything to look at that the robot has not looked at from here."""
        if not self._may_turn(pose):
            return False
        self._turned_at = pose[:2]
        turns = list(self._turns(pose))
        if not turns:
            return False
        lidar, seen = self._survey.lidar, self._survey.map
        rate = lidar.field_of_view * lidar.rate / (VIEWS * seen.share * seen.turns)
        self.scan_turn = ScanTurn(turns, pose[2], min(rate, self._robot.max_yaw_rate), self._robot, self._hz)
        return True

    def end_scan_turn(self, now: float, pose: Pose) -> None:
        """Go on after a look."""
        self.scan_turn, self._held_since = None, math.inf
        self.note_rest(now, pose)

    def note_stall(self, now: float, pose: Pose) -> None:
        """Note a stall, and how many there were at this place."""
        self.note_rest(now, pose)
        self._stalls = self._stalls + 1 if math.dist(self._stalled_at, pose[:2]) < AGAIN else 1
        self._stalled_at = pose[:2]

    def escape(self, pose: Pose) -> Route | None:
        """A way out for a robot that stalls again, or that its sight holds: back along the track, else ahead. None: no way."""
        tries = self._stalls - 2 if self._held_since == math.inf else self._stalls - 1
        if not 0 <= tries <= len(LENGTHS):
            return None
        length = LENGTHS[min(tries, len(LENGTHS) - 1)]
        points = self._back(pose, length)
        self.backwards = len(points) > 1
        if not self.backwards:
            x, y, yaw = pose
            ahead = min(length, self._survey.clear_distance(pose, 1.0, 0.0, 2 * length) - TRAIL)
            if ahead < 2 * TRAIL:
                return None
            points.append((x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)))
        self.route = Route(np.array(points))
        return self.route

    def _back(self, pose: Pose, wanted: float) -> list[tuple[float, float]]:
        """The driven track, from the robot back; only the first point if it is too short."""
        points, length = [pose[:2]], 0.0
        while self._trail and length < wanted:
            point = self._trail.pop()
            step = math.dist(points[-1], point)
            if step > 0.5 * TRAIL:
                points.append(point)
                length += step
        return points if length >= 2 * TRAIL else points[:1]

    def _may_turn(self, pose: Pose) -> bool:
        return not self._survey.lidar.full_circle and math.dist(self._turned_at, pose[:2]) >= ELSEWHERE

    def _turns(self, pose: Pose) -> Iterator[float]:
        """The turns with which the lidar sees all around, as far as they are free."""
        needed = FULL_CIRCLE - self._survey.lidar.field_of_view + OVERLAP
        left, right = (
            min(needed, self._survey.clear_turn(pose, side, needed + SPARE_TURN) - SPARE_TURN) for side in (1.0, -1.0)
        )
        sides = ((left, 1.0), (right, -1.0)) if left >= right else ((right, -1.0), (left, 1.0))
        turned = 0.0
        for turn, side in sides:
            if turn > WORTH and turned < needed - OVERLAP:
                yield side * (turn + turned)  # back over what was turned through before
                turned += turn
