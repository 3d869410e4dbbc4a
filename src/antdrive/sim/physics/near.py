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
from antdrive.sim.physics.bullet import BELOW, bullet
from antdrive.worlds.world import Disc

HOLD = 2.0  # travel of the robot between two updates [m]


class NearBodies:
    """Bodies of the cylinders near the robot."""

    def __init__(
        self,
        obstacles: Sequence[Disc],
        reach: float,
        size_of: Callable[[Disc], tuple[float, float]],
        build: Callable[[Disc, list[int]], list[int]],
        bodies: dict[int, int],
        number: int,
    ) -> None:
        self._obstacles, self._build, self._bodies, self._client = obstacles, build, bodies, number
        self._size_of = size_of
        self._discs: Floats = np.array([(disc.x, disc.y, disc.radius) for disc in obstacles])
        self._reach = HOLD + reach
        self._made: dict[int, int] = {}  # body number by cylinder
        self._spare: dict[tuple[float, float], list[int]] = {}  # unused bodies, by size
        self._centre = (math.inf, math.inf)

    def start(self, x: float, y: float) -> None:
        """Restart with the bodies around a position."""
        self._release(list(self._made))
        self._centre = (math.inf, math.inf)
        self.follow(x, y)

    def follow(self, x: float, y: float) -> None:
        """Give bodies to all cylinders in reach of a position."""
        if math.hypot(x - self._centre[0], y - self._centre[1]) <= HOLD:
            return
        self._centre = (x, y)
        away = np.hypot(self._discs[:, 0] - x, self._discs[:, 1] - y) - self._discs[:, 2]
        self._release([index for index in self._made if away[index] > self._reach])
        fresh = [index for index in np.flatnonzero(away <= self._reach).tolist() if index not in self._made]
        for size, alike in itertools.groupby(fresh, self._size):
            self._furnish(size, list(alike))

    def _furnish(self, size: tuple[float, float], indices: list[int]) -> None:
        """Give bodies to cylinders of one size: unused ones first, then new ones."""
        spare = self._spare.get(size, [])
        reused, built = indices[: len(spare)], indices[len(spare) :]
        for index in reused:
            disc, body = self._obstacles[index], spare.pop()
            self._move(body, (disc.x, disc.y, size[1] / 2))
            self._made[index], self._bodies[body] = body, index
        if built:
            self._made |= dict(zip(built, self._build(self._obstacles[built[0]], built), strict=True))

    def _release(self, indices: list[int]) -> None:
        """Move the bodies of cylinders far below the floor; PyBullet's removal would confuse body numbers."""
        for index in indices:
            body = self._made.pop(index)
            del self._bodies[body]
            self._spare.setdefault(self._size(index), []).append(body)
            self._move(body, (0.0, 0.0, BELOW))

    def _move(self, body: int, place: tuple[float, float, float]) -> None:
        bullet().resetBasePositionAndOrientation(body, place, (0, 0, 0, 1), physicsClientId=self._client)

    def _size(self, index: int) -> tuple[float, float]:
        return self._size_of(self._obstacles[index])
