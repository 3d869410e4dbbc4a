"""Lidar processing during a drive, in the frame of the estimates: scans, mover detection, and the occupancy map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point, Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.lidar import Lidar
from antdrive.sim.driving import _kernels_hits
from antdrive.sim.driving.observation import FirstSight
from antdrive.sim.driving.parts import Rows
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.policy import SCANNED
from antdrive.sim.sensing.mapping import OccupancyMap, clear_way, shape_of
from antdrive.sim.sensing.matching import FAR, ScanMatcher, without_sliding
from antdrive.sim.sensing.tracking import Ground, MappedGround, MoverTracker, TrackedMovers, ends
from antdrive.worlds import Route, World

MAP_CELL = 0.05  # side of the map's cells [m]
HORIZON, HORIZON_AMONG_MOVERS = 10.0, 16.0  # range up to which hits enter the map [m]
RECENT = 1.0  # after a reset, scans up to this age enter the new map [s]
PAD = 0.01  # distance kept from hits and from unknown ground, for rounding of ranges and cells [m]
PATIENCE = 3  # failed plans in a row before the map is reset
TOLERANCE = 0.008  # clearance that a route may lose without a replan [m]
ROUTE_CHECK_STEP = 0.1  # spacing of the points in a route check [m]
BLUR = 0.02  # additional allowance per metre of distance [m/m]
PERSON = 0.5  # width of a person [m]
SHARPEST = 0.05  # arcs of a smaller radius are treated as turns on the spot [m]
FAR_AMONG_MOVERS = 15.0  # matching range among movers, which hide near landmarks [m]


def horizon_of(*, tracks_movers: bool) -> float:
    """Return the range up to which hits enter the robot's map [m]."""
    return HORIZON_AMONG_MOVERS if tracks_movers else HORIZON


def turning_room(radius: float) -> float:
    """Return the radius of free ground that a turn on the spot needs under the stopping constraint [m].

    Unknown ground counts by circles around its cells; half a cell exceeds the part of such a circle outside the cell.
    """
    return radius + PAD + 0.5 * MAP_CELL


def reset_ticks(record: DriveRecord) -> Iterator[int]:
    """Yield the control periods in which a mapless robot reset its map, after `PATIENCE` failed plans in a row."""
    failures = 0
    for replan in record.replans:
        if failures >= PATIENCE and replan.trigger != SCANNED:
            failures = 0
            yield round(replan.t * record.control_hz)
        failures = 0 if replan.solved else failures + 1


def table_logged(
    taken: Iterable[tuple[int, npt.NDArray[Any]]], columns: int, log: Rows, per_tick: int
) -> npt.NDArray[np.float32]:
    """Return a table (K, columns) of a log: entries noted in control periods; each begins with the log row of its period."""
    kept = [(tick * per_tick, lines) for tick, lines in taken if tick * per_tick < len(log.t)]
    tables = [np.column_stack((np.full(len(lines), row), lines)) for row, lines in kept]
    return np.concatenate(tables or [np.empty((0, columns))]).astype(np.float32)


class RoutePoints(NamedTuple):
    """Points of a route for route checks, `ROUTE_CHECK_STEP` apart."""

    xy: Floats  # (N, 2) [m]
    needed: Floats  # required clearance (N,) [m]
    arcs: Floats  # distance along the route (N,) [m]
    blocks: Floats  # rectangles around consecutive points with their clearances (K, 4) [m]

    @classmethod
    def of(cls, route: Route, world: World, inflate: float) -> RoutePoints:
        """Return the points of a route, which keep `inflate` or else their clearance [m]."""
        arcs = np.arange(0.0, route.length + ROUTE_CHECK_STEP, ROUTE_CHECK_STEP)
        bounds = np.asarray(world.bounds, dtype=np.float64)
        points, needed, blocks = _kernels_hits.route_points(route.xy, route.arc, arcs, world.discs, bounds, inflate)
        return cls(points, needed, arcs, blocks)


