"""Compiled route checks against lidar hits: arrays in, arrays out, no validation."""

from __future__ import annotations

import math

import numpy as np

from antdrive.robots.control._kernels_profile import value_at
from antdrive.worlds._kernels import ROUNDING, Array, inline, kernel, leaf, point_clearances

BLOCK = 8  # points of a route that share one rectangle


@kernel
def near_polyline(xy: Array, discs: Array, distance: float) -> Array:
    """Return the discs whose surface is within a distance of a polyline, in their order."""
    out = np.empty_like(discs)
    count = 0
    links = xy.shape[0] - 1
    blocks = around_links(xy, BLOCK)
    groups = around_links(xy, BLOCK * BLOCK)
    for j in range(discs.shape[0]):
        x, y, reach = discs[j, 0], discs[j, 1], distance + discs[j, 2]
        near = False
        for g in range(groups.shape[0]):
            if beyond(x, y, reach, groups[g]):
                continue
            for b in range(BLOCK * g, min(BLOCK * (g + 1), blocks.shape[0])):
                if beyond(x, y, reach, blocks[b]):
                    continue
                for i in range(BLOCK * b, min(BLOCK * (b + 1), links)):
                    ax, ay = xy[i, 0], xy[i, 1]
                    dx, dy = xy[i + 1, 0] - ax, xy[i + 1, 1] - ay
                    px, py = x - ax, y - ay
                    if max(abs(px), abs(py)) > reach + abs(dx) + abs(dy):
                        continue
                    length2 = dx * dx + dy * dy
                    t = min(1.0, max(0.0, (px * dx + py * dy) / length2)) if length2 > 0.0 else 0.0
                    ex, ey = px - t * dx, py - t * dy
                    if ex * ex + ey * ey <= reach * reach:
                        near = True
                        break
                if near:
                    break
            if near:
                for k in range(3):
                    out[count, k] = discs[j, k]
                count += 1
                break
    return out[:count].copy()


