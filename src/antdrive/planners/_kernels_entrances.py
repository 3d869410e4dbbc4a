"""Compiled leads from a start pose to the nodes of a grid with turns."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, kernel
from antdrive.worlds.headings._kernels_headings import TURN, sweep_clearance, turn_clear

STEP = math.pi / 4  # between the headings of a grid [rad]


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
