"""Maps of square cells, free or blocked: how a map becomes a world of discs, and a world a map.

Discs cannot fill squares exactly, so both conversions err to the safe side. A world made from a map has discs that fully
cover the blocked cells and protrude by a stated length. In a map made from a world, a cell is blocked as soon as a
disc reaches into it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.plane import world_to_map
from antdrive.base.types import Bounds, Floats, Point, Pose
from antdrive.worlds.limits import MAX_CELLS
from antdrive.worlds.world import Disc, Task, World

MAX_COVERED = 4_000_000  # cells of the part of a map that is covered; keeps the memory below some 300 MB
MAX_DISCS = 20_000  # as many obstacles as a world file can hold

REACHABLE_DONE, DISTANCES_DONE = 0.1, 0.5  # of a conversion's time: free cells are found, distances are known
SLACK = 1e-9  # discs reach this much farther than necessary, against rounding; a smaller overlap does not count [m]
CORNER = (math.sqrt(2.0) - 1.0) / 2.0  # how far the disc around a cell protrudes, in cells
CAP = 32  # how deep inside blocked cells centres are at most [half cells]; larger discs hardly save any
TOLERANCE = 0.25  # goal tolerance of a map's task when none is given [m]

Cells = npt.NDArray[np.bool_]

_report: ContextVar[Callable[[float], None]] = ContextVar("report", default=lambda share: None)


@contextmanager
def conversion_progress(report: Callable[[float], None]) -> Iterator[None]:
    """A context in which the conversion of a map says how far it is."""
    token = _report.set(report)
    try:
        yield
    finally:
        _report.reset(token)


@dataclass(frozen=True, eq=False)
class CellMap:
    """Square cells that are free or blocked; everything beyond them is blocked.

    Attributes:
        free: which cells are free (R, C), rows along +y, read-only
        resolution: side of a cell [m]
        origin: lower left corner of cell (0, 0): x, y [m]
        frame: where the frame of the cells lies in the map that people know, for messages: x, y [m] and yaw [rad]
    """

    free: Cells
    resolution: float
    origin: Point = (0.0, 0.0)
    frame: Pose = (0.0, 0.0, 0.0)

    @property
    def bounds(self) -> Bounds:
        """The rectangle that the cells fill [m]."""
        (x, y), (rows, cols) = self.origin, self.free.shape
        return x, y, x + cols * self.resolution, y + rows * self.resolution

    def cell_at(self, x: float, y: float) -> tuple[int, int] | None:
        """The (row, col) of the cell that holds a point; None outside the map.

        Args:
            x: world coordinate [m]
            y: world coordinate [m]
        """
        col = math.floor((x - self.origin[0]) / self.resolution)
        row = math.floor((y - self.origin[1]) / self.resolution)
        rows, cols = self.free.shape
        return (row, col) if 0 <= row < rows and 0 <= col < cols else None


@dataclass(frozen=True, eq=False)
class Cover:
    """Discs that cover all blocked cells next to free ones.

    Attributes:
        discs: (N, 3): x, y, radius [m]
        cells: how many cells are fully covered
        overhang: how far a disc reaches beyond blocked cells, at most [m]
    """

    discs: Floats
    cells: int
    overhang: float


def cell_map(world: World, resolution: float) -> CellMap:
    """The map of a world: a cell is free where no disc and no wall reaches into it by more than a nanometre.

    Args:
        world: the obstacles and walls; movers do not count
        resolution: side of a cell [m]

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
    """The range of cells between the edges that a disc may reach: the first, and the one after the last."""
    last = len(edges) - 1
    first = int(np.searchsorted(edges, centre - radius)) - 1
    stop = int(np.searchsorted(edges, centre + radius)) + 1
    return min(max(first, 0), last), min(max(stop, 0), last)


def cover(cells: CellMap, overhang: float | None = None) -> Cover:
    """A cover of the blocked cells that touch a free one, with as few discs as a greedy choice finds.

    Free cells stay separated where the map separates them: no way leads between or past the discs. Blocked cells that
    no free cell touches are left out.
    """
    from antdrive.worlds.formats import _kernels_cover as kernels

    free, cell = cells.free, cells.resolution
    least = CORNER * cell
    if overhang is not None and not (math.isfinite(overhang) and overhang >= least):
        raise input_error(
            "overhang",
            f"must be at least {least:.6g} m, which the disc around a cell of {cell:g} m needs, got {overhang:g}",
        )
    if free.size > MAX_COVERED:
        rows, cols = free.shape
        raise input_error("map", f"has {rows} x {cols} cells that can be reached; the limit is {MAX_COVERED}")
    _report.get()(REACHABLE_DONE)
    needed = _beside(free) & ~free
    # The map counts as surrounded by free cells here: discs then do not reach beyond it, where they would do no harm
    # but look as if they did.
    distance2 = np.empty((2 * free.shape[0] + 5, 2 * free.shape[1] + 5), dtype=np.int32)
    kernels.squared_distances(np.pad(free, 1, constant_values=True), CAP, distance2)
    distance2 = np.ascontiguousarray(distance2[2:-2, 2:-2])
    _report.get()(DISTANCES_DONE)
    chosen = np.empty((int(needed.sum()), 4), dtype=np.int64)
    extra = 2 * (CORNER if overhang is None else max(CORNER, overhang / cell))
    i, j, radius2, inside2 = chosen[: kernels.greedy_cover(needed, distance2, extra, chosen)].T
    radius, (x0, y0) = np.sqrt(radius2) / 2, cells.origin
    _report.get()(1.0)
    discs = np.column_stack([x0 + j * (cell / 2), y0 + i * (cell / 2), radius * cell + SLACK])
    out = float((radius - np.sqrt(inside2) / 2).max(initial=0.0)) * cell
    return Cover(discs, int(needed.sum()), out)


