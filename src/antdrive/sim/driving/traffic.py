"""Ground that movers roam, learned while driving: the robot goes round it if there is much traffic and a way round.

A mover that turns at a short distance cannot be escaped if it is as fast as the robot. How often that happens depends
on how long the robot is among such movers. So a robot that has seen where they go keeps to the ground where none was seen.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats
from antdrive.robots import RobotSpec, TrackedPath
from antdrive.sim.driving.blocking import points_at
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.watching import TrackedPredictor
from antdrive.worlds import Disc, Grid

MIXING = 2.0  # after this time a mover's place counts as a new sample of where movers go [s]
MEMORY = 2.0  # how much traffic a lidar shows is a mean over about this time [s]
FADING = 30.0  # and the most that it showed fades within about this time [s]
FAST = 0.75  # movers that are found by lidar count as traffic from this share of the robot's top speed on
SOON = 0.1  # speeds are those of the predictions this far ahead [s]
STRAY = 0.1  # a mover is expected this far beyond the box, but no farther [m]
MIN_RADIUS = 0.01  # smaller discs are left out [m]
OPENING = 2.0  # half the width of the way that is kept open for the robot and the goal [cells]


class Traffic:
    """Where the robot has seen movers, and how many there are.

    Attributes:
        box: the smallest box around all places of movers that were seen: xmin, ymin, xmax, ymax [m]
        samples: how many independent places of movers that makes, about
    """

    def __init__(self, predictor: Predictor, radius: float, bounds: Bounds, hz: int) -> None:
        self.box, self.samples = _nowhere(), 0.0
        self._predictor, self._radius, self._hz = predictor, radius, hz
        self._area = (bounds[2] - bounds[0]) * (bounds[3] - bounds[1])
        self._noted = _nowhere()

    def look(self, tick: int, robot: tuple[float, float]) -> None:
        """Take note of the movers that the robot perceives in a tick from a position [m]."""
        perceived, places = self._predictor.perceived(tick, robot)
        self._note(places[perceived], 1 / self._hz)

    def _note(self, places: Floats, period: float) -> None:
        """Take note of places of movers (N, 2) [m], a period [s] after the last ones."""
        if len(places):
            self.samples += len(places) * period / MIXING if self.samples else len(places)
            np.minimum(self.box[:2], places.min(axis=0), out=self.box[:2])
            np.maximum(self.box[2:], places.max(axis=0), out=self.box[2:])

    def grown(self, by: float) -> bool:
        """Whether a side of the box has moved outwards by more than this [m] since the last `zones`."""
        return bool(self.samples) and bool((np.abs(self.box - self._noted) > by).any())

    def rate(self, tick: int, robot: tuple[float, float]) -> float:
        """How many movers a second would meet a robot that stands anywhere in the world [1/s].

        A mover sweeps the ground where it would touch the robot: as wide as both, as long as it gets in a second.
        """
        places, radii = self._predictor.predict(tick, robot, np.array([0.0, SOON]))
        speeds = np.hypot(*(places[1] - places[0]).T) / SOON
        return float((2 * (radii + self._radius) * speeds).sum() / self._area)

    def widest(self, tick: int, robot: tuple[float, float]) -> float:
        """The largest radius of the movers that the robot perceives from a position [m]."""
        return float(self._predictor.predict(tick, robot, np.zeros(1))[1].max(initial=0.0))

    def zones(self, tick: int, robot: tuple[float, float], goal: tuple[float, float], grid: Grid) -> list[Zone]:
        """The ground that movers roam, as far as the robot can tell from a position [m]: as estimated, and as seen.

        The box of n places that were seen is too small by about a share of 1 / (n + 1) on each side, if movers are
        everywhere in theirs equally often.
        """
        self._noted = self.box.copy()
        radius = self.widest(tick, robot)
        unseen = (self.box[2:] - self.box[:2]) / (self.samples + 1)
        larger = np.concatenate((self.box[:2] - unseen, self.box[2:] + unseen))
        return [Zone(box, radius, robot, goal, grid) for box in (larger, self.box.copy())]


class TrackedTraffic(Traffic):
    """Where a robot has met movers with its lidar, and how many fast ones there are on the ground in sight.

    Places of movers that are hidden are guesses, so they do not count. How much traffic there is in the whole world cannot be
    seen; the ground that was in sight lately stands for it.
    """

    def __init__(self, predictor: TrackedPredictor, robot: RobotSpec, hz: int) -> None:
        super().__init__(predictor, robot.radius, (0.0, 0.0, 1.0, 1.0), hz)
        self._tracks, self._fast = predictor, FAST * robot.max_speed
        self._last, self._lately, self._most = -1, 0.0, 0.0

    def look(self, tick: int, robot: tuple[float, float]) -> None:
        """Take note of the movers that the last scan met, if it is a new one, from a position [m]."""
        watch = self._tracks.watch
        if watch.tick == self._last:
            return
        period = (watch.tick - self._last) / self._hz
        self._last = watch.tick
        self._note(self._tracks.sighted(tick), period)
        kept = math.exp(-period / MEMORY)
        self._lately *= kept
        if watch.sight:
            self._lately += (1 - kept) * self._sweep(tick, robot, watch.reach) / watch.sight
        self._most = max(self._lately, self._most * math.exp(-period / FADING))

    def rate(self, tick: int, robot: tuple[float, float]) -> float:
        """How many fast movers a second would meet a robot that stands anywhere on ground that is in sight [1/s].

        Movers that are out of sight for a while are there still, so the most that was seen counts, and fades.
        """
        return self._most

    def _sweep(self, tick: int, robot: tuple[float, float], reach: float) -> float:
        """The ground on which fast movers within reach [m] would touch the robot, in a second [m^2/s]."""
        places, radii = self._predictor.predict(tick, robot, np.array([0.0, 1.0]))
        speeds = np.hypot(*(places[1] - places[0]).T)
        counts = (np.hypot(*(places[0] - robot).T) - radii <= reach) & (speeds >= self._fast)
        return float((2 * (radii + self._radius) * speeds)[counts].sum())


class Zone:
    """A box that movers roam, grown by their radius and the grid's inflation, with ways kept open into it.

    A goal within it has a way straight out. A robot within it may go anywhere within its distance from outside.

    Attributes:
        blocked: the free cells within it, off these ways (R, C)
        discs: discs along the edge of the box, which keep a smoothed route outside
    """

    def __init__(
        self, box: Floats, radius: float, robot: tuple[float, float], goal: tuple[float, float], grid: Grid
    ) -> None:
        self._box, self._grid = box, grid
        reach, half = radius + grid.inflate, OPENING * grid.cell
        here, there = np.array(robot), np.array(goal)
        inside = float(_depth(here, box, reach))
        self._ways = [(here, here, inside + half)] if inside > 0 else []
        if _depth(there, box, reach) > 0:
            self._ways.append((there, _way_out(there, box, reach), half))
        rows, cols = np.indices(grid.shape)
        centres = np.array(grid.origin) + grid.cell * np.stack([cols, rows], axis=-1)
        self.blocked: npt.NDArray[np.bool_] = (
            grid.free & (_depth(centres, box, reach) > 0) & (self._off_ways(centres) > 0)
        )
        edge = _edge(box, max(radius, grid.cell) / 2)
        sizes = np.minimum(radius, self._off_ways(edge) - grid.inflate)
        rows_of_discs = np.column_stack((edge, sizes))[sizes > MIN_RADIUS].tolist()
        self.discs = [Disc(x, y, size) for x, y, size in rows_of_discs]

    def holds(self, disc: Disc) -> bool:
        """Whether a predicted disc is where movers go. One that is not will have turned before it gets there."""
        return bool(_depth(np.array([disc.x, disc.y]), self._box, STRAY) > 0)

    def crossed(self, tracked: TrackedPath, arc: float) -> bool:
        """Whether a route leads through blocked cells beyond an arc length on it [m]."""
        points = points_at(tracked, np.arange(arc, tracked.length, 0.5 * self._grid.cell))
        return any(self.blocked[self._grid.cell_at(x, y)] for x, y in points.tolist())

    def _off_ways(self, points: Floats) -> Floats:
        """How far points (..., 2) are from the ways that are kept open [m]."""
        off = np.full(points.shape[:-1], np.inf)
        for a, b, half in self._ways:
            step = b - a
            share = np.clip((points - a) @ step / max(float(step @ step), 1e-12), 0.0, 1.0)
            off = np.minimum(off, np.hypot(*np.moveaxis(points - a - share[..., None] * step, -1, 0)) - half)
        return off


def _nowhere() -> Floats:
    """The box of no places."""
    return np.array([math.inf, math.inf, -math.inf, -math.inf])


def _depth(points: Floats, box: Floats, reach: float) -> Floats:
    """How far points (..., 2) lie within a box that is grown by `reach` [m]; negative outside."""
    return np.asarray(np.minimum(points - box[:2], box[2:] - points).min(axis=-1) + reach)


def _way_out(point: Floats, box: Floats, reach: float) -> Floats:
    """The point outside a box that is grown by `reach` [m] that is nearest to a point within it."""
    gaps = np.concatenate((point - box[:2], box[2:] - point)) + reach
    side = int(np.argmin(gaps))
    out = point.copy()
    out[side % 2] += gaps[side] if side >= 2 else -gaps[side]
    return out


def _edge(box: Floats, spacing: float) -> Floats:
    """Points (N, 2) along the edge of a box, at most `spacing` apart [m]."""
    xs, ys = (np.linspace(box[k], box[k + 2], 2 + math.ceil((box[k + 2] - box[k]) / spacing)) for k in (0, 1))
    sides = [np.stack([xs, np.full_like(xs, y)], axis=1) for y in (box[1], box[3])]
    sides += [np.stack([np.full_like(ys, x), ys], axis=1)[1:-1] for x in (box[0], box[2])]
    return np.vstack(sides)
