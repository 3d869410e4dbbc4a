"""Localisers: exact pose, noisy pose fixes (mapless: with a gyro), dead reckoning, true pose.

All but `Exact` share wheel slip and command delay. To add one, write a class and add its name to `LOCALISATIONS` in
`antdrive.sim.settings`. `Scenario` checks its requirements, `antdrive.sim.log.consistency` its log.
`antdrive.sim.driving.survey` corrects estimates with scans.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots import NoiseModel, RobotSpec, Twist
from antdrive.robots.noise import steady_errors
from antdrive.robots.spec import Noise, Odometry
from antdrive.sim.driving.parts import Rows
from antdrive.sim.log.streams import random_stream
from antdrive.sim.sensing.dead_reckoning import DeadReckoning
from antdrive.sim.sensing.pose_filter import PoseFilter

if TYPE_CHECKING:
    from antdrive.sim.log.record import DriveRecord
    from antdrive.sim.physics.engine import State


class Exact:
    """Localiser with the exact pose and ideal wheels.

    Attributes:
        noisy: false
        matched: false
        estimates: empty, since estimates equal the true poses
    """

    noisy = matched = False
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
        matched: whether scan matching corrects the estimates
        gyro: errors of odometry with a gyro; None without one
        estimates: the estimated pose of each control period so far
    """

    noisy, matched = True, False
    gyro: Odometry | None = None

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

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate after pose fixes (3, 3)."""
        xy, yaw = steady_errors(self._noise, 2 * self._half_track)
        return np.diag([xy**2, xy**2, yaw**2])

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

    def __init__(
        self, noise: Noise, track: float, period: float, start: Pose, seed: int, errors: Odometry, *, matched: bool
    ) -> None:
        super().__init__(noise, track, period, start, random_stream(seed, "noise"))
        self.gyro, self.matched = errors, matched
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


class Fused(Fixes):
    """Localiser of a mapless robot with pose fixes: a Kalman filter fuses them with odometry of encoders and a gyro.

    Scan matching moves its estimate, unless fixes are exact. The covariance stays: the map has the errors of the estimates
    that built it.
    """

    def __init__(self, noise: Noise, track: float, period: float, start: Pose, seed: int, errors: Odometry) -> None:
        super().__init__(noise, track, period, start, random_stream(seed, "noise"))
        self.gyro, self.matched = errors, bool(noise.pose_xy or noise.pose_yaw)
        self._reckoning = DeadReckoning(errors, random_stream(seed, "odometry"), start)
        self._filter = PoseFilter(noise, errors, track, period)

    def _predicted(self, twist: Twist) -> Pose:
        self._reckoning.advance(self.encoders.speed, twist.yaw_rate, self._period)
        self.odometry = Twist(*self._reckoning.measured)
        return self._filter.predict(self.estimate, self.odometry)

    def _corrected(self, fix: Floats) -> Pose:
        x, y, yaw = fix.tolist()
        return self._filter.correct(self.estimate, (x, y, yaw))

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate (3, 3)."""
        return self._filter.covariance[:3, :3]


def localiser_of(
    kind: str,
    robot: RobotSpec,
    noise: float,
    odometry: float,
    period: float,
    start: Pose,
    seed: int,
    *,
    mapless: bool = False,
) -> Exact | Fixes:
    """Create the localiser of a drive."""
    levels, errors = robot.noise.scaled(noise), Odometry().scaled(odometry)
    if kind in ("odometry", "matching"):
        return Reckoned(levels, robot.track, period, start, seed, errors, matched=kind == "matching")
    if not levels.nonzero:
        return Exact()
    if kind == "fixes" and mapless:
        return Fused(levels, robot.track, period, start, seed, errors)
    localiser = {"true": TruePose, "fixes": Fixes}[kind]
    return localiser(levels, robot.track, period, start, random_stream(seed, "noise"))


def logged_localiser(record: DriveRecord) -> Exact | Fixes:
    """Create the localiser of a logged drive."""
    odometry = 1.0 if record.sensing is None else record.sensing.odometry
    period, start = 1 / record.control_hz, record.task.start
    kind, mapless = record.localisation, record.mapless
    return localiser_of(kind, record.robot, record.noise, odometry, period, start, record.seed, mapless=mapless)
