"""Compiled D*: arrays in, arrays out, no validation.

A. Stentz, *Optimal and efficient path planning for partially-known environments*, ICRA 1994; names and line
numbers as in the paper. States are the graph's nodes. `h` is the cost to the goal cell and `back` the backpointer b as a
direction, 8 for none; `heap` and `place` are the OPEN list by k, `size` its length. A NEW state has h = NEVER
and is not on the list.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.planners.graph._kernels_incremental import COST, NEVER, offsets, put, successor, take
from antdrive.worlds._kernels import DCOL, DROW, Array, inline, kernel
from antdrive.worlds._kernels_turns import MoveGraph, after_move, beside, cell_of


@inline
def insert(x: int, cost: int, h: Array, heap: Array, place: Array, size: int) -> int:
    """Do INSERT(X, h_new): the key k is the least h since X joined the list; returns the list's length."""
    k = min(heap[place[x], 0], cost) if place[x] >= 0 else min(h[x], cost)
    h[x] = cost
    return put(heap, place, size, x, k, k)


@kernel
def settle(
    graph: MoveGraph, start: int, h: Array, back: Array, heap: Array, place: Array, size: int
) -> tuple[int, int]:
    """Repeat PROCESS-STATE until k_min reaches h(start).

    Returns the list's length and the number of processed states.
    """
    cols, mask, offset, turning = graph.cols, graph.mask, offsets(graph.cols), len(graph.cell) > 0
    rows, cell, label = len(mask) // cols, graph.cell, graph.label  # rows without turns
    processed = 0
    while size > 0 and heap[0, 0] < h[start]:  # L1 to L3
        x, k_old = heap[0, 2], heap[0, 0]
        size = take(heap, place, size, x)
        processed += 1
        row = x // cols
        col = x - row * cols
        if k_old < h[x]:  # L4 to L7: a neighbour with final cost may lower a RAISE state
            for k in range(8):
                if mask[x] & (1 << k):
                    y = successor(x, k, graph) if turning else x + offset[k]
                    if h[y] <= k_old and h[x] > h[y] + COST[k]:
                        back[x] = k
                        h[x] = h[y] + COST[k]
        lower = k_old == h[x]  # L8
        for k in range(8):
            if turning:
                y = beside(cell, label, cols, x, k)
                if y < 0:
                    continue
            else:
                rn, cn = row + DROW[k], col + DCOL[k]
                if rn < 0 or rn >= rows or cn < 0 or cn >= cols:
                    continue
                y = x + offset[k]
            way = (k + 4) & 7
            through = min(NEVER, h[x] + COST[k]) if mask[y] & (1 << way) else NEVER
            if back[y] == way:
                if h[y] != through:  # L11, L16: a child follows its parent up or down
                    size = insert(y, through, h, heap, place, size)
            elif lower:
                if h[y] > through:  # L10, L12
                    back[y] = way
                    size = insert(y, through, h, heap, place, size)
            elif h[y] > through:  # L19 to L21: X will lower Y once it is LOWER itself
                size = insert(x, h[x], h, heap, place, size)
            elif (
                not turning and mask[x] & (1 << k) and h[x] > h[y] + COST[k] and place[y] < 0 and h[y] > k_old
            ):  # L22 to L24: Y could lower X
                size = insert(y, h[y], h, heap, place, size)
        for k in range(8 if turning and not lower else 0):  # L22 to L24, where X leads to another Y
            if may_lower(x, k, k_old, graph, h, place):
                y = after_move(graph, x, k)
                size = insert(y, h[y], h, heap, place, size)
    return size, processed


@inline
def may_lower(x: int, k: int, least: int, graph: MoveGraph, h: Array, place: Array) -> bool:
    """Return whether move k leads from x to a CLOSED state, of a cost above `least`, that could lower x."""
    if not graph.mask[x] & (1 << k):
        return False
    y = after_move(graph, x, k)
    return bool(h[x] > h[y] + COST[k] and place[y] < 0 and h[y] > least)


@kernel
def follow(graph: MoveGraph, start: int, goal: int, back: Array) -> tuple[Array, int]:
    """Return the path (N, 2) along the backpointers and its number of diagonal steps; the goal must be reachable."""
    n, diagonal = 1, 0
    u: Any = np.int64(start)
    while cell_of(graph, u) != goal:
        diagonal += back[u] & 1
        u = after_move(graph, u, back[u])
        n += 1
    cells = np.empty((n, 2), dtype=np.int32)
    u = np.int64(start)
    for i in range(n):
        here = cell_of(graph, u)
        cells[i, 0], cells[i, 1] = here // graph.cols, here % graph.cols
        if i < n - 1:
            u = after_move(graph, u, back[u])
    return cells, diagonal


@kernel
def begin(
    cols: int, start: int, goal: int, goals: Array, state: Array, h: Array, back: Array, heap: Array, place: Array
) -> None:
    """Initialise: only the goal's nodes are known and on the OPEN list; the first three arguments are D* Lite's."""
    h[:], back[:], place[:] = NEVER, 8, -1
    size: Any = np.int64(0)  # the compiler would treat a literal 0 as a separate type
    none: Any = np.int64(0)
    for node in goals:
        h[node] = 0
        size = put(heap, place, size, node, none, none)
    state[0] = size


@kernel
def repair(
    changed: Array,
    graph: MoveGraph,
    start: int,
    goal: int,
    state: Array,
    h: Array,
    back: Array,
    heap: Array,
    place: Array,
) -> tuple[Array, int, int]:
    """Return the path (N, 2) after moves changed, its number of diagonal steps, and the number of processed states.

    The path is empty if there is none. `changed` holds the nodes whose moves changed, or lead to other nodes. `state` holds the
    length of the OPEN list.
    """
    size, turning = state[0], len(graph.cell) > 0
    for n in range(len(changed)):  # MODIFY-COST
        x = changed[n]
        if turning:  # a move out of x may lead nowhere or to another state, so x starts anew as a RAISE state
            for k in range(8):
                if may_lower(x, k, -1, graph, h, place):
                    y = after_move(graph, x, k)
                    size = insert(y, h[y], h, heap, place, size)
            at_goal = cell_of(graph, x) == goal
            if at_goal or h[x] < NEVER:
                size = insert(x, 0 if at_goal else NEVER, h, heap, place, size)
        elif place[x] < 0 and h[x] < NEVER:
            size = insert(x, h[x], h, heap, place, size)
    size, processed = settle(graph, start, h, back, heap, place, size)
    state[0] = size
    if h[start] >= NEVER:
        return np.empty((0, 2), dtype=np.int32), 0, processed
    cells, diagonal = follow(graph, start, goal, back)
    return cells, diagonal, processed
