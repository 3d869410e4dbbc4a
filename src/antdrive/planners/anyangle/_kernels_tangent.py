"""Compiled search for the shortest path among discs: arrays in, arrays out, no validation.

A shortest path consists of straight lines and of arcs along the rims of discs. A left turn around a disc is
`1`, a right turn `-1`. A line in direction `a` touches a disc at the angle `a - turn * pi / 2` about the disc's
centre. Angles lie in [0, 2 pi).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.planners.graph._kernels_heap import STATE, drop_first, push
from antdrive.worlds._kernels import (
    Array,
    count_below,
    doubled,
    doubled_rows,
    inline,
    kernel,
    order_by,
    segment_distance2,
)

EPS = 5e-10  # m: gaps up to this are closed; a line may enter a disc by this much
TURN = 2.0 * math.pi
ANGLE = 1e-9  # rad: an angle this close to the end of a free arc is off the arc
BACK = 1e-7  # rad: smaller backward motion along a rim is rounding and has length 0
SECTORS = 512  # direction sectors, each with the last blocking disc
JOIN = 32  # covered angles that gather before they are joined
SAME = 1e-12  # m: tolerance of equal lengths
LEAVE, REACH, LENGTH, BEST, ENDS = range(5)  # columns of `Lines.values`
FROM_ARC, DISC, SENSE, ARC, BEFORE, DONE, EARLIER = range(7)  # columns of `Lines.marks`


class Rims(NamedTuple):
    """The free arcs of all rims: the parts not covered by other discs or walls.

    Attributes:
        first: disc i has the arcs first[i] to first[i + 1] (N + 1,)
        begin: the start angle of each arc (A,)
        width: the angular width of each arc, 2 pi if the whole rim is free (A,)
        ends: cosine and sine of the start angle and of the end angle of each arc (A, 4)
    """

    first: Array
    begin: Array
    width: Array
    ends: Array


class Sweep(NamedTuple):
    """The discs sorted by x, so that the discs near a place form a slice.

    Attributes:
        order: the discs sorted by x (N,)
        x: the x of each, ascending [m] (N,)
        widest: the largest radius [m]
    """

    order: Array
    x: Array
    widest: float


class Bins(NamedTuple):
    """Square bins over the bounds, row by row, each with a list of the discs in it.

    Attributes:
        start: index in `items` of each bin's first disc (rows * columns + 1,)
        items: the discs of all bins
        shape: rows and columns (2,)
        side: the side of a bin [m]
    """

    start: Array
    items: Array
    shape: Array
    side: float


class Obstacles(NamedTuple):
    """The obstacles of tangents.

    Attributes:
        discs: x, y and radius of each inflated disc [m] (N, 3)
        bounds: the walls [m] (4,)
        rims: the free arcs of the discs
        bins: the discs by place
        gates: segments between touching discs or walls, which no path crosses [m] (G, 4)
        goals: -1 for the goal, then the discs that a path may touch
    """

    discs: Array
    bounds: Array
    rims: Rims
    bins: Bins
    gates: Array
    goals: Array


class Lines(NamedTuple):
    """The known tangents, one row each, with their search state. Rows at the end may be unused.

    Attributes:
        values: columns LEAVE and REACH, the angles at which the line leaves its disc and reaches the next; LENGTH of the line
            and BEST, the length of the shortest known path that ends with it [m]; from ENDS on, x, y of its ends [m] (rows, 8)
        marks: columns FROM_ARC, the free arc that it leaves, -1 at the start; DISC and ARC that it reaches, -1 at the goal;
            SENSE, the turn around that disc; BEFORE, the previous line on that path, -1 at the start; DONE, 1 if that path is
            final; EARLIER, the line expanded before this one to the same arc and turn, -1 if none (rows, 7)
    """

    values: Array
    marks: Array


@inline
def wrapped(angle: float) -> float:
    """Wrap an angle to [0, 2 pi)."""
    angle = angle % TURN
    return angle if angle < TURN else 0.0


@kernel
def swept(discs: Array) -> Sweep:
    """Sort the discs by x."""
    order = order_by(discs, 0)
    x = np.empty(len(order), dtype=np.float64)
    widest = 0.0
    for p in range(len(order)):
        x[p] = discs[order[p], 0]
        widest = max(widest, discs[p, 2])
    return Sweep(order, x, widest)


@inline
def slice_near(sweep: Sweep, x: float, reach: float) -> tuple[int, int]:
    """Return the slice of `Sweep.order` with the discs that may come within `reach` of a point at this x."""
    apart = reach + sweep.widest + 1e-6
    return count_below(sweep.x, x - apart, False), count_below(sweep.x, x + apart, True)


@inline
def scattering(count: int) -> int:
    """Return a step through `count` places, modulo `count`, that visits all of them in a scattered order."""
    step = max(1, int(0.6180339887498949 * count))
    while math.gcd(step, count) > 1:
        step += 1
    return step


@kernel
def keep_outer(discs: Array, bounds: Array) -> Array:
    """Return which discs (N, 3) have a rim partly outside all other discs and inside the bounds."""
    n = discs.shape[0]
    sweep = swept(discs)
    keep = np.ones(n, dtype=np.bool_)
    for i in range(n):
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        if x + r <= bounds[0] or x - r >= bounds[2] or y + r <= bounds[1] or y - r >= bounds[3]:
            keep[i] = False
            continue
        left, right = slice_near(
            sweep, x, -r
        )  # a disc that contains this one is larger than the distance of the centres
        for p in range(left, right):
            j = sweep.order[p]
            if j == i or not keep[j]:
                continue
            room = discs[j, 2] - r
            if room < -EPS or abs(x - discs[j, 0]) > room + 1e-3:  # rejects nearly all discs without a root
                continue
            if math.hypot(x - discs[j, 0], y - discs[j, 1]) <= room + EPS:
                # Of two equal discs, keep the first.
                if room <= EPS and j > i:
                    continue
                keep[i] = False
                break
    return keep


@kernel
def joined(low: Array, high: Array, count: int) -> int:
    """Join the intervals of covered angles that overlap, in place; returns how many remain, sorted."""
    order = np.argsort(low[:count])
    lows, highs = np.empty(count, dtype=np.float64), np.empty(count, dtype=np.float64)
    for q in range(count):
        lows[q], highs[q] = low[order[q]], high[order[q]]
    size = 0
    for q in range(count):
        if size and lows[q] <= high[size - 1] + 2.0 * ANGLE:
            high[size - 1] = max(high[size - 1], highs[q])
        else:
            low[size], high[size] = lows[q], highs[q]
            size += 1
    return size


@kernel
def free_arcs(discs: Array, bounds: Array) -> Rims:
    """Return the parts of each rim not covered by other discs or walls; contact ends an arc.

    The covered angles are joined whenever `JOIN` of them have gathered. The scan of a rim stops once all of it is
    covered. As it takes the neighbours in a scattered order, a rim amid thousands of discs needs few of them.
    """
    n = discs.shape[0]
    first = np.zeros(n + 1, dtype=np.int64)
    begin = np.empty(4 * n + 16, dtype=np.float64)
    width = np.empty(4 * n + 16, dtype=np.float64)
    low = np.empty(2 * (n + 5) + JOIN, dtype=np.float64)
    high = np.empty(2 * (n + 5) + JOIN, dtype=np.float64)
    sweep = swept(discs)
    size = 0
    for i in range(n):
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        m, full = 0, JOIN
        gone = False
        gap_x, gap_y, gap_reach = x, y, np.inf  # a circle that contains the only gap left
        left, right = slice_near(sweep, x, r)
        stride = scattering(right - left)
        for step in range(right - left + 4):
            if step < right - left:  # another disc
                j = sweep.order[left + step * stride % (right - left)]
                if j == i:
                    continue
                dx, dy, s = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2]
                d2 = dx * dx + dy * dy
                if d2 > (r + s + EPS) * (r + s + EPS):
                    continue
                if gap_reach < np.inf:
                    apart, gx, gy = s + gap_reach, discs[j, 0] - gap_x, discs[j, 1] - gap_y
                    if gx * gx + gy * gy > apart * apart:
                        continue
                d = math.sqrt(d2)
                middle = math.atan2(dy, dx)
                cosine = (r * r + d2 - s * s) / (2.0 * r * d) if d > 0.0 else 2.0
            else:  # a wall: right, upper, left, lower
                k = step - (right - left)
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
            if m >= full:
                m = joined(low, high, m)
                if m == 1 and low[0] + TURN - high[0] <= 2.0 * ANGLE:
                    gone = True
                    break
                full = 2 * m + JOIN
                ahead, behind = high[0], low[0] + TURN
                if m == 2 and low[0] <= 0.0 and high[1] >= TURN:
                    behind = low[1]
                if m == 1 or behind == low[1]:
                    middle, half = 0.5 * (ahead + behind), 0.5 * (behind - ahead)
                    gap_x, gap_y = x + r * math.cos(middle), y + r * math.sin(middle)
                    gap_reach = r * half + 1e-6
        first[i] = size
        if gone:
            continue
        if m == 0:
            while size + 1 > len(begin):
                begin, width = doubled(begin), doubled(width)
            begin[size], width[size] = 0.0, TURN
            size += 1
            continue
        m = joined(low, high, m)
        # The gap that contains the angle 0 comes last.
        while size + m + 1 > len(begin):
            begin, width = doubled(begin), doubled(width)
        for q in range(1, m):
            begin[size], width[size] = high[q - 1], low[q] - high[q - 1]
            size += 1
        reach = high[m - 1]
        rest = min(low[0] + TURN - reach, TURN - ANGLE)  # less than a full rim, as a contact cuts it
        if rest > 2.0 * ANGLE:
            begin[size], width[size] = wrapped(reach), rest
            size += 1
    first[n] = size
    ends = np.empty((size, 4), dtype=np.float64)
    for a in range(size):
        ends[a, 0], ends[a, 1] = math.cos(begin[a]), math.sin(begin[a])
        ends[a, 2], ends[a, 3] = math.cos(begin[a] + width[a]), math.sin(begin[a] + width[a])
    return Rims(first, begin[:size], width[:size], ends)


@inline
def arc_at(first: Array, begin: Array, width: Array, i: int, angle: float) -> int:
    """Return the free arc of disc i that contains an angle, -1 if none."""
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
def misses(rims: Rims, i: int, turn: int, dx: float, dy: float, across: float) -> bool:
    """Return whether the tangent along (dx, dy) certainly touches disc i on no free arc, without computing its angle.

    A line that touches disc i at the angle `a` misses the other disc's tangent point by
    turn * (cos a * dx + sin a * dy) + across. Over an arc that contains the tangent, this changes from negative to
    positive if the arc is at most 2 rad wide and the tangent at most 30 degrees off (dx, dy). Otherwise return False.
    """
    if 4.0 * across * across > dx * dx + dy * dy:
        return False
    slack = 1e-9 * (abs(dx) + abs(dy))
    for a in range(rims.first[i], rims.first[i + 1]):
        if rims.width[a] > 2.0:
            return False
        begins = turn * (rims.ends[a, 0] * dx + rims.ends[a, 1] * dy) + across
        ends = turn * (rims.ends[a, 2] * dx + rims.ends[a, 3] * dy) + across
        if begins <= slack and ends >= -slack:
            return False
    return True


@inline
def along_rim(rims: Rims, arc: int, turn: int, here: float, there: float) -> float:
    """Return the angle from `here` to `there` on a free arc in the direction of `turn`; inf if the arc ends between."""
    ahead = (turn * (there - here)) % TURN
    if ahead > TURN - BACK:
        ahead = 0.0
    if rims.width[arc] < TURN:
        past = (here - rims.begin[arc]) % TURN
        if ahead > (rims.width[arc] - past if turn > 0 else past):
            ahead = np.inf
    return ahead


@kernel
def gates(discs: Array, bounds: Array, rims: Rims) -> Array:
    """Return the segments (G, 4) between touching discs, or a disc and a touching wall: no path crosses them.

    Two discs without a free arc need none: others cover the place where they touch.
    """
    n = discs.shape[0]
    buried = rims.first[1:] == rims.first[:-1]
    out = np.empty((16, 4), dtype=np.float64)
    sweep = swept(discs)
    size = 0
    for i in range(n):
        if buried[i]:
            continue
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        left, right = slice_near(sweep, x, r)
        for p in range(left, right + 4):
            if p < right:
                j = sweep.order[p]
                if j == i or (j < i and not buried[j]):
                    continue
                bx, by = discs[j, 0], discs[j, 1]
                gap = abs(bx - x) + abs(by - y)
                if gap < r + discs[j, 2] - 4.0 * EPS or gap > 1.5 * (r + discs[j, 2]) + 1e-6:
                    continue
                gap = math.hypot(bx - x, by - y) - r - discs[j, 2]
            else:
                k = p - right
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
    """Return a positive number if p lies to the left of the line from a to b."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@kernel
