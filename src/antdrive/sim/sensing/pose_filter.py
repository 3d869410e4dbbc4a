"""Extended Kalman filter for a robot's pose, from odometry and pose fixes."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots import Twist
from antdrive.robots.noise import SLIP_TIME
from antdrive.robots.spec import SAMPLE_RATE, Noise, Odometry

FINEST = 1e-6  # least standard deviation of a fix in the filter [m], [rad]: exact fixes would make it singular


class PoseFilter:
    """Extended Kalman filter (R. E. Kalman, *A new approach to linear filtering and prediction problems*, 1960; S. Thrun,
    W. Burgard and D. Fox, *Probabilistic Robotics*, MIT Press 2005, chapters 3 and 7).

    It estimates the pose and the systematic errors of odometry: slip of the left and right wheel, scale of the speed, scale
    of the yaw rate, and bias of the gyro.

    Attributes:
        covariance: covariance of x, y [m], yaw [rad] and the systematic errors (8, 8)
        errors: estimates of the systematic errors (5,)

    Args:
        noise: levels of wheels and pose fixes
        gyro: errors of odometry with a gyro; None: the wheels measure the yaw rate
        track: distance between the wheels [m]
        period: control period [s]
    """

    def __init__(self, noise: Noise, gyro: Odometry | None, track: float, period: float) -> None:
        self._fix = [max(level, FINEST) ** 2 for level in (noise.pose_xy, noise.pose_xy, noise.pose_yaw)]
        self._encoder, self._half_track, self._period = noise.encoder**2, track / 2, period
        keep = math.exp(-period / SLIP_TIME)
        fade = np.array([1.0, 1.0, 1.0, keep, keep, 1.0, 1.0, 1.0])
        self._fade, self._keep = np.outer(fade, fade), fade[3:]
        self._fresh = np.diag([0.0, 0.0, 0.0, *[noise.slip**2 * (1 - keep * keep)] * 2, 0.0, 0.0, 0.0])
        self.covariance, self.errors = np.zeros((8, 8)), np.zeros(5)
        self._by_wheels, self._white = np.array([[0.5, 0.5], [-1 / track, 1 / track]]), np.zeros((2, 2))
        self._of_errors = np.zeros((2, 5))  # from systematic errors to those of a twist
        self._of_errors[1, 4] = 1.0
        self._extra = 0.0, 0.0  # variances of samples of the speed, as a fraction of it, and of the yaw rate
        if gyro is not None:
            self._by_wheels[1] = 0.0
            self.covariance[5:, 5:] = np.diag([gyro.speed_scale**2, gyro.yaw_scale**2, gyro.gyro_bias**2])
            samples = SAMPLE_RATE * period
            self._extra = gyro.speed_noise**2 / samples, gyro.gyro_noise**2 / samples

    def predict(self, pose: Pose, odometry: Twist) -> Pose:
        """Return the pose after a control period with a measured twist."""
        speed, rate = odometry
        rim, period, wheels = rate * self._half_track, self._period, self._of_errors
        by_wheels = self._by_wheels * (speed - rim, speed + rim)
        wheels[:, :2], wheels[0, 2], wheels[1, 3] = -by_wheels, speed, rate
        self._white = self._encoder * by_wheels @ by_wheels.T
        self._white[0, 0] += self._extra[0] * speed * speed
        self._white[1, 1] += self._extra[1]
        self.errors = self.errors * self._keep
        off_speed, off_rate = (wheels @ self.errors).tolist()
        speed, rate = speed - off_speed, rate - off_rate
        x, y, yaw = pose
        middle = yaw + rate * period / 2
        cos, sin = period * math.cos(middle), period * math.sin(middle)
        moves = np.array([[cos, -speed * sin * period / 2], [sin, speed * cos * period / 2], [0.0, period]])
        step = np.eye(8)
        step[0, 2], step[1, 2] = -speed * sin, speed * cos
        step[:3, 3:] = moves @ wheels
        self.covariance = step @ (self.covariance * self._fade + self._fresh) @ step.T
        self.covariance[:3, :3] += moves @ self._white @ moves.T
        return x + speed * cos, y + speed * sin, yaw + rate * period

    @property
    def twist_covariance(self) -> Floats:
        """Covariance of the twist that the last prediction used, speed and yaw rate (2, 2)."""
        return np.asarray(self._of_errors @ self.covariance[3:, 3:] @ self._of_errors.T + self._white)

    def correct(self, pose: Pose, fix: Pose) -> Pose:
        """Return the pose after a fix. The errors of its x, y and yaw are independent, so it enters number by number."""
        off = pose[0] - fix[0], pose[1] - fix[1], math.remainder(pose[2] - fix[2], 2 * math.pi)
        change = np.zeros(8)  # of the pose's error, which is estimate less truth, and of odometry's
        for i, variance in enumerate(self._fix):
            column = self.covariance[i]
            expected = column[i] + variance
            change = change + column * ((off[i] - change[i]) / expected)
            self.covariance = self.covariance - np.outer(column, column) / expected
        self.errors = self.errors + change[3:]
        x, y, yaw = (here - error for here, error in zip(pose, change.tolist()[:3], strict=True))
        return x, y, yaw
