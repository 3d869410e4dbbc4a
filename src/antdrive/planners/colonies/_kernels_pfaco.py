"""Compiled ants without generations: arrays in, arrays out, no validation."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from antdrive.planners.colonies._kernels_colony import (
    AntGraph,
    after,
    copy_without_loops,
    cut_one_short,
    next_random,
    step_length,
    walk_length,
)
from antdrive.worlds._kernels import SQRT2, Array, inline, kernel

LISTED, ENTRIES = 0, 1  # indices of `Ranking.counts`


class Rules(NamedTuple):
    """The planner's parameters for one iteration.

    Attributes:
        alpha: the exponent of the pheromone
        evaporation: the fraction of pheromone lost per tick
        min_pheromone: the lower bound of the pheromone
        deposit: the deposit of a first-rank walk on each of its cells
        graded: whether the deposit falls with the rank
        generations: whether ants wait for each other
        limit: step limit of a walk
        tabu: whether an ant avoids visited cells
        backtrack: whether an ant in a dead end steps back
        shortcut: whether walks that arrive are cut short
        quota: number of ended walks that ends the iteration
    """

    alpha: float
    evaporation: float
    min_pheromone: float
    deposit: float
    graded: bool
    generations: bool
    limit: int
    tabu: bool
    backtrack: bool
    shortcut: bool
    quota: int


class Ants(NamedTuple):
    """The ants and their unfinished walks.

    Attributes:
        states: the state of each ant's random numbers (ants,)
        walks: the cells of each walk (ants, room)
        sizes: number of cells of each walk (ants,)
        taken: steps of each ant since it left the start, including steps back (ants,)
        lengths: the length of each walk [cells] (ants,)
        visited: the cells that each ant has visited, one bit per cell (ants, cells / 8 + 1)
    """

    states: Array
    walks: Array
    sizes: Array
    taken: Array
    lengths: Array
    visited: Array


class Ranking(NamedTuple):
    """The list of the best walks so far.

    Attributes:
        walks: the cells of each walk in the list (ranks, room)
        sizes: number of cells of each walk (ranks,)
        costs: the cost of each walk, its length times its size (ranks,)
        order: the row of each rank, the best first (ranks,)
        counts: number of walks in the list (LISTED), and of all entries so far (ENTRIES)
    """

    walks: Array
    sizes: Array
    costs: Array
    order: Array
    counts: Array


@kernel
def obstacle_distance(free: Array, reach: int) -> Array:
    """Return the distance from each cell to the nearest blocked cell [cells], inf beyond `reach`."""
    rows, cols = free.shape
    out = np.full((rows, cols), np.inf)
    for r in range(rows):
        for c in range(cols):
            if free[r, c]:
                continue
            for near_row in range(max(0, r - reach), min(rows, r + reach + 1)):
                for near_col in range(max(0, c - reach), min(cols, c + reach + 1)):
                    distance = math.hypot(near_row - r, near_col - c)
                    out[near_row, near_col] = min(out[near_row, near_col], distance)
    return out


@inline
def _power(value: float, exponent: float) -> float:
    """Return value^exponent, fast for the exponents 1, 2 and 3."""
    if exponent == 1.0:
        return value
    if exponent == 2.0:
        return value * value
    return value * value * value if exponent == 3.0 else value**exponent


@inline
def leave(ant: int, start: int, ants: Ants) -> None:
    """Put an ant at the start, with a walk of one cell."""
    for b in range(ants.visited.shape[1]):
        ants.visited[ant, b] = 0
    ants.visited[ant, start >> 3] |= 1 << (start & 7)
    ants.walks[ant, 0] = start
    ants.sizes[ant], ants.taken[ant] = 1, 0
    ants.lengths[ant] = 0.0


@kernel
def enter(walk: Array, size: int, length: float, ranking: Ranking) -> int:
    """Enter a walk into the ranking by cost (lee2008 eq. 15); returns its rank, or -1 if the list is full of better ones."""
    order, costs, counts = ranking.order, ranking.costs, ranking.counts
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
    costs[row], ranking.sizes[row] = cost, size
    for s in range(size):
        ranking.walks[row, s] = walk[s]
    counts[ENTRIES] += 1
    return rank


@kernel
def longest_listed(ranking: Ranking) -> float:
    """Return the length of the longest walk of a full list."""
    longest = 0.0
    for row in range(len(ranking.order)):
        longest = max(longest, ranking.costs[row] / ranking.sizes[row])
    return longest


@inline
def cumulate(
    i: Any,
    ant: int,
    trail: Array,
    heuristic: Array,
    mask: Array,
    to: Array,
    visited: Array,
    tabu: bool,
    alpha: float,
    out: Array,
) -> float:
    """Fill out[k] with the attraction of moves 0 to k from cell i, with `tabu` without visited cells; returns the total."""
    total = 0.0
    for k in range(8):
        if mask[i] & (1 << k):
            j = after(to, np.int64(i), k)
            if not (tabu and visited[ant, j >> 3] & (1 << (j & 7))):
                total += _power(trail[j], alpha) * heuristic[i, k]  # eq. 13
        out[k] = total
    return total


@inline
def draw(cumulated: Array, state: Any, total: float) -> int:
    """Return the move selected by a random number."""
    spin = (state >> np.uint64(11)) * (1.0 / 9007199254740992.0) * total
    k = 0
    while cumulated[k] <= spin and k < 7:
        k += 1
    return k


@kernel
def cut_walk_short(ant: int, ants: Ants, graph: AntGraph, first: int, place: Array, tour: Array) -> None:
    """Cut an ant's walk short; `first`, `place` and `tour` are those of `cut_one_short`."""
    walk = ants.walks[ant]
    size = cut_one_short(walk, ants.sizes[ant], graph.mask, graph.to, first, place, tour)
    for s in range(size):
        walk[s] = tour[s]
    ants.sizes[ant] = size
    ants.lengths[ant] = walk_length(tour, size, graph.to)


