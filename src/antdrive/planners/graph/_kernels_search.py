"""Compiled graph search over `Grid.moves`: arrays in, arrays out, no validation."""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, SQRT2, Array, doubled, inline, kernel
from antdrive.worlds._kernels_turns import MoveGraph, after_move, before_move, cell_of

# Path costs are a + b sqrt(2) with integers a and b. Different costs in one search differ by far more than this;
# rounding errors are far smaller.
TIE = 1e-6

# The open list is a ring of buckets, each a stack. One bucket spans 1/16 of a cell side; a move raises g + h
# by at most 2 sqrt(2) = 2.83 cell sides, so 64 buckets never overlap.
BUCKETS = 64
PER_CELL = 16.0

# Bits of `mark`: 0 to 2 hold the move by which a cell was entered.
SEEN = 8
CLOSED = 16


def _shunned() -> Array:
    """Return the redundant moves out of a cell, by the move into it and the allowed moves of its predecessor.

    They lead back, or to a cell that the predecessor reaches by a single move at no higher cost.
    """
    step = {(int(r), int(c)): k for k, (r, c) in enumerate(zip(DROW, DCOL, strict=True))}
    table = np.zeros((8, 256), dtype=np.uint8)
    for entered in range(8):
        for k in range(8):
            row, col = int(DROW[entered] + DROW[k]), int(DCOL[entered] + DCOL[k])
            if row == 0 and col == 0:
                table[entered] |= 1 << k
            elif (row, col) in step:
                able = (np.arange(256) >> step[row, col]) & 1 == 1
                table[entered, able] |= 1 << k
    return table


SHUNNED = _shunned()


@inline
def octile(rows: int, cols: int) -> float:
    """Return the length of the shortest path on an empty grid between cells `rows` and `cols` apart [cells]."""
    rows, cols = abs(rows), abs(cols)
    return max(rows, cols) + (SQRT2 - 1.0) * min(rows, cols)


@kernel
def traced(graph: MoveGraph, mark: Array, start: int, last: int) -> tuple[Array, int]:
    """Return the path (N, 2) along the moves by which nodes were entered, and its number of diagonal steps."""
    n = 1
    i = last
    while i != start:
        i = before_move(graph, i, mark[i] & 7)
        n += 1
    cells = np.empty((n, 2), dtype=np.int32)
    diagonal = 0
    i = last
    for step in range(n - 1, -1, -1):
        here = cell_of(graph, i)
        cells[step, 0] = here // graph.cols
        cells[step, 1] = here % graph.cols
        if step > 0:
            diagonal += mark[i] & 1
            i = before_move(graph, i, mark[i] & 7)
    return cells, diagonal


@kernel
def shortest_path(graph: MoveGraph, start: int, goal: int, informed: bool) -> tuple[Array, int, int, int]:
    """Return the shortest path (N, 2), empty without one; its straight and diagonal steps; the expanded nodes.

    From a start node to any node of the goal cell. A* with the octile heuristic if `informed`, else Dijkstra's algorithm.
    Nodes may leave a bucket out of order, so a closed node is reopened if its cost drops, and the search ends only when
    nothing cheaper is open.

    The open list is inlined in the loop for speed, as most planners use this search.
    """
    mask, cols = graph.mask, graph.cols
    turning = len(graph.cell) > 0
    r1, c1 = goal // cols, goal % cols
    mark = np.zeros(len(mask), dtype=np.uint8)
    cost = np.empty(len(mask), dtype=np.float64)  # only read where seen
    head = np.full(BUCKETS, -1, dtype=np.int32)
    entry_cell = np.empty(1024, dtype=np.int32)
    entry_next = np.empty(1024, dtype=np.int32)
    entries, spare = 0, -1  # the number of entries, and the first reusable one

    here = cell_of(graph, start)
    origin = octile(r1 - here // cols, c1 - here % cols) if informed else 0.0
    mark[start] = SEEN
    cost[start] = 0.0
    entry_cell[0], entry_next[0] = start, -1
    head[0], entries = 0, 1
    waiting, bucket, expanded = 1, 0, 0
    last: Any = np.int64(-1)
    limit = np.inf

    while waiting > 0:
        slot = bucket & (BUCKETS - 1)
        entry = head[slot]
        if entry < 0:
            if last >= 0:
                break
            bucket += 1
            continue
        head[slot] = entry_next[entry]
        entry_next[entry] = spare
        spare = entry
        waiting -= 1
        i: Any = np.int64(entry_cell[entry])
        if mark[i] & CLOSED:
            continue
        mark[i] |= CLOSED
        g = cost[i]
        here = cell_of(graph, i)
        if here == goal:
            if g < limit:
                limit, last = g - TIE, i
            continue
        row = here // cols
        col = here - row * cols
        if limit < np.inf:  # the goal is closed; finish its bucket
            h = octile(r1 - row, c1 - col) if informed else 0.0
            if g + h >= limit:
                continue
        expanded += 1
        todo = mask[i]
        if i != start and not turning:
            entered = mark[i] & 7
            todo &= ~SHUNNED[entered, mask[before_move(graph, i, entered)]]
        for k in range(8):
            if not todo & (1 << k):
                continue
            j = after_move(graph, i, k)
            g_new = g + (SQRT2 if k & 1 else 1.0)
            if mark[j] & SEEN and g_new >= cost[j] - TIE:
                continue
            mark[j] = SEEN | k
            cost[j] = g_new
            h = octile(r1 - row - DROW[k], c1 - col - DCOL[k]) if informed else 0.0
            slot = max(bucket, int((g_new + h - origin) * PER_CELL + TIE)) & (BUCKETS - 1)
            if spare >= 0:
                entry = spare
                spare = entry_next[entry]
            else:
                if entries == len(entry_cell):
                    entry_cell = doubled(entry_cell)
                    entry_next = doubled(entry_next)
                entry = np.int32(entries)
                entries += 1
            entry_cell[entry] = j
            entry_next[entry] = head[slot]
            head[slot] = entry
            waiting += 1

    if last < 0:
        return np.empty((0, 2), dtype=np.int32), 0, 0, expanded
    cells, diagonal = traced(graph, mark, start, last)
    return cells, len(cells) - 1 - diagonal, diagonal, expanded
