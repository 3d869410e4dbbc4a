"""The map that a robot makes of its scans: where ground was seen free, and what was hit, as discs.

H. Moravec, A. Elfes, *High resolution maps from wide angle sonar*, 1985; S. Thrun, W. Burgard, D. Fox, *Probabilistic
Robotics*, 2005, chapter 9; log-odds with limits after A. Hornung et al., *OctoMap*, 2013. Only cells on the beams of a scan
are touched, so a scan costs the same however large the map is.
"""

from __future__ import annotations

import functools
import math
import mmap
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats, Point, Pose
from antdrive.base.errors import require_positive
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

BLOCK = 64  # a map grows by multiples of so many cells
OFTEN = 12.5  # how often a scan is entered as a whole, where the lidar's rate allows [Hz]
EACH_WAY = 6.25  # how often the free way of each beam is entered, where it allows that [Hz]
LISTED = 2048  # occupied cells that a map has room for at first
ROOM = 4.0  # how far beyond its horizon a map that grows is laid out at first [m]


class OccupancyMap:
    """What a robot has seen so far, in the frame of its odometry.

    A cell is unknown, seen free, or occupied. It is seen free once a beam has passed it, as far as beams lie no farther apart
    than a cell is wide; a thing thinner than that may stand between two of them. A single hit makes a cell occupied, and it
    is free again when the beams on both sides of its hits have ended beyond them: at the ninth time, for what was hit often.

    Every `share`-th scan is entered as a whole. Of the others only the places of the hits are entered: where something stands
    is on the map at once; that ground is free, or free again, with the next whole scan.
    The free ways are those of every `turns`-th beam, in turn, and of all beams of the first scan.

    Attributes:
        cell: side of a cell [m]
        horizon: hits farther than this are not entered [m]
        trust: ground is seen free up to this distance [m]
        scans: number of scans entered
        share: every `share`-th scan is entered as a whole, the first one, too
        turns: of these scans the free ways of every `turns`-th beam are entered
        beams: directions of the lidar's beams, seen from the lidar (beams, 2)
        layouts: how often the map was laid out; cells have other numbers after it has grown

    Args:
        lidar: the lidar whose scans are entered
        cell: side of a cell [m]
        centre: where the robot starts, in the frame of the map [m]
        horizon: hits farther than this are not entered [m]
        bounds: the ground that the map covers, for good; None: it grows as needed [m]
        goal: where the robot is to go [m]; a map that grows is laid out for the way there. None: for no way
        share: every `share`-th scan is entered as a whole; None: about 12 in a second
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
    ) -> None:
        self.share = max(1, round(lidar.rate / OFTEN)) if share is None else share
        self.turns = max(1, math.floor(lidar.rate / self.share / EACH_WAY))
        require_positive("cell", cell)
        require_positive("horizon", horizon)
        self.cell, self.horizon = cell, min(horizon, lidar.max_range)
        self.trust = min(self.horizon, cell / lidar.spacing)
        self.scans = self.layouts = 0
        self._spare = 0  # so many more occupied cells the lists surely have room for
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
    def whole(self) -> bool:
        """Whether the next scan is entered as a whole."""
        return self.scans % self.share == 0

    @property
    def arrays(self) -> kernels.MapArrays:
        """The arrays of the map by their names."""
        return self._arrays

    @property
    def plain(self) -> tuple[Any, ...]:
        """The same arrays, for kernels."""
        return self._plain

    def insert(self, pose: Pose, ranges: Floats, omitted: Mask | None = None) -> Cells:
        """Enter a scan, and return the cells that became free, occupied, or free again (K, 2): row, col.

        Args:
            pose: the estimated pose of the robot, not of its lidar
            ranges: the scan (beams,) [m]
            omitted: beams whose hits are not entered, such as those of movers (beams,)
        """
        x, y, yaw = self._lidar.pose_on(pose)
        if self._grows:
            self._make_room(x, y)
        if self._spare < len(ranges):
            self._lengthen_lists()
        number, rest = divmod(self.scans, self.share)
        turn = -1 if rest else number % self.turns
        turns = self.turns if self.scans else 1
        self.scans += 1
        mask = self._none if omitted is None else np.ascontiguousarray(omitted)
        count = kernels.insert(
            x, y, math.cos(yaw), math.sin(yaw), self.beams, ranges, self._closed, self._begin, turn, turns, mask,
            self.horizon, self.trust, self.scans, self._plain, self._changed,
        )  # fmt: skip
        self._spare -= count
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
        turned = self.beams @ np.array([[cos, sin], [-sin, cos]])
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
        kernels.explained(np.ascontiguousarray(points), self.scans, settle, self._plain, out)
        return out

    def discs(self, within: Bounds | None = None) -> Floats:
        """Discs around all hits (D, 3): x, y, radius [m]. Every point that was entered and not seen through lies in one.

        Args:
            within: only those of cells that meet this rectangle [m]; None: all
        """
        found: Floats = kernels.discs_within(*(within or EVERYWHERE), self._plain)
        return found

    def clear_hits(self, place: Point, radius: float) -> Cells:
        """Take what was hit around a place for free ground, and return the cells (K, 2): a mover has gone on.

        Args:
            place: x, y [m]
            radius: how far around it [m]
        """
        count = kernels.forget(*place, radius, self._plain, self._changed)
        return self._changed[:count].copy()

    def mark_free(self, place: Point, radius: float, world: World | None = None, movers: Floats | None = None) -> Cells:
        """Take unknown ground for free, such as that under the robot, and return the cells (K, 2).

        Args:
            place: x, y [m]
            radius: how far around it [m]
            world: cells that meet one of its cylinders or walls stay unknown; None: none do
            movers: discs of what moves there now (N, 3) [m]; cells that they meet stay unknown, too. None: there are none
        """
        discs, walls = (_NONE, EVERYWHERE) if world is None else (world.discs, world.bounds)
        if movers is not None:
            discs = np.concatenate((discs, movers))
        count = kernels.take_as_free(*place, radius, discs, np.array(walls), self._plain, self._changed)
        return self._changed[:count].copy()

    def reset_around(self, place: Point, radius: float, goal: Point | None = None) -> OccupancyMap:
        """An empty map with the same cells, but for what this one has seen free around a place; hits there are unknown ground.

        Args:
            place: around which the map is laid out, x, y [m]
            radius: how far around it free ground stays free [m]
            goal: where the robot is to go [m]; None: for no way
        """
        cell, half = self.cell, self.horizon + ROOM
        x, y = (
            low + cell * math.floor((at - half - low) / cell) + half for at, low in zip(place, self.origin, strict=True)
        )
        new = OccupancyMap(self._lidar, cell, (x, y), self.horizon, share=self.share, goal=goal)
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
                (rows, cols), self._arrays.free.shape, (up, across), other._arrays.free.shape, strict=True
            )
        )
        sides = zip((cols, rows), self.origin, place, strict=True)
        dx, dy = (
            np.maximum(np.abs(low + (side + 0.5) * self.cell - at) - 0.5 * self.cell, 0) for side, low, at in sides
        )
        within = dx**2 + dy[:, None] ** 2 <= radius * radius
        self._arrays.free[np.ix_(rows, cols)] = within & other._arrays.free[np.ix_(rows + up, cols + across)]
        kernels.count_unseen(self._arrays.free, self._arrays.unseen)

    def _make_room(self, x: float, y: float) -> None:
        """Grow where the horizon around the lidar would leave the map."""
        x_low, x_high, y_low, y_high = self._room
        if x_low <= x <= x_high and y_low <= y <= y_high:
            return
        old, far, (x0, y0) = self._arrays, self.horizon, self.origin
        rows, cols = old.free.shape
        need = (x0 + far - x, y0 + far - y, x + far - x0 - cols * self.cell, y + far - y0 - rows * self.cell)
        more = self._blocks(*need)
        self._lay_out(x0, y0, rows, cols, more, old)
        new, count = self._arrays, int(old.count[0])
        new.free[more[1] : more[1] + rows, more[0] : more[0] + cols] = old.free
        kernels.count_unseen(new.free, new.unseen)
        new.cells[:count, :2] += (more[1], more[0])
        listed = new.cells[:count, 0], new.cells[:count, 1]
        new.occupied[listed], new.slot[listed] = True, np.arange(count)

    def _blocks(self, west: float, south: float, east: float, north: float) -> tuple[int, int, int, int]:
        """How many cells are to be added on each side for so many metres: whole blocks, none for less than 0."""
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
        """New arrays for so many cells from a corner on and `more` in the west, south, east and north; lists as in `old`."""
        west, south, east, north = more
        shape = (rows + south + north, cols + west + east)
        frame = np.array([x0 - west * self.cell, y0 - south * self.cell, self.cell])
        free, occupied = _zeros(shape, dtype=np.bool_), _zeros(shape, dtype=np.bool_)
        slot = _zeros(shape, dtype=np.int32)
        unseen = np.empty([math.ceil(side / kernels.SQUARE) for side in shape], dtype=np.uint8)
        kernels.count_unseen(free, unseen)
        if old is None:
            grains = kernels.GRAINS * kernels.GRAINS
            self._arrays: kernels.MapArrays = kernels.MapArrays(
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
            self._arrays = old._replace(free=free, unseen=unseen, occupied=occupied, slot=slot, frame=frame)
        self._plain = tuple(self._arrays)
        self._changed = _zeros((shape[0] * shape[1], 2), dtype=np.int32)
        (x, y), far = self.origin, self.horizon
        self._room = x + far, x + shape[1] * self.cell - far, y + far, y + shape[0] * self.cell - far
        self.layouts += 1

    def _lengthen_lists(self) -> None:
        """Make the lists of occupied cells longer where a scan could fill them."""
        held, room = int(self._arrays.count[0]), len(self._arrays.cells)
        missing = held + self._lidar.beams - room
        if missing > 0:
            room += max(missing, room)
            lists = {name: getattr(self._arrays, name) for name in ("cells", "odds", "stamp", "box")}
            longer = {name: np.zeros((room, *rows.shape[1:]), dtype=rows.dtype) for name, rows in lists.items()}
            for name, rows in lists.items():
                longer[name][: len(rows)] = rows
            self._arrays = self._arrays._replace(**longer)
            self._plain = tuple(self._arrays)
        self._spare = room - held


def _zeros(shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """An array of zeros whose pages the system provides when they are first written to: most of a map stays empty.

    `np.zeros` writes all of them, wherever the allocator has used the memory before.
    """
    kind = np.dtype(dtype)
    return np.frombuffer(mmap.mmap(-1, math.prod(shape) * kind.itemsize), kind).reshape(shape)


def _read_only(array: Mask) -> Mask:
    view = array.view()
    view.flags.writeable = False
    return view


def clear_distance(
    seen: OccupancyMap,
    pose: Pose,
    speed: float,
    yaw_rate: float,
    footprint: Footprint,
    limit: float,
    *,
    freespace: bool = False,
) -> float:
    """How far the footprint, swept along the arc of a twist, stays on ground that was seen free, at most `limit` [m].

    Ground counts as not seen by whole cells, and what was hit by its discs. It is a lower bound, to 1 mm. What the
    footprint overlaps already does not stop a robot that leaves it or drives along it, only one that would come nearer.

    Args:
        seen: the map
        pose: the robot's estimated pose
        speed: forward speed [m/s], not 0; negative: backwards
        yaw_rate: counter-clockwise [rad/s]
        footprint: the robot's footprint
        limit: how far is far enough [m]
        freespace: whether ground that was not seen counts as free, so that only hits end the way
    """
    if speed == 0.0:
        return 0.0 if yaw_rate else limit
    return _clear(seen, pose, speed, yaw_rate, footprint, limit, freespace)


def clear_turn(
    seen: OccupancyMap, pose: Pose, yaw_rate: float, footprint: Footprint, limit: float, *, freespace: bool = False
) -> float:
    """How far the robot can turn on the spot over ground that was seen free, at most `limit` [rad]; as `clear_distance`.

    Args:
        seen: the map
        pose: the robot's estimated pose
        yaw_rate: counter-clockwise [rad/s]; only its sign counts
        footprint: the robot's footprint
        limit: how far is far enough [rad]
        freespace: whether ground that was not seen counts as free
    """
    return _clear(seen, pose, 0.0, yaw_rate, footprint, limit, freespace)


def _clear(
    seen: OccupancyMap, pose: Pose, speed: float, yaw_rate: float, footprint: Footprint, limit: float, freespace: bool
) -> float:
    shape = footprint.half_length, footprint.half_width, footprint.rounding
    arrays = tuple(seen.arrays._replace(free=~seen.occupied)) if freespace else seen.plain
    return float(_kernels_sight.clear_way(*pose, speed, yaw_rate, *shape, _corners(footprint), limit, arrays))


@functools.lru_cache(maxsize=16)
def _corners(footprint: Footprint) -> Floats:
    return kernel_shape(footprint)[1]
