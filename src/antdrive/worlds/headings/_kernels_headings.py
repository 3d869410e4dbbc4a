"""Compiled headings of convex outlines: arrays in, arrays out.

An outline is a convex polygon `corners` (K, 2), counter-clockwise about the origin, offset outwards by `reach`. It touches a
disc if the polygon's distance from the disc's centre is at most the disc's radius plus `reach`: the sum R below.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import (
    DCOL,
    DROW,
    GRAZE,
    ONE,
    Array,
    block_cells,
    kernel,
    polygon_distance,
    polygon_wall_distance,
)

TURN = 2.0 * math.pi
UNIT = np.array([1.0, math.sqrt(0.5)] * 4)  # length of a direction's step, inverted
SLACK = TURN * GRAZE  # by which blocked intervals are wider, so that adjacent ones overlap [rad]
FAR = 1e9  # bounds of a row without crossing [m]


@kernel
def outer_radius(corners: Array) -> float:
    """Return the distance of the farthest corner from the origin."""
    best = 0.0
    for k in range(corners.shape[0]):
        best = max(best, math.hypot(corners[k, 0], corners[k, 1]))
    return best


@kernel
def touching(corners: Array, reach: float, bounds: Array) -> float:
    """Return `reach` with a tolerance for rounding: closer is touching."""
    size = abs(bounds[0]) + abs(bounds[1]) + abs(bounds[2]) + abs(bounds[3])
    return float(reach + GRAZE * (size + outer_radius(corners) + reach))


@kernel
def rotated(corners: Array, cos: float, sin: float) -> Array:
    """Return the corners of a polygon (K, 2) rotated by cosine and sine."""
    out = np.empty_like(corners)
    for k in range(corners.shape[0]):
        out[k, 0] = cos * corners[k, 0] - sin * corners[k, 1]
        out[k, 1] = sin * corners[k, 0] + cos * corners[k, 1]
    return out


@kernel
def swept(corners: Array, tx: float, ty: float) -> Array:
    """Return the convex hull of a polygon and its translation by (tx, ty).

    Going counter-clockwise, the corners from the rightmost to the leftmost one are translated; both of these occur twice.
    """
    right, left = 0, 0
    side_right, side_left = math.inf, -math.inf
    for k in range(corners.shape[0]):
        side = tx * corners[k, 1] - ty * corners[k, 0]
        if side < side_right:
            right, side_right = k, side
        if side > side_left:
            left, side_left = k, side
    out = np.empty((corners.shape[0] + 2, 2))
    n = 0
    ahead = right > left  # whether corner 0 is among the translated ones
    for k in range(corners.shape[0]):
        if k in (right, left):
            shift = 1.0 if ahead else 0.0
            out[n, 0], out[n, 1] = corners[k, 0] + shift * tx, corners[k, 1] + shift * ty
            ahead = k == right
            n += 1
        shift = 1.0 if ahead else 0.0
        out[n, 0], out[n, 1] = corners[k, 0] + shift * tx, corners[k, 1] + shift * ty
        n += 1
    return out[:n]


@kernel
def sweep_clearance(
    x0: float, y0: float, x1: float, y1: float, yaw: float, corners: Array, reach: float, discs: Array, bounds: Array
) -> float:
    """Return the distance from an outline swept along a straight line to the nearest disc or wall, <= 0 if it touches."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    hull = swept(rotated(corners, cos, sin), x1 - x0, y1 - y0)
    # Inside the walls, the distance to the nearest one is concave along the line, so its minimum is at an end.
    best = min(
        polygon_wall_distance(x0, y0, cos, sin, corners, bounds),
        polygon_wall_distance(x1, y1, cos, sin, corners, bounds),
    )
    for j in range(discs.shape[0]):
        best = min(best, polygon_distance(discs[j, 0] - x0, discs[j, 1] - y0, hull) - discs[j, 2])
    best -= reach
    return best if best > touching(corners, reach, bounds) - reach else min(best, 0.0)