@kernel
def reward(walk: Array, size: int, length: float, trail: Array, ranking: Ranking, deposit: float, graded: bool) -> bool:
    """Enter a walk into the ranking and deposit on each of its cells, by rank if `graded`; returns whether it has a rank."""
    rank = enter(walk, size, length, ranking)
    if graded:
        deposit *= 1.0 - rank / len(ranking.order) if rank >= 0 else 0.0
    for s in range(size):
        trail[walk[s]] += deposit
    return rank >= 0


@kernel
def decay(trail: Array, mask: Array, min_pheromone: float, evaporation: float) -> None:
    """Evaporate pheromone for one tick."""
    for i in range(len(trail)):
        if mask[i]:
            trail[i] = max(min_pheromone, trail[i] * (1.0 - evaporation))


@kernel
def run_colony(
    trail: Array,
    heuristic: Array,
    graph: AntGraph,
    rules: Rules,
    ants: Ants,
    ranking: Ranking,
    shortest: float,
    best: Array,
    arrivals: Array,
) -> tuple[int, float, int, int]:
    """Move every ant by one cell per tick until `rules.quota` walks have ended.

    A walk ends at the goal, in a dead end, after `rules.limit` steps, or when it is longer than every walk of
    the full ranking; the ant then restarts. With `rules.generations` no walk ends for its length, and ants wait
    until all walks have ended; then they deposit, and pheromone evaporates once. `best` receives the cells of the
    best walk if it is shorter than `shortest`, `arrivals` the lengths of the walks that arrived.

    Returns the size of the new best walk (0: none), the length of the best walk, the number of steps, and the
    number of arrivals.
    """
    # Arrays are unpacked here, as the loop below runs once per step of every ant.
    mask, to, goal = graph.mask, graph.to, graph.goal
    states, walks, sizes, taken = ants.states, ants.walks, ants.sizes, ants.taken
    lengths, visited = ants.lengths, ants.visited
    alpha, limit, tabu = rules.alpha, rules.limit, rules.tabu
    cumulated = np.empty(8, dtype=np.float64)
    place, tour = np.full(len(mask), -1, dtype=np.int64), np.empty_like(best)
    last = np.empty_like(place)
    first: Any = np.int64(0)  # a literal 0 would compile `cut_one_short` a second time
    ended, steps, arrived, new = 0, 0, 0, 0
    worst = np.inf  # the longest walk of a full ranking
    stale = True  # whether the ranking has changed since `worst` was computed
    waiting, home = np.zeros(len(states), dtype=np.bool_), np.zeros(len(states), dtype=np.bool_)
    while ended < rules.quota:
        for ant in range(len(states)):
            if waiting[ant]:
                continue
            size = sizes[ant]
            i: Any = np.int64(walks[ant, size - 1])
            total = cumulate(i, ant, trail, heuristic, mask, to, visited, tabu, alpha, cumulated)
            taken[ant] += 1
            steps += 1
            if total > 0.0:
                state = next_random(states[ant])
                states[ant] = state
                k = draw(cumulated, state, total)
                i = after(to, i, k)
                visited[ant, i >> 3] |= 1 << (i & 7)
                walks[ant, size] = i
                sizes[ant] = size + 1
                lengths[ant] += SQRT2 if k & 1 else 1.0
                if i == goal:
                    if rules.shortcut:
                        cut_walk_short(ant, ants, graph, first, place, tour)
                        first += len(mask)
                    size = sizes[ant]
                    arrivals[arrived] = lengths[ant]
                    arrived += 1
                    if lengths[ant] < shortest - 1e-9 or not tabu:
                        size = copy_without_loops(walks[ant], size, last, tour)
                        length = walk_length(tour, size, to)
                        if length < shortest - 1e-9:
                            shortest, new = length, size
                            best[:size] = tour[:size]
                    home[ant] = True
                elif taken[ant] < limit and lengths[ant] <= worst:
                    continue
            elif rules.backtrack and size > 1 and taken[ant] < limit:
                sizes[ant] = size - 1
                back: Any = np.int64(walks[ant, size - 2])
                lengths[ant] -= step_length(to, back, i)
                continue
            ended += 1
            if rules.generations:
                waiting[ant] = True
                continue
            if home[ant]:
                home[ant] = False
                size = sizes[ant]
                stale |= reward(walks[ant], size, lengths[ant], trail, ranking, rules.deposit, rules.graded)
            leave(ant, graph.start, ants)
        if rules.generations and ended < rules.quota:
            continue
        decay(trail, mask, rules.min_pheromone, rules.evaporation)
        if rules.generations:
            for ant in range(len(states)):
                if home[ant]:
                    reward(walks[ant], sizes[ant], lengths[ant], trail, ranking, rules.deposit, rules.graded)
                leave(ant, graph.start, ants)
        elif stale and ranking.counts[LISTED] == len(ranking.order):
            stale = False
            worst = longest_listed(ranking)
    return new, shortest, steps, arrived
