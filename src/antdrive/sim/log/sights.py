"""What the scans of a log say: which ground was seen, and when each obstacle and mover first was, from the true poses.

The log alone is read, and no map is made, so that none of this depends on where the robot believed to be.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import relative_frame, transform_points
from antdrive.base.types import Floats
from antdrive.robots.clearance import kernel_shape
from antdrive.robots.lidar import Lidar
from antdrive.sim.log import _kernels_sights as kernels
from antdrive.sim.log.record import finite_or_none
from antdrive.sim.log.rollout import Rollout, ranges_of

PASSED = 0.5  # the robot passed what its surface came this near to [m]
CELL = 0.1  # side of the cells in which seen ground is counted [m]
MOST_CELLS = 4_000_000  # of those; in a larger world they are larger
COUNTED_RATE = 10.0  # scans a second that seen ground is counted of [Hz]
ROUNDING = 0.0015  # of a range in a log, and what is left over [m]


class Beams(NamedTuple):
    """A scan as it lay in the world."""

    eye: Floats  # the lidar's true x, y [m] and yaw [rad] (3,)
    first: float  # the direction of the first beam, from the lidar's heading [rad]
    reaches: Floats  # how far each beam got (beams,) [m]: to what it met, or to the lidar's range


class Sighting(NamedTuple):
    """A cylinder or a mover, when it was first seen, and when the robot was nearest to it."""

    obstacle: int  # its place in `record.world.obstacles`; that of a mover in `record.world.movers`
    seen_at: float  # when a beam first met it [s]; infinite if none did
    seen_from: float  # how far its surface was from the footprint then [m]; not a number if it was never seen
    nearest_at: float  # when the robot was nearest [s]
    nearest: float  # how far the surface was from the footprint then [m]
    touched: bool  # whether the robot touched it, or a mover touched the robot
    mover: bool = False  # whether it is a mover
    # when the robot first followed a mover, as far as `tracks` tell [s]; infinite if it never did
    tracked_at: float = math.inf

    @property
    def passed(self) -> bool:
        """Whether it was touched, or the robot came within 0.5 m of it."""
        return self.touched or self.nearest <= PASSED

    @property
    def name(self) -> str:
        """What people call it."""
        return f"{'mover' if self.mover else 'obstacle'} {self.obstacle}"

    def as_dict(self) -> dict[str, Any]:
        """The sighting as plain values, for JSON; what never was is null."""
        return {
            "mover" if self.mover else "obstacle": self.obstacle,
            "seen_s": finite_or_none(self.seen_at),
            "seen_from_m": finite_or_none(self.seen_from),
            **({"followed_s": finite_or_none(self.tracked_at)} if self.mover else {}),
            "nearest_s": self.nearest_at,
            "nearest_m": self.nearest,
            "touched": self.touched,
        }


def lidar_of(rollout: Rollout) -> Lidar:
    """The lidar that took a log's scans."""
    lidar = rollout.record.robot.lidar
    if lidar is None or not len(rollout.scans):
        raise ValueError("the log has no scans")
    return lidar


def beams_of(rollout: Rollout, k: int) -> Beams:
    """A scan of a log where it was taken."""
    lidar, ranges = lidar_of(rollout), ranges_of(rollout.scans[k])
    reaches = np.where(np.isposinf(ranges), lidar.max_range, np.maximum(ranges, 0.0))
    x, y, yaw = rollout.pose[rollout.scan_rows[k]].tolist()
    return Beams(np.array(lidar.pose_on((x, y, yaw))), float(lidar.angles[0]) - lidar.yaw, reaches)


def meet(rollout: Rollout, k: int, met: Floats) -> None:
    """Note which cylinders a scan is the first to meet."""
    _meet(rollout, k, rollout.record.world.discs, met)


def _meet(rollout: Rollout, k: int, discs: Floats, met: Floats) -> None:
    """Note which discs (N, 3) a scan is the first to meet."""
    lidar, (eye, first, reaches) = lidar_of(rollout), beams_of(rollout, k)
    slack, now = 4 * lidar.sigma + lidar.resolution / 2 + ROUNDING, float(rollout.t[rollout.scan_rows[k]])
    kernels.first_meetings(eye, first, lidar.spacing, lidar.full_circle, reaches, discs, slack, now, met)


def first_meetings(rollout: Rollout) -> Floats:
    """When a beam first met each cylinder of `record.world.obstacles` (N,) [s]; infinite where none did."""
    met = np.full(len(rollout.record.world.obstacles), math.inf)
    for k in range(len(rollout.scans)):
        if np.isfinite(met).all():
            break
        meet(rollout, k, met)
    return met


