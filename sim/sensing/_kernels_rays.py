"""Compiled rays of a lidar against discs and walls: arrays in, arrays out, nothing validated."""

from __future__ import annotations

import math

from antdrive.worlds._kernels import Array, kernel


@kernel
def cast(pose: Array, beams: Array, spacing: float, first: float, most: float, discs: Array, out: Array) -> None:
    """Lower out[i] to the distance at which beam i meets the first disc.

    `pose` is the lidar's x, y and yaw; `beams` (B, 2) are the beams' directions seen from the lidar, beam i at the angle
    `first` + i `spacing`. Discs are taken one by one: a disc is met by the beams within its angle alone. A beam that starts
    in a disc has the distance 0. Discs farther than `most` are not met.
    """
    x, y, cos, sin = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    count = beams.shape[0]
    turn = 2.0 * math.pi / spacing  # a full turn in beams
    for j in range(discs.shape[0]):
        dx, dy, radius = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2]
        away2 = dx * dx + dy * dy
        if away2 > (most + radius) * (most + radius):
            continue
        if away2 <= radius * radius:
            for i in range(count):
                out[i] = 0.0
            return
        ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
        middle = (math.atan2(left, ahead) - first) / spacing
        half = math.asin(radius / math.sqrt(away2)) / spacing + 0.01  # rounding may not lose a beam at the edge
        for k in range(-1, 2):  # the same angle, a turn less and a turn more
            low = max(0, int(math.ceil(middle + k * turn - half)))
            high = min(count - 1, int(math.floor(middle + k * turn + half)))
            for i in range(low, high + 1):
                across = ahead * beams[i, 1] - left * beams[i, 0]
                rest = radius * radius - across * across
                if rest >= 0.0:
                    out[i] = min(out[i], ahead * beams[i, 0] + left * beams[i, 1] - math.sqrt(rest))


@kernel
def cast_walls(pose: Array, beams: Array, bounds: Array, out: Array) -> None:
    """Lower out[i] to the distance at which beam i meets a wall; 0 for a lidar that is not between the walls."""
    x, y, cos, sin = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    if not (bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]):
        out[:] = 0.0
        return
    for i in range(beams.shape[0]):
        ux, uy = cos * beams[i, 0] - sin * beams[i, 1], sin * beams[i, 0] + cos * beams[i, 1]
        if ux > 0.0:
            out[i] = min(out[i], (bounds[2] - x) / ux)
        elif ux < 0.0:
            out[i] = min(out[i], (bounds[0] - x) / ux)
        if uy > 0.0:
            out[i] = min(out[i], (bounds[3] - y) / uy)
        elif uy < 0.0:
            out[i] = min(out[i], (bounds[1] - y) / uy)


@kernel
def measure(ranges: Array, noise: Array, least: float, most: float, resolution: float) -> None:
    """Turn true distances into what a lidar says, in place.

    Farther than `most` is inf, nearer than `least` is -inf. The others get their `noise`, are rounded to multiples of
    `resolution` and stay within the lidar's limits.
    """
    for i in range(ranges.shape[0]):
        true = ranges[i]
        if true > most:
            ranges[i] = math.inf
        elif true < least:
            ranges[i] = -math.inf
        else:
            value = true + noise[i]
            if resolution > 0.0:
                value = math.floor(value / resolution + 0.5) * resolution
            ranges[i] = min(max(value, least), most)
