"""Compiled D*: arrays in, arrays out, no validation.

A. Stentz, *Optimal and efficient path planning for partially-known environments*, ICRA 1994; names and line
numbers as in the paper. Moves are bidirectional. `h` is the cost to the goal and `back` the backpointer b as a
direction, 8 for none; `heap` and `place` are the OPEN list by k, `size` its length. A NEW state has h = NEVER
and is not on the list.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.planners.graph._kernels_incremental import COST, NEVER, offsets, put, take
from antdrive.worlds._kernels import DCOL, DROW, Array, inline, kernel


@inline
def insert(x: int, cost: int, h: Array, heap: Array, place: Array, size: int) -> int:
    """Do INSERT(X, h_new): the key k is the least h since X joined the list; returns the list's length."""
    k = min(heap[place[x], 0], cost) if place[x] >= 0 else min(h[x], cost)
    h[x] = cost
    return put(heap, place, size, x, k, k)


@kernel
def settle(moves: Array, start: int, h: Array, back: Array, heap: Array, place: Array, size: int) -> tuple[int, int]:
    """Repeat PROCESS-STATE until k_min reaches h(start).

    Returns the list's length and the number of processed states.
    """
    rows, cols = moves.shape
    mask, offset = moves.ravel(), offsets(cols)
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
                    y = x + offset[k]
                    if h[y] <= k_old and h[x] > h[y] + COST[k]:
                        back[x] = k
                        h[x] = h[y] + COST[k]
        lower = k_old == h[x]  # L8
        for k in range(8):
            rn, cn = row + DROW[k], col + DCOL[k]
            if rn < 0 or rn >= rows or cn < 0 or cn >= cols:
                continue
            y = x + offset[k]
            through = min(NEVER, h[x] + COST[k]) if mask[x] & (1 << k) else NEVER
            if back[y] == (k + 4) & 7:
                if h[y] != through:  # L11, L16: a child follows its parent up or down
                    size = insert(y, through, h, heap, place, size)
            elif lower:
                if h[y] > through:  # L10, L12
                    back[y] = (k + 4) & 7
                    size = insert(y, through, h, heap, place, size)
            elif h[y] > through:  # L19 to L21: X will lower Y once it is LOWER itself
                size = insert(x, h[x], h, heap, place, size)
            elif (
                mask[x] & (1 << k) and h[x] > h[y] + COST[k] and place[y] < 0 and h[y] > k_old
            ):  # L22 to L24: Y could lower X
                size = insert(y, h[y], h, heap, place, size)
    return size, processed


@kernel
def follow(cols: int, start: int, goal: int, back: Array) -> tuple[Array, int]:
    """Return the path (N, 2) along the backpointers and its number of diagonal steps; the goal must be reachable."""
    offset = offsets(cols)
    n, diagonal = 1, 0
    u = start
    while u != goal:
        diagonal += back[u] & 1
        u += offset[back[u]]
        n += 1
    cells = np.empty((n, 2), dtype=np.int32)
    u = start
    for i in range(n):
        cells[i, 0], cells[i, 1] = u // cols, u % cols
        if i < n - 1:
            u += offset[back[u]]
    return cells, diagonal


@kernel
def begin(goal: int, state: Array, h: Array, back: Array, heap: Array, place: Array) -> None:
    """Initialise: only the goal is known and on the OPEN list."""
    h[:], back[:], place[:] = NEVER, 8, -1
    h[goal] = 0
    none: Any = np.int64(0)  # the compiler would treat a literal 0 as a separate type
    state[0] = put(heap, place, none, goal, none, none)


@kernel
def repair(
    changed: Array, moves: Array, start: int, goal: int, state: Array, h: Array, back: Array, heap: Array, place: Array
) -> tuple[Array, int, int]:
    """Return the path (N, 2) after moves changed, its number of diagonal steps, and the number of processed states.

    The path is empty if there is none. `state` holds the length of the OPEN list.
    """
    size = state[0]
    for n in range(len(changed)):  # MODIFY-COST
        x = changed[n]
        if place[x] < 0 and h[x] < NEVER:
            size = insert(x, h[x], h, heap, place, size)
    size, processed = settle(moves, start, h, back, heap, place, size)
    state[0] = size
    if h[start] >= NEVER:
        return np.empty((0, 2), dtype=np.int32), 0, processed
    cells, diagonal = follow(moves.shape[1], start, goal, back)
    return cells, diagonal, processed
