"""Compiled ray casting of a lidar against discs and walls: arrays in, arrays out, no validation."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, inline, kernel, leaf

SURE = 0.05  # beams checked beyond a disc's angle, against rounding
ANGLE_ERROR = 2e-5  # upper bound of the error of `angle_of` [rad]


@leaf
def scan(
    x: float, y: float, yaw: float, beams: Array, spacing: float, first: float, limits: Array, discs: Array,
    movers: Array, bounds: Array, noise: Array, out: Array,
) -> None:  # fmt: skip
    """Write the ranges of a lidar at (x, y) with a yaw into out (B,).

    `limits` are its shortest and longest range, resolution and the standard deviation of ranges; `noise` (B,) is in units of
    that. `bounds` without numbers are no walls. `beams` (2, B), `discs` (3, N) and `movers` (3, M) have a row for each
    coordinate, so that several are taken at once.
    """
    for i in range(out.shape[0]):
        out[i] = math.inf
    cos, sin = math.cos(yaw), math.sin(yaw)
    cast(x, y, cos, sin, beams, spacing, first, limits[1], discs, out)
    if movers.shape[1] > 0:
        cast(x, y, cos, sin, beams, spacing, first, limits[1], movers, out)
    if bounds.shape[0] > 0:
        cast_walls(x, y, cos, sin, beams, bounds, out)
    measure(out, noise, limits)


@inline
def angle_of(y: float, x: float) -> float:
    """Return the direction of (x, y), to 1e-5 rad (C. Hastings, *Approximations for digital computers*, 1955, sheet 11)."""
    small, large = min(abs(x), abs(y)), max(abs(x), abs(y))
    t = small / large if large > 0.0 else 0.0
    u = t * t
    turn = t * (0.9998660 + u * (-0.3302995 + u * (0.1801410 + u * (-0.0851330 + u * 0.0208351))))
    turn = 0.5 * math.pi - turn if abs(y) > abs(x) else turn
    turn = math.pi - turn if x < 0.0 else turn
    return -turn if y < 0.0 else turn


@kernel
def cast(
    x: float, y: float, cos: float, sin: float, beams: Array, spacing: float, first: float, most: float, discs: Array,
    out: Array,
) -> None:  # fmt: skip
    """Lower out[i] to the distance at which beam i meets the first disc.

    The lidar is at (x, y), with the cosine and sine of its yaw; `beams` (2, B) are the beams' directions in its frame, beam i
    at the angle `first` + i `spacing`. A disc is tested against the beams within its angle only. A beam that starts in a
    disc has the distance 0. Discs farther than `most` are omitted. Sorting near discs first is fastest.
    """
    turn = 2.0 * math.pi / spacing  # a full turn in beams
    last = beams.shape[1] - 1
    seen = np.empty((5, discs.shape[1]))
    if look(x, y, cos, sin, spacing, first, most, discs, seen):
        out[:] = 0.0
        return
    for j in range(discs.shape[1]):
        low, high, nearest = seen[3, j], seen[4, j], seen[2, j]
        while high - turn >= 0.0:  # the same angle, turns less
            low, high = low - turn, high - turn
        while low <= last:  # and turns more
            cast_at(low, high, seen[0, j], seen[1, j], discs[2, j], nearest, beams, out)
            low, high = low + turn, high + turn


@leaf
def look(
    x: float, y: float, cos: float, sin: float, spacing: float, first: float, most: float, discs: Array, seen: Array
) -> bool:
    """Write the positions of discs relative to a lidar (5, N): ahead, left, distance [m], first and last beam.

    Return whether the lidar is in one of them. Beams are inf for a disc farther than `most`. Branch-free for vectorisation.
    """
    per = 1.0 / spacing
    inside = 0
    for j in range(discs.shape[1]):
        dx, dy, radius = discs[0, j] - x, discs[1, j] - y, discs[2, j]
        away2 = dx * dx + dy * dy
        ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
        middle = (angle_of(left, ahead) - first) * per
        away = math.sqrt(away2)
        sine = radius / away
        # asin(s) <= s + (pi / 2 - 1) s^3 between 0 and 1.
        half = (sine + 0.5708 * sine * sine * sine + ANGLE_ERROR) * per + SURE
        met = away2 <= (most + radius) * (most + radius)
        inside += 1 if away2 <= radius * radius else 0
        seen[0, j], seen[1, j], seen[2, j] = ahead, left, away - radius
        seen[3, j] = middle - half if met else math.inf
        seen[4, j] = middle + half if met else -math.inf
    return inside > 0


@inline
def cast_at(
    low: float, high: float, ahead: float, left: float, radius: float, nearest: float, beams: Array, out: Array
) -> None:
    """Lower the distances of the beams `low` to `high` that hit a disc."""
    for i in range(max(0, int(math.ceil(low))), min(beams.shape[1] - 1, int(math.floor(high))) + 1):
        if nearest >= out[i]:
            continue
        across = ahead * beams[1, i] - left * beams[0, i]
        rest = radius * radius - across * across
        if rest >= 0.0:
            out[i] = min(out[i], max(ahead * beams[0, i] + left * beams[1, i] - math.sqrt(rest), 0.0))


@leaf
def cast_walls(x: float, y: float, cos: float, sin: float, beams: Array, bounds: Array, out: Array) -> None:
    """Lower out[i] to the distance at which beam i meets a wall; 0 for a lidar outside the walls."""
    if not (bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]):
        out[:] = 0.0
        return
    east, west, north, south = bounds[2] - x, bounds[0] - x, bounds[3] - y, bounds[1] - y
    nearest = min(min(east, -west), min(north, -south))
    for i in range(out.shape[0]):  # branch-free for vectorisation
        ux, uy = cos * beams[0, i] - sin * beams[1, i], sin * beams[0, i] + cos * beams[1, i]
        along_x, along_y = (east if ux > 0.0 else -west) / abs(ux), (north if uy > 0.0 else -south) / abs(uy)
        wall = along_x if along_x < along_y else along_y
        out[i] = wall if nearest < out[i] and wall < out[i] else out[i]


@leaf
def measure(ranges: Array, noise: Array, limits: Array) -> None:
    """Convert true distances to lidar ranges, in place; see `scan` for the `limits`.

    Distances beyond the longest range become inf, below the shortest -inf. The others get their `noise`, are rounded to
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
