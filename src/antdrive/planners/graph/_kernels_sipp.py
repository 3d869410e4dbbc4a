"""Compiled safe-interval path planning: arrays in, arrays out, no validation.

A mover's motion consists of straight legs at constant speed. So does the robot's: waits, turns on the spot and moves.
The conflicts of a leg and a move form an interval with ends in closed form; nothing is sampled. Times are in seconds,
positions in metres.

A state is a safe interval of a cell and, on a grid with turns, one of the eight headings: number 8 * interval + heading.
There, moves lead ahead alone, and turns lead to the next heading of the same interval.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.planners.graph._kernels_heap import STATE, G, drop_first, push
from antdrive.planners.graph._kernels_search import octile
from antdrive.worlds._kernels import DCOL, DROW, SQRT2, Array, inline, kernel, segment_distance2
from antdrive.worlds._kernels_turns import MoveGraph

INSTANT = 1e-9  # s: shorter gaps count as closed

# Columns of a leg: start and end time, start position, velocity, clearance of the robot's centre.
BEGIN, END, X, Y, VX, VY, KEEP = range(7)


class Frame(NamedTuple):
    """The grid's frame: the centre of cell (0, 0) and the side of a cell [m]."""

    x0: float
    y0: float
    cell: float


class NearLegs(NamedTuple):
    """The legs that may come too close to each cell: number[first[i] : first[i + 1]] for cell i."""

    legs: Array  # (L, 7)
    first: Array  # (cells + 1,)
    number: Array  # (M,)


class Intervals(NamedTuple):
    """Safe intervals of cell i: from since[k] to until[k] for first[i] <= k < first[i + 1]."""

    first: Array  # (cells + 1,)
    since: Array  # (K,) [s]
    until: Array  # (K,) [s]


class Trip(NamedTuple):
    """Flat start and goal cells, speed, time of a turn by 45°, departure, deadline, and whether the goal must stay safe."""

    start: int
    goal: int
    speed: float
    turn: float
    departure: float
    end: float
    stay: bool


class Tree(NamedTuple):
    """The best known path into each state."""

    reached: Array  # (S,) arrival time, inf while unreached [s]
    parent: Array  # (S,) the previous state, -1 at the root
    left: Array  # (S,) departure time from the parent's cell [s]


class Move(NamedTuple):
    """A move: earliest and latest departure, duration, the minimum time from its end to the goal, and how states count.

    State `offset` + `headings` * k is that of interval k.
    """

    now: float
    latest: float
    lasts: float
    rest: float
    headings: int
    offset: int


@kernel
def legs_within(t: Array, xy: Array, jump: Array, tolerance: float) -> tuple[Array, Array, int]:
    """Join samples to legs as long as possible; returns each leg's first and last sample, and the number of legs.

    Samples `xy` (T, 2) at `t` (T,) lie within `tolerance` of their leg. No leg spans a jump; jump[i] marks one
    between samples i and i + 1.
    """
    first, last = np.empty(len(t), dtype=np.int64), np.empty(len(t), dtype=np.int64)
    count, a = 0, 0
    while a < len(t) - 1:
        if jump[a]:
            a += 1
            continue
        # The box of velocities for which the leg passes every sample so far within the tolerance.
        low_x, high_x, low_y, high_y = -np.inf, np.inf, -np.inf, np.inf
        b = a
        while b < len(t) - 1 and not jump[b]:
            dt = t[b + 1] - t[a]
            vx, vy = (xy[b + 1, 0] - xy[a, 0]) / dt, (xy[b + 1, 1] - xy[a, 1]) / dt
            if b > a and not (low_x <= vx <= high_x and low_y <= vy <= high_y):
                break
            slack = tolerance / SQRT2 / dt
            low_x, high_x = max(low_x, vx - slack), min(high_x, vx + slack)
            low_y, high_y = max(low_y, vy - slack), min(high_y, vy + slack)
            b += 1
        first[count], last[count] = a, b
        count += 1
        a = b
    return first, last, count


