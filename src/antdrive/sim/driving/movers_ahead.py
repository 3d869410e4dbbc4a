"""Traffic: replan triggers by movers, the ground that they cover soon, and the zones where they roam.

A mapless robot knows movers by the tracks of `antdrive.sim.driving.survey` only, so zones grow with its
observations.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats, Point, Pose
from antdrive.planners import PlanResult
from antdrive.robots import RobotSpec, TrackedPath
from antdrive.sim.driving.blockage import MIN_RADIUS, Blockage, covered_discs, obstructs_route, points_at
from antdrive.sim.driving.perceived_movers import STANDS, PerceivedMovers, Tracked
from antdrive.sim.policy import ReplanPolicy, Trigger
from antdrive.worlds import Disc, Grid, World, rasterise

if TYPE_CHECKING:
    from antdrive.sim.driving.survey import Survey

REPLANS, PROGRESS = 3, 1.0  # at most so many replans around movers for so much progress towards the goal [m]
MIXING = 2.0  # after this time a mover's position is an independent sample of where movers go [s]
MEMORY = 2.0  # time constant of the mean traffic in a lidar's view [s]
FADING = 30.0  # time constant with which the highest traffic seen fades [s]
FAST = 0.75  # movers tracked by lidar count as traffic above this fraction of the robot's top speed
SOON = 0.1  # speeds are those of predictions over this time [s]
STRAY = 0.1  # movers are expected up to this far beyond the box [m]
OPENING = 2.0  # half the width of the corridor that stays open for the robot and the goal [cells]


class Traffic:
    """Positions and density of the movers seen so far.

    Attributes:
        box: bounding box of all observed positions: xmin, ymin, xmax, ymax [m]
        samples: equivalent number of independent positions
    """

    def __init__(self, movers: PerceivedMovers, radius: float, bounds: Bounds, hz: int) -> None:
        self.box, self.samples = _nowhere(), 0.0
        self._movers, self._radius, self._hz = movers, radius, hz
        self._area = (bounds[2] - bounds[0]) * (bounds[3] - bounds[1])
        self._noted = _nowhere()

    def observe(self) -> None:
        """Note the movers that the robot perceives."""
        self._note(self._movers.near.positions, 1 / self._hz)

    def _note(self, places: Floats, period: float) -> None:
        """Note positions of movers (N, 2) [m], a period [s] after the last ones."""
        if len(places):
            self.samples += len(places) * period / MIXING if self.samples else len(places)
            np.minimum(self.box[:2], places.min(axis=0), out=self.box[:2])
            np.maximum(self.box[2:], places.max(axis=0), out=self.box[2:])

    def grown(self, by: float) -> bool:
        """Return whether a side of the box has moved outwards by more than this [m] since the last `zones`."""
        return bool(self.samples) and bool((np.abs(self.box - self._noted) > by).any())

    @property
    def rate(self) -> float:
        """How many movers would meet a standing robot per second [1/s].

        Each mover sweeps the ground where it would touch the robot: a strip as wide as both, at the mover's speed.
        """
        places, radii = self._movers.predict(np.array([0.0, SOON])), self._movers.near.radii
        speeds = np.hypot(*(places[1] - places[0]).T) / SOON
        return float((2 * (radii + self._radius) * speeds).sum() / self._area)

    @property
    def widest(self) -> float:
        """Largest radius of the perceived movers [m]."""
        return float(self._movers.near.radii.max(initial=0.0))

    def zones(self, goal: Point, grid: Grid) -> list[Zone]:
        """Return the zones that movers roam: the estimated box, then the observed one.

        The box of n uniform samples is too small by a fraction of about 1 / (n + 1) on each side.
        """
        self._noted = self.box.copy()
        unseen = (self.box[2:] - self.box[:2]) / (self.samples + 1)
        larger = np.concatenate((self.box[:2] - unseen, self.box[2:] + unseen))
        return [Zone(box, self.widest, self._movers.position, goal, grid) for box in (larger, self.box.copy())]


class TrackedTraffic(Traffic):
    """Traffic from lidar tracks: positions hit by scans, and the density of fast movers on visible ground.

    Positions of hidden movers are predictions and do not count. The recently visible ground represents the whole
    world.
    """

    def __init__(self, movers: Tracked, spec: RobotSpec, hz: int) -> None:
        super().__init__(movers, spec.radius, (0.0, 0.0, 1.0, 1.0), hz)
        self._tracks, self._fast = movers, FAST * spec.max_speed
        self._last, self._lately, self._most = -1, 0.0, 0.0

    def observe(self) -> None:
        """Note the movers of the last scan, if it is new."""
        tracking = self._tracks.tracking
        if tracking.tick == self._last:
            return
        period = (tracking.tick - self._last) / self._hz
        self._last = tracking.tick
        self._note(self._tracks.visible, period)
        kept = math.exp(-period / MEMORY)
        self._lately *= kept
        if tracking.sight:
            self._lately += (1 - kept) * self._sweep(tracking.reach) / tracking.sight
        self._most = max(self._lately, self._most * math.exp(-period / FADING))

    @property
    def rate(self) -> float:
        """How many fast movers would meet a standing robot per second on visible ground [1/s].

        Hidden movers still exist, so the highest rate observed counts and fades slowly.
        """
        return self._most

    def _sweep(self, reach: float) -> float:
        """Return the area that fast movers within reach [m] sweep per second [m^2/s]."""
        places, radii = self._movers.predict(np.array([0.0, 1.0])), self._movers.near.radii
        speeds = np.hypot(*(places[1] - places[0]).T)
        counts = (np.hypot(*(places[0] - self._movers.position).T) - radii <= reach) & (speeds >= self._fast)
        return float((2 * (radii + self._radius) * speeds)[counts].sum())


class Zone:
    """A box that movers roam, grown by their radius and the grid's inflation, with open corridors.

    A goal inside has a straight corridor out. A robot inside may go anywhere within its distance to the outside.

    Attributes:
        blocked: the free cells within the zone, outside the corridors (R, C)
        discs: discs along the edge of the box that keep a smoothed route outside
    """

    def __init__(self, box: Floats, radius: float, position: Point, goal: Point, grid: Grid) -> None:
        self._box, self._grid = box, grid
        reach, half = radius + grid.inflate, OPENING * grid.cell
        here, there = np.array(position), np.array(goal)
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
        """Return whether a predicted disc lies in the zone. Movers turn before they leave it."""
        return bool(_depth(np.array([disc.x, disc.y]), self._box, STRAY) > 0)

    def crossed(self, tracked: TrackedPath, arc: float) -> bool:
        """Return whether a route crosses blocked cells beyond an arc length [m]."""
        points = points_at(tracked, np.arange(arc, tracked.length, 0.5 * self._grid.cell))
        return any(self.blocked[self._grid.cell_at(x, y)] for x, y in points.tolist())

    def _off_ways(self, points: Floats) -> Floats:
        """Return the distances of points (..., 2) from the corridors [m]."""
        off = np.full(points.shape[:-1], np.inf)
        for a, b, half in self._ways:
            step = b - a
            share = np.clip((points - a) @ step / max(float(step @ step), 1e-12), 0.0, 1.0)
            off = np.minimum(off, np.hypot(*np.moveaxis(points - a - share[..., None] * step, -1, 0)) - half)
        return off


def _nowhere() -> Floats:
    """Return an empty box."""
    return np.array([math.inf, math.inf, -math.inf, -math.inf])


def _depth(points: Floats, box: Floats, reach: float) -> Floats:
    """Return how deep points (..., 2) lie within a box grown by `reach` [m]; negative outside."""
    return np.asarray(np.minimum(points - box[:2], box[2:] - points).min(axis=-1) + reach)


def _way_out(point: Floats, box: Floats, reach: float) -> Floats:
    """Return the nearest point outside a box grown by `reach` [m]."""
    gaps = np.concatenate((point - box[:2], box[2:] - point)) + reach
    side = int(np.argmin(gaps))
    out = point.copy()
    out[side % 2] += gaps[side] if side >= 2 else -gaps[side]
    return out


def _edge(box: Floats, spacing: float) -> Floats:
    """Return points (N, 2) along the edge of a box, at most `spacing` apart [m]."""
    xs, ys = (np.linspace(box[k], box[k + 2], 2 + math.ceil((box[k + 2] - box[k]) / spacing)) for k in (0, 1))
    sides = [np.stack([xs, np.full_like(xs, y)], axis=1) for y in (box[1], box[3])]
    sides += [np.stack([np.full_like(ys, x), ys], axis=1)[1:-1] for x in (box[0], box[2])]
    return np.vstack(sides)


COARSE = 0.25  # side of the cells on which routes are checked against zones [m]
SLACK = 0.4  # extra width of the lane along the outermost walls, since maps are distorted [m]
MOST = 1.0  # largest radius of a mover [m]


class MoversAhead:
    """Replan triggers by movers, and the discs and zones that plans avoid."""

    def __init__(
        self,
        movers: PerceivedMovers,
        policy: ReplanPolicy,
        goal: Point,
        grid: Grid,
        traffic: Traffic | None,
        blockage: Blockage | None = None,
    ) -> None:
        self._movers, self._policy, self._goal, self._grid = movers, policy, goal, grid
        self._traffic, self._blockage = traffic, blockage
        self._waiting_since = math.nan
        self._nearest, self._replanned = math.inf, [math.inf] * REPLANS

    def observe(self, waiting: bool) -> None:
        """Note the perceived movers and the waiting time of one control period."""
        if self._traffic is not None:
            self._traffic.observe()
        self._nearest = min(self._nearest, math.dist(self._movers.position, self._goal))
        if not waiting:
            self.reset_wait()
        elif math.isnan(self._waiting_since):
            self._waiting_since = self._movers.t

    def reset_wait(self) -> None:
        """Reset the waiting time."""
        self._waiting_since = math.nan

    def trigger(self, tracked: TrackedPath, arc: float) -> str:
        """Return why movers make a new route due; empty if they do not.

        After `REPLANS` around movers for a metre of progress towards the goal, the robot keeps its route until it has waited
        or traffic grows.
        """
        policy = self._policy
        if self._movers.t - self._waiting_since >= policy.max_wait:
            self.reset_wait()
            return Trigger.WAITED
        if self._replanned[-REPLANS] - self._nearest >= PROGRESS and self._obstructed(tracked, arc):
            self._replanned.append(self._nearest)
            return Trigger.OBSTRUCTED
        traffic = self._traffic
        if traffic is None or not traffic.grown(self._grid.cell) or not self.heavy:
            return ""
        return Trigger.TRAFFIC if self.zones(self._around)[-1].crossed(tracked, arc) else ""

    def _obstructed(self, tracked: TrackedPath, arc: float) -> bool:
        """Return whether movers will cover the route ahead."""
        return obstructs_route(self.discs(), tracked, arc, self._policy.obstruction_range, self._grid.inflate)

    @property
    def heavy(self) -> bool:
        """Whether traffic is heavy enough to plan around zones."""
        return self._traffic is not None and self._traffic.rate > self._policy.max_traffic

    def discs(self) -> list[Disc]:
        """Return the discs that movers will cover soon; they close neither the robot's position nor the goal.

        Discs are larger where the robot has waited beside a mover.
        """
        ends = np.array([self._movers.position, self._goal])
        covered = covered_discs(self._movers, ends, self._policy.prediction_time, self._grid)
        return covered if self._blockage is None else covered + self._blockage.discs(ends)

    def zones(self, grid: Grid) -> list[Zone]:
        """Return the zones that movers roam, largest first: the estimated box, then the observed one."""
        assert self._traffic is not None
        return self._traffic.zones(self._goal, grid)

    def waiting_is_quicker(self, trigger: str, speed: float, around: float, free: float) -> bool:
        """Return whether a route `around` movers [m] takes longer than to wait for them and take the `free` one [m].

        Routes are driven at a speed [m/s]. A robot that has waited, or that sees only standing movers, takes any route.
        """
        if trigger == Trigger.WAITED or around <= free + self._policy.max_wait * speed:
            return False
        return bool((np.hypot(*self._movers.near.velocities.T) >= STANDS).any())

    def plan_around_zones(
        self, zones: list[Zone], discs: list[Disc], plan: Callable[[list[Disc], Zone], PlanResult]
    ) -> tuple[PlanResult, list[Disc]] | None:
        """Return a plan around the first zone without a long detour, and its discs; None if all detours are too long."""
        reach, here = self._policy.obstruction_range, self._movers.position
        longest = self._policy.max_detour * math.dist(here, self._goal)
        for zone in zones:
            # Distant movers will have moved on and must not close the only route to the goal.
            near = [d for d in discs if math.dist((d.x, d.y), here) <= reach and zone.holds(d)]
            answer = plan(near, zone)
            if answer.cost <= longest:
                return answer, near + zone.discs
        return None

    @property
    def _around(self) -> Grid:
        """The grid on which routes are checked against zones."""
        return self._grid


class MoversSeenAhead(MoversAhead):
    """Replan triggers by lidar tracks, for a mapless robot."""

    def __init__(
        self,
        tracked: Tracked,
        survey: Survey,
        policy: ReplanPolicy,
        spec: RobotSpec,
        goal: Point,
        inflate: float,
    ) -> None:
        grid = rasterise(World("measure", (0.0, 0.0, 1.0, 1.0)), COARSE, inflate)
        self._roamed = TrackedTraffic(tracked, spec, tracked.tracking.hz)
        super().__init__(tracked, policy, goal, grid, self._roamed)
        self._survey = survey

    def discs(self) -> list[Disc]:
        """Return the discs that movers will cover soon; they close neither the robot's position nor the goal."""
        return super().discs() if len(self._movers.near.numbers) else []

    @property
    def _around(self) -> Grid:
        (x, y), (gx, gy) = self._movers.position, self._goal
        around = self.bounds((min(x, gx) - 1.0, min(y, gy) - 1.0, max(x, gx) + 1.0, max(y, gy) + 1.0))
        return rasterise(World("around movers", around), COARSE, self._grid.inflate)

    def zones(self, grid: Grid) -> list[Zone]:
        """Return the zones, largest first: all but a lane along the outermost walls, the estimated box, the observed one."""
        zones = self._roamed.zones(self._goal, grid)
        roamed, radius = self._roamed.box, self._roamed.widest
        lane = radius + 2 * self._grid.inflate + SLACK
        lower, upper = self._outermost()
        inner = np.concatenate((np.minimum(lower + lane, roamed[:2]), np.maximum(upper - lane, roamed[2:])))
        return [Zone(inner, radius, self._movers.position, self._goal, grid), *zones]

    def bounds(self, least: Bounds) -> Bounds:
        """Return bounds that contain a route around the zones."""
        box, more = self._roamed.box, 2 * (MOST + self._grid.inflate)
        lower, upper = self._outermost()
        x0, y0 = np.floor(np.minimum(lower, box[:2] - more)).tolist()
        x1, y1 = np.ceil(np.maximum(upper, box[2:] + more)).tolist()
        return min(least[0], x0), min(least[1], y0), max(least[2], x1), max(least[3], y1)

    def _outermost(self) -> tuple[Floats, Floats]:
        """Return the lower left and upper right corner of all hits (2,), (2,) [m]; without hits those of the observed box."""
        hits = self._survey.map.discs()[:, :2]
        if not len(hits):
            return self._roamed.box[:2], self._roamed.box[2:]
        return hits.min(axis=0), hits.max(axis=0)

    def without_trails(self, discs: Floats, pose: Pose) -> Floats:
        """Return the discs (N, 3) [m] without those that movers may have left behind where they roam.

        Beyond the distance at which ground is observed as free, a mover has no track yet and its hits enter the map.
        """
        if not self._roamed.samples:
            return discs
        box = self._roamed.box
        far = np.hypot(*(discs[:, :2] - pose[:2]).T) > self._survey.map.trust
        there = ((discs[:, :2] > box[:2]) & (discs[:, :2] < box[2:])).all(axis=1)
        return np.asarray(discs[~(far & there)])
