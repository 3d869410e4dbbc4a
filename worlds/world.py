"""What a robot drives in: upright cylinders between walls, a start and a goal."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.worlds.movers import Cruising, Mover, Wandering, later

Floats: TypeAlias = npt.NDArray[np.float64]
Pose: TypeAlias = tuple[float, float, float]  # x [m], y [m], yaw [rad, counter-clockwise from +x]
Point: TypeAlias = tuple[float, float]  # x [m], y [m]
Bounds: TypeAlias = tuple[float, float, float, float]  # xmin, ymin, xmax, ymax [m]

MAX_WALK_CELLS = 25_000_000  # as for grids


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
    """Cylinders inside four solid walls; some of them may move.

    Raises:
        ValueError: bounds that enclose nothing or are not finite, or a mover that has no room where it begins.
    """

    name: str
    bounds: Bounds  # the walls' inner faces [m]
    obstacles: tuple[Disc, ...] = ()
    source: str | None = None  # where it comes from, free text
    movers: tuple[Mover, ...] = ()  # see `Trajectories` for where they are

    def __post_init__(self) -> None:
        for value in self.bounds:
            _require_finite("bounds", value)
        xmin, ymin, xmax, ymax = self.bounds
        if not (xmin < xmax and ymin < ymax):
            raise ValueError(f"bounds: must be [xmin, ymin, xmax, ymax] with min < max, got {list(self.bounds)}")
        for i, mover in enumerate(self.movers):
            self._require_room(f"movers[{i}].", mover)

    def later(self, seconds: float) -> World:
        """The same world with `seconds` more of every mover's motion passed when a run starts."""
        return dataclasses.replace(self, movers=tuple(later(mover, seconds) for mover in self.movers))

    def _require_room(self, key: str, mover: Mover) -> None:
        if isinstance(mover, Cruising):
            xmin, ymin, xmax, ymax = self.bounds
            (x, y), r = mover.position, mover.radius
            if not (2 * r < min(self.size) and xmin + r <= x <= xmax - r and ymin + r <= y <= ymax - r):
                raise ValueError(
                    f"{key}position: ({x:g}, {y:g}) leaves no room for radius {r:g} within bounds {list(self.bounds)}"
                )
        if isinstance(mover, Wandering):
            from antdrive.worlds.trajectories import home_cell

            columns, rows = (side / mover.cell for side in self.size)
            if columns * rows > MAX_WALK_CELLS:
                raise ValueError(
                    f"{key}walk.cell: {mover.cell:g} m cuts this world into more than {MAX_WALK_CELLS} cells"
                )
            if mover.start is not None:
                try:
                    home_cell(mover, self)
                except ValueError as error:
                    raise ValueError(f"{key}{error}") from None

    @property
    def discs(self) -> Floats:
        """The obstacles as an array (N, 3): x, y, radius [m]."""
        return np.array([(d.x, d.y, d.radius) for d in self.obstacles], dtype=np.float64).reshape(-1, 3)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height between the walls [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        return xmax - xmin, ymax - ymin

    def _repr_html_(self) -> str:
        from antdrive.worlds.drawing import card, world_svg

        facts = {"obstacles": len(self.obstacles), "size": "{:g} × {:g} m".format(*self.size)}
        return card(world_svg(self), self.name, facts)


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
    time_limit: float | None = None  # simulated time allowed unless told otherwise [s]; None: ample for the route

    def __post_init__(self) -> None:
        for key, values in (("start", self.start), ("goal", self.goal)):
            for value in values:
                _require_finite(key, value)
        for key in ("goal_tolerance", "cell", "time_limit"):
            value = getattr(self, key)
            if value is not None:
                _require_finite(key, value)
                if value <= 0:
                    raise ValueError(f"{key}: must be greater than 0, got {value:g}")
        for key, (x, y) in (("start", self.start[:2]), ("goal", self.goal)):
            self._require_free(key, x, y)
        if self.goal == self.start[:2]:
            raise ValueError("goal: is where the robot starts; give it somewhere to go")
        self._require_no_mover()

    def _require_no_mover(self) -> None:
        if not self.world.movers:
            return
        from antdrive.worlds.trajectories import Trajectories

        x, y = self.start[:2]
        traffic = Trajectories.of(self.world, (x, y))
        for i, ((mx, my), radius) in enumerate(zip(traffic.positions(0.0)[0], traffic.radii, strict=True)):
            if math.hypot(x - mx, y - my) <= radius:
                raise ValueError(
                    f"start: ({x:g}, {y:g}) is inside movers[{i}], which begins at ({mx:g}, {my:g}) with radius {radius:g}"
                )

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

    def _repr_html_(self) -> str:
        from antdrive.worlds.drawing import task_card

        return task_card(self)


def _require_finite(key: str, value: float) -> None:
    if not math.isfinite(value):
        raise ValueError(f"{key}: must be a finite number, got {value}")
