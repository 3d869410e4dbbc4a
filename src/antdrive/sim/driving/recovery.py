"""Recovery behaviours of a mapless robot: scan turn, backing off along its track, moving ahead for room."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from antdrive.base import Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.lidar import FULL_CIRCLE
from antdrive.sim.driving.survey import Survey
from antdrive.worlds import Route

STALL_TIME = 2.5  # a robot that stays within `STALL_DISTANCE` for this long has stalled [s]
STALL_DISTANCE = 0.06  # [m]
STALL_TURN = 0.3  # a robot on a route with turns has not stalled while it turns farther than this [rad]
IDLE_TIME = 0.5  # a robot that neither moves nor waits at its controller's command for this long has stalled, too [s]
HELD_TIME = 0.5  # a robot held by the stopping constraint for this long makes a scan turn [s]
TRAIL = 0.05  # spacing of the points of the driven track [m]
LENGTHS = (0.4, 0.8, 1.5)  # distances of successive attempts to back off [m]
AGAIN = 1.0  # stalls within this distance are at one place [m]
ELSEWHERE = 0.3  # shortest distance between two scan turns [m]
NARROW = math.pi / 2  # a narrower field of view misses the ground ahead of the robot's sides [rad]
OVERLAP = 0.2  # scan turns exceed the blind sector by this [rad]
WORTH = 0.3  # shorter scan turns are omitted [rad]
SPARE_TURN = 0.1  # part of a free turn that is left unused [rad]
TURNED = 0.02  # tolerance of a target heading [rad]
VIEWS = 3  # whole scans that must cover each direction
PATIENT = 2.0  # a scan turn is given up after this multiple of its planned duration
SHARPEST = 0.05  # arcs of a smaller radius are treated as turns on the spot [m]
WAY = 1.0  # distance within which unknown ground is checked [m], [rad]
WORTH_SEEING = 0.1  # unknown ground blocks the robot if it shortens the free path by this [m], [rad]
STOPPED = 0.01  # a robot that turns more slowly has stopped [rad/s]


class ScanTurn:
    """Scan turn: a turn on the spot, first one way, then the other if the first is not free all round.

    Attributes:
        done: whether the scan turn is over
    """

    def __init__(self, turns: list[float], yaw: float, rate: float, robot: RobotSpec, hz: int) -> None:
        self._turns, self._yaw, self._rate, self._robot, self._hz = list(turns), yaw, rate, robot, hz
        longest = PATIENT * (sum(map(abs, turns)) / rate + len(turns) * rate / robot.max_yaw_acceleration)
        self._left, self._still, self._periods = self._turns.pop(0), 0, math.ceil(longest * hz)
        self.done = False

    def command(self, pose: Pose, last: Twist) -> Twist:
        """Return the next twist of a robot that turns or stands."""
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
        # Limited to one control period's travel, so that the robot brakes in time.
        rate = min(self._rate, math.sqrt(2 * hardest * abs(self._left)), abs(self._left) * self._hz)
        if self._periods < 0 or self.done:
            self.done, rate = True, 0.0
        wanted, step = math.copysign(rate, self._left), hardest / self._hz
        return Twist(0.0, min(max(wanted, last.yaw_rate - step), last.yaw_rate + step))


class Recovery:
    """Recovery behaviours for a robot that stalls or that the stopping constraint holds.

    If re-planning has failed or the constraint holds the robot, it backs off along its track. If it has not moved yet, it
    drives straight ahead over free ground, to have room for a turn. A robot whose lidar has a blind sector then makes a
    scan turn, as it does whenever unknown ground holds it.

    Attributes:
        scan_turn: the current scan turn; None if there is none
        route: the last escape route; None if there was none
        backwards: whether that route leads back along the track
    """

    def __init__(self, survey: Survey, robot: RobotSpec, start: Pose, hz: int) -> None:
        self.scan_turn: ScanTurn | None = None
        self.route: Route | None = None
        self.backwards = False
        self._survey, self._robot, self._hz = survey, robot, hz
        self._trail: list[tuple[float, float]] = []
        self._rest = (0.0, start)
        self._held_since = self._idle_since = math.inf
        self._wanted: Twist | None = None
        self._stalls, self._stalled_at = 0, start[:2]
        self._turned_at = (math.inf, math.inf)

    def note_progress(self, now: float, pose: Pose, *, waiting: bool, backwards: bool, turns: bool) -> None:
        """Note whether the robot moves, and extend its track unless it follows the track back.

        Turns on the spot count only on a route that has them: on others, the robot may turn back and forth.
        """
        x, y, yaw = self._rest[1]
        turned = turns and abs(math.remainder(pose[2] - yaw, 2 * math.pi)) > STALL_TURN
        if waiting or turned or math.dist((x, y), pose[:2]) > STALL_DISTANCE:
            self.note_rest(now, pose)
        if not backwards and (not self._trail or math.dist(self._trail[-1], pose[:2]) >= TRAIL):
            self._trail.append(pose[:2])

    def note_command(self, now: float, held: Twist | None, idle: bool = False) -> None:
        """Note the twist that the stopping constraint reduced to a stop, None if it did not, and whether the robot is idle.

        It is idle if its controller stops it, as before a turn for which there is no room, and not a mover or the constraint.
        """
        self._idle_since = min(self._idle_since, now) if idle else math.inf
        if held is None:
            self._held_since = math.inf
        elif self._held_since == math.inf:
            self._held_since = now
        self._wanted = held

    def note_rest(self, now: float, pose: Pose) -> None:
        """Restart the count of the time without motion."""
        self._rest = now, pose

    def stalled(self, now: float) -> bool:
        """Return whether the robot has stalled."""
        return now - self._rest[0] > STALL_TIME or now - max(self._rest[0], self._idle_since) > IDLE_TIME

    def held(self, now: float, pose: Pose) -> bool:
        """Return whether a scan turn is due: held by unknown ground for long, or a narrow field of view and no turn so far."""
        first = self._turned_at[0] == math.inf and self._survey.lidar.field_of_view < NARROW
        if not first and now - self._held_since <= HELD_TIME:
            return False
        return self._may_turn(pose) and (first or self.held_by_unknown(pose))

    def held_by_unknown(self, pose: Pose) -> bool:
        """Return whether the robot stands because ground ahead is unknown, rather than because of hits."""
        if self._wanted is None:
            return False
        speed, rate = self._wanted
        arc = 0.0 if abs(speed) <= SHARPEST * abs(rate) else speed, rate
        seen, open_ = (self._survey.clear_way(pose, *arc, WAY, freespace=freespace) for freespace in (False, True))
        return open_ > seen + WORTH_SEEING

    def begin_scan_turn(self, pose: Pose) -> bool:
        """Begin a scan turn; return False if none is possible or one was made here."""
        if not self._may_turn(pose):
            return False
        self._turned_at = pose[:2]
        turns = list(self._turns(pose))
        if not turns:
            return False
        lidar, seen = self._survey.lidar, self._survey.map
        rate = lidar.field_of_view * lidar.rate / (VIEWS * seen.share * seen.stride)
        self.scan_turn = ScanTurn(turns, pose[2], min(rate, self._robot.max_yaw_rate), self._robot, self._hz)
        return True

    def end_scan_turn(self, now: float, pose: Pose) -> None:
        """End the scan turn."""
        self.scan_turn, self._held_since = None, math.inf
        self.note_rest(now, pose)

    def note_stall(self, now: float, pose: Pose) -> None:
        """Note a stall, and count the stalls at this place."""
        self.note_rest(now, pose)
        self._stalls = self._stalls + 1 if math.dist(self._stalled_at, pose[:2]) < AGAIN else 1
        self._stalled_at = pose[:2]

    def escape(self, pose: Pose) -> Route | None:
        """Return an escape route after a repeated stall or a hold: back along the track, else ahead; None if there is none."""
        tries = self._stalls - 2 if self._held_since == math.inf else self._stalls - 1
        if not 0 <= tries <= len(LENGTHS):
            return None
        length = LENGTHS[min(tries, len(LENGTHS) - 1)]
        points = self._back(pose, length)
        self.backwards = len(points) > 1
        if not self.backwards:
            x, y, yaw = pose
            ahead = min(length, self._survey.clear_way(pose, 1.0, 0.0, 2 * length) - TRAIL)
            if ahead < 2 * TRAIL:
                return None
            points.append((x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)))
        self.route = Route(np.array(points))
        return self.route

    def _back(self, pose: Pose, wanted: float) -> list[tuple[float, float]]:
        """Return the driven track backwards from the robot; only its first point if it is too short."""
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
        """Yield the turns that let the lidar cover all directions, as far as they are free."""
        needed = FULL_CIRCLE - self._survey.lidar.field_of_view + OVERLAP
        left, right = (
            min(needed, self._survey.clear_way(pose, 0.0, side, needed + SPARE_TURN) - SPARE_TURN)
            for side in (1.0, -1.0)
        )
        sides = ((left, 1.0), (right, -1.0)) if left >= right else ((right, -1.0), (left, 1.0))
        turned = 0.0
        for turn, side in sides:
            if turn > WORTH and turned < needed - OVERLAP:
                yield side * (turn + turned)  # includes the way back over the first turn
                turned += turn
