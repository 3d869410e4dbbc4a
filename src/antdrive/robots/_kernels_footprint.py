"""Compiled distances from a robot's footprint to obstacles: arrays in, arrays out."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import ROUNDING, Array, inline, kernel, leaf, polygon_distance, polygon_wall_distance

# Distance from its origin within which a list of nearby discs stays valid [m].
NEAR = 0.25


@kernel
def footprint_clearances(poses: Array, shape: Array, corners: Array, discs: Array, bounds: Array, out: Array) -> None:
    """Fill out[i] with the distance from the footprint at poses[i] to the nearest disc surface or wall.

    `shape` is half length, half width and rounding of a rounded rectangle; `corners` (K, 2), if any, replace the rectangle by
    a polygon.
    """
    hx, hy, rounding = shape[0], shape[1], shape[2]
    radius = outer_radius(hx, hy, rounding, corners)
    near = np.empty_like(discs)
    count = 0
    anchor_x, anchor_y = math.inf, math.inf
    for i in range(poses.shape[0]):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        if not math.hypot(x - anchor_x, y - anchor_y) <= NEAR:
            anchor_x, anchor_y = x, y
            count = discs_near(x, y, radius + 2.0 * NEAR, discs, near)
        best = wall_gap(x, y, cos, sin, hx, hy, rounding, corners, bounds)
        for j in range(count):
            gap = disc_gap(near[j, 0] - x, near[j, 1] - y, near[j, 2], cos, sin, hx, hy, rounding, corners)
            best = min(best, gap)
        out[i] = best


@leaf
def outer_radius(hx: float, hy: float, rounding: float, corners: Array) -> float:
    """Return the circumscribed radius of a footprint around its origin [m]."""
    radius = math.hypot(hx, hy) + rounding
    for k in range(corners.shape[0]):
        radius = max(radius, math.hypot(corners[k, 0], corners[k, 1]) + rounding)
    return radius


@inline
def wall_gap(
    x: float, y: float, cos: float, sin: float, hx: float, hy: float, rounding: float, corners: Array, bounds: Array
) -> float:
    """Return the distance from the footprint at (x, y), rotated by cosine and sine, to the nearest wall."""
    if corners.shape[0] > 0:
        gap = polygon_wall_distance(x, y, cos, sin, corners, bounds) - rounding
    else:
        extent_x = hx * abs(cos) + hy * abs(sin) + rounding
        extent_y = hx * abs(sin) + hy * abs(cos) + rounding
        gap = min(
            min(x - extent_x - bounds[0], bounds[2] - x - extent_x),
            min(y - extent_y - bounds[1], bounds[3] - y - extent_y),
        )
    return gap


@inline
def disc_gap(
    dx: float, dy: float, radius: float, cos: float, sin: float, hx: float, hy: float, rounding: float, corners: Array
) -> float:
    """Return the distance from the footprint, rotated by cosine and sine, to a disc at (dx, dy) from its origin."""
    if corners.shape[0] > 0:
        gap = polygon_distance(cos * dx + sin * dy, cos * dy - sin * dx, corners) - radius - rounding
    else:
        qx = abs(cos * dx + sin * dy) - hx
        qy = abs(cos * dy - sin * dx) - hy
        gap = math.hypot(max(qx, 0.0), max(qy, 0.0)) + min(max(qx, qy), 0.0) - rounding - radius
    return gap


@leaf
def footprint_gap(
    x: float, y: float, yaw: float, hx: float, hy: float, rounding: float, corners: Array, discs: Array, bounds: Array
) -> float:
    """Return the distance from the footprint at one pose to the nearest disc surface or wall."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    best = wall_gap(x, y, cos, sin, hx, hy, rounding, corners, bounds)
    for j in range(discs.shape[0]):
        gap = disc_gap(discs[j, 0] - x, discs[j, 1] - y, discs[j, 2], cos, sin, hx, hy, rounding, corners)
        best = min(best, gap)
    return best


@leaf
def comes_within(
    required: float, x: float, y: float, yaw: float, hx: float, hy: float, rounding: float, corners: Array, discs: Array,
    bounds: Array,
) -> bool:  # fmt: skip
    """Return whether `footprint_gap` is less than required, as soon as one disc or wall is that close."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    if wall_gap(x, y, cos, sin, hx, hy, rounding, corners, bounds) < required:
        return True
    reach = outer_radius(hx, hy, rounding, corners) + required + ROUNDING
    for j in range(discs.shape[0]):
        dx, dy, far = discs[j, 0] - x, discs[j, 1] - y, max(reach + discs[j, 2], 0.0)
        if dx * dx + dy * dy > far * far:
            continue
        if disc_gap(dx, dy, discs[j, 2], cos, sin, hx, hy, rounding, corners) < required:
            return True
    return False


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
