"""Compiled ants: arrays in, arrays out, nothing validated.

Cells are flat indices. A colony's rules reach its ants as one table `weights` (cells, 8) of float32: how much
each move attracts, 0 where it is not allowed. It is filled once an iteration, so one walk serves every rule.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, SQRT2, Array, inline, kernel

LEAST = 1e-30  # the least weight of an allowed move beside the largest of its cell: not lost in float32
UNIT = np.float32(1.0 / 16777216.0)
ZERO = np.float32(0.0)


@inline
def next_random(state: Any) -> Any:
    """The next state of Marsaglia's xorshift64 generator; its upper bits are the random number."""
    state ^= state << np.uint64(13)
    state ^= state >> np.uint64(7)
    state ^= state << np.uint64(17)
    return state


@kernel
def offsets(cols: int) -> Array:
    """What each move adds to a flat index."""
    out = np.empty(8, dtype=np.int64)
    for k in range(8):
        out[k] = DROW[k] * cols + DCOL[k]
    return out


@kernel
def walk_length(walk: Array, size: int, cols: int) -> float:
    """Length of a walk [cells]."""
    straight, diagonal = 0, 0
    for s in range(size - 1):
        step = abs(walk[s + 1] - walk[s])
        if step == 1 or step == cols:
            straight += 1
        else:
            diagonal += 1
    return straight + SQRT2 * diagonal


@kernel
def walk_ants(
    weights: Array,
    mask: Array,
    offset: Array,
    start: int,
    goal: int,
    limit: int,
    revisit: float,
    retreat: bool,
    seeds: Array,
    walks: Array,
    sizes: Array,
    lengths: Array,
) -> int:
    """Send one ant per seed from start to goal; the steps taken by all.

    Row a of `walks` receives the cells of ant a, sizes[a] their number and lengths[a] its length [cells]; they are
    0 and inf if it did not arrive: it died where no move has any weight, or it took `limit` steps. A cell the ant
    has been to weighs `revisit`; at 0 it never goes there again. An ant that may `retreat` steps back where it
    would die, and forgets the dead cell as part of its walk, but not that it has been there.
    """
    pad = offset[1]  # no move leads further, so what surrounds the grid can be read without a check
    visited = np.zeros(len(mask) + 2 * pad, dtype=np.int32)  # the last ant that was there, from 1
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
            w0 = weights[i, 0] * np.float32(visited[i + offset[0] + pad] != ant)
            w1 = weights[i, 1] * np.float32(visited[i + offset[1] + pad] != ant)
            w2 = weights[i, 2] * np.float32(visited[i + offset[2] + pad] != ant)
            w3 = weights[i, 3] * np.float32(visited[i + offset[3] + pad] != ant)
            w4 = weights[i, 4] * np.float32(visited[i + offset[4] + pad] != ant)
            w5 = weights[i, 5] * np.float32(visited[i + offset[5] + pad] != ant)
            w6 = weights[i, 6] * np.float32(visited[i + offset[6] + pad] != ant)
            w7 = weights[i, 7] * np.float32(visited[i + offset[7] + pad] != ant)
            if again > ZERO:
                m = mask[i]
                w0 = again if m & 1 and visited[i + offset[0] + pad] == ant else w0
                w1 = again if m & 2 and visited[i + offset[1] + pad] == ant else w1
                w2 = again if m & 4 and visited[i + offset[2] + pad] == ant else w2
                w3 = again if m & 8 and visited[i + offset[3] + pad] == ant else w3
                w4 = again if m & 16 and visited[i + offset[4] + pad] == ant else w4
                w5 = again if m & 32 and visited[i + offset[5] + pad] == ant else w5
                w6 = again if m & 64 and visited[i + offset[6] + pad] == ant else w6
                w7 = again if m & 128 and visited[i + offset[7] + pad] == ant else w7
            p0, p1, p2, p3 = w0 + w1, w2 + w3, w4 + w5, w6 + w7
            q0, q1 = p0 + p1, p2 + p3
            total = q0 + q1
            left -= 1
            if total <= ZERO:
                if not retreat or n == 1:
                    left += 1
                    break
                n -= 1
                i = np.int64(walk[n - 1])
                continue
            state = next_random(state)
            # The roulette wheel as three halvings, without a branch to mispredict.
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
            if (wb if last else wa) <= ZERO:  # rounding pointed just beside a move: spin again
                continue
            i += offset[4 * upper + 2 * second + last]
            visited[i + pad] = ant
            walk[n] = i
            n += 1
        taken += limit - left
        sizes[a] = n if i == goal else 0
        lengths[a] = walk_length(walk, n, offset[2]) if i == goal else np.inf
    return taken


