"""Noise of a drive: wheel slip, encoder errors, delayed commands, and the gains of pose fixes.

The robot file sets the levels (`Noise`). A drive scales them; 0 means a perfect robot. All random numbers come from the
caller's generator.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots.control.observation import Twist
from antdrive.robots.spec import Noise

SLIP_TIME = 0.5  # correlation time of slip [s]
MIN_GAIN = 0.05  # of the filter, so that fixes always correct the estimate


class Wheels:
    """Driven wheels of one drive: slip, encoders and delayed commands.

    Slip is a first-order Gauss-Markov process, a factor on each wheel's speed. Encoders count turns of the wheels and do
    not measure slip.

    Attributes:
        pending: the commands that have not reached the motors yet, oldest first

    Args:
        noise: the levels
        track: distance between the wheels [m]
        period: control period [s]
        rng: the random generator
    """

    def __init__(self, noise: Noise, track: float, period: float, rng: np.random.Generator) -> None:
        self._noise, self._half_track, self._period, self._rng = noise, track / 2, period, rng
        self._slip = np.zeros(2)
        self.pending = deque([Twist(0.0, 0.0)] * round(noise.delay / period))

    def measured(self, twist: Twist) -> Twist:
        """Return the velocity by the encoders for a true one. Call at most once in a control period, before `actuate`."""
        errors = 1 + self._noise.encoder * self._rng.standard_normal(2)
        return self._twist(*(self._rims(twist) / (1 + self._slip) * errors))

    def actuate(self, command: Twist) -> Twist:
        """Return the velocity of the wheels: the delayed command with slip. A new `command` takes effect after the delay."""
        self.pending.append(command)
        delayed = self.pending.popleft()
        keep = math.exp(-self._period / SLIP_TIME)
        fresh = self._noise.slip * math.sqrt(1 - keep * keep)
        self._slip = keep * self._slip + fresh * self._rng.standard_normal(2)
        return self._twist(*(self._rims(delayed) * (1 + self._slip)))

    def _rims(self, twist: Twist) -> Floats:
        rim = twist.yaw_rate * self._half_track
        return np.array([twist.speed - rim, twist.speed + rim])

    def _twist(self, left: float, right: float) -> Twist:
        return Twist(float(left + right) / 2, float(right - left) / (2 * self._half_track))


def moved(pose: Pose, twist: Twist, time: float = 1.0) -> Pose:
    """Return a pose after driving with a twist for a time [s]; by default for one second."""
    x, y, yaw = pose
    middle = yaw + twist.yaw_rate * time / 2
    return (
        x + twist.speed * math.cos(middle) * time,
        y + twist.speed * math.sin(middle) * time,
        yaw + twist.yaw_rate * time,
    )


def moved_by(pose: Pose, commands: Iterable[Twist], period: float) -> Pose:
    """Return a pose after driving with commands in turn, each for a period [s]."""
    for command in commands:
        pose = moved(pose, command, period)
    return pose


def steady_errors(noise: Noise, track: float) -> tuple[float, float]:
    """Return the standard deviations of the estimate in x or y [m] and in heading [rad] at 1 m/s; `track` is in metres."""
    gain_xy, gain_yaw = fix_gains(noise, track)
    return math.sqrt(gain_xy) * noise.pose_xy, math.sqrt(gain_yaw) * noise.pose_yaw


def fix_gains(noise: Noise, track: float) -> tuple[float, float]:
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
