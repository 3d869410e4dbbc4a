"""The map that a robot makes of its scans: where ground was seen free, and what was hit, as discs.

H. Moravec, A. Elfes, *High resolution maps from wide angle sonar*, 1985; S. Thrun, W. Burgard, D. Fox, *Probabilistic
Robotics*, 2005, chapter 9; log-odds with limits after A. Hornung et al., *OctoMap*, 2013. Only cells on the beams of a scan
are touched, so a scan costs the same however large the map is.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing import _kernels_mapping as kernels
from antdrive.worlds import Bounds, Floats, Point, Pose
from antdrive.worlds.errors import require_positive

Cells = npt.NDArray[np.int32]
Mask = npt.NDArray[np.bool_]

BLOCK = 64  # a map grows by multiples of so many cells
OFTEN = 12.5  # how often the free way of a beam is entered, where the lidar's rate allows [Hz]
ROOM = 1.0  # how far beyond its horizon a map that grows is laid out at first [m]


class OccupancyMap:
    """What a robot has seen so far, in the frame of its odometry.

    A cell is unknown, seen free, or occupied. It is seen free once a beam has passed it, as far as beams lie no farther apart
    than a cell is wide; a thing thinner than that may stand between two of them. A single hit makes a cell occupied, and it
    is free again when the beams on both sides of its hits have ended beyond them: at the ninth time, for what was hit often.

    Attributes:
        cell: side of a cell [m]
        horizon: hits farther than this are not entered [m]
        trust: ground is seen free up to this distance [m]
        scans: number of scans entered
        share: of every scan the free ways of every `share`-th beam are entered
        layouts: how often the map was laid out; cells have other numbers after it has grown

    Args:
        lidar: the lidar whose scans are entered
        cell: side of a cell [m]
        centre: where the robot starts, in the frame of the map [m]
        horizon: hits farther than this are not entered [m]
        bounds: the ground that the map covers, for good; None: it grows as needed [m]
        share: of every scan the free ways of every `share`-th beam are entered, in turn, and all hits; None: so many that
            each beam has its turn about 12 times a second
    """

    def __init__(
        self,
        lidar: Lidar,
        cell: float = 0.05,
        centre: Point = (0.0, 0.0),
        horizon: float = 10.0,
        bounds: Bounds | None = None,
        share: int | None = None,
    ) -> None:
        self.share = max(1, round(lidar.rate / OFTEN)) if share is None else share
        require_positive("cell", cell)
        require_positive("horizon", horizon)
        self.cell, self.horizon = cell, min(horizon, lidar.max_range)
        self.trust = min(self.horizon, cell / lidar.spacing)
        self.scans = self.layouts = 0
        self._lidar, self._grows = lidar, bounds is None
        angles = lidar.angles - lidar.yaw
        self._beams = np.column_stack((np.cos(angles), np.sin(angles)))
        self._first = float(angles[0])
        self._begin = np.empty(lidar.beams)
        kernels.begins(lidar.beams, lidar.spacing, cell, self.share, self._begin)
        self._none = np.zeros(lidar.beams, dtype=np.bool_)
        half = self.horizon + ROOM
        x, y = centre
        self._lay_out(bounds or (x - half, y - half, x + half, y + half))

    @property
    def origin(self) -> Point:
        """The lower left corner of cell (0, 0) [m]."""
        return float(self._arrays.frame[0]), float(self._arrays.frame[1])

    @property
    def occupied(self) -> Mask:
        """Which cells hold hits (rows, cols); rows along +y. A live view, to be read only."""
        return _read_only(self._arrays.occupied)

    @property
    def seen_free(self) -> Mask:
        """Which cells were seen free and are not occupied (rows, cols). A live view, to be read only."""
        return _read_only(self._arrays.free)

    @property
    def arrays(self) -> kernels.MapArrays:
        """The arrays of the map, for kernels."""
        return self._arrays

    def insert(self, pose: Pose, ranges: Floats, left_out: Mask | None = None) -> Cells:
        """Enter a scan, and return the cells that became free, occupied, or free again (K, 2): row, col.

        Args:
            pose: the estimated pose of the robot, not of its lidar
            ranges: the scan (beams,) [m]
            left_out: beams whose hits are not entered, such as those of movers (beams,)
        """
        eye = np.array(self._lidar.pose_on(pose))
        if self._grows:
            self._make_room(eye[0], eye[1])
        self.scans += 1
        mask = self._none if left_out is None else np.ascontiguousarray(left_out)
        lidar = self._lidar
        fan = kernels.Fan(eye, self._beams, ranges, self._first, lidar.spacing, lidar.full_circle)
        count = kernels.insert(
            fan, self._begin, self.share, mask, self.horizon, self.trust, self.scans, self._arrays, self._changed
        )
        return self._changed[:count].copy()

    def endpoints(self, pose: Pose, ranges: Floats) -> Floats:
        """Where the beams end (beams, 2) [m]; not a number where they hit nothing that can be measured.

        Args:
            pose: the estimated pose of the robot
            ranges: the scan (beams,) [m]
        """
        x, y, yaw = self._lidar.pose_on(pose)
        cos, sin = math.cos(yaw), math.sin(yaw)
        measured = np.where(np.isfinite(ranges), ranges, np.nan)[:, None]
        turned = self._beams @ np.array([[cos, sin], [-sin, cos]])
        return np.asarray(measured * turned + (x, y), dtype=np.float64)

    def explained(self, points: Floats, settle: int) -> Mask:
        """Whether points belong to what stands still (N,): they lie in or beside cells that have long been occupied.

        Points on ground that had been seen free until less than `settle` scans ago do not, whether or not their scan has been
        entered.

        Args:
            points: places (N, 2) [m]
            settle: after how many scans what has come counts as standing
        """
        out = np.empty(len(points), dtype=np.bool_)
        kernels.explained(np.ascontiguousarray(points), self.scans, settle, self._arrays, out)
        return out

    def discs(self) -> Floats:
        """Discs around all hits (D, 3): x, y, radius [m]. Every point that was entered and not seen through lies in one."""
        return kernels.discs_of(self._arrays)  # type: ignore[no-any-return]

    def forget(self, place: Point, radius: float) -> Cells:
        """Take what was hit around a place for free ground, and return the cells (K, 2): a mover has gone on.

        Args:
            place: x, y [m]
            radius: how far around it [m]
        """
        count = kernels.forget(*place, radius, self._arrays, self._changed)
        return self._changed[:count].copy()

    def take_as_free(self, place: Point, radius: float) -> Cells:
        """Take unknown ground for free, such as that under the robot, and return the cells (K, 2).

        Args:
            place: x, y [m]
            radius: how far around it [m]
        """
        count = kernels.take_as_free(*place, radius, self._arrays, self._changed)
        return self._changed[:count].copy()

    def _make_room(self, x: float, y: float) -> None:
        """Grow where the horizon around the lidar would leave the map."""
        x0, y0 = self.origin
        rows, cols = self._arrays.free.shape
        need = (x - self.horizon - x0, y - self.horizon - y0, x0 + cols * self.cell - x, y0 + rows * self.cell - y)
        if need[0] >= 0 and need[1] >= 0 and min(need[2:]) >= self.horizon:
            return
        west, south = (max(0, math.ceil(-side / self.cell / BLOCK)) * BLOCK for side in need[:2])
        east, north = (max(0, math.ceil((self.horizon - side) / self.cell / BLOCK)) * BLOCK for side in need[2:])
        self._lay_out((x0, y0, x0 + cols * self.cell, y0 + rows * self.cell), (west, south, east, north))

    def _lay_out(self, bounds: Bounds, more: tuple[int, int, int, int] = (0, 0, 0, 0)) -> None:
        """New arrays for the ground within `bounds` and `more` cells in the west, south, east and north."""
        west, south, east, north = more
        cols = (
            round((bounds[2] - bounds[0]) / self.cell) if any(more) else math.ceil((bounds[2] - bounds[0]) / self.cell)
        )
        rows = (
            round((bounds[3] - bounds[1]) / self.cell) if any(more) else math.ceil((bounds[3] - bounds[1]) / self.cell)
        )
        shape = (rows + south + north, cols + west + east)
        fine = (kernels.GRAINS * shape[0], kernels.GRAINS * shape[1])
        arrays = kernels.MapArrays(
            free=np.zeros(shape, dtype=np.bool_),
            occupied=np.zeros(shape, dtype=np.bool_),
            turned=np.zeros(shape, dtype=np.int32),
            slot=np.zeros(shape, dtype=np.int32),
            cells=np.empty((shape[0] * shape[1], 2), dtype=np.int32),
            count=np.zeros(1, dtype=np.int64),
            odds=np.zeros(fine, dtype=np.float32),
            stamp=np.zeros(fine, dtype=np.int32),
            box=np.zeros((*fine, 4), dtype=np.float32),
            frame=np.array([bounds[0] - west * self.cell, bounds[1] - south * self.cell, self.cell]),
        )
        if any(more):
            old = self._arrays
            for name in ("free", "occupied", "turned", "slot", "odds", "stamp", "box"):
                scale = kernels.GRAINS if name in ("odds", "stamp", "box") else 1
                r, c = scale * south, scale * west
                part = getattr(old, name)
                getattr(arrays, name)[r : r + part.shape[0], c : c + part.shape[1]] = part
            count = int(old.count[0])
            arrays.cells[:count] = old.cells[:count] + (south, west)
            arrays.count[0] = count
        self._arrays: kernels.MapArrays = arrays
        self._changed = np.empty((shape[0] * shape[1], 2), dtype=np.int32)
        self.layouts += 1


def _read_only(array: Mask) -> Mask:
    view = array.view()
    view.flags.writeable = False
    return view
