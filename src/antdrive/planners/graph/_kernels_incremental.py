"""Compiled parts of the incremental searches: exact costs, an indexed heap, moves after an edit."""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, Array, doubled, inline, kernel, leaf
from antdrive.worlds._kernels_turns import NOWHERE, MoveGraph, after_move

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


# A graph's arrays in the inner loop of a search halve its speed. So searches call these functions for graphs with turns, and
# use offsets without.


@leaf
def successor(u: int, k: int, graph: MoveGraph) -> Any:
    """Return the node that allowed move k leads to from u, with turns."""
    return after_move(graph, u, k)


@leaf
def cost_through(u: int, k: int, graph: MoveGraph, g: Array) -> Any:
    """Return the cost to the goal through allowed move k of u, with turns."""
    return g[after_move(graph, u, k)] + COST[k]


# The heap holds rows of (first key, second key, cell), the smallest first. `place` holds the row of each
# cell, -1 if the cell is not in the heap. The entries of `_kernels_sipp`'s open list have fixed keys, so it needs
# no `place`.


@inline
def before(heap: Array, i: int, first: int, second: int) -> bool:
    """Return whether entry i comes strictly before a key."""
    return bool(heap[i, 0] < first or (heap[i, 0] == first and heap[i, 1] < second))


@leaf
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


@leaf
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


@leaf
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


@leaf
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
def moves_between_free(free: Array, r: int, c: int, turning: bool) -> int:
    """Return the moves of a cell between free cells.

    Without turns a diagonal also needs both its orthogonal neighbours free.
    """
    rows, cols = free.shape
    mask = 0
    if free[r, c]:
        for k in range(8):
            rn, cn = r + DROW[k], c + DCOL[k]
            if rn < 0 or rn >= rows or cn < 0 or cn >= cols or not free[rn, cn]:
                continue
            if k & 1 and not turning and not (free[r, cn] and free[rn, c]):
                continue
            mask |= 1 << k
    return mask


@kernel
def closed_moves(free: Array, moves: Array, turning: bool, closed: Array) -> None:
    """Fill `closed` with the forbidden moves: without turns those between free cells, with turns all."""
    rows, cols = free.shape
    for r in range(rows):
        for c in range(cols):
            able = 255 if turning else moves_between_free(free, r, c, turning)
            closed[r, c] = able & ~moves[r, c]


@inline
def give_moves(cell: int, able: int, label: Array, mask: Array) -> None:
    """Give the nodes of a cell its moves: move k is that of the label of heading k."""
    for k in range(8):
        node = label[cell, k]
        if node >= 0:
            mask[node] = (mask[node] & ~(1 << k)) | (able & (1 << k))


@kernel
def mark(
    free: Array, closed: Array, moves: Array, label: Array, mask: Array, cells: Array, value: bool, changed: Array
) -> tuple[int, int]:
    """Make cells (N, 2) free or blocked, and list in `changed` the cells whose moves changed.

    With turns, a cell without a label stays blocked, and `mask` has the moves of the nodes. Returns the number of changed cells,
    and the index of the first cell outside the grid or -1. If a cell lies outside, nothing changes.
    """
    rows, cols = free.shape
    turning = len(label) > 0
    count = 0
    for n in range(len(cells)):
        if cells[n, 0] < 0 or cells[n, 0] >= rows or cells[n, 1] < 0 or cells[n, 1] >= cols:
            return 0, n
    for n in range(len(cells)):
        r, c = cells[n, 0], cells[n, 1]
        free[r, c] = value and (not turning or label[r * cols + c].max() >= 0)
    for n in range(len(cells)):
        for r in range(max(0, cells[n, 0] - 1), min(rows, cells[n, 0] + 2)):
            for c in range(max(0, cells[n, 1] - 1), min(cols, cells[n, 1] + 2)):
                able = moves_between_free(free, r, c, turning) & ~closed[r, c]
                if able != moves[r, c]:
                    moves[r, c] = able
                    changed[count] = r * cols + c
                    count += 1
                    if turning:
                        give_moves(r * cols + c, able, label, mask)
    return count, -1


@kernel
def adopt(moves: Array, new: Array, relabelled: Array, changed: Array) -> int:
    """Replace the moves by new ones and list in `changed` the cells where they differ, or lead to other nodes.

    `relabelled` marks the cells whose labels changed (cells,); it is empty without turns. Returns the number of changed cells.
    """
    rows, cols = moves.shape
    count = 0
    for r in range(rows):
        for c in range(cols):
            differs = moves[r, c] != new[r, c]
            if len(relabelled) and not differs:
                for rn in range(max(0, r - 1), min(rows, r + 2)):
                    for cn in range(max(0, c - 1), min(cols, c + 2)):
                        differs |= relabelled[rn * cols + cn]
            if differs:
                moves[r, c] = new[r, c]
                changed[count] = r * cols + c
                count += 1
    return count


@kernel
def adopt_cells(free: Array, moves: Array, new_free: Array, new_moves: Array, cells: Array, changed: Array) -> int:
    """Replace some cells, free or not, and their moves by new ones, and list in `changed` those whose moves differ.

    Return their number. The grids are flat.
    """
    count = 0
    for i in cells:
        free[i] = new_free[i]
        if moves[i] != new_moves[i]:
            moves[i] = new_moves[i]
            changed[count] = i
            count += 1
    return count


@kernel
def nodes_of_cells(cell: Array, cells: int) -> Array:
    """Return the nodes of each cell in order of their numbers (cells, 8), -1 after the last; `cell` is that of each node."""
    own = np.full((cells, 8), NOWHERE, dtype=np.int32)
    for node in range(len(cell)):
        i, count = cell[node], 0
        while own[i, count] >= 0:
            count += 1
        own[i, count] = node
    return own


@kernel
def relabel(label: Array, new: Array, own: Array, cell: Array, relabelled: Array) -> Array:
    """Replace the labels by those of a grid with other numbers of its nodes, and mark the cells that they differ in.

    The labels of a cell are the nodes `own` (cells, 8) that it had before, in order; it gets more if it never had as many. So
    nodes keep their numbers where nothing changed. Returns the cells of all nodes: `cell`, extended by those of new nodes.
    """
    size = len(cell)
    for i in range(len(label)):
        relabelled[i] = False
        last, most, same = NOWHERE, NOWHERE, True
        for k in range(8):
            most = max(most, new[i, k])
            same &= new[i, k] == label[i, k]
        if same:
            continue
        rank = 0
        while last < most:  # the labels in order of their nodes
            node = most
            for k in range(8):
                if last < new[i, k] < node:
                    node = new[i, k]
            if own[i, rank] < 0:
                own[i, rank] = size
                if size == len(cell):
                    cell = doubled(cell)
                cell[size] = i
                size += 1
            for k in range(8):
                if new[i, k] == node and label[i, k] != own[i, rank]:
                    label[i, k] = own[i, rank]
                    relabelled[i] = True
            last, rank = node, rank + 1
        for k in range(8):
            if new[i, k] < 0 and label[i, k] >= 0:
                label[i, k] = NOWHERE
                relabelled[i] = True
    return cell[:size].copy()


@kernel
def move_masks(moves: Array, label: Array, mask: Array) -> None:
    """Fill the moves `mask` (nodes,) of all nodes."""
    mask[:] = 0
    for i in range(len(label)):
        give_moves(i, moves[i], label, mask)
