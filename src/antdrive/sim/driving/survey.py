"""Lidar processing during a drive, in the frame of the estimates: scans, mover detection, and the occupancy map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point, Pose
from antdrive.robots import RobotSpec
from antdrive.robots.control.observation import FirstSight
from antdrive.sim.driving import _kernels_hits
from antdrive.sim.driving.mover_tracking import MAP_CELL, MoverTracking
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.policy import Trigger
from antdrive.sim.sensing.mapping import OccupancyMap, clear_way, shape_of
from antdrive.sim.sensing.matching import FAR, ScanMatcher, without_sliding
from antdrive.sim.sensing.tracking import Ground
from antdrive.worlds import Route, World

HORIZON, HORIZON_AMONG_MOVERS = 10.0, 16.0  # range up to which hits enter the map [m]
RECENT = 1.0  # after a reset, scans up to this age enter the new map [s]
PAD = 0.01  # distance kept from hits and from unknown ground, for rounding of ranges and cells [m]
PATIENCE = 3  # failed plans in a row before the map is reset
TOLERANCE = 0.008  # clearance that a route may lose without a replan [m]
ROUTE_CHECK_STEP = 0.1  # spacing of the points in a route check [m]
BLUR = 0.02  # additional allowance per metre of distance [m/m]
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
        if failures >= PATIENCE and replan.trigger != Trigger.SCAN_TURN:
            failures = 0
            yield round(replan.t * record.control_hz)
        failures = 0 if replan.solved else failures + 1


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
        tracking: the mover tracker; None without tracking
    """

    def __init__(self, tracking: MoverTracking | None = None) -> None:
        self.scans: list[Scan] = []
        self.tracking = tracking

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> Pose:
        """Store a scan; return the estimate, possibly corrected by the scan."""
        self.scans.append(Scan(tick, estimate, ranges))
        return estimate


class MoverDetector(Scans):
    """Lidar-based mover detection for a robot with a map."""

    def __init__(self, ground: Ground, tracking: MoverTracking) -> None:
        super().__init__(tracking)
        self._tracks, self._ground = tracking, ground

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> Pose:
        """Store a scan and track movers in it; return the estimate."""
        self._tracks.read(self._ground, estimate, ranges, tick)
        return super().read(tick, estimate, ranges)


class Survey(Scans):
    """Mapping for a mapless robot.

    At the start, the free ground within the robot's turning circle is given.

    Attributes:
        lidar: the lidar
        map: the occupancy map
        whole: number of scans entered as a whole, with their free ground

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
        super().__init__(tracking)
        assert robot.lidar is not None
        self.lidar = robot.lidar.at(hz)
        foot = robot.footprint
        self._shape = shape_of(dataclasses.replace(foot, rounding=foot.rounding + PAD))
        self._turning_room = turning_room(robot.radius)
        self._goal = goal
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
        movers = self.tracking.read(self.tracking.ground(self.map), estimate, ranges, tick) if self.tracking else None
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

    def clear_way(self, pose: Pose, speed: float, yaw_rate: float, longest: float, *, freespace: bool = False) -> float:
        """Return how far the robot can drive on an arc over observed free ground [m], or turn on the spot [rad].

        With `freespace`, unknown ground is open, too.
        """
        return clear_way(self.map, pose, speed, yaw_rate, self._shape, longest, freespace=freespace)
