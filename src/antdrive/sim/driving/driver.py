"""What the robot does in one control period: replan, pursue, keep to a schedule, avoid movers, arrive."""

from __future__ import annotations

import math
from typing import NamedTuple

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
from antdrive.sim.driving.caution import SLOWEST, Caution
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.recorder import Ending
from antdrive.sim.driving.replanning import MISSED, ReplanMonitor
from antdrive.sim.driving.schedule import slow_down
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.physics.engine import State
from antdrive.worlds import Task

STOPPED_SPEED = 0.01  # a robot slower than this has stopped [m/s], [rad/s]
WAITING_SPEED = 0.1  # a robot that avoids a mover and is slower than this waits for it [m/s]
STUCK_TIME = 8.0  # a robot without progress for this long is stuck [s]
STUCK_PROGRESS = 0.02  # what counts as progress along the route [m]
GOAL_SHARE = 0.95  # a robot that avoids a mover may stop early within this fraction of the goal's tolerance
DRIFTING_SHARE = 0.6  # and within this one, if it finds movers and its way by its lidar, and where it is by odometry
BLIND_SHARE = 0.3  # of its top speed such a robot backs off where its lidar does not look, unless a mover is met then
AVOIDING, ROTATING = LIMITERS.index("avoid"), LIMITERS.index("rotate")
EXPLORING_LIMITERS = (*LIMITERS, "sight")  # the rules where the robot has no map
OUT_OF_SIGHT = EXPLORING_LIMITERS.index("sight")


class StuckClock(NamedTuple):
    """How long the robot has made no progress along its route. Waiting for a mover does not count.

    Attributes:
        farthest: the farthest that the robot has got along the route [m]
        driving: control periods since then in which the robot was to drive, not rotate
        turning: control periods since then in which the robot rotated in place
        held: how many of all these its sight limited the robot's speed
    """

    farthest: float = 0.0
    driving: int = 0
    turning: int = 0
    held: int = 0

    def after(self, pursuit: PursuitState, waiting: bool) -> StuckClock:
        """The clock after one more control period."""
        if pursuit.arc > self.farthest + STUCK_PROGRESS:
            return StuckClock(pursuit.arc)
        if waiting:
            return self
        held = self.held + (pursuit.limiter == OUT_OF_SIGHT)
        if pursuit.turning:
            return StuckClock(self.farthest, self.driving, self.turning + 1, held)
        return StuckClock(self.farthest, self.driving + 1, self.turning, held)

    @property
    def reason(self) -> str:
        """What is said of a robot that has made no progress for too long."""
        why = f"no progress along the route for {STUCK_TIME:g} s"
        if 2 * self.held > self.driving + self.turning:
            return f"{why}; its sight held it: it had seen no free ground where it was to go"
        return why


