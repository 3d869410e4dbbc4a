"""Compiled occupancy map: scans in, discs out. Arrays in, arrays out, no validation.

Cells hold free ground. Finer grains (GRAINS by GRAINS to a cell) hold hits, each with its log-odds and the bounding box of its
points. A list of the occupied cells holds the grains of a cell side by side, so all hits of a map take a few hundred kilobytes,
however large the map is, and stay in the processor's cache.

Kernels that Python calls get a map as the plain tuple of its arrays: a call with a named tuple takes 1 to 4 us longer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.worlds._kernels import Array, inline, kernel, leaf

GRAINS, FINER = 2, 1  # grains along the side of a cell, and its binary logarithm
SQUARE, SHIFT = 8, 3  # cells along the side of a square, and its binary logarithm
HIT, MISS, MOST = 0.85, 0.4, 3.5  # steps of the log-odds and their upper limit (Hornung et al. 2013, section 4)
SLACK = 1e-4  # added to the radius of discs; boxes are kept in single precision [m]
EDGE = 1e-6  # beams end this far inside the map's edge [cells]
THINNEST = 0.005  # least radius of a disc [m]


class MapArrays(NamedTuple):
    """State of a map with R rows and C columns of cells, at most K of them occupied.

    The last four are unordered lists of the occupied cells; the first `count[0]` rows count.

    Attributes:
        free: whether cells were observed as free (R, C)
        unseen: number of cells in each square of SQUARE x SQUARE that are not free (R / SQUARE, C / SQUARE, rounded up)
        occupied: whether cells hold hits (R, C); no cell is free and occupied
        slot: the row of an occupied cell in the lists (R, C)
        count: the number of occupied cells (1,)
        frame: x and y of the lower left corner, and a cell's side (3,) [m]
        cells: row and column of an occupied cell, the scan in which it became occupied (0: from unknown), and the scan in which
            a beam last crossed it (K, 4)
        odds: log-odds of its grains, row by row (K, GRAINS * GRAINS); 0: no hits
        stamp: the scan that last hit a grain, or checked whether beams pass it (K, GRAINS * GRAINS)
        box: the least x and y and the largest x and y of a grain's hits (K, GRAINS * GRAINS, 4) [m]
    """

    free: Array
    unseen: Array
    occupied: Array
    slot: Array
    count: Array
    frame: Array
    cells: Array
    odds: Array
    stamp: Array
    box: Array


class Fan(NamedTuple):
    """Scan in the frame of the map.

    Attributes:
        eye: pose of the lidar: x, y, and the cosine and sine of its yaw
        beams: directions of the beams in the lidar's frame (B, 2)
        ranges: their ranges (B,) [m]
        closed: whether the first beam is beside the last
    """

    eye: tuple[float, float, float, float]
    beams: Array
    ranges: Array
    closed: bool


@leaf
def begins(beams: int, spacing: float, cell: float, out: Array) -> None:
    """Set out[i] to the distance from which beam i is needed to omit no cell [m], once all beams have had their turns.

    Near the lidar every second, fourth, ... beam crosses all cells that the others cross.
    """
    for i in range(beams):
        step, number = 2, i
        while number and number % 2 == 0:
            step, number = step * 2, number // 2
        out[i] = cell / (step * spacing) if number else 0.0


@leaf
def count_unseen(free: Array, unseen: Array) -> None:
    """Count the cells of each square that are not free."""
    unseen[:] = 0
    for row in range(free.shape[0]):
        for col in range(free.shape[1]):
            unseen[row >> SHIFT, col >> SHIFT] += 0 if free[row, col] else 1


@leaf
def insert(
    x: float, y: float, cos: float, sin: float, beams: Array, ranges: Array, closed: bool, begin: Array, turn: int,
    turns: int, left_out: Array, horizon: float, trust: float, scan: int, arrays: tuple[Array, ...], changed: Array,
) -> int:  # fmt: skip
    """Enter a scan from (x, y) and the cosine and sine of a yaw; return the number of rows written to `changed`.

    A whole scan enters the free paths of every `turns`-th beam from beam `turn` on; for `turn` below 0, only the hits are
    entered.

    Hits farther than `horizon` are omitted, as are those of beams in `omitted`; ground is observed as free up to `trust`.
    """
    fan, m = Fan((x, y, cos, sin), beams, ranges, closed), MapArrays(*arrays)
    count = enter_hits(fan, turn >= 0, left_out, horizon, scan, m, changed)
    return enter_ways(fan, begin, turn, turns, trust, scan, m, changed, count) if turn >= 0 else count


@kernel
def enter_hits(fan: Fan, whole: bool, left_out: Array, horizon: float, scan: int, m: MapArrays, changed: Array) -> int:
    """Enter the hits: all of them in the boxes of their grains, those of whole scans in the log-odds.

    A hit may come nearer by as much as a cell between two whole scans, which the robot must know at once.
    """
    size, cols = m.odds.size, m.occupied.shape[1]
    odds, stamp, box = m.odds.reshape(size), m.stamp.reshape(size), m.box.reshape(size, 4)
    occupied, slot = m.occupied.reshape(m.occupied.size), m.slot.reshape(m.slot.size)
    found, at = np.empty((2, left_out.shape[0]), dtype=np.float32), np.empty(left_out.shape[0], dtype=np.int32)
    locate(fan, left_out, horizon, m, found, at)
    count = 0
    for i in range(at.shape[0]):
        if at[i] < 0:
            continue
        # A signed index costs a comparison each time.
        grain, px, py = np.uint32(at[i]), found[0, i], found[1, i]
        cell = grain >> np.uint32(2 * FINER)
        if not occupied[cell]:
            row, col = cell // cols, cell % cols
            occupy(row, col, scan, m)
            changed[count, 0], changed[count, 1] = row, col
            count += 1
        k = np.uint32((slot[cell] << 2 * FINER) | (at[i] & (GRAINS * GRAINS - 1)))
        first = odds[k] <= 0.0
        if first:
            box[k, 0], box[k, 1], box[k, 2], box[k, 3] = px, py, px, py
        else:
            box[k, 0], box[k, 1] = min(box[k, 0], px), min(box[k, 1], py)
            box[k, 2], box[k, 3] = max(box[k, 2], px), max(box[k, 3], py)
        if (first or whole) and stamp[k] != scan:
            stamp[k] = scan
            odds[k] = min(MOST, odds[k] + HIT)
    return count


@inline
def locate(fan: Fan, left_out: Array, horizon: float, m: MapArrays, found: Array, at: Array) -> None:
    """Write the ends of the beams (2, B) [m], and their cells' numbers with the grains' as last bits (B,), -1 for none.

    Branch-free for vectorisation.
    """
    ranges, beams, x, y, cos, sin = fan.ranges, fan.beams, fan.eye[0], fan.eye[1], fan.eye[2], fan.eye[3]
    left, low, cell = m.frame[0], m.frame[1], m.frame[2]
    rows, cols = m.occupied.shape
    for i in range(at.shape[0]):
        px = x + ranges[i] * (cos * beams[i, 0] - sin * beams[i, 1])
        py = y + ranges[i] * (sin * beams[i, 0] + cos * beams[i, 1])
        u, v = (px - left) / cell, (py - low) / cell
        entered = (not left_out[i]) & (ranges[i] > 0.0) & (ranges[i] <= horizon)
        entered &= (u >= 0.0) & (u < cols) & (v >= 0.0) & (v < rows)
        u, v = u if entered else 0.0, v if entered else 0.0
        row, col = np.int32(v), np.int32(u)
        grain = GRAINS * np.int32(GRAINS * (v - row)) + np.int32(GRAINS * (u - col))
        found[0, i], found[1, i] = px, py
        at[i] = GRAINS * GRAINS * (row * np.int32(cols) + col) + grain if entered else -1


@leaf
def occupy(row: int, col: int, scan: int, m: MapArrays) -> None:
    """Add a cell without hits to the list of occupied ones."""
    at = m.count[0]
    m.count[0] = at + 1
    m.cells[at, 0], m.cells[at, 1], m.cells[at, 2], m.cells[at, 3] = row, col, scan if m.free[row, col] else 0, 0
    m.slot[row, col], m.occupied[row, col] = at, True
    if m.free[row, col]:
        m.free[row, col] = False
        m.unseen[row >> SHIFT, col >> SHIFT] += 1
    for k in range(GRAINS * GRAINS):
        m.odds[at, k], m.stamp[at, k] = 0.0, 0


@kernel
def enter_ways(
    fan: Fan, begin: Array, turn: int, turns: int, trust: float, scan: int, m: MapArrays, changed: Array, count: int
) -> int:
    """Enter the free paths of every `turns`-th beam, each from its `begin` on.

    A beam passes columns of cells or, if steep, rows: *lanes*. The *place* where it enters the next lane follows from the
    lane's number, so that no step depends on the previous one (as in J. Bresenham, IBM Systems Journal 4, 1965, but for all cells
    that a beam meets). Both are counted in the beam's direction. Squares of free cells are passed in one step.
    """
    ranges, beams, x, y, cos, sin = fan.ranges, fan.beams, fan.eye[0], fan.eye[1], fan.eye[2], fan.eye[3]
    left, low, cell = m.frame[0], m.frame[1], m.frame[2]
    rows, cols = m.free.shape
    # Hoisted: each access to an array of a record costs as much as several cells.
    occupied, free, unseen = m.occupied.reshape(rows * cols), m.free.reshape(rows * cols), m.unseen
    cells, slot = m.cells, m.slot.reshape(rows * cols)
    crossed, crossings = np.empty((m.count[0], 3), dtype=np.int32), 0
    for i in range(turn, beams.shape[0], turns):
        rest = min(ranges[i], trust) - begin[i]  # inf: no hit; -inf: a hit too near to measure
        if not rest > 0.0:
            continue
        ux, uy = cos * beams[i, 0] - sin * beams[i, 1], sin * beams[i, 0] + cos * beams[i, 1]
        sx, sy = (x + begin[i] * ux - left) / cell, (y + begin[i] * uy - low) / cell
        row, col = int(math.floor(sy)), int(math.floor(sx))
        if not (0 <= row < rows and 0 <= col < cols):
            continue
        right, up, flat = ux >= 0.0, uy >= 0.0, abs(ux) >= abs(uy)
        px, c, to_c, corner_c = (sx, col, 1, 0) if right else (cols - sx, cols - 1 - col, -1, cols - 1)
        py, r, to_r, corner_r = (sy, row, cols, 0) if up else (rows - sy, rows - 1 - row, -cols, (rows - 1) * cols)
        along, beside, lane, place = (px, py, c, r) if flat else (py, px, r, c)
        to_lane, to_place, lanes, places = (to_c, to_r, cols, rows) if flat else (to_r, to_c, rows, cols)
        large, small = max(abs(ux), abs(uy)) / cell, min(abs(ux), abs(uy)) / cell
        # Ground beyond the map is omitted.
        end = min(rest, (lanes - EDGE - along) / large)
        if end * small > places - EDGE - beside:
            end = (places - EDGE - beside) / small
        first, slope = lane + 1 - along, small / large  # the beam leaves lane + k at the distance (first + k) / large
        leaves = beside + first * slope  # and its place there is `leaves` + k * slope
        line = corner_c + corner_r + lane * to_lane
        ahead = int(math.ceil(end * large - first))  # lanes that the beam leaves
        forward, sideways = (right, up) if flat else (up, right)
        k = 0
        while k <= ahead:
            at = lane + k if forward else lanes - 1 - lane - k
            square = k + (
                SQUARE - (at & (SQUARE - 1)) if forward else (at & (SQUARE - 1)) + 1
            )  # the lane where the next square begins
            if square <= ahead:
                then = int(leaves + (square - 1) * slope)
                begins, ends = (place, then) if sideways else (places - 1 - place, places - 1 - then)
                if all_free(at >> SHIFT, begins >> SHIFT, ends >> SHIFT, flat, unseen):
                    place, line, k = then, line + (square - k) * to_lane, square
                    continue
            for k in range(k, min(square, ahead + 1)):  # noqa: B020
                then = int(leaves + k * slope)
                if k == ahead:
                    then = place + 1 if place + 1 - beside < end * small else place
                if free[np.uint64(line + place * to_place)] & free[np.uint64(line + then * to_place)]:
                    place, line = then, line + to_lane
                    continue
                for p in range(place, then + 1):
                    at = line + p * to_place
                    if free[at]:
                        continue
                    c, r = (lane + k, p) if flat else (p, lane + k)
                    col, row = c if right else cols - 1 - c, r if up else rows - 1 - r
                    if not occupied[at]:
                        free[at] = True
                        unseen[row >> SHIFT, col >> SHIFT] -= 1
                        changed[count, 0], changed[count, 1] = row, col
                        count += 1
                    elif (first + k - 1) / large < rest and cells[slot[at], 3] != scan:
                        # Distances along the beam to the sides of the cell through which it may leave.
                        to_x = ((col + 1 - sx) if ux > 0.0 else (sx - col)) * cell / abs(ux) if ux != 0.0 else math.inf
                        to_y = ((row + 1 - sy) if uy > 0.0 else (sy - row)) * cell / abs(uy) if uy != 0.0 else math.inf
                        if min(to_x, to_y) + 0.5 * cell < rest:  # else the beam ends here or close behind
                            cells[slot[at], 3] = scan
                            crossed[crossings, 0], crossed[crossings, 1], crossed[crossings, 2] = row, col, i
                            crossings += 1
                place, line = then, line + to_lane
            k += 1
    return see_through(crossed[:crossings], scan, fan, m, changed, count)


@inline
def all_free(lane: int, first: int, last: int, flat: bool, unseen: Array) -> bool:
    """Return whether the squares `first` to `last`, at most three, of a lane of squares are free."""
    squares = unseen[:, lane] if flat else unseen[lane]
    return bool(squares[first] | squares[(first + last) >> 1] | squares[last] == 0)


@leaf
def see_through(crossed: Array, scan: int, fan: Fan, m: MapArrays, changed: Array, count: int) -> int:
    """Lower the log-odds of the grains of occupied cells whose hits the scan has passed on both sides.

    Grains that the scan has hit are unchanged. `crossed` has the row and column of each cell, and a beam that crosses it.
    """
    slot, odds, stamp, box = m.slot, m.odds, m.stamp, m.box
    eye, beams, ranges, closed, behind = fan.eye, fan.beams, fan.ranges, fan.closed, m.frame[2]
    for j in range(crossed.shape[0]):
        at = slot[crossed[j, 0], crossed[j, 1]]
        left, lowered = False, False
        for k in range(GRAINS * GRAINS):
            if odds[at, k] <= 0.0:
                continue
            if stamp[at, k] != scan:
                stamp[at, k] = scan
                dx = 0.5 * (box[at, k, 0] + box[at, k, 2]) - eye[0]
                dy = 0.5 * (box[at, k, 1] + box[at, k, 3]) - eye[1]
                if seen_beyond(dx, dy, behind, crossed[j, 2], eye, beams, ranges, closed):
                    odds[at, k] -= MISS
                    lowered = True
            if odds[at, k] > 0.0:
                left = True
            else:
                odds[at, k] = 0.0
        if lowered and not left:
            vacate(crossed[j, 0], crossed[j, 1], m)
            changed[count, 0], changed[count, 1] = crossed[j, 0], crossed[j, 1]
            count += 1
    return count


@leaf
def seen_beyond(
    dx: float, dy: float, behind: float, beam: int, eye: Array, beams: Array, ranges: Array, closed: bool
) -> bool:
    """Return whether both beams beside the middle of a grain's hits, at (dx, dy) from the lidar, end at least `behind` farther.

    A beam beside an obstacle says nothing about it: its neighbour on the other side has hit the obstacle. `beam` passes close by
    and starts the search for the two.
    """
    ahead, left = eye[2] * dx + eye[3] * dy, eye[2] * dy - eye[3] * dx
    count = ranges.shape[0]
    far2 = (math.sqrt(dx * dx + dy * dy) + behind) ** 2
    side = beams[beam, 0] * left - beams[beam, 1] * ahead
    step = 1 if side >= 0.0 else -1
    last = beam
    while True:  # all beams lie within half a turn of the middle
        other = last + step
        if closed:
            other %= count
        elif not 0 <= other < count:
            return False
        if (beams[other, 0] * left - beams[other, 1] * ahead) * step < 0.0:
            break
        last = other
    return bool(
        ranges[last] > 0.0 and ranges[other] > 0.0
        and ranges[last] * ranges[last] > far2 and ranges[other] * ranges[other] > far2
    )  # fmt: skip


@kernel
def see_far(
    x: float, y: float, cos: float, sin: float, beams: Array, ranges: Array, closed: bool, trust: float, scan: int,
    arrays: tuple[Array, ...], changed: Array, count: int,
) -> int:  # fmt: skip
    """Lower the log-odds of hits beyond `trust` that the scan has passed on both sides, as `see_through` does nearer.

    Cells without hits become unknown, since beams are too far apart there to observe free ground. Rows of `changed` follow
    `count`; return their new number.
    """
    fan, m = Fan((x, y, cos, sin), beams, ranges, closed), MapArrays(*arrays)
    cell, number = m.frame[2], beams.shape[0]
    first = math.atan2(beams[0, 1], beams[0, 0])
    spacing = (math.atan2(beams[1, 1], beams[1, 0]) - first) % (2.0 * math.pi)
    crossed, crossings = np.empty((m.count[0], 3), dtype=np.int32), 0
    for i in range(m.count[0]):
        dx, dy = m.frame[0] + (m.cells[i, 1] + 0.5) * cell - x, m.frame[1] + (m.cells[i, 0] + 0.5) * cell - y
        if dx * dx + dy * dy <= trust * trust or m.cells[i, 3] == scan:
            continue
        angle = math.atan2(cos * dy - sin * dx, cos * dx + sin * dy)
        beam = int(round((angle - first) % (2.0 * math.pi) / spacing))
        if beam >= number and not closed:
            continue
        m.cells[i, 3] = scan
        crossed[crossings, 0], crossed[crossings, 1], crossed[crossings, 2] = (
            m.cells[i, 0],
            m.cells[i, 1],
            beam % number,
        )
        crossings += 1
    after = see_through(crossed[:crossings], scan, fan, m, changed, count)
    for j in range(count, after):
        row, col = changed[j, 0], changed[j, 1]
        m.free[row, col] = False
        m.unseen[row >> SHIFT, col >> SHIFT] += 1
    return after


@leaf
def vacate(row: int, col: int, m: MapArrays) -> None:
    """Remove an occupied cell from the list; it becomes free ground."""
    m.occupied[row, col], m.free[row, col] = False, True
    m.unseen[row >> SHIFT, col >> SHIFT] -= 1
    m.count[0] -= 1
    last, gap = m.count[0], m.slot[row, col]
    if gap == last:
        return
    m.slot[m.cells[last, 0], m.cells[last, 1]] = gap
    for k in range(4):
        m.cells[gap, k] = m.cells[last, k]
    for k in range(GRAINS * GRAINS):
        m.odds[gap, k], m.stamp[gap, k] = m.odds[last, k], m.stamp[last, k]
        for side in range(4):
            m.box[gap, k, side] = m.box[last, k, side]


@leaf
def take_as_free(
    x: float, y: float, radius: float, discs: Array, walls: Array, arrays: tuple[Array, ...], changed: Array
) -> int:
    """Free the unknown cells that meet a disc, except those that meet one of `discs` (N, 3) or reach beyond `walls`.

    `walls` are x_min, y_min, x_max, y_max. Return the number of rows written to `changed`.
    """
    m = MapArrays(*arrays)
    cell = m.frame[2]
    rows, cols = m.free.shape
    count = 0
    low, high = int(math.floor((y - radius - m.frame[1]) / cell)), int(math.floor((y + radius - m.frame[1]) / cell))
    for row in range(max(0, low), min(rows - 1, high) + 1):
        first = int(math.floor((x - radius - m.frame[0]) / cell))
        last = int(math.floor((x + radius - m.frame[0]) / cell))
        for col in range(max(0, first), min(cols - 1, last) + 1):
            west, south = m.frame[0] + col * cell, m.frame[1] + row * cell
            known = m.free[row, col] or m.occupied[row, col]
            if known or not square_meets(west, south, cell, x, y, radius):
                continue
            blocked = west < walls[0] or south < walls[1] or west + cell > walls[2] or south + cell > walls[3]
            for k in range(discs.shape[0]):
                blocked = blocked or square_meets(west, south, cell, discs[k, 0], discs[k, 1], discs[k, 2])
            if not blocked:
                m.free[row, col] = True
                m.unseen[row >> SHIFT, col >> SHIFT] -= 1
                changed[count, 0], changed[count, 1] = row, col
                count += 1
    return count


@kernel
def square_meets(west: float, south: float, side: float, x: float, y: float, radius: float) -> bool:
    """Return whether a square, given by its lower left corner, meets a disc."""
    dx = max(max(west - x, x - west - side), 0.0)
    dy = max(max(south - y, y - south - side), 0.0)
    return bool(dx * dx + dy * dy <= radius * radius)


@kernel
def discs_within(x_min: float, y_min: float, x_max: float, y_max: float, arrays: tuple[Array, ...]) -> Array:
    """Return a disc (x, y, radius) around the hits of every grain whose cell meets a rectangle (D, 3) [m]."""
    m = MapArrays(*arrays)
    cells, odds, box, cell = m.cells, m.odds, m.box, m.frame[2]
    rows, cols = m.free.shape
    col_low, col_high = meeting(x_min, x_max, m.frame[0], cell, cols)
    row_low, row_high = meeting(y_min, y_max, m.frame[1], cell, rows)
    met = np.empty(m.count[0], dtype=np.int32)
    near, count = 0, 0
    for i in range(m.count[0]):
        met[near] = i
        within = (row_low <= cells[i, 0]) & (cells[i, 0] <= row_high)
        near += within & (col_low <= cells[i, 1]) & (cells[i, 1] <= col_high)
    for j in range(near):
        for k in range(GRAINS * GRAINS):
            count += 1 if odds[met[j], k] > 0.0 else 0
    out = np.empty((count, 3))
    count = 0
    for j in range(near):
        i = met[j]
        for k in range(GRAINS * GRAINS):
            if odds[i, k] > 0.0:
                out[count, 0], out[count, 1], out[count, 2] = grain_disc(box, i, k)
                count += 1
    return out


@kernel
def meeting(low: float, high: float, begin: float, cell: float, count: int) -> tuple[int, int]:
    """Return the first and the last of `count` cells in a row from `begin` on that meet an interval."""
    last = int(min(max((high - begin) / cell, -1.0), count * 1.0))
    while last < count - 1 and begin + (last + 1) * cell <= high:
        last += 1
    while last >= 0 and begin + last * cell > high:
        last -= 1
    first = int(min(max((low - begin) / cell, 0.0), count * 1.0))
    while first > 0 and begin + (first - 1) * cell + cell >= low:
        first -= 1
    while first < count and begin + first * cell + cell < low:
        first += 1
    return first, last


@leaf
def grain_disc(box: Array, at: int, k: int) -> tuple[float, float, float]:
    """Return the disc around the hits of a grain: x, y, radius [m]."""
    x_min, y_min = np.float64(box[at, k, 0]), np.float64(box[at, k, 1])
    x_max, y_max = np.float64(box[at, k, 2]), np.float64(box[at, k, 3])
    wide, high = x_max - x_min, y_max - y_min
    radius = max(0.5 * math.sqrt(wide * wide + high * high), THINNEST) + SLACK
    return 0.5 * (x_min + x_max), 0.5 * (y_min + y_max), radius


@leaf
def explained(points: Array, scan: int, settle: int, arrays: tuple[Array, ...], out: Array) -> None:
    """Set out[i] to whether point i lies in or beside a cell that is occupied for `settle` scans, or was never free.

    Points outside the map and on unknown ground count as explained.
    """
    m = MapArrays(*arrays)
    cell = m.frame[2]
    rows, cols = m.free.shape
    for i in range(points.shape[0]):
        row = int(math.floor((points[i, 1] - m.frame[1]) / cell))
        col = int(math.floor((points[i, 0] - m.frame[0]) / cell))
        if not (0 <= row < rows and 0 <= col < cols):
            out[i] = True
            continue
        out[i] = not m.free[row, col] and not m.occupied[row, col]
        for r in range(max(0, row - 1), min(rows, row + 2)):
            for c in range(max(0, col - 1), min(cols, col + 2)):
                if m.occupied[r, c]:
                    turned = m.cells[m.slot[r, c], 2]
                    out[i] = out[i] or turned == 0 or scan - turned >= settle
