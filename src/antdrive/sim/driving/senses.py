"""Senses of motion: what wheels, gyro and pose fixes measure of the true state, and how commands reach the wheels.

`antdrive.sim.driving.localising` estimates the pose from the measurements alone.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from antdrive.base import Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.noise import Wheels
from antdrive.robots.spec import Noise, Odometry
from antdrive.sim.driving.localising import Exact, Fixes, Fused, Reckoned
from antdrive.sim.log.streams import random_stream
from antdrive.sim.sensing.odometer import Odometer

if TYPE_CHECKING:
    from antdrive.sim.log.record import DriveRecord
    from antdrive.sim.physics.engine import State


class Senses:
    """Exact senses on ideal wheels.

    Attributes:
        noisy: whether measurements or wheels have errors
        pending: the commands that have not reached the motors yet, oldest first
        gyro: errors of odometry with a gyro; None without one
        encoders: the velocity that the encoders measured in the last control period
    """

    noisy = False
    pending: Collection[Twist] = ()
    gyro: Odometry | None = None
    encoders = Twist(0.0, 0.0)

    def read(self, state: State) -> tuple[Twist, Pose | None]:
        """Return the velocity by odometry, and a pose fix if one is due. Call once in a control period, before `actuate`."""
        return Twist(state.speed, state.yaw_rate), state.pose

    def actuate(self, command: Twist) -> Twist:
        """Return the motor targets for a command."""
        return command


class SlippingSenses(Senses):
    """Exact poses on slipping wheels."""

    noisy = True

    def __init__(self, noise: Noise, track: float, period: float, seed: int) -> None:
        self._noise, self._period, self._rng = noise, period, random_stream(seed, "noise")
        self._wheels = Wheels(noise, track, period, self._rng)
        self.pending = self._wheels.pending

    def actuate(self, command: Twist) -> Twist:
        """Return the motor targets for a command."""
        return self._wheels.actuate(command)


class NoisySenses(SlippingSenses):
    """Encoders, with a gyro if there are errors for one, and noisy pose fixes if the robot has any."""

    def __init__(
        self, noise: Noise, track: float, period: float, seed: int, gyro: Odometry | None = None, *, fixes: bool = True
    ) -> None:
        super().__init__(noise, track, period, seed)
        self.gyro, self._fixes = gyro, fixes
        self._odometer = Odometer(gyro, random_stream(seed, "odometry")) if gyro is not None else None
        self._periods_per_fix = max(1, round(1 / (noise.pose_rate * period)))
        self._tick = 0

    def read(self, state: State) -> tuple[Twist, Pose | None]:
        """Return the velocity by odometry, and a pose fix if one is due. Call once in a control period, before `actuate`."""
        self.encoders = odometry = self._wheels.measured(Twist(state.speed, state.yaw_rate))
        fix = self._fix(state.pose) if self._fixes else None  # draws in every period
        if self._odometer is not None and self._tick:
            odometry = self._odometer.measured(Twist(self.encoders.speed, state.yaw_rate), self._period)
        due = self._tick % self._periods_per_fix == 0
        self._tick += 1
        return odometry, fix if due else None

    def _fix(self, pose: Pose) -> Pose:
        levels = self._noise.pose_xy, self._noise.pose_xy, self._noise.pose_yaw
        x, y, yaw = (pose + self._rng.standard_normal(3) * levels).tolist()
        return x, y, yaw


def positioning(
    kind: str,
    robot: RobotSpec,
    noise: float,
    odometry: float,
    period: float,
    start: Pose,
    seed: int,
    *,
    mapless: bool = False,
) -> tuple[Senses, Exact]:
    """Create the senses and the localiser of a drive."""
    levels, errors = robot.noise.scaled(noise), Odometry().scaled(odometry)
    noisy, known = (levels, robot.track, period, seed), (start, period)
    if kind in ("odometry", "matching"):
        return NoisySenses(*noisy, errors, fixes=False), Reckoned(*known, matched=kind == "matching")
    if kind == "true" or not levels.nonzero:
        return SlippingSenses(*noisy) if levels.nonzero else Senses(), Exact(*known)
    if mapless:
        return NoisySenses(*noisy, errors), Fused(*known, levels, robot.track, errors)
    return NoisySenses(*noisy), Fixes(*known, levels, robot.track)


def logged_positioning(record: DriveRecord) -> tuple[Senses, Exact]:
    """Create the senses and the localiser of a logged drive."""
    odometry = 1.0 if record.sensing is None else record.sensing.odometry
    levels = record.localisation, record.robot, record.noise, odometry, 1 / record.control_hz
    return positioning(*levels, record.task.start, record.seed, mapless=record.mapless)
