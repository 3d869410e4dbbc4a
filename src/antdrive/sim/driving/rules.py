"""Control rules, in order: pursuit, scan turn, schedule, corners, avoidance. `StoppingConstraint` applies last."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from antdrive.base import Pose
from antdrive.robots import (
    LIMITERS,
    Avoidance,
    AvoidanceState,
    PurePursuit,
    PursuitState,
    RobotSpec,
    TrackedPath,
    Twist,
)
from antdrive.robots.control.controller import Following
from antdrive.sim.driving.blockage import points_at
from antdrive.sim.driving.guide import Moment, Wait
from antdrive.sim.driving.habits import Habits
from antdrive.sim.driving.parts import Step
from antdrive.sim.driving.perceived_movers import PerceivedMovers
from antdrive.worlds import Task

if TYPE_CHECKING:
    from antdrive.sim.driving.mover_tracking import MoverTracking


def slow_down(command: Twist, last: Twist, limit: float, max_change: float) -> Twist:
    """Slow a command to a speed limit on the same arc, as far as the robot can brake."""
    if command.speed <= 0:
        return command
    v = max(min(command.speed, limit), min(command.speed, last.speed - max_change))
    return Twist(v, command.yaw_rate * v / command.speed)


STEPPING_OUT = 1.2  # speed of people who step out of hidden ground [m/s]
CORNER_STEP = 0.1  # between the places of a route that are compared with corners [m]
STANDING = 0.01  # a robot that is slower than this turns on the spot [m/s], [rad/s]
WAITING_SPEED = 0.1  # a robot that avoids a mover and is slower than this waits for it [m/s]
GOAL_SHARE = 0.95  # a robot that avoids a mover may stop within this fraction of the goal's tolerance
AVOIDING, ROTATING = LIMITERS.index("avoid"), LIMITERS.index("rotate")


class Pursuit:
    """Rule: follow the path. After more than a full turn on the spot, drive off as soon as possible.

    Between pillars, the longest clear lookahead depends on the heading. A robot that turns towards its carrot may find the
    next one on its other side, and turn back and forth endlessly.
    """

    def __init__(self, controller: PurePursuit, full_turn: int) -> None:
        self._controller, self._full_turn = controller, full_turn

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the controller's command."""
        last, before = now.before.command, now.before.pursuit
        if now.clock.turning <= self._full_turn:
            return Step(*self._controller.pursue(now.way.path, now.pose, last, before))
        arcs = now.way.path.preferring_arcs
        return Step(*self._controller.pursue(arcs, now.pose, last, before._replace(turning=False)))


class ByController:
    """Rule: follow the path by another controller, and measure the progress along it."""

    def __init__(self, following: Following, movers: PerceivedMovers) -> None:
        self._following, self._movers = following, movers

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the controller's command."""
        path = now.way.path
        command = self._following.command(now.observed._replace(movers=self._movers.near), path)
        turning = abs(command.speed) < STANDING and abs(command.yaw_rate) >= STANDING
        return Step(command, PursuitState(path.nearest(now.pose, now.before.pursuit.arc), turning))


class TurnToScan:
    """Rule: make the scan turn once the robot stands; stop where it has no path."""

    def __init__(self, robot: RobotSpec, hz: int) -> None:
        self._robot, self._hz = robot, hz

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the scan turn's command, or one that brakes for it."""
        way, last = now.way, now.before.command
        if not isinstance(way, Wait):
            return step
        if way.scan_turn is not None and not last.speed:
            turning = step.pursuit._replace(limiter=ROTATING)
            return step._replace(command=way.scan_turn.command(now.pose, last), pursuit=turning, speed_limit=0.0)
        command = braked(last, self._robot, self._hz)
        return step._replace(command=command, speed_limit=max(command.speed, 0.0))


class KeepToSchedule:
    """Rule: keep to the schedule of a plan in space and time."""

    def __init__(self, robot: RobotSpec, hz: int) -> None:
        self._hz, self._max_change = hz, robot.max_acceleration / hz

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the command, limited to the schedule's speed."""
        schedule = now.way.schedule
        if schedule is None:
            return step
        limit = schedule.speed_limit(now.tick / self._hz, step.pursuit.arc)
        command = slow_down(step.command, now.before.command, limit, self._max_change)
        return step._replace(command=command, speed_limit=limit, waits=limit < WAITING_SPEED)


