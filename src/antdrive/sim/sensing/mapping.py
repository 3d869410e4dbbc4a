"""Occupancy map of a robot's scans: observed free ground, and hits as discs.

H. Moravec, A. Elfes, *High resolution maps from wide angle sonar*, 1985; S. Thrun, W. Burgard, D. Fox, *Probabilistic
Robotics*, 2005, chapter 9; log-odds with limits after A. Hornung et al., *OctoMap*, 2013. A scan touches only cells on its
beams, so its cost is independent of the map's size.
"""

from __future__ import annotations

import math
import mmap
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats, Point, Pose
from antdrive.base.errors import require
from antdrive.robots.clearance import kernel_shape
from antdrive.robots.lidar import Lidar
from antdrive.robots.spec import Footprint
from antdrive.sim.sensing import _kernels_mapping as kernels
from antdrive.sim.sensing import _kernels_sight
from antdrive.worlds import World

EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)
_NONE = np.empty((0, 3))
Cells = npt.NDArray[np.int32]
Mask = npt.NDArray[np.bool_]
Shape: TypeAlias = tuple[float, float, float, Floats]

BLOCK = 64  # growth increment of the map [cells]
OFTEN = 12.5  # rate of whole scans, if the lidar's rate allows [Hz]
EACH_WAY = 6.25  # rate at which the free path of each beam is entered, if possible [Hz]
LISTED = 2048  # initial capacity for occupied cells
ROOM = 4.0  # initial extent of a growing map beyond its horizon [m]


