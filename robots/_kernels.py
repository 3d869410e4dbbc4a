"""Compiled geometry of footprints and the inner loop of the controller: arrays in, arrays out."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from antdrive.worlds._kernels import doubled_rows, kernel, segment_clearance, wall_distance

Array = Any

NEAR = 0.25  # how far a list of near discs serves [m]


class Line(NamedTuple):
    """The route and, at every `ds` along it, what is allowed and what it is like."""

    xy: Array  # (N, 2)
    arc: Array  # (N,)
    lookahead: Array  # (S,) longest clear lookahead
    speed: Array  # (S,) speed limit
    curvature: Array  # (S,) NaN where the carrot alone rounds corners
    heading: Array  # (S,)


class Known(NamedTuple):
    """The obstacles that the controller knows of, by squares, see `bucket`."""

    discs: Array
    starts: Array
    bounds: Array
    side: float


class Limits(NamedTuple):
    """The robot's."""

    speed: float
    yaw_rate: float
    acceleration: float
    yaw_acceleration: float
    lateral: float
    half_track: float
    rim: float


class Tuning(NamedTuple):
    """The controller's settings, and what follows from them for one robot."""

    period: float
    ds: float
    guard: float  # from the centre to what carrot lines may touch
    floor: float  # and the arc on which it can still stop
    radius: float  # of the robot
    look_time: float
    look_min: float
    look_max: float
    look_floor: float
    turn_from: float
    turn_to: float
    turn_rest: float
    braking: float
    creep: float
    close: float
    near_speed: float
    near_time: float


# The rules that can hold the speed, in the order of pursuit.LIMITERS.
CRUISE, CURVATURE, ROUTE, YAW, GOAL, TURN, CREEP, CLEARANCE, DONE, ROOM = range(10)


@kernel
def footprint_clearances(poses: Array, shape: Array, discs: Array, bounds: Array, out: Array) -> None:
    """out[i] = distance from the footprint at poses[i] to the nearest disc surface or wall.

    `shape` holds half length, half width and rounding of a rounded rectangle.
    """
    hx, hy, rounding = shape[0], shape[1], shape[2]
    radius = math.hypot(hx, hy) + rounding
    near = np.empty_like(discs)
    count = 0
    anchor_x, anchor_y = math.inf, math.inf
    for i in range(poses.shape[0]):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        # Within NEAR of an anchor, only discs about as close to it as its closest can be the nearest to the footprint.
        if not math.hypot(x - anchor_x, y - anchor_y) <= NEAR:
            anchor_x, anchor_y = x, y
            closest = math.inf
            for j in range(discs.shape[0]):
                closest = min(closest, math.hypot(discs[j, 0] - x, discs[j, 1] - y) - discs[j, 2])
            count = 0
            for j in range(discs.shape[0]):
                if math.hypot(discs[j, 0] - x, discs[j, 1] - y) - discs[j, 2] <= closest + radius + 2.0 * NEAR:
                    near[count, 0], near[count, 1], near[count, 2] = discs[j, 0], discs[j, 1], discs[j, 2]
                    count += 1
        reach_x = hx * abs(cos) + hy * abs(sin) + rounding
        reach_y = hx * abs(sin) + hy * abs(cos) + rounding
        best = min(
            min(x - reach_x - bounds[0], bounds[2] - x - reach_x),
            min(y - reach_y - bounds[1], bounds[3] - y - reach_y),
        )
        for j in range(count):
            dx, dy = near[j, 0] - x, near[j, 1] - y
            qx = abs(cos * dx + sin * dy) - hx
            qy = abs(cos * dy - sin * dx) - hy
            outside = math.hypot(max(qx, 0.0), max(qy, 0.0))
            inside = min(max(qx, qy), 0.0)
            best = min(best, outside + inside - rounding - near[j, 2])
        out[i] = best


