"""Worlds of a few cylinders as points of a unit cube, for searches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import FieldError
from antdrive.planners.anyangle.tangent import shortest
from antdrive.worlds import Disc, Task, World

# The arena, in radii of the robot. Cylinders are centred between start and goal, at any distance from the side walls.
LENGTH, WIDTH = 24.0, 12.0
END = 2.5  # from the start and the goal to the walls behind them
FREE = 5.5  # from the end walls to the centre of any cylinder
RADII = (0.3, 1.5)
CELL = 0.75


@dataclass(frozen=True)
class WorldSpace:
    """All worlds of so many cylinders in a rectangle that is crossed along its middle; its size is that of the robot.

    A point of the space holds x, y and radius of each cylinder, each from 0 to 1. Lengths are in whole millimetres, or in
    hundredths of the robot's radius where the robot is small.

    Attributes:
        count: number of cylinders
        robot_radius: radius of the robot, which all lengths are multiples of [m]

    Raises:
        FieldError: no cylinder, or a radius that is not positive.
    """

    count: int
    robot_radius: float

    def __post_init__(self) -> None:
        if not 1 <= self.count <= 50:
            raise FieldError("count", f"must be from 1 to 50, got {self.count}")
        if not self.robot_radius > 0:
            raise FieldError("robot_radius", f"must be greater than 0, got {self.robot_radius:g}")

    @property
    def dimensions(self) -> int:
        """The number of coordinates of a point."""
        return 3 * self.count

    def task(self, point: Floats, name: str) -> Task:
        """The world of a point (D,), with start and goal."""
        r = self.robot_radius
        length, width = self._metres(LENGTH * r), self._metres(WIDTH * r)
        low, high = self._range
        values = low + np.asarray(point, dtype=np.float64).reshape(self.count, 3) * (high - low)
        discs = tuple(Disc(self._metres(x), self._metres(y), self._metres(size)) for x, y, size in values.tolist())
        middle = self._metres(width / 2)
        return Task(
            World(name, (0.0, 0.0, length, width), discs, "found by antdrive falsify"),
            (self._metres(END * r), middle, 0.0),
            (self._metres(length - END * r), middle),
            goal_tolerance=self._metres(0.75 * r),
            cell=float(f"{CELL * r:.2g}"),
        )

    @property
    def _range(self) -> tuple[Floats, Floats]:
        """The least and the largest x, y and radius of a cylinder [m]."""
        r = self.robot_radius
        low = np.array([FREE * r, 0.0, RADII[0] * r])
        return low, np.array([(LENGTH - FREE) * r, WIDTH * r, RADII[1] * r])

    def _metres(self, value: float) -> float:
        return round(value, 3 if self.robot_radius >= 0.1 else 5)


def feasible(task: Task, clearance: float) -> bool:
    """Whether a path exists from start to goal that keeps a clearance [m], by the exact shortest path."""
    world = task.world
    return shortest(world.discs, world.bounds, clearance, task.start[:2], task.goal) is not None
