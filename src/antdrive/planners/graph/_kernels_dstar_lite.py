"""Compiled D* Lite: arrays in, arrays out, no validation.

S. Koenig and M. Likhachev, *D\\* Lite*, AAAI 2002, the optimised version (Figure 4); names as in the paper. `g` and
`rhs` are costs of the graph's nodes to the goal cell; `heap` and `place` are the queue U, `size` its length.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.planners.graph._kernels_incremental import (
    COST,
    NEVER,
    cost_through,
    octile,
    offsets,
    put,
    successor,
    take,
)
from antdrive.worlds._kernels import DCOL, DROW, Array, inline, kernel
from antdrive.worlds._kernels_turns import MoveGraph, behind, cell_of


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
def lookahead(u: int, graph: MoveGraph, mask: Array, offset: Array, turning: bool, g: Array) -> int:
    """Return the least cost to the goal through a successor of u."""
    best = NEVER
    for k in range(8):
        if mask[u] & (1 << k):
            best = min(best, cost_through(u, k, graph, g) if turning else g[u + offset[k]] + COST[k])
    return best


@kernel
def settle(
    graph: MoveGraph, start: int, goal: int, km: int, g: Array, rhs: Array, heap: Array, place: Array, size: int
) -> tuple[int, int]:
    """Do ComputeShortestPath from the start node.

    Returns the queue's size and the number of expanded nodes.
    """
    cols, mask, cell, offset = graph.cols, graph.mask, graph.cell, offsets(graph.cols)
    label, turning = graph.label, len(cell) > 0
    r0, c0 = cell_of(graph, start) // cols, cell_of(graph, start) % cols
    expanded = 0
    while size > 0:
        least = min(g[start], rhs[start])
        old_first, old_second = heap[0, 0], heap[0, 1]
        if not (old_first < least + km or (old_first == least + km and old_second < least) or rhs[start] > g[start]):
            break
        u = heap[0, 2]
        here = cell[u] if turning else u
        row = here // cols
        col = here - row * cols
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
                if turning:
                    s = behind(mask, cell, label, cols, u, k)
                    if s < 0:
                        continue
                elif mask[u] & (1 << k):
                    s = u + offset[k]
                else:
                    continue
                through = g[u] + COST[k]
                if rhs[s] > through:
                    rhs[s] = through
                    h = octile(row + DROW[k] - r0, col + DCOL[k] - c0)
                    size = update_vertex(s, h, km, g, rhs, heap, place, size)
        else:
            old = g[u]
            g[u] = NEVER
            for k in range(8):
                if turning:
                    s = behind(mask, cell, label, cols, u, k)
                    if s < 0:
                        continue
                elif mask[u] & (1 << k):
                    s = u + offset[k]
                else:
                    continue
                if rhs[s] == old + COST[k] and (cell[s] if turning else s) != goal:
                    rhs[s] = lookahead(s, graph, mask, offset, turning, g)
                    h = octile(row + DROW[k] - r0, col + DCOL[k] - c0)
                    size = update_vertex(s, h, km, g, rhs, heap, place, size)
            h = octile(row - r0, col - c0)
            size = update_vertex(u, h, km, g, rhs, heap, place, size)
    return size, expanded


@kernel
def descend(graph: MoveGraph, start: int, goal: int, g: Array) -> tuple[Array, int]:
    """Return the path (N, 2) by least cost to the goal and its number of diagonal steps; the goal must be reachable."""
    cols, mask, offset, turning = graph.cols, graph.mask, offsets(graph.cols), len(graph.cell) > 0
    cells = np.empty((64, 2), dtype=np.int32)
    u: Any = np.int64(start)
    here = cell_of(graph, u)
    cells[0, 0], cells[0, 1] = here // cols, here % cols
    n, diagonal = 1, 0
    while here != goal:
        best, way = NEVER, 0
        for k in range(8):
            if mask[u] & (1 << k):
                through = cost_through(u, k, graph, g) if turning else g[u + offset[k]] + COST[k]
                if through < best:
                    best, way = through, k
        u = successor(u, way, graph) if turning else u + offset[way]
        here = cell_of(graph, u)
        diagonal += way & 1
        if n == len(cells):
            cells = np.concatenate((cells, np.empty_like(cells)))
        cells[n, 0], cells[n, 1] = here // cols, here % cols
        n += 1
    return cells[:n].copy(), diagonal


@kernel
def begin(
    cols: int, start: int, goal: int, goals: Array, state: Array, g: Array, rhs: Array, heap: Array, place: Array
) -> None:
    """Initialize: only the goal's nodes are known and in the queue; `start` and `goal` are flat cells."""
    g[:], rhs[:], place[:] = NEVER, NEVER, -1
    size: Any = np.int64(0)  # the compiler would treat a literal 0 as a separate type
    none: Any = np.int64(0)
    h = octile(goal // cols - start // cols, goal % cols - start % cols)
    for node in goals:
        rhs[node] = 0
        size = put(heap, place, size, node, h, none)
    state[0], state[1], state[2] = size, 0, start


@kernel
def repair(
    changed: Array,
    graph: MoveGraph,
    start: int,
    goal: int,
    state: Array,
    g: Array,
    rhs: Array,
    heap: Array,
    place: Array,
) -> tuple[Array, int, int]:
    """Do Main: return the path (N, 2) after moves changed, its number of diagonal steps, and that of expanded nodes.

    The path is empty if there is none. `changed` holds the nodes whose moves changed, or lead to other nodes. `state` holds the
    queue's size, k_m and the cell of s_last.
    """
    cols, mask, offset, turning = graph.cols, graph.mask, offsets(graph.cols), len(graph.cell) > 0
    here = cell_of(graph, start)
    r0, c0 = here // cols, here % cols
    state[1] += octile(state[2] // cols - r0, state[2] % cols - c0)
    state[2] = here
    size, km = state[0], state[1]
    for n in range(len(changed)):
        u = changed[n]
        here = cell_of(graph, u)
        rhs[u] = lookahead(u, graph, mask, offset, turning, g) if here != goal else 0
        h = octile(here // cols - r0, here % cols - c0)
        size = update_vertex(u, h, km, g, rhs, heap, place, size)
    size, expanded = settle(graph, start, goal, km, g, rhs, heap, place, size)
    state[0] = size
    if rhs[start] >= NEVER:
        return np.empty((0, 2), dtype=np.int32), 0, expanded
    cells, diagonal = descend(graph, start, goal, g)
    return cells, diagonal, expanded
