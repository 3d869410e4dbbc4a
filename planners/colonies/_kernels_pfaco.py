"""Compiled ants without generations: arrays in, arrays out, nothing validated."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.planners.colonies._kernels_colony import cut_one_short, next_random, walk_length
from antdrive.worlds._kernels import SQRT2, Array, inline, kernel

# What an ant has behind it, by column of `ants`.
SIZE, TAKEN = 0, 1  # cells of its walk; steps since it left, those back included
# What the colony has behind it, by index of `counts`.
LISTED, ENTRIES, STEPS, ARRIVED = 0, 1, 2, 3


@kernel
def obstacle_distance(free: Array, reach: int) -> Array:
    """Distance from each cell to the nearest blocked one [cells], inf beyond `reach`."""
    rows, cols = free.shape
    out = np.full((rows, cols), np.inf)
    for r in range(rows):
        for c in range(cols):
            if free[r, c]:
                continue
            for near_row in range(max(0, r - reach), min(rows, r + reach + 1)):
                for near_col in range(max(0, c - reach), min(cols, c + reach + 1)):
                    out[near_row, near_col] = min(out[near_row, near_col], math.hypot(near_row - r, near_col - c))
    return out


@inline
def _power(value: float, exponent: float) -> float:
    """value^exponent, quick for 1, 2 and 3."""
    if exponent == 1.0:
        return value
    if exponent == 2.0:
        return value * value
    return value * value * value if exponent == 3.0 else value**exponent


@kernel
def leave(ant: int, start: int, walks: Array, ants: Array, lengths: Array, been: Array) -> None:
    """Put an ant at the start, with nothing behind it."""
    for b in range(been.shape[1]):
        been[ant, b] = 0
    been[ant, start >> 3] |= 1 << (start & 7)
    walks[ant, 0] = start
    ants[ant, SIZE], ants[ant, TAKEN] = 1, 0
    lengths[ant] = 0.0


@kernel
def enter(
    walk: Array, size: int, length: float, ranked: Array, sizes: Array, costs: Array, order: Array, counts: Array
) -> int:
    """Enter a walk into the ranking list by its cost (lee2008 eq. 15); its rank, or -1 if it is no better than the last.

    order[r] is the row of `ranked` that holds rank r.
    """
    cost = length * size
    listed, room = counts[LISTED], len(order)
    if listed == room and cost >= costs[order[room - 1]]:
        return -1
    if listed < room:
        row = listed
        counts[LISTED] += 1
    else:
        row = order[room - 1]
        listed -= 1
    rank: int = listed
    while rank > 0 and costs[order[rank - 1]] > cost:
        order[rank] = order[rank - 1]
        rank -= 1
    order[rank] = row
    costs[row], sizes[row] = cost, size
    for s in range(size):
        ranked[row, s] = walk[s]
    counts[ENTRIES] += 1
    return rank


@kernel
def run_colony(
    trail: Array,
    appeal: Array,
    mask: Array,
    offset: Array,
    start: int,
    goal: int,
    alpha: float,
    evaporation: float,
    least: float,
    deposit: float,
    limit: int,
    retreat: bool,
    shortcut: bool,
    quota: int,
    states: Array,
    walks: Array,
    ants: Array,
    lengths: Array,
    been: Array,
    ranked: Array,
    sizes: Array,
    costs: Array,
    order: Array,
    counts: Array,
    shortest: float,
    best: Array,
    arrivals: Array,
) -> tuple[int, float]:
    """Move every ant a cell a tick until `quota` walks have ended; the number of cells of the best walk and its length.

    `best` receives it if it is shorter than `shortest`; else the number is 0.

    A walk ends at the goal, in a dead end, after `limit` steps, or when it is longer than all of the full list.
    `arrivals` receives the lengths of those that arrived.
    """
    share = np.empty(8, dtype=np.float64)
    place = np.full(len(mask), -1, dtype=np.int64)
    first: Any = np.int64(0)  # a plain 0 would be compiled for as a type of its own
    tour = np.empty_like(best)
    ended, new = 0, 0
    counts[ARRIVED] = 0
    worst = np.inf  # longest of the list
    stale = True
    while ended < quota:
        for ant in range(len(states)):
            size = ants[ant, SIZE]
            i: Any = np.int64(walks[ant, size - 1])
            total = 0.0
            for k in range(8):
                if mask[i] & (1 << k):
                    j = i + offset[k]
                    if not been[ant, j >> 3] & (1 << (j & 7)):
                        total += _power(trail[j], alpha) * appeal[j]  # eq. 13
                share[k] = total
            ants[ant, TAKEN] += 1
            counts[STEPS] += 1
            if total <= 0.0:
                if retreat and size > 1 and ants[ant, TAKEN] < limit:
                    ants[ant, SIZE] = size - 1
                    h = np.int64(walks[ant, size - 2])
                    lengths[ant] -= 1.0 if abs(i - h) == 1 or abs(i - h) == offset[2] else SQRT2
                    continue
                leave(ant, start, walks, ants, lengths, been)
                ended += 1
                continue
            state = next_random(states[ant])
            states[ant] = state
            spin = (state >> np.uint64(11)) * (1.0 / 9007199254740992.0) * total
            k = 0
            while share[k] <= spin and k < 7:
                k += 1
            i += offset[k]
            been[ant, i >> 3] |= 1 << (i & 7)
            walks[ant, size] = i
            ants[ant, SIZE] = size + 1
            lengths[ant] += SQRT2 if k & 1 else 1.0
            if i == goal:
                if shortcut:
                    size = cut_one_short(walks[ant], size + 1, mask, offset, first, place, tour) - 1
                    first += len(mask)
                    for s in range(size + 1):
                        walks[ant, s] = tour[s]
                    lengths[ant] = walk_length(tour, size + 1, offset[2])
                arrivals[counts[ARRIVED]] = lengths[ant]
                counts[ARRIVED] += 1
                if lengths[ant] < shortest - 1e-9:
                    shortest = lengths[ant]
                    new = size + 1
                    for s in range(size + 1):
                        best[s] = walks[ant, s]
                rank = enter(walks[ant], size + 1, lengths[ant], ranked, sizes, costs, order, counts)
                if rank >= 0:  # the better the rank, the more on each cell
                    amount = deposit * (1.0 - rank / len(order))
                    for s in range(size + 1):
                        trail[walks[ant, s]] += amount
                    stale = True
            elif ants[ant, TAKEN] < limit and lengths[ant] <= worst:
                continue
            ended += 1
            leave(ant, start, walks, ants, lengths, been)
        for i in range(len(trail)):
            if mask[i]:
                trail[i] = max(least, trail[i] * (1.0 - evaporation))
        if stale and counts[LISTED] == len(order):
            stale = False
            worst = 0.0
            for row in range(len(order)):
                worst = max(worst, costs[row] / sizes[row])
    return new, shortest
