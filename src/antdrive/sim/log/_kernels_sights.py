"""Compiled visibility: first hits, observed ground and nearest approaches. Arrays in, arrays out, no validation.

`eye` is the lidar's true x, y and yaw, `reaches` (B,) the length of each beam [m]. Beam k points `first` + k `spacing` to the
left of the lidar's heading; on a `closed` circle the first beam follows the last.
"""

from __future__ import annotations

import math

from antdrive.robots._kernels_footprint import outer_radius
from antdrive.worlds._kernels import Array, leaf, polygon_distance


@leaf
def first_meetings(
    eye: Array, first: float, spacing: float, closed: bool, reaches: Array, discs: Array, slack: float, now: float,
    met: Array,
) -> None:  # fmt: skip
    """Set met[j] = now for every disc (N, 3) whose surface a beam hits for the first time, within `slack` [m].

    `met` (N,) is infinite before.
    """
    beams = reaches.shape[0]
    for j in range(discs.shape[0]):
        if met[j] <= now:
            continue
        dx, dy, radius = discs[j, 0] - eye[0], discs[j, 1] - eye[1], discs[j, 2]
        away = math.hypot(dx, dy)
        if away <= radius:
            continue
        middle = (math.atan2(dy, dx) - eye[2] - first) % (2.0 * math.pi)
        half = math.asin(radius / away)
        for turn in range(1 if closed else 2):  # a disc may lie across the direction in which the count begins
            centre = middle - 2.0 * math.pi * turn
            for k in range(math.ceil((centre - half) / spacing), math.floor((centre + half) / spacing) + 1):
                if not closed and (k < 0 or k >= beams):
                    continue
                aside = k * spacing - centre
                across = away * math.sin(aside)
                surface = away * math.cos(aside) - math.sqrt(max(0.0, radius * radius - across * across))
                if abs(reaches[k % beams] - surface) <= slack:
                    met[j] = now


@leaf
def mark_seen(
    eye: Array, first: float, spacing: float, closed: bool, reaches: Array, grid: Array, seen: Array
) -> None:  # fmt: skip
    """Mark the cells of `seen` (rows, cols) whose centre is nearer than the end of the beam closest in direction.

    `grid` (3,): the lower left corner of the first cell, and the side of a cell [m].
    """
    x0, y0, cell = grid[0], grid[1], grid[2]
    beams, far = reaches.shape[0], 0.0
    for k in range(beams):
        far = max(far, reaches[k])
    rows, cols = seen.shape
    low, high = int(max(0.0, (eye[1] - far - y0) / cell)), int(min(float(rows), (eye[1] + far - y0) / cell + 1.0))
    left, right = int(max(0.0, (eye[0] - far - x0) / cell)), int(min(float(cols), (eye[0] + far - x0) / cell + 1.0))
    for r in range(low, high):
        dy = y0 + (r + 0.5) * cell - eye[1]
        for c in range(left, right):
            if seen[r, c]:
                continue
            dx = x0 + (c + 0.5) * cell - eye[0]
            away = math.hypot(dx, dy)
            if away > far:
                continue
            turn = (math.atan2(dy, dx) - eye[2] - first + 0.5 * spacing) % (2.0 * math.pi)
            k = int(turn / spacing)
            if k >= beams:
                if not closed:
                    continue
                k = 0
            if away < reaches[k]:
                seen[r, c] = True


@leaf
def nearest_approaches(poses: Array, shape: Array, corners: Array, discs: Array, rows: Array, away: Array) -> None:
    """Set rows[j] to the pose at which the footprint was nearest to the surface of disc j, and away[j] to the distance.

    `shape` and `corners` are those of `footprint_clearances`. Over a disc's centre, the distance is minus its radius.
    """
    hx, hy, rounding = shape[0], shape[1], shape[2]
    radius = outer_radius(hx, hy, rounding, corners)
    for j in range(discs.shape[0]):
        rows[j], best = 0, math.inf
        for i in range(poses.shape[0]):
            dx, dy = discs[j, 0] - poses[i, 0], discs[j, 1] - poses[i, 1]
            if math.hypot(dx, dy) - radius - discs[j, 2] >= best:
                continue
            cos, sin = math.cos(poses[i, 2]), math.sin(poses[i, 2])
            ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
            if corners.shape[0] > 0:
                apart = max(0.0, polygon_distance(ahead, aside, corners))
            else:
                apart = math.hypot(max(abs(ahead) - hx, 0.0), max(abs(aside) - hy, 0.0))
            apart = max(0.0, apart - rounding) - discs[j, 2]
            if apart < best:
                rows[j], best = i, apart
        away[j] = best
