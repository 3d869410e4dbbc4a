"""Compiled search for the shortest path among discs: arrays in, arrays out, nothing validated.

A shortest path consists of straight lines and of arcs of the discs that it bends around. A turn to the left
around a disc is `1`, to the right `-1`; a line that leaves a disc in direction `a` leaves it at the angle
`a - turn * pi / 2`. Angles lie in [0, 2 pi).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.worlds._kernels import Array, doubled, doubled_rows, inline, kernel, segment_distance2

EPS = 5e-10  # m: a gap no wider than this is closed; a line may lie this much deeper than the clearance
TURN = 2.0 * math.pi
ANGLE = 1e-9  # rad: how close to the end of a free arc counts as beyond it
BACK = 1e-7  # rad: an arc that would go backwards by less than this is rounding and has no length
SAME = 1e-12  # m: lengths that differ by less are equal


@inline
def wrapped(angle: float) -> float:
    """The angle within [0, 2 pi)."""
    angle = angle % TURN
    return angle if angle < TURN else 0.0


@kernel
def keep_outer(discs: Array, bounds: Array) -> Array:
    """Which discs (N, 3) have a rim that is not wholly within another disc or outside the bounds."""
    n = discs.shape[0]
    keep = np.ones(n, dtype=np.bool_)
    for i in range(n):
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        if x + r <= bounds[0] or x - r >= bounds[2] or y + r <= bounds[1] or y - r >= bounds[3]:
            keep[i] = False
            continue
        for j in range(n):
            if j == i or not keep[j]:
                continue
            room = discs[j, 2] - r
            if room < -EPS:
                continue
            if math.hypot(x - discs[j, 0], y - discs[j, 1]) <= room + EPS:
                # Of two that hold each other the first stays; one outside the bounds is dropped for that alone.
                if room <= EPS and j > i:
                    continue
                keep[i] = False
                break
    return keep


@kernel
def free_arcs(discs: Array, bounds: Array) -> tuple[Array, Array, Array]:
    """The parts of each rim that no other disc and no wall covers.

    Disc i has the arcs first[i] to first[i + 1]; each begins at an angle and has a width, 2 pi where the whole
    rim is free. Contact ends an arc.
    """
    n = discs.shape[0]
    first = np.zeros(n + 1, dtype=np.int64)
    begin = np.empty(4 * n + 16, dtype=np.float64)
    width = np.empty(4 * n + 16, dtype=np.float64)
    low = np.empty(2 * (n + 5), dtype=np.float64)
    high = np.empty(2 * (n + 5), dtype=np.float64)
    order = np.empty(2 * (n + 5), dtype=np.int64)
    size = 0
    for i in range(n):
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        m = 0
        gone = False
        for j in range(n + 4):
            if j < n:  # another disc
                if j == i:
                    continue
                dx, dy, s = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2]
                d2 = dx * dx + dy * dy
                if d2 > (r + s + EPS) * (r + s + EPS):
                    continue
                d = math.sqrt(d2)
                middle = math.atan2(dy, dx)
                cosine = (r * r + d2 - s * s) / (2.0 * r * d) if d > 0.0 else 2.0
            else:  # a wall: right, upper, left, lower
                k = j - n
                if k == 0:
                    d = bounds[2] - x
                elif k == 1:
                    d = bounds[3] - y
                elif k == 2:
                    d = x - bounds[0]
                else:
                    d = y - bounds[1]
                if d > r + EPS:
                    continue
                middle = 0.5 * math.pi * k
                cosine = d / r
            if cosine <= -1.0:
                gone = True
                break
            half = math.acos(min(1.0, cosine))
            a = wrapped(middle - half)
            b = a + 2.0 * half
            low[m], high[m] = a, min(b, TURN)
            m += 1
            if b > TURN:
                low[m], high[m] = 0.0, b - TURN
                m += 1
        first[i] = size
        if gone:
            continue
        while size + m + 1 > len(begin):
            begin, width = doubled(begin), doubled(width)
        if m == 0:
            begin[size], width[size] = 0.0, TURN
            size += 1
            continue
        for q in range(m):  # in order, by insertion: there are few
            at = q
            while at > 0 and low[order[at - 1]] > low[q]:
                order[at] = order[at - 1]
                at -= 1
            order[at] = q
        # The gap that runs through the angle 0 comes last.
        reach = high[order[0]]
        for q in range(1, m):
            p = order[q]
            if low[p] > reach + 2.0 * ANGLE:
                begin[size], width[size] = reach, low[p] - reach
                size += 1
            reach = max(reach, high[p])
        rest = min(low[order[0]] + TURN - reach, TURN - ANGLE)  # less than a full rim: one contact cuts it
        if rest > 2.0 * ANGLE:
            begin[size], width[size] = wrapped(reach), rest
            size += 1
    first[n] = size
    return first, begin[:size], width[:size]


@inline
def arc_at(first: Array, begin: Array, width: Array, i: int, angle: float) -> int:
    """The free arc of disc i that an angle lies on, -1 if none."""
    found = -1
    for a in range(first[i], first[i + 1]):
        if width[a] >= TURN:
            found = a
        else:
            past = (angle - begin[a]) % TURN
            if past > ANGLE and past < width[a] - ANGLE:
                found = a
    return found


@kernel
def gates(discs: Array, bounds: Array) -> Array:
    """Where two discs, or a disc and a wall, just touch: segments (G, 4) that no path crosses."""
    n = discs.shape[0]
    out = np.empty((16, 4), dtype=np.float64)
    size = 0
    for i in range(n):
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        for j in range(i + 1, n + 4):
            if j < n:
                bx, by = discs[j, 0], discs[j, 1]
                gap = abs(bx - x) + abs(by - y)
                if gap < r + discs[j, 2] - 4.0 * EPS or gap > 1.5 * (r + discs[j, 2]) + 1e-6:
                    continue
                gap = math.hypot(bx - x, by - y) - r - discs[j, 2]
            else:
                k = j - n
                bx, by = x, y
                if k == 0:
                    bx = bounds[2] + 1.0
                    gap = bounds[2] - x - r
                elif k == 1:
                    by = bounds[3] + 1.0
                    gap = bounds[3] - y - r
                elif k == 2:
                    bx = bounds[0] - 1.0
                    gap = x - bounds[0] - r
                else:
                    by = bounds[1] - 1.0
                    gap = y - bounds[1] - r
            if abs(gap) > 4.0 * EPS:
                continue
            if size == len(out):
                out = doubled_rows(out)
            out[size, 0], out[size, 1], out[size, 2], out[size, 3] = x, y, bx, by
            size += 1
    return out[:size]


@inline
def side(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    """Positive where p lies to the left of the line from a to b."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@kernel
def bins(discs: Array, bounds: Array) -> tuple[Array, Array, Array, float]:
    """Square bins over the bounds: where each one's discs begin in a list, that list, (rows, columns), the side."""
    n = discs.shape[0]
    wide, tall = bounds[2] - bounds[0], bounds[3] - bounds[1]
    cell = max(math.sqrt(wide * tall / max(n, 1)), max(wide, tall) / 200.0, 1e-9)
    shape = np.empty(2, dtype=np.int64)
    rows, cols = int(tall / cell) + 1, int(wide / cell) + 1
    shape[0], shape[1] = rows, cols
    start = np.zeros(rows * cols + 1, dtype=np.int64)
    items = np.empty(0, dtype=np.int32)
    for write in range(2):  # count, then fill
        if write:
            for b in range(rows * cols):
                start[b + 1] += start[b]
            items = np.empty(start[rows * cols], dtype=np.int32)
            at = start[: rows * cols].copy()
        for j in range(n):
            x, y, r = discs[j, 0] - bounds[0], discs[j, 1] - bounds[1], discs[j, 2] + 1e-6 * cell
            r_lo, r_hi = max(0, math.floor((y - r) / cell)), min(rows - 1, math.floor((y + r) / cell))
            c_lo, c_hi = max(0, math.floor((x - r) / cell)), min(cols - 1, math.floor((x + r) / cell))
            for row in range(r_lo, r_hi + 1):
                dy = max(row * cell - y, y - (row + 1) * cell, 0.0)
                for col in range(c_lo, c_hi + 1):
                    dx = max(col * cell - x, x - (col + 1) * cell, 0.0)
                    if dx * dx + dy * dy > r * r:
                        continue
                    if write:
                        items[at[row * cols + col]] = j
                        at[row * cols + col] += 1
                    else:
                        start[row * cols + col + 1] += 1
    return start, items, shape, cell


