"""Compiled line tracking: straights driven facing along them, turns on the spot at corners.

The yaw rate is proportional to the speed, so that errors decay over a distance instead of a time (C. Samson, *Control of
chained systems*, IEEE Trans. Automatic Control 40, 1995, in the form without inversion by the speed).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.robots._kernels_footprint import comes_within, footprint_gap, outer_radius
from antdrive.robots.control._kernels_obstacles import ObstacleIndex, clearance_at, nearby, nearest_bound
from antdrive.robots.control._kernels_path import PathSamples
from antdrive.robots.control._kernels_pursuit import (
    BRAKING,
    DONE,
    GOAL,
    ROTATE,
    ROUTE,
    START_TOLERANCE,
    MotionLimits,
    PursuitTuning,
    clear_turn,
    clip,
    keep_wheels_within,
    pursue,
    reachable_yaw_rate,
    rotation,
    speed_limit,
    unpacked,
)
from antdrive.worlds._kernels import Array, inline, kernel, leaf

PASSED = 0.02  # smallest corner at which the robot stops and turns [rad]
AGAIN = 0.05  # smallest heading error at a corner for a further turn [rad]
TURNED = 0.01  # heading error at which a turn ends [rad]
SETTLED = 0.1  # yaw rate at which a turn ends [rad/s]
NEAREST, RESPONSE = 0.2, 0.15  # errors decay over this distance, or this time at speed [m], [s]
STEEPEST = 0.5  # largest angle at which the robot returns to a straight [rad]
CHECKED = 0.05  # distance between the checked poses of a stopping path [m]


class Straight(NamedTuple):
    """Straight of a route: a point (x, y), its direction (ux, uy), the robot's heading, and 1 forwards or -1 backwards."""

    x: float
    y: float
    ux: float
    uy: float
    facing: float
    side: float


@inline
def advance(
    x: float, y: float, yaw: float, v: float, w: float, progress: float, turning: bool,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
) -> tuple[float, float, float, bool, int]:  # fmt: skip
    """Compute one control period: next speed and yaw rate, progress, whether to turn on the spot, and the limiter."""
    if path.turns.shape[0] == 0:
        return pursue(x, y, yaw, v, w, progress, turning, path, obstacles, limits, tuning)
    return follow_lines(x, y, yaw, v, w, progress, turning, path, obstacles, limits, tuning)


@kernel
def follow_packed(
    x: float, y: float, yaw: float, v: float, w: float, progress: float, turning: bool,
    xy: Array, arc: Array, lookahead: Array, speed: Array, curvature: Array, heading: Array, turns: Array,
    discs: Array, starts: Array, bounds: Array, corner: Array, corners: Array, n: Array,
) -> tuple[float, float, float, bool, int]:  # fmt: skip
    """Compute one control period along the straights of a path in the form of `TrackedPath.packed`."""
    path, obstacles, limits, tuning = unpacked(
        xy, arc, lookahead, speed, curvature, heading, turns, discs, starts, bounds, corner, corners, n
    )
    return follow_lines(x, y, yaw, v, w, progress, turning, path, obstacles, limits, tuning)


@kernel
def wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@leaf
def next_stop(k: int, path: PathSamples) -> int:
    """Return the first point after segment k at which the robot stops: a corner, a reversal or the end."""
    j = k + 1
    while j < path.xy.shape[0] - 1 and abs(path.turns[j]) < PASSED and path.arc[j] != path.backwards:
        j += 1
    return j


@leaf
def outline_radius(tuning: PursuitTuning) -> float:
    """Return the circumscribed radius of the footprint [m]."""
    return outer_radius(tuning.half_length, tuning.half_width, tuning.rounding, tuning.corners)


@leaf
def outline_clearance(
    x: float, y: float, yaw: float, obstacles: ObstacleIndex, tuning: PursuitTuning, most: float
) -> float:
    """Return the distance from the footprint at a pose to the nearest disc or wall; exact below `most`, else at least that."""
    radius = outline_radius(tuning)
    discs = nearby(x, y, radius + min(most, nearest_bound(x, y, obstacles) + radius), obstacles)
    return footprint_gap(
        x, y, yaw, tuning.half_length, tuning.half_width, tuning.rounding, tuning.corners, discs, obstacles.bounds
    )


@leaf
def outline_within(
    required: float, x: float, y: float, yaw: float, discs: Array, bounds: Array, tuning: PursuitTuning
) -> bool:
    """Return whether the footprint at a pose is closer than required to a disc or wall."""
    return comes_within(
        required, x, y, yaw, tuning.half_length, tuning.half_width, tuning.rounding, tuning.corners, discs, bounds
    )


@kernel
def line_curvature(x: float, y: float, yaw: float, v: float, line: Straight) -> float:
    """Return the curvature that leads a robot back to a straight: errors decay over a distance."""
    reach = max(NEAREST, RESPONSE * v)
    aside = (x - line.x) * line.uy - (y - line.y) * line.ux
    back = clip(0.5 * aside / reach, -STEEPEST, STEEPEST)
    return float(2.0 * (back + wrapped(line.facing - yaw)) / reach)


