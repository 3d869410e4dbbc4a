"""Compiled ants: arrays in, arrays out, no validation.

The table `weights` (nodes, 8) of float32 holds the attraction of each move, 0 where the
move is not allowed. It encodes all rules of a colony and is filled once per iteration, so `walk_ants` serves every
colony.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from antdrive.planners.graph._kernels_search import octile
from antdrive.worlds._kernels import DCOL, DROW, SQRT2, Array, inline, kernel
from antdrive.worlds._kernels_turns import MoveGraph, after_move

MIN_WEIGHT = 1e-30  # relative to the largest weight of a cell; within float32, so allowed moves keep a weight
UNIT = np.float32(1.0 / 16777216.0)
ZERO = np.float32(0.0)


class AntGraph(NamedTuple):
    """The ants' graph.

    Attributes:
        mask: the allowed moves of each node, one bit per direction (nodes,)
        to: leads from node to node by each move: index offsets (8,), or with turns a table of nodes (nodes, 8)
        cell: flat cell of each node (nodes,); empty without turns, where nodes are flat cells
        cols: columns of the grid
        start: the start node
        goal: the goal node
    """

    mask: Array
    to: Array
    cell: Array
    cols: int
    start: int
    goal: int


@inline
def next_random(state: Any) -> Any:
    """Return the next state of Marsaglia's xorshift64 generator; its upper bits are the random number."""
    state ^= state << np.uint64(13)
    state ^= state >> np.uint64(7)
    state ^= state << np.uint64(17)
    return state


@kernel
def after(to: Array, i: Any, k: int) -> Any:
    """Return the node that move k leads to from node i."""
    return i + to[k] if to.ndim == 1 else np.int64(to[i, k])


@kernel
def table_of(graph: MoveGraph, kept: Array, goal: int, mask: Array, to: Array) -> None:
    """Fill the moves `mask` (nodes,) and the table `to` (nodes, 8) of a grid with turns, for walks among the `kept` nodes.

    All nodes of the goal's cell become its first. A move that is not allowed leads nowhere.
    """
    for i in range(len(mask)):
        mask[i] = 0
        for k in range(8):
            to[i, k] = i
            if graph.mask[i] >> k & 1:
                j = after_move(graph, i, k)
                if kept[j]:
                    mask[i] |= 1 << k
                    to[i, k] = goal if graph.cell[j] == goal else j


@kernel
def move_between(to: Array, i: int, j: int) -> int:
    """Return the move from node i to node j by a table (nodes, 8); 8 without one."""
    for k in range(8):
        if to[i, k] == j:
            return k
    return 8


@kernel
def nodes_along(to: Array, cols: int, start: int, cells: Array) -> Array:
    """Return the nodes (N,) of a walk along cells (N, 2)."""
    walk = np.empty(len(cells), dtype=np.int32)
    walk[0] = start
    for s in range(1, len(cells)):
        up, right = cells[s, 0] - cells[s - 1, 0], cells[s, 1] - cells[s - 1, 1]
        for k in range(8):
            if DROW[k] == up and DCOL[k] == right:
                walk[s] = after(to, np.int64(walk[s - 1]), k)
    return walk


@kernel
def step_length(to: Array, i: int, j: int) -> float:
    """Return the length of the move from node i to node j [cells]."""
    if to.ndim == 2:
        return SQRT2 if move_between(to, i, j) & 1 else 1.0
    return 1.0 if abs(j - i) == 1 or abs(j - i) == to[2] else SQRT2


@kernel
def walk_length(walk: Array, size: int, to: Array) -> float:
    """Return the length of a walk [cells]."""
    straight, diagonal = 0, 0
    for s in range(size - 1):
        step = abs(walk[s + 1] - walk[s])
        if (step == 1 or step == to[2]) if to.ndim == 1 else not move_between(to, walk[s], walk[s + 1]) & 1:
            straight += 1
        else:
            diagonal += 1
    return straight + SQRT2 * diagonal


@kernel
def longest_offset(to: Array) -> int:
    """Return the index offset of the longest move; 0 for a table."""
    return to[1] if to.ndim == 1 else 0