@kernel
def near_legs(legs: Array, free: Array, frame: Frame) -> tuple[Array, Array]:
    """Compute `first` and `number` of `NearLegs`: the legs that may come too close to a robot in each free cell.

    They include legs that may come too close during a move from the cell. Legs keep their order.
    """
    rows, cols = free.shape
    first = np.zeros(rows * cols + 1, dtype=np.int64)
    number = np.empty(0, dtype=np.int32)
    fill = np.empty(0, dtype=np.int64)
    x0, y0, cell = frame.x0, frame.y0, frame.cell
    for filling in range(2):  # the first pass counts, the second lists
        for n in range(len(legs)):
            span = legs[n, END] - legs[n, BEGIN]
            ax, ay = legs[n, X], legs[n, Y]
            dx, dy = legs[n, VX] * span, legs[n, VY] * span
            reach = legs[n, KEEP] + SQRT2 * cell
            r_lo = max(0, int(math.ceil((min(ay, ay + dy) - reach - y0) / cell)))
            r_hi = min(rows - 1, int(math.floor((max(ay, ay + dy) + reach - y0) / cell)))
            for r in range(r_lo, r_hi + 1):
                y = y0 + r * cell
                lo, hi = 0.0, 1.0  # the part of the leg that is no farther from this row than the reach
                if abs(dy) > 1e-12:
                    one, two = (y - reach - ay) / dy, (y + reach - ay) / dy
                    lo, hi = max(0.0, min(one, two)), min(1.0, max(one, two))
                left, right = ax + min(lo * dx, hi * dx) - reach, ax + max(lo * dx, hi * dx) + reach
                c_lo = max(0, int(math.ceil((left - x0) / cell)))
                c_hi = min(cols - 1, int(math.floor((right - x0) / cell)))
                for c in range(c_lo, c_hi + 1):
                    if not free[r, c]:
                        continue
                    if segment_distance2(x0 + c * cell, y, ax, ay, ax + dx, ay + dy) > reach * reach:
                        continue
                    i = r * cols + c
                    if filling:
                        number[fill[i]] = n
                        fill[i] += 1
                    else:
                        first[i + 1] += 1
        if not filling:
            first = np.cumsum(first)
            number = np.empty(first[-1], dtype=np.int32)
            fill = first.copy()
    return first, number


@inline
def within(qx: float, qy: float, vx: float, vy: float, reach: float, span: float) -> tuple[float, float]:
    """Return the part of [0, span] in which |q + v s| < reach, as (lo, hi); lo > hi if there is none."""
    a = vx * vx + vy * vy
    b = qx * vx + qy * vy
    c = qx * qx + qy * qy - reach * reach
    lo, hi = 0.0, span
    if a < 1e-18:
        if c >= 0.0:
            lo, hi = 1.0, 0.0
    else:
        root = b * b - a * c
        if root <= 0.0:
            lo, hi = 1.0, 0.0
        else:
            root = math.sqrt(root)
            lo, hi = max(0.0, (-b - root) / a), min(span, (-b + root) / a)
    return lo, hi


@kernel
def conflict(leg: Array, x: float, y: float, ux: float, uy: float, lasts: float) -> tuple[float, float]:
    """Return the departures (lo, hi) for which a move from (x, y) at velocity u over `lasts` comes too close to a leg.

    With w the time since the leg began and s the time since the departure, the robot is too close where
    |q + v w - u s| < reach: a convex region, cut by the rectangle 0 <= w <= span, 0 <= s <= lasts.
    The departure w - s takes its extremes on the sides of the rectangle or where the rim of the region is
    parallel to the line w - s = 0. If there is no such departure, lo > hi.
    """
    span, reach = leg[END] - leg[BEGIN], leg[KEEP]
    qx, qy, vx, vy = leg[X] - x, leg[Y] - y, leg[VX], leg[VY]
    lo, hi = np.inf, -np.inf
    for side in range(2):  # the robot at the beginning or end of its move
        s = side * lasts
        one, two = within(qx - ux * s, qy - uy * s, vx, vy, reach, span)
        if one <= two:
            lo, hi = min(lo, one - s), max(hi, two - s)
    for side in range(2):  # the mover at the beginning or end of its leg
        w = side * span
        one, two = within(qx + vx * w, qy + vy * w, -ux, -uy, reach, lasts)
        if one <= two:
            lo, hi = min(lo, w - two), max(hi, w - one)
    det = vy * ux - vx * uy
    ex, ey = vx - ux, vy - uy
    size = math.hypot(ex, ey)
    if abs(det) > 1e-12 and size > 1e-12:
        for sign in (-1.0, 1.0):
            zx, zy = -sign * reach * ey / size - qx, sign * reach * ex / size - qy
            w, s = (zy * ux - zx * uy) / det, (vx * zy - vy * zx) / det
            if 0.0 <= w <= span and 0.0 <= s <= lasts:
                lo, hi = min(lo, w - s), max(hi, w - s)
    return leg[BEGIN] + lo, leg[BEGIN] + hi


@inline
def insert(lows: Array, highs: Array, count: int, lo: float, hi: float) -> int:
    """Insert an interval into a list sorted by lower ends; returns the new count."""
    n = count
    while n > 0 and lows[n - 1] > lo:
        lows[n], highs[n] = lows[n - 1], highs[n - 1]
        n -= 1
    lows[n], highs[n] = lo, hi
    return count + 1


@kernel
def most_legs(near: NearLegs) -> int:
    """Return the largest number of legs near one cell."""
    most = 0
    for i in range(len(near.first) - 1):
        most = max(most, near.first[i + 1] - near.first[i])
    return most