def sightings(rollout: Rollout, met: Floats) -> list[Sighting]:
    """First sight and nearest approach of every cylinder, those that the robot came nearest to first."""
    touched = set(rollout.contacts[:, 1].astype(int).tolist())
    found = [
        _sighting(rollout, j, first, rollout.pose, disc, touched=j in touched)
        for j, (first, disc) in enumerate(zip(met.tolist(), rollout.record.world.discs, strict=True))
    ]
    return sorted(found, key=lambda sight: (not sight.touched, sight.nearest))


def mover_sightings(rollout: Rollout) -> list[Sighting]:
    """First sight and nearest approach of every mover, in the order of the world."""
    record, rows = rollout.record, rollout.scan_rows
    radii = np.array([mover.radius for mover in record.world.movers])
    met = np.full(len(radii), math.inf)
    for k, row in enumerate(rows.tolist()):
        _meet(rollout, k, np.column_stack((rollout.movers[row], radii)), met)
    touched = set((rollout.contacts[:, 1].astype(int) - len(record.world.obstacles)).tolist())
    found = []
    for j, (first, followed) in enumerate(zip(met.tolist(), tracked_rows(rollout), strict=True)):
        poses, disc = rollout.pose.copy(), np.array([0.0, 0.0, radii[j]])
        poses[:, :2] -= rollout.movers[:, j]  # as the mover sees the robot
        at = float(rollout.t[followed[0]]) if len(followed) else math.inf
        found.append(_sighting(rollout, j, first, poses, disc, touched=j in touched, mover=True, tracked_at=at))
    return found


def _sighting(rollout: Rollout, j: int, first: float, poses: Floats, disc: Floats, **more: Any) -> Sighting:
    """What is first met at a time [s], if the robot's poses (T, 3) are seen from where a disc (3,) has its place."""
    shape, row, away = kernel_shape(rollout.record.robot.footprint), np.zeros(1, dtype=np.int64), np.empty(1)

    def approach(some: Floats) -> tuple[int, float]:
        kernels.nearest_approaches(some, *shape, disc[None], row, away)
        return int(row[0]), float(away[0])

    nearest_row, nearest = approach(poses)
    seen_from = math.nan
    if math.isfinite(first):
        then = int(np.searchsorted(rollout.t, first - 1e-9))
        _, seen_from = approach(poses[then : then + 1])
    return Sighting(j, first, seen_from, float(rollout.t[nearest_row]), nearest, **more)


def tracked_rows(rollout: Rollout) -> list[npt.NDArray[np.int64]]:
    """The rows in which the middle of a track lay in each mover, in the order of the world.

    Tracks lie in the frame of the estimated pose, so they are laid as they lay from the robot.
    """
    rows = rollout.tracks[:, 0].astype(np.int64)
    believed, true = (rollout.estimate if len(rollout.estimate) else rollout.pose)[rows], rollout.pose[rows]
    places = transform_points(rollout.tracks[:, 2:4].astype(np.float64), relative_frame(believed, true))
    return [
        rows[np.hypot(*(places - rollout.movers[rows, j]).T) <= mover.radius]
        for j, mover in enumerate(rollout.record.world.movers)
    ]


def passed(rollout: Rollout) -> list[Sighting]:
    """What the robot touched or came within 0.5 m of, cylinders and movers, in the order in which it was nearest to them."""
    if not len(rollout.scans):
        return []
    everything = sightings(rollout, first_meetings(rollout)) + mover_sightings(rollout)
    return sorted(
        (sight for sight in everything if sight.passed),
        key=lambda sight: (sight.nearest_at, sight.mover, sight.obstacle),
    )


def seen_ground(rollout: Rollout) -> tuple[npt.NDArray[np.bool_], float]:
    """Which cells of the ground within the walls the lidar saw (rows, cols), from the lower left on, and their side [m].

    A cell was seen if the beam that was nearest to its middle in direction got farther than the middle. Ten scans a second
    count, and the last.
    """
    lidar = lidar_of(rollout)
    x0, y0, x1, y1 = rollout.record.world.bounds
    cell = max(CELL, math.sqrt((x1 - x0) * (y1 - y0) / MOST_CELLS))
    seen = np.zeros((math.ceil((y1 - y0) / cell - 1e-9), math.ceil((x1 - x0) / cell - 1e-9)), dtype=np.bool_)
    grid, last = np.array([x0, y0, cell]), len(rollout.scans) - 1
    for k in {*range(0, last + 1, max(1, round(lidar.rate / COUNTED_RATE))), last}:
        eye, first, reaches = beams_of(rollout, k)
        kernels.mark_seen(eye, first, lidar.spacing, lidar.full_circle, reaches, grid, seen)
    return seen, cell
