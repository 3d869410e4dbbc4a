"""What a real robot adds: wheels that slip, encoders that err, commands that come late, a pose that is only measured.

The levels stand in the robot's file; a drive scales them, 0 being the perfect robot. All chance comes from the generator given.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from antdrive.robots.control.pursuit import Twist
from antdrive.robots.spec import Noise
from antdrive.worlds import Floats, Pose

SLIP_TIME = 0.5  # over which slip forgets itself [s]


class Senses:
    """One drive of a noisy robot: what its wheels make of commands, and where it believes to be.

    Between two fixes of its pose the robot reckons by its encoders; a fix moves the belief by the gain of a steady Kalman
    filter. Slip is a factor on each wheel's speed that wanders as a first-order Gauss-Markov process and that encoders, which
    count the wheel's turns, do not see.
    """

    def __init__(self, noise: Noise, track: float, period: float, start: Pose, rng: np.random.Generator) -> None:
        self._noise, self._half_track, self._period, self._rng = noise, track / 2, period, rng
        self._slip = np.zeros(2)
        self._pending = deque([Twist(0.0, 0.0)] * round(noise.delay / period))
        self._ticks_per_fix = max(1, round(1 / (noise.pose_rate * period)))
        self._tick = 0
        self.estimate = start
        # What reckoning at 1 m/s loses between two fixes; slip lasts, so that it adds up over several.
        lasting = max(1.0, 2 * SLIP_TIME * noise.pose_rate)
        drift = (noise.encoder**2 + lasting * noise.slip**2) / noise.pose_rate**2
        self._gain = _steady_gain(drift / 2, noise.pose_xy**2), _steady_gain(2 * drift / track**2, noise.pose_yaw**2)

    def look(self, pose: Pose, twist: Twist) -> Pose:
        """Where the robot, now truly at `pose` and moving by `twist`, believes to be."""
        noise, rng = self._noise, self._rng
        rolled = self._wheels(twist) / (1 + self._slip) * (1 + noise.encoder * rng.standard_normal(2))
        fix = np.asarray(pose) + rng.standard_normal(3) * (noise.pose_xy, noise.pose_xy, noise.pose_yaw)
        if self._tick:
            self.estimate = _moved(self.estimate, self._twist(*rolled), self._period)
        if self._tick % self._ticks_per_fix == 0:
            x, y, yaw = self.estimate
            by_xy, by_yaw = self._gain
            turned = math.remainder(fix[2] - yaw, 2 * math.pi)
            self.estimate = (x + by_xy * (fix[0] - x), y + by_xy * (fix[1] - y), yaw + by_yaw * turned)
        self._tick += 1
        return self.estimate

    def ahead(self) -> Pose:
        """Where it will believe to be when the next command takes effect: the delay is known, and what is under way."""
        pose = self.estimate
        for twist in self._pending:
            pose = _moved(pose, twist, self._period)
        return pose

    def act(self, command: Twist) -> Twist:
        """What the wheels do now: an earlier command, with slip."""
        self._pending.append(command)
        late = self._pending.popleft()
        keep = math.exp(-self._period / SLIP_TIME)
        fresh = self._noise.slip * math.sqrt(1 - keep * keep)
        self._slip = keep * self._slip + fresh * self._rng.standard_normal(2)
        return self._twist(*(self._wheels(late) * (1 + self._slip)))

    def _wheels(self, twist: Twist) -> Floats:
        rim = twist.yaw_rate * self._half_track
        return np.array([twist.speed - rim, twist.speed + rim])

    def _twist(self, left: float, right: float) -> Twist:
        return Twist(float(left + right) / 2, float(right - left) / (2 * self._half_track))


def _moved(pose: Pose, twist: Twist, time: float) -> Pose:
    """A pose after driving on for a time."""
    x, y, yaw = pose
    middle = yaw + twist.yaw_rate * time / 2
    return (
        x + twist.speed * math.cos(middle) * time,
        y + twist.speed * math.sin(middle) * time,
        yaw + twist.yaw_rate * time,
    )


def _steady_gain(drift: float, error: float) -> float:
    """A scalar Kalman filter's gain in the long run, from the variances between two fixes and of a fix."""
    if error == 0:
        return 1.0
    ratio = drift / error
    return min(1.0, max(0.05, (math.sqrt(ratio * ratio + 4 * ratio) - ratio) / 2))