@kernel
def blocked_headings(x: float, y: float, corners: Array, reach: float, discs: Array, bounds: Array) -> Array:
    """Return intervals of heading (N, 2) that cover all blocked ones; starts in [0, 2π), ends at most 2π later."""
    count, close = corners.shape[0], touching(corners, reach, bounds)
    outer = outer_radius(corners)
    out = np.empty((16, 2))
    n = 0
    for w in range(4):  # a corner in direction g from the origin passes the wall within acos(room / |c|) of it
        room = (bounds[2] - x, bounds[3] - y, x - bounds[0], y - bounds[1])[w] - close
        for k in range(count):
            far = math.hypot(corners[k, 0], corners[k, 1])
            if far < room:
                continue
            half = math.acos(max(room / far, -1.0)) if far > abs(room) else (math.pi if room <= 0.0 else 0.0)
            middle = 0.5 * math.pi * w - math.atan2(corners[k, 1], corners[k, 0])
            out = with_interval(out, n, middle - half, middle + half)
            n += 1
    cuts = np.empty(4 * count + 1)
    for j in range(discs.shape[0]):
        dx, dy, size = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2] + close
        rho = math.hypot(dx, dy)
        if rho > outer + size:
            continue
        # The disc's centre goes around the outline on a circle; its side changes only at the cuts.
        found = crossings(rho, size, corners, cuts)
        phi = math.atan2(dy, dx)
        for i in range(found):
            low, high = cuts[i], (cuts[i + 1] if i + 1 < found else cuts[0] + TURN)
            middle = 0.5 * (low + high)
            if polygon_distance(rho * math.cos(middle), rho * math.sin(middle), corners) <= size:
                out = with_interval(out, n, phi - high, phi - low)
                n += 1
    return out[:n]


@kernel
def turn_clear(
    x: float, y: float, yaw: float, turn: float, corners: Array, reach: float, discs: Array, bounds: Array
) -> bool:
    """Return whether an outline touches nothing on a whole turn on the spot."""
    blocked = blocked_headings(x, y, corners, reach, discs, bounds)
    for i in range(blocked.shape[0]):
        after = (yaw + min(turn, 0.0) - blocked[i, 0]) % TURN  # from the interval's start to the turn's lower end
        if after <= blocked[i, 1] - blocked[i, 0] or after + abs(turn) >= TURN:
            return False
    return True


@kernel
def with_interval(rows: Array, n: int, low: float, high: float) -> Array:
    """Write an interval into row n, with its start in [0, 2π); return the table, which grows if it is full."""
    if n == rows.shape[0]:
        wider = np.empty((2 * n, 2))
        wider[:n] = rows
        rows = wider
    start = (low - SLACK) % TURN
    if start >= TURN:  # rounding of a tiny negative angle
        start = 0.0
    rows[n, 0], rows[n, 1] = start, start + (high - low) + 2.0 * SLACK
    return rows


@kernel
def crossings(rho: float, size: float, corners: Array, out: Array) -> int:
    """Write the sorted directions of all points where a circle around the origin crosses an outline; return their number.

    Directions that are no crossings may be among them, one if there is no crossing.
    """
    count, n = corners.shape[0], 0
    for k in range(count):
        bx, by = corners[k, 0], corners[k, 1]
        far = math.hypot(bx, by)
        if far > 0.0 and rho > 0.0:  # the round corner: law of cosines
            cosine = (rho * rho + far * far - size * size) / (2.0 * rho * far)
            if abs(cosine) <= 1.0:
                middle, half = math.atan2(by, bx), math.acos(cosine)
                out[n], out[n + 1] = middle - half, middle + half
                n += 2
        ax, ay = corners[k - 1, 0], corners[k - 1, 1]
        ex, ey = bx - ax, by - ay
        length = math.hypot(ex, ey)
        if length == 0.0:
            continue
        ex, ey = ex / length, ey / length
        away = ax * ey - ay * ex + size  # of the offset edge's line from the origin
        if abs(away) > rho:
            continue
        along, normal = math.sqrt(rho * rho - away * away), math.atan2(-ex, ey)
        for side in range(2):
            at = along if side == 0 else -along
            if ax * ex + ay * ey <= at <= bx * ex + by * ey:
                out[n] = normal + math.atan2(at, away)
                n += 1
    if n == 0:
        out[0] = 0.0
        return 1
    for i in range(n):
        out[i] %= TURN
    out[:n].sort()
    return n


