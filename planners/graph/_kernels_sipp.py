"""Compiled safe-interval path planning: arrays in, arrays out, nothing validated.

A mover comes as legs: rows of `legs` (L, 7) hold t0, t1, x and y at t0, vx, vy, and the distance that the robot's centre has
to keep from it. Times are in seconds, places in metres. While a robot waits or makes one move and a mover is on one leg, both
move in straight lines at constant speed; then the instants of conflict are an interval with ends in closed form, so nothing
here is sampled.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, SQRT2, Array, inline, kernel, segment_distance2

INSTANT = 1e-9  # s: shorter gaps are none


@kernel
def legs_within(t: Array, xy: Array, jump: Array, tolerance: float) -> tuple[Array, Array, int]:
    """First and last sample of each straight leg at constant speed that samples can be told by, and how many.

    Samples `xy` (T, 2) at `t` (T,) lie no farther than `tolerance` from the leg over them. No leg spans the jump between two
    samples, from i to i + 1 where jump[i].
    """
    first, last = np.empty(len(t), dtype=np.int64), np.empty(len(t), dtype=np.int64)
    count, a = 0, 0
    while a < len(t) - 1:
        if jump[a]:
            a += 1
            continue
        # The velocities that keep every sample so far within the tolerance, as a box about each coordinate.
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
def near_legs(legs: Array, free: Array, x0: float, y0: float, cell: float) -> tuple[Array, Array]:
    """By free cell, the legs that may come too close to a robot that stands there or makes a move from there.

    Those of cell i are listed[begin[i] : begin[i + 1]], in the order of `legs`.
    """
    rows, cols = free.shape
    begin = np.zeros(rows * cols + 1, dtype=np.int64)
    listed = np.empty(0, dtype=np.int32)
    fill = np.empty(0, dtype=np.int64)
    for filling in range(2):  # first counted, then listed
        for n in range(len(legs)):
            span = legs[n, 1] - legs[n, 0]
            ax, ay = legs[n, 2], legs[n, 3]
            dx, dy = legs[n, 4] * span, legs[n, 5] * span
            reach = legs[n, 6] + SQRT2 * cell
            r_lo = max(0, int(math.ceil((min(ay, ay + dy) - reach - y0) / cell)))
            r_hi = min(rows - 1, int(math.floor((max(ay, ay + dy) + reach - y0) / cell)))
            for r in range(r_lo, r_hi + 1):
                y = y0 + r * cell
                lo, hi = 0.0, 1.0  # the part of the leg no farther from this row than the reach
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
                        listed[fill[i]] = n
                        fill[i] += 1
                    else:
                        begin[i + 1] += 1
        if not filling:
            begin = np.cumsum(begin)
            listed = np.empty(begin[-1], dtype=np.int32)
            fill = begin.copy()
    return begin, listed


@inline
def within(qx: float, qy: float, vx: float, vy: float, reach: float, span: float) -> tuple[float, float]:
    """The part of [0, span] in which |q + v s| < reach, as (lo, hi); lo > hi where there is none."""
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
    """The departures, as (lo, hi), of which a move from (x, y) at velocity u over `lasts` comes too close to a leg.

    With w the time since the leg began and s the time since the departure, it is too close where
    |q + v w - u s| < reach: a convex region, cut by the rectangle 0 <= w <= span, 0 <= s <= lasts. Departures w - s
    take their extremes on the rectangle's sides or where the region's rim runs along them. lo > hi where there are none.
    """
    span, reach = leg[1] - leg[0], leg[6]
    qx, qy, vx, vy = leg[2] - x, leg[3] - y, leg[4], leg[5]
    lo, hi = np.inf, -np.inf
    for side in range(2):  # the robot where its move begins, or ends
        s = side * lasts
        one, two = within(qx - ux * s, qy - uy * s, vx, vy, reach, span)
        if one <= two:
            lo, hi = min(lo, one - s), max(hi, two - s)
    for side in range(2):  # the mover where its leg begins, or ends
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
    return leg[0] + lo, leg[0] + hi


@inline
def insert(lows: Array, highs: Array, count: int, lo: float, hi: float) -> int:
    """Put an interval among others sorted by their lower ends; how many then."""
    n = count
    while n > 0 and lows[n - 1] > lo:
        lows[n], highs[n] = lows[n - 1], highs[n - 1]
        n -= 1
    lows[n], highs[n] = lo, hi
    return count + 1


@kernel
def safe_intervals(
    legs: Array, begin: Array, listed: Array, free: Array, x0: float, y0: float, cell: float, start: float, end: float
) -> tuple[Array, Array, Array]:
    """When a robot can stand in each free cell: from since[k] to until[k], for k of cell i from own[i] to own[i + 1]."""
    rows, cols = free.shape
    most = 0
    for i in range(rows * cols):
        most = max(most, begin[i + 1] - begin[i])
    room = rows * cols + len(listed)
    own = np.empty(rows * cols + 1, dtype=np.int64)
    since, until = np.empty(room), np.empty(room)
    lows, highs = np.empty(most), np.empty(most)
    size = 0
    for i in range(rows * cols):
        own[i] = size
        r, c = i // cols, i % cols
        if not free[r, c]:
            continue
        count = 0
        for e in range(begin[i], begin[i + 1]):
            leg = legs[listed[e]]
            lo, hi = within(leg[2] - x0 - c * cell, leg[3] - y0 - r * cell, leg[4], leg[5], leg[6], leg[1] - leg[0])
            if lo <= hi:
                count = insert(lows, highs, count, leg[0] + lo, leg[0] + hi)
        t = start
        for n in range(count):
            if lows[n] > t + INSTANT:
                since[size], until[size] = t, lows[n]
                size += 1
            t = max(t, highs[n])
        if t < end:
            since[size], until[size] = t, end
            size += 1
    own[rows * cols] = size
    return own, since[:size].copy(), until[:size].copy()


@inline
def sooner(f: Array, g: Array, a: int, b: int) -> bool:
    """Whether heap entry a comes before b: by f, then the farther along."""
    return bool(f[a] < f[b] or (f[a] == f[b] and g[a] > g[b]))


@inline
def swap(f: Array, g: Array, state: Array, a: int, b: int) -> None:
    """Exchange two heap entries."""
    f[a], f[b] = f[b], f[a]
    g[a], g[b] = g[b], g[a]
    state[a], state[b] = state[b], state[a]


@kernel
def earliest(
    moves: Array,
    start: int,
    goal: int,
    x0: float,
    y0: float,
    cell: float,
    speed: float,
    end: float,
    stay: bool,
    legs: Array,
    begin: Array,
    listed: Array,
    own: Array,
    since: Array,
    until: Array,
    departed: float,
) -> tuple[Array, Array, Array, int]:
    """The way that arrives first: its cells, when each is reached and left, and the states expanded.

    Phillips and Likhachev's A* over pairs of a cell and one of its safe intervals; of all ways into a pair the first to
    arrive is as good as any, since it can wait. Empty where no way arrives by `end`. With `stay` the goal must be safe
    from the arrival to `end`.
    """
    rows, cols = moves.shape
    mask = moves.ravel()
    r1, c1 = goal // cols, goal % cols
    pace = cell / speed
    reached = np.full(len(since), np.inf)
    closed = np.zeros(len(since), dtype=np.bool_)
    parent = np.full(len(since), -1, dtype=np.int64)
    left = np.empty(len(since))  # when the parent's cell was left
    place = np.empty(len(since), dtype=np.int64)
    f, g, heap = np.empty(1024), np.empty(1024), np.empty(1024, dtype=np.int64)
    most = 0
    for i in range(rows * cols):
        for k in range(own[i], own[i + 1]):
            place[k] = i
        most = max(most, begin[i + 1] - begin[i])
    lows, highs = np.empty(most), np.empty(most)
    size, expanded, found = 0, 0, -1
    for k in range(own[start], own[start + 1]):
        if since[k] <= departed <= until[k]:
            reached[k] = departed
            f[0], g[0], heap[0] = departed, departed, k
            size = 1
            break
    while size > 0:
        state, now = heap[0], g[0]
        size -= 1
        f[0], g[0], heap[0] = f[size], g[size], heap[size]
        n = 0
        while True:
            child = 2 * n + 1
            if child >= size:
                break
            if child + 1 < size and sooner(f, g, child + 1, child):
                child += 1
            if not sooner(f, g, child, n):
                break
            swap(f, g, heap, child, n)
            n = child
        if closed[state]:
            continue
        closed[state] = True
        i = place[state]
        if i == goal and (not stay or until[state] >= end):
            found = state
            break
        expanded += 1
        r, c = i // cols, i % cols
        x, y = x0 + c * cell, y0 + r * cell
        for k in range(8):
            if not mask[i] & (1 << k):
                continue
            rn, cn = r + DROW[k], c + DCOL[k]
            j = rn * cols + cn
            lasts = pace * (SQRT2 if k & 1 else 1.0)
            latest = min(until[state], end - lasts)
            if now > latest:
                continue
            along = speed / SQRT2 if k & 1 else speed
            count = 0
            for e in range(begin[i], begin[i + 1]):
                leg = legs[listed[e]]
                if leg[1] < now or leg[0] > latest + lasts:
                    continue
                lo, hi = conflict(leg, x, y, DCOL[k] * along, DROW[k] * along, lasts)
                if lo <= hi and hi > now and lo < latest:
                    count = insert(lows, highs, count, lo, hi)
            # Between conflicts the robot can leave at any instant, and all of these reach one interval of the next cell.
            leave, n = now, 0
            interval = own[j]
            ahead = max(abs(r1 - rn), abs(c1 - cn)) + (SQRT2 - 1.0) * min(abs(r1 - rn), abs(c1 - cn))
            while leave <= latest:
                while n < count and lows[n] <= leave + INSTANT:
                    leave = max(leave, highs[n])
                    n += 1
                if leave > latest:
                    break
                arrive = leave + lasts
                while interval < own[j + 1] and until[interval] < arrive - INSTANT:
                    interval += 1
                if interval < own[j + 1] and since[interval] <= arrive + INSTANT and arrive < reached[interval]:
                    reached[interval], parent[interval], left[interval] = arrive, state, leave
                    if size == len(heap):
                        f, g = np.concatenate((f, np.empty_like(f))), np.concatenate((g, np.empty_like(g)))
                        heap = np.concatenate((heap, np.empty_like(heap)))
                    f[size], g[size], heap[size] = arrive + pace * ahead, arrive, interval
                    m = size
                    size += 1
                    while m > 0 and sooner(f, g, m, (m - 1) >> 1):
                        swap(f, g, heap, m, (m - 1) >> 1)
                        m = (m - 1) >> 1
                if n == count:
                    break
                leave = highs[n]
                n += 1
    length = 0
    state = found
    while state >= 0:
        length += 1
        state = parent[state]
    cells, arrive_at, leave_at = np.empty((length, 2), dtype=np.int32), np.empty(length), np.empty(length)
    state = found
    leave = reached[found] if found >= 0 else 0.0
    for n in range(length - 1, -1, -1):
        cells[n, 0], cells[n, 1] = place[state] // cols, place[state] % cols
        arrive_at[n], leave_at[n] = reached[state], leave
        leave = left[state]
        state = parent[state]
    return cells, arrive_at, leave_at, expanded
