"""Conversion between maps of square cells and worlds of discs.

Both directions are conservative. From a map, discs fully cover the blocked cells and protrude by a stated overhang. From
a world, a cell is blocked if a disc reaches into it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.plane import format_number, format_point, tidy, world_to_map
from antdrive.base.types import Bounds, Floats, Point, Pose
from antdrive.worlds.limits import MAX_CELLS
from antdrive.worlds.world import Disc, Task, World

MAX_COVERED = 4_000_000  # cells of a covered map; limits memory to about 300 MB
MAX_DISCS = 20_000  # as many as a world file can hold

REACHABLE_DONE, DISTANCES_DONE = 0.1, 0.5  # progress after the flood fill and after the distance transform
SLACK = 1e-9  # added to discs' radii against rounding; smaller overlaps are ignored [m]
CORNER = (math.sqrt(2.0) - 1.0) / 2.0  # overhang of the disc around one cell [cells]
CAP = 32  # largest depth of a disc's centre in blocked cells [half cells]; deeper ones save few discs
COARSE = 8  # cells along a side of a block of cells, for the insides of large blocked areas
MOST_EROSIONS = 20  # for the start and goal of the largest ground [cells]
TOLERANCE = 0.25  # default goal tolerance of a map's task [m]

Cells = npt.NDArray[np.bool_]

_report: ContextVar[Callable[[float], None]] = ContextVar("report", default=lambda fraction: None)


@contextmanager
def conversion_progress(report: Callable[[float], None]) -> Iterator[None]:
    """Report a map conversion's progress, as a fraction, within the context."""
    token = _report.set(report)
    try:
        yield
    finally:
        _report.reset(token)


@dataclass(frozen=True, eq=False)
class CellMap:
    """A map of free and blocked square cells; everything beyond it is blocked.

    Attributes:
        free: free cells (R, C), rows along +y, read-only
        resolution: side of a cell [m]
        origin: lower left corner of cell (0, 0): x, y [m]
        frame: pose of the cells' frame in the source map, for messages: x, y [m] and yaw [rad]
        unknown: cells (R, C) that the source map does not know, for messages
    """

    free: Cells
    resolution: float
    origin: Point = (0.0, 0.0)
    frame: Pose = (0.0, 0.0, 0.0)
    unknown: Cells | None = None

    @property
    def bounds(self) -> Bounds:
        """Bounding box of the cells [m]."""
        (x, y), (rows, cols) = self.origin, self.free.shape
        return x, y, x + cols * self.resolution, y + rows * self.resolution

    def cell_at(self, x: float, y: float) -> tuple[int, int] | None:
        """Return the (row, col) of the cell that contains the point (`x`, `y`) of the world [m]; None outside the map."""
        col = math.floor((x - self.origin[0]) / self.resolution)
        row = math.floor((y - self.origin[1]) / self.resolution)
        rows, cols = self.free.shape
        return (row, col) if 0 <= row < rows and 0 <= col < cols else None


@dataclass(frozen=True, eq=False)
class Cover:
    """Discs that cover all blocked cells adjacent to free ones.

    Attributes:
        discs: (N, 3): x, y, radius [m]
        cells: number of covered cells
        overhang: largest protrusion of a disc beyond blocked cells [m]
    """

    discs: Floats
    cells: int
    overhang: float


