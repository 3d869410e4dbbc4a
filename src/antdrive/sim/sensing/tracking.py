"""Mover tracking: cluster unexplained scan points, fit circles, and track them over time.

Each track is a Kalman filter with constant velocity (Y. Bar-Shalom, X. Li, T. Kirubarajan, *Estimation with Applications to
Tracking and Navigation*, 2001, chapter 6). Tracks that expect points in one cluster share it, so that passing movers keep
their tracks; the remaining clusters and tracks are associated greedily, nearest first. A mover far off its prediction has
turned, so its velocity is unknown again (chapter 11). The given map, or the robot's occupancy map, explains hits on static
obstacles.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Pose
from antdrive.robots.control import _kernels_obstacles
from antdrive.robots.control.pursuit import SQUARE, indexed_obstacles
from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing import _kernels_tracking as kernels
from antdrive.sim.sensing.mapping import OccupancyMap
from antdrive.worlds import World

SLACK = 0.02  # points this near to a known surface lie on it [m]
SIGMAS = 3.0  # tolerance of errors in standard deviations


class Hits(NamedTuple):
    """Ends of the beams of a scan."""

    beams: npt.NDArray[np.intp]  # numbers of the beams with a hit in range (N,)
    points: Floats  # their ends, in the frame of the estimate (N, 2) [m]
    explained: npt.NDArray[np.bool_]  # whether static obstacles explain them (N,)


class Ground(Protocol):
    """Map that explains hits by static obstacles."""

    @property
    def complete(self) -> bool:
        """Whether the map is complete from the beginning."""

    def hits(self, pose: Pose, ranges: Floats) -> Hits:
        """Return the hits of a scan."""


class KnownGround:
    """Cylinders and walls of a given map. Unexplained hits belong to movers or unknown obstacles.

    Attributes:
        complete: true

    Args:
        lidar: the robot's lidar; cylinders below its beams do not count
        world: the map; its movers do not count
        pose_xy: standard deviation of the estimated position [m]
        pose_yaw: standard deviation of the estimated heading [rad]
    """

    complete = True

    def __init__(self, lidar: Lidar, world: World, pose_xy: float = 0.0, pose_yaw: float = 0.0) -> None:
        tall = tuple(disc for disc in world.obstacles if disc.height >= lidar.height)
        self._lidar, self._pose_xy, self._pose_yaw = lidar, pose_xy, pose_yaw
        world = dataclasses.replace(world, obstacles=tall, movers=())
        most = float(self._slack(np.array(lidar.max_range)))
        self._obstacles = indexed_obstacles(world, most, max(most, SQUARE))

    def hits(self, pose: Pose, ranges: Floats) -> Hits:
        """Return the hits of a scan.

        Args:
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
        """
        beams = np.flatnonzero(np.isfinite(ranges) & (ranges <= self._lidar.max_range))
        points, explained = ends(self._lidar, pose, ranges, beams), np.empty(len(beams), dtype=np.bool_)
        _kernels_obstacles.points_within(points, self._slack(ranges[beams]), self._obstacles, explained)
        return Hits(beams, points, explained)

    def _slack(self, away: Floats) -> Floats:
        """Return how far hits at distances (N,) may lie from their obstacles (N,) [m]."""
        error = np.sqrt(self._lidar.sigma**2 + self._pose_xy**2 + (away * self._pose_yaw) ** 2)
        return np.asarray(SLACK + self._lidar.resolution / 2 + SIGMAS * error)


class MappedGround:
    """The occupancy map. It explains lasting hits, and hits on unknown ground.

    Attributes:
        complete: false

    Args:
        seen: the map of the earlier scans
        settle: scans after which a new object counts as standing
    """

    complete = False

    def __init__(self, seen: OccupancyMap, settle: int) -> None:
        self._seen, self._settle = seen, settle

    def hits(self, pose: Pose, ranges: Floats) -> Hits:
        """Return the hits of a scan.

        Args:
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
        """
        beams = np.flatnonzero(np.isfinite(ranges) & (ranges <= self._seen.horizon))
        points = np.ascontiguousarray(self._seen.endpoints(pose, ranges)[beams])
        return Hits(beams, points, self._seen.explained(points, self._settle))


def ends(lidar: Lidar, pose: Pose, ranges: Floats, beams: npt.NDArray[np.intp]) -> Floats:
    """Return the ends of some beams of a scan (N, 2) [m]."""
    x, y, yaw = lidar.pose_on(pose)
    angles = lidar.angles[beams] - lidar.yaw + yaw
    return np.column_stack((x + ranges[beams] * np.cos(angles), y + ranges[beams] * np.sin(angles)))


SKIN = kernels.SKIN
ROOM = 64  # initial capacity for tracks
ERROR = 0.01  # standard deviation of a measured centre, without the lidar's own [m]
PARTIAL = 3.0  # factor on the error of a partly hidden mover's centre
ACCELERATION = 3.0  # standard deviation of the movers' acceleration [m/s^2]


class TrackedMovers(NamedTuple):
    """Tracked movers.

    Attributes:
        positions: their centres (T, 2) [m]
        velocities: their velocities (T, 2) [m/s]
        radii: their radii (T,) [m]
        numbers: their track IDs (T,), in order of detection
        met: whether the last scan hit them (T,); if not, they are occluded and predicted
    """

    positions: Floats
    velocities: Floats
    radii: Floats
    numbers: npt.NDArray[np.int64]
    met: npt.NDArray[np.bool_]


class MoverTracker:
    """Mover tracker over the scans of one drive.

    Attributes:
        rules: the tracking rules, on a complete map (True) and on the robot's own (False)

    Args:
        lidar: the scanning lidar
        pose_xy: standard deviation of the estimated positions [m]
        pose_yaw: standard deviation of the estimated headings [rad]
    """

    def __init__(self, lidar: Lidar, pose_xy: float = 0.0, pose_yaw: float = 0.0) -> None:
        self._lidar = lidar
        measured = lidar.sigma**2 + lidar.resolution**2 / 12
        rules = kernels.TrackingRules(
            whole=ERROR**2 + measured,
            part=(PARTIAL * ERROR) ** 2 + measured,
            pose_xy=float(pose_xy) ** 2,
            pose_yaw=float(pose_yaw),
            spacing=lidar.spacing,
            first=float(lidar.angles[0]) - lidar.yaw,
            reach=float(lidar.max_range),
            rate=float(lidar.rate),
            closed=bool(lidar.full_circle),
            complete=True,
        )
        self.rules = {True: rules, False: rules._replace(complete=False)}
        self._tracks, self._count = np.zeros(ROOM, dtype=kernels.TRACK), 0
        self._time = -math.inf
        self._found = 0
        self._usual = np.array((rules.smallest, 0.0))
        self._now: TrackedMovers = _listed(self._tracks[:0], self._time)

    @property
    def tracks_begun(self) -> int:
        """Number of tracks begun so far."""
        return self._found

    def movers(self) -> TrackedMovers:
        """Return the confirmed movers at the time of the last scan."""
        return self._now

    def update(self, ground: Ground, pose: Pose, ranges: Floats, time: float) -> npt.NDArray[np.bool_]:
        """Update the tracks with a scan; return which beams hit tracked movers (beams,).

        A map can omit those beams (`OccupancyMap.insert`, `omitted`).

        Args:
            ground: the map before this scan
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
            time: time of the scan [s]; must increase from scan to scan
        """
        dt = time - self._time if math.isfinite(self._time) else 0.0
        self._time = time
        power = ACCELERATION * ACCELERATION
        kernels.predict(self._tracks, self._count, dt, power, power * dt**4 / 4, power * dt**3 / 2)
        hits = ground.hits(pose, ranges)
        points, explained = np.ascontiguousarray(hits.points), np.ascontiguousarray(hits.explained)
        owner = np.empty(len(points), dtype=np.int64)
        kernels.own(self._tracks, self._count, points, explained, owner)
        self._make_room(len(points))
        eye = np.array(self._lidar.pose_on(pose))
        view = kernels.View(points, hits.beams, explained, owner, np.ascontiguousarray(ranges), eye, float(time))
        self._count, self._found = kernels.read(
            view, self.rules[ground.complete], self._tracks, self._count, self._found, self._usual
        )
        tracks = self._tracks[: self._count]
        self._now = _listed(tracks[tracks["sure"] & (tracks["moves"] | ground.complete)], self._time)
        out, mine = np.zeros(len(ranges), dtype=np.bool_), np.empty(len(points), dtype=np.bool_)
        kernels.on_movers(points, self._now.positions, self._now.radii, mine)
        out[hits.beams[mine]] = True
        return out

    def suspected(self, ground: Ground, pose: Pose, ranges: Floats, time: float) -> npt.NDArray[np.bool_]:
        """Return which beams of an unprocessed scan may have hit a mover (beams,), so that scan matching omits them.

        Args:
            ground: the map before this scan; objects that it explains count only if seen to move
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
            time: time of the scan [s]
        """
        hits = ground.hits(pose, ranges)
        points, explained = np.ascontiguousarray(hits.points), np.ascontiguousarray(hits.explained)
        mine = np.empty(len(points), dtype=np.bool_)
        dt = time - self._time if self._count else 0.0
        kernels.suspects(self._tracks, self._count, dt, float(time), self.rules[True].settle, points, explained, mine)
        out = np.zeros(len(ranges), dtype=np.bool_)
        out[hits.beams[mine]] = True
        return out

    def _make_room(self, points: int) -> None:
        """Grow the track array to hold all tracks that a scan may start."""
        needed = self._count + points // self.rules[True].least + 1
        if needed > len(self._tracks):
            longer = np.zeros(2 * needed, dtype=kernels.TRACK)
            longer[: self._count] = self._tracks[: self._count]
            self._tracks = longer


def _listed(tracks: npt.NDArray[np.void], time: float) -> TrackedMovers:
    return TrackedMovers(
        np.column_stack((tracks["x"], tracks["y"])),
        np.column_stack((tracks["vx"], tracks["vy"])),
        tracks["radius"].copy(),
        tracks["number"].copy(),
        tracks["last"] == time,
    )