class MoverTracking:
    """Mover tracker of a drive, with its log.

    Attributes:
        tracker: detects and tracks movers
        tick: the control period of the last scan
        sight: area covered by its beams within `reach` [m^2]
        reach: range up to which beams lie no farther apart than a map cell [m]
    """

    def __init__(self, lidar: Lidar, hz: int, pose_xy: float = 0.0, pose_yaw: float = 0.0) -> None:
        lidar = lidar.at(hz)
        self.tracker, self.tick = MoverTracker(lidar, None, pose_xy, pose_yaw), 0
        self.sight, self.reach = 0.0, min(lidar.max_range, MAP_CELL / lidar.spacing)
        self._last: tuple[Pose, Floats, npt.NDArray[np.bool_]] | None = None
        self._known_corners: Floats | None = None
        self._hz, self._spacing, self._lidar = hz, lidar.spacing, lidar
        self._settle = max(2, round(self.tracker.policy.settle * lidar.rate))
        self._log: list[tuple[int, TrackedMovers]] = []

    def read(self, ground: Ground, pose: Pose, ranges: Floats, tick: int) -> npt.NDArray[np.bool_]:
        """Update the tracks with a scan; return which beams hit tracked movers (beams,)."""
        theirs = self.tracker.update(ground, pose, ranges, tick / self._hz)
        self.tick = tick
        crossed = np.clip(ranges, 0.0, self.reach)
        self.sight = float(0.5 * self._spacing * (crossed * crossed).sum())
        self._log.append((tick, self.tracker.movers()))
        self._last, self._known_corners = (pose, ranges, theirs), None
        return theirs

    @property
    def corners(self) -> Floats:
        """Where ground that may hide people from the last scan begins, movers apart (N, 2) [m].

        These are ends of surfaces at least as wide as a person, and with as much space behind.
        """
        if self._known_corners is None:
            self._known_corners = self._corners(*self._last) if self._last else np.empty((0, 2))
        return self._known_corners

    def _corners(self, pose: Pose, ranges: Floats, theirs: npt.NDArray[np.bool_]) -> Floats:
        """Return the corners that a scan shows (N, 2) [m]."""
        far = np.clip(ranges, 0.0, self._lidar.max_range)
        steps = np.diff(far)
        jumps = np.flatnonzero(np.abs(steps) > PERSON)
        first, last = np.append(0, jumps + 1), np.append(jumps, len(far) - 1)  # beams of each surface
        begins, finishes = (ends(self._lidar, pose, far, beams) for beams in (first, last))
        wide = np.hypot(*(finishes - begins).T) >= PERSON
        nearer = np.where(steps[jumps] > 0, jumps, jumps + 1)
        hides = np.where(steps[jumps] > 0, wide[:-1], wide[1:]) & np.isfinite(ranges[nearer]) & ~theirs[nearer]
        return ends(self._lidar, pose, ranges, nearer[hides])

    def update_on_map(self, seen: OccupancyMap, pose: Pose, ranges: Floats, tick: int) -> npt.NDArray[np.bool_]:
        """Update with a scan of a robot that makes its own map, before the map takes the scan."""
        return self.read(MappedGround(seen, self._settle), pose, ranges, tick)

    def standing(self, seen: OccupancyMap, pose: Pose, ranges: Floats, tick: int) -> Floats:
        """Return an unprocessed scan without hits on possible movers (beams,) [m]: those ranges are infinite."""
        ground = MappedGround(seen, self._settle)
        return np.where(self.tracker.suspected(ground, pose, ranges, tick / self._hz), np.inf, ranges)

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Return the array `tracks` of a log (K, 7)."""
        lines = (
            (tick, np.column_stack((movers.numbers, movers.positions, movers.velocities, movers.radii)))
            for tick, movers in self._log
        )
        return {"tracks": table_logged(lines, 7, log, per_tick)}


class Scan(NamedTuple):
    """A scan with its estimated pose."""

    tick: int  # the control period of the scan
    estimate: Pose  # the estimated pose
    ranges: Floats  # ranges (beams,) [m]
    # which beams hit tracked movers (beams,); None without tracking
    movers: npt.NDArray[np.bool_] | None = None


class Scans:
    """Scans of a drive, at their estimated poses.

    Attributes:
        scans: all scans so far
    """

    def __init__(self) -> None:
        self.scans: list[Scan] = []

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> Pose:
        """Store a scan; return the estimate, possibly corrected by the scan."""
        self.scans.append(Scan(tick, estimate, ranges))
        return estimate


class MoverDetector(Scans):
    """Lidar-based mover detection for a robot with a map.

    Attributes:
        tracking: the tracks of the movers
    """

    def __init__(self, ground: Ground, tracking: MoverTracking) -> None:
        super().__init__()
        self.tracking, self._ground = tracking, ground

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> Pose:
        """Store a scan and track movers in it; return the estimate."""
        self.tracking.read(self._ground, estimate, ranges, tick)
        return super().read(tick, estimate, ranges)


class Survey(Scans):
    """Mapping for a mapless robot.

    At the start, the free ground within the robot's turning circle is given.

    Attributes:
        lidar: the lidar
        map: the occupancy map
        whole: number of scans entered as a whole, with their free ground
        tracking: the mover tracker; None without tracking

    Args:
        robot: the robot; it has a lidar
        start: the start pose
        goal: the goal [m]
        hz: control periods per second
        sight: what it is given at its start; None: nothing
        matching: whether to correct estimates by scan matching
        tracking: the mover tracker; None without tracking
    """

    def __init__(
        self,
        robot: RobotSpec,
        start: Pose,
        goal: Point,
        hz: int,
        sight: FirstSight | None = None,
        *,
        matching: bool = False,
        tracking: MoverTracking | None = None,
    ) -> None:
        super().__init__()
        assert robot.lidar is not None
        self.lidar = robot.lidar.at(hz)
        foot = robot.footprint
        self._shape = shape_of(dataclasses.replace(foot, rounding=foot.rounding + PAD))
        self._turning_room = turning_room(robot.radius)
        self._goal = goal
        self.tracking = tracking
        moving = tracking is not None
        horizon = horizon_of(tracks_movers=moving)
        self.map = OccupancyMap(self.lidar, MAP_CELL, start[:2], horizon, goal=goal, moving=moving)
        self.map.mark_free(start[:2], self._turning_room, sight.ground if sight else None)
        self._recent = math.ceil(RECENT * self.lidar.rate)
        self._matcher = ScanMatcher(self.lidar, FAR_AMONG_MOVERS if moving else FAR) if matching else None
        self.whole = 0
        if sight is not None:
            self.read(0, start, sight.ranges)

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> Pose:
        """Enter a scan in the map; return the estimate, possibly corrected by scan matching."""
        if self.map.whole:
            self.whole += 1
            if self._matcher is not None:
                estimate = self._matched(self._matcher, estimate, ranges, tick)
        movers = self.tracking.update_on_map(self.map, estimate, ranges, tick) if self.tracking is not None else None
        self.map.insert(estimate, ranges, movers)
        self.scans.append(Scan(tick, estimate, ranges, movers))
        return estimate

    def _matched(self, matcher: ScanMatcher, estimate: Pose, ranges: Floats, tick: int) -> Pose:
        """Match a scan to the map; among movers use standing hits only, and drop shifts along a wall."""
        if self.tracking is None:
            return matcher.corrected(self.map, estimate, ranges)
        standing = self.tracking.standing(self.map, estimate, ranges, tick)
        corrected = matcher.corrected(self.map, estimate, standing)
        near = np.where(standing <= FAR_AMONG_MOVERS, standing, np.inf)
        return without_sliding(estimate, corrected, self.map.endpoints(estimate, near))

    def check(self, path: tuple[Floats, Floats], points: RoutePoints, at: float, first: int) -> tuple[Point, bool]:
        """Return a path's point at an arc length, and whether a beam of the last scan ended clearly within the required
        clearance of a route point from `first` on."""
        scan = self.scans[-1]
        eye = self.lidar.pose_on(scan.estimate)
        ranges = scan.ranges if scan.movers is None else np.where(scan.movers, np.inf, scan.ranges)
        x, y, hit = _kernels_hits.check(*path, *points, at, first, TOLERANCE, BLUR, *eye, self.map.beams, ranges)
        return (x, y), hit

    def reset(self, pose: Pose) -> None:
        """Reset the map to the latest scans: older hits may be displaced by drift.

        Ground within the turning circle stays free where it was observed as free. Hits there become unknown: open to plans, but
        closed to motion until scanned again.
        """
        self.map = self.map.reset_around(pose[:2], self._turning_room, self._goal)
        for scan in self.scans[-self._recent :]:
            self.map.insert(scan.estimate, scan.ranges, scan.movers)

    def clear_distance(self, pose: Pose, speed: float, yaw_rate: float, longest: float) -> float:
        """Return how far the robot can drive on an arc over observed free ground [m]."""
        return clear_way(self.map, pose, speed, yaw_rate, self._shape, longest)

    def clear_turn(self, pose: Pose, yaw_rate: float, farthest: float) -> float:
        """Return how far the robot can turn on the spot over observed free ground [rad]."""
        return clear_way(self.map, pose, 0.0, yaw_rate, self._shape, farthest)

    def clear_way(self, pose: Pose, twist: Twist, farthest: float, *, freespace: bool = False) -> float:
        """Return how far a twist leads over observed free ground [m], for near turns [rad]; `freespace` opens unknown ground."""
        speed = 0.0 if abs(twist.speed) <= SHARPEST * abs(twist.yaw_rate) else twist.speed
        return clear_way(self.map, pose, speed, twist.yaw_rate, self._shape, farthest, freespace=freespace)
