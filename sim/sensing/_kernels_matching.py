"""Compiled scan matching: the small motion that lays a scan on a map. Arrays in, arrays out, nothing validated."""

from __future__ import annotations

import math

from antdrive.sim.sensing._kernels_mapping import MapArrays, grain_disc
from antdrive.worlds._kernels import Array, kernel

ROUNDS = 4  # pairings of hits with the map
SETTLED = 1.0  # log-odds from which on a place of the map is matched with: two hits


@kernel
def match(eye: Array, beams: Array, ranges: Array, every: int, first: int, far: float, near: int, fewest: int,
          m: MapArrays) -> tuple[float, float, float, int]:  # fmt: skip
    """The lidar's pose, moved so that hits lie on the nearest hits of the map: x, y, yaw, and the number of pairs.

    Every `every`-th beam from beam `first` counts if its range is at most `far`; partners are looked for within `near` grains.
    With fewer pairs than `fewest` the pose stays. In each round the best rigid motion for the pairs has a closed form (K. S.
    Arun, T. S. Huang and S. D. Blostein, *Least-squares fitting of two 3-D point sets*, IEEE PAMI 9, 1987); the whole is the
    iterative closest point of P. J. Besl and N. D. McKay, IEEE PAMI 14, 1992.
    """
    x, y, yaw = eye[0], eye[1], eye[2]
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


@kernel
def partner(x: float, y: float, near: int, m: MapArrays) -> tuple[bool, float, float]:
    """The settled hit of the map that is nearest to a point, within `near` grains."""
    fine = m.frame[2] * m.free.shape[0] / m.odds.shape[0]
    rows, cols = m.odds.shape
    row, col = int(math.floor((y - m.frame[1]) / fine)), int(math.floor((x - m.frame[0]) / fine))
    best, bx, by = (near * fine) ** 2, 0.0, 0.0
    found = False
    for r in range(max(0, row - near), min(rows, row + near + 1)):
        for c in range(max(0, col - near), min(cols, col + near + 1)):
            if m.odds[r, c] < SETTLED:
                continue
            gx, gy, _ = grain_disc(m.box, r, c)
            away = (gx - x) * (gx - x) + (gy - y) * (gy - y)
            if away < best:
                best, bx, by, found = away, gx, gy, True
    return found, bx, by