@kernel
def rows_of(polygon: Array, size: float, cy: float, y0: float, cell: float, low: Array, high: Array) -> tuple[int, int]:
    """Fill in the ranges of x, from the centre, of the rows that cross a polygon offset by `size`, around a centre.

    Return the first row and the one after the last.
    """
    count = polygon.shape[0]
    bottom, top = math.inf, -math.inf
    for k in range(count):
        bottom, top = min(bottom, polygon[k, 1]), max(top, polygon[k, 1])
    first = max(0, int(math.ceil((cy + bottom - size - y0) / cell)))
    last = min(low.shape[0], int(math.floor((cy + top + size - y0) / cell)) + 1)
    for r in range(first, last):
        low[r], high[r] = FAR, -FAR
    for k in range(count):
        ax, ay, bx, by = polygon[k - 1, 0], polygon[k - 1, 1], polygon[k, 0], polygon[k, 1]
        for r in range(
            max(first, int(math.ceil((cy + by - size - y0) / cell))),
            min(last, int(math.floor((cy + by + size - y0) / cell)) + 1),
        ):  # the round corner
            v = y0 + r * cell - cy - by
            half = math.sqrt(max(size * size - v * v, 0.0))
            low[r], high[r] = min(low[r], bx - half), max(high[r], bx + half)
        length = math.hypot(bx - ax, by - ay)
        if by == ay or length == 0.0:
            continue
        nx, ny = size * (by - ay) / length, size * (ax - bx) / length
        slope, bottom, top = (bx - ax) / (by - ay), min(ay, by) + ny, max(ay, by) + ny
        for r in range(
            max(first, int(math.ceil((cy + bottom - y0) / cell))),
            min(last, int(math.floor((cy + top - y0) / cell)) + 1),
        ):  # the offset edge
            u = ax + nx + slope * (y0 + r * cell - cy - ay - ny)
            low[r], high[r] = min(low[r], u), max(high[r], u)
    return first, last


@kernel
def columns_of(low: float, high: float, cx: float, x0: float, cell: float, cols: int) -> tuple[int, int]:
    """Return the first column of a range of x, from a centre, and the one after the last."""
    return (
        max(0, int(math.ceil((cx + low - x0) / cell))),
        min(cols, int(math.floor((cx + high - x0) / cell)) + 1),
    )


