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
        stamp: the scan in which a grain was last hit or seen through
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
        eye: the lidar's pose: x, y, yaw (3,)
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
    ranges, beams = fan.ranges, fan.beams
    x, y, cos, sin = fan.eye[0], fan.eye[1], math.cos(fan.eye[2]), math.sin(fan.eye[2])
    count = 0
    for i in range(beams.shape[0]):
        if left_out[i] or not 0.0 < ranges[i] <= horizon:
            continue
        px = x + ranges[i] * (cos * beams[i, 0] - sin * beams[i, 1])
        py = y + ranges[i] * (sin * beams[i, 0] + cos * beams[i, 1])
        count = hit(px, py, scan, m, changed, count)
    for i in range(scan % share, beams.shape[0], share):
        length = min(ranges[i], trust)  # inf: nothing there; -inf: something too near to be measured
        if length > begin[i]:
            ux, uy = cos * beams[i, 0] - sin * beams[i, 1], sin * beams[i, 0] + cos * beams[i, 1]
            count = pass_through(ux, uy, begin[i], length, scan, fan, m, changed, count)
    return count


@kernel
def hit(px: float, py: float, scan: int, m: MapArrays, changed: Array, count: int) -> int:
    """Enter a measured point."""
    fine = m.frame[2] / GRAINS
    r, c = int(math.floor((py - m.frame[1]) / fine)), int(math.floor((px - m.frame[0]) / fine))
    if not (0 <= r < m.odds.shape[0] and 0 <= c < m.odds.shape[1]):
        return count
    box = m.box[r, c]
    if m.odds[r, c] > 0.0:
        box[0], box[1] = min(box[0], np.float32(px)), min(box[1], np.float32(py))
        box[2], box[3] = max(box[2], np.float32(px)), max(box[3], np.float32(py))
    else:
        box[0], box[1], box[2], box[3] = px, py, px, py
    if m.stamp[r, c] != scan:
        m.stamp[r, c] = scan
        m.odds[r, c] = min(MOST, m.odds[r, c] + HIT)
    row, col = r // GRAINS, c // GRAINS
    if not m.occupied[row, col]:
        m.turned[row, col] = scan if m.free[row, col] else 0
        m.free[row, col] = False
        m.occupied[row, col] = True
        m.slot[row, col] = m.count[0]
        m.cells[m.count[0], 0], m.cells[m.count[0], 1] = row, col
        m.count[0] += 1
        changed[count, 0], changed[count, 1] = row, col
        count += 1
    return count


@kernel
def pass_through(
    ux: float, uy: float, begin: float, length: float, scan: int, fan: Fan, m: MapArrays, changed: Array, count: int
) -> int:
    """Enter a beam's free way, from `begin` to `length` (Amanatides & Woo 1987)."""
    cell = m.frame[2]
    rows, cols = m.free.shape
    x, y = fan.eye[0], fan.eye[1]
    sx, sy = (x + begin * ux - m.frame[0]) / cell, (y + begin * uy - m.frame[1]) / cell
    row, col = int(math.floor(sy)), int(math.floor(sx))
    step_x, step_y = 1 if ux > 0.0 else -1, 1 if uy > 0.0 else -1
    # Distances along the beam, from its begin, to the next sides of cells.
    each_x = cell / abs(ux) if ux != 0.0 else math.inf
    each_y = cell / abs(uy) if uy != 0.0 else math.inf
    next_x = ((col + 1 - sx) if ux > 0.0 else (sx - col)) * each_x if ux != 0.0 else math.inf
    next_y = ((row + 1 - sy) if uy > 0.0 else (sy - row)) * each_y if uy != 0.0 else math.inf
    rest = length - begin
    while 0 <= row < rows and 0 <= col < cols:
        if not m.free[row, col]:
            if m.occupied[row, col]:
                if min(next_x, next_y) + 0.5 * cell < rest:  # else the beam ends here or close behind
                    count = see_through(row, col, scan, fan, m, changed, count)
            else:
                m.free[row, col] = True
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
def see_through(row: int, col: int, scan: int, fan: Fan, m: MapArrays, changed: Array, count: int) -> int:
    """Lower the log-odds of those grains of an occupied cell whose hits the scan has passed by on both sides."""
    left = False
    lowered = False
    for r in range(GRAINS * row, GRAINS * row + GRAINS):
        for c in range(GRAINS * col, GRAINS * col + GRAINS):
            if m.odds[r, c] <= 0.0:
                continue
            if m.stamp[r, c] != scan and seen_beyond(m.box[r, c], m.frame[2], fan):
                m.stamp[r, c] = scan
                m.odds[r, c] -= MISS
                lowered = True
            if m.odds[r, c] > 0.0:
                left = True
            else:
                m.odds[r, c] = 0.0
    if lowered and not left:
        vacate(row, col, m)
        m.free[row, col] = True
        changed[count, 0], changed[count, 1] = row, col
        count += 1
    return count


@kernel
def seen_beyond(box: Array, behind: float, fan: Fan) -> bool:
    """Whether both beams beside the middle of a box of hits end at least `behind` farther away.

    A beam that passes beside an obstacle says nothing about it: its neighbour on the other side has met the obstacle.
    """
    dx, dy = 0.5 * (box[0] + box[2]) - fan.eye[0], 0.5 * (box[1] + box[3]) - fan.eye[1]
    cos, sin = math.cos(fan.eye[2]), math.sin(fan.eye[2])
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
    """Take an occupied cell off the list; it is then unknown."""
    m.occupied[row, col] = False
    m.count[0] -= 1
    last, gap = m.count[0], m.slot[row, col]
    other_row, other_col = m.cells[last, 0], m.cells[last, 1]
    m.cells[gap, 0], m.cells[gap, 1] = other_row, other_col
    m.slot[other_row, other_col] = gap


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
        m.free[row, col] = True
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
def discs_of(m: MapArrays) -> Array:
    """A disc (x, y, radius) around the hits of every grain (D, 3) [m]."""
    out = np.empty((m.count[0] * GRAINS * GRAINS, 3))
    count = 0
    for i in range(m.count[0]):
        row, col = m.cells[i, 0], m.cells[i, 1]
        for r in range(GRAINS * row, GRAINS * row + GRAINS):
            for c in range(GRAINS * col, GRAINS * col + GRAINS):
                if m.odds[r, c] > 0.0:
                    out[count, 0], out[count, 1], out[count, 2] = grain_disc(m.box[r, c])
                    count += 1
    return out[:count].copy()


@kernel
def grain_disc(box: Array) -> tuple[float, float, float]:
    """The disc around a box of hits: x, y, radius [m]."""
    x, y = 0.5 * (np.float64(box[0]) + box[2]), 0.5 * (np.float64(box[1]) + box[3])
    return x, y, max(0.5 * math.hypot(np.float64(box[2]) - box[0], np.float64(box[3]) - box[1]), THINNEST) + SLACK


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