def cell_map(world: World, resolution: float) -> CellMap:
    """Rasterise a world into a map of cells with sides of `resolution` [m]; movers do not count.

    A cell is blocked if a disc or a wall reaches into it by more than 1 nm.

    Raises:
        InputError: the resolution is not positive or cuts the world into too many cells.
    """
    if not (math.isfinite(resolution) and resolution > 0):
        raise input_error("resolution", f"must be greater than 0, got {resolution:g}")
    xmin, ymin, xmax, ymax = world.bounds
    rows, cols = (max(1, math.ceil(side / resolution - SLACK)) for side in (ymax - ymin, xmax - xmin))
    if rows * cols > MAX_CELLS:
        raise input_error(
            "resolution", f"{resolution:g} m cuts this world into {rows} x {cols} cells; the limit is {MAX_CELLS}"
        )
    xs, ys = xmin + resolution * np.arange(cols + 1.0), ymin + resolution * np.arange(rows + 1.0)
    free = np.ones((rows, cols), dtype=np.bool_)
    free[:, xs[1:] > xmax + SLACK] = False
    free[ys[1:] > ymax + SLACK] = False
    for x, y, radius in world.discs:
        reach = radius - SLACK
        if reach > 0:
            (left, right), (low, high) = _window(xs, x, radius), _window(ys, y, radius)
            dx = np.maximum(np.maximum(xs[left:right] - x, x - xs[left + 1 : right + 1]), 0.0)
            dy = np.maximum(np.maximum(ys[low:high] - y, y - ys[low + 1 : high + 1]), 0.0)
            free[low:high, left:right] &= np.hypot(dx[None, :], dy[:, None]) >= reach
    free.setflags(write=False)
    return CellMap(free, resolution, (xmin, ymin))


def _window(edges: Floats, centre: float, radius: float) -> tuple[int, int]:
    """Return the half-open range of cells that a disc may reach."""
    last = len(edges) - 1
    first = int(np.searchsorted(edges, centre - radius)) - 1
    stop = int(np.searchsorted(edges, centre + radius)) + 1
    return min(max(first, 0), last), min(max(stop, 0), last)


def cover(cells: CellMap, overhang: float | None = None, needed: Cells | None = None) -> Cover:
    """Cover the needed blocked cells, by default those adjacent to free ones, with few discs, chosen greedily.

    The discs leave no passage that the map does not have. By default, blocked cells without a free neighbour are omitted.
    """
    from antdrive.worlds.formats import _kernels_cover as kernels

    free, cell = cells.free, cells.resolution
    least = CORNER * cell
    if overhang is not None and not (math.isfinite(overhang) and overhang >= least):
        raise input_error(
            "overhang",
            f"must be at least {least:.6g} m, the overhang of a disc around a cell of {cell:g} m, got {overhang:g}",
        )
    if free.size > MAX_COVERED:
        rows, cols = free.shape
        raise input_error("map", f"has {rows} x {cols} reachable cells; the limit is {MAX_COVERED}")
    report = _report.get() if needed is None else lambda fraction: None  # of a part, nothing is reported
    report(REACHABLE_DONE)
    needed = beside(free) & ~free if needed is None else needed
    # Treat the map as surrounded by free cells, so that no disc reaches beyond it.
    distance2 = np.empty((2 * free.shape[0] + 5, 2 * free.shape[1] + 5), dtype=np.int32)
    kernels.squared_distances(np.pad(free, 1, constant_values=True), CAP, distance2)
    distance2 = np.ascontiguousarray(distance2[2:-2, 2:-2])
    report(DISTANCES_DONE)
    chosen = np.empty((int(needed.sum()), 4), dtype=np.int64)
    extra = 2 * (CORNER if overhang is None else max(CORNER, overhang / cell))
    i, j, radius2, inside2 = chosen[: kernels.greedy_cover(needed, distance2, extra, chosen)].T
    radius, (x0, y0) = np.sqrt(radius2) / 2, cells.origin
    report(1.0)
    discs = np.column_stack([x0 + j * (cell / 2), y0 + i * (cell / 2), radius * cell + SLACK])
    out = float((radius - np.sqrt(inside2) / 2).max(initial=0.0)) * cell
    return Cover(discs, int(needed.sum()), out)


