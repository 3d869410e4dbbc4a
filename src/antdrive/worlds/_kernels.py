"""Compiled geometry: arrays in, arrays out, without validation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.base._kernels_compiler import inline as inline
from antdrive.base._kernels_compiler import kernel as kernel
from antdrive.base._kernels_compiler import leaf as leaf

Array = Any
ONE, ALL = np.uint64(1), np.uint64(2**64 - 1)

SQRT2 = math.sqrt(2.0)
GRAZE = 1e-12  # bound on the rounding error of distances, as a fraction of the coordinates; 1000 times the actual error
TOGETHER = 8  # discs in one box
APART = 8  # every so many discs, one is processed first
SPARE = 1e-6  # slack of cell ranges for rounding [cells]
ROUNDING = 1e-6  # discs are skipped only with this slack, so that no result changes [m]
# Directions by bit: E, NE, N, NW, W, SW, S, SE as (row, column) steps; row grows with y.
DROW = np.array([0, 1, 1, 1, 0, -1, -1, -1], dtype=np.int64)
DCOL = np.array([1, 1, 0, -1, -1, -1, 0, 1], dtype=np.int64)


@kernel
def doubled(array: Array) -> Array:
    """Return a copy of a vector with twice its length; the second half is undefined."""
    out = np.empty(2 * len(array), dtype=array.dtype)
    for i in range(len(array)):
        out[i] = array[i]
    return out


@kernel
def doubled_rows(array: Array) -> Array:
    """Return a copy of a table (N, M) with twice its rows; the second half is undefined."""
    out = np.empty((2 * len(array), array.shape[1]), dtype=array.dtype)
    for i in range(len(array)):
        for j in range(array.shape[1]):
            out[i, j] = array[i, j]
    return out


@kernel
def span(table: Array, column: int) -> tuple[float, float]:
    """Return the smallest and the largest value in a column of a table (N, M), N >= 1."""
    low = high = table[0, column]
    for i in range(1, table.shape[0]):
        low, high = min(low, table[i, column]), max(high, table[i, column])
    return low, high


@kernel
def order_by(table: Array, column: int) -> Array:
    """Return the order of a table's rows (N, M) by a column; all callers share one compiled sort."""
    values = np.empty(table.shape[0], dtype=np.float64)
    for i in range(table.shape[0]):
        values[i] = table[i, column]
    return np.argsort(values)


