"""Compiled path queries: nearest point, carrot, clear lookaheads, braking."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.robots.control._kernels_obstacles import ObstacleIndex, nearby, square_at
from antdrive.worlds._kernels import (
    ROUNDING,
    Array,
    inline,
    kernel,
    leaf,
    segment_clearance,
    segment_distance2,
    wall_distance,
)

NO_TURNS = np.empty(0)
NO_TURNS.setflags(write=False)  # as the turns of a route are: kernels are compiled for one type
STRETCH = 0.5  # length of route for which obstacles are chosen at once [m]


class PathSamples(NamedTuple):
    """A route and quantities at samples along it, at constant spacing.

    Attributes:
        xy: the route's points (N, 2) [m]
        arc: length along the route at each point (N,) [m]
        lookahead: the longest lookahead with a clear line to the carrot (S,) [m]
        speed: the speed limit (S,) [m/s]
        curvature: the route's curvature (S,) [1/m], NaN for a route with corners
        heading: the route's heading (S,) [rad]
        turns: turns on the spot at the points of a route of lines (N,) [rad]; none for other routes
        backwards: the robot drives backwards up to this arc length of a route of lines [m]
    """

    xy: Array
    arc: Array
    lookahead: Array
    speed: Array
    curvature: Array
    heading: Array
    turns: Array = NO_TURNS
    backwards: float = 0.0


@leaf
def point_at(s: float, k: int, xy: Array, arc: Array) -> tuple[float, float, int]:
    """Return the point at arc length s and its segment, from segment k on; the last one extends past the end."""
    n = xy.shape[0]
    while k < n - 2 and arc[k + 1] < s:
        k += 1
    f = (s - arc[k]) / (arc[k + 1] - arc[k])
    return xy[k, 0] + f * (xy[k + 1, 0] - xy[k, 0]), xy[k, 1] + f * (xy[k + 1, 1] - xy[k, 1]), k


@leaf
def segment_at(s: float, arc: Array) -> int:
    """Return the first segment that ends at arc length s or beyond; the last one extends past the end."""
    low, high = 0, arc.shape[0] - 2
    while low < high:
        middle = (low + high) // 2
        if arc[middle + 1] < s:
            low = middle + 1
        else:
            high = middle
    return low


@leaf
def project(x: float, y: float, progress: float, window: float, xy: Array, arc: Array) -> tuple[float, int]:
    """Return arc length and segment of the point nearest to (x, y), between `progress` and `window` beyond it."""
    n, k = xy.shape[0], segment_at(progress, arc)
    best, best_s, best_k = math.inf, progress, k
    while k < n - 1 and arc[k] <= progress + window:
        ax, ay = xy[k, 0], xy[k, 1]
        length = arc[k + 1] - arc[k]
        ux, uy = (xy[k + 1, 0] - ax) / length, (xy[k + 1, 1] - ay) / length
        f = (x - ax) * ux + (y - ay) * uy
        f = min(max(f, progress - arc[k]), min(length, progress + window - arc[k]))
        f = max(f, 0.0)
        d = math.hypot(ax + f * ux - x, ay + f * uy - y)
        if d < best - 1e-12:
            best, best_s, best_k = d, arc[k] + f, k
        k += 1
    return best_s, best_k


@leaf
def carrot_at(x: float, y: float, lookahead: float, s: float, k: int, xy: Array, arc: Array) -> tuple[float, float]:
    """Return the first route point beyond arc length s at distance `lookahead` from the robot at (x, y).

    Past the route's end it is on the extension of the last segment.
    """
    n = xy.shape[0]
    ax, ay, k = point_at(s, k, xy, arc)
    if math.hypot(ax - x, ay - y) >= lookahead:  # too far from the route: return straight to it
        return ax, ay
    while True:
        bx, by = xy[k + 1, 0], xy[k + 1, 1]
        last = k == n - 2
        if last or math.hypot(bx - x, by - y) >= lookahead:
            length = arc[k + 1] - arc[k]
            ux, uy = (bx - xy[k, 0]) / length, (by - xy[k, 1]) / length
            along = (ax - x) * ux + (ay - y) * uy
            off2 = (ax - x) * (ax - x) + (ay - y) * (ay - y) - lookahead * lookahead
            f = -along + math.sqrt(max(along * along - off2, 0.0))
            return ax + f * ux, ay + f * uy
        ax, ay = bx, by
        k += 1


@leaf
def clearance_below(most: float, ax: float, ay: float, bx: float, by: float, discs: Array, bounds: Array) -> float:
    """Return the clearance of a segment if it is less than `most`, otherwise a value of at least `most`."""
    best = min(wall_distance(ax, ay, bounds), wall_distance(bx, by, bounds))
    mx, my, half = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * math.hypot(bx - ax, by - ay) + ROUNDING
    for j in range(discs.shape[0]):
        dx, dy, reach = discs[j, 0] - mx, discs[j, 1] - my, min(best, most) + discs[j, 2] + half
        if dx * dx + dy * dy <= reach * reach:
            away2 = segment_distance2(discs[j, 0], discs[j, 1], ax, ay, bx, by)
            best = min(best, math.sqrt(away2) - discs[j, 2])
    return best


@inline
def within_reach(x: float, y: float, reach: float, discs: Array, out: Array) -> Array:
    """Return the discs (N, 3) whose surfaces are within reach of a point, in order; `out` has room for all."""
    count = 0
    for j in range(discs.shape[0]):
        dx, dy, far = discs[j, 0] - x, discs[j, 1] - y, reach + discs[j, 2]
        if dx * dx + dy * dy <= far * far:
            out[count, 0], out[count, 1], out[count, 2] = discs[j, 0], discs[j, 1], discs[j, 2]
            count += 1
    return out[:count]


@inline
def beside_route(
    ax: float, ay: float, end: float, k: int, distance: float, xy: Array, arc: Array, discs: Array
) -> Array:
    """Return the discs, moved to the front, that may be within a distance of a line between two points of the route.

    The points are between (ax, ay) on segment k and arc length `end`; their bounding box contains all such lines.
    """
    bx, by, last = point_at(end, k, xy, arc)
    x_min, x_max, y_min, y_max = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
    for i in range(k + 1, last + 1):
        x_min, x_max = min(x_min, xy[i, 0]), max(x_max, xy[i, 0])
        y_min, y_max = min(y_min, xy[i, 1]), max(y_max, xy[i, 1])
    count = 0
    for j in range(discs.shape[0]):
        x, y, far = discs[j, 0], discs[j, 1], distance + discs[j, 2]
        if x_min - far <= x <= x_max + far and y_min - far <= y <= y_max + far:
            discs[count, 0], discs[count, 1], discs[count, 2] = x, y, discs[j, 2]
            count += 1
    return discs[:count]


@kernel
def clear_lookaheads(
    xy: Array, arc: Array, obstacles: ObstacleIndex, clearance: float, spacing: float, low: float, high: float,
    out: Array,
) -> None:  # fmt: skip
    """Fill out[i] with the longest lookahead at i * spacing whose straight line to the carrot keeps `clearance`.

    At least `low`, at most `high`. Where the route is closer to obstacles, the line may be as close as the route.
    """
    bounds, reach = obstacles.bounds, high + clearance + ROUNDING
    step = 0.5 * low
    k = 0
    chosen, kept = np.empty((16, 3)), np.empty((16, 3))
    around, square, begin = chosen, -1, 0.0
    for i in range(out.shape[0]):
        s = min(i * spacing, arc[-1])
        ax, ay, k = point_at(s, k, xy, arc)
        if s > begin + STRETCH or square_at(ax, ay, obstacles) != square:
            square, begin = square_at(ax, ay, obstacles), s
            known = nearby(ax, ay, reach + STRETCH + ROUNDING, obstacles)
            if known.shape[0] > kept.shape[0]:
                chosen, kept = np.empty((2 * known.shape[0], 3)), np.empty((2 * known.shape[0], 3))
            around = within_reach(ax, ay, reach + STRETCH + ROUNDING, known, chosen)
        discs = within_reach(ax, ay, reach, around, kept)
        required = min(clearance, segment_clearance(ax, ay, ax, ay, discs, bounds))
        discs = beside_route(ax, ay, min(s + high, arc[-1]), k, required + ROUNDING, xy, arc, discs)
        clear, kk, length = low, k, low
        while length < high:
            length = min(length + step, high)
            t = min(s + length, arc[-1])
            bx, by, kk = point_at(t, kk, xy, arc)
            c = clearance_below(required, ax, ay, bx, by, discs, bounds)
            if c < required - 1e-9 and c < segment_clearance(bx, by, bx, by, discs, bounds) - 1e-9:
                break
            clear = length
        out[i] = clear


@leaf
def brake_backwards(limit: Array, spacing: float, deceleration: float) -> None:
    """Lower each speed so that braking reaches the next: v_i^2 <= v_{i+1}^2 + 2 a ds."""
    for i in range(limit.shape[0] - 2, -1, -1):
        limit[i] = min(limit[i], math.sqrt(limit[i + 1] * limit[i + 1] + 2.0 * deceleration * spacing))