@kernel
def walk_ants(
    weights: Array,
    graph: AntGraph,
    limit: int,
    revisit: float,
    backtrack: bool,
    seeds: Array,
    walks: Array,
    sizes: Array,
    lengths: Array,
) -> int:
    """Send one ant per seed from start to goal; returns the total number of steps.

    Row a of `walks` receives the cells of ant a, sizes[a] their number and lengths[a] the length [cells]. An
    ant that dies where no move has any weight, or reaches `limit` steps, has size 0 and length inf. A visited
    cell has the weight `revisit`; at 0 it is never visited again. With `backtrack` an ant steps back instead of
    dying: the dead cell leaves the walk, but counts as visited.

    The eight moves are unrolled and summed in pairs. A loop is 1 to 2 % slower; its order of summation would
    round differently and change plans.
    """
    mask, to, _, _, start, goal = graph
    pad = longest_offset(to)  # so cells around the grid can be read without a check
    visited = np.zeros(len(mask) + 2 * pad, dtype=np.int32)  # number of the last ant at each cell, from 1
    again = np.float32(revisit)
    taken = 0
    for a in range(len(seeds)):
        ant = a + 1
        state = seeds[a]
        walk = walks[a]
        walk[0], n = start, 1
        visited[start + pad] = ant
        i: Any = start
        left = limit
        while i != goal and left > 0:
            w0 = weights[i, 0] * np.float32(visited[after(to, i, 0) + pad] != ant)
            w1 = weights[i, 1] * np.float32(visited[after(to, i, 1) + pad] != ant)
            w2 = weights[i, 2] * np.float32(visited[after(to, i, 2) + pad] != ant)
            w3 = weights[i, 3] * np.float32(visited[after(to, i, 3) + pad] != ant)
            w4 = weights[i, 4] * np.float32(visited[after(to, i, 4) + pad] != ant)
            w5 = weights[i, 5] * np.float32(visited[after(to, i, 5) + pad] != ant)
            w6 = weights[i, 6] * np.float32(visited[after(to, i, 6) + pad] != ant)
            w7 = weights[i, 7] * np.float32(visited[after(to, i, 7) + pad] != ant)
            if again > ZERO:
                m = mask[i]
                w0 = again if m & 1 and visited[after(to, i, 0) + pad] == ant else w0
                w1 = again if m & 2 and visited[after(to, i, 1) + pad] == ant else w1
                w2 = again if m & 4 and visited[after(to, i, 2) + pad] == ant else w2
                w3 = again if m & 8 and visited[after(to, i, 3) + pad] == ant else w3
                w4 = again if m & 16 and visited[after(to, i, 4) + pad] == ant else w4
                w5 = again if m & 32 and visited[after(to, i, 5) + pad] == ant else w5
                w6 = again if m & 64 and visited[after(to, i, 6) + pad] == ant else w6
                w7 = again if m & 128 and visited[after(to, i, 7) + pad] == ant else w7
            p0, p1, p2, p3 = w0 + w1, w2 + w3, w4 + w5, w6 + w7
            q0, q1 = p0 + p1, p2 + p3
            total = q0 + q1
            left -= 1
            if total <= ZERO:
                if not backtrack or n == 1:
                    left += 1
                    break
                n -= 1
                i = np.int64(walk[n - 1])
                continue
            state = next_random(state)
            # The roulette wheel as three branch-free halvings.
            spin = np.float32(state >> np.uint64(40)) * UNIT * total
            upper = spin >= q0
            spin = spin - q0 if upper else spin
            pair = p2 if upper else p0
            wa = w4 if upper else w0
            wb = w5 if upper else w1
            wc = w6 if upper else w2
            wd = w7 if upper else w3
            second = spin >= pair
            spin = spin - pair if second else spin
            wa = wc if second else wa
            wb = wd if second else wb
            last = spin >= wa
            if (wb if last else wa) <= ZERO:  # rounding chose a forbidden move: spin again
                continue
            i = after(to, i, 4 * upper + 2 * second + last)
            visited[i + pad] = ant
            walk[n] = i
            n += 1
        taken += limit - left
        sizes[a] = n if i == goal else 0
        lengths[a] = walk_length(walk, n, to) if i == goal else np.inf
    return taken


