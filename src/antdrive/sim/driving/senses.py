"""Senses of a robot: what wheels, gyro, pose fixes and lidar measure of the true state, and which movers it is given.

`antdrive.sim.driving.localising` estimates the pose from the measurements alone.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from antdrive.base import Floats, Point, Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.control.observation import FirstSight, Movers
from antdrive.robots.lidar import Lidar
from antdrive.robots.noise import Wheels
from antdrive.robots.spec import Noise, Odometry
from antdrive.sim.driving.localising import Exact, Fixes, Fused, Reckoned
from antdrive.sim.log.streams import random_stream
from antdrive.sim.policy import Perception
from antdrive.sim.sensing.odometer import Odometer
from antdrive.sim.sensing.scanner import Scanner
from antdrive.worlds import Trajectories, World
from antdrive.worlds.world import PointWorld

if TYPE_CHECKING:
    from antdrive.sim.log.record import DriveRecord
    from antdrive.sim.physics.engine import State


GROUND_BEYOND = 0.2  # what is farther than this beyond a radius meets no cell of a map within it [m]
CHUNK = 240  # control periods whose positions and velocities are computed at once
BEYOND = 2.0  # movers this far beyond the range are given; the robot omits them where it will be or believes to be [m]


class Senses:
    """Exact senses on ideal wheels.

    Attributes:
        noisy: whether measurements or wheels have errors
        pending: the commands that have not reached the motors yet, oldest first
        gyro: errors of odometry with a gyro; None without one
        encoders: the velocity that the encoders measured in the last control period
        lidar: scans the true world; None: unused
        movers: tells of movers; None: unused
    """

    noisy = False
    pending: Collection[Twist] = ()
    gyro: Odometry | None = None
    encoders = Twist(0.0, 0.0)
    lidar: SimulatedLidar | None = None
    movers: MoverSense | None = None

    def read(self, state: State) -> tuple[Twist, Pose | None]:
        """Return the velocity by odometry, and a pose fix if one is due. Call once in a control period, before `actuate`."""
        return Twist(state.speed, state.yaw_rate), state.pose

    def actuate(self, command: Twist) -> Twist:
        """Return the motor targets for a command."""
        return command


class NoisySenses(Senses):
    """Slipping wheels with encoders, a gyro if there are errors for one, and pose fixes.

    Args:
        noise: the levels
        track: distance between the wheels [m]
        period: control period [s]
        seed: the drive's seed
        gyro: errors of odometry with a gyro; None: no gyro
        fixes: `noisy`, `exact`, which need no odometry, or `none`
    """

    noisy = True

    def __init__(
        self, noise: Noise, track: float, period: float, seed: int, gyro: Odometry | None = None, fixes: str = "noisy"
    ) -> None:
        self._noise, self._period, self._rng = noise, period, random_stream(seed, "noise")
        self._wheels = Wheels(noise, track, period, self._rng)
        self.pending, self.gyro, self._fixes, self._tick = self._wheels.pending, gyro, fixes, 0
        self._odometer = Odometer(gyro, random_stream(seed, "odometry")) if gyro is not None else None
        self._periods_per_fix = max(1, round(1 / (noise.pose_rate * period)))

    def read(self, state: State) -> tuple[Twist, Pose | None]:
        """Return the velocity by odometry, and a pose fix if one is due. Call once in a control period, before `actuate`."""
        if self._fixes == "exact":
            return super().read(state)
        self.encoders = odometry = self._wheels.measured(Twist(state.speed, state.yaw_rate))
        fix = self._fix(state.pose) if self._fixes == "noisy" else None  # draws in every period
        if self._odometer is not None and self._tick:
            odometry = self._odometer.measured(Twist(self.encoders.speed, state.yaw_rate), self._period)
        due = self._tick % self._periods_per_fix == 0
        self._tick += 1
        return odometry, fix if due else None

    def actuate(self, command: Twist) -> Twist:
        """Return the motor targets for a command."""
        return self._wheels.actuate(command)

    def _fix(self, pose: Pose) -> Pose:
        levels = self._noise.pose_xy, self._noise.pose_xy, self._noise.pose_yaw
        x, y, yaw = (pose + self._rng.standard_normal(3) * levels).tolist()
        return x, y, yaw


class SimulatedLidar:
    """Simulated lidar in the true world, with at most one scan per control period.

    Attributes:
        taken: all scans so far, with their control periods

    Args:
        lidar: the lidar
        world: the static obstacles
        trajectories: true motions of the movers
        hz: control periods per second
        rng: source of range noise; None: no noise
    """

    def __init__(
        self, lidar: Lidar, world: World, trajectories: Trajectories, hz: int, rng: np.random.Generator | None
    ) -> None:
        self._scanner, self._world, self._trajectories = Scanner.of(lidar.at(hz), world), world, trajectories
        self._hz, self._rng = hz, rng
        self.taken: list[tuple[int, Floats]] = []

    def scan(self, tick: int, pose: Pose) -> Floats | None:
        """Return a scan (beams,) [m] from a true pose, if one is due in a control period. The first is due at once."""
        if self.taken and (tick == self.taken[-1][0] or not self._scanner.lidar.due(tick, self._hz)):
            return None
        movers = self._trajectories
        places = movers.positions(np.array([tick / self._hz]))[0] if movers else None
        ranges = self._scanner.scan(pose, places, movers.radii if movers else None, self._rng)
        self.taken.append((tick, ranges))
        return ranges

    def first(self, start: Pose, radius: float) -> FirstSight:
        """Return what a mapless robot is given at its start, with ground within a radius [m]."""
        movers = self._trajectories
        there = np.column_stack((movers.positions(np.zeros(1))[0], movers.radii)) if movers else np.empty((0, 3))
        ranges = self.scan(0, start)
        assert ranges is not None
        return FirstSight(start_ground(self._world, start[:2], radius, there), ranges)


def start_ground(world: World, place: Point, radius: float, movers: Floats) -> World:
    """Return the part of a world within a radius [m] of a place; discs (M, 3) stand for its movers."""
    reach = radius + GROUND_BEYOND
    discs = np.concatenate((world.discs, movers.reshape(-1, 3)))
    near = np.hypot(discs[:, 0] - place[0], discs[:, 1] - place[1]) <= reach + discs[:, 2]
    (x, y), (x0, y0, x1, y1) = place, world.bounds
    bounds = max(x0, x - reach), max(y0, y - reach), min(x1, x + reach), min(y1, y + reach)
    return PointWorld.of("start", bounds, discs[near])


class MoverSense:
    """Movers within range of a robot, by their true motions.

    Args:
        trajectories: the true motions
        perception: what the robot is given, and within which range
        hz: control periods per second
    """

    def __init__(self, trajectories: Trajectories, perception: Perception, hz: int) -> None:
        self._trajectories, self._perception, self._hz = trajectories, perception, hz
        self._numbers = np.arange(len(trajectories.radii))
        self._first, self._positions, self._velocities = 0, np.empty((0, 0, 2)), np.empty((0, 0, 2))

    def read(self, tick: int, position: Point) -> Movers:
        """Return the movers in a control period; where the robot is given no velocities, those since the last period."""
        if not self._first <= tick < self._first + len(self._positions):
            t = np.arange(tick, tick + CHUNK) / self._hz
            self._first, self._positions = tick, self._trajectories.positions(t)
            if self._perception.kind != "positions":
                self._velocities = self._trajectories.velocities(t)
        row, radii = tick - self._first, self._trajectories.radii
        places = self._positions[row]
        velocities = self._observed(tick, places) if self._perception.kind == "positions" else self._velocities[row]
        if self._perception.range == math.inf:
            return Movers(self._numbers, places, velocities, radii)
        near = np.hypot(*(places - position).T) - radii <= self._perception.range + BEYOND
        return Movers(self._numbers[near], places[near], velocities[near], radii[near])

    def _observed(self, tick: int, places: Floats) -> Floats:
        before = self._trajectories.positions(np.array([max(tick - 1, 0) / self._hz]))[0]
        return np.asarray((places - before) * self._hz)


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
        return NoisySenses(*noisy, errors, fixes="none"), Reckoned(*known, matched=kind == "matching")
    if kind == "true" or not levels.nonzero:
        return NoisySenses(*noisy, fixes="exact") if levels.nonzero else Senses(), Exact(*known)
    if mapless:
        return NoisySenses(*noisy, errors), Fused(*known, levels, robot.track, errors)
    return NoisySenses(*noisy), Fixes(*known, levels, robot.track)


def logged_positioning(record: DriveRecord) -> tuple[Senses, Exact]:
    """Create the senses and the localiser of a logged drive."""
    odometry = 1.0 if record.sensing is None else record.sensing.odometry
    levels = record.localisation, record.robot, record.noise, odometry, 1 / record.control_hz
    return positioning(*levels, record.task.start, record.seed, mapless=record.mapless)
