"""Compiled straight lines and corridors: arrays in, arrays out, no validation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, Array, kernel, segment_distance2, wall_distance

EDGE = 1e-9  # cells: a line this close to a cell's border touches the cell behind it


class Terrain(NamedTuple):
    """Obstacles of straight lines, for compiled code.

    Attributes:
        discs: x, y and radius + inflation of each disc [m] (N, 3)
        bounds: the walls [m] (4,)
        inflate: the clearance from the walls [m]
        free: the grid (R, C)
        x0: x of the centre of cell (0, 0) [m]
        y0: y of the centre of cell (0, 0) [m]
        cell: the side of a cell [m]
        bare: whether `free` decides instead of discs and walls, as there is no world
    """

    discs: Array
    bounds: Array
    inflate: float
    free: Array
    x0: float
    y0: float
    cell: float
    bare: bool


@kernel
def clear_line(land: Terrain, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether the segment ab is collision-free; contact counts as collision."""
    if land.bare:
        return clear_cells(
            land.free,
            (ay - land.y0) / land.cell,
            (ax - land.x0) / land.cell,
            (by - land.y0) / land.cell,
            (bx - land.x0) / land.cell,
        )
    if wall_distance(ax, ay, land.bounds) <= land.inflate or wall_distance(bx, by, land.bounds) <= land.inflate:
        return False
    left, right = min(ax, bx), max(ax, bx)
    low, high = min(ay, by), max(ay, by)
    for j in range(land.discs.shape[0]):
        x, y, radius = land.discs[j, 0], land.discs[j, 1], land.discs[j, 2]
        if x + radius < left or x - radius > right or y + radius < low or y - radius > high:
            continue
        if segment_distance2(x, y, ax, ay, bx, by) <= radius * radius:
            return False
    return True


@kernel
def clear_cells(free: Array, r0: float, c0: float, r1: float, c1: float) -> bool:
    """Return whether every cell that the segment touches, even at a corner, is free."""
    rows, cols = free.shape
    first = math.ceil(min(r0, r1) - 0.5 - EDGE)
    last = math.floor(max(r0, r1) + 0.5 + EDGE)
    if first < 0 or last >= rows:
        return False
    for r in range(first, last + 1):
        # The part of the segment within this row of cells, borders included.
        t0, t1 = 0.0, 1.0
        if r1 != r0:
            ta, tb = (r - 0.5 - EDGE - r0) / (r1 - r0), (r + 0.5 + EDGE - r0) / (r1 - r0)
            t0, t1 = max(0.0, min(ta, tb)), min(1.0, max(ta, tb))
        ca, cb = c0 + t0 * (c1 - c0), c0 + t1 * (c1 - c0)
        left = math.ceil(min(ca, cb) - 0.5 - EDGE)
        right = math.floor(max(ca, cb) + 0.5 + EDGE)
        if left < 0 or right >= cols:
            return False
        for c in range(left, right + 1):
            if not free[r, c]:
                return False
    return True


@kernel
def pull(land: Terrain, xy: Array) -> Array:
    """Return the indices of the points that remain when a polyline (M, 2) is pulled straight, ends included.

    Each kept point connects to the last point in clear line of sight, or to the next if there is none.
    """
    n = xy.shape[0]
    kept = np.empty(n, dtype=np.int64)
    kept[0], size, i = 0, 1, 0
    while i < n - 1:
        j = n - 1
        while j > i + 1 and not clear_line(land, xy[i, 0], xy[i, 1], xy[j, 0], xy[j, 1]):
            j -= 1
        i = j
        kept[size] = i
        size += 1
    return kept[:size]


@kernel
def corridor_moves(moves: Array, line: Array, width: float) -> Array:
    """Return the moves between cells whose centres lie within `width` of a polyline (M, 2), all in cells."""
    rows, cols = moves.shape
    inside = np.zeros((rows, cols), dtype=np.bool_)
    for s in range(line.shape[0] - 1):
        r0, c0, r1, c1 = line[s, 0], line[s, 1], line[s + 1, 0], line[s + 1, 1]
        for r in range(
            max(0, math.ceil(min(r0, r1) - width)),
            min(rows - 1, math.floor(max(r0, r1) + width)) + 1,
        ):
            # In a row, the cells near a segment lie beside its part within `width` of the row.
            t0, t1 = 0.0, 1.0
            if r1 != r0:
                ta, tb = (r - width - r0) / (r1 - r0), (r + width - r0) / (r1 - r0)
                t0, t1 = max(0.0, min(ta, tb)), min(1.0, max(ta, tb))
            ca, cb = c0 + t0 * (c1 - c0), c0 + t1 * (c1 - c0)
            for c in range(
                max(0, math.ceil(min(ca, cb) - width)),
                min(cols - 1, math.floor(max(ca, cb) + width)) + 1,
            ):
                if segment_distance2(float(r), float(c), r0, c0, r1, c1) <= width * width:
                    inside[r, c] = True
    out = np.zeros((rows, cols), dtype=np.uint8)
    for r in range(rows):
        for c in range(cols):
            if inside[r, c] and moves[r, c]:
                for k in range(8):
                    if moves[r, c] & (1 << k) and inside[r + DROW[k], c + DCOL[k]]:
                        out[r, c] |= 1 << k
    return out


@kernel
def visits(lines: Array, shape: tuple[int, int]) -> Array:
    """Count the polylines (K, M, 2), in cells, that pass through each cell."""
    rows, cols = shape
    count = np.zeros((rows, cols), dtype=np.float64)
    seen = np.full((rows, cols), -1, dtype=np.int64)
    for k in range(lines.shape[0]):
        for s in range(lines.shape[1] - 1):
            dr, dc = lines[k, s + 1, 0] - lines[k, s, 0], lines[k, s + 1, 1] - lines[k, s, 1]
            steps = max(1, math.ceil(max(abs(dr), abs(dc))))
            for i in range(steps + 1):
                r = math.floor(lines[k, s, 0] + dr * i / steps + 0.5)
                c = math.floor(lines[k, s, 1] + dc * i / steps + 0.5)
                if 0 <= r < rows and 0 <= c < cols and seen[r, c] != k:
                    seen[r, c] = k
                    count[r, c] += 1.0
    return count
