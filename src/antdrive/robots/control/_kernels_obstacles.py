"""Compiled obstacle queries: obstacles near a point, and clearances of arcs and turns."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.worlds._kernels import (
    ROUNDING,
    Array,
    inline,
    kernel,
    leaf,
    order_by,
    polygon_distance,
    polygon_wall_distance,
    segment_clearance,
    segment_distance2,
    wall_distance,
)

HALF_CIRCLE = 3.0  # arcs that turn by less are shorter than half a circle [rad]
BESIDE = 1e-6  # slack for rounding of directions beside an arc, as a fraction of the squared radius


class ObstacleIndex(NamedTuple):
    """The obstacles known to the controller, indexed by the squares of a coarse grid.

    Attributes:
        discs: x, y and radius of the discs near each square, square by square, nearest to its centre first (K, 3) [m]
        starts: the row of `discs` at which each square's discs start (squares + 1,)
        bounds: the walls: x_min, y_min, x_max, y_max (4,) [m]
        corner: the lower left corner of the squares (2,) [m]
        side: side of a square [m]
    """

    discs: Array
    starts: Array
    bounds: Array
    corner: Array
    side: float


@kernel
def index_discs(discs: Array, bounds: Array, side: float, distance: float) -> tuple[Array, Array]:
    """Return the discs within `distance` of each square, as `discs` and `starts` of an ObstacleIndex."""
    cols = int((bounds[2] - bounds[0]) / side) + 1
    rows = int((bounds[3] - bounds[1]) / side) + 1
    starts = np.zeros(rows * cols + 1, np.int64)
    found, fill = np.empty((0, 3)), starts
    for filling in range(2):  # first count the discs of each square, then fill them in
        for j in range(discs.shape[0]):
            reach = distance + discs[j, 2] + 0.01 * side  # with slack for rounding
            c_low = max(0, int(math.floor((discs[j, 0] - reach - bounds[0]) / side)))
            c_high = min(cols - 1, int(math.floor((discs[j, 0] + reach - bounds[0]) / side)))
            r_low = max(0, int(math.floor((discs[j, 1] - reach - bounds[1]) / side)))
            r_high = min(rows - 1, int(math.floor((discs[j, 1] + reach - bounds[1]) / side)))
            for r in range(r_low, r_high + 1):
                for c in range(c_low, c_high + 1):
                    x_min, y_min = bounds[0] + c * side, bounds[1] + r * side
                    dx = max(max(x_min - discs[j, 0], discs[j, 0] - x_min - side), 0.0)
                    dy = max(max(y_min - discs[j, 1], discs[j, 1] - y_min - side), 0.0)
                    if math.hypot(dx, dy) - discs[j, 2] <= distance:
                        b = r * cols + c
                        if filling:
                            for k in range(3):
                                found[fill[b], k] = discs[j, k]
                            fill[b] += 1
                        else:
                            starts[b + 1] += 1
        if not filling:
            for b in range(len(starts) - 1):
                starts[b + 1] += starts[b]
            fill = starts.copy()
            found = np.empty((starts[-1], 3))
    for b in range(len(starts) - 1):
        x, y = bounds[0] + (b % cols + 0.5) * side, bounds[1] + (b // cols + 0.5) * side
        sort_discs(x, y, found[starts[b] : starts[b + 1]])
    return found, starts


@kernel
def sort_discs(x: float, y: float, discs: Array) -> None:
    """Sort discs (N, 3) in place by the distance of their surfaces from (x, y)."""
    before, away = discs.copy(), np.empty((discs.shape[0], 1))
    for j in range(discs.shape[0]):
        away[j, 0] = math.hypot(discs[j, 0] - x, discs[j, 1] - y) - discs[j, 2]
    order = order_by(away, 0)
    for j in range(discs.shape[0]):
        for k in range(3):
            discs[j, k] = before[order[j], k]


@leaf
def square_at(x: float, y: float, obstacles: ObstacleIndex) -> int:
    """Return the square near (x, y)."""
    bounds, corner, side = obstacles.bounds, obstacles.corner, obstacles.side
    cols = int((bounds[2] - bounds[0]) / side) + 1
    rows = int((bounds[3] - bounds[1]) / side) + 1
    c = min(max(int((x - corner[0]) / side), 0), cols - 1)
    r = min(max(int((y - corner[1]) / side), 0), rows - 1)
    return r * cols + c


@leaf
def end_of(square: int, x: float, y: float, reach: float, obstacles: ObstacleIndex) -> int:
    """Return the row of `discs` after those of a square whose surfaces may be within reach of (x, y)."""
    discs, side = obstacles.discs, obstacles.side
    cols = int((obstacles.bounds[2] - obstacles.bounds[0]) / side) + 1
    cx, cy = obstacles.corner[0] + (square % cols + 0.5) * side, obstacles.corner[1] + (square // cols + 0.5) * side
    farthest = reach + math.hypot(x - cx, y - cy) + ROUNDING
    low, high = obstacles.starts[square], obstacles.starts[square + 1]
    while low < high:
        middle = (low + high) >> 1
        if math.hypot(discs[middle, 0] - cx, discs[middle, 1] - cy) - discs[middle, 2] <= farthest:
            low = middle + 1
        else:
            high = middle
    return int(low)


@inline
def nearby(x: float, y: float, reach: float, obstacles: ObstacleIndex) -> Array:
    """Return the indexed discs (N, 3) near (x, y), without most of those whose surfaces are not within reach."""
    square = square_at(x, y, obstacles)
    return obstacles.discs[obstacles.starts[square] : end_of(square, x, y, reach, obstacles)]


@leaf
def nearest_bound(x: float, y: float, obstacles: ObstacleIndex) -> float:
    """Return an upper bound of the distance from a point to the nearest indexed disc surface: that of one disc."""
    square = square_at(x, y, obstacles)
    first = obstacles.starts[square]
    if first == obstacles.starts[square + 1]:
        return 0.0
    return float(math.hypot(obstacles.discs[first, 0] - x, obstacles.discs[first, 1] - y) - obstacles.discs[first, 2])


@leaf
def clearance_at(x: float, y: float, obstacles: ObstacleIndex) -> float:
    """Return the distance from a point to the nearest disc surface or wall."""
    discs = nearby(x, y, nearest_bound(x, y, obstacles), obstacles)
    return segment_clearance(x, y, x, y, discs, obstacles.bounds)


@leaf
def points_within(points: Array, reach: Array, obstacles: ObstacleIndex, out: Array) -> None:
    """Fill out[i] with whether a disc or wall is within reach[i] of point i."""
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        out[i] = wall_distance(x, y, obstacles.bounds) <= reach[i]
        if out[i]:
            continue
        discs = nearby(x, y, reach[i], obstacles)
        for j in range(discs.shape[0]):
            if math.hypot(x - discs[j, 0], y - discs[j, 1]) - discs[j, 2] <= reach[i]:
                out[i] = True
                break


@leaf
def arc_clearance(
    x: float,
    y: float,
    yaw: float,
    curvature: float,
    sweep: float,
    ex: float,
    ey: float,
    discs: Array,
    bounds: Array,
    most: float,
) -> float:
    """Return the distance from a circular arc to the nearest disc surface or wall, at most `most`.

    The arc leaves (x, y) along `yaw`, turns by `sweep` and ends at (ex, ey).
    """
    if abs(sweep) < 1e-6:
        return min(most, segment_clearance(x, y, ex, ey, discs, bounds))
    radius = 1.0 / abs(curvature)
    cx, cy = x - math.sin(yaw) / curvature, y + math.cos(yaw) / curvature
    # An arc of less than half a circle is no farther from its chord than its middle is, any arc no farther than it is long.
    aside = radius * (1.0 - math.cos(0.5 * sweep)) if abs(sweep) <= HALF_CIRCLE else radius * abs(sweep)
    mx, my = x + ex - 2.0 * cx, y + ey - 2.0 * cy  # towards the middle of the arc
    best = min(most, min(wall_distance(x, y, bounds), wall_distance(ex, ey, bounds)))
    for q in range(4):  # the arc's extreme points in x and y
        ux, uy = (1.0 - q if q % 2 == 0 else 0.0), (2.0 - q if q % 2 == 1 else 0.0)
        if is_beside_arc(ux, uy, mx, my, radius, sweep):
            continue
        angle = q * 0.5 * math.pi
        if on_arc(angle, math.atan2(y - cy, x - cx), sweep):
            best = min(best, wall_distance(cx + radius * math.cos(angle), cy + radius * math.sin(angle), bounds))
    for j in range(discs.shape[0]):
        px, py, reach = discs[j, 0], discs[j, 1], best + discs[j, 2] + aside + ROUNDING
        if segment_distance2(px, py, x, y, ex, ey) > reach * reach:
            continue
        d = min(math.hypot(px - x, py - y), math.hypot(px - ex, py - ey))
        beside = is_beside_arc(px - cx, py - cy, mx, my, radius, sweep)
        if not beside and on_arc(math.atan2(py - cy, px - cx), math.atan2(y - cy, x - cx), sweep):
            d = min(d, abs(math.hypot(px - cx, py - cy) - radius))
        best = min(best, d - discs[j, 2])
    return best


@leaf
def turn_clearance(
    x: float, y: float, yaw: float, turn: float, half_length: float, half_width: float, rounding: float, corners: Array,
    discs: Array, bounds: Array,
) -> float:  # fmt: skip
    """Return the distance from a rounded rectangle rotating about its centre by `turn` to the nearest disc or wall.

    In the rectangle's frame a disc moves on an arc, and is nearest at an end or in line with a corner. `corners` (K, 2), if
    any, replace the rectangle by a polygon.
    """
    if corners.shape[0] > 0:
        return polygon_turn_clearance(x, y, yaw, turn, corners, discs, bounds) - rounding
    corner = math.atan2(half_width, half_length)
    radius = math.hypot(half_length, half_width)
    best = math.inf
    for j in range(discs.shape[0]):
        dx, dy = discs[j, 0] - x, discs[j, 1] - y
        away, angle = math.hypot(dx, dy), math.atan2(dy, dx) - yaw
        if away - radius - rounding - discs[j, 2] > best:
            continue
        for end in (angle, angle - turn):
            over_x = away * abs(math.cos(end)) - half_length
            over_y = away * abs(math.sin(end)) - half_width
            gap = math.hypot(max(over_x, 0.0), max(over_y, 0.0)) + min(max(over_x, over_y), 0.0)
            best = min(best, gap - rounding - discs[j, 2])
        for side in (corner, math.pi - corner, math.pi + corner, 2.0 * math.pi - corner):
            if on_arc(side, angle, -turn):
                best = min(best, away - radius - rounding - discs[j, 2])
    for q in range(4):  # the walls, by the direction in which they are
        room = abs(bounds[q] - (x if q % 2 == 0 else y))
        angle = (2 + q) * 0.5 * math.pi - yaw
        for end in (angle, angle - turn):
            best = min(best, room - half_length * abs(math.cos(end)) - half_width * abs(math.sin(end)) - rounding)
        for side in (corner, math.pi - corner, math.pi + corner, 2.0 * math.pi - corner):
            if on_arc(side, angle, -turn):
                best = min(best, room - radius - rounding)
    return best


@leaf
def polygon_turn_clearance(
    x: float, y: float, yaw: float, turn: float, corners: Array, discs: Array, bounds: Array
) -> float:
    """Return the same for a convex polygon (K, 2) around (x, y), in the frame rotated by `yaw`."""
    best = math.inf
    for j in range(discs.shape[0]):
        dx, dy = discs[j, 0] - x, discs[j, 1] - y
        away, angle = math.hypot(dx, dy), math.atan2(dy, dx) - yaw
        for end in (angle, angle - turn):
            best = min(best, polygon_distance(away * math.cos(end), away * math.sin(end), corners) - discs[j, 2])
        for k in range(corners.shape[0]):
            if on_arc(math.atan2(corners[k, 1], corners[k, 0]), angle, -turn):
                best = min(best, away - math.hypot(corners[k, 0], corners[k, 1]) - discs[j, 2])
    for end in (yaw + 0.0, yaw + turn):  # always float, even for an integer yaw
        best = min(best, polygon_wall_distance(x, y, math.cos(end), math.sin(end), corners, bounds))
    for q in range(4):  # the walls, by the direction in which they are
        room = abs(bounds[q] - (x if q % 2 == 0 else y))
        angle = (2 + q) * 0.5 * math.pi - yaw
        for k in range(corners.shape[0]):
            if on_arc(math.atan2(corners[k, 1], corners[k, 0]), angle, -turn):
                best = min(best, room - math.hypot(corners[k, 0], corners[k, 1]))
    return best


@leaf
def is_beside_arc(ux: float, uy: float, mx: float, my: float, radius: float, sweep: float) -> bool:
    """Return whether the direction (ux, uy) from the centre is beside the arc by more than rounding; not all such are found.

    (mx, my) is the sum of the vectors from the centre to both ends. It leads to the middle of an arc of less than half a
    circle, and its length is 2 radius cos(sweep / 2).
    """
    if abs(sweep) > HALF_CIRCLE:
        return False
    limit = mx * mx + my * my - BESIDE * radius * radius
    return bool(2.0 * radius * (ux * mx + uy * my) < limit * math.hypot(ux, uy))


@leaf
def on_arc(angle: float, first: float, sweep: float) -> bool:
    """Return whether an angle lies on the arc from `first` by `sweep`."""
    turn = (angle - first) % (2.0 * math.pi)
    if sweep < 0:
        turn = (2.0 * math.pi - turn) % (2.0 * math.pi)
    return bool(turn <= abs(sweep))