class Driver:
    """Drives a robot along a path, period by period. `decide` chooses each command.

    Attributes:
        tracked: the path that the robot follows now
        pursuit: the controller's state: how far the robot has got, and what limited its speed
        command: the twist that was commanded last
        avoids: whether that twist avoids a mover, even if sight then held its speed
    """

    def __init__(
        self,
        controller: PurePursuit,
        tracked: TrackedPath,
        task: Task,
        robot: RobotSpec,
        control_hz: int,
        avoidance: Avoidance | None,
        predictor: Predictor | None,
        monitor: ReplanMonitor | Exploration | None,
        caution: Caution | None = None,
    ) -> None:
        self.tracked, self.command, self.pursuit = tracked, Twist(0.0, 0.0), PursuitState()
        self._controller, self._task, self._robot, self._hz = controller, task, robot, control_hz
        self._avoidance, self._predictor, self._monitor = avoidance, predictor, monitor
        self._caution = caution
        self._drifts = isinstance(monitor, Exploration) and monitor.survey.watch is not None
        blind = self._drifts and robot.lidar is not None and not robot.lidar.full_circle
        self._backwards = BLIND_SHARE * robot.max_speed if blind else math.inf
        self._avoidance_state = AvoidanceState()
        self.avoids = False
        self._clock = StuckClock()
        self._patience = round(STUCK_TIME * control_hz)
        self._full_turn = round(2 * math.pi / robot.max_yaw_rate * control_hz)

    @property
    def stuck(self) -> bool:
        """Whether the robot has made no progress for too long; rotating in place may take a full turn's time longer."""
        clock = self._clock
        return clock.driving >= self._patience or clock.turning >= self._patience + self._full_turn

    @property
    def why_stuck(self) -> str:
        """Why the robot makes no progress."""
        return self._clock.reason

    @property
    def fraction(self) -> float:
        """The fraction of the route that is done."""
        return self.pursuit.arc / self.tracked.length

    def decide(self, tick: int, pose: Pose, state: State) -> Ending | None:
        """Choose the command of one control period, or end the drive.

        Returns:
            How the drive ends now; None if it goes on.
        """
        if self._monitor is not None:
            self._replan_if_triggered(tick, pose, state)
            if self._monitor.wrong:
                return self._wrong_plan(tick)
            if self._monitor.blockage.reason:
                return Ending(Outcome.BLOCKED, self._monitor.blockage.reason)
        if isinstance(self._monitor, Exploration):
            self.tracked = self._monitor.refreshed(self.tracked, pose)
        last, before = self.command, self.pursuit
        self.command, self.pursuit = self._pursue(pose, last, before)
        if isinstance(self._monitor, Exploration):
            self._look_round(pose, last, self._monitor)
        speed_limit = self._keep_to_schedule(tick, last)
        if self._avoidance is not None and self._predictor is not None:
            stopping = self.avoids and self._stops_at_goal(pose, last)
            if stopping and _standing(state):
                return self._arrival(pose, state)
            self._avoid_movers(tick, pose, last, before, speed_limit, stopping)
        self._keep_within_sight(tick, pose, last)
        ending = self._end_of_route(tick, pose, state)
        waiting = self.avoids or speed_limit < WAITING_SPEED or self._looks
        self._clock = self._clock.after(self.pursuit, waiting)
        return ending

    def _pursue(self, pose: Pose, last: Twist, before: PursuitState) -> tuple[Twist, PursuitState]:
        """What the controller commands. A robot that has turned for more than a full turn drives off as soon as it may.

        Between pillars the longest lookahead whose arc is clear depends on the heading. So a robot that turns towards its
        carrot may find the next carrot on its other side, and turn to and fro without end.
        """
        if self._clock.turning <= self._full_turn:
            return self._controller.step(self.tracked, pose, last, before)
        return self._controller.step(self.tracked.without_turning, pose, last, before._replace(turning=False))

    def _replan_if_triggered(self, tick: int, pose: Pose, state: State) -> None:
        """Go on along a new path, if one is due and there is one."""
        assert self._monitor is not None
        waiting = self.avoids and abs(state.speed) < WAITING_SPEED
        trigger = self._monitor.trigger(tick, pose, waiting, self.tracked, self.pursuit.arc)
        if trigger:
            self._follow(self._monitor.replan(tick, pose, trigger))

    def _follow(self, tracked: TrackedPath | None) -> bool:
        """Go on along a new path; whether there is one."""
        if tracked is None:
            return False
        self.tracked, self.pursuit = tracked, PursuitState(limiter=self.pursuit.limiter)
        self._clock = self._clock._replace(farthest=0.0)
        return True

    @property
    def _looks(self) -> bool:
        """Whether the robot looks round."""
        return isinstance(self._monitor, Exploration) and self._monitor.look is not None

    def _look_round(self, pose: Pose, last: Twist, exploration: Exploration) -> None:
        """Turn on the spot where the robot is to look round, once it stands; stop where it has no way."""
        if exploration.look is not None and not last.speed:
            self.command = exploration.look.command(pose, last)
            self.pursuit = self.pursuit._replace(limiter=ROTATING)
        elif exploration.look is not None or exploration.lost:
            self.command = _brake(last, self._robot, self._hz)

    def _keep_within_sight(self, tick: int, pose: Pose, last: Twist) -> None:
        """Slow down where the robot could not stop on ground that it has seen."""
        if self._caution is None:
            return
        wanted = self.command
        self.command, slowed = self._caution.limit(pose, last, wanted)
        if slowed:
            self.pursuit = self.pursuit._replace(limiter=OUT_OF_SIGHT)
        if isinstance(self._monitor, Exploration):
            stands = abs(self.command.speed) < SLOWEST and abs(self.command.yaw_rate) < SLOWEST
            self._monitor.note_sight(tick, wanted if slowed and stands else None)

    def _keep_to_schedule(self, tick: int, last: Twist) -> float:
        """Slow the command down to the schedule, if there is one. Returns the speed that it allows [m/s]."""
        schedule = self._monitor.schedule if self._monitor is not None else None
        if schedule is None:
            return math.inf
        limit = schedule.speed_limit(tick / self._hz, self.pursuit.arc)
        self.command = slow_down(self.command, last, limit, self._robot.max_acceleration / self._hz)
        return limit

    def _avoid_movers(
        self, tick: int, pose: Pose, last: Twist, before: PursuitState, speed_limit: float, stopping: bool
    ) -> None:
        """Replace the command where movers come too close. A robot that is `stopping` brakes for the goal."""
        avoidance = self._avoidance
        assert avoidance is not None
        assert self._predictor is not None
        ahead = avoidance.prediction_times
        if stopping:
            self.command = _brake(last, self._robot, self._hz)
            # A robot that stands at the goal has arrived, so only the time until it stands matters.
            ahead = ahead[: 2 + math.ceil(_stopping_time(last, self._robot) / avoidance.step)]
        movers, radii = self._predictor.predict(tick, pose[:2], ahead)
        if self._monitor is not None:
            radii = radii - self._monitor.blockage.gaps.closer(tick, pose[:2])
        self.command, avoids, self._avoidance_state = avoidance.avoid(
            self.tracked,
            self._robot,
            pose,
            last,
            before,
            self.command,
            self._avoidance_state,
            movers,
            radii,
            speed_limit=speed_limit,
            backwards=self._backwards,
        )
        self.avoids = avoids or stopping
        if self.avoids:
            self.pursuit = self.pursuit._replace(turning=before.turning, limiter=AVOIDING)

    def _end_of_route(self, tick: int, pose: Pose, state: State) -> Ending | None:
        """The ending of a robot that stands at the end of its route, unless it can still get to the goal."""
        left = self.tracked.length - self.pursuit.arc
        if left > self.tracked.goal_distance or not _standing(state) or any(self.command):
            return None
        ending, monitor, task = self._arrival(pose, state), self._monitor, self._task
        # The robot goes by its estimate: one that is at the goal by it stays, even if it missed it, and one that is not goes on.
        knows = math.dist(pose[:2], task.goal) > task.goal_tolerance
        if monitor is None or not knows:
            return ending
        if isinstance(monitor, Exploration) and (monitor.lost or self._looks):
            return None  # it looks for a way already, and no longer than a robot may make no progress
        if self._follow(monitor.replan(tick, pose, MISSED)) or monitor.may_wait:
            return None
        return self._wrong_plan(tick) if monitor.wrong else ending

    def _wrong_plan(self, tick: int) -> Ending:
        """The ending of a drive on which the planner has given a wrong plan."""
        assert self._monitor is not None
        return Ending(Outcome.INVALID_PLAN, f"on the way, at t = {tick / self._hz:g} s: {self._monitor.wrong}")

    def _arrival(self, pose: Pose, state: State) -> Ending:
        """How the drive ends if the robot stops here, where it believes that it is at a pose, without a contact."""
        task, true = self._task, (state.x, state.y)
        left, believed = math.dist(true, task.goal), math.dist(pose[:2], task.goal)
        if left <= task.goal_tolerance:
            return Ending(Outcome.SUCCEEDED)
        why = f"the route ends here, {left:.3f} m from the goal; the tolerance is {task.goal_tolerance:g} m"
        if believed <= task.goal_tolerance:
            why = (
                f"the robot believed that it was at the goal, {believed:.2f} m from it, but was {left:.3f} m from it "
                f"(the tolerance is {task.goal_tolerance:g} m): its estimate was wrong by {math.dist(pose[:2], true):.2f} m"
            )
        return Ending(Outcome.STUCK, why)

    def _stops_at_goal(self, pose: Pose, command: Twist) -> bool:
        """Whether a robot that brakes now stops within the goal's tolerance."""
        x, y, yaw = pose
        goal = self._task.goal
        distance = command.speed * abs(command.speed) / (2 * self._robot.max_acceleration)
        end = (x + distance * math.cos(yaw), y + distance * math.sin(yaw))
        share = DRIFTING_SHARE if self._drifts else GOAL_SHARE
        return max(math.dist((x, y), goal), math.dist(end, goal)) < share * self._task.goal_tolerance


def _standing(state: State) -> bool:
    return abs(state.speed) < STOPPED_SPEED and abs(state.yaw_rate) < STOPPED_SPEED


def _stopping_time(command: Twist, robot: RobotSpec) -> float:
    """How long a robot takes to stop [s]."""
    return max(abs(command.speed) / robot.max_acceleration, abs(command.yaw_rate) / robot.max_yaw_acceleration)


def _brake(command: Twist, robot: RobotSpec, hz: int) -> Twist:
    """The command of a robot that brakes on the same curve, as far as it can slow its turn as fast."""
    share = max(0.0, 1 - robot.max_acceleration / hz / abs(command.speed)) if command.speed else 0.0
    turning = max(abs(command.yaw_rate) * share, abs(command.yaw_rate) - robot.max_yaw_acceleration / hz, 0.0)
    return Twist(command.speed * share, math.copysign(turning, command.yaw_rate))