class SlowAtCorners:
    """Rule: someone who steps out of hidden ground reaches the robot's way no sooner than it can stop.

    The robot need not be slower than its `near_speed`. It has a map; without one, `StoppingConstraint` holds it back.
    """

    def __init__(self, tracking: MoverTracking, robot: RobotSpec, hz: int, reaction: float) -> None:
        self._tracking, self._robot, self._reaction = tracking, robot, reaction
        self._max_change = robot.max_acceleration / hz

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the command, limited to the speed for the corners ahead."""
        limit = self.limit(now.way.path, step.pursuit.arc, step.command.speed)
        if limit >= step.command.speed:
            return step
        command = slow_down(step.command, now.before.command, limit, self._max_change)
        return step._replace(command=command, speed_limit=min(max(limit, command.speed), step.speed_limit))

    def limit(self, path: TrackedPath, arc: float, speed: float) -> float:
        """Return the speed limit of a robot at an arc length [m] and a speed [m/s]; infinite without corners ahead."""
        slowest, brake = self._robot.near_speed, self._robot.max_acceleration
        if speed <= slowest or not len(corners := self._tracking.corners):
            return math.inf
        arcs = np.arange(arc, min(arc + speed * speed / (2 * brake), path.length) + CORNER_STEP, CORNER_STEP)
        gaps = points_at(path, arcs)[:, None] - corners
        room = np.hypot(gaps[..., 0], gaps[..., 1]).min(axis=1) - self._robot.radius
        there = np.maximum(slowest, brake * (room / STEPPING_OUT - self._reaction))
        return float(np.sqrt(there * there + 2 * brake * (arcs - arc)).min())


class Avoid:
    """Rule: avoid movers that come too close. A robot that gives way at the goal stops and stays."""

    def __init__(
        self,
        avoidance: Avoidance,
        movers: PerceivedMovers,
        task: Task,
        robot: RobotSpec,
        hz: int,
        *,
        goal_share: float = GOAL_SHARE,
        backwards: float = math.inf,
        delay: float = 0.0,  # from a command to the motors [s]
        losses: tuple[float, float] = (0.0, 0.0),  # see `Avoidance.avoid`
        habits: Habits | None = None,  # a second prediction of movers
    ) -> None:
        self._avoidance, self._movers, self._task, self._robot, self._hz = avoidance, movers, task, robot, hz
        self._goal_share, self._backwards, self._delay, self._losses = goal_share, backwards, delay, losses
        self._habits = habits
        self._state = AvoidanceState()

    def apply(self, now: Moment, step: Step) -> Step:
        """Return the command that avoids movers."""
        avoidance, pose, way, before = self._avoidance, now.pose, now.way, now.before
        last, ahead = before.command, avoidance.prediction_times
        stopping = before.avoids and self._stops_at_goal(pose, last)
        if stopping:
            step = step._replace(command=braked(last, self._robot, self._hz))
            # The drive ends when the robot stands, so only the stopping time matters.
            ahead = ahead[: 2 + math.ceil(stopping_time(last, self._robot) / avoidance.step)]
        # The pose is that of the moment when the command takes effect.
        ahead = ahead + self._delay
        movers, _, velocities, radii = self._movers.predict(ahead), *self._movers.near[1:]
        kept = radii - way.blockage.clearance_reduction() if way.blockage else radii
        if self._habits is not None:
            again, sizes = self._habits.predict(ahead, movers)
            if len(sizes):
                movers, kept = np.concatenate((movers, again), axis=1), np.concatenate((kept, sizes))
                velocities = np.concatenate((velocities, (again[1] - again[0]) / avoidance.step))
        command, avoids, self._state = avoidance.avoid(
            way.path,
            self._robot,
            pose,
            last,
            before.pursuit,
            step.command,
            self._state,
            movers,
            kept,
            velocities,
            speed_limit=step.speed_limit,
            backwards=self._backwards,
            losses=self._losses,
        )
        if not (avoids or stopping):
            return step._replace(command=command)
        pursuit = step.pursuit._replace(turning=before.pursuit.turning, limiter=AVOIDING)
        return step._replace(command=command, pursuit=pursuit, avoids=True)

    def _stops_at_goal(self, pose: Pose, command: Twist) -> bool:
        """Return whether a robot that brakes now stops within the goal's tolerance."""
        x, y, yaw = pose
        goal = self._task.goal
        distance = command.speed * abs(command.speed) / (2 * self._robot.max_acceleration)
        end = (x + distance * math.cos(yaw), y + distance * math.sin(yaw))
        return max(math.dist((x, y), goal), math.dist(end, goal)) < self._goal_share * self._task.goal_tolerance


def stopping_time(command: Twist, robot: RobotSpec) -> float:
    """Return the stopping time [s]."""
    return max(abs(command.speed) / robot.max_acceleration, abs(command.yaw_rate) / robot.max_yaw_acceleration)


def braked(command: Twist, robot: RobotSpec, hz: int) -> Twist:
    """Return the next command of a robot that brakes on the same arc, as far as its yaw rate can follow."""
    share = max(0.0, 1 - robot.max_acceleration / hz / abs(command.speed)) if command.speed else 0.0
    turning = max(abs(command.yaw_rate) * share, abs(command.yaw_rate) - robot.max_yaw_acceleration / hz, 0.0)
    return Twist(command.speed * share, math.copysign(turning, command.yaw_rate))
