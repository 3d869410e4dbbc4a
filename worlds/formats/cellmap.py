"""Maps of square cells, free or blocked, and how they and worlds of discs become one another.

Cells are exact squares; discs are not. A world made from a map therefore errs to one side only: its discs cover the blocked
cells wholly, never less, and stick out by a stated length. A map made from a world errs the same way: a cell
is blocked as soon as a disc reaches into it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.worlds.files.document import input_error
from antdrive.worlds.world import Bounds, Disc, Floats, Point, Pose, Task, World

MAX_CELLS = 25_000_000  # as in worlds.grid, which is not imported here because it loads the compiler
MAX_COVERED = 4_000_000  # cells of the part of a map that is covered; keeps the work within some 300 MB
MAX_DISCS = 20_000  # what a world file holds

SLACK = 1e-9  # discs reach this much farther than they must, against rounding; less than this is no overlap [m]
CORNER = (math.sqrt(2.0) - 1.0) / 2.0  # what the disc around a cell sticks out by, in cells
CAP = 32  # centres are at most this deep inside blocked cells [half cells]: larger discs hardly save any

Cells = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class CellMap:
    """Square cells that are free or blocked; all that lies beyond them is blocked."""

    free: Cells  # (R, C), the row along +y, read-only
    resolution: float  # side of a cell [m]
    origin: Point = (0.0, 0.0)  # lower left corner of cell (0, 0) [m]

    @property
    def bounds(self) -> Bounds:
        """The rectangle that the cells fill [m]."""
        (x, y), (rows, cols) = self.origin, self.free.shape
        return x, y, x + cols * self.resolution, y + rows * self.resolution

    def cell_at(self, x: float, y: float) -> tuple[int, int] | None:
        """The (row, col) of the cell that holds a point, if any does."""
        col = math.floor((x - self.origin[0]) / self.resolution)
        row = math.floor((y - self.origin[1]) / self.resolution)
        rows, cols = self.free.shape
        return (row, col) if 0 <= row < rows and 0 <= col < cols else None


@dataclass(frozen=True, eq=False)
class Cover:
    """Discs that cover all blocked cells that free ground touches."""

    discs: Floats  # (N, 3): x, y, radius [m]
    cells: int  # how many cells are covered wholly
    overhang: float  # how far a disc reaches beyond blocked cells, at most [m]


def cell_map(world: World, resolution: float) -> CellMap:
    """The cells of `resolution` [m] that no disc and no wall reaches into by more than a nanometre.

    Raises:
        InputError: the resolution is not positive or cuts the world into absurdly many cells.
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
    """First and last-but-one cell between the edges that a disc may reach."""
    last = len(edges) - 1
    first = int(np.searchsorted(edges, centre - radius)) - 1
    stop = int(np.searchsorted(edges, centre + radius)) + 1
    return min(max(first, 0), last), min(max(stop, 0), last)