@kernel
def bucket(discs: Array, bounds: Array, side: float, reach: float) -> tuple[Array, Array]:
    """The discs that come within `reach` of each square of a coarse grid: rows, and where each square's rows start."""
    cols = int((bounds[2] - bounds[0]) / side) + 1
    rows = int((bounds[3] - bounds[1]) / side) + 1
    starts = np.zeros(rows * cols + 1, np.int64)
    found = np.empty((16 + discs.shape[0], 3))
    count = 0
    for b in range(rows * cols):
        x_lo, y_lo = bounds[0] + (b % cols) * side, bounds[1] + (b // cols) * side
        for j in range(discs.shape[0]):
            dx = max(max(x_lo - discs[j, 0], discs[j, 0] - x_lo - side), 0.0)
            dy = max(max(y_lo - discs[j, 1], discs[j, 1] - y_lo - side), 0.0)
            if math.hypot(dx, dy) - discs[j, 2] <= reach:
                if count == found.shape[0]:
                    found = doubled_rows(found)
                found[count, 0], found[count, 1], found[count, 2] = discs[j, 0], discs[j, 1], discs[j, 2]
                count += 1
        starts[b + 1] = count
    return found[:count].copy(), starts


@kernel
def nearby(x: float, y: float, discs: Array, starts: Array, bounds: Array, side: float) -> Array:
    """The bucketed discs that matter near (x, y)."""
    cols = int((bounds[2] - bounds[0]) / side) + 1
    rows = int((bounds[3] - bounds[1]) / side) + 1
    c = min(max(int((x - bounds[0]) / side), 0), cols - 1)
    r = min(max(int((y - bounds[1]) / side), 0), rows - 1)
    return discs[starts[r * cols + c] : starts[r * cols + c + 1]]


@kernel
def point_at(s: float, k: int, xy: Array, arc: Array) -> tuple[float, float, int]:
    """The point at arc length s, searched forwards from segment k; beyond the end the last segment goes on."""
    n = xy.shape[0]
    while k < n - 2 and arc[k + 1] < s:
        k += 1
    f = (s - arc[k]) / (arc[k + 1] - arc[k])
    return xy[k, 0] + f * (xy[k + 1, 0] - xy[k, 0]), xy[k, 1] + f * (xy[k + 1, 1] - xy[k, 1]), k


@kernel
def clear_lookaheads(
    xy: Array, arc: Array, buckets: Array, starts: Array, side: float, bounds: Array,
    guard: float, ds: float, low: float, high: float, out: Array,
) -> None:  # fmt: skip
    """out[i] = how far ahead of i * ds along the route a straight line to the route keeps `guard` from everything.

    At least `low`, at most `high`. Where the route itself comes closer than `guard`, its own distance counts instead.
    """
    step = 0.5 * low
    k = 0
    for i in range(out.shape[0]):
        s = min(i * ds, arc[-1])
        ax, ay, k = point_at(s, k, xy, arc)
        discs = nearby(ax, ay, buckets, starts, bounds, side)
        own = min(guard, segment_clearance(ax, ay, ax, ay, discs, bounds))
        reach, kk, length = low, k, low
        while length < high:
            length = min(length + step, high)
            t = min(s + length, arc[-1])
            bx, by, kk = point_at(t, kk, xy, arc)
            c = segment_clearance(ax, ay, bx, by, discs, bounds)
            if c < own - 1e-9 and c < segment_clearance(bx, by, bx, by, discs, bounds) - 1e-9:
                break
            reach = length
        out[i] = reach


@kernel
def brake_backwards(limit: Array, ds: float, deceleration: float) -> None:
    """Lower each speed so that the ones after it can be reached by braking: v_i^2 <= v_{i+1}^2 + 2 a ds."""
    for i in range(limit.shape[0] - 2, -1, -1):
        limit[i] = min(limit[i], math.sqrt(limit[i + 1] * limit[i + 1] + 2.0 * deceleration * ds))


@kernel
def arc_clearance(
    x: float,
    y: float,
    yaw: float,
    curvature: float,
    sweep: float,
    ex: float,
    ey: float,
    discs: Array,
    bounds: Array,
) -> float:
    """Distance from a circular arc to the nearest disc surface or wall.

    The arc leaves (x, y) along `yaw`, turns by `sweep` and ends at (ex, ey).
    """
    if abs(sweep) < 1e-6:
        return segment_clearance(x, y, ex, ey, discs, bounds)
    radius = 1.0 / abs(curvature)
    cx, cy = x - math.sin(yaw) / curvature, y + math.cos(yaw) / curvature
    first = math.atan2(y - cy, x - cx)
    best = min(wall_distance(x, y, bounds), wall_distance(ex, ey, bounds))
    for q in range(4):  # the arc's extreme points in x and y
        angle = q * 0.5 * math.pi
        if on_arc(angle, first, sweep):
            best = min(best, wall_distance(cx + radius * math.cos(angle), cy + radius * math.sin(angle), bounds))
    for j in range(discs.shape[0]):
        px, py = discs[j, 0], discs[j, 1]
        d = min(math.hypot(px - x, py - y), math.hypot(px - ex, py - ey))
        if d - discs[j, 2] - radius * abs(sweep) > best:
            continue
        if on_arc(math.atan2(py - cy, px - cx), first, sweep):
            d = min(d, abs(math.hypot(px - cx, py - cy) - radius))
        best = min(best, d - discs[j, 2])
    return best


@kernel
def on_arc(angle: float, first: float, sweep: float) -> bool:
    """Whether an angle lies on the arc that starts at `first` and turns by `sweep`."""
    turn = (angle - first) % (2.0 * math.pi)
    if sweep < 0:
        turn = (2.0 * math.pi - turn) % (2.0 * math.pi)
    return bool(turn <= abs(sweep))


@kernel
def project(x: float, y: float, progress: float, window: float, xy: Array, arc: Array) -> tuple[float, int]:
    """The arc length of the route point nearest to (x, y), between `progress` and `window` beyond it."""
    n = xy.shape[0]
    k = 0
    while k < n - 2 and arc[k + 1] < progress:
        k += 1
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


@kernel
def carrot_at(x: float, y: float, lookahead: float, s: float, k: int, xy: Array, arc: Array) -> tuple[float, float]:
    """The first route point beyond s at distance `lookahead` from the robot; the last segment is prolonged for it."""
    n = xy.shape[0]
    ax, ay, k = point_at(s, k, xy, arc)
    if math.hypot(ax - x, ay - y) >= lookahead:  # farther from the route than it looks ahead: go straight back to it
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


@kernel
def clip(value: float, low: float, high: float) -> float:
    """The value, moved into [low, high]."""
    return min(max(value, low), high)


@kernel
def keep_wheels_within(v: float, w: float, half_track: float, fastest: float) -> tuple[float, float]:
    """Scale speed and yaw rate together, so that no wheel's rim exceeds `fastest` [m/s] and the curvature stays."""
    rim = abs(v) + abs(w) * half_track
    if rim > fastest:
        v, w = v * fastest / rim, w * fastest / rim
    return v, w


@kernel
def slow_for_curvature(curvature: float, lateral: float, yaw_rate: float) -> float:
    """The speed at which a curve asks for no more than the lateral acceleration and the yaw rate allowed."""
    k = abs(curvature)
    if k < 1e-9:
        return math.inf
    return min(math.sqrt(lateral / k), yaw_rate / k)


@kernel
def slow_for_yaw(curvature: float, yaw_rate: float, yaw_acceleration: float, time: float) -> float:
    """The speed at which the yaw rate of a curve can be reached within `time`."""
    k = abs(curvature)
    if k < 1e-9:
        return math.inf
    turning = yaw_rate if curvature > 0 else -yaw_rate
    return max(turning + yaw_acceleration * time, 0.0) / k


@kernel
def slow_for_room(room: float, slowest: float, time: float) -> float:
    """The speed that so much room beside the robot allows: it grows by 1 m/s with each `time` metres."""
    return slowest + max(room, 0.0) / time


@kernel
def brake_for_goal(remaining: float, deceleration: float) -> float:
    """The speed from which the robot can still stop in `remaining` metres."""
    return math.sqrt(2.0 * deceleration * max(remaining, 0.0))


@kernel
def stopping_clearance(
    x: float,
    y: float,
    yaw: float,
    v: float,
    w: float,
    deceleration: float,
    dt: float,
    discs: Array,
    bounds: Array,
) -> float:
    """The clearance of the arc that a robot still drives when it brakes after one more period."""
    length = v * dt + 0.5 * v * v / deceleration
    sweep = w / v * length
    chord = length if abs(sweep) < 1e-6 else 2.0 * v / w * math.sin(0.5 * sweep)
    ex, ey = x + chord * math.cos(yaw + 0.5 * sweep), y + chord * math.sin(yaw + 0.5 * sweep)
    return arc_clearance(x, y, yaw, w / v, sweep, ex, ey, discs, bounds)


@kernel
def pursue(
    x: float, y: float, yaw: float, v: float, w: float, progress: float, turning: bool,
    line: Line, known: Known, limits: Limits, tuning: Tuning,
) -> tuple[float, float, float, bool, int]:  # fmt: skip
    """One control period: the next command (speed, yaw rate), the progress, whether it turns on the spot, the limiter."""
    xy, arc, lookaheads, speeds, curvatures, headings = line
    acc, yaw_acc, max_w = limits.acceleration, limits.yaw_acceleration, limits.yaw_rate
    dt, ds, look_min, creep = tuning.period, tuning.ds, tuning.look_min, tuning.creep
    bounds = known.bounds
    discs = nearby(x, y, known.discs, known.starts, bounds, known.side)
    s, k = project(x, y, progress, tuning.look_max, xy, arc)
    remaining = arc[-1] - s
    i = min(int(s / ds), lookaheads.shape[0] - 1)
    j = min(i + 1, lookaheads.shape[0] - 1)
    reach = min(lookaheads[i], lookaheads[j])

    # Shrink the lookahead until the arc to the carrot keeps its distance: corners are cut only where there is room.
    room = segment_clearance(x, y, x, y, discs, bounds)
    guard = min(tuning.guard, room - 5e-4)
    end = max(0.35 * remaining, look_min)  # near the end it looks less far, to come to stand there and not beside it
    look = clip(max(tuning.look_time * v, tuning.look_floor), look_min, min(reach, end))
    blocked = True
    cx, cy, left, ahead, distance, bearing = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    while True:
        cx, cy = carrot_at(x, y, look, s, k, xy, arc)
        dx, dy = cx - x, cy - y
        ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
        left = math.cos(yaw) * dy - math.sin(yaw) * dx
        distance = math.hypot(dx, dy)
        bearing = math.atan2(left, ahead)
        if abs(bearing) < tuning.turn_from:
            kappa = 2.0 * left / (distance * distance)
            if arc_clearance(x, y, yaw, kappa, 2.0 * bearing, cx, cy, discs, bounds) >= guard:
                blocked = False
                break
        if look <= look_min:
            break
        look = max(0.75 * look, look_min)

    stopped_at_goal = remaining <= tuning.close
    if turning:
        turning = abs(bearing) > tuning.turn_to
    elif (blocked and abs(bearing) > tuning.turn_to) or abs(bearing) > (
        tuning.turn_from if v > creep else tuning.turn_rest
    ):
        turning = True

    limiter = CRUISE
    if stopped_at_goal:
        target, limiter = 0.0, DONE
        curvature = 0.0
    elif turning:
        target, limiter = 0.0, TURN
        curvature = 0.0
    else:
        curvature = 2.0 * left / (distance * distance)
        if not math.isnan(curvatures[i]):
            # On the route the carrot would cut its bends. So the route's own curvature is driven, a period ahead, and of the
            # carrot's only what is due to being off the route.
            f = min((s - i * ds) / ds, 1.0)
            px, py, _ = point_at(s, k, xy, arc)
            cx, cy = carrot_at(px, py, look, s, k, xy, arc)
            facing = headings[i] + f * (headings[j] - headings[i])
            left = math.cos(facing) * (cy - py) - math.sin(facing) * (cx - px)
            curvature -= 2.0 * left / ((cx - px) * (cx - px) + (cy - py) * (cy - py))
            ahead = min(s + max(v, 0.0) * dt, arc[-1]) / ds
            h = min(int(ahead), curvatures.shape[0] - 2)
            curvature += curvatures[h] + (ahead - h) * (curvatures[h + 1] - curvatures[h])
        target = limits.speed
        bound = slow_for_curvature(curvature, limits.lateral, max_w)
        if bound < target:
            target, limiter = bound, CURVATURE
        bound = min(speeds[i], speeds[j])
        if bound < target:
            target, limiter = bound, ROUTE
        bound = slow_for_room(room - tuning.radius, tuning.near_speed, tuning.near_time)
        if bound < target:
            target, limiter = bound, ROOM
        bound = slow_for_yaw(curvature, w, yaw_acc, 0.2)
        if bound < target:
            target, limiter = bound, YAW
        bound = brake_for_goal(remaining - 0.5 * tuning.close, tuning.braking * acc)
        if bound < target:
            target, limiter = bound, GOAL
        if blocked:
            target, limiter = min(target, creep), CREEP
        target = max(target, min(creep, limits.speed))

    new_v = clip(target, v - acc * dt, v + acc * dt)
    if turning and not stopped_at_goal:
        # Brake first; turn on the spot once (nearly) standing, so that the footprint stays where it was checked.
        want = 0.0
        if abs(new_v) < creep:
            want = math.copysign(min(max_w, math.sqrt(yaw_acc * abs(bearing))), bearing)
        elif v > 0.0:
            want = w * new_v / v
    else:
        want = curvature * new_v
    new_w = clip(want, max(w - yaw_acc * dt, -max_w), min(w + yaw_acc * dt, max_w))
    new_v, new_w = keep_wheels_within(new_v, new_w, limits.half_track, limits.rim)

    # Whatever the rules above say: the arc on which the robot can still stop must be clear. It was for the last command, so
    # braking on that one's curve is safe.
    if new_v > creep and stopping_clearance(x, y, yaw, new_v, new_w, acc, dt, discs, bounds) < min(tuning.floor, guard):
        limiter = CLEARANCE
        new_v = max(v - acc * dt, 0.0)
        new_w = w * new_v / v if v > 0.0 else 0.0
    return new_v, new_w, s, turning, limiter