def cover_inside(blocked: Cells, cell: float, corner: Point, overhang: float, done: float) -> Cover:
    """Cover all of the given blocked cells (R, C), their insides with large discs that reach nowhere beyond.

    Then the fraction `done` of a conversion is reported.
    """
    rows, cols = blocked.shape
    padded = np.pad(blocked, ((0, -rows % COARSE), (0, -cols % COARSE)))
    coarse = np.pad(padded.reshape(padded.shape[0] // COARSE, COARSE, -1, COARSE).all(axis=(1, 3)), 1)
    deep = (coarse & ~beside(~coarse))[1:-1, 1:-1]
    inner = cover(CellMap(~deep, cell * COARSE, corner), needed=deep)
    rim = blocked & ~deep.repeat(COARSE, 0).repeat(COARSE, 1)[:rows, :cols]
    outer = cover(CellMap(~blocked, cell, corner), overhang, rim)
    _report.get()(done)
    return Cover(np.vstack([inner.discs, outer.discs]), int(blocked.sum()), outer.overhang)


def beside(cells: Cells) -> Cells:
    """Return the given cells with their eight neighbours."""
    rows, cols = cells.shape
    padded, near = np.pad(cells, 1), np.zeros_like(cells)
    for r, c in np.ndindex(3, 3):
        near |= padded[r : r + rows, c : c + cols]
    return near


def map_task(
    cells: CellMap,
    start: Pose | None,
    goal: Point | None,
    *,
    name: str,
    source: str = "a map of cells",
    overhang: float | None = None,
    goal_tolerance: float = TOLERANCE,
    cell: float | None = None,
) -> Task:
    """Convert a map to a task: a world of discs with start and goal on free cells.

    Free cells not 4-connected to the start or the goal count as blocked. The walls enclose the remaining free cells.
    `cover` chooses the discs; the world's source states their number and overhang.

    Args:
        cells: the map
        start: the robot's start pose [m, m, rad]
        goal: the goal position [m]
        name: the world's name
        source: origin of the map
        overhang: largest protrusion of discs beyond blocked cells [m]; see `cover`
        goal_tolerance: largest distance from the goal at the stop [m]
        cell: the task's grid resolution [m]; by default the map's

    Raises:
        InputError: the start or the goal is missing, not on a free cell or inside a disc; the map is too large or needs
            too many discs.
    """
    if start is None or goal is None:
        missing = " and ".join(key for key, end in (("start", start), ("goal", goal)) if end is None)
        raise input_error(missing, f"missing; give a position on free ground, within {_span(cells)}")
    used, joined = _reachable(cells, start, goal)
    covered = cover(used, overhang)
    if len(covered.discs) > MAX_DISCS:
        more = f"; an overhang above {covered.overhang:.3g} m needs fewer" if overhang is None else ""
        raise input_error("map", f"needs {len(covered.discs)} discs; the limit is {MAX_DISCS}{more}")
    rows, cols = cells.free.shape
    source = (
        f"{source}, {rows} x {cols} cells of {cells.resolution:g} m; the {covered.cells} blocked cells next to free "
        f"cells are fully covered by {len(covered.discs)} cylinders that reach at most {covered.overhang:.4g} m "
        "beyond blocked cells" + ("" if joined else "; start and goal are not joined")
    )
    try:
        xmin, ymin, xmax, ymax = map(tidy, used.bounds)
        discs = tuple(Disc(tidy(x), tidy(y), radius) for x, y, radius in covered.discs.tolist())
        world = World(name, (xmin, ymin, xmax, ymax), discs, source)
        return Task(world, start, goal, goal_tolerance, cells.resolution if cell is None else cell)
    except FieldError as error:
        hint = f"; it is within {covered.overhang:.4g} m of a blocked cell" if "inside" in error.problem else ""
        raise input_error(error.key, f"{error.problem}{hint}") from None


def file_task(
    file: Path,
    cells: CellMap,
    start: Pose | None,
    goal: Point | None,
    *,
    source: str,
    overhang: float | None,
    cell: float | None,
    goal_tolerance: float | None,
    anywhere: bool,
) -> Task:
    """Convert a map from a file as `map_task` does, with the file's name for the world and for errors.

    If `anywhere` is set and neither start nor goal is given, they lie on the largest connected ground.
    """
    name = "".join(filter(str.isprintable, file.stem))[:200] or "map"
    tolerance = TOLERANCE if goal_tolerance is None else goal_tolerance
    try:
        if anywhere and start is None and goal is None:
            start, goal = largest_ground(cells)
        return map_task(
            cells, start, goal, name=name, source=source, overhang=overhang, cell=cell, goal_tolerance=tolerance
        )
    except InputError as error:
        raise input_error(str(file), str(error)) from None


def connected(free: Cells, ends: Iterable[tuple[int, int]]) -> Cells:
    """Return the free cells (R, C) 4-connected to any of the given cells (row, col)."""
    from antdrive.worlds.formats import _kernels_cover as kernels

    reached = np.zeros(free.shape, dtype=np.bool_)
    for row, col in ends:
        kernels.flood(free, row, col, reached)
    return reached


def largest_ground(cells: CellMap, most: int = MOST_EROSIONS) -> tuple[Pose, Point]:
    """Return a start and a goal on the largest connected part of a map, up to `most` cells away from blocked ones.

    Raises:
        InputError: no two free cells are connected.
    """
    left, largest = cells.free.copy(), np.zeros(cells.free.shape, dtype=np.bool_)
    while np.count_nonzero(left) > np.count_nonzero(largest):
        row, col = divmod(int(np.argmax(left)), left.shape[1])
        part = connected(left, [(row, col)])
        left &= ~part
        largest = max(largest, part, key=np.count_nonzero)
    if np.count_nonzero(largest) < 2:
        raise input_error("map", "has no two connected free cells")
    for _ in range(most):
        inner = ~beside(~np.pad(largest, 1))[1:-1, 1:-1]
        if np.count_nonzero(inner) < 2:
            break
        largest = inner
    spots = np.argwhere(largest)
    goal = spots[np.argmax(np.abs(spots - spots[0]).sum(axis=1))]
    (x, y), (goal_x, goal_y) = (
        ((np.array([spot[1], spot[0]]) + 0.5) * cells.resolution + cells.origin).tolist() for spot in (spots[0], goal)
    )
    return (x, y, math.atan2(goal_y - y, goal_x - x)), (goal_x, goal_y)


def _reachable(cells: CellMap, start: Pose, goal: Point) -> tuple[CellMap, bool]:
    """Return the part of a map connected to the start or the goal, and whether the two are connected."""
    here, there = _free_cell(cells, "start", start[0], start[1]), _free_cell(cells, "goal", goal[0], goal[1])
    reached = connected(cells.free, [here])
    joined = bool(reached[there])
    used = reached if joined else connected(cells.free, [here, there])
    return _cropped(CellMap(used, cells.resolution, cells.origin)), joined


def _free_cell(cells: CellMap, key: str, x: float, y: float) -> tuple[int, int]:
    spot = cells.cell_at(x, y)
    there = world_to_map(cells.frame, [(x, y)])[0].tolist()
    if spot is None:
        raise input_error(key, f"{format_point(there)} is not on the map, which spans {_span(cells)}")
    if not cells.free[spot]:
        at = f"row {spot[0]} from below, column {spot[1]}"
        if cells.unknown is not None and cells.unknown[spot]:
            unknown = "an unknown cell, such as map savers' shade 205"
            raise input_error(key, f"{format_point(there)} is on {unknown}: {at}; --unknown free makes such cells free")
        raise input_error(key, f"{format_point(there)} is on a blocked cell: {at}")
    return spot


def _span(cells: CellMap) -> str:
    """Return the bounding box of the cells in the source map, as text."""
    x0, y0, x1, y1 = cells.bounds
    corners = world_to_map(cells.frame, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    (xmin, ymin), (xmax, ymax) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    xs, ys = (" to ".join(map(format_number, ends)) for ends in ((xmin, xmax), (ymin, ymax)))
    return f"x {xs} and y {ys} m"


def _cropped(cells: CellMap) -> CellMap:
    """Crop a map to the bounding box of its free cells."""
    kept = np.argwhere(cells.free)
    (low, left), (high, right) = kept.min(axis=0), kept.max(axis=0) + 1
    x, y = cells.origin
    corner = (float(x + left * cells.resolution), float(y + low * cells.resolution))
    return CellMap(cells.free[low:high, left:right], cells.resolution, corner)
