"""Compiled spreading of pheromone from the goal: arrays in, arrays out, no validation."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, Array, kernel

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
def propagate(mask: Array, offset: Array, start: int, goal: int, retained: float, pheromone: Array) -> int:
    """Spread pheromone, `retained` times the cost of the path to the goal, until the start's is final.

    Returns the number of cells that received some; the others have inf, 10000 in the paper. Cells leave the open list
    in the order of cost, as in D*. Costs are multiples of 1/5, so the list is a ring of eight buckets, each a
    linked list.
    """
    cost = np.full(len(mask), -1, dtype=np.int64)
    closed = np.zeros(len(mask), dtype=np.bool_)
    head = np.full(8, -1, dtype=np.int64)
    entry_cell = np.empty(8 * len(mask) + 1, dtype=np.int32)
    entry_next = np.empty(8 * len(mask) + 1, dtype=np.int64)
    pheromone[:] = np.inf
    cost[goal], pheromone[goal] = 0, 0.0
    entry_cell[0], entry_next[0] = goal, -1
    head[0] = 0
    entries, waiting, level, reached = 1, 1, 0, 1
    while waiting > 0 and not closed[start]:
        entry = head[level & 7]
        if entry < 0:
            level += 1
            continue
        head[level & 7] = entry_next[entry]
        waiting -= 1
        i = np.int64(entry_cell[entry])
        if closed[i]:
            continue
        closed[i] = True
        for k in range(8):
            if not mask[i] & (1 << k):
                continue
            j = i + offset[k]
            price = cost[i] + FIFTHS[k]
            if cost[j] >= 0 and cost[j] <= price:
                continue
            reached += cost[j] < 0
            cost[j], pheromone[j] = price, retained * price / 5.0
            entry_cell[entries], entry_next[entries] = j, head[price & 7]
            head[price & 7] = entries
            entries += 1
            waiting += 1
    return reached


@kernel
def decide(
    mask: Array, offset: Array, cols: int, here: int, goal: int, alpha: float, beta: float, pheromone: Array
) -> int:
    """Return the allowed neighbour with the smallest pheromone^alpha * distance^beta; -1 if none has pheromone."""
    r1, c1 = goal // cols, goal % cols
    least, to = np.inf, -1
    for k in range(8):
        if not mask[here] & (1 << k):
            continue
        j = here + offset[k]
        if j == goal:
            to = j
            break
        price = alpha * math.log(pheromone[j]) + beta * math.log(math.hypot(r1 - j // cols, c1 - j % cols))
        if price < least:
            least, to = price, j
    return to


@kernel
def descend(
    mask: Array,
    offset: Array,
    cols: int,
    start: int,
    goal: int,
    alpha: float,
    beta: float,
    pheromone: Array,
    walk: Array,
) -> int:
    """Fill `walk` with cells, each the last one's neighbour with the smallest pheromone^alpha * distance^beta.

    Returns their number; it is negative if the walk would return to one of its cells.
    """
    been = np.zeros(len(mask), dtype=np.bool_)
    walk[0], n = start, 1
    been[start] = True
    i = start
    while i != goal:
        to = decide(mask, offset, cols, i, goal, alpha, beta, pheromone)
        if to < 0 or been[to]:
            return -n
        i = to
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