@kernel
def safe_intervals(near: NearLegs, free: Array, frame: Frame, start: float, end: float) -> tuple[Array, Array, Array]:
    """Compute the fields of `Intervals`: when a robot can stand in each free cell between two times."""
    rows, cols = free.shape
    capacity = rows * cols + len(near.number)
    first = np.empty(rows * cols + 1, dtype=np.int64)
    since, until = np.empty(capacity), np.empty(capacity)
    most = most_legs(near)
    lows, highs = np.empty(most), np.empty(most)
    size = 0
    for i in range(rows * cols):
        first[i] = size
        r, c = i // cols, i % cols
        if not free[r, c]:
            continue
        count = 0
        for e in range(near.first[i], near.first[i + 1]):
            leg = near.legs[near.number[e]]
            qx, qy = leg[X] - frame.x0 - c * frame.cell, leg[Y] - frame.y0 - r * frame.cell
            lo, hi = within(qx, qy, leg[VX], leg[VY], leg[KEEP], leg[END] - leg[BEGIN])
            if lo <= hi:
                count = insert(lows, highs, count, leg[BEGIN] + lo, leg[BEGIN] + hi)
        t = start
        for n in range(count):
            if lows[n] > t + INSTANT:
                since[size], until[size] = t, lows[n]
                size += 1
            t = max(t, highs[n])
        if t < end:
            since[size], until[size] = t, end
            size += 1
    first[rows * cols] = size
    return first, since[:size].copy(), until[:size].copy()


@inline
def conflicts(
    near: NearLegs, i: int, x: float, y: float, ux: float, uy: float, move: Move, lows: Array, highs: Array
) -> int:
    """Fill `lows` and `highs` with the departures that conflict with a leg, sorted.

    Returns the number of intervals.
    """
    count = 0
    for e in range(near.first[i], near.first[i + 1]):
        leg = near.legs[near.number[e]]
        if leg[END] < move.now or leg[BEGIN] > move.latest + move.lasts:
            continue
        lo, hi = conflict(leg, x, y, ux, uy, move.lasts)
        if lo <= hi and hi > move.now and lo < move.latest:
            count = insert(lows, highs, count, lo, hi)
    return count


@inline
def relax(
    tree: Tree,
    intervals: Intervals,
    state: int,
    to: int,
    move: Move,
    lows: Array,
    highs: Array,
    count: int,
    heap: Array,
    size: int,
) -> tuple[Array, int]:
    """Reach the safe intervals of cell `to` from a state between conflicts; returns the open list and its size.

    Between two conflicts the robot can leave at any instant; all these departures reach one interval of the next
    cell.
    """
    leave, n = move.now, 0
    interval, last = intervals.first[to], intervals.first[to + 1]
    while leave <= move.latest:
        while n < count and lows[n] <= leave + INSTANT:
            leave = max(leave, highs[n])
            n += 1
        if leave > move.latest:
            break
        arrive = leave + move.lasts
        while interval < last and intervals.until[interval] < arrive - INSTANT:
            interval += 1
        reaches = interval * move.headings + move.offset
        if interval < last and intervals.since[interval] <= arrive + INSTANT and arrive < tree.reached[reaches]:
            tree.reached[reaches], tree.parent[reaches], tree.left[reaches] = arrive, state, leave
            heap = push(heap, size, arrive + move.rest, arrive, reaches)
            size += 1
        if n == count:
            break
        leave = highs[n]
        n += 1
    return heap, size


@inline
def fewest_turns(heading: int, rows: int, cols: int) -> int:
    """Return the least number of turns by 45° from a heading to a goal some rows and columns away, on open ground."""
    if rows == 0 and cols == 0:
        return 0
    straight = (0 if cols > 0 else 4) if abs(cols) > abs(rows) else (2 if rows > 0 else 6)
    diagonal = (1 if cols > 0 else 3) if rows > 0 else (7 if cols > 0 else 5)
    one, two = abs((straight - heading + 4) % 8 - 4), abs((diagonal - heading + 4) % 8 - 4)
    if abs(rows) == abs(cols):
        return two
    return one if rows == 0 or cols == 0 else min(one, two) + 1


@inline
def least_time(heading: int, rows: int, cols: int, trip: Trip, pace: float, headings: int) -> float:
    """Return the time to a goal some rows and columns away, on open ground; `pace` is the time of a straight move [s]."""
    time = pace * octile(rows, cols)
    return time + trip.turn * fewest_turns(heading, rows, cols) if headings > 1 else time


