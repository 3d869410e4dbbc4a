"""Compiled distances to what moves: arrays in, arrays out, nothing validated."""

from __future__ import annotations

import math

from antdrive.worlds._kernels import Array, kernel


@kernel
def lower_by_movers(poses: Array, shape: Array, places: Array, radii: Array, out: Array) -> None:
    """Lower out[i] to the distance from the footprint at poses[i] to the nearest of the movers at places[i] (M, 2).

    `shape` holds half length, half width and rounding of a rounded rectangle.
    """
    for i in range(poses.shape[0]):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        for m in range(radii.shape[0]):
            dx, dy = places[i, m, 0] - x, places[i, m, 1] - y
            qx = abs(cos * dx + sin * dy) - shape[0]
            qy = abs(cos * dy - sin * dx) - shape[1]
            outside = math.hypot(max(qx, 0.0), max(qy, 0.0))
            out[i] = min(out[i], outside + min(max(qx, qy), 0.0) - shape[2] - radii[m])