@kernel
def visible(
    ax: float,
    ay: float,
    bx: float,
    by: float,
    i: int,
    j: int,
    discs: Array,
    bounds: Array,
    start: Array,
    items: Array,
    shape: Array,
    cell: float,
    gate: Array,
) -> bool:
    """Whether the segment ab enters no disc but i and j, to which it is tangent, and passes no gate."""
    rows, cols = shape[0], shape[1]
    px, py = (ax - bounds[0]) / cell, (ay - bounds[1]) / cell
    qx, qy = (bx - bounds[0]) / cell, (by - bounds[1]) / cell
    col = min(max(math.floor(px), 0), cols - 1)
    row = min(max(math.floor(py), 0), rows - 1)
    last_col = min(max(math.floor(qx), 0), cols - 1)
    last_row = min(max(math.floor(qy), 0), rows - 1)
    dx, dy = qx - px, qy - py
    step_col, step_row = 1 if dx > 0.0 else -1, 1 if dy > 0.0 else -1
    # Along the segment, from 0 to 1: where the next column and the next row begin, and how far they lie apart.
    next_x = ((col + (1 if dx > 0.0 else 0)) - px) / dx if dx != 0.0 else np.inf
    next_y = ((row + (1 if dy > 0.0 else 0)) - py) / dy if dy != 0.0 else np.inf
    per_x = abs(1.0 / dx) if dx != 0.0 else np.inf
    per_y = abs(1.0 / dy) if dy != 0.0 else np.inf
    todo = abs(last_col - col) + abs(last_row - row)
    while True:
        b = row * cols + col
        for q in range(start[b], start[b + 1]):
            k = items[q]
            if k in (i, j):
                continue
            r = discs[k, 2] - EPS
            if r > 0.0 and segment_distance2(discs[k, 0], discs[k, 1], ax, ay, bx, by) < r * r:
                return False
        if todo == 0:
            break
        todo -= 1
        if (next_x < next_y and col != last_col) or row == last_row:
            col += step_col
            next_x += per_x
        else:
            row += step_row
            next_y += per_y
    for g in range(gate.shape[0]):
        gx, gy, hx, hy = gate[g, 0], gate[g, 1], gate[g, 2], gate[g, 3]
        apart = side(gx, gy, hx, hy, ax, ay) * side(gx, gy, hx, hy, bx, by) < 0.0
        if apart and side(ax, ay, bx, by, gx, gy) * side(ax, ay, bx, by, hx, hy) <= 0.0:
            return False
    return True


