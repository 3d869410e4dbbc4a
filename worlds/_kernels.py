"""Compiled geometry: arrays in, arrays out, nothing validated."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.worlds._kernels_compiler import inline as inline
from antdrive.worlds._kernels_compiler import kernel as kernel

Array = Any

SQRT2 = math.sqrt(2.0)
ROUNDING = 1e-6  # a disc is left out only if it is this much too far away to matter, so that no result changes [m]
# Directions by bit: E, NE, N, NW, W, SW, S, SE as (row, column) steps; row grows with y.
DROW = np.array([0, 1, 1, 1, 0, -1, -1, -1], dtype=np.int64)
DCOL = np.array([1, 1, 0, -1, -1, -1, 0, 1], dtype=np.int64)


@kernel
def doubled(array: Array) -> Array:
    """A copy of a vector with twice its length; the second half is undefined."""
    out = np.empty(2 * len(array), dtype=array.dtype)
    for i in range(len(array)):
        out[i] = array[i]
    return out


@kernel
def doubled_rows(array: Array) -> Array:
    """A copy of a table (N, M) with twice its rows; the second half is undefined."""
    out = np.empty((2 * len(array), array.shape[1]), dtype=array.dtype)
    for i in range(len(array)):
        for j in range(array.shape[1]):
            out[i, j] = array[i, j]
    return out


@kernel
def segment_distance2(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Squared distance from a point to the closed segment ab."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    t = 0.0
    if length2 > 0.0:
        t = ((px - ax) * dx + (py - ay) * dy) / length2
        t = min(1.0, max(0.0, t))
    ex, ey = ax + t * dx - px, ay + t * dy - py
    return ex * ex + ey * ey


@kernel
def wall_distance(x: float, y: float, bounds: Array) -> float:
    """Distance to the nearest wall, negative outside."""
    return float(min(min(x - bounds[0], bounds[2] - x), min(y - bounds[1], bounds[3] - y)))


@kernel
def point_clearances(points: Array, discs: Array, bounds: Array, out: Array) -> None:
    """out[i] = distance from point i to the nearest disc surface or wall."""
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        best = wall_distance(x, y, bounds)
        for j in range(discs.shape[0]):
            dx, dy, reach = x - discs[j, 0], y - discs[j, 1], best + discs[j, 2] + ROUNDING
            if dx * dx + dy * dy > reach * reach:
                continue
            best = min(best, math.hypot(x - discs[j, 0], y - discs[j, 1]) - discs[j, 2])
        out[i] = best


@kernel
def segment_clearance(ax: float, ay: float, bx: float, by: float, discs: Array, bounds: Array) -> float:
    """Distance from a segment to the nearest disc surface or wall."""
    # Inside the box the distance to the nearest wall is concave along a segment, so its minimum is at an end.
    best = min(wall_distance(ax, ay, bounds), wall_distance(bx, by, bounds))
    mx, my, half = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * math.hypot(bx - ax, by - ay) + ROUNDING
    for j in range(discs.shape[0]):
        dx, dy, reach = discs[j, 0] - mx, discs[j, 1] - my, best + discs[j, 2] + half
        if dx * dx + dy * dy > reach * reach:
            continue
        best = min(best, math.sqrt(segment_distance2(discs[j, 0], discs[j, 1], ax, ay, bx, by)) - discs[j, 2])
    return best


@kernel
def segment_clearances(starts: Array, ends: Array, discs: Array, bounds: Array, out: Array) -> None:
    """out[i] = clearance of the segment starts[i]..ends[i]."""
    for i in range(starts.shape[0]):
        out[i] = segment_clearance(starts[i, 0], starts[i, 1], ends[i, 0], ends[i, 1], discs, bounds)


@kernel
def rasterise(
    discs: Array, bounds: Array, x0: float, y0: float, cell: float, inflate: float, free: Array, closed: Array
) -> None:
    """Fill `free` with the free cells, and mark in `closed` the moves between free cells that a disc blocks.

    A cell is blocked when its centre is no farther than `inflate` from a disc or a wall.
    `closed` has the bits of E, NE, N and NW only, so that each pair of opposite moves is stored once.
    """
    rows, cols = free.shape
    within = np.empty(cols, dtype=np.bool_)
    for c in range(cols):
        x = x0 + c * cell
        within[c] = min(x - bounds[0], bounds[2] - x) > inflate
    for r in range(rows):
        y = y0 + r * cell
        inside = min(y - bounds[1], bounds[3] - y) > inflate
        for c in range(cols):
            free[r, c] = inside and within[c]
    for j in range(discs.shape[0]):
        cx, cy, radius = discs[j, 0], discs[j, 1], discs[j, 2] + inflate
        r_lo = max(0, int(math.floor((cy - radius - y0) / cell)))
        r_hi = min(rows - 1, int(math.ceil((cy + radius - y0) / cell)))
        for r in range(r_lo, r_hi + 1):
            dy = y0 + r * cell - cy
            if abs(dy) > radius:
                continue
            half = math.sqrt(radius * radius - dy * dy)
            c_lo = max(0, int(math.floor((cx - half - x0) / cell)))
            c_hi = min(cols - 1, int(math.ceil((cx + half - x0) / cell)))
            for c in range(c_lo, c_hi + 1):
                dx = x0 + c * cell - cx
                if dx * dx + dy * dy <= radius * radius:
                    free[r, c] = False
    # Only a disc close to both ends can block a move between free cells, so look at the cells along each disc's rim.
    for j in range(discs.shape[0]):
        cx, cy, radius = discs[j, 0], discs[j, 1], discs[j, 2] + inflate
        reach = radius + SQRT2 * cell
        r_lo = max(0, int(math.floor((cy - reach - y0) / cell)))
        r_hi = min(rows - 1, int(math.ceil((cy + reach - y0) / cell)))
        for r in range(r_lo, r_hi + 1):
            y = y0 + r * cell
            dy = abs(y - cy)
            if dy > reach:
                continue
            half = math.sqrt(reach * reach - dy * dy)
            inner = math.sqrt(radius * radius - dy * dy) - cell if dy < radius else -1.0
            c_lo = max(0, int(math.floor((cx - half - x0) / cell)))
            c_hi = min(cols - 1, int(math.ceil((cx + half - x0) / cell)))
            c = c_lo
            while c <= c_hi:
                x = x0 + c * cell
                if abs(x - cx) < inner:  # deep inside the disc all cells are blocked: skip to the other side
                    c = max(c + 1, int(math.floor((cx + inner - x0) / cell)))
                    continue
                if free[r, c]:
                    for k in range(4):
                        rn, cn = r + DROW[k], c + DCOL[k]
                        if rn < 0 or rn >= rows or cn < 0 or cn >= cols or not free[rn, cn]:
                            continue
                        d2 = segment_distance2(cx, cy, x, y, x0 + cn * cell, y0 + rn * cell)
                        if d2 <= radius * radius:
                            closed[r, c] |= 1 << k
                c += 1


@kernel
def allowed_moves(free: Array, closed: Array, moves: Array) -> None:
    """Fill `moves` (all 0 before) with the masks of allowed moves; a diagonal needs both orthogonal neighbours free."""
    rows, cols = free.shape
    for r in range(rows):
        for c in range(cols):
            if not free[r, c]:
                continue
            shut = closed[r, c]
            east, north = c + 1 < cols and free[r, c + 1], r + 1 < rows and free[r + 1, c]
            if east and not shut & 1:
                moves[r, c] |= 1
                moves[r, c + 1] |= 16
            if north:
                if east and free[r + 1, c + 1] and not shut & 2:
                    moves[r, c] |= 2
                    moves[r + 1, c + 1] |= 32
                if not shut & 4:
                    moves[r, c] |= 4
                    moves[r + 1, c] |= 64
                if c > 0 and free[r, c - 1] and free[r + 1, c - 1] and not shut & 8:
                    moves[r, c] |= 8
                    moves[r + 1, c - 1] |= 128
