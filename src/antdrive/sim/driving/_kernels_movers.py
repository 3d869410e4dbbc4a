"""Compiled distances from the robot to movers: arrays in, arrays out, no validation."""

from __future__ import annotations

import math

from antdrive.worlds._kernels import Array, leaf, polygon_distance


@leaf
def lower_by_movers(
    poses: Array, footprint: Array, corners: Array, movers: Array, radii: Array, clearance: Array
) -> None:
    """Lower clearance[i] to the distance from the footprint at poses[i] to the nearest of movers[i] (M, 2).

    `footprint` holds half length, half width and rounding of a rounded rectangle; `corners` (K, 2), if any, replace it by a
    polygon.
    """
    for i in range(poses.shape[0]):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        for m in range(radii.shape[0]):
            dx, dy = movers[i, m, 0] - x, movers[i, m, 1] - y
            if corners.shape[0] > 0:
                apart = polygon_distance(cos * dx + sin * dy, cos * dy - sin * dx, corners)
                clearance[i] = min(clearance[i], apart - footprint[2] - radii[m])
                continue
            qx = abs(cos * dx + sin * dy) - footprint[0]
            qy = abs(cos * dy - sin * dx) - footprint[1]
            outside = math.hypot(max(qx, 0.0), max(qy, 0.0))
            distance = outside + min(max(qx, qy), 0.0) - footprint[2] - radii[m]
            clearance[i] = min(clearance[i], distance)
