"""Odometer of wheels and a gyro."""

from __future__ import annotations

import math

import numpy as np

from antdrive.robots import Twist
from antdrive.robots.spec import SAMPLE_RATE, Odometry


class Odometer:
    """Speed and yaw rate of a robot, measured with the errors of odometry.

    Args:
        odometry: the measurement errors
        rng: the random stream: three numbers for the drive, then two per sample
    """

    def __init__(self, odometry: Odometry, rng: np.random.Generator) -> None:
        self._odometry, self._rng = odometry, rng
        scale, turn, bias = rng.standard_normal(3)
        self._scale = 1 + odometry.speed_scale * float(scale)
        self._turn = 1 + odometry.yaw_scale * float(turn)
        self._bias = odometry.gyro_bias * float(bias)

    def measured(self, twist: Twist, dt: float) -> Twist:
        """Return the measured velocity for a true one.

        Args:
            twist: the true velocity
            dt: duration of the sample [s]
        """
        once, turn_noise = self._rng.standard_normal(2)
        louder = 1 / math.sqrt(SAMPLE_RATE * dt)  # short samples average less noise
        speed = twist.speed * (self._scale + self._odometry.speed_noise * louder * float(once))
        rate = twist.yaw_rate * self._turn + self._bias + self._odometry.gyro_noise * louder * float(turn_noise)
        return Twist(speed, rate)