@kernel
def traced(tree: Tree, cell_of: Array, cols: int, headings: int, found: int) -> tuple[Array, Array, Array]:
    """Return the cells (N, 2) from the root to state `found`, with their arrival and departure times.

    Turns happen between arrival and departure. All are empty if `found` is -1.
    """
    length = 0
    state, here = found, -1
    while state >= 0:
        if cell_of[state // headings] != here:
            here = cell_of[state // headings]
            length += 1
        state = tree.parent[state]
    cells, arrive, leave = np.empty((length, 2), dtype=np.int32), np.empty(length), np.empty(length)
    state, here, n = found, -1, length
    left = tree.reached[found] if found >= 0 else 0.0
    while state >= 0:
        if cell_of[state // headings] != here:
            here = cell_of[state // headings]
            n -= 1
            cells[n, 0], cells[n, 1] = here // cols, here % cols
            leave[n] = left
        arrive[n] = tree.reached[state]
        left = tree.left[state]
        state = tree.parent[state]
    return cells, arrive, leave


@kernel
def earliest(
    graph: MoveGraph, joints: Array, ready: Array, frame: Frame, near: NearLegs, intervals: Intervals, trip: Trip
) -> tuple[Array, Array, Array, int]:
    """Return the earliest-arrival path: cells, arrival and departure times, and the number of expanded states.

    Phillips and Likhachev's A* over the safe intervals of cells, with the heading where the grid has turns. Of all paths
    into a state only the earliest counts, as the robot can wait there. The path is empty if none arrives by `trip.end`.

    `joints` are those of `Turns`. `ready` has the time from departure until the robot is ready to move ahead from the start
    cell, at each of eight headings (8,), inf at others; (1,) without turns.
    """
    cols, headings = graph.cols, len(ready)
    goal_row, goal_col = trip.goal // cols, trip.goal % cols
    pace = frame.cell / trip.speed
    states = headings * len(intervals.since)
    tree = Tree(np.full(states, np.inf), np.full(states, -1, dtype=np.int64), np.empty(states))
    closed = np.zeros(states, dtype=np.bool_)
    cell_of = np.empty(len(intervals.since), dtype=np.int64)
    for i in range(len(intervals.first) - 1):
        for k in range(intervals.first[i], intervals.first[i + 1]):
            cell_of[k] = i
    most = most_legs(near)
    lows, highs = np.empty(most), np.empty(most)
    heap = np.empty((1024, 3))
    size, expanded, found = 0, 0, -1
    for k in range(intervals.first[trip.start], intervals.first[trip.start + 1]):
        if intervals.since[k] <= trip.departure <= intervals.until[k]:
            for h in range(headings):
                now = trip.departure + ready[h]
                if now <= intervals.until[k]:
                    rows, away = goal_row - trip.start // cols, goal_col - trip.start % cols
                    tree.reached[k * headings + h] = now
                    heap = push(
                        heap, size, now + least_time(h, rows, away, trip, pace, headings), now, k * headings + h
                    )
                    size += 1
            break
    while size > 0:
        state, now = int(heap[0, STATE]), heap[0, G]
        size = drop_first(heap, size)
        if closed[state]:
            continue
        closed[state] = True
        here, heading = state // headings, state % headings
        i = cell_of[here]
        if i == trip.goal and (not trip.stay or intervals.until[here] >= trip.end):
            found = state
            break
        expanded += 1
        r, c = i // cols, i % cols
        x, y = frame.x0 + c * frame.cell, frame.y0 + r * frame.cell
        able = graph.mask[graph.label[i, heading]] & (1 << heading) if headings > 1 else graph.mask[i]
        for k in range(8):
            if not able & (1 << k):
                continue
            rn, cn = r + DROW[k], c + DCOL[k]
            lasts = pace * (SQRT2 if k & 1 else 1.0)
            latest = min(intervals.until[here], trip.end - lasts)
            if now > latest:
                continue
            rest = least_time(k, goal_row - rn, goal_col - cn, trip, pace, headings)
            move = Move(now, latest, lasts, rest, headings, heading)
            along = trip.speed / SQRT2 if k & 1 else trip.speed
            count = conflicts(near, i, x, y, DCOL[k] * along, DROW[k] * along, move, lows, highs)
            heap, size = relax(tree, intervals, state, rn * cols + cn, move, lows, highs, count, heap, size)
        for side in range(-1, 2, 2):
            if headings == 1 or not joints[i] & (1 << (heading + (side - 1) // 2) % 8):
                continue
            after = (heading + side) % 8
            arrive, reaches = now + trip.turn, here * headings + after
            if arrive <= intervals.until[here] and arrive < tree.reached[reaches]:
                tree.reached[reaches], tree.parent[reaches], tree.left[reaches] = arrive, state, now
                rest = least_time(after, goal_row - r, goal_col - c, trip, pace, headings)
                heap = push(heap, size, arrive + rest, arrive, reaches)
                size += 1
    cells, arrive_at, leave_at = traced(tree, cell_of, cols, headings, found)
    return cells, arrive_at, leave_at, expanded
