"""Compiled leads between the ends of a task and the cells of a grid, or the nodes of a grid with turns."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, boxes_around, clearance_up_to, kernel, point_clearances
from antdrive.worlds.headings._kernels_headings import TURN, sweep_clearance, turn_clear

STEP = math.pi / 4  # between the headings of a grid [rad]
FEW = 8  # nearest cells that are tried before all are sorted


@kernel
def entrances(
    free: Array, x0: float, y0: float, cell: float, inflate: float, reach: int, ends: Array, tolerance: float,
    discs: Array, bounds: Array,
) -> Array:  # fmt: skip
    """Return (row, col, 1) of the nearest free cell with a clear straight line to each end, else (row, col, 0) of the end (2, 3).

    Cells are up to `reach` rows and columns from an end. From an end within the inflation of a disc, the line must not come
    closer to a disc than the end; the cell of such a goal, the second end, is also within `tolerance` of it.
    """
    rows, cols = free.shape
    out, own, boxes = np.empty((2, 3), dtype=np.int64), np.empty(2), boxes_around(discs)
    point_clearances(ends, discs, bounds, own)
    for end in range(2):
        x, y = ends[end, 0], ends[end, 1]
        row = min(max(int(math.floor((y - y0) / cell + 0.5)), 0), rows - 1)
        col = min(max(int(math.floor((x - x0) / cell + 0.5)), 0), cols - 1)
        out[end, 0], out[end, 1], out[end, 2] = row, col, 0
        top, left = max(0, row - reach), max(0, col - reach)
        high, wide = min(rows, row + reach + 1) - top, min(cols, col + reach + 1) - left
        near = np.full(high * wide, math.inf)  # distances of its cells
        within = tolerance if end == 1 and own[1] < inflate else math.inf
        for k in range(near.shape[0]):
            r, c = top + k // wide, left + k % wide
            if free[r, c]:
                away = math.hypot(c * cell + x0 - x, r * cell + y0 - y)
                near[k] = away if away <= within else math.inf
        order = np.empty(0, dtype=np.int64)
        for n in range(near.shape[0]):
            if n == FEW:
                order = np.argsort(near, kind="mergesort")
            at = order[n - FEW] if n >= FEW else np.argmin(near)
            if near[at] == math.inf:
                break
            near[at] = math.inf
            r, c = top + at // wide, left + at % wide
            to_x, to_y = c * cell + x0, r * cell + y0
            if clearance_up_to(math.inf, to_x, to_y, x, y, discs, boxes, bounds) >= min(inflate, own[end]) - 1e-9:
                out[end, 0], out[end, 1], out[end, 2] = r, c, 1
                break
    return out


@kernel
def clear_turn(
    x: float, y: float, yaw: float, heading: float, corners: Array, reach: float, discs: Array, bounds: Array
) -> float:
    """Return the shortest clear turn on the spot to a heading; NaN if neither way round is clear."""
    short = (heading - yaw + math.pi) % TURN - math.pi
    if turn_clear(x, y, yaw, short, corners, reach, discs, bounds):
        return short
    other = short - math.copysign(TURN, short)
    return other if turn_clear(x, y, yaw, other, corners, reach, discs, bounds) else math.nan


@kernel
def lead_heading(
    x: float, y: float, yaw: float, to_x: float, to_y: float, backwards: bool,
    corners: Array, reach: float, discs: Array, bounds: Array,
) -> float:  # fmt: skip
    """Return the heading of a straight lead to a point; NaN if it or the turn to it is not clear."""
    dx, dy = to_x - x, to_y - y
    if math.hypot(dx, dy) < 1e-6:
        return yaw
    heading = math.atan2(-dy, -dx) if backwards else math.atan2(dy, dx)
    if sweep_clearance(x, y, to_x, to_y, heading, corners, reach, discs, bounds) <= 0.0:
        return math.nan
    return heading if math.isfinite(clear_turn(x, y, yaw, heading, corners, reach, discs, bounds)) else math.nan


@kernel
def first_entrance(
    x: float, y: float, yaw: float, centres: Array, labels: Array, goals: Array, backwards: bool,
    corners: Array, reach: float, discs: Array, bounds: Array,
) -> int:  # fmt: skip
    """Return the first node that a clear lead enters and from which moves lead to a goal; -1 if there is none.

    `centres` (C, 2) and `labels` (C, 8) are those of cells in the order of preference, `goals` (N,) the result of `leads_to`.
    """
    for i in range(len(centres)):
        to_x, to_y = centres[i]
        heading = lead_heading(x, y, yaw, to_x, to_y, backwards, corners, reach, discs, bounds)
        if math.isnan(heading):
            continue
        for side in (math.floor(heading / STEP), math.ceil(heading / STEP)):
            node = np.int64(labels[i, side % 8])
            turn = side * STEP - heading
            if node >= 0 and goals[node] >= 0 and turn_clear(to_x, to_y, heading, turn, corners, reach, discs, bounds):
                return int(node)
    return -1