@kernel
def copy_without_loops(walk: Array, size: int, last: Array, tour: Array) -> int:
    """Write the walk without loops to `tour`, continuing from the last visit of each cell; returns the tour's size.

    `last` (cells,) is working memory.
    """
    for s in range(size):
        last[walk[s]] = s
    s, n = 0, 0
    while s < size:
        tour[n] = walk[s]
        n += 1
        s = last[walk[s]] + 1
    return n


@kernel
def cut_one_short(walk: Array, size: int, mask: Array, to: Array, first: int, place: Array, tour: Array) -> int:
    """Write the walk cut short to `tour`: from each cell straight to the neighbour that comes last in the walk.

    Returns the size of the tour. A tour is never longer than its walk: a move of length at most sqrt(2) replaces at
    least two steps. `place` holds the position of each cell in the walk, counted from `first`; entries of earlier
    walks are below `first`.
    """
    for s in range(size):
        place[walk[s]] = first + s
    s, n = 0, 0
    while s < size:
        i = np.int64(walk[s])
        tour[n] = i
        n += 1
        onward = first + s + 1
        for k in range(8):
            if mask[i] & (1 << k):
                onward = max(onward, place[after(to, i, k)])
        s = onward - first
    return n


@kernel
def cut(
    walks: Array, sizes: Array, graph: AntGraph, short: bool, tours: Array, tour_sizes: Array, lengths: Array
) -> None:
    """Write walk a to row a of `tours`, cut `short` or without its loops alone."""
    mask, to, _, _, _, _ = graph
    place = np.full(len(mask), -1, dtype=np.int64)
    first: Any = np.int64(0)  # a literal 0 would compile `cut_one_short` a second time
    for a in range(len(sizes)):
        if short:
            n = cut_one_short(walks[a], sizes[a], mask, to, first, place, tours[a])
            first += sizes[a]
        else:
            n = copy_without_loops(walks[a], sizes[a], place, tours[a])
        tour_sizes[a] = n
        lengths[a] = walk_length(tours[a], n, to) if n else np.inf


@kernel
def deposit_on_cells(trail: Array, walks: Array, sizes: Array, amounts: Array) -> None:
    """Add amounts[a] once to each cell that walk a visits."""
    last = np.full(len(trail), -1, dtype=np.int32)
    for a in range(len(sizes)):
        for s in range(sizes[a]):
            i = walks[a, s]
            if last[i] != a:
                last[i] = a
                trail[i] += amounts[a]


@kernel
def first_row(to: Array, i: Any) -> Any:
    """Return the row of node i for `row_and_move`, which tables do without."""
    return i // to[2] if to.ndim == 1 else i


@kernel
def row_and_move(i: Any, j: Any, row: Any, to: Array) -> tuple[Any, Any]:
    """Return the row of node j, and the move to j from its neighbour i in row `row`."""
    if to.ndim == 2:
        return row, move_between(to, i, j)
    next_row = j // to[2]
    up = next_row - row
    right = j - i - up * to[2]
    move = 2 - right if up == 1 else (6 + right if up == -1 else 2 - 2 * right)
    return next_row, move


@kernel
def deposit_on_arcs(trail: Array, to: Array, walks: Array, sizes: Array, amounts: Array) -> None:
    """Add amounts[a] to each arc that walk a uses; `trail` is (nodes, 8)."""
    for a in range(len(sizes)):
        if sizes[a] == 0:
            continue
        i = np.int64(walks[a, 0])
        row = first_row(to, i)
        for s in range(1, sizes[a]):
            j = np.int64(walks[a, s])
            row, k = row_and_move(i, j, row, to)
            trail[i, k] += amounts[a]
            i = j


@kernel
def deposit_in_passing(trail: Array, walks: Array, sizes: Array, amounts: Array, evaporation: float) -> None:
    """Add amounts[a] to each cell of walk a as in the program of han2007: a cell evaporates only on deposits."""
    for a in range(len(sizes)):
        for s in range(sizes[a]):
            i = walks[a, s]
            trail[i] = trail[i] * (1.0 - evaporation) + amounts[a]