def _beside(cells: Cells) -> Cells:
    """The given cells and all that share a side or a corner with one of them."""
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
    """A map as a task: a world of discs, which can be planned and driven, between two points on free cells.

    Free cells that steps over shared sides do not join to the start or the goal count as blocked. The bounds, which are
    solid and straight, are drawn in to the free cells that remain. `cover` chooses the discs; the world's source says
    how many there are and how far they protrude.

    Args:
        cells: the map
        start: the robot's first pose [m, m, rad]
        goal: [m]
        name: the world's name
        source: where the map comes from
        overhang: how far discs may reach beyond blocked cells [m]; see `cover`
        goal_tolerance: how close to the goal the robot must stop [m]
        cell: the task's grid resolution [m]; by default the map's own

    Raises:
        InputError: the start or the goal is missing, not on a free cell or inside a disc; or the map is too large or
            needs too many discs.
    """
    if start is None or goal is None:
        missing = " and ".join(key for key, end in (("start", start), ("goal", goal)) if end is None)
        raise input_error(missing, f"maps have none; give it on free ground, within {_span(cells)}")
    used, joined = _reachable(cells, start, goal)
    found = cover(used, overhang)
    if len(found.discs) > MAX_DISCS:
        more = f"; a larger overhang than {found.overhang:.3g} m needs fewer" if overhang is None else ""
        raise input_error("map", f"needs {len(found.discs)} discs; the limit is {MAX_DISCS}{more}")
    rows, cols = cells.free.shape
    source = (
        f"{source}, {rows} x {cols} cells of {cells.resolution:g} m; the {found.cells} blocked cells next to free "
        f"cells are fully covered by {len(found.discs)} cylinders that reach at most {found.overhang:.4g} m "
        "beyond blocked cells" + ("" if joined else "; start and goal are not joined")
    )
    try:
        world = World(name, used.bounds, tuple(Disc(*map(float, disc)) for disc in found.discs), source)
        return Task(world, start, goal, goal_tolerance, cells.resolution if cell is None else cell)
    except FieldError as error:
        hint = f"; it is within {found.overhang:.4g} m of a blocked cell" if "inside" in error.problem else ""
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
) -> Task:
    """`map_task` for a map from a file, which gives the world's name and is named in errors."""
    name = "".join(filter(str.isprintable, file.stem))[:200] or "map"
    tolerance = TOLERANCE if goal_tolerance is None else goal_tolerance
    try:
        return map_task(
            cells, start, goal, name=name, source=source, overhang=overhang, cell=cell, goal_tolerance=tolerance
        )
    except InputError as error:
        raise input_error(str(file), str(error)) from None


def _reachable(cells: CellMap, start: Pose, goal: Point) -> tuple[CellMap, bool]:
    """The part of a map that is joined to the start or the goal, and whether they are joined to each other."""
    from antdrive.worlds.formats import _kernels_cover as kernels

    here, there = _free_cell(cells, "start", start[0], start[1]), _free_cell(cells, "goal", goal[0], goal[1])
    reached = np.zeros(cells.free.shape, dtype=np.bool_)
    kernels.flood(cells.free, *here, reached)
    joined = bool(reached[there])
    kernels.flood(cells.free, *there, reached)
    return _cropped(CellMap(reached, cells.resolution, cells.origin)), joined


def _free_cell(cells: CellMap, key: str, x: float, y: float) -> tuple[int, int]:
    spot = cells.cell_at(x, y)
    there_x, there_y = world_to_map(cells.frame, [(x, y)])[0].tolist()
    if spot is None:
        raise input_error(key, f"({there_x:g}, {there_y:g}) is not on the map, which spans {_span(cells)}")
    if not cells.free[spot]:
        raise input_error(
            key, f"({there_x:g}, {there_y:g}) is on a blocked cell, in row {spot[0]} from below and column {spot[1]}"
        )
    return spot


def _span(cells: CellMap) -> str:
    """The box around the cells in the map that people know."""
    x0, y0, x1, y1 = cells.bounds
    corners = world_to_map(cells.frame, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    (xmin, ymin), (xmax, ymax) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return f"x {xmin:g} to {xmax:g} and y {ymin:g} to {ymax:g} m"


def _cropped(cells: CellMap) -> CellMap:
    """The smallest rectangle of cells with all the free ones; everything beyond it is blocked anyway."""
    kept = np.argwhere(cells.free)
    (low, left), (high, right) = kept.min(axis=0), kept.max(axis=0) + 1
    x, y = cells.origin
    corner = (float(x + left * cells.resolution), float(y + low * cells.resolution))
    return CellMap(cells.free[low:high, left:right], cells.resolution, corner)