@kernel
def around_links(xy: Array, size: int) -> Array:
    """Return rectangles around each `size` consecutive links of a polyline: x_min, x_max, y_min, y_max (B, 4)."""
    links = xy.shape[0] - 1
    out = np.empty(((links + size - 1) // size, 4))
    for b in range(out.shape[0]):
        some = xy[size * b : min(size * (b + 1), links) + 1]
        out[b, 0], out[b, 1] = some[:, 0].min() - ROUNDING, some[:, 0].max() + ROUNDING
        out[b, 2], out[b, 3] = some[:, 1].min() - ROUNDING, some[:, 1].max() + ROUNDING
    return out


@inline
def beyond(x: float, y: float, reach: float, box: Array) -> bool:
    """Return whether a rectangle x_min, x_max, y_min, y_max is farther from a point than a reach, in x or in y."""
    return bool(x < box[0] - reach or x > box[1] + reach or y < box[2] - reach or y > box[3] + reach)


@kernel
def beside(discs: Array, points: Array, distance: float) -> Array:
    """Return the discs whose surface is farther than a distance from all points, in their order."""
    out = np.empty_like(discs)
    count = 0
    for j in range(discs.shape[0]):
        out[count, 0], out[count, 1], out[count, 2] = discs[j, 0], discs[j, 1], discs[j, 2]
        clear = True
        for i in range(points.shape[0]):
            dx, dy, reach = discs[j, 0] - points[i, 0], discs[j, 1] - points[i, 1], discs[j, 2] + distance
            if max(abs(dx), abs(dy)) <= reach and math.hypot(dx, dy) <= reach:
                clear = False
        count += 1 if clear else 0
    return out[:count].copy()


@leaf
def check(
    xy: Array, arc: Array, points: Array, needed: Array, arcs: Array, blocks: Array, at: float, first: int,
    tolerance: float, blur: float, x0: float, y0: float, yaw: float, beams: Array, ranges: Array,
) -> tuple[float, float, bool]:  # fmt: skip
    """Return the point `at` an arc length of a polyline, and whether a beam from (x0, y0) ends near a route point ahead.

    Such a beam ends within needed[i] of a point i >= `first`, less `tolerance` and `blur` * (arcs[i] - at). `blocks` are from
    `surrounding`, for distances that are no shorter.
    """
    x_min, x_max, y_min, y_max = math.inf, -math.inf, math.inf, -math.inf
    begin = first // BLOCK
    for k in range(begin, blocks.shape[0]):
        x_min, x_max = min(x_min, blocks[k, 0]), max(x_max, blocks[k, 1])
        y_min, y_max = min(y_min, blocks[k, 2]), max(y_max, blocks[k, 3])
    px, py = point_at(xy, arc, at)
    cos, sin = math.cos(yaw), math.sin(yaw)
    for j in range(beams.shape[0]):
        if not 0.0 <= ranges[j] < math.inf:
            continue
        x = x0 + ranges[j] * (cos * beams[j, 0] - sin * beams[j, 1])
        y = y0 + ranges[j] * (sin * beams[j, 0] + cos * beams[j, 1])
        if x < x_min or x > x_max or y < y_min or y > y_max:
            continue
        for k in range(begin, blocks.shape[0]):
            if x < blocks[k, 0] or x > blocks[k, 1] or y < blocks[k, 2] or y > blocks[k, 3]:
                continue
            for i in range(max(first, BLOCK * k), min(BLOCK * (k + 1), points.shape[0])):
                dx, dy, distance = points[i, 0] - x, points[i, 1] - y, needed[i] - (tolerance + blur * (arcs[i] - at))
                if distance > 0.0 and dx * dx + dy * dy < distance * distance:
                    return px, py, True
    return px, py, False


@kernel
def route_points(
    xy: Array, arc: Array, at: Array, discs: Array, bounds: Array, inflate: float
) -> tuple[Array, Array, Array]:
    """Return the points of a polyline at ascending arc lengths, the clearance they keep, at most `inflate`, and `surrounding`."""
    points, needed = np.empty((len(at), 2)), np.empty(len(at))
    k = 0
    for i in range(len(at)):
        while k < len(arc) - 1 and arc[k + 1] <= at[i]:
            k += 1
        for axis in range(2):
            points[i, axis] = value_at(at[i], k, arc, xy[:, axis])
    point_clearances(points, discs, bounds, needed)
    for i in range(len(at)):
        needed[i] = min(needed[i], inflate)
    return points, needed, surrounding(points, needed)


@kernel
def surrounding(points: Array, distances: Array) -> Array:
    """Return rectangles around BLOCK points each with their distances: x_min, x_max, y_min, y_max (K, 4)."""
    out = np.empty(((points.shape[0] + BLOCK - 1) // BLOCK, 4))
    for k in range(out.shape[0]):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = math.inf, -math.inf, math.inf, -math.inf
        for i in range(BLOCK * k, min(BLOCK * (k + 1), points.shape[0])):
            reach = max(distances[i], 0.0) + ROUNDING
            out[k, 0], out[k, 1] = min(out[k, 0], points[i, 0] - reach), max(out[k, 1], points[i, 0] + reach)
            out[k, 2], out[k, 3] = min(out[k, 2], points[i, 1] - reach), max(out[k, 3], points[i, 1] + reach)
    return out


@leaf
def point_at(xy: Array, arc: Array, at: float) -> tuple[float, float]:
    """Return the point of a polyline at a distance from its start; `arc` holds the arc lengths of its points."""
    k = min(max(int(np.searchsorted(arc, at)), 1), arc.shape[0] - 1)
    share = min(max((at - arc[k - 1]) / (arc[k] - arc[k - 1]), 0.0), 1.0)
    return xy[k - 1, 0] + share * (xy[k, 0] - xy[k - 1, 0]), xy[k - 1, 1] + share * (xy[k, 1] - xy[k - 1, 1])