@kernel
def strongest(trail: Array, out: Array) -> None:
    """Set out[i] to the strongest trail that leaves cell i; `trail` is (nodes, 8)."""
    for i in range(len(out)):
        most = trail[i, 0]
        for k in range(1, 8):
            most = max(most, trail[i, k])
        out[i] = most


@kernel
def arc_weights(trail: Array, heuristic: Array, alpha: float, weights: Array) -> None:
    """Set weights[i, k] to trail^alpha * heuristic, scaled to a maximum of 1 per cell."""
    for i in range(len(weights)):
        most = 0.0
        for k in range(8):
            if heuristic[i, k] > 0.0:
                most = max(most, _power(trail[i, k], alpha) * heuristic[i, k])
        scale = 1.0 / most if most > 0.0 else 0.0
        for k in range(8):
            weights[i, k] = 0.0
            if heuristic[i, k] > 0.0:
                weights[i, k] = max(MIN_WEIGHT, scale * _power(trail[i, k], alpha) * heuristic[i, k])


@inline
def _power(trail: float, alpha: float) -> float:
    """Return trail^alpha, fast for alpha 1 and -1; the bound keeps negative powers of evaporated trails finite."""
    trail = max(trail, 1e-100)
    return trail if alpha == 1.0 else (1.0 / trail if alpha == -1.0 else trail**alpha)


@kernel
def union_moves(walks: Array, sizes: Array, to: Array, moves: Array) -> None:
    """Set in moves[i] the bit of every move that a walk makes from cell i."""
    for a in range(len(sizes)):
        if sizes[a] == 0:
            continue
        i = np.int64(walks[a, 0])
        row = first_row(to, i)
        for s in range(1, sizes[a]):
            j = np.int64(walks[a, s])
            row, k = row_and_move(i, j, row, to)
            moves[i] |= 1 << k
            i = j


@kernel
def detour_weights(
    graph: AntGraph, greed: float, lane_pull: float, lane: float, to_goal: Array, weights: Array
) -> None:
    """Set weights[i, k] to exp(-greed * detour), with detour the excess length of the path through move k.

    The length of the path from a cell to the goal is that over open ground plus `lane_pull` times the distance to a
    lane: a parallel to the line from start to goal, offset by `lane` cells. `to_goal` (nodes,) is working memory.
    """
    mask, to, cell, cols, start, goal = graph
    from_cell = cell[start] if len(cell) else start
    r0, c0, r1, c1 = from_cell // cols, from_cell % cols, goal // cols, goal % cols
    distance = max(math.hypot(r1 - r0, c1 - c0), 1.0)
    across_row, across_col = (c0 - c1) / distance, (r1 - r0) / distance
    for i in range(len(mask)):
        here = cell[i] if len(cell) else i
        row, col = here // cols, here % cols
        aside = (row - r0) * across_row + (col - c0) * across_col
        to_goal[i] = octile(r1 - row, c1 - col) + lane_pull * abs(aside - lane)
    for i in range(len(mask)):
        for k in range(8):
            weights[i, k] = 0.0
            if mask[i] & (1 << k):
                detour = (SQRT2 if k & 1 else 1.0) + to_goal[after(to, i, k)] - to_goal[i]
                weights[i, k] = math.exp(-greed * detour)


@kernel
def attracted_weights(
    trail: Array, graph: AntGraph, omega: Array, attraction: float, shares: bool, min_weight: float, weights: Array
) -> None:
    """Set weights[i, k] to trail + attraction * omega; with `shares`, the trail's fraction of all neighbours' trails."""
    mask, to, _, _, _, _ = graph
    for i in range(len(mask)):
        scale = 1.0
        if shares:
            total = 0.0
            for k in range(8):
                if mask[i] & (1 << k):
                    total += trail[after(to, i, k)]
            scale = 1.0 / total if total > 0.0 else 0.0
        for k in range(8):
            weights[i, k] = 0.0
            if mask[i] & (1 << k):
                weights[i, k] = max(min_weight, trail[after(to, i, k)] * scale + attraction * omega[i, k])
