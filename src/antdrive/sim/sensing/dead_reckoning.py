"""Dead reckoning from wheels and a gyro."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Pose
from antdrive.robots.spec import SAMPLE_RATE, Odometry


class DeadReckoning:
    """Pose estimate in the odometry frame, integrated from measured speeds and yaw rates.

    Attributes:
        pose: the estimated pose: x, y [m] and yaw [rad]
        measured: speed [m/s] and yaw rate [rad/s] of the last sample

    Args:
        odometry: the measurement errors
        rng: the random stream: three numbers for the drive, then two per call of `advance`
        start: the first pose, assumed exact
    """

    def __init__(self, odometry: Odometry, rng: np.random.Generator, start: Pose = (0.0, 0.0, 0.0)) -> None:
        self._odometry, self._rng = odometry, rng
        scale, turn, bias = rng.standard_normal(3)
        self._scale = 1 + odometry.speed_scale * float(scale)
        self._turn = 1 + odometry.yaw_scale * float(turn)
        self._bias = odometry.gyro_bias * float(bias)
        self.pose, self.measured = start, (0.0, 0.0)

    def advance(self, speed: float, yaw_rate: float, dt: float) -> Pose:
        """Advance by one sample, and return the estimated pose.

        Args:
            speed: the true forward speed [m/s]
            yaw_rate: the true yaw rate, counter-clockwise [rad/s]
            dt: duration of the sample [s]
        """
        once, turn_noise = self._rng.standard_normal(2)
        louder = 1 / math.sqrt(SAMPLE_RATE * dt)  # short samples average less noise
        measured = speed * (self._scale + self._odometry.speed_noise * louder * float(once))
        rate = yaw_rate * self._turn + self._bias + self._odometry.gyro_noise * louder * float(turn_noise)
        self.measured = measured, rate
        x, y, yaw = self.pose
        middle = yaw + rate * dt / 2
        way = measured * dt
        self.pose = (x + way * math.cos(middle), y + way * math.sin(middle), yaw + rate * dt)
        return self.pose
