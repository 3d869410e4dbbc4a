"""Compiled distances from a robot's footprint to obstacles: arrays in, arrays out."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, kernel, leaf, polygon_distance, polygon_wall_distance

# Distance from its origin within which a list of nearby discs stays valid [m].
NEAR = 0.25


@kernel
def footprint_clearances(poses: Array, shape: Array, corners: Array, discs: Array, bounds: Array, out: Array) -> None:
    """Fill out[i] with the distance from the footprint at poses[i] to the nearest disc surface or wall.

    `shape` is half length, half width and rounding of a rounded rectangle; `corners` (K, 2), if any, replace the rectangle by
    a polygon.
    """
    hx, hy, rounding = shape[0], shape[1], shape[2]
    radius = math.hypot(hx, hy) + rounding
    for k in range(corners.shape[0]):
        radius = max(radius, math.hypot(corners[k, 0], corners[k, 1]) + rounding)
    near = np.empty_like(discs)
    count = 0
    anchor_x, anchor_y = math.inf, math.inf
    for i in range(poses.shape[0]):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        if not math.hypot(x - anchor_x, y - anchor_y) <= NEAR:
            anchor_x, anchor_y = x, y
            count = discs_near(x, y, radius + 2.0 * NEAR, discs, near)
        if corners.shape[0] > 0:
            best = polygon_wall_distance(x, y, cos, sin, corners, bounds)
            for j in range(count):
                dx, dy = near[j, 0] - x, near[j, 1] - y
                apart = polygon_distance(cos * dx + sin * dy, cos * dy - sin * dx, corners)
                best = min(best, apart - near[j, 2])
            out[i] = best - rounding
            continue
        extent_x = hx * abs(cos) + hy * abs(sin) + rounding
        extent_y = hx * abs(sin) + hy * abs(cos) + rounding
        best = min(
            min(x - extent_x - bounds[0], bounds[2] - x - extent_x),
            min(y - extent_y - bounds[1], bounds[3] - y - extent_y),
        )
        for j in range(count):
            dx, dy = near[j, 0] - x, near[j, 1] - y
            qx = abs(cos * dx + sin * dy) - hx
            qy = abs(cos * dy - sin * dx) - hy
            outside = math.hypot(max(qx, 0.0), max(qy, 0.0))
            inside = min(max(qx, qy), 0.0)
            best = min(best, outside + inside - rounding - near[j, 2])
        out[i] = best


@leaf
def discs_near(x: float, y: float, slack: float, discs: Array, out: Array) -> int:
    """Write the discs at most `slack` farther from (x, y) than the closest one to `out`; return their number.

    While the robot is within NEAR of (x, y), no other disc can be the closest to its footprint.
    """
    closest = math.inf
    for j in range(discs.shape[0]):
        closest = min(closest, math.hypot(discs[j, 0] - x, discs[j, 1] - y) - discs[j, 2])
    count = 0
    for j in range(discs.shape[0]):
        if math.hypot(discs[j, 0] - x, discs[j, 1] - y) - discs[j, 2] <= closest + slack:
            out[count, 0], out[count, 1], out[count, 2] = discs[j, 0], discs[j, 1], discs[j, 2]
            count += 1
    return count
