"""Physics bodies of the cylinders near the robot, for worlds of thousands.

Bullet visits every body at every step, at about 50 ns each, though the robot can touch only the nearest. In large worlds,
only cylinders within reach before the next update have bodies.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from antdrive.base.types import Floats
from antdrive.sim.physics.bodies import Bodies, size_of
from antdrive.worlds.world import Disc

HOLD = 2.0  # travel of the robot between two updates [m]


class NearBodies:
    """Bodies of the cylinders near the robot."""

    def __init__(
        self,
        obstacles: Sequence[Disc],
        reach: float,
        shape_of: Callable[[Disc], int],
        build: Callable[[list[int]], None],
        bodies: Bodies,
    ) -> None:
        self._obstacles, self._shape_of, self._build, self._bodies = obstacles, shape_of, build, bodies
        self._discs: Floats = np.array([(disc.x, disc.y, disc.radius) for disc in obstacles])
        self._reach = HOLD + reach
        self._centre = (math.inf, math.inf)

    def start(self, x: float, y: float) -> None:
        """Restart with the bodies around a position."""
        for index in self._held():
            self._bodies.park(index)
        self._centre = (math.inf, math.inf)
        self.follow(x, y)

    def follow(self, x: float, y: float) -> None:
        """Give bodies to all cylinders in reach of a position."""
        if math.hypot(x - self._centre[0], y - self._centre[1]) <= HOLD:
            return
        self._centre = (x, y)
        away = np.hypot(self._discs[:, 0] - x, self._discs[:, 1] - y) - self._discs[:, 2]
        for index in self._held():
            if away[index] > self._reach:
                self._bodies.park(index)
        fresh = [index for index in np.flatnonzero(away <= self._reach).tolist() if index not in self._bodies.held]
        for _, alike in itertools.groupby(fresh, lambda index: size_of(self._obstacles[index])):
            self._furnish(list(alike))

    def _furnish(self, indices: list[int]) -> None:
        """Give bodies to cylinders of one size: parked ones first, then new ones."""
        shape = self._shape_of(self._obstacles[indices[0]])
        for k, index in enumerate(indices):
            disc = self._obstacles[index]
            if not self._bodies.reuse(index, shape, (disc.x, disc.y, size_of(disc)[1] / 2)):
                self._build(indices[k:])
                return

    def _held(self) -> list[int]:
        """Return the cylinders with a body."""
        return [index for index in self._bodies.held if index < len(self._obstacles)]
