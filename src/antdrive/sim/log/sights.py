"""Visibility from a log's scans and true poses: observed ground, and the first sighting of obstacles and movers.

Only the log is read, without mapping, so results do not depend on the robot's estimates.
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
from antdrive.sim.log.rollout import Rollout, estimates_of, ranges_of

PASSED = 0.5  # the robot passes objects within this distance of its surface [m]
CELL = 0.1  # side of the cells of observed ground [m]
MOST_CELLS = 4_000_000  # cell limit; larger worlds get larger cells
COUNTED_RATE = 10.0  # rate to which scans for observed ground are thinned, by a whole number [Hz]
ROUNDING = 0.0015  # rounding of logged ranges, with a reserve [m]


class Beams(NamedTuple):
    """Scan in the world frame."""

    eye: Floats  # true pose of the lidar: x, y [m] and yaw [rad] (3,)
    first: float  # direction of the first beam relative to the lidar's heading [rad]
    reaches: Floats  # length of each beam (beams,) [m], up to a hit or the lidar's range


class Sighting(NamedTuple):
    """First sighting and nearest approach of a cylinder or mover."""

    obstacle: int  # index in `record.world.obstacles`, or for a mover in `record.world.movers`
    seen_at: float  # time of the first hit [s]; infinite if never hit
    seen_from: float  # distance of its surface from the footprint then [m]; nan if never hit
    nearest_at: float  # time of the nearest approach [s]
    nearest: float  # distance of its surface from the footprint then [m]
    touched: bool  # whether the robot touched it, or a mover the robot
    mover: bool = False  # whether it is a mover
    # time at which `tracks` first hold the mover [s]; infinite if never
    tracked_at: float = math.inf

    @property
    def passed(self) -> bool:
        """Whether it was touched, or the robot came within 0.5 m."""
        return self.touched or self.nearest <= PASSED

    @property
    def name(self) -> str:
        """Name in messages."""
        return f"{'mover' if self.mover else 'obstacle'} {self.obstacle}"

    def as_dict(self) -> dict[str, Any]:
        """Return the sighting as plain values, for JSON; infinite values are null."""
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
    """Return the lidar of a log's scans."""
    lidar = rollout.record.robot.lidar
    if lidar is None or not len(rollout.scans):
        raise ValueError("the log has no scans")
    return lidar


def beams_of(rollout: Rollout, k: int) -> Beams:
    """Return a scan of a log in the world frame."""
    lidar, ranges = lidar_of(rollout), ranges_of(rollout.scans[k])
    reaches = np.where(np.isposinf(ranges), lidar.max_range, np.maximum(ranges, 0.0))
    x, y, yaw = rollout.pose[rollout.scan_rows[k]].tolist()
    return Beams(np.array(lidar.pose_on((x, y, yaw))), float(lidar.angles[0]) - lidar.yaw, reaches)


def meet(rollout: Rollout, k: int, met: Floats, movers: Floats | None = None) -> None:
    """Note the cylinders, or the discs of movers (M, 3), that a scan hits for the first time."""
    discs = rollout.record.world.discs if movers is None else movers
    lidar, (eye, first, reaches) = lidar_of(rollout), beams_of(rollout, k)
    slack, now = 4 * lidar.sigma + lidar.resolution / 2 + ROUNDING, float(rollout.t[rollout.scan_rows[k]])
    kernels.first_meetings(eye, first, lidar.spacing, lidar.full_circle, reaches, discs, slack, now, met)


def first_meetings(rollout: Rollout) -> Floats:
    """Return the first hit of each cylinder of `record.world.obstacles` (N,) [s]; infinite where there is none."""
    met = np.full(len(rollout.record.world.obstacles), math.inf)
    for k in range(len(rollout.scans)):
        if np.isfinite(met).all():
            break
        meet(rollout, k, met)
    return met


def seen_at(rollout: Rollout) -> list[float | None]:
    """Return the first hit of each cylinder, then of each mover [s]; None where there is none."""
    movers = [sight.seen_at for sight in mover_sightings(rollout)] if rollout.record.world.movers else []
    return [finite_or_none(at) for at in [*first_meetings(rollout).tolist(), *movers]]


def sightings(rollout: Rollout, met: Floats) -> list[Sighting]:
    """Return the sightings of all cylinders, nearest first."""
    touched = set(rollout.contacts[:, 1].astype(int).tolist())
    cylinders = [
        _sighting(rollout, j, first, rollout.pose, disc, touched=j in touched)
        for j, (first, disc) in enumerate(zip(met.tolist(), rollout.record.world.discs, strict=True))
    ]
    return sorted(cylinders, key=lambda sight: (not sight.touched, sight.nearest))


def mover_sightings(rollout: Rollout) -> list[Sighting]:
    """Return the sightings of all movers, in the order of the world."""
    record, rows = rollout.record, rollout.scan_rows
    radii = np.array([mover.radius for mover in record.world.movers])
    met = np.full(len(radii), math.inf)
    for k, row in enumerate(rows.tolist()):
        meet(rollout, k, met, np.column_stack((rollout.movers[row], radii)))
    touched = set((rollout.contacts[:, 1].astype(int) - len(record.world.obstacles)).tolist())
    movers = []
    for j, (first, followed) in enumerate(zip(met.tolist(), tracked_rows(rollout), strict=True)):
        poses, disc = rollout.pose.copy(), np.array([0.0, 0.0, radii[j]])
        poses[:, :2] -= rollout.movers[:, j]  # relative to the mover
        at = float(rollout.t[followed[0]]) if len(followed) else math.inf
        movers.append(_sighting(rollout, j, first, poses, disc, touched=j in touched, mover=True, tracked_at=at))
    return movers


def _sighting(rollout: Rollout, j: int, first: float, poses: Floats, disc: Floats, **more: Any) -> Sighting:
    """Return a sighting, first hit at `first` [s], from the robot's poses (T, 3) relative to a disc (3,)."""
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
    """Return the rows with a track centred in each mover, in the order of the world.

    Tracks lie in the frame of the estimates and are transformed to the true poses.
    """
    rows = rollout.tracks[:, 0].astype(np.int64)
    believed, true = estimates_of(rollout)[rows], rollout.pose[rows]
    places = transform_points(rollout.tracks[:, 2:4].astype(np.float64), relative_frame(believed, true))
    return [
        rows[np.hypot(*(places - rollout.movers[rows, j]).T) <= mover.radius]
        for j, mover in enumerate(rollout.record.world.movers)
    ]


def passed(rollout: Rollout) -> list[Sighting]:
    """Return the sightings of touched or passed cylinders and movers, in the order of nearest approach."""
    if not len(rollout.scans):
        return []
    everything = sightings(rollout, first_meetings(rollout)) + mover_sightings(rollout)
    return sorted(
        (sight for sight in everything if sight.passed),
        key=lambda sight: (sight.nearest_at, sight.mover, sight.obstacle),
    )


def seen_ground(rollout: Rollout) -> tuple[npt.NDArray[np.bool_], float]:
    """Return the cells within the walls that the lidar observed (rows, cols), from the lower left, and their side [m].

    A cell is observed if the beam nearest to its centre in direction reached beyond the centre. The metric `explored_m2` defines
    the cells and the scans that count.
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
