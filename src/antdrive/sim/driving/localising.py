"""Localisers: the pose by exact fixes, by noisy fixes (mapless: with a gyro), and by dead reckoning.

They know measurements alone, see `antdrive.sim.driving.senses`. To add one, write a class and add its name to
`LOCALISATIONS` in `antdrive.sim.settings`. `Scenario` checks its requirements, `antdrive.sim.log.consistency` its log.
`antdrive.sim.driving.survey` corrects estimates with scans.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots import Twist
from antdrive.robots.noise import fix_gains, moved, steady_errors
from antdrive.robots.spec import Noise, Odometry
from antdrive.sim.sensing.pose_filter import PoseFilter


class Exact:
    """Localiser with exact fixes.

    Attributes:
        matched: whether scan matching corrects the estimates
        pose: the estimated pose: x, y [m] and yaw [rad]

    Args:
        start: the first pose, known exactly
        period: control period [s]
    """

    matched = False

    def __init__(self, start: Pose, period: float) -> None:
        self.pose, self._period, self._begun = start, period, False

    def update(self, odometry: Twist, fix: Pose | None) -> Pose:
        """Return the estimated pose after a control period, by its odometry and a fix, if there is one."""
        if self._begun:
            self.pose = self._predicted(odometry)
        if fix is not None:
            self.pose = self._corrected(fix)
        self._begun = True
        return self.pose

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate after fixes (3, 3)."""
        return np.zeros((3, 3))

    def _predicted(self, odometry: Twist) -> Pose:
        return self.pose

    def _corrected(self, fix: Pose) -> Pose:
        return fix


class Fixes(Exact):
    """Localiser that corrects wheel odometry by noisy fixes, with the gain of a steady-state Kalman filter."""

    def __init__(self, start: Pose, period: float, noise: Noise, track: float) -> None:
        super().__init__(start, period)
        self._noise, self._track, self._gain = noise, track, fix_gains(noise, track)

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate after fixes (3, 3)."""
        xy, yaw = steady_errors(self._noise, self._track)
        return np.diag([xy**2, xy**2, yaw**2])

    def _predicted(self, odometry: Twist) -> Pose:
        return moved(self.pose, odometry, self._period)

    def _corrected(self, fix: Pose) -> Pose:
        x, y, yaw = self.pose
        gain_xy, gain_yaw = self._gain
        turned = math.remainder(fix[2] - yaw, 2 * math.pi)
        return x + gain_xy * (fix[0] - x), y + gain_xy * (fix[1] - y), yaw + gain_yaw * turned


class Reckoned(Exact):
    """Dead reckoning from encoders and a gyro. Errors accumulate; scans may correct them."""

    def __init__(self, start: Pose, period: float, *, matched: bool) -> None:
        super().__init__(start, period)
        self.matched = matched

    def _predicted(self, odometry: Twist) -> Pose:
        return moved(self.pose, Twist(odometry.speed * self._period, odometry.yaw_rate * self._period))


class Fused(Exact):
    """Localiser of a mapless robot with noisy fixes: a Kalman filter fuses them with odometry of encoders and a gyro.

    Scan matching moves its estimate, unless fixes are exact. The covariance stays: the map has the errors of the estimates
    that built it.
    """

    def __init__(self, start: Pose, period: float, noise: Noise, track: float, errors: Odometry) -> None:
        super().__init__(start, period)
        self.matched = bool(noise.pose_xy or noise.pose_yaw)
        self._filter = PoseFilter(noise, errors, track, period)

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate (3, 3)."""
        return self._filter.covariance[:3, :3]

    def _predicted(self, odometry: Twist) -> Pose:
        return self._filter.predict(self.pose, odometry)

    def _corrected(self, fix: Pose) -> Pose:
        return self._filter.correct(self.pose, fix)
