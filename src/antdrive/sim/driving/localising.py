"""Localisers: exact, by noisy pose fixes, by dead reckoning (which scan matching may correct), or by the true pose.

The same wheels slip and the same commands are late whichever way the robot localises itself. A new kind is a class here and a
word of `LOCALISATIONS` in `antdrive.sim.settings`; what it needs is checked in `Scenario`, what its log must show in
`antdrive.sim.log.consistency`. Scans correct the estimate in `antdrive.sim.driving.survey`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from antdrive.base import Pose
from antdrive.robots import NoiseModel, RobotSpec, Twist
from antdrive.robots.spec import Noise, Odometry
from antdrive.sim.driving.parts import Rows
from antdrive.sim.log.streams import random_stream
from antdrive.sim.physics.engine import State
from antdrive.sim.sensing.dead_reckoning import DeadReckoning


class Exact:
    """A robot that knows its pose and whose wheels do as they are told.

    Attributes:
        noisy: false
        estimates: empty: estimates are poses
    """

    noisy = False
    estimates: Sequence[Pose] = ()

    def sense(self, state: State) -> Pose:
        """The true pose."""
        return state.pose

    def settle(self, estimate: Pose) -> Pose:
        """The pose itself: commands take effect at once."""
        return estimate

    def actuate(self, command: Twist) -> Twist:
        """The command itself."""
        return command

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Nothing: estimates are poses, and the motors are set to the commands."""
        return {}


class Fixes(NoiseModel):
    """Wheel odometry that noisy pose fixes correct.

    Attributes:
        noisy: true
        estimates: the estimated pose in each control period so far
    """

    noisy = True

    def __init__(self, noise: Noise, track: float, period: float, start: Pose, rng: np.random.Generator) -> None:
        super().__init__(noise, track, period, start, rng)
        self.estimates: list[Pose] = []

    def sense(self, state: State) -> Pose:
        """The pose by odometry and, where one is due, a fix."""
        return self.estimate_pose(state.pose, Twist(state.speed, state.yaw_rate))

    def settle(self, estimate: Pose) -> Pose:
        """Go on from an estimate; the pose after the commands that are under way."""
        self.estimate = estimate
        self.estimates.append(estimate)
        return self.pose_after_delay()

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """The estimates, whose error stays the same between two control periods, and the targets of the motors."""
        errors = [
            (x - true_x, y - true_y, math.remainder(yaw - true_yaw, 2 * math.pi))
            for (x, y, yaw), (true_x, true_y, true_yaw) in zip(
                self.estimates, log.pose[::per_tick].tolist(), strict=False
            )
        ]
        period = np.minimum(np.arange(len(log.t)) // per_tick, max(len(errors) - 1, 0))
        return {"estimate": log.pose + np.array(errors or [(0.0, 0.0, 0.0)])[period], "actuated": log.actuated}


class TruePose(Fixes):
    """The true pose, on wheels that slip."""

    def estimate_pose(self, pose: Pose, twist: Twist) -> Pose:
        """The true pose."""
        return pose


class Reckoned(Fixes):
    """Dead reckoning: encoders tell the speed, a gyro the yaw rate, and errors add up. Scans may correct it."""

    def __init__(self, robot: RobotSpec, noise: float, period: float, start: Pose, seed: int, errors: Odometry) -> None:
        super().__init__(robot.noise.scaled(noise), robot.track, period, start, random_stream(seed, "noise"))
        self._reckoning = DeadReckoning(errors, random_stream(seed, "odometry"), start)

    def estimate_pose(self, pose: Pose, twist: Twist) -> Pose:
        """The pose that odometry gives for a robot whose true velocity is `twist`."""
        noise = self._noise
        rolled = self._wheels(twist) / (1 + self._slip) * (1 + noise.encoder * self._rng.standard_normal(2))
        if self._tick:
            self.estimate = self._reckoning.advance(self._twist(*rolled).speed, twist.yaw_rate, self._period)
        self._tick += 1
        return self.estimate

    def settle(self, estimate: Pose) -> Pose:
        """Go on from an estimate; the pose after the commands that are under way."""
        self._reckoning.pose = estimate
        return super().settle(estimate)


def localiser_of(
    kind: str, robot: RobotSpec, noise: float, odometry: float, period: float, start: Pose, seed: int
) -> Exact | Fixes:
    """The localiser of one drive."""
    if kind in ("odometry", "matching"):
        return Reckoned(robot, noise, period, start, seed, Odometry().scaled(odometry))
    levels = robot.noise.scaled(noise)
    if not levels.nonzero:
        return Exact()
    localiser = {"true": TruePose, "fixes": Fixes}[kind]
    return localiser(levels, robot.track, period, start, random_stream(seed, "noise"))