class OccupancyMap:
    """Occupancy map in the frame of the robot's odometry.

    A cell is unknown, free or occupied. It is free once a beam has passed it, out to the distance where neighbouring
    beams are one cell apart; an object thinner than a cell may stand between two beams. One hit makes a cell
    occupied. It is free again once the beams on both sides of its hits have ended beyond them; cells with many hits
    need nine such scans.

    Every `share`-th scan is entered as a whole. The others contribute their hits only: obstacles appear at once, and free
    ground with the next whole scan. A whole scan enters the free paths of every `stride`-th beam, of other beams each
    time; the first scan enters those of all beams.

    Attributes:
        cell: side of a cell [m]
        horizon: hits farther than this are omitted [m]
        trust: ground is observed as free up to this distance [m]
        scans: number of scans entered
        share: every `share`-th scan is entered as a whole, beginning with the first
        stride: whole scans enter the free paths of every `stride`-th beam
        beams: directions of the lidar's beams in its frame (beams, 2)
        layouts: number of layouts; cell indices change when the map grows
        arrays: arrays of the map by name
        plain: the same arrays, for kernels

    Args:
        lidar: the scanning lidar
        cell: side of a cell [m]
        centre: the robot's start, in the frame of the map [m]
        horizon: hits farther than this are omitted [m]
        bounds: the fixed bounds of the map [m]; None: it grows as needed
        goal: the robot's goal [m], included in the layout of a growing map; None: no goal
        share: every `share`-th scan is entered as a whole; None: about 12 per second
        moving: whether hits beyond `trust` may be those of movers, so that beams clear them there as well
    """

    def __init__(
        self,
        lidar: Lidar,
        cell: float = 0.05,
        centre: Point = (0.0, 0.0),
        horizon: float = 10.0,
        bounds: Bounds | None = None,
        share: int | None = None,
        goal: Point | None = None,
        moving: bool = False,
    ) -> None:
        self._moving = moving
        self.share = max(1, round(lidar.rate / OFTEN)) if share is None else share
        self.stride = max(1, math.floor(lidar.rate / self.share / EACH_WAY))
        require("cell", cell, above=0)
        require("horizon", horizon, above=0)
        self.cell, self.horizon = cell, min(horizon, lidar.max_range)
        self.trust = min(self.horizon, cell / lidar.spacing)
        self.scans = self.layouts = 0
        self._spare = 0  # free capacity of the lists of occupied cells
        self._lidar, self._grows, self._closed = lidar, bounds is None, lidar.full_circle
        angles = lidar.angles - lidar.yaw
        self.beams = np.column_stack((np.cos(angles), np.sin(angles)))
        self._begin = np.empty(lidar.beams)
        kernels.begins(lidar.beams, lidar.spacing, cell, self._begin)
        self._none = np.zeros(lidar.beams, dtype=np.bool_)
        half = self.horizon + ROOM
        x, y = centre
        more = (0, 0, 0, 0)
        if bounds is None and goal is not None:
            more = self._blocks(x - goal[0], y - goal[1], goal[0] - x, goal[1] - y)
        bounds = bounds or (x - half, y - half, x + half, y + half)
        cols, rows = (math.ceil((bounds[k + 2] - bounds[k]) / cell) for k in (0, 1))
        self._lay_out(bounds[0], bounds[1], rows, cols, more)

    @property
    def origin(self) -> Point:
        """Lower left corner of cell (0, 0) [m]."""
        return float(self.arrays.frame[0]), float(self.arrays.frame[1])

    @property
    def occupied(self) -> Mask:
        """Cells with hits (rows, cols); rows along +y. A read-only live view."""
        return _read_only(self.arrays.occupied)

    @property
    def seen_free(self) -> Mask:
        """Cells that were observed as free and are not occupied (rows, cols). A read-only live view."""
        return _read_only(self.arrays.free)

    @property
    def whole(self) -> bool:
        """Whether the next scan is entered as a whole."""
        return self.scans % self.share == 0

    def insert(self, pose: Pose, ranges: Floats, omitted: Mask | None = None) -> Cells:
        """Enter a scan, and return the cells that became free or occupied (K, 2): row, col; valid until the next call.

        Args:
            pose: the estimated pose of the robot, not of its lidar
            ranges: the scan (beams,) [m]
            omitted: beams whose hits are omitted, such as those of movers (beams,)
        """
        x, y, yaw = self._lidar.pose_on(pose)
        if self._grows:
            self._make_room(x, y)
        if self._spare < len(ranges):
            self._lengthen_lists()
        number, rest = divmod(self.scans, self.share)
        first = -1 if rest else number % self.stride
        stride = self.stride if self.scans else 1
        self.scans += 1
        mask = self._none if omitted is None else np.ascontiguousarray(omitted)
        count = kernels.insert(
            x, y, math.cos(yaw), math.sin(yaw), self.beams, ranges, self._closed, self._begin, first, stride, mask,
            self.horizon, self.trust, self.scans, self.plain, self._changed,
        )  # fmt: skip
        if self._moving and not rest:
            count = kernels.see_far(
                x, y, math.cos(yaw), math.sin(yaw), self.beams, ranges, self._closed, self.trust, self.scans,
                self.plain, self._changed, count,
            )  # fmt: skip
        self._spare -= count
        return self._changed[:count]

    def endpoints(self, pose: Pose, ranges: Floats) -> Floats:
        """Return the ends of the beams (beams, 2) [m]; nan without a measurable hit.

        Args:
            pose: the estimated pose of the robot
            ranges: the scan (beams,) [m]
        """
        x, y, yaw = self._lidar.pose_on(pose)
        cos, sin = math.cos(yaw), math.sin(yaw)
        measured = np.where(np.isfinite(ranges), ranges, np.nan)[:, None]
        turned = self.beams @ np.array([[cos, sin], [-sin, cos]])
        return np.asarray(measured * turned + (x, y), dtype=np.float64)

    def explained(self, points: Floats, settle: int) -> Mask:
        """Return whether points belong to static obstacles (N,): they lie in or beside cells occupied for long.

        Points on ground observed as free less than `settle` scans ago do not count, whether or not their scan has been
        entered.

        Args:
            points: positions (N, 2) [m]
            settle: scans after which a new object counts as standing
        """
        out = np.empty(len(points), dtype=np.bool_)
        kernels.explained(np.ascontiguousarray(points), self.scans, settle, self.plain, out)
        return out

    def discs(self, within: Bounds | None = None) -> Floats:
        """Return discs around all hits (D, 3): x, y, radius [m]. They contain every entered hit that no beam has cleared.

        Args:
            within: omit cells outside this rectangle [m]; None: all
        """
        discs: Floats = kernels.discs_within(*(within or EVERYWHERE), self.plain)
        return discs

    def mark_free(self, place: Point, radius: float, world: World | None = None) -> Cells:
        """Mark unknown ground as free, such as that under the robot, and return the cells (K, 2).

        Args:
            place: x, y [m]
            radius: distance around it [m]
            world: cells that meet its cylinders or walls stay unknown; None: no world
        """
        discs, walls = (_NONE, EVERYWHERE) if world is None else (world.discs, world.bounds)
        count = kernels.take_as_free(*place, radius, discs, np.array(walls), self.plain, self._changed)
        return self._changed[:count].copy()

    def reset_around(self, place: Point, radius: float, goal: Point | None = None) -> OccupancyMap:
        """Return a map without hits and with only the free ground around a position; hits there become unknown ground.

        Args:
            place: centre of the new layout, x, y [m]
            radius: free ground within this distance stays free [m]
            goal: the robot's goal [m]; None: no goal
        """
        cell, half = self.cell, self.horizon + ROOM
        x, y = (
            low + cell * math.floor((at - half - low) / cell) + half for at, low in zip(place, self.origin, strict=True)
        )
        new = OccupancyMap(self._lidar, cell, (x, y), self.horizon, share=self.share, goal=goal, moving=self._moving)
        new._take_over(self, place, radius)
        return new

    def _take_over(self, other: OccupancyMap, place: Point, radius: float) -> None:
        """Free the cells that meet a disc and are free on another map with the same cells."""
        low, span = np.subtract(place, radius), math.ceil(2 * radius / self.cell) + 1
        cols, rows = np.floor((low - self.origin) / self.cell).astype(np.int64)[:, None] + np.arange(span)
        across, up = np.round(np.subtract(self.origin, other.origin) / self.cell).astype(np.int64)
        rows, cols = (
            side[(side >= 0) & (side < most) & (side + shift >= 0) & (side + shift < far)]
            for side, most, shift, far in zip(
                (rows, cols), self.arrays.free.shape, (up, across), other.arrays.free.shape, strict=True
            )
        )
        sides = zip((cols, rows), self.origin, place, strict=True)
        dx, dy = (
            np.maximum(np.abs(low + (side + 0.5) * self.cell - at) - 0.5 * self.cell, 0) for side, low, at in sides
        )
        within = dx**2 + dy[:, None] ** 2 <= radius * radius
        self.arrays.free[np.ix_(rows, cols)] = within & other.arrays.free[np.ix_(rows + up, cols + across)]
        kernels.count_unseen(self.arrays.free, self.arrays.unseen)

    def _make_room(self, x: float, y: float) -> None:
        """Grow the map if the lidar's horizon would leave it."""
        x_low, x_high, y_low, y_high = self._room
        if x_low <= x <= x_high and y_low <= y <= y_high:
            return
        old, far, (x0, y0) = self.arrays, self.horizon, self.origin
        rows, cols = old.free.shape
        need = (x0 + far - x, y0 + far - y, x + far - x0 - cols * self.cell, y + far - y0 - rows * self.cell)
        more = self._blocks(*need)
        self._lay_out(x0, y0, rows, cols, more, old)
        new, count = self.arrays, int(old.count[0])
        new.free[more[1] : more[1] + rows, more[0] : more[0] + cols] = old.free
        kernels.count_unseen(new.free, new.unseen)
        new.cells[:count, :2] += (more[1], more[0])
        listed = new.cells[:count, 0], new.cells[:count, 1]
        new.occupied[listed], new.slot[listed] = True, np.arange(count)

    def _blocks(self, west: float, south: float, east: float, north: float) -> tuple[int, int, int, int]:
        """Return the cells to add on each side for distances [m], in whole blocks; none for negative distances."""
        w, s, e, n = (max(0, math.ceil(side / self.cell / BLOCK)) * BLOCK for side in (west, south, east, north))
        return w, s, e, n

    def _lay_out(
        self,
        x0: float,
        y0: float,
        rows: int,
        cols: int,
        more: tuple[int, int, int, int],
        old: kernels.MapArrays | None = None,
    ) -> None:
        """Allocate arrays for `rows` x `cols` cells from a corner, plus `more` cells on each side (west, south, east,
        north); keep the lists of `old`."""
        west, south, east, north = more
        shape = (rows + south + north, cols + west + east)
        frame = np.array([x0 - west * self.cell, y0 - south * self.cell, self.cell])
        free, occupied = _zeros(shape, dtype=np.bool_), _zeros(shape, dtype=np.bool_)
        slot = _zeros(shape, dtype=np.int32)
        unseen = np.empty([math.ceil(side / kernels.SQUARE) for side in shape], dtype=np.uint8)
        kernels.count_unseen(free, unseen)
        if old is None:
            grains = kernels.GRAINS * kernels.GRAINS
            self.arrays = kernels.MapArrays(
                free=free,
                unseen=unseen,
                occupied=occupied,
                slot=slot,
                count=np.zeros(1, dtype=np.int64),
                frame=frame,
                cells=np.zeros((LISTED, 4), dtype=np.int32),
                odds=np.zeros((LISTED, grains), dtype=np.float32),
                stamp=np.zeros((LISTED, grains), dtype=np.int32),
                box=np.zeros((LISTED, grains, 4), dtype=np.float32),
            )
        else:
            self.arrays = old._replace(free=free, unseen=unseen, occupied=occupied, slot=slot, frame=frame)
        self.plain: tuple[Any, ...] = tuple(self.arrays)
        self._changed = _zeros((shape[0] * shape[1], 2), dtype=np.int32)
        (x, y), far = self.origin, self.horizon
        self._room = x + far, x + shape[1] * self.cell - far, y + far, y + shape[0] * self.cell - far
        self.layouts += 1

    def _lengthen_lists(self) -> None:
        """Extend the lists of occupied cells if a scan could fill them."""
        held, room = int(self.arrays.count[0]), len(self.arrays.cells)
        missing = held + self._lidar.beams - room
        if missing > 0:
            room += max(missing, room)
            lists = {name: getattr(self.arrays, name) for name in ("cells", "odds", "stamp", "box")}
            longer = {name: np.zeros((room, *rows.shape[1:]), dtype=rows.dtype) for name, rows in lists.items()}
            for name, rows in lists.items():
                longer[name][: len(rows)] = rows
            self.arrays = self.arrays._replace(**longer)
            self.plain = tuple(self.arrays)
        self._spare = room - held


