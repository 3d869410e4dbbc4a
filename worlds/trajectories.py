"""Where movers are at any time. Chance is drawn once, from a run's seed; then all is a function of time, to the last bit.

Needs numpy alone, so that a log can be checked against it without compiler or physics.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from antdrive.worlds.errors import InputError
from antdrive.worlds.movers import Cruising, Keyframed, Mover, Wandering
from antdrive.worlds.world import Bounds, Floats, Point, World

ROOM = 1.0  # a wanderer without a start of its own begins at least this far from the robot's start, to its surface [m]
TRIES = 10_000
_NEIGHBOURS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], dtype=np.float64)  # x, y


class Motion(Protocol):
    """One mover as a function of time. Times (T,) are seconds from a run's start, >= 0 and increasing."""

    @property
    def radius(self) -> float:
        """Its radius [m]."""

    def at(self, t: Floats) -> Floats:
        """Where its centre is, (T, 2) [m]."""

    def velocities(self, t: Floats) -> Floats:
        """How it moves on from there, (T, 2) [m/s]."""

    def travelled(self, t: Floats) -> Floats:
        """A distance (T,) that grows at least as fast as it moves; jumps do not count [m]."""

    def jumped(self, t: Floats) -> npt.NDArray[np.int64]:
        """How often it has jumped so far, (T,)."""

    def jump_times(self, until: float) -> Floats:
        """When it jumps, up to a time (J,) [s]."""


