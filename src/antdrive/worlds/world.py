"""What a robot drives in: upright cylinders between walls, a start and a goal."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np

from antdrive.base.caches import Keyed, bits
from antdrive.base.errors import FieldError, require_finite, require_positive
from antdrive.base.types import Bounds, Floats, Point, Pose
from antdrive.worlds.limits import MAX_CELLS, MAX_WALK, Coordinate, Size
from antdrive.worlds.motions import Motion, first_cell, motion_of, path_ahead, require_few_draws
from antdrive.worlds.movers import Cruising, Mover, Wandering, later
from antdrive.worlds.svg import card, world_svg

DRAWN_TIME = 20.0  # how far ahead notebooks show the ways of movers [s]


@dataclass(frozen=True)
class Disc:
    """An upright cylinder, seen from above.

    Attributes:
        x: the centre's x [m]
        y: the centre's y [m]
        radius: the radius as built, never inflated [m]
        height: the height [m]

    Raises:
        FieldError: a value is not finite, or a size is not positive.
    """

    x: Coordinate
    y: Coordinate
    radius: Size
    height: Size = 1.0

    def __post_init__(self) -> None:
        for key in ("x", "y", "radius", "height"):
            require_finite(key, getattr(self, key))
        for key in ("radius", "height"):
            require_positive(key, getattr(self, key))


@dataclass(frozen=True)
class World:
    """Cylinders inside four solid walls; some of them may move.

    Attributes:
        name: what people call the world
        bounds: the walls' inner faces: xmin, ymin, xmax, ymax [m]
        obstacles: the cylinders that never move
        source: where the world comes from, free text
        movers: the cylinders that move; `Trajectories` computes where they are

    Raises:
        FieldError: bounds that enclose nothing or are not finite, a mover without room where it begins, or wanderers
            with more steps behind them than can be drawn at once.
    """

    name: str
    bounds: Bounds
    obstacles: tuple[Disc, ...] = ()
    source: str | None = None
    movers: tuple[Mover, ...] = ()

    def __post_init__(self) -> None:
        for value in self.bounds:
            require_finite("bounds", value)
        xmin, ymin, xmax, ymax = self.bounds
        if not (xmin < xmax and ymin < ymax):
            raise FieldError("bounds", f"must be [xmin, ymin, xmax, ymax] with min < max, got {list(self.bounds)}")
        for i, mover in enumerate(self.movers):
            try:
                self._require_room(mover)
            except FieldError as error:
                raise error.under(f"movers[{i}]") from None
        self._require_short_walks()

    def later(self, seconds: float) -> World:
        """The same world, with every mover further into its motion when a run starts.

        Args:
            seconds: how much further [s]
        """
        return dataclasses.replace(self, movers=tuple(later(mover, seconds) for mover in self.movers))

    def _require_room(self, mover: Mover) -> None:
        if isinstance(mover, Cruising):
            xmin, ymin, xmax, ymax = self.bounds
            (x, y), r = mover.position, mover.radius
            if not (2 * r < min(self.size) and xmin + r <= x <= xmax - r and ymin + r <= y <= ymax - r):
                raise FieldError(
                    "position", f"({x:g}, {y:g}) leaves no room for radius {r:g} within bounds {list(self.bounds)}"
                )
        if isinstance(mover, Wandering):
            columns, rows = (side / mover.cell for side in self.size)
            if columns * rows > MAX_CELLS:
                raise FieldError("walk.cell", f"{mover.cell:g} m cuts this world into more than {MAX_CELLS} cells")
            if mover.start is not None:
                first_cell(mover, self.bounds, self.discs)

    def _require_short_walks(self) -> None:
        """Refuse phases of wanderers that are too many steps: they are drawn one by one before a run starts."""
        steps = {i: math.floor(m.phase / m.period) for i, m in enumerate(self.movers) if isinstance(m, Wandering)}
        if not steps:
            return
        most = MAX_WALK // (200 + len(self.obstacles))
        if sum(steps.values()) > most:
            i = max(steps, key=lambda i: steps[i])
            raise FieldError(
                f"movers[{i}].phase",
                f"{self.movers[i].phase:g} s are {steps[i]} steps before the start; the wanderers of this world may "
                f"have {most:.0f} together; lower phase, or give another walk.seed",
            )

    @property
    def discs(self) -> Floats:
        """The obstacles as a new array (N, 3): x, y, radius [m]."""
        return self._discs.copy()

    @functools.cached_property
    def _discs(self) -> Floats:
        return np.array([(d.x, d.y, d.radius) for d in self.obstacles], dtype=np.float64).reshape(-1, 3)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height between the walls [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        return xmax - xmin, ymax - ymin

    def _repr_html_(self) -> str:
        facts = {"obstacles": len(self.obstacles), "size": "{:g} × {:g} m".format(*self.size)}
        facts |= {"movers": len(self.movers)} if self.movers else {}
        return card(world_svg(self.bounds, self.discs, movers=self.mover_paths()), self.name, facts)

    def mover_paths(self, start: Point | None = None, seed: int | None = None) -> list[tuple[Floats, float]]:
        """The way (N, 2) [m] and the radius [m] of each mover over the next 20 s, to draw.

        Args:
            start: the robot's start [m]
            seed: the run's random seed; None: wanderers whose way depends on it are left out
        """
        paths = []
        for i, mover in enumerate(self.movers):
            if isinstance(mover, Wandering) and seed is None and (mover.seed is None or mover.start is None):
                continue
            motion = motion_of(mover, i, self.bounds, self.discs, start or (math.inf, math.inf), seed or 0)
            paths.append((path_ahead(motion, DRAWN_TIME), mover.radius))
        return paths


class PointWorld(World):
    """A world that was measured, as numbers: its `Disc` records are made when somebody asks for them, which planners do not."""

    @classmethod
    def of(cls, name: str, bounds: Bounds, discs: Floats) -> PointWorld:
        """The world of so many cylinders."""
        if not (np.isfinite(discs).all() and (discs[:, 2] > 0).all()):
            row = np.flatnonzero(~(np.isfinite(discs).all(axis=1) & (discs[:, 2] > 0)))[0]
            Disc(*discs[row].tolist())
        world = cls(name, bounds)
        del world.__dict__["obstacles"]
        world.__dict__["_discs"] = discs
        return world

    @functools.cached_property
    def obstacles(self) -> tuple[Disc, ...]:
        """The cylinders, one by one."""
        return tuple(Disc(x, y, radius) for x, y, radius in self._discs.tolist())


@dataclass(frozen=True)
class Task:
    """A world with a start pose and a goal to reach: what a world file holds.

    Attributes:
        world: where the robot drives
        start: the robot's first pose: x, y [m] and yaw [rad, counter-clockwise from +x]
        goal: where the robot's centre must stop: x, y [m]
        goal_tolerance: how close to the goal the robot must stop [m]
        cell: the grid resolution that planners use unless another is given [m]
        time_limit: simulated time allowed unless another limit is given [s]; None: ample for the route
        frame: how the world lies in the map that it was made from, for exports: x, y [m] and yaw [rad] of its frame there

    Raises:
        FieldError: the start or the goal is out of bounds or inside a cylinder, or a size is not positive.
    """

    world: World
    start: Pose
    goal: Point
    goal_tolerance: float = 0.25
    cell: float = 0.5
    time_limit: float | None = None
    frame: Pose = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for key, values in (("start", self.start), ("goal", self.goal), ("frame", self.frame)):
            for value in values:
                require_finite(key, value)
        for key in ("goal_tolerance", "cell", "time_limit"):
            value = getattr(self, key)
            if value is not None:
                require_finite(key, value)
                require_positive(key, value)
        for key, (x, y) in (("start", self.start[:2]), ("goal", self.goal)):
            self._require_free(key, x, y)
        if self.goal == self.start[:2]:
            raise FieldError("goal", "is where the robot starts; choose another place")
        self._require_start_clear_of_movers()

    def _require_free(self, key: str, x: float, y: float) -> None:
        xmin, ymin, xmax, ymax = self.world.bounds
        if not (xmin <= x <= xmax and ymin <= y <= ymax):
            raise FieldError(key, f"({x:g}, {y:g}) is out of bounds {list(self.world.bounds)}")
        discs = self.world.discs
        near = (np.abs(x - discs[:, 0]) <= discs[:, 2]) & (np.abs(y - discs[:, 1]) <= discs[:, 2])
        for i in np.flatnonzero(near).tolist():
            disc = self.world.obstacles[i]
            if math.hypot(x - disc.x, y - disc.y) <= disc.radius:
                raise FieldError(
                    key,
                    f"({x:g}, {y:g}) is inside obstacles[{i}] at ({disc.x:g}, {disc.y:g}) with radius {disc.radius:g}",
                )

    def _require_start_clear_of_movers(self) -> None:
        """Refuse a start inside a mover, and a wanderer without a free first cell."""
        x, y = self.start[:2]
        discs = self.world.discs if self.world.movers else np.empty((0, 3))
        motions: list[Motion] = []
        for i, mover in enumerate(self.world.movers):
            try:
                motion = motion_of(mover, i, self.world.bounds, discs, (x, y), seed=0)
                motions.append(motion)
                require_few_draws(motions)
            except FieldError as error:
                raise error.under(f"movers[{i}]") from None
            mx, my = motion.at(np.zeros(1))[0]
            if math.hypot(x - mx, y - my) <= motion.radius:
                raise FieldError(
                    "start",
                    f"({x:g}, {y:g}) is inside movers[{i}], which begins at ({mx:g}, {my:g}) "
                    f"with radius {motion.radius:g}",
                )

    def _repr_html_(self) -> str:
        world = self.world
        goal = (*self.goal, self.goal_tolerance)
        facts = {
            "obstacles": len(world.obstacles),
            "size": "{:g} × {:g} m".format(*world.size),
            "start": "{:g}, {:g}".format(*self.start[:2]),
            "goal": "{:g}, {:g}".format(*self.goal),
        }
        facts |= {"movers": len(world.movers)} if world.movers else {}
        movers = world.mover_paths()
        return card(world_svg(world.bounds, world.discs, start=self.start, goal=goal, movers=movers), world.name, facts)


def by_geometry(world: World) -> Keyed[World]:
    """The world, equal to all worlds whose walls and standing cylinders have the same bits, seen from above."""
    return Keyed(world, (bits(*world.bounds), world.discs.tobytes()))
