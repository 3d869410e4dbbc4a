"""Movers found in scans: points that what stands still does not explain, clustered, fitted with circles, followed over time.

Each track is a Kalman filter with constant velocity (Y. Bar-Shalom, X. Li, T. Kirubarajan, *Estimation with Applications to
Tracking and Navigation*, 2001, chapter 6). A cluster in which several tracks expect points is shared out among them, so that
movers which pass each other keep their tracks; other clusters and tracks are matched nearest first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing import _kernels_tracking as kernels
from antdrive.sim.sensing.ground import Ground, Hits, ends
from antdrive.worlds import Floats, Pose
from antdrive.worlds.errors import FieldError, require_positive

SKIN = 0.06  # points so near to a mover's surface are its own, whatever else may explain them [m]
CLAIM = 0.1  # a track expects its points within this of its surface, and the error of its position [m]
CLAIM_MOST = 0.4  # but no farther away than this [m]
MATURE = 5  # a radius that was seen so often is known: what else is in a cluster belongs to something else
ROUND = 0.03  # a cluster is round if it lies so near to a circle [m]
CROOKED = 0.15  # and it is no part of a mover if it is farther off any [m]
FRESH = 1 / 3  # this share of a mover lies on ground that was seen free, before it counts on a map of the robot's own
ALL_FRESH = 0.9  # and this share of it, all the way, where only a part of it is seen
FARTHER = 3.0  # such a part has to have come so many times as far
FASTER = 0.3  # and to be faster than this [m/s]
OFTEN = 0.25  # and to have been seen in this share of the scans
ALIKE = 0.2  # and its radius, unless it was seen from edge to edge, to differ from the usual one by this share at most
PARTIAL = 3.0  # the centre of a mover that is partly hidden has so many times the error
THROUGH = 3  # a track through which the beams have passed in so many scans is gone
SURE = 0.4  # a track counts once its velocity is known so well, as a standard deviation [m/s]
SLOW = 0.1  # what is slower has stopped [m/s]
Indices = npt.NDArray[np.intp]


class TrackedMovers(NamedTuple):
    """The movers that are followed now.

    Attributes:
        positions: their centres (T, 2) [m]
        velocities: their velocities (T, 2) [m/s]
        radii: their radii (T,) [m]
        numbers: their numbers (T,), in the order in which they were found; a number is never used again
    """

    positions: Floats
    velocities: Floats
    radii: Floats
    numbers: npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class TrackingPolicy:
    """How movers are found and followed.

    Attributes:
        gap: neighbouring points farther apart belong to different things [m]
        least: points that a cluster needs to begin a track
        settle: what has stood on once free ground for so long is part of a map of the robot's own [s]
        smallest: the least radius that is estimated [m]
        largest: the largest one [m]
        gate: a cluster farther from where a track is expected is not its own [m]
        speed: the highest speed that a mover is looked for with [m/s]; it widens the gate of a new track
        acceleration: standard deviation of the movers' acceleration [m/s^2]
        error: standard deviation of a measured centre [m]
        confirmed: in how many scans a mover has to be seen before it counts
        way: how far a mover has to have come before it counts [m]; on a given map it need not have moved
        patience: for how long a track goes on while it is hidden [s]
        doubt: the same for one that does not count yet [s]

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
    acceleration: float = 3.0
    error: float = 0.02
    confirmed: int = 3
    way: float = 0.12
    patience: float = 3.0
    doubt: float = 0.5

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            require_positive(key, value)
        if not self.smallest <= self.largest:
            raise FieldError("smallest", f"must be at most largest, {self.largest:g}, got {self.smallest:g}")


