"""Bodies of the cylinders around the robot alone, for worlds of thousands of cylinders.

In every step Bullet looks at every body, at some 50 ns each, though the robot can touch only those next to it. Where a world
has many cylinders, only those have bodies that the robot can reach before it is looked at again. Bodies come and go as it drives.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from antdrive.base.types import Floats
from antdrive.sim.physics.bullet import bullet
from antdrive.worlds.world import Disc

HOLD = 2.0  # the robot goes this far before other cylinders get bodies [m]
BELOW = -1000.0  # where bodies wait that no cylinder needs [m]


class NearBodies:
    """The bodies around the robot."""

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
        self._spare: dict[tuple[float, float], list[int]] = {}  # bodies that stand for no cylinder, by size
        self._centre = (math.inf, math.inf)

    def start(self, x: float, y: float) -> None:
        """Make the bodies around a place, and no others, whatever was there before."""
        self._release(list(self._made))
        self._centre = (math.inf, math.inf)
        self.follow(x, y)

    def follow(self, x: float, y: float) -> None:
        """See to it that all cylinders in reach have bodies."""
        if math.hypot(x - self._centre[0], y - self._centre[1]) <= HOLD:
            return
        self._centre = (x, y)
        away = np.hypot(self._discs[:, 0] - x, self._discs[:, 1] - y) - self._discs[:, 2]
        self._release([index for index in self._made if away[index] > self._reach])
        fresh = [index for index in np.flatnonzero(away <= self._reach).tolist() if index not in self._made]
        for size, alike in itertools.groupby(fresh, self._size):
            self._furnish(size, list(alike))

    def _furnish(self, size: tuple[float, float], indices: list[int]) -> None:
        """Give bodies to cylinders of one size: spare ones while there are any, then new ones."""
        spare = self._spare.get(size, [])
        reused, built = indices[: len(spare)], indices[len(spare) :]
        for index in reused:
            disc, body = self._obstacles[index], spare.pop()
            self._move(body, (disc.x, disc.y, size[1] / 2))
            self._made[index], self._bodies[body] = body, index
        if built:
            self._made |= dict(zip(built, self._build(self._obstacles[built[0]], built), strict=True))

    def _release(self, indices: list[int]) -> None:
        """Take the bodies away from cylinders. They wait far below the floor: PyBullet's removal confuses body numbers."""
        for index in indices:
            body = self._made.pop(index)
            del self._bodies[body]
            self._spare.setdefault(self._size(index), []).append(body)
            self._move(body, (0.0, 0.0, BELOW))

    def _move(self, body: int, place: tuple[float, float, float]) -> None:
        bullet().resetBasePositionAndOrientation(body, place, (0, 0, 0, 1), physicsClientId=self._client)

    def _size(self, index: int) -> tuple[float, float]:
        return self._size_of(self._obstacles[index])
