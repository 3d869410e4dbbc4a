"""Noise of a drive: wheel slip, encoder errors, delayed commands and pose estimation.

The robot file sets the levels (`Noise`). A drive scales them; 0 means a perfect robot. All random numbers come from the
caller's generator.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots.control.observation import Twist
from antdrive.robots.spec import Noise

SLIP_TIME = 0.5  # correlation time of slip [s]
MIN_GAIN = 0.05  # of the filter, so that fixes always correct the estimate


class NoiseModel:
    """Actuation and pose-estimation noise of one drive.

    Between pose fixes the robot uses odometry. A fix corrects the estimate with the gain of a steady-state Kalman
    filter. Slip is a first-order Gauss-Markov process, a factor on each wheel's speed. Encoders count turns of the
    wheels and do not measure slip.

    Attributes:
        estimate: the estimated pose at the last control period: x, y [m] and yaw [rad]
        encoders: the velocity that the wheels' encoders measured in the last control period
        odometry: the velocity that odometry measured in it; without a gyro that of the encoders

    Args:
        noise: the levels
        track: distance between the wheels [m]
        period: control period [s]
        start: the start pose, known exactly
        rng: the random generator
    """

    def __init__(self, noise: Noise, track: float, period: float, start: Pose, rng: np.random.Generator) -> None:
        self._noise, self._half_track, self._period, self._rng = noise, track / 2, period, rng
        self._slip = np.zeros(2)
        self._pending = deque([Twist(0.0, 0.0)] * round(noise.delay / period))
        self._ticks_per_fix = max(1, round(1 / (noise.pose_rate * period)))
        self._tick = 0
        self.estimate = start
        self.encoders = self.odometry = Twist(0.0, 0.0)
        self._gain = _gains(noise, track)

    def estimate_pose(self, pose: Pose, twist: Twist) -> Pose:
        """Return the estimated pose for a true `pose` and a true velocity `twist`.

        Call once in every control period, before `actuate`.
        """
        noise, rng = self._noise, self._rng
        rolled = self._wheels(twist) / (1 + self._slip) * (1 + noise.encoder * rng.standard_normal(2))
        fix = np.asarray(pose) + rng.standard_normal(3) * (noise.pose_xy, noise.pose_xy, noise.pose_yaw)
        self.encoders = self.odometry = self._twist(*rolled)
        if self._tick:
            self.estimate = self._predicted(twist)
        if self._tick % self._ticks_per_fix == 0:
            self.estimate = self._corrected(fix)
        self._tick += 1
        return self.estimate

    def _predicted(self, twist: Twist) -> Pose:
        """Return the estimate after a control period, by odometry of a robot with a true velocity `twist`."""
        return _moved(self.estimate, self.odometry, self._period)

    def _corrected(self, fix: Floats) -> Pose:
        """Return the estimate after a pose fix (3,)."""
        x, y, yaw = self.estimate
        gain_xy, gain_yaw = self._gain
        turned = math.remainder(fix[2] - yaw, 2 * math.pi)
        return x + gain_xy * (fix[0] - x), y + gain_xy * (fix[1] - y), yaw + gain_yaw * turned

    def pose_after_delay(self) -> Pose:
        """Return the pose expected when the next command takes effect: the estimate moved by pending commands."""
        pose = self.estimate
        for twist in self._pending:
            pose = _moved(pose, twist, self._period)
        return pose

    def actuate(self, command: Twist) -> Twist:
        """Return the velocity of the wheels: the delayed command with slip. A new `command` takes effect after the delay."""
        self._pending.append(command)
        delayed = self._pending.popleft()
        keep = math.exp(-self._period / SLIP_TIME)
        fresh = self._noise.slip * math.sqrt(1 - keep * keep)
        self._slip = keep * self._slip + fresh * self._rng.standard_normal(2)
        return self._twist(*(self._wheels(delayed) * (1 + self._slip)))

    def _wheels(self, twist: Twist) -> Floats:
        rim = twist.yaw_rate * self._half_track
        return np.array([twist.speed - rim, twist.speed + rim])

    def _twist(self, left: float, right: float) -> Twist:
        return Twist(float(left + right) / 2, float(right - left) / (2 * self._half_track))


def _moved(pose: Pose, twist: Twist, time: float) -> Pose:
    """Return a pose after driving with a twist for a time."""
    x, y, yaw = pose
    middle = yaw + twist.yaw_rate * time / 2
    return (
        x + twist.speed * math.cos(middle) * time,
        y + twist.speed * math.sin(middle) * time,
        yaw + twist.yaw_rate * time,
    )


def steady_errors(noise: Noise, track: float) -> tuple[float, float]:
    """Return the standard deviations of the estimate in x or y [m] and in heading [rad] at 1 m/s; `track` is in metres."""
    gain_xy, gain_yaw = _gains(noise, track)
    return math.sqrt(gain_xy) * noise.pose_xy, math.sqrt(gain_yaw) * noise.pose_yaw


def _gains(noise: Noise, track: float) -> tuple[float, float]:
    """Return the gains of pose fixes for the position and the heading."""
    # Variance of odometry at 1 m/s between two fixes. Slip is correlated, so its errors add up over fixes.
    correlated = max(1.0, 2 * SLIP_TIME * noise.pose_rate)
    drift = (noise.encoder**2 + correlated * noise.slip**2) / noise.pose_rate**2
    return _steady_gain(drift / 2, noise.pose_xy**2), _steady_gain(2 * drift / track**2, noise.pose_yaw**2)


def _steady_gain(drift: float, error: float) -> float:
    """Return the steady-state gain of a scalar Kalman filter from the variances of drift and fix."""
    if error == 0:
        return 1.0
    ratio = drift / error
    return min(1.0, max(MIN_GAIN, (math.sqrt(ratio * ratio + 4 * ratio) - ratio) / 2))