@kernel
def count_below(values: Array, bound: float, equal: bool) -> int:
    """Return how many ascending values lie below a bound; `equal`: or on it. `np.searchsorted` compiles far longer."""
    low, high = 0, values.shape[0]
    while low < high:
        middle = (low + high) >> 1
        if values[middle] < bound or (equal and values[middle] == bound):
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def segment_distance2(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the squared distance from a point to the closed segment ab."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    t = 0.0
    if length2 > 0.0:
        t = ((px - ax) * dx + (py - ay) * dy) / length2
        t = min(1.0, max(0.0, t))
    ex, ey = ax + t * dx - px, ay + t * dy - py
    return ex * ex + ey * ey


@kernel
def wall_distance(x: float, y: float, bounds: Array) -> float:
    """Return the distance to the nearest wall, negative outside."""
    return float(min(min(x - bounds[0], bounds[2] - x), min(y - bounds[1], bounds[3] - y)))


@kernel
def polygon_distance(x: float, y: float, corners: Array) -> float:
    """Return the signed distance from a convex polygon (K, 2), counter-clockwise, to a point, negative inside.

    One corner is a point, two are a segment; corners may repeat.
    """
    over, apart2 = -math.inf, math.inf
    for k in range(corners.shape[0]):
        ax, ay = corners[k - 1, 0], corners[k - 1, 1]
        ex, ey = corners[k, 0] - ax, corners[k, 1] - ay
        dx, dy = x - ax, y - ay
        length2 = ex * ex + ey * ey
        share = 0.0
        if length2 > 0.0:
            share = min(max((dx * ex + dy * ey) / length2, 0.0), 1.0)
            over = max(over, (dx * ey - dy * ex) / math.sqrt(length2))
        dx, dy = dx - share * ex, dy - share * ey
        apart2 = min(apart2, dx * dx + dy * dy)
    return over if over <= 0.0 and corners.shape[0] > 2 else math.sqrt(apart2)


@kernel
def polygon_wall_distance(x: float, y: float, cos: float, sin: float, corners: Array, bounds: Array) -> float:
    """Return the distance from a polygon (K, 2) at (x, y), rotated by cosine and sine, to the nearest wall."""
    best = math.inf
    for k in range(corners.shape[0]):
        cx = x + cos * corners[k, 0] - sin * corners[k, 1]
        cy = y + sin * corners[k, 0] + cos * corners[k, 1]
        best = min(best, min(min(cx - bounds[0], bounds[2] - cx), min(cy - bounds[1], bounds[3] - cy)))
    return best


@kernel
def boxes_around(discs: Array) -> Array:
    """Return the bounding boxes of each TOGETHER consecutive discs: x_min, y_min, x_max, y_max (B, 4).

    Consecutive discs are often neighbours; all discs of a box that is too far away are skipped.
    """
    count = discs.shape[0]
    out = np.empty(((count + TOGETHER - 1) // TOGETHER, 4))
    for b in range(out.shape[0]):
        x_min, y_min, x_max, y_max = math.inf, math.inf, -math.inf, -math.inf
        for j in range(b * TOGETHER, min(count, (b + 1) * TOGETHER)):
            x, y, radius = discs[j, 0], discs[j, 1], discs[j, 2]
            x_min, y_min = min(x_min, x - radius), min(y_min, y - radius)
            x_max, y_max = max(x_max, x + radius), max(y_max, y + radius)
        out[b, 0], out[b, 1], out[b, 2], out[b, 3] = x_min, y_min, x_max, y_max
    return out


@inline
def is_beyond(reach: float, x: float, y: float, box: Array) -> bool:
    """Return whether a box is farther from (x, y) than a reach; False for a negative reach."""
    dx = max(max(box[0] - x, x - box[2]), 0.0)
    dy = max(max(box[1] - y, y - box[3]), 0.0)
    return bool(reach >= 0.0 and dx * dx + dy * dy > reach * reach)


@kernel
def point_clearances(points: Array, discs: Array, bounds: Array, out: Array) -> None:
    """Fill out[i] with the distance from point i to the nearest disc surface or wall."""
    boxes = boxes_around(discs)
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        best = wall_distance(x, y, bounds)
        if i > 0:  # clearance grows at most by the distance from the previous point
            best = min(best, out[i - 1] + math.hypot(x - points[i - 1, 0], y - points[i - 1, 1]) + ROUNDING)
        for b in range(boxes.shape[0]):
            if is_beyond(best + ROUNDING, x, y, boxes[b]):
                continue
            for j in range(b * TOGETHER, min(discs.shape[0], (b + 1) * TOGETHER)):
                dx, dy, reach = x - discs[j, 0], y - discs[j, 1], best + discs[j, 2] + ROUNDING
                if dx * dx + dy * dy > reach * reach:
                    continue
                best = min(best, math.hypot(x - discs[j, 0], y - discs[j, 1]) - discs[j, 2])
        out[i] = best


@kernel
def segment_clearance(ax: float, ay: float, bx: float, by: float, discs: Array, bounds: Array) -> float:
    """Return the distance from a segment to the nearest disc surface or wall."""
    # Inside the box the distance to the nearest wall is concave along a segment, so its minimum is at an end.
    best = min(wall_distance(ax, ay, bounds), wall_distance(bx, by, bounds))
    mx, my, half = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * math.hypot(bx - ax, by - ay) + ROUNDING
    for j in range(discs.shape[0]):
        dx, dy, reach = discs[j, 0] - mx, discs[j, 1] - my, best + discs[j, 2] + half
        if dx * dx + dy * dy > reach * reach:
            continue
        best = min(best, math.sqrt(segment_distance2(discs[j, 0], discs[j, 1], ax, ay, bx, by)) - discs[j, 2])
    return best


@kernel
def clearance_up_to(
    most: float, ax: float, ay: float, bx: float, by: float, discs: Array, boxes: Array, bounds: Array
) -> float:
    """Return the lesser of `segment_clearance` and `most`, for discs with their boxes.

    Most discs farther away than `most` are skipped.
    """
    best = min(most, min(wall_distance(ax, ay, bounds), wall_distance(bx, by, bounds)))
    x_min, x_max, y_min, y_max = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
    for b in range(boxes.shape[0]):
        dx = max(max(boxes[b, 0] - x_max, x_min - boxes[b, 2]), 0.0)
        dy = max(max(boxes[b, 1] - y_max, y_min - boxes[b, 3]), 0.0)
        reach = best + ROUNDING
        if reach >= 0.0 and dx * dx + dy * dy > reach * reach:
            continue
        for j in range(b * TOGETHER, min(discs.shape[0], (b + 1) * TOGETHER)):
            x, y, reach = discs[j, 0], discs[j, 1], best + discs[j, 2] + ROUNDING
            dx, dy = max(max(x_min - x, x - x_max), 0.0), max(max(y_min - y, y - y_max), 0.0)
            if reach < 0.0 or dx * dx + dy * dy > reach * reach:
                continue
            best = min(best, math.sqrt(segment_distance2(x, y, ax, ay, bx, by)) - discs[j, 2])
    return best


@kernel
def polyline_clearance(xy: Array, discs: Array, bounds: Array) -> float:
    """Return the least clearance of the segments of a polyline (N, 2), N >= 2."""
    boxes = boxes_around(discs)
    best = math.inf
    for i in range(xy.shape[0] - 1):
        best = clearance_up_to(best, xy[i, 0], xy[i, 1], xy[i + 1, 0], xy[i + 1, 1], discs, boxes, bounds)
    return best


@kernel
def segment_clearances(starts: Array, ends: Array, discs: Array, bounds: Array, out: Array) -> None:
    """Fill out[i] with the clearance of the segment starts[i]..ends[i]."""
    boxes = boxes_around(discs)
    for i in range(starts.shape[0]):
        ax, ay, bx, by = starts[i, 0], starts[i, 1], ends[i, 0], ends[i, 1]
        most = math.inf
        if i > 0:  # clearance grows at most by the ends' distances from the previous segment
            begun = math.hypot(ax - starts[i - 1, 0], ay - starts[i - 1, 1])
            ended = math.hypot(bx - ends[i - 1, 0], by - ends[i - 1, 1])
            most = out[i - 1] + max(begun, ended) + ROUNDING
        out[i] = clearance_up_to(most, ax, ay, bx, by, discs, boxes, bounds)


@kernel
def rasterise(
    discs: Array, bounds: Array, x0: float, y0: float, cell: float, inflate: float, free: Array, closed: Array
) -> None:
    """Fill `free` with the free cells, and mark in `closed` the moves between free cells blocked by discs.

    A cell is blocked when its centre is no farther than `inflate` from a disc or a wall.
    `closed` has the bits of E, NE, N and NW only, so that each pair of opposite moves is stored once.
    """
    rows, cols = free.shape
    within = np.empty(cols, dtype=np.bool_)
    for c in range(cols):
        x = x0 + c * cell
        within[c] = min(x - bounds[0], bounds[2] - x) > inflate
    grazes = np.empty(discs.shape[0], dtype=np.bool_)
    blocked = np.zeros((rows, cols // 64 + 1), dtype=np.uint64)  # a bit for each cell
    # Neighbours in the list are often neighbours in the world: after every APART-th disc, the others add little.
    for first in range(APART):
        for j in range(first, discs.shape[0], APART):
            grazes[j] = block_cells(discs[j, 0], discs[j, 1], discs[j, 2] + inflate, x0, y0, cell, cols, blocked)
    for r in range(rows):
        y = y0 + r * cell
        inside = min(y - bounds[1], bounds[3] - y) > inflate
        for word in range(blocked.shape[1]):
            bits = blocked[r, word]
            for c in range(64 * word, min(64 * (word + 1), cols)):
                free[r, c] = inside & within[c] & ((bits >> np.uint64(c & 63)) & ONE == 0)
    for j in range(discs.shape[0]):
        if grazes[j]:
            close_rim(discs[j, 0], discs[j, 1], discs[j, 2] + inflate, x0, y0, cell, free, closed)
        else:
            close_moves(discs[j, 0], discs[j, 1], discs[j, 2] + inflate, x0, y0, cell, free, closed)


@inline
def cells_of(word: int, first: int, last: int) -> Array:
    """Return the bits of the cells `first` to `last` of a row within one of its words."""
    low, high = max(first - 64 * word, 0), min(last - 64 * word, 63)
    return (ALL << np.uint64(low)) & (ALL >> np.uint64(63 - high))


@kernel
def block_cells(
    cx: float, cy: float, radius: float, x0: float, y0: float, cell: float, cols: int, blocked: Array
) -> bool:
    """Set the bits of the cells whose centres lie in a disc.

    Return whether other centres, not blocked by earlier discs, lie on its rim within rounding.
    """
    radius2, per = radius * radius, 1.0 / cell
    rim2 = radius2 + GRAZE * radius * (abs(cx) + abs(cy) + abs(x0) + abs(y0) + radius + cell)
    r_lo = max(0, int(math.floor((cy - radius - y0) * per)))
    r_hi = min(blocked.shape[0] - 1, int(math.ceil((cy + radius - y0) * per)))
    first = max(0, int(math.floor((cx - radius - x0) * per)))
    last = min(cols - 1, int(math.ceil((cx + radius - x0) * per)))
    if first > last:
        return False
    w_lo, w_hi = first >> 6, last >> 6
    mask_lo, mask_hi = cells_of(w_lo, first, last), cells_of(w_hi, first, last)
    grazes = False
    for r in range(r_lo, r_hi + 1):
        if w_hi <= w_lo + 1 and blocked[r, w_lo] & mask_lo == mask_lo and blocked[r, w_hi] & mask_hi == mask_hi:
            continue  # all are set
        dy = y0 + r * cell - cy
        if abs(dy) > radius:
            grazes = grazes or dy * dy <= rim2
            continue
        half = math.sqrt(radius2 - dy * dy)
        c_lo = max(0, int(math.floor((cx - half - x0) * per)))
        c_hi = min(cols - 1, int(math.ceil((cx + half - x0) * per)))
        if c_lo <= c_hi and c_lo >> 6 == c_hi >> 6:
            mask = cells_of(c_lo >> 6, c_lo, c_hi)
            if blocked[r, c_lo >> 6] & mask == mask:
                continue
        while c_lo <= c_hi:
            d2 = (x0 + c_lo * cell - cx) * (x0 + c_lo * cell - cx) + dy * dy
            if d2 <= radius2:
                break
            grazes = grazes or d2 <= rim2
            c_lo += 1
        while c_lo <= c_hi:
            d2 = (x0 + c_hi * cell - cx) * (x0 + c_hi * cell - cx) + dy * dy
            if d2 <= radius2:
                break
            grazes = grazes or d2 <= rim2
            c_hi -= 1
        if c_lo <= c_hi:
            for word in range(c_lo >> 6, (c_hi >> 6) + 1):
                blocked[r, word] |= cells_of(word, c_lo, c_hi)
    return grazes


@kernel
def close_moves(
    cx: float, cy: float, radius: float, x0: float, y0: float, cell: float, free: Array, closed: Array
) -> None:
    """Mark the moves between free cells that a disc blocks, if no cell centre lies on its rim.

    Such a move passes the disc's centre at no more than the radius, while both of its ends are farther. In units of cells,
    with the disc's centre at (p, q), `lo` to `hi` is the range of its distances times its length.
    """
    p, q, size2 = (cx - x0) / cell, (cy - y0) / cell, (radius / cell) * (radius / cell)
    for side in range(2):
        lo, hi = math.sqrt(max(size2 - 1.0, 0.0)) - SPARE, math.sqrt(size2) + SPARE
        low, high = (lo, hi) if side == 1 else (-hi, -lo)
        for c in range(int(math.floor(p - SPARE)), int(math.floor(p + SPARE)) + 1):  # east
            for r in range(int(math.ceil(q + low)), int(math.floor(q + high)) + 1):
                close_move(r, c, 0, cx, cy, radius, x0, y0, cell, free, closed)
        for r in range(int(math.floor(q - SPARE)), int(math.floor(q + SPARE)) + 1):  # north
            for c in range(int(math.ceil(p + low)), int(math.floor(p + high)) + 1):
                close_move(r, c, 2, cx, cy, radius, x0, y0, cell, free, closed)
        lo, hi = math.sqrt(max(2.0 * size2 - 4.0, 0.0)) - SPARE, math.sqrt(2.0 * size2) + SPARE
        low, high = (lo, hi) if side == 1 else (-hi, -lo)
        for n in range(int(math.ceil(p + q - 2.0 - SPARE)), int(math.floor(p + q + SPARE)) + 1):  # north-east
            for r in range(int(math.ceil(0.5 * (n - p + q + low))), int(math.floor(0.5 * (n - p + q + high))) + 1):
                close_move(r, n - r, 1, cx, cy, radius, x0, y0, cell, free, closed)
        for n in range(int(math.ceil(q - p - 2.0 - SPARE)), int(math.floor(q - p + SPARE)) + 1):  # north-west
            for r in range(int(math.ceil(0.5 * (n + p + q + low))), int(math.floor(0.5 * (n + p + q + high))) + 1):
                close_move(r, r - n, 3, cx, cy, radius, x0, y0, cell, free, closed)


@inline
def close_move(
    r: int, c: int, k: int, cx: float, cy: float, radius: float, x0: float, y0: float, cell: float, free: Array,
    closed: Array,
) -> None:  # fmt: skip
    """Mark move k of a cell if both ends are free and a disc blocks it."""
    rows, cols = free.shape
    rn, cn = r + DROW[k], c + DCOL[k]
    if r < 0 or r >= rows or c < 0 or c >= cols or rn < 0 or rn >= rows or cn < 0 or cn >= cols:
        return
    if free[r, c] and free[rn, cn]:
        d2 = segment_distance2(cx, cy, x0 + c * cell, y0 + r * cell, x0 + cn * cell, y0 + rn * cell)
        if d2 <= radius * radius:
            closed[r, c] |= 1 << k


@kernel
def close_rim(
    cx: float, cy: float, radius: float, x0: float, y0: float, cell: float, free: Array, closed: Array
) -> None:
    """Mark the moves between free cells that a disc blocks, checking all cells along its rim."""
    rows, cols = free.shape
    reach = radius + SQRT2 * cell
    r_lo = max(0, int(math.floor((cy - reach - y0) / cell)))
    r_hi = min(rows - 1, int(math.ceil((cy + reach - y0) / cell)))
    for r in range(r_lo, r_hi + 1):
        y = y0 + r * cell
        dy = abs(y - cy)
        if dy > reach:
            continue
        half = math.sqrt(reach * reach - dy * dy)
        inner = math.sqrt(radius * radius - dy * dy) - cell if dy < radius else -1.0
        c_lo = max(0, int(math.floor((cx - half - x0) / cell)))
        c_hi = min(cols - 1, int(math.ceil((cx + half - x0) / cell)))
        c = c_lo
        while c <= c_hi:
            x = x0 + c * cell
            if abs(x - cx) < inner:  # deep inside the disc all cells are blocked: skip to the other side
                c = max(c + 1, int(math.floor((cx + inner - x0) / cell)))
                continue
            if free[r, c]:
                for k in range(4):
                    close_move(r, c, k, cx, cy, radius, x0, y0, cell, free, closed)
            c += 1


@kernel
def allowed_moves(free: Array, closed: Array, moves: Array) -> None:
    """Fill `moves` with the masks of allowed moves; a diagonal needs both orthogonal neighbours free.

    Branch-free, so that the loop is vectorised.
    """
    rows, cols = free.shape
    wide = np.zeros((rows + 1, cols + 2), dtype=np.uint8)  # the free cells, padded
    first = np.zeros((rows + 1, cols + 2), dtype=np.uint8)  # their moves E, NE, N and NW, with a row below
    for r in range(rows):
        for c in range(cols):
            wide[r, c + 1] = free[r, c]
    for r in range(rows):
        for c in range(cols):
            here, east, north = wide[r, c + 1], wide[r, c + 2], wide[r + 1, c + 1]
            diagonal = 2 * (east & wide[r + 1, c + 2]) | 8 * (wide[r, c] & wide[r + 1, c])
            able = east | 4 * north | north * diagonal
            first[r + 1, c + 1] = np.uint8(here * able) & ~closed[r, c]
    for r in range(rows):
        for c in range(cols):
            below = (first[r, c] & 2) | (first[r, c + 1] & 4) | (first[r, c + 2] & 8)
            moves[r, c] = first[r + 1, c + 1] | np.uint8(((first[r + 1, c] & 1) | below) << 4)