@dataclass(frozen=True, eq=False)
class Trajectories:
    """All movers of a run as functions of time."""

    radii: Floats  # (M,) [m]
    heights: Floats  # (M,) [m]
    motions: tuple[Motion, ...]

    @classmethod
    def of(cls, world: World, start: Point, seed: int = 0) -> Trajectories:
        """The movers of a world in which a robot starts at a point; wanderers draw from the run's seed.

        Raises:
            InputError: a wanderer finds no free cell to begin in.
        """
        motions = tuple(_motion(mover, i, world, start, seed) for i, mover in enumerate(world.movers))
        radii, heights = (np.array([getattr(m, key) for m in world.movers]) for key in ("radius", "height"))
        return cls(radii, heights, motions)

    def __len__(self) -> int:
        return len(self.motions)

    def positions(self, t: npt.ArrayLike) -> Floats:
        """Centres at times (T,), shape (T, M, 2) [m]. The same time gives the same bits, whatever times stand beside it."""
        times = _times(t)
        return _stacked([motion.at(times) for motion in self.motions], (len(times), 0, 2))

    def velocities(self, t: npt.ArrayLike) -> Floats:
        """Velocities from times (T,) on, shape (T, M, 2) [m/s]."""
        times = _times(t)
        return _stacked([motion.velocities(times) for motion in self.motions], (len(times), 0, 2))

    def travel(self, t: npt.ArrayLike) -> Floats:
        """How far each mover gets at most between one time and the next, shape (T - 1, M) [m]; jumps do not count."""
        times = _times(t)
        return _stacked([np.diff(motion.travelled(times)) for motion in self.motions], (max(0, len(times) - 1), 0))

    def jumps(self, t: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether each mover jumps after one time and no later than the next, shape (T - 1, M)."""
        times = _times(t)
        rows = [np.diff(motion.jumped(times)) > 0 for motion in self.motions]
        return np.stack(rows, axis=1) if rows else np.zeros((max(0, len(times) - 1), 0), dtype=np.bool_)

    def teleports(self, until: float) -> tuple[Floats, ...]:
        """When each mover jumps up to a time, one array (J,) for each [s]."""
        return tuple(motion.jump_times(until) for motion in self.motions)


def _times(t: npt.ArrayLike) -> Floats:
    return np.atleast_1d(np.asarray(t, dtype=np.float64))


def _stacked(rows: list[Floats], empty: tuple[int, ...]) -> Floats:
    return np.stack(rows, axis=1) if rows else np.empty(empty)


def _motion(mover: Mover, index: int, world: World, start: Point, seed: int) -> Motion:
    if isinstance(mover, Keyframed):
        return _Track(mover)
    if isinstance(mover, Cruising):
        return _Bounce(mover, world.bounds)
    key = [seed, zlib.crc32(b"mover"), index] if mover.seed is None else [mover.seed]
    return _Walk(mover, world, np.random.default_rng(key), (index, start))


class _Track:
    """Along keyframes: in each segment a cubic in the share of its time that has passed."""

    def __init__(self, mover: Keyframed) -> None:
        frames = np.array(mover.keyframes, dtype=np.float64)
        self.radius = mover.radius
        self._loop = mover.loop
        self._late = mover.phase - frames[0, 0]
        self._knots = frames[:, 0] - frames[0, 0]
        self._span = float(self._knots[-1])
        self._lasts = np.diff(self._knots)
        xy = frames[:, 1:]
        step = np.diff(xy, axis=0)
        if mover.interpolation == "linear":
            self._terms = np.stack([xy[:-1], step, 0 * step, 0 * step])
        else:
            closed = bool((xy[0] == xy[-1]).all())
            ahead = xy[1] - xy[-2] if closed else xy[1] - xy[0]
            behind = ahead if closed else xy[-1] - xy[-2]
            tangent = np.vstack([ahead, xy[2:] - xy[:-2], behind]) / 2
            a, b = tangent[:-1], tangent[1:]
            self._terms = np.stack([xy[:-1], a, 3 * step - 2 * a - b, a + b - 2 * step])
        self._jumps = mover.loop == "teleport" and bool((xy[0] != xy[-1]).any())
        self._paced = np.concatenate(([0.0], np.cumsum(_longest(self._terms))))

    def at(self, t: Floats) -> Floats:
        at, _, _ = self._share(t)
        k, f = self._segment(at, "right")
        p, a, b, c = self._terms[:, k]
        return np.asarray(p + f * (a + f * (b + f * c)))

    def velocities(self, t: Floats) -> Floats:
        at, sense, _ = self._share(t)
        k, f = self._segment(at, "right")
        back = sense < 0
        k[back], f[back] = (part[back] for part in self._segment(at, "left"))
        _, a, b, c = self._terms[:, k]
        return np.asarray(sense[:, None] * (a + f * (2 * b + f * 3 * c)) / self._lasts[k, None])

    def travelled(self, t: Floats) -> Floats:
        at, sense, lap = self._share(t)
        along = np.interp(at, self._knots, self._paced)
        whole = self._paced[-1]
        return np.asarray(lap * whole + np.where(sense < 0, whole - along, along))

    def jumped(self, t: Floats) -> npt.NDArray[np.int64]:
        lap = self._share(t)[2]
        return lap if self._jumps else np.zeros_like(lap)

    def jump_times(self, until: float) -> Floats:
        if not self._jumps:
            return np.empty(0)
        first = max(1, math.floor(self._late / self._span) + 1)
        last = math.floor((until + self._late) / self._span)
        return np.asarray(np.arange(first, last + 1) * self._span - self._late)

    def _share(self, t: Floats) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
        """The time along the keyframes, the sense in which it runs (-1, 0, 1), and how many laps lie behind."""
        local = t + self._late
        started = local >= 0
        local = np.maximum(local, 0.0)
        if self._loop == "once":
            return np.minimum(local, self._span), (started & (local < self._span)) * 1.0, np.zeros(len(t), np.int64)
        lap = np.floor_divide(local, self._span)
        at = np.clip(local - lap * self._span, 0.0, self._span)
        back = (lap % 2 == 1) & (self._loop == "pingpong")
        at = np.where(back, self._span - at, at)
        return at, np.where(started, np.where(back, -1.0, 1.0), 0.0), lap.astype(np.int64)

    def _segment(self, at: Floats, side: str) -> tuple[npt.NDArray[np.int64], Floats]:
        found = np.searchsorted(self._knots, at, side="right" if side == "right" else "left") - 1
        k = np.clip(found, 0, len(self._lasts) - 1)
        return k, ((at - self._knots[k]) / self._lasts[k])[:, None]


def _longest(terms: Floats) -> Floats:
    """No cubic segment moves farther than this (K,) if the fastest it gets at all lasted for all of its time [m]."""
    _, a, b, c = terms
    ends = [np.abs(a), np.abs(a + 2 * b + 3 * c)]
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.clip(np.nan_to_num(-b / (3 * c), nan=0.0), 0.0, 1.0)  # where a component's speed is extreme
    most = np.maximum.reduce([*ends, np.abs(a + turn * (2 * b + turn * 3 * c))])
    return np.asarray(np.hypot(most[:, 0], most[:, 1]))


class _Bounce:
    """Straight on, reflected at the walls: each coordinate is a line folded into the room that the walls leave."""

    def __init__(self, mover: Cruising, bounds: Bounds) -> None:
        self.radius = mover.radius
        self._low = np.array(bounds[:2]) + mover.radius
        self._room = np.array(bounds[2:]) - mover.radius - self._low
        self._velocity = np.array(mover.velocity, dtype=np.float64)
        self._first = np.array(mover.position, dtype=np.float64) - self._low + mover.phase * self._velocity

    def at(self, t: Floats) -> Floats:
        at = self._unfolded(t)
        return np.asarray(self._low + np.where(at > self._room, 2 * self._room - at, at))

    def velocities(self, t: Floats) -> Floats:
        at = self._unfolded(t)
        # At the wall itself it already moves away from it.
        back = np.where(self._velocity < 0, (at > self._room) | (at == 0), at >= self._room)
        return np.asarray(np.where(back, -self._velocity, self._velocity))

    def travelled(self, t: Floats) -> Floats:
        return np.asarray(t * math.hypot(*self._velocity))

    def jumped(self, t: Floats) -> npt.NDArray[np.int64]:
        return np.zeros(len(t), dtype=np.int64)

    def jump_times(self, until: float) -> Floats:
        return np.empty(0)

    def _unfolded(self, t: Floats) -> Floats:
        """Along a line through the room and its mirror image behind the wall."""
        return np.asarray(np.mod(self._first + t[:, None] * self._velocity, 2 * self._room))


class _Walk:
    """From cell to cell. The way is drawn as far as it is asked for; asking for more never changes what was drawn."""

    def __init__(self, mover: Wandering, world: World, rng: np.random.Generator, place: tuple[int, Point]) -> None:
        self.radius = mover.radius
        self._mover, self._world, self._rng = mover, world, rng
        self._way = [self._home(*place)]

    @cached_property
    def _discs(self) -> Floats:
        return self._world.discs

    def at(self, t: Floats) -> Floats:
        here, there, share = self._steps(t)
        return np.asarray(here + share[:, None] * (there - here))

    def velocities(self, t: Floats) -> Floats:
        here, there, _ = self._steps(t)
        return np.asarray((there - here) / self._mover.period)

    def travelled(self, t: Floats) -> Floats:
        return np.asarray(t * (math.sqrt(2) * self._mover.cell / self._mover.period))

    def jumped(self, t: Floats) -> npt.NDArray[np.int64]:
        return np.zeros(len(t), dtype=np.int64)

    def jump_times(self, until: float) -> Floats:
        return np.empty(0)

    def _steps(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Where the step under way began, where it ends, and what share of it is done."""
        turns = (t + self._mover.phase) / self._mover.period
        step = np.floor(turns).astype(np.int64)
        while len(self._way) < (step.max(initial=0) + 2):
            self._way.append(self._next(self._way[-1]))
        way = np.array(self._way)
        return way[step], way[step + 1], turns - step

    def _next(self, here: Point) -> Point:
        cell = self._mover.cell
        x0, y0 = self._world.bounds[0] + cell / 2, self._world.bounds[1] + cell / 2
        # Counted in cells, so that rounding does not add up on the way.
        col, row = round((here[0] - x0) / cell), round((here[1] - y0) / cell)
        ends = np.array([x0, y0]) + (_NEIGHBOURS + (col, row)) * cell
        free = np.flatnonzero(_ways_free(self._discs, self._world.bounds, here, ends, self._mover.radius))
        if not len(free):
            return here
        x, y = ends[free[self._rng.integers(len(free))]]
        return float(x), float(y)

    def _home(self, index: int, robot: Point) -> Point:
        mover, world = self._mover, self._world
        if mover.start is not None:
            return home_cell(mover, world)
        cols, rows = (max(1, math.ceil(side / mover.cell - 1e-9)) for side in world.size)
        for _ in range(TRIES):
            col, row = self._rng.integers(cols), self._rng.integers(rows)
            x = float(world.bounds[0] + mover.cell / 2 + col * mover.cell)
            y = float(world.bounds[1] + mover.cell / 2 + row * mover.cell)
            away = math.dist((x, y), robot) - mover.radius >= ROOM
            if away and _ways_free(self._discs, world.bounds, (x, y), np.array([(x, y)]), mover.radius)[0]:
                return x, y
        raise InputError(
            f"movers[{index}].walk: found no free cell of {mover.cell:g} m, {ROOM:g} m from the robot's start, to begin in; "
            "give walk.start"
        )


def home_cell(mover: Wandering, world: World) -> Point:
    """The centre of the cell that holds a wanderer's own start.

    Raises:
        ValueError: the start is out of bounds, or a cylinder or wall is in the way there.
    """
    assert mover.start is not None
    (x, y), (xmin, ymin, xmax, ymax), cell = mover.start, world.bounds, mover.cell
    if not (xmin <= x <= xmax and ymin <= y <= ymax):
        raise ValueError(f"walk.start: ({x:g}, {y:g}) is out of bounds {list(world.bounds)}")
    cols, rows = (max(1, math.ceil(side / cell - 1e-9)) for side in world.size)
    col, row = min(math.floor((x - xmin) / cell), cols - 1), min(math.floor((y - ymin) / cell), rows - 1)
    home = (float(xmin + cell / 2 + col * cell), float(ymin + cell / 2 + row * cell))
    if not _ways_free(world.discs, world.bounds, home, np.array([home]), mover.radius)[0]:
        raise ValueError(
            f"walk.start: radius {mover.radius:g} has no room in the cell around ({home[0]:g}, {home[1]:g})"
        )
    return home


def _ways_free(discs: Floats, bounds: Bounds, here: Point, ends: Floats, radius: float) -> npt.NDArray[np.bool_]:
    """Whether a disc on its way from a point to each end (N, 2) touches nothing that stands."""
    walls = np.minimum(ends - np.array(bounds[:2]), np.array(bounds[2:]) - ends).min(axis=1)
    if not len(discs):
        return np.asarray(walls > radius)
    way = ends - np.array(here)
    length2 = np.maximum((way**2).sum(axis=1), 1e-300)
    to = discs[:, :2] - np.array(here)
    share = np.clip(way @ to.T / length2[:, None], 0.0, 1.0)
    gap = np.hypot(*np.moveaxis(to[None] - share[..., None] * way[:, None], -1, 0)) - discs[:, 2]
    return np.asarray((walls > radius) & (gap > radius).all(axis=1))