@dataclass
class _Track:
    """One mover. Both coordinates have the same variances, so there is one 2x2 covariance of a place and its speed."""

    number: int
    x: float
    y: float
    radius: float
    begun: float  # when it was first seen [s]
    last: float  # when it was last measured [s]
    variance: float  # of a coordinate [m^2]
    vx: float = 0.0
    vy: float = 0.0
    mixed: float = 0.0  # covariance of a coordinate and its velocity [m^2/s]
    spread: float = 1.0  # variance of a velocity [m^2/s^2]
    seen: int = 1
    views: int = 0  # how often it was seen from edge to edge
    weight: float = 0.0  # of the views of its radius
    through: int = 0  # in how many scans in a row beams have passed where it should be
    sure: bool = False  # whether it was seen so often, and its velocity was known so well, that it counts
    moves: bool = False  # whether it has come far enough to be a mover
    rested: float = 0.0  # since when it has been where it stands [s]
    anchor: tuple[float, float] = field(default=(0.0, 0.0))  # where that is, or where it was first seen [m]
    free_from: tuple[float, float] = field(
        default=(0.0, 0.0)
    )  # since when all of it stands on ground that was free [m]

    def predict(self, dt: float, acceleration: float) -> None:
        """Go on at constant velocity."""
        self.x += dt * self.vx
        self.y += dt * self.vy
        power = acceleration * acceleration
        self.variance += dt * (2 * self.mixed + dt * self.spread) + power * dt**4 / 4
        self.mixed += dt * self.spread + power * dt**3 / 2
        self.spread += power * dt * dt

    def correct(self, x: float, y: float, variance: float) -> None:
        """Take a measured centre into account."""
        total = self.variance + variance
        gain, speeds = self.variance / total, self.mixed / total
        dx, dy = x - self.x, y - self.y
        self.x, self.y = self.x + gain * dx, self.y + gain * dy
        self.vx, self.vy = self.vx + speeds * dx, self.vy + speeds * dy
        self.spread -= speeds * self.mixed
        self.mixed *= 1 - gain
        self.variance *= 1 - gain


class _View(NamedTuple):
    """A scan that is being read."""

    hits: Hits
    ranges: Floats
    eye: Pose
    time: float
    owner: npt.NDArray[np.int64]  # which track, by its place in the list, expects each point; -1 where none does


