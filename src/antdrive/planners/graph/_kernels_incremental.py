"""Compiled parts of the incremental searches: exact costs, an indexed heap, moves after an edit."""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, Array, inline, kernel

# Costs are integers, so keys are exact. STRAIGHT is a Pell number: DIAGONAL / STRAIGHT differs from sqrt(2) by
# 2e-19, and sums of fewer than a billion steps compare like a + b sqrt(2).
STRAIGHT = 1_311_738_121
DIAGONAL = 1_855_077_841
NEVER = 1 << 62  # above the cost of any path; their sum fits 64 bits

COST = np.array([STRAIGHT, DIAGONAL] * 4, dtype=np.int64)  # by direction


@inline
def octile(rows: int, cols: int) -> int:
    """Return the cost of the shortest path on an empty grid, in the same integers.

    `_kernels_search.octile` is the same distance in cells, with rounding.
    """
    rows, cols = abs(rows), abs(cols)
    return STRAIGHT * max(rows, cols) + (DIAGONAL - STRAIGHT) * min(rows, cols)


@kernel
def offsets(cols: int) -> Array:
    """Return the index offsets of the eight moves in a grid of `cols` columns."""
    offset = np.empty(8, dtype=np.int64)
    for k in range(8):
        offset[k] = DROW[k] * cols + DCOL[k]
    return offset


# The heap holds rows of (first key, second key, cell), the smallest first. `place` holds the row of each
# cell, -1 if the cell is not in the heap. The entries of `_kernels_sipp`'s open list have fixed keys, so it needs
# no `place`.


@inline
def before(heap: Array, i: int, first: int, second: int) -> bool:
    """Return whether entry i comes strictly before a key."""
    return bool(heap[i, 0] < first or (heap[i, 0] == first and heap[i, 1] < second))


@kernel
def rise(heap: Array, place: Array, i: int, first: int, second: int, cell: int) -> None:
    """Put an entry at the empty row i or above it."""
    while i > 0:
        parent = (i - 1) >> 1
        if not (first < heap[parent, 0] or (first == heap[parent, 0] and second < heap[parent, 1])):
            break
        heap[i, 0], heap[i, 1], heap[i, 2] = heap[parent, 0], heap[parent, 1], heap[parent, 2]
        place[heap[i, 2]] = i
        i = parent
    heap[i, 0], heap[i, 1], heap[i, 2] = first, second, cell
    place[cell] = i


@kernel
def sink(heap: Array, place: Array, size: int, i: int, first: int, second: int, cell: int) -> None:
    """Put an entry at the empty row i or below it."""
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        if child + 1 < size and before(heap, child + 1, heap[child, 0], heap[child, 1]):
            child += 1
        if not before(heap, child, first, second):
            break
        heap[i, 0], heap[i, 1], heap[i, 2] = heap[child, 0], heap[child, 1], heap[child, 2]
        place[heap[i, 2]] = i
        i = child
    heap[i, 0], heap[i, 1], heap[i, 2] = first, second, cell
    place[cell] = i


@kernel
def put(heap: Array, place: Array, size: int, cell: int, first: int, second: int) -> int:
    """Insert a cell or update its key; returns the new size."""
    i: Any = np.int64(place[cell])
    if i < 0:
        rise(heap, place, size, first, second, cell)
        return size + 1
    if before(heap, i, first, second):
        sink(heap, place, size, i, first, second, cell)
    else:
        rise(heap, place, i, first, second, cell)
    return size


@kernel
def take(heap: Array, place: Array, size: int, cell: int) -> int:
    """Remove a cell that is in the heap; returns the new size."""
    i: Any = np.int64(place[cell])
    place[cell] = -1
    size -= 1
    if i < size:
        first, second, last = heap[size, 0], heap[size, 1], heap[size, 2]
        if before(heap, i, first, second):
            sink(heap, place, size, i, first, second, last)
        else:
            rise(heap, place, i, first, second, last)
    return size


@inline
def moves_between_free(free: Array, r: int, c: int) -> int:
    """Return the moves of a cell between free cells.

    A diagonal also needs both its orthogonal neighbours free.
    """
    rows, cols = free.shape
    mask = 0
    if free[r, c]:
        for k in range(8):
            rn, cn = r + DROW[k], c + DCOL[k]
            if rn < 0 or rn >= rows or cn < 0 or cn >= cols or not free[rn, cn]:
                continue
            if k & 1 and not (free[r, cn] and free[rn, c]):
                continue
            mask |= 1 << k
    return mask


@kernel
def closed_moves(free: Array, moves: Array, closed: Array) -> None:
    """Fill `closed` with the forbidden moves between free cells."""
    rows, cols = free.shape
    for r in range(rows):
        for c in range(cols):
            closed[r, c] = moves_between_free(free, r, c) & ~moves[r, c]


@kernel
def mark(free: Array, closed: Array, moves: Array, cells: Array, value: bool, changed: Array) -> tuple[int, int]:
    """Make cells (N, 2) free or blocked, and list in `changed` the cells whose moves changed.

    Returns their number, and the index of the first cell outside the grid or -1. If a cell lies outside, nothing
    changes.
    """
    rows, cols = free.shape
    count = 0
    for n in range(len(cells)):
        if cells[n, 0] < 0 or cells[n, 0] >= rows or cells[n, 1] < 0 or cells[n, 1] >= cols:
            return 0, n
    for n in range(len(cells)):
        free[cells[n, 0], cells[n, 1]] = value
    for n in range(len(cells)):
        for r in range(max(0, cells[n, 0] - 1), min(rows, cells[n, 0] + 2)):
            for c in range(max(0, cells[n, 1] - 1), min(cols, cells[n, 1] + 2)):
                mask = moves_between_free(free, r, c) & ~closed[r, c]
                if mask != moves[r, c]:
                    moves[r, c] = mask
                    changed[count] = r * cols + c
                    count += 1
    return count, -1


@kernel
def adopt(moves: Array, new: Array, changed: Array) -> int:
    """Replace the moves by new ones and list in `changed` the cells where they differ; returns their number."""
    rows, cols = moves.shape
    count = 0
    for r in range(rows):
        for c in range(cols):
            if moves[r, c] != new[r, c]:
                moves[r, c] = new[r, c]
                changed[count] = r * cols + c
                count += 1
    return count
