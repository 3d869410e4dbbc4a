"""Compiled spreading of pheromone from the goal: arrays in, arrays out, no validation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.planners.colonies._kernels_colony import AntGraph, after
from antdrive.planners.graph._kernels_incremental import offsets, put, take
from antdrive.worlds._kernels import DCOL, DROW, Array, kernel
from antdrive.worlds._kernels_turns import MoveGraph, behind

FIFTHS = np.array([5, 7, 5, 7, 5, 7, 5, 7], dtype=np.int64)  # cost of each move, 1 or 1.4, in fifths


@kernel
def close_gates(free: Array, moves: Array, start_row: int, start_col: int, goal_row: int, goal_col: int) -> int:
    """Remove the moves to and from gate cells: those between two diagonally opposite blocked cells.

    Returns the number of closed cells; start and goal stay open.
    """
    rows, cols = free.shape
    closed = 0
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            if not free[r, c] or (r == start_row and c == start_col) or (r == goal_row and c == goal_col):
                continue
            rising = not free[r - 1, c - 1] and not free[r + 1, c + 1]
            falling = not free[r - 1, c + 1] and not free[r + 1, c - 1]
            if not (rising or falling):
                continue
            closed += 1
            moves[r, c] = 0
            for k in range(8):
                moves[r + DROW[k], c + DCOL[k]] &= 255 - (1 << ((k + 4) & 7))
    return closed


@kernel
def propagate(graph: MoveGraph, start: int, goal: int, retained: float, lowers: bool, pheromone: Array) -> int:
    """Spread pheromone, `retained` times the cost of the path to the goal cell, until the start node's is final.

    Returns the number of nodes that received some; the others have inf, 10000 in the paper. Cells leave the open list
    in the order of cost, as in D*. Unless it `lowers` costs, a node keeps its first. Costs are multiples of 1/5, so the
    list is a ring of eight buckets, each a linked list.
    """
    mask, cell, label, cols = graph.mask, graph.cell, graph.label, graph.cols
    offset, turning = offsets(cols), len(cell) > 0
    cost = np.full(len(mask), -1, dtype=np.int64)
    closed = np.zeros(len(mask), dtype=np.bool_)
    head = np.full(8, -1, dtype=np.int64)
    entry_cell = np.empty(8 * len(mask) + 8, dtype=np.int32)
    entry_next = np.empty(8 * len(mask) + 8, dtype=np.int64)
    pheromone[:] = np.inf
    head[0] = -1
    entries, level = 0, 0
    for k in range(8):
        node = np.int64(label[goal, k]) if turning else goal
        if node >= 0 and cost[node] < 0:
            cost[node], pheromone[node] = 0, 0.0
            entry_cell[entries], entry_next[entries] = node, head[0]
            head[0] = entries
            entries += 1
    waiting, reached = entries, entries
    while waiting > 0 and not closed[start]:
        entry = head[level & 7]
        if entry < 0:
            level += 1
            continue
        head[level & 7] = entry_next[entry]
        waiting -= 1
        i: Any = np.int64(entry_cell[entry])
        if closed[i]:
            continue
        closed[i] = True
        for k in range(8):
            if turning:
                j = behind(mask, cell, label, cols, i, k)
                if j < 0:
                    continue
            elif mask[i] & (1 << k):
                j = i + offset[k]
            else:
                continue
            price = cost[i] + FIFTHS[k]
            if cost[j] >= 0 and (cost[j] <= price or not lowers):
                continue
            reached += cost[j] < 0
            cost[j], pheromone[j] = price, retained * price / 5.0
            entry_cell[entries], entry_next[entries] = j, head[price & 7]
            head[price & 7] = entries
            entries += 1
            waiting += 1
    return reached


@kernel
def touch(mask: Array, cols: int, start: int, goal: int, nearest: bool, onward: Array) -> int:
    """Spread from the goal until the start is touched; `onward` (cells,) gets each cell's next one, -1 if it was not touched.

    Returns the number of touched cells. Cells leave the open list `nearest` to the start first, or by their cost.
    """
    offset = offsets(cols)
    size: Any = np.int64(0)  # the compiler would treat a literal 0 as a separate type
    none: Any = np.int64(0)
    heap, place = np.empty((len(mask), 3), dtype=np.int64), np.full(len(mask), -1, dtype=np.int32)
    cost = np.zeros(len(mask), dtype=np.int64)  # in fifths
    onward[:] = -1
    onward[goal] = goal
    touched = 1
    size = put(heap, place, size, goal, none, none)
    while size > 0 and onward[start] < 0:
        i: Any = heap[0, 2]
        size = take(heap, place, size, i)
        for k in range(8):
            j = i + offset[k]
            if not mask[i] & (1 << k) or onward[j] >= 0:
                continue
            onward[j], cost[j] = i, cost[i] + FIFTHS[k]
            touched += 1
            rows_off, cols_off = j // cols - start // cols, j % cols - start % cols
            key = rows_off * rows_off + cols_off * cols_off if nearest else cost[j]
            size = put(heap, place, size, j, key, j)
    return touched


@kernel
def decide(graph: AntGraph, here: int, alpha: float, beta: float, pheromone: Array) -> Any:
    """Return the allowed next node with the smallest pheromone^alpha * distance^beta; -1 if none has pheromone."""
    mask, to, cell, cols, _, goal = graph
    r1, c1 = goal // cols, goal % cols
    least = np.inf
    best: Any = np.int64(-1)
    for k in range(8):
        if not mask[here] & (1 << k):
            continue
        j = after(to, here, k)
        if j == goal:
            best = j
            break
        at = cell[j] if len(cell) else j
        price = alpha * math.log(pheromone[j]) + beta * math.log(math.hypot(r1 - at // cols, c1 - at % cols))
        if price < least:
            least, best = price, j
    return best


@kernel
def descend(graph: AntGraph, alpha: float, beta: float, pheromone: Array, walk: Array) -> int:
    """Fill `walk` with nodes, each after the last one the next with the smallest pheromone^alpha * distance^beta.

    Returns their number; it is negative if the walk would return to one of its nodes.
    """
    been = np.zeros(len(graph.mask), dtype=np.bool_)
    walk[0], n = graph.start, 1
    been[graph.start] = True
    i = graph.start
    while i != graph.goal:
        j = decide(graph, i, alpha, beta, pheromone)
        if j < 0 or been[j]:
            return -n
        i = j
        been[i] = True
        walk[n] = i
        n += 1
    return n


@kernel
def close_cells(moves: Array, cells: Array) -> None:
    """Remove every move into, out of or diagonally past these cells (N, 2) from `moves` (rows, cols)."""
    rows, cols = moves.shape
    for n in range(len(cells)):
        r, c = cells[n, 0], cells[n, 1]
        moves[r, c] = 0
        for k in range(8):
            rn, cn = r + DROW[k], c + DCOL[k]
            if rn < 0 or rn >= rows or cn < 0 or cn >= cols:
                continue
            gone = 1 << ((k + 4) & 7)
            if not k & 1:  # an orthogonal neighbour: also the diagonals past the cell
                gone |= 1 << ((k + 3) & 7) | 1 << ((k + 5) & 7)
            moves[rn, cn] &= 255 - gone
