"""Compiled rays of a lidar against discs and walls: arrays in, arrays out, nothing validated."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, inline, kernel

SURE = 0.05  # so many beams are looked at beyond those that a disc's angle holds, whatever the rounding
PAST = 1.0 + 1e-12  # products of rounded numbers are this much too large or too small at most
ANGLE_ERROR = 2e-5  # more than the largest error of `angle_of` [rad]


@kernel
def scan(
    pose: Array, beams: Array, spacing: float, first: float, limits: Array, discs: Array, movers: Array, bounds: Array,
    noise: Array, out: Array,
) -> None:  # fmt: skip
    """Write what a lidar at a pose measures into out (B,).

    `limits` are its shortest and longest range, resolution and the standard deviation of ranges; `noise` (B,) is in units of
    that. `bounds` without numbers are no walls.
    """
    for i in range(out.shape[0]):
        out[i] = math.inf
    cast(pose, beams, spacing, first, limits[1], discs, out)
    cast(pose, beams, spacing, first, limits[1], movers, out)
    if bounds.shape[0] > 0:
        cast_walls(pose, beams, bounds, out)
    measure(out, noise, limits)


@inline
def angle_of(y: float, x: float) -> float:
    """The direction of (x, y), to 1e-5 rad (C. Hastings, *Approximations for digital computers*, 1955, sheet 11)."""
    small, large = min(abs(x), abs(y)), max(abs(x), abs(y))
    t = small / large if large > 0.0 else 0.0
    u = t * t
    turn = t * (0.9998660 + u * (-0.3302995 + u * (0.1801410 + u * (-0.0851330 + u * 0.0208351))))
    if abs(y) > abs(x):
        turn = 0.5 * math.pi - turn
    if x < 0.0:
        turn = math.pi - turn
    return -turn if y < 0.0 else turn


@kernel
def cast(pose: Array, beams: Array, spacing: float, first: float, most: float, discs: Array, out: Array) -> None:
    """Lower out[i] to the distance at which beam i meets the first disc.

    `pose` is the lidar's x, y and yaw; `beams` (B, 2) are the beams' directions seen from the lidar, beam i at the angle
    `first` + i `spacing`. Discs are taken one by one: a disc is met by the beams within its angle alone. A beam that starts
    in a disc has the distance 0. Discs farther than `most` are not met. It is quickest when near discs come first.
    """
    x, y, cos, sin = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    turn = 2.0 * math.pi / spacing  # a full turn in beams
    per, last = 1.0 / spacing, beams.shape[0] - 1
    for j in range(discs.shape[0]):
        dx, dy, radius = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2]
        away2 = dx * dx + dy * dy
        if away2 > (most + radius) * (most + radius):
            continue
        if away2 <= radius * radius:
            for i in range(beams.shape[0]):
                out[i] = 0.0
            return
        ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
        middle = (angle_of(left, ahead) - first) * per
        away = math.sqrt(away2)
        sine = radius / away
        # asin(s) <= s + (pi / 2 - 1) s^3 between 0 and 1.
        half = (sine + 0.5708 * sine * sine * sine + ANGLE_ERROR) * per + SURE
        while middle - turn + half >= 0.0:  # the same angle, turns less
            middle -= turn
        while middle - half <= last:  # and turns more
            cast_at(middle - half, middle + half, ahead, left, radius, away - radius, beams, out)
            middle += turn


@inline
def cast_at(
    low: float, high: float, ahead: float, left: float, radius: float, nearest: float, beams: Array, out: Array
) -> None:
    """Lower the distances of the beams `low` to `high`, as far as they meet a disc."""
    for i in range(max(0, int(math.ceil(low))), min(beams.shape[0] - 1, int(math.floor(high))) + 1):
        if nearest >= out[i]:
            continue
        across = ahead * beams[i, 1] - left * beams[i, 0]
        rest = radius * radius - across * across
        if rest >= 0.0:
            out[i] = min(out[i], max(ahead * beams[i, 0] + left * beams[i, 1] - math.sqrt(rest), 0.0))


@kernel
def cast_walls(pose: Array, beams: Array, bounds: Array, out: Array) -> None:
    """Lower out[i] to the distance at which beam i meets a wall; 0 for a lidar that is not between the walls."""
    x, y, cos, sin = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    if not (bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]):
        out[:] = 0.0
        return
    east, west, north, south = bounds[2] - x, bounds[0] - x, bounds[3] - y, bounds[1] - y
    nearest = min(min(east, -west), min(north, -south))
    for i in range(beams.shape[0]):
        if out[i] <= nearest:
            continue
        ux, uy = cos * beams[i, 0] - sin * beams[i, 1], sin * beams[i, 0] + cos * beams[i, 1]
        far = out[i] * PAST  # quotients only where a wall may be nearer
        if far * ux >= east:
            out[i] = min(out[i], east / ux)
        elif far * ux <= west:
            out[i] = min(out[i], west / ux)
        if far * uy >= north:
            out[i] = min(out[i], north / uy)
        elif far * uy <= south:
            out[i] = min(out[i], south / uy)


@kernel
def measure(ranges: Array, noise: Array, limits: Array) -> None:
    """Turn true distances into what a lidar says, in place; see `scan` for the `limits`.

    Farther than the longest range is inf, nearer than the shortest is -inf. The others get their `noise`, are rounded to
    multiples of the resolution and stay within the lidar's limits.
    """
    least, most, resolution, sigma = limits[0], limits[1], limits[2], limits[3]
    rounds = resolution > 0.0
    step = resolution if rounds else 1.0
    for i in range(ranges.shape[0]):  # without branches, so that several are taken at once
        true = ranges[i]
        value = true + sigma * noise[i]
        rounded = np.floor(value / step + 0.5) * step
        value = rounded if rounds else value
        value = least if value < least else value
        value = most if value > most else value
        value = -math.inf if true < least else value
        ranges[i] = math.inf if true > most else value
