"""Compiled scan matching: the small motion that aligns a scan with a map. Arrays in, arrays out, no validation."""

from __future__ import annotations

import math

import numpy as np

from antdrive.sim.sensing._kernels_mapping import GRAINS, MapArrays
from antdrive.worlds._kernels import Array, leaf

ROUNDS = 4  # pairings of hits with the map
SETTLED = 1.0  # least log-odds of a grain that is matched: two hits


@leaf
def match(
    x: float, y: float, yaw: float, beams: Array, ranges: Array, every: int, first: int, far: float, near: int,
    fewest: int, arrays: tuple[Array, ...],
) -> tuple[float, float, float, int]:  # fmt: skip
    """Return the lidar's pose x, y, yaw, moved to align hits with the nearest hits of the map, and the number of pairs.

    Every `every`-th beam from beam `first` counts if its range is at most `far`; partners lie within `near` grains. With fewer
    pairs than `fewest` the pose stays. In each round the best rigid motion for the pairs has a closed form (K. S.
    Arun, T. S. Huang and S. D. Blostein, *Least-squares fitting of two 3-D point sets*, IEEE PAMI 9, 1987); the whole is the
    iterative closest point of P. J. Besl and N. D. McKay, IEEE PAMI 14, 1992.
    """
    m = MapArrays(*arrays)
    eye = x, y, yaw
    pairs = 0
    for _ in range(ROUNDS):
        cos, sin = math.cos(yaw), math.sin(yaw)
        pairs = 0
        sx, sy, tx, ty, dot, cross = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(first, beams.shape[0], every):
            if not 0.0 < ranges[i] <= far:
                continue
            px = ranges[i] * (cos * beams[i, 0] - sin * beams[i, 1])
            py = ranges[i] * (sin * beams[i, 0] + cos * beams[i, 1])
            found, qx, qy = partner(x + px, y + py, near, m)
            if not found:
                continue
            qx, qy = qx - x, qy - y
            pairs += 1
            sx, sy, tx, ty = sx + px, sy + py, tx + qx, ty + qy
            dot += px * qx + py * qy
            cross += px * qy - py * qx
        if pairs < fewest:
            return eye[0], eye[1], eye[2], pairs
        sx, sy, tx, ty = sx / pairs, sy / pairs, tx / pairs, ty / pairs
        turn = math.atan2(cross / pairs - (sx * ty - sy * tx), dot / pairs - (sx * tx + sy * ty))
        cos, sin = math.cos(turn), math.sin(turn)
        x += tx - (cos * sx - sin * sy)
        y += ty - (sin * sx + cos * sy)
        yaw += turn
    return x, y, yaw, pairs


@leaf
def partner(x: float, y: float, near: int, m: MapArrays) -> tuple[bool, float, float]:
    """Return the settled hit of the map nearest to a point, within `near` grains."""
    cell = m.frame[2]
    reach = near * cell / GRAINS
    rows, cols = m.free.shape
    row_low, col_low = (
        int(math.floor((y - reach - m.frame[1]) / cell)),
        int(math.floor((x - reach - m.frame[0]) / cell)),
    )
    row_high, col_high = (
        int(math.floor((y + reach - m.frame[1]) / cell)),
        int(math.floor((x + reach - m.frame[0]) / cell)),
    )
    best, bx, by = reach * reach, 0.0, 0.0
    found = False
    for r in range(max(0, row_low), min(rows - 1, row_high) + 1):
        for c in range(max(0, col_low), min(cols - 1, col_high) + 1):
            if not m.occupied[r, c]:
                continue
            at = m.slot[r, c]
            for k in range(GRAINS * GRAINS):
                if m.odds[at, k] < SETTLED:
                    continue
                gx = 0.5 * (np.float64(m.box[at, k, 0]) + m.box[at, k, 2])
                gy = 0.5 * (np.float64(m.box[at, k, 1]) + m.box[at, k, 3])
                away = (gx - x) * (gx - x) + (gy - y) * (gy - y)
                if away < best:
                    best, bx, by, found = away, gx, gy, True
    return found, bx, by