@kernel
def stopping_poses(
    x: float, y: float, yaw: float, v: float, w: float, line: Straight, limits: MotionLimits, period: float
) -> Array:
    """Return poses (N, 3) of a robot that stops along a straight, steering back to it: one more period, then braking."""
    braked = 0.5 * v * v / limits.acceleration
    length = v * period + braked
    count = int(length / CHECKED) + 1
    step = length / count
    poses = np.empty((count, 3))
    for i in range(count):
        speed = math.sqrt(2.0 * limits.acceleration * min(braked, length - (i + 0.5) * step))
        lasts = step / speed
        wanted = line_curvature(x, y, yaw, speed, line) * speed
        w = reachable_yaw_rate(wanted, w, lasts, limits)
        middle = yaw + 0.5 * w * lasts
        x, y = x + line.side * step * math.cos(middle), y + line.side * step * math.sin(middle)
        yaw += w * lasts
        poses[i, 0], poses[i, 1], poses[i, 2] = x, y, yaw
    return poses


@kernel
def follow_lines(
    x: float, y: float, yaw: float, v: float, w: float, progress: float, turning: bool,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
) -> tuple[float, float, float, bool, int]:  # fmt: skip
    """Compute one control period along the straights of a route.

    The robot stops at each corner and turns the way that the route gives. While it turns, the remaining angle is within half
    a turn of the middle of the corner's turn, so that an error at either end does not reverse it.
    """
    bounds, period, arc = obstacles.bounds, tuning.period, path.arc
    k = 0
    while k < arc.shape[0] - 2 and arc[k + 1] <= progress:
        k += 1
    side = -1.0 if arc[k] < path.backwards else 1.0
    v *= side
    length, dx, dy = arc[k + 1] - arc[k], x - path.xy[k, 0], y - path.xy[k, 1]
    ux, uy = (path.xy[k + 1, 0] - path.xy[k, 0]) / length, (path.xy[k + 1, 1] - path.xy[k, 1]) / length
    s = clip(arc[k] + dx * ux + dy * uy, progress, arc[k + 1])
    facing = math.atan2(side * uy, side * ux)
    line = Straight(path.xy[k, 0], path.xy[k, 1], ux, uy, facing, side)
    planned = path.turns[k] if progress <= arc[k] else 0.0
    turn = 0.5 * planned + wrapped(facing - yaw - 0.5 * planned)

    clearance = outline_clearance(x, y, yaw, obstacles, tuning, math.inf)
    stop = next_stop(k, path)
    remaining, last = arc[stop] - s, stop == arc.shape[0] - 1
    halt = 0.5 * tuning.creep_speed * tuning.creep_speed / limits.acceleration + tuning.creep_speed * period
    at_end = remaining <= (tuning.goal_distance if last else halt)

    if turning:
        turning = abs(turn) > TURNED or abs(w) > SETTLED
    elif progress <= arc[k]:
        turning = abs(turn) > max(PASSED, min(0.5 * abs(planned), AGAIN))
    else:
        turning = abs(turn) > (tuning.rotate_above if v > tuning.creep_speed else tuning.rotate_above_at_rest)
    curvature = 0.0
    if turning:
        s = progress
        target, limiter = 0.0, ROTATE
    elif at_end:
        target, limiter = 0.0, DONE if last else ROUTE
    else:
        curvature = line_curvature(x, y, yaw, v, line)
        i = min(int(s / tuning.spacing), path.speed.shape[0] - 2)
        route_speed = min(path.speed[i], path.speed[i + 1])
        # The speed limit's goal is half of the goal distance before the end; a corner's stop is at the corner.
        ahead = remaining if last else remaining + 0.5 * tuning.goal_distance
        target, limiter = speed_limit(w, curvature, route_speed, clearance, ahead, True, limits, tuning)
        if limiter == GOAL and not last:
            limiter = ROUTE

    new_v = clip(target, v - limits.acceleration * period, v + limits.acceleration * period)
    if turning:
        turn = clear_turn(x, y, yaw, turn, clearance_at(x, y, obstacles), obstacles, tuning)
        wanted = rotation(new_v, v, w, turn, limits, tuning)
    else:
        wanted = curvature * new_v
    new_w = reachable_yaw_rate(wanted, w, period, limits)
    new_v, new_w = keep_wheels_within(new_v, new_w, v, period, limits)

    # Overrides the rules above: the stopping path must be clear.
    if new_v > tuning.creep_speed:
        required = min(max(tuning.stopping_clearance - tuning.robot_radius, 0.0), clearance - START_TOLERANCE)
        poses = stopping_poses(x, y, yaw, new_v, new_w, line, limits, period)
        stopping = new_v * period + 0.5 * new_v * new_v / limits.acceleration
        discs = nearby(x, y, outline_radius(tuning) + required + stopping, obstacles)
        meets = False
        for i in range(poses.shape[0]):
            meets = meets or outline_within(required, poses[i, 0], poses[i, 1], poses[i, 2], discs, bounds, tuning)
        if meets:
            limiter, slowed = BRAKING, max(v - limits.acceleration * period, 0.0)
            # It steers on while it brakes: on the arc of one moment's yaw rate it would leave the straight.
            new_v, new_w = slowed, reachable_yaw_rate(curvature * slowed, w, period, limits)
    if at_end and not last and new_v == 0.0:
        s = arc[stop]
    return side * new_v, new_w, s, turning, limiter
