"""What a robot drives in: upright cylinders between walls, a start and a goal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Pose: TypeAlias = tuple[float, float, float]  # x [m], y [m], yaw [rad, counter-clockwise from +x]
Point: TypeAlias = tuple[float, float]  # x [m], y [m]
Bounds: TypeAlias = tuple[float, float, float, float]  # xmin, ymin, xmax, ymax [m]


@dataclass(frozen=True)
class Disc:
    """An upright cylinder, seen from above. The radius is as built, never inflated."""

    x: float  # [m]
    y: float  # [m]
    radius: float  # [m], > 0
    height: float = 1.0  # [m], > 0

    def __post_init__(self) -> None:
        for key in ("x", "y", "radius", "height"):
            _require_finite(key, getattr(self, key))
        for key in ("radius", "height"):
            if getattr(self, key) <= 0:
                raise ValueError(f"{key}: must be greater than 0, got {getattr(self, key):g}")


@dataclass(frozen=True)
class World:
    """Cylinders inside four solid walls.

    Raises:
        ValueError: bounds that enclose nothing or are not finite.
    """

    name: str
    bounds: Bounds  # the walls' inner faces [m]
    obstacles: tuple[Disc, ...] = ()
    source: str | None = None  # where it comes from, free text

    def __post_init__(self) -> None:
        for value in self.bounds:
            _require_finite("bounds", value)
        xmin, ymin, xmax, ymax = self.bounds
        if not (xmin < xmax and ymin < ymax):
            raise ValueError(f"bounds: must be [xmin, ymin, xmax, ymax] with min < max, got {list(self.bounds)}")

    @property
    def discs(self) -> Floats:
        """The obstacles as an array (N, 3): x, y, radius [m]."""
        return np.array([(d.x, d.y, d.radius) for d in self.obstacles], dtype=np.float64).reshape(-1, 3)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height between the walls [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        return xmax - xmin, ymax - ymin


@dataclass(frozen=True)
class Task:
    """A world with a start pose and a goal to reach.

    Raises:
        ValueError: the start or the goal is out of bounds or inside an obstacle, or a size is not positive.
    """

    world: World
    start: Pose
    goal: Point
    goal_tolerance: float = 0.25  # the robot must stop this close to the goal [m]
    cell: float = 0.5  # the grid resolution planners use unless told otherwise [m]

    def __post_init__(self) -> None:
        for key, values in (("start", self.start), ("goal", self.goal)):
            for value in values:
                _require_finite(key, value)
        for key in ("goal_tolerance", "cell"):
            _require_finite(key, getattr(self, key))
            if getattr(self, key) <= 0:
                raise ValueError(f"{key}: must be greater than 0, got {getattr(self, key):g}")
        for key, (x, y) in (("start", self.start[:2]), ("goal", self.goal)):
            self._require_free(key, x, y)
        if self.goal == self.start[:2]:
            raise ValueError("goal: is where the robot starts; give it somewhere to go")

    def _require_free(self, key: str, x: float, y: float) -> None:
        xmin, ymin, xmax, ymax = self.world.bounds
        if not (xmin <= x <= xmax and ymin <= y <= ymax):
            raise ValueError(f"{key}: ({x:g}, {y:g}) is out of bounds {list(self.world.bounds)}")
        for i, disc in enumerate(self.world.obstacles):
            if math.hypot(x - disc.x, y - disc.y) <= disc.radius:
                raise ValueError(
                    f"{key}: ({x:g}, {y:g}) is inside obstacles[{i}] "
                    f"at ({disc.x:g}, {disc.y:g}) with radius {disc.radius:g}"
                )


def _require_finite(key: str, value: float) -> None:
    if not math.isfinite(value):
        raise ValueError(f"{key}: must be a finite number, got {value}")
