"""Compiled queries about what a lidar has hit: arrays in, arrays out, nothing validated."""

from __future__ import annotations

import math

import numpy as np

from antdrive.sim.sensing._kernels_mapping import GRAINS, MapArrays, grain_disc
from antdrive.worlds._kernels import Array, kernel


@kernel
def discs_within(m: MapArrays, bounds: Array) -> Array:
    """A disc (x, y, radius) around the hits of every grain whose cell meets a rectangle (D, 3) [m]."""
    out = np.empty((m.count[0] * GRAINS * GRAINS, 3))
    cell = m.frame[2]
    count = 0
    for i in range(m.count[0]):
        row, col = m.cells[i, 0], m.cells[i, 1]
        x, y = m.frame[0] + col * cell, m.frame[1] + row * cell
        if x > bounds[2] or y > bounds[3] or x + cell < bounds[0] or y + cell < bounds[1]:
            continue
        for r in range(GRAINS * row, GRAINS * row + GRAINS):
            for c in range(GRAINS * col, GRAINS * col + GRAINS):
                if m.odds[r, c] > 0.0:
                    out[count, 0], out[count, 1], out[count, 2] = grain_disc(m.box[r, c])
                    count += 1
    return out[:count].copy()


@kernel
def near_polyline(xy: Array, discs: Array, distance: float) -> Array:
    """The discs whose surface is within a distance of a polyline, in their order."""
    out = np.empty_like(discs)
    count = 0
    for j in range(discs.shape[0]):
        reach = distance + discs[j, 2]
        for i in range(xy.shape[0] - 1):
            ax, ay = xy[i, 0], xy[i, 1]
            dx, dy = xy[i + 1, 0] - ax, xy[i + 1, 1] - ay
            px, py = discs[j, 0] - ax, discs[j, 1] - ay
            length2 = dx * dx + dy * dy
            t = min(1.0, max(0.0, (px * dx + py * dy) / length2)) if length2 > 0.0 else 0.0
            ex, ey = px - t * dx, py - t * dy
            if ex * ex + ey * ey <= reach * reach:
                out[count] = discs[j]
                count += 1
                break
    return out[:count].copy()


@kernel
def hit_distances(points: Array, hits: Array) -> Array:
    """The distance from each point to the nearest hit; beams that hit nothing are not numbers."""
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        best = math.inf
        for j in range(hits.shape[0]):
            dx, dy = points[i, 0] - hits[j, 0], points[i, 1] - hits[j, 1]
            away = dx * dx + dy * dy
            if away < best:
                best = away
        out[i] = math.sqrt(best)
    return out
