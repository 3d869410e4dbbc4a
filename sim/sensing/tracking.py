"""Movers found in scans: points that the map does not explain, clustered, fitted with circles, and followed over time.

Each track is a Kalman filter with constant velocity (Y. Bar-Shalom, X. Li, T. Kirubarajan, *Estimation with Applications to
Tracking and Navigation*, 2001, chapter 6); clusters and tracks are matched nearest first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing import _kernels_tracking as kernels
from antdrive.sim.sensing.mapping import OccupancyMap
from antdrive.worlds import Floats, Pose
from antdrive.worlds.errors import require_positive

NEXT = 0.1  # neighbouring points so near belong to one surface [m]
SKIN = 0.06  # points so near to a mover's surface are its own [m]


class TrackedMovers(NamedTuple):
    """The movers that are followed now.

    Attributes:
        positions: their centres (T, 2) [m]
        velocities: their velocities (T, 2) [m/s]
        radii: their radii (T,) [m]
    """

    positions: Floats
    velocities: Floats
    radii: Floats


@dataclass(frozen=True, kw_only=True)
class TrackingPolicy:
    """How movers are found and followed.

    Attributes:
        gap: neighbouring points farther apart belong to different things [m]
        least: points that a cluster needs to begin a track
        settle: what has stood on once free ground for so long is part of the map [s]
        smallest: the least radius that is estimated [m]
        largest: the largest one [m]
        gate: a cluster farther from where a track is expected is not its own [m]
        speed: the highest speed that a mover is looked for with [m/s]; it widens the gate of a new track
        acceleration: standard deviation of the movers' acceleration [m/s^2]
        error: standard deviation of a measured centre [m]
        confirmed: in how many scans a mover has to be seen before it counts
        way: how far a mover has to have come before it counts [m]
        patience: for how long a track goes on without being seen [s]

    Raises:
        FieldError: a value that is not positive.
    """

    gap: float = 0.2
    least: int = 3
    settle: float = 2.0
    smallest: float = 0.05
    largest: float = 1.0
    gate: float = 0.4
    speed: float = 2.0
    acceleration: float = 1.5
    error: float = 0.02
    confirmed: int = 3
    way: float = 0.08
    patience: float = 1.0

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            require_positive(key, value)


@dataclass
class _Track:
    """One mover: mean and covariance of x, y, vx, vy, and its radius."""

    mean: Floats
    covariance: Floats
    radius: float
    seen: int
    last: float  # when it was last seen [s]
    first: Floats  # where it was seen first [m]
    moves: bool = False  # whether it has come far enough to be a mover


class MoverTracker:
    """Finds movers in the scans of one drive, and follows them.

    Attributes:
        policy: how movers are found and followed

    Args:
        lidar: the lidar whose scans are read
        policy: how movers are found and followed; None: as by default
    """

    def __init__(self, lidar: Lidar, policy: TrackingPolicy | None = None) -> None:
        self.policy = policy or TrackingPolicy()
        self._lidar = lidar
        self._settle = max(2, round(self.policy.settle * lidar.rate))
        self._tracks: list[_Track] = []
        self._time = -math.inf

    def update(self, seen: OccupancyMap, pose: Pose, ranges: Floats, time: float) -> npt.NDArray[np.bool_]:
        """Read a scan, before it is entered into the map; which beams met movers that are followed (beams,).

        Those beams can be left out of the map (`OccupancyMap.insert`, `left_out`).

        Args:
            seen: the map of the earlier scans
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
            time: when it was taken [s]; later than the scan before
        """
        self._predict(time)
        measured = np.flatnonzero(np.isfinite(ranges) & (ranges <= seen.horizon))
        points = seen.endpoints(pose, ranges)[measured]
        theirs = self._of_tracks(points)
        fresh = theirs | ~seen.explained(points, self._settle)
        self._match(points[fresh], measured[fresh], _continues(points, fresh), pose, time)
        self._tracks = [track for track in self._tracks if time - track.last <= self.policy.patience]
        out = np.zeros(len(ranges), dtype=np.bool_)
        out[measured[self._of_tracks(points)]] = True
        return out

    def movers(self) -> TrackedMovers:
        """The confirmed movers at the time of the last scan."""
        sure = [track for track in self._tracks if track.moves and track.seen >= self.policy.confirmed]
        means = np.array([track.mean for track in sure]).reshape(-1, 4)
        return TrackedMovers(means[:, :2].copy(), means[:, 2:].copy(), np.array([track.radius for track in sure]))

    def _predict(self, time: float) -> None:
        dt = time - self._time if math.isfinite(self._time) else 0.0
        self._time = time
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt
        spread = np.array([[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]]) * self.policy.acceleration**2
        for track in self._tracks:
            track.mean = step @ track.mean
            track.covariance = step @ track.covariance @ step.T + np.kron(spread, np.eye(2))

    def _of_tracks(self, points: Floats) -> npt.NDArray[np.bool_]:
        """Which points lie on or in confirmed movers."""
        movers = self.movers()
        if not len(movers.radii):
            return np.zeros(len(points), dtype=np.bool_)
        away = np.hypot(*(points[:, None, :] - movers.positions[None]).transpose(2, 0, 1))
        near: npt.NDArray[np.bool_] = np.any(away <= movers.radii + SKIN, axis=1)
        return near

    def _match(
        self, points: Floats, beams: npt.NDArray[np.intp], continues: npt.NDArray[np.bool_], pose: Pose, time: float
    ) -> None:
        policy, lidar = self.policy, self._lidar
        if not len(points):
            return
        x, y, _ = lidar.pose_on(pose)
        label = np.empty(len(points), dtype=np.int64)
        count = kernels.clusters(points, beams, lidar.beams, lidar.full_circle, policy.gap, label)
        found = kernels.found(points, label, count, policy.least, x, y, lidar.spacing, policy.smallest, policy.largest)
        pairs = [
            (math.hypot(row[0] - track.mean[0], row[1] - track.mean[1]), i, k)
            for i, row in enumerate(found)
            for k, track in enumerate(self._tracks)
        ]
        free_rows, free_tracks = set(range(len(found))), set(range(len(self._tracks)))
        for away, i, k in sorted(pairs):
            track = self._tracks[k]
            # A track that was seen once has no velocity yet.
            gate = policy.gate + (policy.speed * (time - track.last) if track.seen == 1 else 0.0)
            if away <= gate and i in free_rows and k in free_tracks:
                free_rows.remove(i)
                free_tracks.remove(k)
                self._correct(track, points[label == _label_of(i, label, policy.least)], found[i], (x, y), time)
        part_of_more = np.bincount(label, weights=continues) > 0
        for i in sorted(free_rows):
            if part_of_more[_label_of(i, label, policy.least)]:
                continue
            covariance = np.diag([policy.error**2] * 2 + [policy.speed**2 / 4] * 2)
            mean = np.array([found[i, 0], found[i, 1], 0.0, 0.0])
            self._tracks.append(_Track(mean, covariance, float(found[i, 2]), 1, time, mean[:2].copy()))

    def _correct(self, track: _Track, points: Floats, row: Floats, eye: tuple[float, float], time: float) -> None:
        """Take a cluster for the track's mover: its radius as the mean so far, its centre with that radius."""
        weight = 1 / min(track.seen + 1, 20)
        track.radius += weight * (float(row[2]) - track.radius)
        centre = np.empty(2)
        kernels.centre_of(np.ascontiguousarray(points), *eye, track.radius, centre)
        innovation = track.covariance[:2, :2] + np.eye(2) * self.policy.error**2
        gain = np.linalg.solve(innovation, track.covariance[:2]).T
        track.mean = track.mean + gain @ (centre - track.mean[:2])
        track.covariance = track.covariance - gain @ track.covariance[:2]
        track.seen += 1
        track.last = time
        track.moves = track.moves or math.dist(track.mean[:2], track.first) >= self.policy.way


def _continues(points: Floats, fresh: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Which of the fresh points continue a surface that is explained: more of it has come into sight."""
    places = np.flatnonzero(fresh)
    out = np.zeros(len(places), dtype=np.bool_)
    for side in (-1, 1):
        beside = (places + side) % max(1, len(points))
        out |= ~fresh[beside] & (np.hypot(*(points[beside] - points[places]).T) < NEXT)
    return out


def _label_of(row: int, label: npt.NDArray[np.int64], least: int) -> int:
    """The label of the cluster that a row of `found` describes: clusters with too few points have no row."""
    large = np.flatnonzero(np.bincount(label) >= least)
    return int(large[row])
