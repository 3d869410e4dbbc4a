"""Motions of movers as functions of time.

Random steps are drawn once, from the run's seed. The result for a time is bit-identical, regardless of the other times
requested.
"""

from __future__ import annotations

import math
import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.plane import format_numbers, format_point
from antdrive.base.types import Bounds, Floats, Point
from antdrive.worlds.limits import MAX_DRAWS
from antdrive.worlds.movers import Cruising, Keyframed, Mover, Wandering

CLEAR_OF_ROBOT = 1.0  # minimum distance from a wanderer's surface in its random first cell to the robot's start [m]
ROUNDING = 1e-9  # positions beyond the bounds by no more are within them [m]
TRIES = 10_000  # draws of a wanderer's first cell
PATH_POINTS = 120  # points of a drawn path
_NEIGHBOURS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], dtype=np.float64)  # x, y


@runtime_checkable
class MoverMotion(Protocol):
    """A disc with known motion, as space-time planners use it."""

    @property
    def radius(self) -> float:
        """The disc's radius [m]."""
        ...

    def at(self, t: Floats) -> Floats:
        """Return the disc's centres.

        Args:
            t: times (T,) from a run's start on, increasing [s]

        Returns:
            Centres (T, 2) [m].
        """
        ...


class Motion(ABC):
    """The motion of a world's mover: a `MoverMotion` with velocities and jumps.

    All times (T,) are seconds since a run's start, >= 0 and increasing.
    """

    radius: float  # the mover's radius [m]
    draws: int = 0  # number of random draws for a wanderer's first cell

    @abstractmethod
    def at(self, t: Floats) -> Floats:
        """Return the mover's centres, (T, 2) [m]."""

    @abstractmethod
    def velocities(self, t: Floats) -> Floats:
        """Return velocities, right-continuous in time, (T, 2) [m/s]."""

    @abstractmethod
    def travelled(self, t: Floats) -> Floats:
        """Return an upper bound on the distance travelled at each time, without jumps, (T,) [m]."""

    def jumped(self, t: Floats) -> npt.NDArray[np.int64]:
        """Return the number of jumps up to each time, (T,)."""
        return np.zeros(len(t), dtype=np.int64)

    def jump_times(self, until: float) -> Floats:
        """Return the times of the jumps up to `until`, (J,) [s]."""
        return np.empty(0)


def require_few_draws(motions: Iterable[Motion]) -> None:
    """Raise FieldError if the wanderers needed too many draws for their first cells."""
    if sum(motion.draws for motion in motions) > MAX_DRAWS:
        raise FieldError("walk.start", f"missing; random first cells need more than {MAX_DRAWS} draws in this world")


def motion_of(mover: Mover, index: int, bounds: Bounds, discs: Floats, start: Point, seed: int) -> Motion:
    """Return the motion of a world's mover."""
    if isinstance(mover, Keyframed):
        return _KeyframedMotion(mover)
    if isinstance(mover, Cruising):
        return _CruisingMotion(mover, bounds)
    key = [seed, zlib.crc32(b"mover"), index] if mover.seed is None else [mover.seed]
    return _WanderingMotion(mover, bounds, discs, start, np.random.default_rng(key))


def first_place(mover: Mover, bounds: Bounds, discs: Floats) -> Point | None:
    """Return a mover's centre at a run's start [m]; None for a wanderer without a start, or in the middle of its walk."""
    if isinstance(mover, Wandering):
        return first_cell(mover, bounds, discs) if mover.start is not None and not mover.phase else None
    x, y = motion_of(mover, 0, bounds, discs, (math.inf, math.inf), 0).at(np.zeros(1))[0].tolist()
    return x, y


def path_ahead(motion: Motion, seconds: float) -> Floats:
    """Return a mover's path from the run's start to its first jump, for drawing (N, 2) [m]."""
    end = float(min(motion.jump_times(seconds), default=seconds))
    times = np.linspace(0.0, end, PATH_POINTS)
    return motion.at(times[:-1] if end < seconds else times)