def _zeros(shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Return an array of zeros whose pages are allocated on the first write, since most of a map stays empty.

    `np.zeros` writes all pages where the allocator reuses memory.
    """
    kind = np.dtype(dtype)
    return np.frombuffer(mmap.mmap(-1, math.prod(shape) * kind.itemsize), kind).reshape(shape)


def _read_only(array: Mask) -> Mask:
    view = array.view()
    view.flags.writeable = False
    return view


def clear_way(
    seen: OccupancyMap,
    pose: Pose,
    speed: float,
    yaw_rate: float,
    shape: Shape,
    limit: float,
    *,
    freespace: bool = False,
) -> float:
    """Return how far the footprint, swept along a twist's arc, stays on observed free ground [m]; without a speed [rad].

    Unknown ground counts by whole cells, hits by their discs. The result is a lower bound, to 1 mm. An overlap at the
    start stops only a motion that comes nearer to it.

    Args:
        seen: the map
        pose: the robot's estimated pose
        speed: forward speed [m/s]; negative: backwards; 0: a turn on the spot
        yaw_rate: counter-clockwise [rad/s]
        shape: the robot's footprint, from `shape_of`
        limit: the largest distance or angle of interest [m], [rad]
        freespace: whether unknown ground counts as free, so that only hits limit the path
    """
    arrays = tuple(seen.arrays._replace(free=~seen.occupied)) if freespace else seen.plain
    length, width, rounding, corners = shape
    clear: float = _kernels_sight.clear_way(*pose, speed, yaw_rate, length, width, rounding, corners, limit, arrays)
    return clear


def shape_of(footprint: Footprint) -> Shape:
    """Return a footprint for `clear_way`: half length, half width, rounding and corners (K, 2) [m]."""
    sizes, corners = kernel_shape(footprint)
    length, width, rounding = sizes.tolist()
    return length, width, rounding, corners