@kernel
def heading_bits(
    discs: Array, bounds: Array, x0: float, y0: float, cell: float, corners: Array, reach: float, out: Array
) -> None:
    """Fill out (R, C), uint16, with the free headings and turns of an outline at the cells' centres.

    Bit k < 8: heading k·45° is free. Bit 8 + k: the whole turn from heading k to heading k + 1 is free.

    The centres at which heading k touches a disc are within R of the polygon at heading k + 180° around the disc: rows of
    cells between two bounds. While the outline turns, its distance from the origin in the disc's direction has its maxima at
    the ends of the turn and where a corner points at the disc. So a turn is free if both ends are, and no corner within
    |c| + R points at the disc on the way: a sector around the disc.
    """
    rows, cols = out.shape
    count, close = corners.shape[0], touching(corners, reach, bounds)
    outer, depth = outer_radius(corners), -polygon_distance(0.0, 0.0, corners)
    polygons = np.empty((8, count, 2))
    for k in range(8):
        polygons[k] = rotated(corners, UNIT[k] * DCOL[k], UNIT[k] * DROW[k])
    fill_walls(bounds, x0, y0, cell, corners, close, polygons, out)
    inner = np.zeros((rows, cols // 64 + 1), dtype=np.uint64)  # cells where all headings touch a disc
    for j in range(discs.shape[0]):
        if depth + discs[j, 2] + close > 0.0:
            block_cells(discs[j, 0], discs[j, 1], depth + discs[j, 2] + close, x0, y0, cell, cols, inner)
    low, high = np.empty(rows), np.empty(rows)
    live = np.zeros(rows, dtype=np.bool_)
    centre = np.zeros((1, 2))
    for j in range(discs.shape[0]):
        cx, cy, size = discs[j, 0], discs[j, 1], discs[j, 2] + close
        first, last = rows_of(centre, outer + size + cell, cy, y0, cell, low, high)
        some = False
        for r in range(first, last):
            begin, end = columns_of(low[r], high[r], cx, x0, cell, cols)
            live[r] = has_free(inner, r, begin, end)
            some = some or live[r]
        if not some:
            continue
        for k in range(8):
            bits = np.uint16((1 << k) | (256 << k) | (256 << ((k + 7) & 7)))
            first, last = rows_of(polygons[(k + 4) & 7], size, cy, y0, cell, low, high)
            for r in range(first, last):
                if live[r]:
                    begin, end = columns_of(low[r], high[r], cx, x0, cell, cols)
                    for c in range(begin, end):
                        out[r, c] &= ~bits
        for i in range(count):
            block_turns(i, cx, cy, outer, size, x0, y0, cell, polygons, live, low, high, out)
    for r in range(rows):
        for c in range(cols):
            if (inner[r, c >> 6] >> np.uint64(c & 63)) & ONE:
                out[r, c] = 0


@kernel
def has_free(blocked: Array, r: int, begin: int, end: int) -> bool:
    """Return whether a bit of a range of cells in a row is not set."""
    for word in range(begin >> 6, ((end - 1) >> 6) + 1 if end > begin else 0):
        bits = ~blocked[r, word]
        if word == begin >> 6:
            bits = (bits >> np.uint64(begin & 63)) << np.uint64(begin & 63)
        if word == (end - 1) >> 6:
            bits = bits << np.uint64(63 - ((end - 1) & 63))
        if bits != 0:
            return True
    return False


@kernel
def fill_walls(
    bounds: Array, x0: float, y0: float, cell: float, corners: Array, close: float, polygons: Array, out: Array
) -> None:
    """Fill out (R, C) with the headings and turns that touch no wall."""
    rows, cols = out.shape
    extents = np.full((16, 4), -math.inf)  # of the outline, for each bit: left, below, right, above
    for k in range(8):
        for i in range(corners.shape[0]):
            x, y = polygons[k, i, 0], polygons[k, i, 1]
            for bit in (k, 8 + k, 8 + (k + 7) % 8):
                extents[bit, 0], extents[bit, 1] = max(extents[bit, 0], -x), max(extents[bit, 1], -y)
                extents[bit, 2], extents[bit, 3] = max(extents[bit, 2], x), max(extents[bit, 3], y)
            for w in range(4):  # a corner that points at the wall during the turn
                axis = (w + 2) % 4
                nx, ny = DCOL[2 * axis], DROW[2 * axis]
                ahead, aside = nx * x + ny * y, nx * y - ny * x  # it points at the wall at turns of 0 to 45°
                if ahead > 0.0 and aside <= 0.0 and -aside <= ahead:
                    extents[8 + k, w] = max(extents[8 + k, w], math.hypot(x, y))
    across = np.zeros(cols, dtype=np.uint16)
    for c in range(cols):
        x = x0 + c * cell
        for bit in range(16):
            if x - bounds[0] > extents[bit, 0] + close and bounds[2] - x > extents[bit, 2] + close:
                across[c] |= np.uint16(1 << bit)
    for r in range(rows):
        y = y0 + r * cell
        bits = np.uint16(0)
        for bit in range(16):
            if y - bounds[1] > extents[bit, 1] + close and bounds[3] - y > extents[bit, 3] + close:
                bits |= np.uint16(1 << bit)
        for c in range(cols):
            out[r, c] = across[c] & bits


@kernel
def block_turns(
    i: int, cx: float, cy: float, outer: float, size: float, x0: float, y0: float, cell: float, polygons: Array, live: Array,
    low: Array, high: Array, out: Array,
) -> None:  # fmt: skip
    """Clear the turns during which corner i points at a disc, within |c| + R of it."""
    cols = out.shape[1]
    radius = math.hypot(polygons[0, i, 0], polygons[0, i, 1])
    if radius == 0.0:  # as far in every direction
        return
    size += radius
    for k in range(8):
        # From the disc, the centres are between the directions opposite to the corner at headings k and k + 1.
        ax, ay = -polygons[k, i, 0] / radius, -polygons[k, i, 1] / radius
        bx, by = -polygons[(k + 1) & 7, i, 0] / radius, -polygons[(k + 1) & 7, i, 1] / radius
        bottom, top = min(0.0, min(ay, by)), max(0.0, max(ay, by))
        if ax >= 0.0 and bx <= 0.0:
            top = 1.0
        if ax <= 0.0 and bx >= 0.0:
            bottom = -1.0
        bits = ~np.uint16(256 << k)
        for r in range(
            max(0, int(math.ceil((cy + bottom * size - y0) / cell))),
            min(out.shape[0], int(math.floor((cy + top * size - y0) / cell)) + 1),
        ):
            if not live[r]:
                continue
            v = y0 + r * cell - cy
            right = math.sqrt(max(size * size - v * v, 0.0))
            left = -right
            # Left of the first direction, right of the second; the centre's own row belongs to both sides.
            if ay > 0.0:
                right = min(right, v * ax / ay)
            elif ay < 0.0:
                left = max(left, v * ax / ay)
            if by > 0.0:
                left = max(left, v * bx / by)
            elif by < 0.0:
                right = min(right, v * bx / by)
            begin, end = columns_of(left, right, cx, x0, cell, cols)
            for c in range(begin, end):
                out[r, c] &= bits


@kernel
def clear_moves(
    discs: Array,
    bounds: Array,
    x0: float,
    y0: float,
    cell: float,
    corners: Array,
    reach: float,
    bits: Array,
    out: Array,
) -> None:
    """Fill out (R, C), uint8, with the clear straight moves: bit k is the move `DIRECTIONS[k]` at heading k·45°.

    `bits` are those of `heading_bits`. A move is clear if both ends are free and the sweep between them touches nothing.
    """
    rows, cols = out.shape
    close = touching(corners, reach, bounds)
    for r in range(rows):
        for c in range(cols):
            out[r, c] = 0
        for k in range(8):
            if 0 <= r + DROW[k] < rows:
                for c in range(max(0, -DCOL[k]), min(cols, cols - DCOL[k])):
                    both = bits[r, c] & bits[r + DROW[k], c + DCOL[k]]
                    out[r, c] |= np.uint8(both & (1 << k))
    low, high = np.empty(rows), np.empty(rows)
    for k in range(8):
        step = cell / UNIT[k]
        # Chords along the heading are concave across it: if those of both flanks are at least as long as the move, all are,
        # and the polygons at both ends cover the sweep.
        if shorter_flank(corners) >= step:
            continue
        tx, ty = cell * DCOL[k], cell * DROW[k]
        hull = -swept(rotated(corners, UNIT[k] * DCOL[k], UNIT[k] * DROW[k]), tx, ty)
        keep = ~np.uint8(1 << k)
        for j in range(discs.shape[0]):
            first, last = rows_of(hull, discs[j, 2] + close, discs[j, 1], y0, cell, low, high)
            for r in range(first, last):
                begin, end = columns_of(low[r], high[r], discs[j, 0], x0, cell, cols)
                for c in range(begin, end):
                    out[r, c] &= keep


@kernel
def shorter_flank(corners: Array) -> float:
    """Return the length of a polygon's shorter flank: its chord along x at the smallest or the largest y."""
    lengths = np.zeros(2)
    for side in range(2):
        extreme = -math.inf
        for k in range(corners.shape[0]):
            extreme = max(extreme, corners[k, 1] if side == 0 else -corners[k, 1])
        first, last = math.inf, -math.inf
        for k in range(corners.shape[0]):
            if (corners[k, 1] if side == 0 else -corners[k, 1]) == extreme:
                first, last = min(first, corners[k, 0]), max(last, corners[k, 0])
        lengths[side] = last - first
    return float(min(lengths[0], lengths[1]))