class _KeyframedMotion(Motion):
    """Motion along keyframes; each segment is a cubic in the elapsed fraction of its time."""

    def __init__(self, mover: Keyframed) -> None:
        frames = np.array(mover.keyframes, dtype=np.float64)
        self.radius = mover.radius
        self._loop = mover.loop
        self._late = mover.phase - frames[0, 0]  # time from keyframe time 0 to the run's start
        self._knots = frames[:, 0] - frames[0, 0]
        self._span = float(self._knots[-1])
        self._durations = np.diff(self._knots)
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
        self._travelled = np.concatenate(([0.0], np.cumsum(_longest(self._terms))))  # at each knot

    def at(self, t: Floats) -> Floats:
        along, _, _ = self._lap(t)
        k, f = self._segment(along, "right")
        p, a, b, c = self._terms[:, k]
        return np.asarray(p + f * (a + f * (b + f * c)))

    def velocities(self, t: Floats) -> Floats:
        along, sense, _ = self._lap(t)
        k, f = self._segment(along, "right")
        back = sense < 0
        k[back], f[back] = (part[back] for part in self._segment(along, "left"))
        _, a, b, c = self._terms[:, k]
        return np.asarray(sense[:, None] * (a + f * (2 * b + f * 3 * c)) / self._durations[k, None])

    def travelled(self, t: Floats) -> Floats:
        along, sense, lap = self._lap(t)
        travelled = np.interp(along, self._knots, self._travelled)
        whole = self._travelled[-1]
        return np.asarray(lap * whole + np.where(sense < 0, whole - travelled, travelled))

    def jumped(self, t: Floats) -> npt.NDArray[np.int64]:
        lap = self._lap(t)[2]
        return lap if self._jumps else np.zeros_like(lap)

    def jump_times(self, until: float) -> Floats:
        if not self._jumps:
            return np.empty(0)
        first = max(1, math.floor(self._late / self._span) + 1)
        last = math.floor((until + self._late) / self._span)
        return np.asarray(np.arange(first, last + 1) * self._span - self._late)

    def _lap(self, t: Floats) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
        """Return the time along the keyframes, its direction (-1, 0 or 1) and the laps completed, each (T,)."""
        local = t + self._late
        started = local >= 0
        local = np.maximum(local, 0.0)
        if self._loop == "once":
            return np.minimum(local, self._span), (started & (local < self._span)) * 1.0, np.zeros(len(t), np.int64)
        lap = np.floor_divide(local, self._span)
        along = np.clip(local - lap * self._span, 0.0, self._span)
        back = (lap % 2 == 1) & (self._loop == "pingpong")
        along = np.where(back, self._span - along, along)
        return along, np.where(started, np.where(back, -1.0, 1.0), 0.0), lap.astype(np.int64)

    def _segment(self, along: Floats, side: str) -> tuple[npt.NDArray[np.int64], Floats]:
        """Return the segment (T,) of each time along the keyframes, and its elapsed fraction (T, 1)."""
        segment = np.searchsorted(self._knots, along, side="right" if side == "right" else "left") - 1
        k = np.clip(segment, 0, len(self._durations) - 1)
        return k, ((along - self._knots[k]) / self._durations[k])[:, None]


def _longest(terms: Floats) -> Floats:
    """Return an upper bound on each cubic segment's length: duration times highest speed, (K,) [m]."""
    _, a, b, c = terms
    ends = [np.abs(a), np.abs(a + 2 * b + 3 * c)]
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.clip(np.nan_to_num(-b / (3 * c), nan=0.0), 0.0, 1.0)  # extremum of a component's speed
    most = np.maximum.reduce([*ends, np.abs(a + turn * (2 * b + turn * 3 * c))])
    return np.asarray(np.hypot(most[:, 0], most[:, 1]))


class _CruisingMotion(Motion):
    """Straight motion reflected at the walls: each coordinate is a line folded into the free interval."""

    def __init__(self, mover: Cruising, bounds: Bounds) -> None:
        self.radius = mover.radius
        # Columns (2, 1): numpy is several times faster on two rows of T than on T rows of two.
        low, high = np.array(bounds[:2])[:, None], np.array(bounds[2:])[:, None]
        self._low = low + mover.radius
        self._room = high - mover.radius - self._low
        self._velocity = np.array(mover.velocity, dtype=np.float64)[:, None]
        self._first = np.array(mover.position, dtype=np.float64)[:, None] - self._low + mover.phase * self._velocity

    def at(self, t: Floats) -> Floats:
        unfolded = self._unfolded(t)
        return np.asarray(self._low + np.where(unfolded > self._room, 2 * self._room - unfolded, unfolded)).T

    def velocities(self, t: Floats) -> Floats:
        unfolded = self._unfolded(t)
        # At the wall the velocity already points away from it.
        back = np.where(self._velocity < 0, (unfolded > self._room) | (unfolded == 0), unfolded >= self._room)
        return np.asarray(np.where(back, -self._velocity, self._velocity)).T

    def travelled(self, t: Floats) -> Floats:
        return np.asarray(t * math.hypot(*self._velocity[:, 0]))

    def _unfolded(self, t: Floats) -> Floats:
        """Return the position (2, T) in the interval doubled by its mirror image."""
        return np.asarray(np.mod(self._first + t * self._velocity, 2 * self._room))


