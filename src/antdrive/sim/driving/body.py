"""Body of a robot in a drive: its plant, its senses, and the referee that ends the drive."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from antdrive.base import Pose
from antdrive.robots import Twist
from antdrive.robots.control.observation import NOBODY, REST, Observation
from antdrive.sim.driving.localising import Exact
from antdrive.sim.driving.parts import SILENT, Drive, Ending, Note, at_goal
from antdrive.sim.driving.senses import Senses
from antdrive.sim.log.ending import control_periods, outcome_at, stopped
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import scans_logged

if TYPE_CHECKING:
    from antdrive.sim.physics.engine import State
    from antdrive.worlds import Task


class Plant(Protocol):
    """Robot that executes twists: in physics (`Bullet`) or exactly (`Kinematic`)."""

    state: State  # true pose and velocity

    @property
    def touched(self) -> bool:
        """Whether the robot has touched anything so far."""

    def advance(self, command: Twist, actuated: Twist, limiter: int = 0) -> None:
        """Drive for one control period with the given motor targets; the command and its limiter are for the log."""


class Body:
    """Robot that is observed and commanded period by period, until its drive ends.

    Attributes:
        tick: the number of the control period
        ended: how the drive ended; None while it goes on
        estimates: the pose in which the robot believed in each control period so far
    """

    def __init__(
        self,
        plant: Plant,
        senses: Senses,
        localiser: Exact,
        *,
        hz: int,  # control periods per second
        limit: float,  # time limit [s]
        task: Task | None = None,  # where the drive ends; None: nowhere
    ) -> None:
        self._plant, self._senses, self._localiser, self._task = plant, senses, localiser, task
        self._periods, self._hz = control_periods(limit, hz), hz
        self.estimates: list[Pose] = []
        self._command = REST  # in force
        self._now: Observation | None = None
        self.tick = 0
        late = None if self._periods else Ending(Outcome.TIMED_OUT)
        self.ended = Ending(Outcome.COLLIDED) if plant.touched else late

    def observe(self) -> Observation:
        """Return what the robot observes in this control period."""
        if self._now is None:
            state, senses = self._plant.state, self._senses
            twist, fix = senses.read(state)
            pose = self._localiser.update(twist, fix)
            scan = senses.lidar.scan(self.tick, state.pose) if senses.lidar else None
            standing, pending = stopped((state.speed, state.yaw_rate), REST), tuple(senses.pending)
            movers = senses.movers.read(self.tick, pose[:2]) if senses.movers else NOBODY
            t = self.tick / self._hz
            self._now = Observation(self.tick, t, pose, twist, self._command, pending, scan, movers, standing)
        return self._now

    def step(self, command: Twist | None, note: Note = SILENT) -> None:
        """Drive for one control period; without a command, or at the goal, the drive ends where the robot stands."""
        now, task = self._now or self.observe(), self._task
        believed = self._localiser.pose = note.pose or now.pose
        self.estimates.append(believed)
        stays = command is None and note.ending is None
        if task is not None and not stays:
            stays = at_goal(now, believed, task.goal, task.goal_tolerance)
        if stays:
            self.ended = self._judged(believed)
            return
        if command is None:
            self.ended = note.ending
            return
        self._command, self._now = command, None
        self._plant.advance(command, self._senses.actuate(command), note.limiter)
        self.ended = Ending(Outcome.COLLIDED) if self._plant.touched else note.ending
        if self.ended is None:
            self.tick += 1
            if self.tick >= self._periods:
                self.ended = Ending(Outcome.TIMED_OUT)

    def logged(self, log: Drive, per_tick: int) -> dict[str, Any]:
        """Return the scans, and for a robot with noise the estimates and the motor targets.

        The error of an estimate stays constant within a control period.
        """
        lidar = self._senses.lidar
        scans = scans_logged(lidar.taken, per_tick, len(log.t)) if lidar else {}
        if not self._senses.noisy:
            return scans
        errors = [
            (x - true_x, y - true_y, math.remainder(yaw - true_yaw, 2 * math.pi))
            for (x, y, yaw), (true_x, true_y, true_yaw) in zip(
                self.estimates, log.pose[::per_tick].tolist(), strict=False
            )
        ]
        period = np.minimum(np.arange(len(log.t)) // per_tick, max(len(errors) - 1, 0))
        return scans | {"estimate": log.pose + np.array(errors or [(0.0, 0.0, 0.0)])[period], "actuated": log.actuated}

    def _judged(self, believed: Pose) -> Ending:
        """Return the ending of a robot that stands without contact and believes to be at a pose."""
        task, true = self._task, self._plant.state.pose
        assert task is not None
        left, off = math.dist(true[:2], task.goal), math.dist(believed[:2], task.goal)
        outcome = outcome_at(true, task.goal, task.goal_tolerance)
        if outcome is Outcome.SUCCEEDED:
            return Ending(outcome)
        why = f"the route ends here, {left:.3f} m from the goal; the tolerance is {task.goal_tolerance:g} m"
        if off <= task.goal_tolerance:
            why = (
                f"the robot believed that it was at the goal, {off:.2f} m from it, but was {left:.3f} m from it "
                f"(the tolerance is {task.goal_tolerance:g} m): its estimate was wrong by "
                f"{math.dist(believed[:2], true[:2]):.2f} m"
            )
        return Ending(outcome, why)
