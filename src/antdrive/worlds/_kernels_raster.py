"""Compiled rasterising of a changing list of discs, tile by tile."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import (
    APART,
    ONE,
    Array,
    allowed_moves,
    block_cells,
    close_moves,
    close_rim,
    inline,
    kernel,
)

AHEAD = 64  # rows of a list that are searched for the next row of the other
NEAR = 0.02  # discs this close in their lists and on the ground are taken for one [m]
TALL, WIDE = 16, 64  # rows and columns of a tile; a row of a tile is one word of bits
BESIDE = 2.0  # a disc changes moves of cells up to this far beyond its rim [cells]
CHANGED = 16  # bit beside the closed moves of a cell that became free or blocked


@inline
def same(a: Array, i: int, b: Array, j: int) -> bool:
    """Return whether two discs are equal."""
    return bool(a[i, 0] == b[j, 0] and a[i, 1] == b[j, 1] and a[i, 2] == b[j, 2])


@kernel
def differences(old: Array, new: Array, pairs: Array) -> int:
    """Fill `pairs` with the rows of each list that are in no place of the other; return their number.

    A pair is a row that goes and one that comes, -1 for none. Lists in nearly the same order leave few pairs.
    """
    i, j, count = 0, 0, 0
    while i < len(old) or j < len(new):
        gone, come = 1 if i < len(old) else 0, 1 if j < len(new) else 0
        if gone and come:
            if same(old, i, new, j):
                i, j = i + 1, j + 1
                continue
            apart = abs(old[i, 0] - new[j, 0]) + abs(old[i, 1] - new[j, 1])
            if apart < NEAR:  # one disc that was measured again
                pairs[count, 0], pairs[count, 1] = i, j
                i, j, count = i + 1, j + 1, count + 1
                continue
            while gone < AHEAD and i + gone < len(old) and not same(old, i + gone, new, j):
                gone += 1
            while come < min(gone, AHEAD) and j + come < len(new) and not same(old, i, new, j + come):
                come += 1
            if come < min(gone, AHEAD) and j + come < len(new):
                gone = 0
            elif gone < AHEAD and i + gone < len(old):
                come = 0
            else:
                gone, come = 1, 1
        for n in range(max(gone, come)):
            pairs[count, 0] = i + n if n < gone else -1
            pairs[count, 1] = j + n if n < come else -1
            count += 1
        i, j = i + gone, j + come
    return count


@inline
def tiles_near(
    x: float, y: float, radius: float, x0: float, y0: float, cell: float, dirty: Array
) -> tuple[int, int, int, int]:
    """Return the first and last rows and columns of the tiles whose moves a disc may change; no row or column off the grid."""
    reach = radius + (BESIDE + 0.5) * cell
    r_lo, r_hi = math.floor((y - reach - y0) / cell), math.ceil((y + reach - y0) / cell)
    c_lo, c_hi = math.floor((x - reach - x0) / cell), math.ceil((x + reach - x0) / cell)
    rows, cols = dirty.shape
    return max(0, r_lo // TALL), min(rows - 1, r_hi // TALL), max(0, c_lo // WIDE), min(cols - 1, c_hi // WIDE)


@kernel
def adapt(
    old: Array, new: Array, bounds: Array, x0: float, y0: float, cell: float, inflate: float, blocked: Array,
    closed: Array, free: Array, moves: Array,
) -> Array:  # fmt: skip
    """Adapt the free cells and allowed moves to a new list of discs; return the flat cells where they differ (K,).

    Only tiles near discs of one list alone are rasterised again. The kernels are those of `rasterise` and see the same
    numbers, so the results have the same bits.

    Args:
        old: the discs before (N, 3)
        new: the discs (M, 3)
        blocked: a bit for each cell in a disc (R, C // 64 + 1)
        closed: the closed moves E, NE, N and NW of each cell (R, C)
    """
    rows, cols = free.shape
    dirty = np.zeros(((rows + TALL - 1) // TALL, blocked.shape[1]), dtype=np.bool_)
    pairs = np.empty((len(old) + len(new), 2), dtype=np.int64)
    for n in range(differences(old, new, pairs)):
        for k in range(2):
            if pairs[n, k] >= 0:
                x, y, radius = (old if k == 0 else new)[pairs[n, k]]
                top, bottom, left, right = tiles_near(x, y, radius + inflate, x0, y0, cell, dirty)
                for i in range(top, bottom + 1):
                    for j in range(left, right + 1):
                        dirty[i, j] = True
    before = blocked.copy()
    for i in range(dirty.shape[0]):
        for j in range(dirty.shape[1]):
            if dirty[i, j]:
                blocked[TALL * i : TALL * (i + 1), j] = 0
    inside = clear_of_walls(bounds[1], bounds[3], y0, cell, inflate, rows)
    within = clear_of_walls(bounds[0], bounds[2], x0, cell, inflate, cols)
    near, grazes = near_dirty(new, inflate, x0, y0, cell, cols, dirty, blocked)
    for i in range(dirty.shape[0]):
        for j in range(dirty.shape[1]):
            if dirty[i, j]:
                free_tile(i, j, inside, within, before, blocked, closed, free)
    for n in range(len(near)):
        x, y, radius = new[near[n]]
        if grazes[n]:
            close_rim(x, y, radius + inflate, x0, y0, cell, free, closed)
        else:
            close_moves(x, y, radius + inflate, x0, y0, cell, free, closed)
    changed, count = np.empty(dirty.sum() * TALL * WIDE, dtype=np.int64), 0
    for i in range(dirty.shape[0]):
        for j in range(dirty.shape[1]):
            if dirty[i, j]:
                count = moves_of_tile(i, j, free, closed, moves, changed, count)
    return changed[:count].copy()


@kernel
def near_dirty(
    discs: Array, inflate: float, x0: float, y0: float, cell: float, cols: int, dirty: Array, blocked: Array
) -> tuple[Array, Array]:
    """Set the bits of the cells in all discs near dirty tiles; return these discs, and whether centres lie on their rims."""
    near, grazes = np.empty(len(discs), dtype=np.int64), np.empty(len(discs), dtype=np.bool_)
    count = 0
    for first in range(APART):  # as in `rasterise`
        for n in range(first, len(discs), APART):
            x, y, radius = discs[n]
            top, bottom, left, right = tiles_near(x, y, radius + inflate, x0, y0, cell, dirty)
            some = False
            for i in range(top, bottom + 1):
                for j in range(left, right + 1):
                    some |= dirty[i, j]
            if some:
                near[count] = n
                grazes[count] = block_cells(x, y, radius + inflate, x0, y0, cell, cols, blocked)
                count += 1
    return near[:count], grazes[:count]


@kernel
def free_tile(
    i: int, j: int, inside: Array, within: Array, before: Array, blocked: Array, closed: Array, free: Array
) -> None:
    """Fill in the free cells of a tile, without closed moves; `CHANGED` marks the cells that differ.

    Args:
        inside: rows clear of the walls (R,)
        within: columns clear of the walls (C,)
        before: the bits of the blocked cells before
    """
    rows, cols = free.shape
    for r in range(TALL * i, min(rows, TALL * (i + 1))):
        bits = blocked[r, j]
        if bits == before[r, j]:
            closed[r, WIDE * j : WIDE * (j + 1)] = 0
            continue
        for c in range(WIDE * j, min(cols, WIDE * (j + 1))):
            now = inside[r] & within[c] & ((bits >> np.uint64(c & 63)) & ONE == 0)
            closed[r, c] = np.uint8(now ^ free[r, c]) * np.uint8(CHANGED)
            free[r, c] = now


@kernel
def clear_of_walls(low: float, high: float, begin: float, cell: float, inflate: float, count: int) -> Array:
    """Return which cells in a row from `begin` on keep their distance from both walls (count,)."""
    out = np.empty(count, dtype=np.bool_)
    for n in range(count):
        at = begin + n * cell
        out[n] = min(at - low, high - at) > inflate
    return out


@kernel
def moves_of_tile(i: int, j: int, free: Array, closed: Array, moves: Array, changed: Array, count: int) -> int:
    """Fill in the allowed moves of a tile, and list the cells that differ; return their number."""
    rows, cols = free.shape
    top, bottom = TALL * i, min(rows, TALL * (i + 1))
    left, right = WIDE * j, min(cols, WIDE * (j + 1))
    if left >= right:
        return count
    up, back = max(0, top - 1), max(0, left - 1)  # the cells beside the tile decide on its moves, too
    down, on = min(rows, bottom + 1), min(cols, right + 1)
    now = np.empty((down - up, on - back), dtype=np.uint8)
    allowed_moves(free[up:down, back:on].copy(), closed[up:down, back:on].copy(), now)
    for r in range(top, bottom):
        for c in range(left, right):
            able = now[r - up, c - back]
            if able != moves[r, c] or closed[r, c] & CHANGED:
                moves[r, c] = able
                changed[count] = r * cols + c
                count += 1
    return count