def cover(cells: CellMap, overhang: float | None = None) -> Cover:
    """As few discs as a greedy choice finds that cover each blocked cell with a free one beside it, or at its corner.

    They do not reach farther than `overhang` [m] beyond blocked cells: 0.207 cells by default, which the disc around a single
    cell needs; more makes for fewer discs. Between them and beyond, no way leads from free cells into others:
    blocked cells that no free one touches are left out.

    Raises:
        InputError: an overhang that the disc around a cell exceeds, or too many cells.
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
        raise input_error("map", f"has {rows} x {cols} cells that matter; the limit is {MAX_COVERED}")
    needed = _beside(free) & ~free
    # As if free ground lay around the map: a disc would do no harm there, but look as if it did.
    distance2 = np.empty((2 * free.shape[0] + 5, 2 * free.shape[1] + 5), dtype=np.int32)
    kernels.squared_distances(np.pad(free, 1, constant_values=True), CAP, distance2)
    distance2 = np.ascontiguousarray(distance2[2:-2, 2:-2])
    chosen = np.empty((int(needed.sum()), 4), dtype=np.int64)
    extra = 2 * (CORNER if overhang is None else max(CORNER, overhang / cell))
    i, j, radius2, inside2 = chosen[: kernels.greedy_cover(needed, distance2, extra, chosen)].T
    radius, (x0, y0) = np.sqrt(radius2) / 2, cells.origin
    discs = np.column_stack([x0 + j * (cell / 2), y0 + i * (cell / 2), radius * cell + SLACK])
    out = float((radius - np.sqrt(inside2) / 2).max(initial=0.0)) * cell
    return Cover(discs, int(needed.sum()), out)


def _beside(cells: Cells) -> Cells:
    """The cells that share a side or a corner with one of these, and these."""
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
    goal_tolerance: float = 0.25,
    cell: float | None = None,
) -> Task:
    """A map as a world of discs that can be planned and driven, between a start and a goal on free cells.

    ColonyGraph that free cells do not join to the start or the goal, side by side, counts as blocked, and the bounds, which
    are solid and straight, are drawn in to the free cells that remain. `cover` tells how the discs stand to the others;
    the world's source does, too. Planners use the map's own cells unless `cell` [m] is given.

    Raises:
        InputError: the start or the goal is missing, not on free ground or inside an overhang; the map is
            too large or needs too many discs.
    """
    from antdrive.worlds.formats import _kernels_cover as kernels

    if start is None or goal is None:
        missing = " and ".join(key for key, end in (("start", start), ("goal", goal)) if end is None)
        xmin, ymin, xmax, ymax = cells.bounds
        raise input_error(
            missing,
            f"maps have none; give it on free ground, within x {xmin:g} to {xmax:g} and y {ymin:g} to {ymax:g} m",
        )
    here, there = (_free_cell(cells, key, *end[:2]) for key, end in (("start", start), ("goal", goal)))
    reached = np.zeros(cells.free.shape, dtype=np.bool_)
    kernels.flood(cells.free, *here, reached)
    joined = bool(reached[there])
    kernels.flood(cells.free, *there, reached)
    used = _cropped(CellMap(reached, cells.resolution, cells.origin))
    found = cover(used, overhang)
    if len(found.discs) > MAX_DISCS:
        more = f"; a larger overhang than {found.overhang:.3g} m needs fewer" if overhang is None else ""
        raise input_error("map", f"needs {len(found.discs)} discs; the limit is {MAX_DISCS}{more}")
    rows, cols = cells.free.shape
    source = (
        f"{source}, {rows} x {cols} cells of {cells.resolution:g} m; the {found.cells} blocked cells next to free "
        f"ground are wholly covered by {len(found.discs)} cylinders that reach at most {found.overhang:.4g} m "
        "beyond blocked cells" + ("" if joined else "; start and goal are not joined")
    )
    try:
        world = World(name, used.bounds, tuple(Disc(*map(float, disc)) for disc in found.discs), source)
        return Task(world, start, goal, goal_tolerance, cells.resolution if cell is None else cell)
    except ValueError as error:
        hint = f"; it is within {found.overhang:.4g} m of a blocked cell" if "inside" in str(error) else ""
        raise input_error(f"{error}{hint}") from None


def _free_cell(cells: CellMap, key: str, x: float, y: float) -> tuple[int, int]:
    spot = cells.cell_at(x, y)
    if spot is None:
        xmin, ymin, xmax, ymax = cells.bounds
        raise input_error(
            key, f"({x:g}, {y:g}) is not on the map, which spans x {xmin:g} to {xmax:g} and y {ymin:g} to {ymax:g} m"
        )
    if not cells.free[spot]:
        raise input_error(key, f"({x:g}, {y:g}) is on a blocked cell, in row {spot[0]} from below and column {spot[1]}")
    return spot


def _cropped(cells: CellMap) -> CellMap:
    """The smallest rectangle of cells that holds all free ones: beyond it all is blocked anyway."""
    kept = np.argwhere(cells.free)
    (low, left), (high, right) = kept.min(axis=0), kept.max(axis=0) + 1
    x, y = cells.origin
    corner = (float(x + left * cells.resolution), float(y + low * cells.resolution))
    return CellMap(cells.free[low:high, left:right], cells.resolution, corner)
