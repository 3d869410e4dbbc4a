"""Compiled occupancy map: scans go in, discs come out. Arrays in, arrays out, nothing validated.

Ground is seen free in cells. Hits are kept finer, in grains (GRAINS by GRAINS to a cell), each with its log-odds and with the
box around the points that were measured in it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.worlds._kernels import Array, kernel

GRAINS = 2
HIT, MISS, MOST = 0.85, 0.4, 3.5  # steps of the log-odds and their upper limit (Hornung et al. 2013, section 4)
SLACK = 1e-4  # added to the radius of discs; boxes are kept in single precision [m]
THINNEST = 0.005  # the least radius of a disc [m]


class MapArrays(NamedTuple):
    """The state of a map with R rows and C columns of cells.

    Attributes:
        free: which cells were seen free (R, C)
        occupied: which cells hold hits (R, C); no cell is both
        turned: the scan in which a cell that had been seen free became occupied (R, C); 0: it had not been seen before
        slot: the row of an occupied cell in `cells` (R, C)
        cells: the occupied cells (row, col), without order; the first `count[0]` rows count
        count: the number of occupied cells (1,)
        odds: log-odds of each grain (GRAINS R, GRAINS C); 0: nothing was hit there
        stamp: the scan that a grain was last hit in, or looked at: whether it is seen through
        box: the least x and y and the largest x and y of a grain's hits (GRAINS R, GRAINS C, 4) [m]
        frame: x and y of the lower left corner, and a cell's side (3,) [m]
    """

    free: Array
    occupied: Array
    turned: Array
    slot: Array
    cells: Array
    count: Array
    odds: Array
    stamp: Array
    box: Array
    frame: Array


class Fan(NamedTuple):
    """A scan as it lies in the map.

    Attributes:
        eye: where the lidar is: x, y, and the cosine and sine of its yaw (4,)
        beams: directions of the beams, seen from the lidar (B, 2)
        ranges: what they measured (B,) [m]
        first: the angle of the first beam [rad]
        spacing: the angle between two beams [rad]
        closed: whether the first beam is beside the last
    """

    eye: Array
    beams: Array
    ranges: Array
    first: float
    spacing: float
    closed: bool


@kernel
def begins(beams: int, spacing: float, cell: float, share: int, out: Array) -> None:
    """out[i] = the distance from which on beam i is needed to leave no cell out [m], when every `share`-th is entered.

    Near the lidar every second, fourth, ... beam crosses all cells that others cross.
    """
    for i in range(beams):
        step, number = 2 * share, i // share
        while number and number % 2 == 0:
            step, number = step * 2, number // 2
        out[i] = cell / (step * spacing) if number else 0.0


@kernel
def insert(
    fan: Fan, begin: Array, share: int, left_out: Array, horizon: float, trust: float, scan: int, m: MapArrays,
    changed: Array,
) -> int:  # fmt: skip
    """Enter a scan, of every `share`-th beam its free way too; the number of rows (row, col) written to `changed`.

    Hits farther than `horizon` are not entered, nor those of beams in `left_out`; ground is seen free up to `trust`.
    """
    count = enter_hits(fan, left_out, horizon, scan, m, changed)
    return enter_ways(fan, begin, share, trust, scan, m, changed, count)


@kernel
def enter_hits(fan: Fan, left_out: Array, horizon: float, scan: int, m: MapArrays, changed: Array) -> int:
    """Enter the measured points."""
    ranges, beams, x, y, cos, sin = fan.ranges, fan.beams, fan.eye[0], fan.eye[1], fan.eye[2], fan.eye[3]
    odds, stamp, box, occupied, left, low = m.odds, m.stamp, m.box, m.occupied, m.frame[0], m.frame[1]
    fine, fine_rows, fine_cols = m.frame[2] / GRAINS, m.odds.shape[0], m.odds.shape[1]
    count = 0
    for i in range(beams.shape[0]):
        if left_out[i] or not 0.0 < ranges[i] <= horizon:
            continue
        px = x + ranges[i] * (cos * beams[i, 0] - sin * beams[i, 1])
        py = y + ranges[i] * (sin * beams[i, 0] + cos * beams[i, 1])
        r, c = int(math.floor((py - low) / fine)), int(math.floor((px - left) / fine))
        if not (0 <= r < fine_rows and 0 <= c < fine_cols):
            continue
        qx, qy = np.float32(px), np.float32(py)
        if odds[r, c] > 0.0:
            box[r, c, 0], box[r, c, 1] = min(box[r, c, 0], qx), min(box[r, c, 1], qy)
            box[r, c, 2], box[r, c, 3] = max(box[r, c, 2], qx), max(box[r, c, 3], qy)
        else:
            box[r, c, 0], box[r, c, 1], box[r, c, 2], box[r, c, 3] = qx, qy, qx, qy
        if stamp[r, c] != scan:
            stamp[r, c] = scan
            odds[r, c] = min(MOST, odds[r, c] + HIT)
        row, col = r // GRAINS, c // GRAINS
        if not occupied[row, col]:
            m.turned[row, col] = scan if m.free[row, col] else 0
            m.free[row, col] = False
            occupied[row, col] = True
            m.slot[row, col] = m.count[0]
            m.cells[m.count[0], 0], m.cells[m.count[0], 1] = row, col
            m.count[0] += 1
            changed[count, 0], changed[count, 1] = row, col
            count += 1
    return count


@kernel
def enter_ways(
    fan: Fan, begin: Array, share: int, trust: float, scan: int, m: MapArrays, changed: Array, count: int
) -> int:
    """Enter the free ways of every `share`-th beam, each from its `begin` on (Amanatides & Woo 1987)."""
    ranges, beams, x, y, cos, sin = fan.ranges, fan.beams, fan.eye[0], fan.eye[1], fan.eye[2], fan.eye[3]
    free, occupied, left, low, cell = m.free, m.occupied, m.frame[0], m.frame[1], m.frame[2]
    odds, stamp = m.odds, m.stamp
    rows, cols = free.shape
    for i in range(scan % share, beams.shape[0], share):
        rest = min(ranges[i], trust) - begin[i]  # inf: nothing there; -inf: something too near to be measured
        if not rest > 0.0:
            continue
        ux, uy = cos * beams[i, 0] - sin * beams[i, 1], sin * beams[i, 0] + cos * beams[i, 1]
        sx, sy = (x + begin[i] * ux - left) / cell, (y + begin[i] * uy - low) / cell
        row, col = int(math.floor(sy)), int(math.floor(sx))
        step_x, step_y = 1 if ux > 0.0 else -1, 1 if uy > 0.0 else -1
        # Distances along the beam, from its begin, to the next sides of cells.
        each_x = cell / abs(ux) if ux != 0.0 else math.inf
        each_y = cell / abs(uy) if uy != 0.0 else math.inf
        next_x = ((col + 1 - sx) if ux > 0.0 else (sx - col)) * each_x if ux != 0.0 else math.inf
        next_y = ((row + 1 - sy) if uy > 0.0 else (sy - row)) * each_y if uy != 0.0 else math.inf
        while 0 <= row < rows and 0 <= col < cols:
            if not free[row, col]:
                if occupied[row, col]:
                    # Else the beam ends here or close behind, or the scan has been here.
                    if min(next_x, next_y) + 0.5 * cell < rest and unread(odds, stamp, row, col, scan):
                        count = see_through(row, col, scan, fan, m, changed, count)
                else:
                    free[row, col] = True
                    changed[count, 0], changed[count, 1] = row, col
                    count += 1
            if next_x < next_y:
                if next_x >= rest:
                    break
                next_x += each_x
                col += step_x
            else:
                if next_y >= rest:
                    break
                next_y += each_y
                row += step_y
    return count


@kernel
def unread(odds: Array, stamp: Array, row: int, col: int, scan: int) -> bool:
    """Whether a cell holds hits that a scan has neither met nor been compared with."""
    for r in range(GRAINS * row, GRAINS * row + GRAINS):
        for c in range(GRAINS * col, GRAINS * col + GRAINS):
            if odds[r, c] > 0.0 and stamp[r, c] != scan:
                return True
    return False


@kernel
def see_through(row: int, col: int, scan: int, fan: Fan, m: MapArrays, changed: Array, count: int) -> int:
    """Lower the log-odds of those grains of an occupied cell whose hits the scan has passed by on both sides."""
    odds, stamp = m.odds, m.stamp
    left = False
    lowered = False
    for r in range(GRAINS * row, GRAINS * row + GRAINS):
        for c in range(GRAINS * col, GRAINS * col + GRAINS):
            if odds[r, c] <= 0.0:
                continue
            if stamp[r, c] != scan:
                stamp[r, c] = scan
                if seen_beyond(m.box, r, c, m.frame[2], fan):
                    odds[r, c] -= MISS
                    lowered = True
            if odds[r, c] > 0.0:
                left = True
            else:
                odds[r, c] = 0.0
    if lowered and not left:
        vacate(row, col, m)
        changed[count, 0], changed[count, 1] = row, col
        count += 1
    return count


@kernel
def seen_beyond(box: Array, r: int, c: int, behind: float, fan: Fan) -> bool:
    """Whether both beams beside the middle of a grain's hits end at least `behind` farther away.

    A beam that passes beside an obstacle says nothing about it: its neighbour on the other side has met the obstacle.
    """
    dx, dy = 0.5 * (box[r, c, 0] + box[r, c, 2]) - fan.eye[0], 0.5 * (box[r, c, 1] + box[r, c, 3]) - fan.eye[1]
    cos, sin = fan.eye[2], fan.eye[3]
    place = (math.atan2(cos * dy - sin * dx, cos * dx + sin * dy) - fan.first) / fan.spacing
    low, beams = int(math.floor(place)), fan.ranges.shape[0]
    high = low + 1
    if fan.closed:
        low, high = low % beams, high % beams
    if low < 0 or high >= beams:
        return False
    far = math.hypot(dx, dy) + behind
    return bool(fan.ranges[low] > far and fan.ranges[high] > far)


@kernel
def vacate(row: int, col: int, m: MapArrays) -> None:
    """Take an occupied cell off the list; it is then free ground."""
    m.occupied[row, col], m.free[row, col] = False, True
    m.count[0] -= 1
    last, gap = m.count[0], m.slot[row, col]
    other_row, other_col = m.cells[last, 0], m.cells[last, 1]
    m.cells[gap, 0], m.cells[gap, 1] = other_row, other_col
    m.slot[other_row, other_col] = gap


@kernel
def move_hits(old: MapArrays, m: MapArrays, rows: int, cols: int) -> None:
    """Enter the occupied cells of a map in a larger one without hits, in which they lie so many rows and columns farther."""
    m.count[0] = old.count[0]
    for i in range(old.count[0]):
        old_row, old_col = old.cells[i, 0], old.cells[i, 1]
        row, col = old_row + rows, old_col + cols
        m.cells[i, 0], m.cells[i, 1] = row, col
        m.slot[row, col], m.turned[row, col], m.occupied[row, col] = i, old.turned[old_row, old_col], True
        for r in range(GRAINS):
            for c in range(GRAINS):
                grain, place = (GRAINS * row + r, GRAINS * col + c), (GRAINS * old_row + r, GRAINS * old_col + c)
                m.odds[grain], m.stamp[grain] = old.odds[place], old.stamp[place]
                for k in range(4):
                    m.box[grain[0], grain[1], k] = old.box[place[0], place[1], k]


@kernel
def forget(x: float, y: float, radius: float, m: MapArrays, changed: Array) -> int:
    """Make the occupied cells whose hits all lie within `radius` of (x, y) free again; the rows written to `changed`."""
    count = 0
    i = 0
    while i < m.count[0]:
        row, col = m.cells[i, 0], m.cells[i, 1]
        outside = False
        for r in range(GRAINS * row, GRAINS * row + GRAINS):
            for c in range(GRAINS * col, GRAINS * col + GRAINS):
                if m.odds[r, c] > 0.0:
                    box = m.box[r, c]
                    dx, dy = 0.5 * (box[0] + box[2]) - x, 0.5 * (box[1] + box[3]) - y
                    outside = outside or math.hypot(dx, dy) > radius
        if outside:
            i += 1
            continue
        for r in range(GRAINS * row, GRAINS * row + GRAINS):
            for c in range(GRAINS * col, GRAINS * col + GRAINS):
                m.odds[r, c] = 0.0
        vacate(row, col, m)
        changed[count, 0], changed[count, 1] = row, col
        count += 1
    return count


@kernel
def take_as_free(x: float, y: float, radius: float, m: MapArrays, changed: Array) -> int:
    """Make the unknown cells whose squares meet a disc free; the rows written to `changed`."""
    cell = m.frame[2]
    rows, cols = m.free.shape
    count = 0
    low, high = int(math.floor((y - radius - m.frame[1]) / cell)), int(math.floor((y + radius - m.frame[1]) / cell))
    for row in range(max(0, low), min(rows - 1, high) + 1):
        first = int(math.floor((x - radius - m.frame[0]) / cell))
        last = int(math.floor((x + radius - m.frame[0]) / cell))
        for col in range(max(0, first), min(cols - 1, last) + 1):
            west, south = m.frame[0] + col * cell, m.frame[1] + row * cell
            dx = max(max(west - x, x - west - cell), 0.0)
            dy = max(max(south - y, y - south - cell), 0.0)
            if dx * dx + dy * dy <= radius * radius and not m.free[row, col] and not m.occupied[row, col]:
                m.free[row, col] = True
                changed[count, 0], changed[count, 1] = row, col
                count += 1
    return count


@kernel
def discs_within(m: MapArrays, x_min: float, y_min: float, x_max: float, y_max: float) -> Array:
    """A disc (x, y, radius) around the hits of every grain whose cell meets a rectangle (D, 3) [m]."""
    cells, odds, box, left, low, cell = m.cells, m.odds, m.box, m.frame[0], m.frame[1], m.frame[2]
    out = np.empty((m.count[0] * GRAINS * GRAINS, 3))
    count = 0
    for i in range(m.count[0]):
        row, col = cells[i, 0], cells[i, 1]
        x, y = left + col * cell, low + row * cell
        if x > x_max or y > y_max or x + cell < x_min or y + cell < y_min:
            continue
        for r in range(GRAINS * row, GRAINS * row + GRAINS):
            for c in range(GRAINS * col, GRAINS * col + GRAINS):
                if odds[r, c] > 0.0:
                    out[count, 0], out[count, 1], out[count, 2] = grain_disc(box, r, c)
                    count += 1
    return out[:count].copy()


@kernel
def grain_disc(box: Array, r: int, c: int) -> tuple[float, float, float]:
    """The disc around the hits of a grain: x, y, radius [m]."""
    x_min, y_min, x_max, y_max = box[r, c, 0], box[r, c, 1], box[r, c, 2], box[r, c, 3]
    x, y = 0.5 * (np.float64(x_min) + x_max), 0.5 * (np.float64(y_min) + y_max)
    return x, y, max(0.5 * math.hypot(np.float64(x_max) - x_min, np.float64(y_max) - y_min), THINNEST) + SLACK


@kernel
def explained(points: Array, scan: int, settle: int, m: MapArrays, out: Array) -> None:
    """out[i] = whether point i lies in or beside a cell that has been occupied for `settle` scans, or was never seen free.

    A point outside the map is explained; so is one in ground that was never seen.
    """
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
                old = m.turned[r, c] == 0 or scan - m.turned[r, c] >= settle
                out[i] = out[i] or (m.occupied[r, c] and old)
