"""Worlds (upright cylinders between walls) and tasks (a world with start and goal)."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from antdrive.base.caches import Keyed, bits
from antdrive.base.errors import FieldError, require
from antdrive.base.plane import format_disc, format_number, format_numbers, format_point
from antdrive.base.records import unchecked_copy
from antdrive.base.types import Bounds, Floats, Point, Pose
from antdrive.worlds.limits import MAX_CELLS, MAX_WALK, Coordinate, Size
from antdrive.worlds.motions import Motion, first_cell, is_within, motion_of, path_ahead, require_few_draws
from antdrive.worlds.movers import Cruising, Mover, Wandering, later
from antdrive.worlds.svg import card, world_svg

WALLS = ("the left wall", "the lower wall", "the right wall", "the upper wall")
DRAWN_TIME = 20.0  # length of movers' paths in notebooks [s]


@dataclass(frozen=True)
class Disc:
    """An upright cylinder.

    Attributes:
        x: the centre's x [m]
        y: the centre's y [m]
        radius: true radius, never inflated [m]
        height: the height [m]

    Raises:
        FieldError: a value is not finite, or a size is not positive.
    """

    x: Coordinate
    y: Coordinate
    radius: Size
    height: Size = 1.0

    def __post_init__(self) -> None:
        if (
            math.isfinite(self.x)
            and math.isfinite(self.y)
            and 0 < self.radius < math.inf
            and 0 < self.height < math.inf
        ):
            return
        for key in ("x", "y", "radius", "height"):
            require(key, getattr(self, key))
        for key in ("radius", "height"):
            require(key, getattr(self, key), above=0)


@dataclass(frozen=True)
class World:
    """Static and moving cylinders inside four solid walls.

    Attributes:
        name: the world's name
        bounds: the walls' inner faces: xmin, ymin, xmax, ymax [m]
        obstacles: the static cylinders
        source: origin of the world, free text
        movers: the moving cylinders; `Trajectories` computes their positions

    Raises:
        FieldError: bounds are empty or not finite, a mover has no room at its start, or wanderers have too many steps
            before the start.
    """

    name: str
    bounds: Bounds
    obstacles: tuple[Disc, ...] = ()
    source: str | None = None
    movers: tuple[Mover, ...] = ()

    def __post_init__(self) -> None:
        for value in self.bounds:
            require("bounds", value)
        xmin, ymin, xmax, ymax = self.bounds
        if not (xmin < xmax and ymin < ymax):
            raise FieldError(
                "bounds", f"must be [xmin, ymin, xmax, ymax] with min < max, got {format_numbers(self.bounds)}"
            )
        for i, mover in enumerate(self.movers):
            try:
                self._require_room(mover)
            except FieldError as error:
                raise error.under(f"movers[{i}]") from None
        self._require_short_walks()

    def later(self, seconds: float) -> World:
        """Return the world with all movers' phases advanced by some `seconds`."""
        return dataclasses.replace(self, movers=tuple(later(mover, seconds) for mover in self.movers))

    def _require_room(self, mover: Mover) -> None:
        if isinstance(mover, Cruising):
            (x, y), r = mover.position, mover.radius
            if not (2 * r < min(self.size) and is_within(self.bounds, x, y, r)):
                room = f"radius {format_number(r)} within bounds {format_numbers(self.bounds)}"
                raise FieldError("position", f"{format_point((x, y))} leaves no room for {room}")
        if isinstance(mover, Wandering):
            columns, rows = (side / mover.cell for side in self.size)
            if columns * rows > MAX_CELLS:
                raise FieldError("walk.cell", f"{mover.cell:g} m cuts this world into more than {MAX_CELLS} cells")
            if mover.start is not None:
                first_cell(mover, self.bounds, self.discs)

    def _require_short_walks(self) -> None:
        """Raise FieldError if wanderers have too many steps before the start: each one is sampled."""
        steps = {i: math.floor(m.phase / m.period) for i, m in enumerate(self.movers) if isinstance(m, Wandering)}
        if not steps:
            return
        most = MAX_WALK // (200 + len(self.obstacles))
        if sum(steps.values()) > most:
            i = max(steps, key=lambda i: steps[i])
            raise FieldError(
                f"movers[{i}].phase",
                f"{self.movers[i].phase:g} s are {steps[i]} steps before the start; the limit for all wanderers of this "
                f"world is {most:.0f}; lower phase, or give another walk.seed",
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
        """Return the path over the next 20 s (N, 2) [m] and the radius [m] of each mover, for drawing.

        The robot starts at `start` [m]. Without the run's seed, wanderers that depend on it are omitted.
        """
        paths = []
        for i, mover in enumerate(self.movers):
            if isinstance(mover, Wandering) and seed is None and (mover.seed is None or mover.start is None):
                continue
            motion = motion_of(mover, i, self.bounds, self.discs, start or (math.inf, math.inf), seed or 0)
            paths.append((path_ahead(motion, DRAWN_TIME), mover.radius))
        return paths


class PointWorld(World):
    """A world of measured points, which creates its `Disc` records on first use."""

    @classmethod
    def of(cls, name: str, bounds: Bounds, discs: Floats) -> PointWorld:
        """Return the world of the given cylinders (N, 3): x, y, radius [m]."""
        if not (np.isfinite(discs).all() and (discs[:, 2] > 0).all()):
            row = np.flatnonzero(~(np.isfinite(discs).all(axis=1) & (discs[:, 2] > 0)))[0]
            Disc(*discs[row].tolist())
        world = cls(name, bounds)
        del world.__dict__["obstacles"]
        world.__dict__["_discs"] = discs
        return world

    def among(self, bounds: Bounds, discs: Floats) -> PointWorld:
        """Return the world of other cylinders (N, 3) between other walls, unchecked: they are made of checked ones."""
        made = unchecked_copy(self, bounds=bounds, _discs=discs)
        del vars(made)["obstacles"]
        return made

    @functools.cached_property
    def obstacles(self) -> tuple[Disc, ...]:
        """The cylinders as records."""
        return tuple(Disc(x, y, radius) for x, y, radius in self._discs.tolist())


@dataclass(frozen=True)
class Task:
    """A world with a start pose and a goal: the content of a world file.

    Attributes:
        world: the world to drive in
        start: the robot's start pose: x, y [m] and yaw [rad, counter-clockwise from +x]
        goal: target position of the robot's centre: x, y [m]
        goal_tolerance: largest distance from the goal at the stop [m]
        cell: default grid resolution for planners [m]
        time_limit: default limit of simulated time [s]; None: computed from the route
        frame: pose of the world's frame in its source map, for exports: x, y [m] and yaw [rad]

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
                require(key, value)
        for key in ("goal_tolerance", "cell", "time_limit"):
            value = getattr(self, key)
            if value is not None:
                require(key, value)
                require(key, value, above=0)
        for key, (x, y) in (("start", self.start[:2]), ("goal", self.goal)):
            self._require_free(key, x, y)
        if self.goal == self.start[:2]:
            raise FieldError("goal", "equals the start; choose another position")
        self._require_start_clear_of_movers()

    def _require_free(self, key: str, x: float, y: float) -> None:
        if not is_within(self.world.bounds, x, y):
            raise FieldError(key, f"{format_point((x, y))} is out of bounds {format_numbers(self.world.bounds)}")
        discs = self.world._discs
        near = (np.abs(x - discs[:, 0]) <= discs[:, 2]) & (np.abs(y - discs[:, 1]) <= discs[:, 2])
        for i in np.flatnonzero(near).tolist():
            disc = self.world.obstacles[i]
            if math.hypot(x - disc.x, y - disc.y) <= disc.radius:
                where = f"obstacles[{i}] {format_disc(disc.x, disc.y, disc.radius)}"
                raise FieldError(key, f"{format_point((x, y))} is inside {where}")

    def _require_start_clear_of_movers(self) -> None:
        """Raise FieldError for a start inside a mover, or a wanderer without a free first cell."""
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
            mx, my = motion.at(np.zeros(1))[0].tolist()
            if math.hypot(x - mx, y - my) <= motion.radius:
                where = f"movers[{i}], which starts {format_disc(mx, my, motion.radius)}"
                raise FieldError("start", f"{format_point((x, y))} is inside {where}")

    def as_dict(self) -> dict[str, Any]:
        """Return the task as plain values, with the numbers of the world's obstacles and movers."""
        return {
            "name": self.world.name,
            "source": self.world.source,
            "bounds": list(self.world.bounds),
            "start": list(self.start),
            "goal": list(self.goal),
            "goal_tolerance": self.goal_tolerance,
            "cell": self.cell,
            **({"frame": list(self.frame)} if any(self.frame) else {}),
            "obstacles": len(self.world.obstacles),
            "movers": len(self.world.movers),
        }

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
    """Return the world keyed by the bits of its walls and static cylinders; heights do not count."""
    return Keyed(world, (bits(*world.bounds), world.discs.tobytes()))


def obstacle_name(world: World, index: int, unseen: int = 0) -> str:
    """Return the name of an obstacle or a wall for messages."""
    count = len(world.obstacles)
    if index >= count:
        return WALLS[index - count]
    disc, known = world.obstacles[index], count - unseen
    key = f"obstacles[{index}]" if index < known else f"unseen[{index - known}]"
    return f"{key} {format_disc(disc.x, disc.y, disc.radius)}"
