"""Compiled D* Lite: arrays in, arrays out, no validation.

S. Koenig and M. Likhachev, *D\\* Lite*, AAAI 2002, the optimised version (Figure 4); names as in the paper. Moves
are bidirectional. `g` and `rhs` are costs to the goal; `heap` and `place` are the queue U, `size` its length.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.planners.graph._kernels_incremental import COST, NEVER, octile, offsets, put, take
from antdrive.worlds._kernels import DCOL, DROW, Array, inline, kernel


@inline
def update_vertex(u: int, h: int, km: int, g: Array, rhs: Array, heap: Array, place: Array, size: int) -> int:
    """Do UpdateVertex with CalculateKey; `h` is the heuristic of u. Returns the queue's size."""
    if g[u] != rhs[u]:
        least = min(g[u], rhs[u])
        size = put(heap, place, size, u, least + h + km, least)
    elif place[u] >= 0:
        size = take(heap, place, size, u)
    return size


@inline
def lookahead(u: int, mask: Array, offset: Array, g: Array) -> int:
    """Return the least cost to the goal through a neighbour of u."""
    best = NEVER
    for k in range(8):
        if mask[u] & (1 << k):
            best = min(best, g[u + offset[k]] + COST[k])
    return best


@kernel
def settle(
    moves: Array, r0: int, c0: int, goal: int, km: int, g: Array, rhs: Array, heap: Array, place: Array, size: int
) -> tuple[int, int]:
    """Do ComputeShortestPath from the start cell (r0, c0).

    Returns the queue's size and the number of expanded cells.
    """
    cols = moves.shape[1]
    mask, offset = moves.ravel(), offsets(cols)
    start = r0 * cols + c0
    expanded = 0
    while size > 0:
        least = min(g[start], rhs[start])
        old_first, old_second = heap[0, 0], heap[0, 1]
        if not (old_first < least + km or (old_first == least + km and old_second < least) or rhs[start] > g[start]):
            break
        u = heap[0, 2]
        row = u // cols
        col = u - row * cols
        h = octile(row - r0, col - c0)
        least = min(g[u], rhs[u])
        if old_first < least + h + km or (old_first == least + h + km and old_second < least):
            size = put(heap, place, size, u, least + h + km, least)
            continue
        expanded += 1
        if g[u] > rhs[u]:
            g[u] = rhs[u]
            size = take(heap, place, size, u)
            for k in range(8):
                if not mask[u] & (1 << k):
                    continue
                s = u + offset[k]
                through = g[u] + COST[k]
                if rhs[s] > through:
                    rhs[s] = through
                    h = octile(row + DROW[k] - r0, col + DCOL[k] - c0)
                    size = update_vertex(s, h, km, g, rhs, heap, place, size)
        else:
            old = g[u]
            g[u] = NEVER
            for k in range(8):
                if not mask[u] & (1 << k):
                    continue
                s = u + offset[k]
                if rhs[s] == old + COST[k] and s != goal:
                    rhs[s] = lookahead(s, mask, offset, g)
                    h = octile(row + DROW[k] - r0, col + DCOL[k] - c0)
                    size = update_vertex(s, h, km, g, rhs, heap, place, size)
            h = octile(row - r0, col - c0)
            size = update_vertex(u, h, km, g, rhs, heap, place, size)
    return size, expanded


@kernel
def descend(moves: Array, start: int, goal: int, g: Array) -> tuple[Array, int]:
    """Return the path (N, 2) by least cost to the goal and its number of diagonal steps; the goal must be reachable."""
    cols = moves.shape[1]
    mask, offset = moves.ravel(), offsets(cols)
    cells = np.empty((64, 2), dtype=np.int32)
    cells[0, 0], cells[0, 1] = start // cols, start % cols
    n, diagonal = 1, 0
    u = start
    while u != goal:
        best, way = NEVER, 0
        for k in range(8):
            if mask[u] & (1 << k) and g[u + offset[k]] + COST[k] < best:
                best, way = g[u + offset[k]] + COST[k], k
        u += offset[way]
        diagonal += way & 1
        if n == len(cells):
            cells = np.concatenate((cells, np.empty_like(cells)))
        cells[n, 0], cells[n, 1] = u // cols, u % cols
        n += 1
    return cells[:n].copy(), diagonal


@kernel
def begin(moves: Array, start: int, goal: int, state: Array, g: Array, rhs: Array, heap: Array, place: Array) -> None:
    """Initialize: only the goal is known and in the queue."""
    cols = moves.shape[1]
    g[:], rhs[:], place[:] = NEVER, NEVER, -1
    rhs[goal] = 0
    h = octile(goal // cols - start // cols, goal % cols - start % cols)
    none: Any = np.int64(0)  # the compiler would treat a literal 0 as a separate type
    state[0], state[1], state[2] = put(heap, place, none, goal, h, none), 0, start


@kernel
def repair(
    changed: Array, moves: Array, start: int, goal: int, state: Array, g: Array, rhs: Array, heap: Array, place: Array
) -> tuple[Array, int, int]:
    """Do Main: return the path (N, 2) after moves changed, its number of diagonal steps, and that of expanded cells.

    The path is empty if there is none. `state` holds the queue's size, k_m and s_last.
    """
    cols = moves.shape[1]
    mask, offset = moves.ravel(), offsets(cols)
    r0, c0 = start // cols, start % cols
    state[1] += octile(state[2] // cols - r0, state[2] % cols - c0)
    state[2] = start
    size, km = state[0], state[1]
    for n in range(len(changed)):
        u = changed[n]
        if u != goal:
            rhs[u] = lookahead(u, mask, offset, g)
        h = octile(u // cols - r0, u % cols - c0)
        size = update_vertex(u, h, km, g, rhs, heap, place, size)
    size, expanded = settle(moves, r0, c0, goal, km, g, rhs, heap, place, size)
    state[0] = size
    if rhs[start] >= NEVER:
        return np.empty((0, 2), dtype=np.int32), 0, expanded
    cells, diagonal = descend(moves, start, goal, g)
    return cells, diagonal, expanded