@kernel
def push(heap_f: Array, heap_e: Array, size: int, f: float, e: int) -> tuple[Array, Array, int]:
    """Add an entry to a binary heap."""
    if size == len(heap_f):
        heap_f = doubled(heap_f)
        heap_e = doubled(heap_e)
    at = size
    while at > 0:
        up = (at - 1) >> 1
        if heap_f[up] <= f:
            break
        heap_f[at], heap_e[at] = heap_f[up], heap_e[up]
        at = up
    heap_f[at], heap_e[at] = f, e
    return heap_f, heap_e, size + 1


@kernel
def drop_first(heap_f: Array, heap_e: Array, size: int) -> int:
    """Take the first entry off a binary heap; its new size."""
    size -= 1
    f, e = heap_f[size], heap_e[size]
    at = 0
    while True:
        down = 2 * at + 1
        if down >= size:
            break
        if down + 1 < size and heap_f[down + 1] < heap_f[down]:
            down += 1
        if heap_f[down] >= f:
            break
        heap_f[at], heap_e[at] = heap_f[down], heap_e[down]
        at = down
    heap_f[at], heap_e[at] = f, e
    return size


@kernel
def shortest_path(discs: Array, bounds: Array, ends: Array) -> tuple[Array, float, int]:
    """The shortest way from point ends[0] to ends[1]: its lines (L, 6), its length, the lines looked at.

    `discs` are inflated, `bounds` shrunken; none of the discs lies within another (`keep_outer`). A line is
    x, y where it starts, x, y where it stops, and the disc and the turn (1 left, -1 right) that it stops at;
    the disc is -1 at the goal. No lines: there is no way.

    A* over the tangents between discs. A disc's tangents are found when the search first comes to it, sorted
    by nothing: each arrival looks at all that leave the same free arc ahead of it. An arrival is passed over
    when an earlier one reaches the same spot along the rim as cheaply.
    """
    n = discs.shape[0]
    first, begin, width = free_arcs(discs, bounds)
    gate = gates(discs, bounds)
    start, items, shape, cell = bins(discs, bounds)
    gx, gy = ends[1, 0], ends[1, 1]

    # Lines: leaving angle and arc on the disc they come from, arriving angle and arc on the one they reach.
    room = 256
    num = np.empty((room, 7), dtype=np.float64)  # leaving angle, arriving angle, length, x, y, x, y
    ref = np.empty((room, 5), dtype=np.int64)  # leaving arc, disc reached, turn there, arc there, line before
    best = np.empty(room, dtype=np.float64)
    lines = 0
    span = np.full((2 * n + 1, 2), -1, dtype=np.int64)  # by disc and turn, the start last: lines that leave
    heap_f, heap_e = np.empty(256, dtype=np.float64), np.empty(256, dtype=np.int64)
    waiting: Any = np.int64(0)  # a plain 0 would be compiled for as a type of its own
    # Arrivals that were followed, as linked lists by arc and turn.
    arrived = np.full(2 * len(begin), -1, dtype=np.int64)
    earlier = np.full(room, -1, dtype=np.int64)
    done = np.zeros(room, dtype=np.bool_)

    line, g = -1, 0.0
    looked = 0
    while True:
        # Where the search stands: at the start, or on disc i after line `line`, turning by s.
        if line < 0:
            i, s, x, y, r, source = -1, 1, ends[0, 0], ends[0, 1], 0.0, 2 * n
        else:
            i, s = ref[line, 1], ref[line, 2]
            x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
            source = 2 * i + (1 if s > 0 else 0)
        if span[source, 0] < 0:
            span[source, 0] = lines
            for j in range(-1, n):
                if j == i and j >= 0:
                    continue
                for turn in range(2 if j >= 0 else 1):
                    t = 2 * turn - 1
                    if j < 0:
                        dx, dy, q = gx - x, gy - y, 0.0
                    else:
                        dx, dy, q = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2]
                    d = math.hypot(dx, dy)
                    across = t * q - s * r
                    if abs(across) > d + 4.0 * EPS:
                        continue
                    sine = min(1.0, max(-1.0, across / d)) if d > 0.0 else 0.0
                    heading = math.atan2(dy, dx) - math.asin(sine)
                    leave = wrapped(heading - s * 0.5 * math.pi)
                    reach = wrapped(heading - t * 0.5 * math.pi)
                    arc0, arc1 = -1, -1
                    ax, ay, bx, by = x, y, gx, gy
                    if i >= 0:
                        arc0 = arc_at(first, begin, width, i, leave)
                        if arc0 < 0:
                            continue
                        ax, ay = x + r * math.cos(leave), y + r * math.sin(leave)
                    if j >= 0:
                        arc1 = arc_at(first, begin, width, j, reach)
                        if arc1 < 0:
                            continue
                        bx, by = discs[j, 0] + q * math.cos(reach), discs[j, 1] + q * math.sin(reach)
                    looked += 1
                    if not visible(ax, ay, bx, by, i, j, discs, bounds, start, items, shape, cell, gate):
                        continue
                    if lines == room:
                        num = doubled_rows(num)
                        ref = doubled_rows(ref)
                        best = doubled(best)
                        earlier = doubled(earlier)
                        done = doubled(done)
                        done[room:] = False
                        room *= 2
                    num[lines, 0], num[lines, 1] = leave, reach
                    num[lines, 2] = math.sqrt(max(0.0, d * d - across * across))
                    num[lines, 3], num[lines, 4], num[lines, 5], num[lines, 6] = ax, ay, bx, by
                    ref[lines, 0], ref[lines, 1], ref[lines, 2] = arc0, j, t
                    ref[lines, 3], ref[lines, 4] = arc1, -1
                    best[lines] = np.inf
                    lines += 1
            span[source, 1] = lines
        for e in range(span[source, 0], span[source, 1]):
            if done[e]:
                continue
            ahead = 0.0
            if line >= 0:
                arc = ref[line, 3]
                if ref[e, 0] != arc:
                    continue
                ahead = (s * (num[e, 0] - num[line, 1])) % TURN
                if ahead > TURN - BACK:
                    ahead = 0.0
                if width[arc] < TURN:  # the way round must not leave the arc
                    past = (num[line, 1] - begin[arc]) % TURN
                    if ahead > (width[arc] - past if s > 0 else past):
                        continue
            g_new = g + r * ahead + num[e, 2]
            if g_new < best[e] - SAME:
                best[e] = g_new
                ref[e, 4] = line
                f = g_new + math.hypot(gx - num[e, 5], gy - num[e, 6])
                heap_f, heap_e, waiting = push(heap_f, heap_e, waiting, f, e)
        # On to the most promising arrival.
        line = -1
        while waiting > 0:
            e = heap_e[0]
            waiting = drop_first(heap_f, heap_e, waiting)
            if done[e]:
                continue
            done[e] = True
            g = best[e]
            if ref[e, 1] < 0:
                line = e
                break
            arc, j = ref[e, 3], ref[e, 1]
            slot = 2 * arc + (1 if ref[e, 2] > 0 else 0)
            other = arrived[slot]
            beaten = False
            while other >= 0 and not beaten:
                ahead = (ref[e, 2] * (num[e, 1] - num[other, 1])) % TURN
                if ahead > TURN - BACK:
                    ahead = 0.0
                within = True
                if width[arc] < TURN:
                    past = (num[other, 1] - begin[arc]) % TURN
                    within = ahead <= (width[arc] - past if ref[e, 2] > 0 else past)
                beaten = within and best[other] + discs[j, 2] * ahead <= g + SAME
                other = earlier[other]
            if beaten:
                continue
            earlier[e] = arrived[slot]
            arrived[slot] = e
            line = e
            break
        if line < 0:
            return np.empty((0, 6), dtype=np.float64), np.inf, looked
        if ref[line, 1] < 0:
            break
    count = 0
    e = line
    while e >= 0:
        count += 1
        e = ref[e, 4]
    way = np.empty((count, 6), dtype=np.float64)
    e = line
    for k in range(count - 1, -1, -1):
        for q in range(4):
            way[k, q] = num[e, 3 + q]
        way[k, 4], way[k, 5] = ref[e, 1], ref[e, 2]
        e = ref[e, 4]
    return way, g, looked