class _WanderingMotion(Motion):
    """Random walk between cells. Steps are drawn on first use, in order, and kept."""

    def __init__(self, mover: Wandering, bounds: Bounds, discs: Floats, start: Point, rng: np.random.Generator) -> None:
        self.radius = mover.radius
        self._mover, self._bounds, self._discs, self._rng = mover, bounds, discs, rng
        self._stops = [self._first_stop(start)]

    def at(self, t: Floats) -> Floats:
        here, there, fraction = self._steps(t)
        return np.asarray(here + fraction[:, None] * (there - here))

    def velocities(self, t: Floats) -> Floats:
        here, there, _ = self._steps(t)
        return np.asarray((there - here) / self._mover.period)

    def travelled(self, t: Floats) -> Floats:
        return np.asarray(t * (math.sqrt(2) * self._mover.cell / self._mover.period))

    def _steps(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the current step at each time: start (T, 2), end (T, 2) and completed fraction (T,)."""
        periods = (t + self._mover.phase) / self._mover.period
        step = np.floor(periods).astype(np.int64)
        while len(self._stops) < (step.max(initial=0) + 2):
            self._stops.append(self._next_stop(self._stops[-1]))
        stops = np.array(self._stops)
        return stops[step], stops[step + 1], periods - step

    def _next_stop(self, here: Point) -> Point:
        cell = self._mover.cell
        x0, y0 = self._bounds[0] + cell / 2, self._bounds[1] + cell / 2
        # Counted in cells, so that rounding errors do not accumulate.
        col, row = round((here[0] - x0) / cell), round((here[1] - y0) / cell)
        ends = np.array([x0, y0]) + (_NEIGHBOURS + (col, row)) * cell
        free = np.flatnonzero(_free_steps(self._discs, self._bounds, here, ends, self._mover.radius))
        if not len(free):
            return here
        x, y = ends[free[self._rng.integers(len(free))]]
        return float(x), float(y)

    def _first_stop(self, start: Point) -> Point:
        mover, bounds = self._mover, self._bounds
        if mover.start is not None:
            return first_cell(mover, bounds, self._discs)
        cols, rows = _cells_across(bounds, mover.cell)
        for draw in range(TRIES):
            self.draws = draw + 1
            col, row = self._rng.integers(cols), self._rng.integers(rows)
            x = float(bounds[0] + mover.cell / 2 + col * mover.cell)
            y = float(bounds[1] + mover.cell / 2 + row * mover.cell)
            clear = math.dist((x, y), start) - mover.radius >= CLEAR_OF_ROBOT
            if clear and _free_steps(self._discs, bounds, (x, y), np.array([(x, y)]), mover.radius)[0]:
                return x, y
        raise FieldError(
            "walk",
            f"no free first cell of {mover.cell:g} m at least {CLEAR_OF_ROBOT:g} m from the robot's start; give walk.start",
        )


def is_within(bounds: Bounds, x: float, y: float, radius: float = 0.0) -> bool:
    """Return whether a disc is within bounds, up to rounding."""
    xmin, ymin, xmax, ymax = bounds
    inset = radius - ROUNDING
    return xmin + inset <= x <= xmax - inset and ymin + inset <= y <= ymax - inset


def first_cell(mover: Wandering, bounds: Bounds, discs: Floats) -> Point:
    """Return the centre of the cell that contains a wanderer's given start."""
    assert mover.start is not None
    (x, y), (xmin, ymin), cell = mover.start, bounds[:2], mover.cell
    if not is_within(bounds, x, y):
        raise FieldError("walk.start", f"{format_point((x, y))} is out of bounds {format_numbers(bounds)}")
    cols, rows = _cells_across(bounds, cell)
    col = min(max(math.floor((x - xmin) / cell), 0), cols - 1)
    row = min(max(math.floor((y - ymin) / cell), 0), rows - 1)
    centre = (float(xmin + cell / 2 + col * cell), float(ymin + cell / 2 + row * cell))
    if not _free_steps(discs, bounds, centre, np.array([centre]), mover.radius)[0]:
        raise FieldError("walk.start", f"radius {mover.radius:g} has no room in the cell around {format_point(centre)}")
    return centre


def _cells_across(bounds: Bounds, cell: float) -> tuple[int, int]:
    """Return the number of columns and rows of cells within the bounds."""
    width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
    return max(1, math.ceil(width / cell - 1e-9)), max(1, math.ceil(height / cell - 1e-9))


def _free_steps(discs: Floats, bounds: Bounds, here: Point, ends: Floats, radius: float) -> npt.NDArray[np.bool_]:
    """Return whether a disc moves straight from a point to each end (N, 2) without contact, (N,)."""
    walls = np.minimum(ends - np.array(bounds[:2]), np.array(bounds[2:]) - ends).min(axis=1)
    if not len(discs):
        return np.asarray(walls > radius)
    step = ends - np.array(here)
    length2 = np.maximum((step**2).sum(axis=1), 1e-300)
    to = discs[:, :2] - np.array(here)
    nearest = np.clip(step @ to.T / length2[:, None], 0.0, 1.0)  # fraction of the step where a disc is nearest
    gap = np.hypot(*np.moveaxis(to[None] - nearest[..., None] * step[:, None], -1, 0)) - discs[:, 2]
    return np.asarray((walls > radius) & (gap > radius).all(axis=1))