def bins(discs: Array, bounds: Array) -> Bins:
    """Sort discs into bins: every bin that a disc touches lists it. A bin within a disc lists only one such disc."""
    n = discs.shape[0]
    wide, tall = bounds[2] - bounds[0], bounds[3] - bounds[1]
    cell = max(math.sqrt(wide * tall / max(n, 1)), max(wide, tall) / 200.0, 1e-9)
    shape = np.empty(2, dtype=np.int64)
    rows, cols = int(tall / cell) + 1, int(wide / cell) + 1
    shape[0], shape[1] = rows, cols
    start = np.zeros(rows * cols + 1, dtype=np.int64)
    items = np.empty(0, dtype=np.int32)
    filled = np.full(rows * cols, -1, dtype=np.int32)  # a disc that contains the bin
    for step in range(3):  # find the contained bins, count, fill
        if step == 2:
            for b in range(rows * cols):
                start[b + 1] = start[b] + (start[b + 1] if filled[b] < 0 else 1)
            items = np.empty(start[rows * cols], dtype=np.int32)
            at = start[: rows * cols].copy()
            for b in range(rows * cols):
                if filled[b] >= 0:
                    items[at[b]] = filled[b]
        for j in range(n):
            x, y, r = discs[j, 0] - bounds[0], discs[j, 1] - bounds[1], discs[j, 2] + 1e-6 * cell
            r_lo, r_hi = max(0, math.floor((y - r) / cell)), min(rows - 1, math.floor((y + r) / cell))
            for row in range(r_lo, r_hi + 1):
                dy = max(row * cell - y, y - (row + 1) * cell, 0.0)
                far = max(y - row * cell, (row + 1) * cell - y)
                room = discs[j, 2] - 1e-6 * (cell + discs[j, 2])
                c_lo, c_hi = max(0, math.floor((x - r) / cell)), min(cols - 1, math.floor((x + r) / cell))
                in_lo, in_hi = cols, -1  # the contained bins of this row
                if room > far:
                    half = math.sqrt(room * room - far * far)
                    in_lo, in_hi = max(0, math.ceil((x - half) / cell)), min(cols, math.floor((x + half) / cell)) - 1
                if step == 0:
                    for col in range(in_lo, in_hi + 1):
                        filled[row * cols + col] = j
                    continue
                col = c_lo - 1
                while col < c_hi:
                    col += 1
                    if in_lo <= col <= in_hi:
                        col = in_hi
                        continue
                    b = row * cols + col
                    if filled[b] >= 0:
                        continue
                    dx = max(col * cell - x, x - (col + 1) * cell, 0.0)
                    if dx * dx + dy * dy > r * r:
                        continue
                    if step == 2:
                        items[at[b]] = j
                        at[b] += 1
                    else:
                        start[b + 1] += 1
    return Bins(start, items, shape, cell)


