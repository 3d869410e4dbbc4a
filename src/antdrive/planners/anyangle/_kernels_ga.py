"""Compiled evolution of via points: arrays in, arrays out, no validation.

A chromosome is a sequence of via points between the two fixed ends. Random numbers come from one xorshift64
state; every function that draws some returns the new state.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.planners.anyangle._kernels_lines import Terrain, clear_line
from antdrive.planners.colonies._kernels_colony import next_random
from antdrive.worlds._kernels import Array, inline, kernel

PER_BIT = 1.0 / 9007199254740992.0


@inline
def uniform(state: Any) -> Any:
    """Return the random number in [0, 1) of a state."""
    return (state >> np.uint64(11)) * PER_BIT


@kernel
def length_of(via: Array, ends: Array) -> float:
    """Return the length of the line from ends[0] over the via points (n, 2) to ends[1]."""
    total, x, y = 0.0, ends[0, 0], ends[0, 1]
    for k in range(via.shape[0]):
        total += math.hypot(via[k, 0] - x, via[k, 1] - y)
        x, y = via[k, 0], via[k, 1]
    return total + math.hypot(ends[1, 0] - x, ends[1, 1] - y)


@kernel
def feasible(via: Array, ends: Array, land: Terrain) -> bool:
    """Return whether every segment of the line from ends[0] over the via points to ends[1] is clear."""
    x, y = ends[0, 0], ends[0, 1]
    for k in range(via.shape[0]):
        if not clear_line(land, x, y, via[k, 0], via[k, 1]):
            return False
        x, y = via[k, 0], via[k, 1]
    return clear_line(land, x, y, ends[1, 0], ends[1, 1])


@kernel
def refill(
    population: Array, lengths: Array, size: int, points: Array, ends: Array, land: Terrain, tries: int, state: Any
) -> tuple[int, int, Any]:
    """Add random feasible chromosomes until the population is full or after `tries`; returns size, draws, state."""
    n = population.shape[1]
    drawn = 0
    while size < population.shape[0] and drawn < tries:
        drawn += 1
        # Draw a via point only after a clear line to the one before: most draws fail at the first segment.
        x, y = ends[0, 0], ends[0, 1]
        clear = True
        for k in range(n):
            state = next_random(state)
            p = int(uniform(state) * points.shape[0])
            if not clear_line(land, x, y, points[p, 0], points[p, 1]):
                clear = False
                break
            x, y = points[p, 0], points[p, 1]
            population[size, k, 0], population[size, k, 1] = x, y
        if clear and clear_line(land, x, y, ends[1, 0], ends[1, 1]):
            lengths[size] = length_of(population[size], ends)
            size += 1
    return size, drawn, state


@inline
def copy_points(points: Array, first: int, into: Array) -> None:
    """Assign into[first:] = points[first:] for points (n, 2)."""
    for k in range(first, points.shape[0]):
        into[k, 0], into[k, 1] = points[k, 0], points[k, 1]


@inline
def shortest_of(lengths: Array, size: int) -> int:
    """Return the index of the shortest of the first `size` lengths."""
    first = 0
    for i in range(1, size):
        first = i if lengths[i] < lengths[first] else first
    return first


@kernel
def next_generation(
    population: Array,
    lengths: Array,
    size: int,
    points: Array,
    ends: Array,
    land: Terrain,
    crossover: float,
    mutation: float,
    elitism: bool,
    elite_breeds: bool,
    state: Any,
) -> tuple[int, Any]:
    """Clone, cross, mutate and eliminate in place (Han 2007, section 4.1); returns the number of survivors, state.

    The survivors fill the front of `population`; with elitism the best of the last generation comes first.
    """
    room, n = population.shape[0], population.shape[1]
    bred = np.empty_like(population)
    keep, elite = (1, shortest_of(lengths, size)) if elitism else (0, -1)
    if elitism:
        copy_points(population[elite], 0, bred[0])
    # Natural selection: fill the population with clones drawn by fitness 1 / length.
    share, total = np.empty(size, dtype=np.float64), 0.0
    for i in range(size):
        total += 1.0 / lengths[i] if elite_breeds or i != elite or size == 1 else 0.0
        share[i] = total
    for i in range(keep, room):
        state = next_random(state)
        parent = np.searchsorted(share, uniform(state) * share[size - 1], side="right")
        copy_points(population[min(parent, size - 1)], 0, bred[i])
    # Crossover after the same via point for all parents; they receive the tails in reverse order.
    if n > 1:
        state = next_random(state)
        head = 1 + int(uniform(state) * (n - 1))
        parents = np.empty(room, dtype=np.int64)
        count = 0
        for i in range(keep, room):
            state = next_random(state)
            if uniform(state) < crossover:
                parents[count] = i
                count += 1
        tails = np.empty((count, n, 2), dtype=np.float64)
        for k in range(count):
            copy_points(bred[parents[count - 1 - k]], head, tails[k])
        for k in range(count):
            copy_points(tails[k], head, bred[parents[k]])
    # A gene mutates to any free grid point.
    for i in range(keep, room):
        for k in range(n):
            state = next_random(state)
            if uniform(state) < mutation:
                state = next_random(state)
                p = int(uniform(state) * points.shape[0])
                bred[i, k, 0], bred[i, k, 1] = points[p, 0], points[p, 1]
    # Elimination of infeasible chromosomes.
    size = 0
    for i in range(room):
        if i < keep or feasible(bred[i], ends, land):
            copy_points(bred[i], 0, population[size])
            lengths[size] = length_of(bred[i], ends)
            size += 1
    return size, state


@inline
def neighbours(via: Array, k: int, ends: Array) -> tuple[float, float, float, float]:
    """Return the points before and after a via point."""
    ax, ay = ends[0, 0], ends[0, 1]
    if k > 0:
        ax, ay = via[k - 1, 0], via[k - 1, 1]
    bx, by = ends[1, 0], ends[1, 1]
    if k < via.shape[0] - 1:
        bx, by = via[k + 1, 0], via[k + 1, 1]
    return ax, ay, bx, by


@kernel
def tighten(via: Array, k: int, ends: Array, land: Terrain) -> None:
    """Move one via point towards the line between its neighbours while both its segments stay clear."""
    ax, ay, bx, by = neighbours(via, k, ends)
    x, y = via[k, 0], via[k, 1]
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    t = ((x - ax) * dx + (y - ay) * dy) / length2 if length2 > 0.0 else 0.0
    t = min(1.0, max(0.0, t))
    dx, dy = ax + t * dx - x, ay + t * dy - y
    part, step = 0.0, 1.0
    for _ in range(10):  # to a thousandth of the distance
        if part + step <= 1.0:
            nx, ny = x + (part + step) * dx, y + (part + step) * dy
            if clear_line(land, ax, ay, nx, ny) and clear_line(land, nx, ny, bx, by):
                part += step
        step *= 0.5
    via[k, 0], via[k, 1] = x + part * dx, y + part * dy


@kernel
def tighten_all(via: Array, ends: Array, land: Terrain, rounds: int) -> float:
    """Tighten all via points in sequence, `rounds` times; returns the length of the line."""
    for _ in range(rounds):
        for k in range(via.shape[0]):
            tighten(via, k, ends, land)
    return length_of(via, ends)


@kernel
def shift(via: Array, k: int, ends: Array, land: Terrain, max_shift: float, state: Any) -> Any:
    """Shift one via point at random by 1e-4 to 1 times `max_shift` if its segments stay clear; returns the state."""
    ax, ay, bx, by = neighbours(via, k, ends)
    state = next_random(state)
    step = max_shift * 10.0 ** (-4.0 * uniform(state))
    state = next_random(state)
    heading = 2.0 * math.pi * uniform(state)
    nx, ny = via[k, 0] + step * math.cos(heading), via[k, 1] + step * math.sin(heading)
    if clear_line(land, ax, ay, nx, ny) and clear_line(land, nx, ny, bx, by):
        via[k, 0], via[k, 1] = nx, ny
    return state


@kernel
def breed_feasible(
    population: Array,
    lengths: Array,
    ends: Array,
    land: Terrain,
    crossover: float,
    mutation: float,
    max_shift: float,
    state: Any,
) -> Any:
    """Breed feasible chromosomes from feasible ones in place, the best one in front; returns the state.

    A parent is the shorter of two random chromosomes. Crossover takes a tail if the new segment is clear. A gene
    mutates by tightening or by a random shift, only while its segments stay clear, so no chromosome needs to be
    eliminated.
    """
    room, n = population.shape[0], population.shape[1]
    bred = np.empty_like(population)
    copy_points(population[shortest_of(lengths, room)], 0, bred[0])
    for i in range(1, room):
        pick = np.empty(2, dtype=np.int64)
        for p in range(2):
            state = next_random(state)
            a = int(uniform(state) * room)
            state = next_random(state)
            b = int(uniform(state) * room)
            pick[p] = a if lengths[a] <= lengths[b] else b
        copy_points(population[pick[0]], 0, bred[i])
        state = next_random(state)
        if n > 1 and uniform(state) < crossover:
            state = next_random(state)
            head = 1 + int(uniform(state) * (n - 1))
            other = population[pick[1]]
            if clear_line(land, bred[i, head - 1, 0], bred[i, head - 1, 1], other[head, 0], other[head, 1]):
                copy_points(other, head, bred[i])
        for k in range(n):
            state = next_random(state)
            if uniform(state) < mutation:
                state = next_random(state)
                if uniform(state) < 0.5:
                    tighten(bred[i], k, ends, land)
                else:
                    state = shift(bred[i], k, ends, land, max_shift, state)
    for i in range(room):
        copy_points(bred[i], 0, population[i])
        lengths[i] = length_of(bred[i], ends)
    return state