@kernel
def tally(lengths: Array) -> tuple[int, float, int]:
    """How many walks arrived, their mean length, and the shortest; lengths are inf of those that did not."""
    count, total, first = 0, 0.0, 0
    for a in range(len(lengths)):
        if lengths[a] < np.inf:
            count += 1
            total += lengths[a]
            if lengths[a] < lengths[first]:
                first = a
    return count, (total / count if count else np.inf), first


@kernel
def cut_loops(
    walks: Array, sizes: Array, mask: Array, offset: Array, tours: Array, tour_sizes: Array, lengths: Array
) -> None:
    """Row a of `tours` receives walk a without loops: back at a cell, everything since is dropped."""
    place = np.full(len(mask), -1, dtype=np.int32)
    for a in range(len(sizes)):
        n = 0
        for s in range(sizes[a]):
            i = walks[a, s]
            if place[i] >= 0:
                while n > place[i] + 1:
                    n -= 1
                    place[tours[a, n]] = -1
            else:
                tours[a, n] = i
                place[i] = n
                n += 1
        for s in range(n):
            place[tours[a, s]] = -1
        tour_sizes[a] = n
        lengths[a] = walk_length(tours[a], n, offset[2]) if n else np.inf


@kernel
def cut_one_short(walk: Array, size: int, mask: Array, offset: Array, first: int, place: Array, tour: Array) -> int:
    """`tour` receives the walk cut short: from each cell on to its neighbour that comes last in it. Its size.

    No longer than the walk: what is left out has two steps or more, and the step in its place is sqrt(2) at most.
    `place` tells each cell's place in a walk, counted on from `first`; what earlier walks left there is less.
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
                onward = max(onward, place[i + offset[k]])
        s = onward - first
    return n


@kernel
def cut_short(
    walks: Array, sizes: Array, mask: Array, offset: Array, tours: Array, tour_sizes: Array, lengths: Array
) -> None:
    """Row a of `tours` receives walk a cut short."""
    place = np.full(len(mask), -1, dtype=np.int64)
    first: Any = np.int64(0)  # a plain 0 would be compiled for as a type of its own
    for a in range(len(sizes)):
        n = cut_one_short(walks[a], sizes[a], mask, offset, first, place, tours[a])
        first += sizes[a]
        tour_sizes[a] = n
        lengths[a] = walk_length(tours[a], n, offset[2]) if n else np.inf


@kernel
def evaporate(trail: Array, evaporation: float) -> None:
    """trail *= 1 - evaporation, for a flat `trail`."""
    for i in range(len(trail)):
        trail[i] *= 1.0 - evaporation


@kernel
def clamp(trail: Array, least: float, most: float) -> None:
    """Bring every trail between two bounds; `trail` is flat."""
    for i in range(len(trail)):
        trail[i] = min(max(trail[i], least), most)


@kernel
def deposit_on_cells(trail: Array, walks: Array, sizes: Array, amounts: Array) -> None:
    """Add amounts[a] to each cell that walk a visits, once however often it does."""
    last = np.full(len(trail), -1, dtype=np.int32)
    for a in range(len(sizes)):
        for s in range(sizes[a]):
            i = walks[a, s]
            if last[i] != a:
                last[i] = a
                trail[i] += amounts[a]


@inline
def row_and_move(i: Any, j: Any, row: Any, cols: int) -> tuple[Any, Any]:
    """Row of cell j, and the move that leads there from its neighbour i in row `row`."""
    next_row = j // cols
    up = next_row - row
    right = j - i - up * cols
    move = 2 - right if up == 1 else (6 + right if up == -1 else 2 - 2 * right)
    return next_row, move


@kernel
def deposit_on_arcs(trail: Array, cols: int, walks: Array, sizes: Array, amounts: Array) -> None:
    """Add amounts[a] to each move, from its cell, that walk a makes; `trail` is (cells, 8)."""
    for a in range(len(sizes)):
        if sizes[a] == 0:
            continue
        i = np.int64(walks[a, 0])
        row = i // cols
        for s in range(1, sizes[a]):
            j = np.int64(walks[a, s])
            row, k = row_and_move(i, j, row, cols)
            trail[i, k] += amounts[a]
            i = j


@kernel
def deposit_in_passing(trail: Array, walks: Array, sizes: Array, amounts: Array, evaporation: float) -> None:
    """As han2007's listing: a cell evaporates each time an ant's deposit reaches it, and only then."""
    for a in range(len(sizes)):
        for s in range(sizes[a]):
            i = walks[a, s]
            trail[i] = trail[i] * (1.0 - evaporation) + amounts[a]


@kernel
def strongest(trail: Array, out: Array) -> None:
    """out[i] = the strongest trail that leaves cell i; `trail` is (cells, 8)."""
    for i in range(len(out)):
        most = trail[i, 0]
        for k in range(1, 8):
            most = max(most, trail[i, k])
        out[i] = most


@kernel
def arc_weights(trail: Array, desire: Array, alpha: float, weights: Array) -> None:
    """weights[i, k] = trail^alpha * desire, scaled so that the largest of each cell is 1."""
    for i in range(len(weights)):
        most = 0.0
        for k in range(8):
            if desire[i, k] > 0.0:
                most = max(most, _power(trail[i, k], alpha) * desire[i, k])
        scale = 1.0 / most if most > 0.0 else 0.0
        for k in range(8):
            weights[i, k] = 0.0
            if desire[i, k] > 0.0:
                weights[i, k] = max(LEAST, scale * _power(trail[i, k], alpha) * desire[i, k])


@inline
def _power(trail: float, alpha: float) -> float:
    """trail^alpha, quick for 1 and -1; a trail that has all but gone is as good as gone."""
    trail = max(trail, 1e-100)
    return trail if alpha == 1.0 else (1.0 / trail if alpha == -1.0 else trail**alpha)


@kernel
def union_moves(walks: Array, sizes: Array, cols: int, moves: Array) -> None:
    """Add to moves[i], bit by bit, those that the walks make from cell i; the cells are flat indices."""
    for a in range(len(sizes)):
        if sizes[a] == 0:
            continue
        i = np.int64(walks[a, 0])
        row = i // cols
        for s in range(1, sizes[a]):
            j = np.int64(walks[a, s])
            row, k = row_and_move(i, j, row, cols)
            moves[i] |= 1 << k
            i = j


@inline
def _octile(rows: int, cols: int) -> float:
    """Length of the shortest way over open ground [cells]."""
    rows, cols = abs(rows), abs(cols)
    return max(rows, cols) + (SQRT2 - 1.0) * min(rows, cols)


@kernel
def detour_weights(
    mask: Array,
    offset: Array,
    cols: int,
    start: int,
    goal: int,
    greed: float,
    pull: float,
    lane: float,
    height: Array,
    weights: Array,
) -> None:
    """weights[i, k] = exp(-greed * how much longer move k makes the way to the goal than it need be) [cells].

    The way from a cell to the goal is as over open ground plus, with `pull` above 0, pull * the distance to a
    lane: the line parallel to that from start to goal, `lane` cells to its side. `height` is room for a number
    per cell.
    """
    r0, c0, r1, c1 = start // cols, start % cols, goal // cols, goal % cols
    far = max(math.hypot(r1 - r0, c1 - c0), 1.0)
    across_row, across_col = (c0 - c1) / far, (r1 - r0) / far
    for i in range(len(mask)):
        row, col = i // cols, i % cols
        aside = (row - r0) * across_row + (col - c0) * across_col
        height[i] = _octile(r1 - row, c1 - col) + pull * abs(aside - lane)
    for i in range(len(mask)):
        for k in range(8):
            weights[i, k] = 0.0
            if mask[i] & (1 << k):
                detour = (SQRT2 if k & 1 else 1.0) + height[i + offset[k]] - height[i]
                weights[i, k] = math.exp(-greed * detour)


@kernel
def goal_pull(mask: Array, cols: int, r1: int, c1: int, pull: Array) -> None:
    """pull[i, k] = cosine between move k and the direction from cell i to the goal, at least 0."""
    for i in range(len(mask)):
        dr, dc = r1 - i // cols, c1 - i % cols
        far = math.hypot(dr, dc)
        for k in range(8):
            pull[i, k] = 0.0
            if far > 0.0 and mask[i] & (1 << k):
                along = (DROW[k] * dr + DCOL[k] * dc) / far
                pull[i, k] = max(0.0, along / SQRT2 if k & 1 else along)


@kernel
def fixed_pull(mask: Array, dr: float, dc: float, pull: Array) -> None:
    """pull[i, k] = dot product of step k (not normalised) and one direction for all cells, at least 0."""
    for i in range(len(mask)):
        for k in range(8):
            pull[i, k] = max(0.0, DROW[k] * dr + DCOL[k] * dc) if mask[i] & (1 << k) else 0.0


@kernel
def attracted_weights(
    trail: Array,
    mask: Array,
    offset: Array,
    pull: Array,
    attraction: float,
    shares: bool,
    least: float,
    weights: Array,
) -> None:
    """weights[i, k] = the neighbour's trail (or its share among the neighbours) + attraction * pull."""
    for i in range(len(mask)):
        scale = 1.0
        if shares:
            total = 0.0
            for k in range(8):
                if mask[i] & (1 << k):
                    total += trail[i + offset[k]]
            scale = 1.0 / total if total > 0.0 else 0.0
        for k in range(8):
            weights[i, k] = 0.0
            if mask[i] & (1 << k):
                weights[i, k] = max(least, trail[i + offset[k]] * scale + attraction * pull[i, k])
