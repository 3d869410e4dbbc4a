"""Localisers: exact pose, noisy pose fixes, dead reckoning (optionally corrected by scan matching), true pose.

All but `Exact` share wheel slip and command delay. To add one, write a class and add its name to `LOCALISATIONS` in
`antdrive.sim.settings`. `Scenario` checks its requirements, `antdrive.sim.log.consistency` its log.
`antdrive.sim.driving.survey` corrects estimates with scans.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from antdrive.base import Pose
from antdrive.robots import NoiseModel, RobotSpec, Twist
from antdrive.robots.spec import Noise, Odometry
from antdrive.sim.driving.parts import Rows
from antdrive.sim.log.streams import random_stream
from antdrive.sim.sensing.dead_reckoning import DeadReckoning

if TYPE_CHECKING:
    from antdrive.sim.log.record import DriveRecord
    from antdrive.sim.physics.engine import State


class Exact:
    """Localiser with the exact pose and ideal wheels.

    Attributes:
        noisy: false
        estimates: empty, since estimates equal the true poses
    """

    noisy = False
    estimates: Sequence[Pose] = ()

    def sense(self, state: State) -> Pose:
        """Return the true pose."""
        return state.pose

    def settle(self, estimate: Pose) -> Pose:
        """Return the pose unchanged: commands take effect at once."""
        return estimate

    def actuate(self, command: Twist) -> Twist:
        """Return the command unchanged."""
        return command

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Return no arrays: estimates equal poses, and motor targets equal commands."""
        return {}


class Fixes(NoiseModel):
    """Localiser that corrects wheel odometry by noisy pose fixes.

    Attributes:
        noisy: true
        estimates: the estimated pose of each control period so far
    """

    noisy = True

    def __init__(self, noise: Noise, track: float, period: float, start: Pose, rng: np.random.Generator) -> None:
        super().__init__(noise, track, period, start, rng)
        self.estimates: list[Pose] = []

    def sense(self, state: State) -> Pose:
        """Return the odometry pose, corrected by a fix where one is due."""
        return self.estimate_pose(state.pose, Twist(state.speed, state.yaw_rate))

    def settle(self, estimate: Pose) -> Pose:
        """Set the estimate, and return the pose after the delayed commands."""
        self.estimate = estimate
        self.estimates.append(estimate)
        return self.pose_after_delay()

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Return the estimates and the motor targets; the error of an estimate stays constant within a control period."""
        errors = [
            (x - true_x, y - true_y, math.remainder(yaw - true_yaw, 2 * math.pi))
            for (x, y, yaw), (true_x, true_y, true_yaw) in zip(
                self.estimates, log.pose[::per_tick].tolist(), strict=False
            )
        ]
        period = np.minimum(np.arange(len(log.t)) // per_tick, max(len(errors) - 1, 0))
        return {"estimate": log.pose + np.array(errors or [(0.0, 0.0, 0.0)])[period], "actuated": log.actuated}


class TruePose(Fixes):
    """Localiser with the true pose on slipping wheels."""

    def estimate_pose(self, pose: Pose, twist: Twist) -> Pose:
        """Return the true pose."""
        return pose


class Reckoned(Fixes):
    """Dead reckoning from encoders and a gyro. Errors accumulate; scans may correct them."""

    def __init__(self, robot: RobotSpec, noise: float, period: float, start: Pose, seed: int, errors: Odometry) -> None:
        super().__init__(robot.noise.scaled(noise), robot.track, period, start, random_stream(seed, "noise"))
        self._reckoning = DeadReckoning(errors, random_stream(seed, "odometry"), start)

    def estimate_pose(self, pose: Pose, twist: Twist) -> Pose:
        """Return the odometry pose of a robot whose true velocity is `twist`."""
        noise = self._noise
        rolled = self._wheels(twist) / (1 + self._slip) * (1 + noise.encoder * self._rng.standard_normal(2))
        self.encoders = self._twist(*rolled)
        if self._tick:
            self.estimate = self._reckoning.advance(self.encoders.speed, twist.yaw_rate, self._period)
            self.odometry = Twist(*self._reckoning.measured)
        self._tick += 1
        return self.estimate

    def settle(self, estimate: Pose) -> Pose:
        """Set the estimate, and return the pose after the delayed commands."""
        self._reckoning.pose = estimate
        return super().settle(estimate)


def localiser_of(
    kind: str, robot: RobotSpec, noise: float, odometry: float, period: float, start: Pose, seed: int
) -> Exact | Fixes:
    """Create the localiser of a drive."""
    if kind in ("odometry", "matching"):
        return Reckoned(robot, noise, period, start, seed, Odometry().scaled(odometry))
    levels = robot.noise.scaled(noise)
    if not levels.nonzero:
        return Exact()
    localiser = {"true": TruePose, "fixes": Fixes}[kind]
    return localiser(levels, robot.track, period, start, random_stream(seed, "noise"))


def logged_localiser(record: DriveRecord) -> Exact | Fixes:
    """Create the localiser of a logged drive."""
    odometry = 1.0 if record.sensing is None else record.sensing.odometry
    period, start = 1 / record.control_hz, record.task.start
    return localiser_of(record.localisation, record.robot, record.noise, odometry, period, start, record.seed)