class MoverTracker:
    """Finds movers in the scans of one drive, and follows them.

    Attributes:
        policy: how movers are found and followed

    Args:
        lidar: the lidar whose scans are read
        policy: how movers are found and followed; None: as by default
        pose_xy: standard deviation of the estimated positions at which scans are taken [m]
        pose_yaw: and of the headings [rad]
    """

    def __init__(
        self, lidar: Lidar, policy: TrackingPolicy | None = None, pose_xy: float = 0.0, pose_yaw: float = 0.0
    ) -> None:
        self.policy = policy or TrackingPolicy()
        self._lidar, self._pose_xy, self._pose_yaw = lidar, pose_xy, pose_yaw
        self._first = float(lidar.angles[0]) - lidar.yaw
        self._tracks: list[_Track] = []
        self._time = -math.inf
        self._found = 0
        self._usual, self._usual_weight = self.policy.smallest, 0.0
        self._now: TrackedMovers = _listed([])

    @property
    def found(self) -> int:
        """How many tracks were begun so far."""
        return self._found

    def movers(self) -> TrackedMovers:
        """The movers that count, at the time of the last scan."""
        return self._now

    def update(self, ground: Ground, pose: Pose, ranges: Floats, time: float) -> npt.NDArray[np.bool_]:
        """Read a scan; which beams met movers that are followed (beams,).

        Those beams can be left out of a map (`OccupancyMap.insert`, `left_out`).

        Args:
            ground: what stands still, as known before this scan
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
            time: when it was taken [s]; later than the scan before
        """
        dt = time - self._time if math.isfinite(self._time) else 0.0
        self._time = time
        for track in self._tracks:
            track.predict(dt, self.policy.acceleration)
        hits = ground.hits(pose, ranges)
        view = _View(hits, ranges, self._lidar.pose_on(pose), time, self._owners(hits))
        rest: list[Indices] = []
        for cluster in self._clusters(view, ~hits.explained if ground.complete else np.ones_like(hits.explained)):
            rest += self._share_out(cluster, view, ground.complete)
        self._begin_or_match(rest, view, ground.complete)
        self._tracks = [track for track in self._tracks if self._goes_on(track, view)]
        self._now = _listed([track for track in self._tracks if self._counts(track, ground.complete)])
        out = np.zeros(len(ranges), dtype=np.bool_)
        out[hits.beams[self._on_movers(hits.points)]] = True
        return out

    def suspected(self, pose: Pose, ranges: Floats, time: float) -> npt.NDArray[np.bool_]:
        """Which beams of a scan that was not read yet may have met something that moves (beams,): no marks to steer by.

        Args:
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
            time: when it was taken [s]
        """
        policy, dt = self.policy, time - self._time
        rows = [
            (track.x + dt * track.vx, track.y + dt * track.vy, track.radius + CLAIM + 2 * math.sqrt(track.variance))
            for track in self._tracks
            if track.moves or time - track.begun < policy.settle / 2 or math.hypot(track.vx, track.vy) > SLOW
        ]
        out = np.zeros(len(ranges), dtype=np.bool_)
        measured = np.flatnonzero(np.isfinite(ranges))
        points = ends(self._lidar, pose, ranges, measured)
        for x, y, reach in rows:
            out[measured] |= np.hypot(points[:, 0] - x, points[:, 1] - y) <= reach
        return out

    # ---- points and tracks

    def _owners(self, hits: Hits) -> npt.NDArray[np.int64]:
        """The track that expects each point on its surface, the nearest first; -1 where none does."""
        owner = np.full(len(hits.points), -1)
        if not self._tracks or not len(owner):
            return owner
        places = np.array([(track.x, track.y) for track in self._tracks])
        radii = np.array([track.radius for track in self._tracks])
        reach = np.array([min(CLAIM_MOST, CLAIM + 2 * math.sqrt(track.variance)) for track in self._tracks])
        sure = np.array([track.moves and track.sure for track in self._tracks])
        off = np.abs(np.hypot(*(hits.points[:, None] - places).transpose(2, 0, 1)) - radii)
        # What stands still explains other points too well to give them to a track that only passes.
        allowed = np.where(hits.explained[:, None], np.where(sure, SKIN, -1.0), reach)
        off = np.where(off <= allowed, off, np.inf)
        nearest = off.argmin(axis=1)
        return np.where(np.isfinite(off.min(axis=1)), nearest, -1)

    def _clusters(self, view: _View, used: npt.NDArray[np.bool_]) -> Iterator[Indices]:
        """The clusters of the points that are used, as indices of points."""
        chosen = np.flatnonzero(used)
        if not len(chosen):
            return
        label = np.empty(len(chosen), dtype=np.int64)
        points, beams = np.ascontiguousarray(view.hits.points[chosen]), view.hits.beams[chosen]
        lidar = self._lidar
        kernels.clusters(points, beams, lidar.beams, lidar.full_circle, self.policy.gap, label)
        order = np.argsort(label, kind="stable")
        yield from np.split(chosen[order], np.flatnonzero(np.diff(label[order])) + 1)

    def _share_out(self, cluster: Indices, view: _View, complete: bool) -> list[Indices]:
        """Correct the tracks that expect points in a cluster; the clusters that are left."""
        owner = view.owner[cluster]
        owners = np.unique(owner[owner >= 0]).tolist()
        if not owners:
            return [cluster] if len(cluster) >= self.policy.least else []
        if len(owners) == 1 and self._tracks[owners[0]].views < MATURE:
            if not complete:
                cluster = cluster[~view.hits.explained[cluster] | (owner >= 0)]
            self._correct(self._tracks[owners[0]], cluster, view, complete)
            return []
        for k in owners:
            self._correct(self._tracks[k], cluster[owner == k], view, complete)
        left = cluster[(owner < 0) & ~view.hits.explained[cluster]]
        return [left] if len(owners) == 1 and len(left) >= self.policy.least else []

    def _begin_or_match(self, clusters: list[Indices], view: _View, complete: bool) -> None:
        """Match clusters in which no track expects points with tracks that were not measured, and begin new tracks."""
        policy = self.policy
        idle = [track for track in self._tracks if track.last < view.time]
        circles = [self._circle(cluster, view) for cluster in clusters]
        pairs = sorted(
            (math.hypot(circle[0] - track.x, circle[1] - track.y), i, k)
            for i, circle in enumerate(circles)
            for k, track in enumerate(idle)
        )
        rows, tracks = set(range(len(clusters))), set(range(len(idle)))
        for away, i, k in pairs:
            # A track that was seen once has no velocity yet.
            gate = policy.gate + (policy.speed * (view.time - idle[k].last) if idle[k].seen == 1 else 0.0)
            if away <= gate and i in rows and k in tracks:
                rows.remove(i)
                tracks.remove(k)
                self._correct(idle[k], clusters[i], view, complete)
        for i in sorted(rows):
            if complete or self._may_begin(clusters[i], circles[i], view):
                self._begin(clusters[i], circles[i], view)

    def _may_begin(self, cluster: Indices, circle: tuple[float, float, float, float], view: _View) -> bool:
        """Whether a cluster may be a mover, or a part of one, where the ground is not known."""
        points = view.hits.points[cluster]
        return float(np.ptp(points, axis=0).max()) <= 2 * self.policy.largest and circle[3] <= CROOKED

    def _begin(self, cluster: Indices, circle: tuple[float, float, float, float], view: _View) -> None:
        x, y, radius, _ = circle
        whole = self._whole(cluster, view)
        if not whole and self._usual > radius:  # as large as the others, as long as only a part of it is seen
            radius = self._usual
            x, y = self._centre(cluster, view, radius)
        error = self._error(x, y, view, whole)
        track = _Track(self._found, x, y, radius, view.time, view.time, error**2, spread=self.policy.speed**2 / 4)
        track.rested, track.anchor, track.free_from = view.time, (x, y), (x, y)
        self._tracks.append(track)
        self._found += 1

    # ---- one cluster

    def _circle(self, cluster: Indices, view: _View) -> tuple[float, float, float, float]:
        """The circle through a cluster: x, y, radius, and how far its points lie off it [m]."""
        x, y, _ = view.eye
        points = np.ascontiguousarray(view.hits.points[cluster])
        seen = kernels.visible_radius(points, x, y, self._lidar.spacing)
        radius = min(max(seen, self.policy.smallest), self.policy.largest)
        cx, cy = self._centre(cluster, view, radius)
        off = np.hypot(points[:, 0] - cx, points[:, 1] - cy) - radius
        return cx, cy, radius, float(np.sqrt(np.mean(off * off)))

    def _centre(self, cluster: Indices, view: _View, radius: float) -> tuple[float, float]:
        out = np.empty(2)
        kernels.centre_of(np.ascontiguousarray(view.hits.points[cluster]), *view.eye[:2], radius, out)
        return float(out[0]), float(out[1])

    def _whole(self, cluster: Indices, view: _View) -> bool:
        """Whether a cluster is seen from edge to edge: the beams beside it got clearly farther, so nothing goes on there."""
        beams, lidar = view.hits.beams[cluster], self._lidar
        for edge, side in ((beams[0], -1), (beams[-1], 1)):
            beside = int(edge) + side
            if lidar.full_circle:
                beside %= lidar.beams
            elif not 0 <= beside < lidar.beams:
                return False
            if view.ranges[beside] < view.ranges[edge] + self.policy.gap / 2:
                return False
        return True

    def _error(self, x: float, y: float, view: _View, whole: bool) -> float:
        """The standard deviation of a measured centre [m]."""
        away = math.hypot(x - view.eye[0], y - view.eye[1])
        own = self.policy.error * (1.0 if whole else PARTIAL)
        return math.sqrt(own**2 + self._pose_xy**2 + (away * self._pose_yaw) ** 2)

    def _correct(self, track: _Track, cluster: Indices, view: _View, complete: bool) -> None:
        """Take a cluster for the track's mover: its radius as the mean so far, its centre with that radius."""
        if len(cluster) < 2:
            return
        whole = len(cluster) >= self.policy.least and self._whole(cluster, view)
        *_, seen, off = self._circle(cluster, view)
        if whole:
            weight = float(len(cluster)) ** 2  # the more beams, the more exact
            track.weight = min(track.weight + weight, 20 * weight)
            start = seen if track.views == 0 else track.radius
            track.radius = start + (seen - start) * weight / track.weight
            track.views += 1
            self._usual_weight = min(self._usual_weight + weight, 1e6)
            self._usual += (seen - self._usual) * weight / self._usual_weight
        elif track.views == 0:
            track.radius = max(track.radius, seen)
        x, y = self._centre(cluster, view, track.radius)
        if math.hypot(x - track.x, y - track.y) > CLAIM_MOST + self.policy.gate:
            return
        track.correct(x, y, self._error(x, y, view, whole) ** 2)
        track.seen += 1
        track.sure = track.sure or (track.seen >= self.policy.confirmed and track.spread < SURE**2)
        track.last = view.time
        track.through = 0
        if not complete:
            self._judge(track, cluster, view, whole and off <= ROUND and seen < 0.8 * self.policy.largest)

    def _judge(self, track: _Track, cluster: Indices, view: _View, round_: bool) -> None:
        """Whether a track moves, on a map that is being made: what stood at first, or has stood for long, is part of it."""
        fresh = float(np.mean(~view.hits.explained[cluster]))
        if fresh < ALL_FRESH or not track.sure:
            track.free_from = (track.x, track.y)
        if track.views < self.policy.confirmed:  # a part of something seems to move as more of it comes into sight
            track.rested, track.anchor = view.time, (track.x, track.y)
        away = math.dist((track.x, track.y), track.anchor)
        if not track.moves:
            track.moves = (away >= self.policy.way and round_ and fresh >= FRESH) or self._crosses(track, cluster, view)
        if track.moves:
            if away >= self.policy.way or math.hypot(track.vx, track.vy) > SLOW:
                track.rested, track.anchor = view.time, (track.x, track.y)
            elif view.time - track.rested > self.policy.settle:
                track.moves = False

    def _crosses(self, track: _Track, cluster: Indices, view: _View) -> bool:
        """Whether a track of which perhaps only a part is seen has gone a long way over ground that was seen free.

        Things that stand, seen through gaps between others, seem to move. So what is seen has to be a good part of a circle
        of the track's size, and that size to be known: from views from edge to edge of it, or of other movers like it.
        """
        policy = self.policy
        came, due = math.dist((track.x, track.y), track.free_from), (view.time - track.begun) * self._lidar.rate
        if came < FARTHER * policy.way or math.hypot(track.vx, track.vy) < FASTER or track.seen < OFTEN * due:
            return False
        if track.views == 0 and abs(track.radius - self._usual) > ALIKE * self._usual:
            return False
        points = view.hits.points[cluster]
        wide = float(np.ptp(points, axis=0).max())
        if len(cluster) < 2 * policy.least or wide < track.radius / 2 or track.radius >= 0.8 * policy.largest:
            return False
        off = np.hypot(*(points - self._centre(cluster, view, track.radius)).T) - track.radius
        return float(np.sqrt(np.mean(off * off))) <= (ROUND if track.views else ROUND / 2)

    # ---- which tracks count, and for how long

    def _goes_on(self, track: _Track, view: _View) -> bool:
        if track.last == view.time:
            return True
        if view.time - track.last > (self.policy.patience if track.sure else self.policy.doubt):
            return False
        track.through = track.through + 1 if self._seen_through(track, view) else 0
        return track.through < (THROUGH if track.sure else 1)

    def _seen_through(self, track: _Track, view: _View) -> bool:
        """Whether beams have passed where the track should be."""
        x, y, yaw = view.eye
        away = math.hypot(track.x - x, track.y - y)
        if away <= track.radius:
            return False
        lidar = self._lidar
        half = math.asin(0.5 * track.radius / away) / lidar.spacing
        middle = math.remainder(math.atan2(track.y - y, track.x - x) - yaw, 2 * math.pi) - self._first
        beams = np.arange(math.ceil(middle / lidar.spacing - half), math.floor(middle / lidar.spacing + half) + 1)
        beams = beams % lidar.beams if lidar.full_circle else beams[(beams >= 0) & (beams < lidar.beams)]
        return len(beams) > 0 and away < lidar.max_range and bool(np.mean(view.ranges[beams] > away) > 0.5)

    def _counts(self, track: _Track, complete: bool) -> bool:
        return track.sure and (complete or track.moves)

    def _on_movers(self, points: Floats) -> npt.NDArray[np.bool_]:
        """Which points lie on or in movers that count."""
        movers = self._now
        if not len(movers.radii) or not len(points):
            return np.zeros(len(points), dtype=np.bool_)
        away = np.hypot(*(points[:, None, :] - movers.positions[None]).transpose(2, 0, 1))
        near: npt.NDArray[np.bool_] = np.any(away <= movers.radii + SKIN, axis=1)
        return near


def _listed(tracks: list[_Track]) -> TrackedMovers:
    return TrackedMovers(
        np.array([(track.x, track.y) for track in tracks]).reshape(-1, 2),
        np.array([(track.vx, track.vy) for track in tracks]).reshape(-1, 2),
        np.array([track.radius for track in tracks], dtype=np.float64),
        np.array([track.number for track in tracks], dtype=np.int64),
    )