@inline
def enters(discs: Array, k: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether the segment ab enters disc k."""
    r = discs[k, 2] - EPS
    return bool(r > 0.0 and segment_distance2(discs[k, 0], discs[k, 1], ax, ay, bx, by) < r * r)


@kernel
def blocked_by(
    ax: float, ay: float, bx: float, by: float, i: int, j: int, discs: Array, bounds: Array, grid: Bins, gates: Array
) -> int:
    """Return a disc that the segment ab enters, except its tangent discs i and j; -2 if it crosses a gate; else -1."""
    start, items, bin_side = grid.start, grid.items, grid.side
    rows, cols = grid.shape[0], grid.shape[1]
    px, py = (ax - bounds[0]) / bin_side, (ay - bounds[1]) / bin_side
    qx, qy = (bx - bounds[0]) / bin_side, (by - bounds[1]) / bin_side
    col = min(max(math.floor(px), 0), cols - 1)
    row = min(max(math.floor(py), 0), rows - 1)
    last_col = min(max(math.floor(qx), 0), cols - 1)
    last_row = min(max(math.floor(qy), 0), rows - 1)
    dx, dy = qx - px, qy - py
    step_col, step_row = 1 if dx > 0.0 else -1, 1 if dy > 0.0 else -1
    # Fractions of the segment: the start of the next column and row, and the spacing of columns and rows.
    next_x = ((col + (1 if dx > 0.0 else 0)) - px) / dx if dx != 0.0 else np.inf
    next_y = ((row + (1 if dy > 0.0 else 0)) - py) / dy if dy != 0.0 else np.inf
    per_x = abs(1.0 / dx) if dx != 0.0 else np.inf
    per_y = abs(1.0 / dy) if dy != 0.0 else np.inf
    todo = abs(last_col - col) + abs(last_row - row)
    while True:
        b = row * cols + col
        for q in range(start[b], start[b + 1]):
            k = int(items[q])
            if k not in (i, j) and enters(discs, k, ax, ay, bx, by):
                return k
        if todo == 0:
            break
        todo -= 1
        if (next_x < next_y and col != last_col) or row == last_row:
            col += step_col
            next_x += per_x
        else:
            row += step_row
            next_y += per_y
    for g in range(gates.shape[0]):
        gx, gy, hx, hy = gates[g, 0], gates[g, 1], gates[g, 2], gates[g, 3]
        apart = side(gx, gy, hx, hy, ax, ay) * side(gx, gy, hx, hy, bx, by) < 0.0
        if apart and side(ax, ay, bx, by, gx, gy) * side(ax, ay, bx, by, hx, hy) <= 0.0:
            return -2
    return -1


@inline
def least_by(ends: Array, least: float, ax: float, ay: float, bx: float, by: float, length: float) -> float:
    """Return a lower bound of every undiscovered path through the line from a to b.

    The path to `a` is no shorter than the straight line from the start. It is also no shorter than `least` minus the
    straight line from `a` to the goal, as A* expands paths in the order of their length plus that line.
    """
    to_a = math.hypot(ax - ends[0, 0], ay - ends[0, 1])
    to_a = max(to_a, least - math.hypot(ends[1, 0] - ax, ends[1, 1] - ay))
    return to_a + length + math.hypot(ends[1, 0] - bx, ends[1, 1] - by)


@kernel
def add_tangents(
    obstacles: Obstacles, ends: Array, line: int, lines: Lines, count: int, limit: float
) -> tuple[int, int]:
    """Add the tangents that leave the disc and turn reached by `line`; for -1, those from the start.

    There are at most 2 N + 1: one to the goal and two to each disc; `lines` has capacity for them. Tangents that
    certainly belong to no path of at most `limit` are omitted. Returns the number of lines in the table and the number
    of lines checked against the other discs.
    """
    discs, bounds, grid, gates, checked = obstacles.discs, obstacles.bounds, obstacles.bins, obstacles.gates, 0
    rims = obstacles.rims
    first, begin, width = rims.first, rims.begin, rims.width
    blockers = np.full(SECTORS, -1, dtype=np.int64)
    i, s, x, y, r = -1, 1, ends[0, 0], ends[0, 1], 0.0
    least = math.hypot(ends[1, 0] - x, ends[1, 1] - y)  # lower bound of every undiscovered path
    if line >= 0:
        i, s = lines.marks[line, DISC], lines.marks[line, SENSE]
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        least = lines.values[line, BEST] + math.hypot(
            ends[1, 0] - lines.values[line, ENDS + 2], ends[1, 1] - lines.values[line, ENDS + 3]
        )
    for j in obstacles.goals:
        if j == i and j >= 0:
            continue
        for side_of_disc in range(2 if j >= 0 else 1):
            t = 2 * side_of_disc - 1
            if j < 0:
                dx, dy, q = ends[1, 0] - x, ends[1, 1] - y, 0.0
            else:
                dx, dy, q = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2]
            across = t * q - s * r
            if (i >= 0 and misses(rims, i, s, dx, dy, across)) or (j >= 0 and misses(rims, j, t, dx, dy, across)):
                continue
            d = math.hypot(dx, dy)
            if abs(across) > d + 4.0 * EPS:
                continue
            sine = min(1.0, max(-1.0, across / d)) if d > 0.0 else 0.0
            heading = math.atan2(dy, dx) - math.asin(sine)
            leave = wrapped(heading - s * 0.5 * math.pi)
            reach = wrapped(heading - t * 0.5 * math.pi)
            from_arc, arc = -1, -1
            ax, ay, bx, by = x, y, ends[1, 0], ends[1, 1]
            if i >= 0:
                from_arc = arc_at(first, begin, width, i, leave)
                if from_arc < 0:
                    continue
                ax, ay = x + r * math.cos(leave), y + r * math.sin(leave)
            if j >= 0:
                arc = arc_at(first, begin, width, j, reach)
                if arc < 0:
                    continue
                bx, by = discs[j, 0] + q * math.cos(reach), discs[j, 1] + q * math.sin(reach)
            length = math.sqrt(max(0.0, d * d - across * across))
            if limit < np.inf and least_by(ends, least, ax, ay, bx, by, length) > limit:
                continue
            checked += 1
            sector = min(int(wrapped(heading) * (SECTORS / TURN)), SECTORS - 1)
            k = blockers[sector]  # the last blocker in this direction often blocks again
            if k >= 0 and k not in (i, j) and enters(discs, k, ax, ay, bx, by):
                continue
            k = blocked_by(ax, ay, bx, by, i, j, discs, bounds, grid, gates)
            if k != -1:
                blockers[sector] = k
                continue
            lines.values[count, LEAVE], lines.values[count, REACH], lines.values[count, LENGTH] = leave, reach, length
            lines.values[count, ENDS], lines.values[count, ENDS + 1] = ax, ay
            lines.values[count, ENDS + 2], lines.values[count, ENDS + 3] = bx, by
            lines.marks[count, FROM_ARC], lines.marks[count, ARC] = from_arc, arc
            lines.marks[count, DISC], lines.marks[count, SENSE] = j, t
            lines.marks[count, BEFORE], lines.marks[count, EARLIER] = -1, -1
            lines.values[count, BEST], lines.marks[count, DONE] = np.inf, 0
            count += 1
    return count, checked


@kernel
def relax(
    obstacles: Obstacles, ends: Array, line: int, lines: Lines, first: int, last: int, heap: Array, waiting: int
) -> tuple[Array, int]:
    """Extend the path ending in `line` by lines `first` to `last`, which leave its disc; returns the open list and its size."""
    g, r = 0.0, 0.0
    if line >= 0:
        g, r = lines.values[line, BEST], obstacles.discs[lines.marks[line, DISC], 2]
    for e in range(first, last):
        if lines.marks[e, DONE]:
            continue
        ahead = 0.0
        if line >= 0:
            arc = lines.marks[line, ARC]
            if lines.marks[e, FROM_ARC] != arc:
                continue
            ahead = along_rim(
                obstacles.rims, arc, lines.marks[line, SENSE], lines.values[line, REACH], lines.values[e, LEAVE]
            )
            if ahead == np.inf:
                continue
        length = g + r * ahead + lines.values[e, LENGTH]
        if length < lines.values[e, BEST] - SAME:
            lines.values[e, BEST] = length
            lines.marks[e, BEFORE] = line
            to_goal = math.hypot(ends[1, 0] - lines.values[e, ENDS + 2], ends[1, 1] - lines.values[e, ENDS + 3])
            heap = push(heap, waiting, length + to_goal, 0.0, e)
            waiting += 1
    return heap, waiting


@kernel
def next_line(obstacles: Obstacles, lines: Lines, latest: Array, heap: Array, waiting: int) -> tuple[int, int]:
    """Return the most promising line to expand, -1 if there is none, and the open list's new size.

    A line is skipped if an earlier expanded line reaches the same point of the rim by a path at most as long.
    Expanded lines form a linked list per arc and turn, from `latest` (2 A,) on by EARLIER.
    """
    while waiting > 0:
        e = int(heap[0, STATE])
        waiting = drop_first(heap, waiting)
        if lines.marks[e, DONE]:
            continue
        lines.marks[e, DONE] = 1
        if lines.marks[e, DISC] < 0:
            return e, waiting
        arc, turn, r = lines.marks[e, ARC], lines.marks[e, SENSE], obstacles.discs[lines.marks[e, DISC], 2]
        slot = 2 * arc + (1 if turn > 0 else 0)
        other = latest[slot]
        beaten = False
        while other >= 0 and not beaten:
            ahead = along_rim(obstacles.rims, arc, turn, lines.values[other, REACH], lines.values[e, REACH])
            beaten = ahead < np.inf and lines.values[other, BEST] + r * ahead <= lines.values[e, BEST] + SAME
            other = lines.marks[other, EARLIER]
        if beaten:
            continue
        lines.marks[e, EARLIER] = latest[slot]
        latest[slot] = e
        return e, waiting
    return -1, waiting


@kernel
def way_to(line: int, lines: Lines) -> Array:
    """Return the lines of the path ending in `line`, in the format of `shortest_path`."""
    count, e = 0, line
    while e >= 0:
        count += 1
        e = lines.marks[e, BEFORE]
    way = np.empty((count, 6), dtype=np.float64)
    e = line
    for k in range(count - 1, -1, -1):
        for q in range(4):
            way[k, q] = lines.values[e, ENDS + q]
        way[k, 4], way[k, 5] = lines.marks[e, DISC], lines.marks[e, SENSE]
        e = lines.marks[e, BEFORE]
    return way


@kernel
def touchable(discs: Array, rims: Rims, ends: Array, limit: float) -> Array:
    """Return -1 for the goal, then the discs with a free arc that a path of at most `limit` between the ends may touch."""
    found = np.empty(len(discs) + 1, dtype=np.int64)
    found[0], size = -1, 1
    for i in range(len(discs)):
        least = -2.0 * discs[i, 2]
        for end in range(2):
            least += math.hypot(discs[i, 0] - ends[end, 0], discs[i, 1] - ends[end, 1])
        if rims.first[i] < rims.first[i + 1] and least <= limit:
            found[size] = i
            size += 1
    return found[:size]


@kernel
def shortest_path(discs: Array, bounds: Array, ends: Array, limit: float) -> tuple[Array, float, int]:
    """Return the shortest path from ends[0] to ends[1]: its lines (L, 6), its length, the number of lines checked.

    `discs` are inflated, `bounds` shrunk; no disc lies within another (`keep_outer`). A line is its start x, y,
    its end x, y, and the disc that it reaches with the turn (1 left, -1 right) around it; the disc is -1 at the goal.
    No lines: there is no path of at most `limit`. A limit slightly above the path's length saves most of the search.

    A* over the tangents between discs. The tangents from a disc are computed when the search first reaches that
    disc and turn; every line that arrives there tries all that leave the same free arc ahead of it.
    """
    n = discs.shape[0]
    rims = free_arcs(discs, bounds)
    near = touchable(discs, rims, ends, limit)
    obstacles = Obstacles(discs, bounds, rims, bins(discs, bounds), gates(discs, bounds, rims), near)
    rows = max(256, 2 * n + 1)
    lines = Lines(np.empty((rows, 8), dtype=np.float64), np.empty((rows, 7), dtype=np.int64))
    span = np.full((2 * n + 1, 2), -1, dtype=np.int64)  # the lines that leave each disc by turn; last, the start
    latest = np.full(2 * len(obstacles.rims.begin), -1, dtype=np.int64)
    heap = np.empty((256, 3))
    count, waiting, checked, line = 0, 0, 0, -1
    while True:
        source = 2 * n if line < 0 else 2 * lines.marks[line, DISC] + (1 if lines.marks[line, SENSE] > 0 else 0)
        if span[source, 0] < 0:
            if count + 2 * n + 1 > len(lines.marks):
                lines = Lines(doubled_rows(lines.values), doubled_rows(lines.marks))
            span[source, 0] = count
            count, more = add_tangents(obstacles, ends, line, lines, count, limit)
            span[source, 1] = count
            checked += more
        first, last = span[source, 0], span[source, 1]
        heap, waiting = relax(obstacles, ends, line, lines, first, last, heap, waiting)
        line, waiting = next_line(obstacles, lines, latest, heap, waiting)
        if line < 0:
            return np.empty((0, 6), dtype=np.float64), np.inf, checked
        if lines.marks[line, DISC] < 0:
            return way_to(line, lines), lines.values[line, BEST], checked
