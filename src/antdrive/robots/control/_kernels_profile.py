"""Compiled speed profile and speed limits of a route: arrays in, arrays out.

Distances are in metres, angles in radians.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.robots.control._kernels_obstacles import ObstacleIndex, nearby, square_at
from antdrive.robots.control._kernels_path import STRETCH, brake_backwards, within_reach
from antdrive.worlds._kernels import ROUNDING, Array, inline, kernel, leaf, point_clearances

TURN = 2.0 * math.pi


@inline
def allowed_gain(v2: float, curvature: float, change: float, acceleration: float, yaw_acceleration: float) -> float:
    """Return the acceleration a at speed v that also keeps the yaw acceleration, `change v^2 + curvature a`."""
    k = abs(curvature)
    if k * acceleration <= 1e-12:
        return acceleration
    return min(acceleration, max(0.0, yaw_acceleration - math.copysign(1.0, curvature) * change * v2) / k)


@leaf
def limit_speeds(
    arc: Array, curvature: Array, change: Array, max_speed: float, lateral_acceleration: float, yaw_rate: float,
    yaw_acceleration: float, half_track: float, rim_speed: float, acceleration: float, deceleration: float,
    speed: Array, limit: Array,
) -> None:  # fmt: skip
    """Fill in speed and limit along a leg from rest to rest; the limit is independent of the initial speed.

    A backward pass lowers each limit so that braking reaches the next. A forward pass lowers the speeds so that acceleration
    reaches them.
    """
    last = len(arc) - 1
    for i in range(last):
        k, dk = abs(curvature[i]), abs(change[i])
        v = min(max_speed, rim_speed / (1.0 + k * half_track))
        if k > 1e-12:
            v = min(v, min(math.sqrt(lateral_acceleration / k), yaw_rate / k))
        if dk > 1e-12:
            v = min(v, math.sqrt(yaw_acceleration / dk))
        limit[i] = v
    limit[last] = 0.0
    for i in range(last - 1, -1, -1):
        v2 = limit[i + 1] * limit[i + 1]
        a = min(
            allowed_gain(v2, curvature[i + 1], -change[i + 1], deceleration, yaw_acceleration),
            allowed_gain(v2, curvature[i], -change[i], deceleration, yaw_acceleration),
        )
        limit[i] = min(limit[i], math.sqrt(v2 + 2.0 * a * (arc[i + 1] - arc[i])))
    speed[0] = 0.0
    for i in range(1, last + 1):
        v2 = speed[i - 1] * speed[i - 1]
        a = min(
            allowed_gain(v2, curvature[i - 1], change[i - 1], acceleration, yaw_acceleration),
            allowed_gain(v2, curvature[i], change[i], acceleration, yaw_acceleration),
        )
        speed[i] = min(limit[i], math.sqrt(v2 + 2.0 * a * (arc[i] - arc[i - 1])))


@inline
def turning_time(angle: float, yaw_rate: float, yaw_acceleration: float) -> float:
    """Return the time to rotate in place by an angle, from rest to rest [s]."""
    spin_up = yaw_rate / yaw_acceleration
    if abs(angle) >= yaw_rate * spin_up:
        return abs(angle) / yaw_rate + spin_up
    return 2.0 * math.sqrt(abs(angle) / yaw_acceleration)


@kernel
def headings_along(xy: Array, arc: Array, bend: Array, rotate_above: float) -> tuple[Array, Array, Array, Array]:
    """Return the piecewise linear heading along a route, and arc lengths and angles of rotations in place.

    The heading is given by arc lengths and values. It is linear on arcs; a corner occurs twice. Rotations in place are
    omitted from it. `bend` is the curvature from each point on; empty: unknown.
    """
    n = xy.shape[0] - 1
    places, headings = np.empty(2 * n), np.empty(2 * n)
    stops, turns, count = np.empty(n), np.empty(n), 0
    begin, before, heading = 0.0, 0.0, 0.0
    turned, rotated = 0.0, 0.0
    for i in range(n):
        here = math.atan2(xy[i + 1, 1] - xy[i, 1], xy[i + 1, 0] - xy[i, 0])
        places[2 * i], places[2 * i + 1] = arc[i], arc[i + 1]
        if i == 0:
            begin, heading = here, here + 0.0
            headings[0], headings[1] = heading, heading
        else:
            turn = here - before
            turn -= TURN * np.round(turn / TURN)
            turned += turn
            after = begin + turned
            corner = len(bend) == 0 or bend[i - 1] != bend[i] or bend[i] == 0.0  # else a vertex of a sampled arc
            start, end = (after, heading) if corner else ((after + heading) / 2.0, (after + heading) / 2.0)
            headings[2 * i - 1] = end - rotated
            if corner and abs(turn) >= rotate_above:
                stops[count], turns[count], count = arc[i], turn, count + 1
                rotated += turn
            headings[2 * i], headings[2 * i + 1] = start - rotated, after - rotated
            heading = after
        before = here
    return places, headings, stops[:count], turns[:count]


@kernel
def profile_along(
    xy: Array, arc: Array, bend: Array, blend: float, blend2: float, rotate_above: float, step: float,
    max_speed: float, lateral_acceleration: float, yaw_rate: float, yaw_acceleration: float, half_track: float,
    rim_speed: float, acceleration: float, deceleration: float,
) -> Array:  # fmt: skip
    """Return the rows of a `speed_profile` (6, S).

    Headings are averaged over `blend` on both sides with triangular weights. The heading is piecewise linear, so its average
    and the average's derivatives are exact second differences of its first and second integrals. `blend2` is `blend` squared.
    """
    places, headings, stops, turns = headings_along(xy, arc, bend, rotate_above)
    n = len(places) - 1
    slopes, first, second = np.empty(n), np.zeros(n + 1), np.zeros(n + 1)  # integrals of the heading
    for i in range(n):
        width = places[i + 1] - places[i]
        slopes[i] = (headings[i + 1] - headings[i]) / (width if width > 0.0 else 1.0)
        first[i + 1] = first[i] + width * (headings[i + 1] + headings[i]) / 2.0
        growth = first[i] * width + headings[i] * (width * width) / 2.0 + slopes[i] * math.pow(width, 3.0) / 6.0
        second[i + 1] = second[i] + growth
    lengths, samples = np.empty(len(stops) + 1, dtype=np.int64), 0
    for leg in range(len(lengths)):
        begin, end = stops[leg - 1] if leg > 0 else 0.0, stops[leg] if leg < len(stops) else arc[-1]
        lengths[leg] = max(3, int(math.ceil((end - begin) / step)) + 1)
        samples += lengths[leg]
    out, change = np.empty((6, samples)), np.empty(samples)
    sums, segment = np.empty((3, 3)), np.zeros(3, dtype=np.int64)
    low, now, turned = 0, 0.0, 0.0
    spin = min(yaw_rate, rim_speed / half_track)
    for leg in range(len(lengths)):
        begin, end = stops[leg - 1] if leg > 0 else 0.0, stops[leg] if leg < len(stops) else arc[-1]
        if leg > 0:
            now += turning_time(turns[leg - 1], spin, yaw_acceleration)
            turned += turns[leg - 1]
        high = low + lengths[leg]
        spacing = (end - begin) / (lengths[leg] - 1)
        for k in range(low, high):
            s = (k - low) * spacing + begin if k < high - 1 else end
            for side in range(3):
                t = s + blend * (side - 1)
                inside = min(max(t, places[0]), places[-1])
                i = segment[side]
                while i < n - 1 and places[i + 1] <= inside:
                    i += 1
                segment[side] = i
                d, beyond = inside - places[i], t - inside
                sums[0, side] = headings[i] + slopes[i] * d
                one = first[i] + headings[i] * d + slopes[i] * (d * d) / 2.0
                cube = slopes[i] * math.pow(d, 3.0) / 6.0
                two = second[i] + first[i] * d + headings[i] * (d * d) / 2.0 + cube
                sums[1, side] = one + sums[0, side] * beyond
                sums[2, side] = two + one * beyond + sums[0, side] * (beyond * beyond) / 2.0
            out[0, k] = s
            change[k] = (sums[0, 2] - 2.0 * sums[0, 1] + sums[0, 0]) / blend2
            out[3, k] = (sums[1, 2] - 2.0 * sums[1, 1] + sums[1, 0]) / blend2
            out[4, k] = (sums[2, 2] - 2.0 * sums[2, 1] + sums[2, 0]) / blend2 + turned
        limit_speeds(
            out[0, low:high], out[3, low:high], change[low:high], max_speed, lateral_acceleration, yaw_rate,
            yaw_acceleration, half_track, rim_speed, acceleration, deceleration, out[1, low:high], out[5, low:high],
        )  # fmt: skip
        elapsed = 0.0
        out[2, low] = now + elapsed
        for k in range(low + 1, high):
            elapsed += 2.0 * (out[0, k] - out[0, k - 1]) / (out[1, k] + out[1, k - 1])
            out[2, k] = now + elapsed
        low, now = high, out[2, high - 1]
    return out


@kernel
def samples_along(
    profile: Array, xy: Array, arc: Array, lookahead: Array, obstacles: ObstacleIndex, spacing: float, radius: float,
    lookahead_time: float, speed_near: float, time_near: float, deceleration: float,
) -> Array:  # fmt: skip
    """Return speed limit, curvature and heading at the samples of a route (3, S).

    The limit is the minimum of profile, clearance and lookahead; near obstacles it is `speed_near` + clearance / `time_near`.
    Discs too far away to lower the profile are left out.
    """
    count = len(lookahead)
    out, points, clearance = np.empty((3, count)), np.empty((count, 2)), np.empty(count)
    place, k = 0, 0
    for i in range(count):
        at = spacing * i
        while place < len(arc) - 1 and arc[place + 1] <= at:
            place += 1
        for axis in range(2):
            points[i, axis] = value_at(at, place, arc, xy[:, axis])
        while k < profile.shape[1] - 1 and profile[0, k + 1] <= at:
            k += 1
        for row in range(3):
            out[row, i] = value_at(at, k, profile[0], profile[5 if row == 0 else row + 2])
    reach = radius + max(0.0, profile[5].max() - speed_near) * time_near + STRETCH + ROUNDING
    first = 0
    for i in range(1, count + 1):
        x, y = points[first, 0], points[first, 1]
        near = i < count and math.hypot(points[i, 0] - x, points[i, 1] - y) <= STRETCH
        if near and square_at(points[i, 0], points[i, 1], obstacles) == square_at(x, y, obstacles):
            continue
        known = nearby(x, y, reach, obstacles)
        discs = within_reach(x, y, reach, known, np.empty((known.shape[0], 3)))
        point_clearances(points[first:i], discs, obstacles.bounds, clearance[first:i])
        first = i
    for i in range(count):
        near = speed_near + max(clearance[i] - radius, 0.0) / time_near
        out[0, i] = min(min(lookahead[i] / lookahead_time, out[0, i]), near)
    for k in range(1, profile.shape[1]):
        if profile[0, k] == profile[0, k - 1]:  # a stop
            first = int(profile[0, k] / spacing)
            out[0, first : first + 2] = 0.0
    brake_backwards(out[0], spacing, deceleration)
    return out


@inline
def value_at(x: float, k: int, places: Array, values: Array) -> float:
    """Return the value at x, interpolated after place k, the last that is not beyond x."""
    if k == len(places) - 1 or places[k] == x:
        return float(values[k])
    return float((values[k + 1] - values[k]) / (places[k + 1] - places[k]) * (x - places[k]) + values[k])
