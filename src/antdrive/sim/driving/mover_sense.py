"""Ground-truth movers that a robot is given."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Floats, Point
from antdrive.robots.control.observation import Movers
from antdrive.sim.policy import Perception
from antdrive.worlds import Trajectories

CHUNK = 240  # control periods whose positions and velocities are computed at once
BEYOND = 2.0  # movers this far beyond the range are given; the robot omits them where it will be or believes to be [m]


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
