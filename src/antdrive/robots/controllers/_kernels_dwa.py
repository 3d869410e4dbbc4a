"""Compiled search of a dynamic window."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.robots.control._kernels_pursuit import MotionLimits
from antdrive.worlds._kernels import Array, kernel, leaf

STRAIGHT = 1e-4  # least curvature of an arc; others are straight [1/m]
CLOSER = 1e-3  # a robot that is closer to obstacles than required may come closer by this [m]


class WindowTuning(NamedTuple):
    """Options of `DynamicWindow`."""

    interval: float
    lookahead: float
    heading_weight: float
    distance_weight: float
    speed_weight: float
    reach: float
    margin: float
    speeds: int
    yaw_rates: int


@kernel
def best_velocity(
    x: float, y: float, yaw: float, v: float, w: float, top: float, target_x: float, target_y: float, discs: Array,
    bounds: Array, radius: float, limits: MotionLimits, tuning: WindowTuning,
) -> tuple[float, float]:  # fmt: skip
    """Return the best admissible velocity of the window around the last command (v, w), up to a speed; full braking without one.

    The robot's centre keeps a radius [m] from discs (D, 3) and walls (4,).
    """
    t, a, b = tuning.interval, limits.acceleration, limits.yaw_acceleration
    slowest = max(v - a * t, 0.0)
    fastest = max(min(v + a * t, top), slowest)
    low, high = max(w - b * t, -limits.yaw_rate), min(w + b * t, limits.yaw_rate)
    near = discs_ahead(x, y, yaw, discs, bounds, radius)
    best, best_v, best_w = -math.inf, 0.0, 0.0
    for i in range(tuning.speeds):
        speed = slowest + (fastest - slowest) * i / (tuning.speeds - 1)
        for j in range(-1, tuning.yaw_rates):  # first the one closest to straight ahead
            rate = min(max(0.0, low), high) if j < 0 else low + (high - low) * j / (tuning.yaw_rates - 1)
            turn = abs(rate)
            if speed * turn > limits.lateral_acceleration:
                continue
            free = 0.0  # else standing would be worth more than driving towards a near obstacle
            if speed > 0.0:
                free = free_arc(rate / speed, near, tuning.reach)
                if speed * speed > 2 * free * a or turn * turn > 2 * free * turn / speed * b:  # it cannot stop in time
                    continue
            length, turned = speed * t + speed * speed / (2 * a), rate * t + rate * turn / (2 * b)
            chord = length * math.sin(turned / 2) / (turned / 2) if abs(turned) > STRAIGHT else length
            end_x, end_y = x + chord * math.cos(yaw + turned / 2), y + chord * math.sin(yaw + turned / 2)
            bearing = math.atan2(target_y - end_y, target_x - end_x) - yaw - turned
            aligned = 1 - abs((bearing + math.pi) % (2 * math.pi) - math.pi) / math.pi
            worth = (
                tuning.heading_weight * aligned
                + tuning.distance_weight * free / tuning.reach
                + tuning.speed_weight * speed / limits.speed
            )
            if worth > best:
                best, best_v, best_w = worth, speed, rate
    return best_v, best_w


@kernel
def discs_ahead(x: float, y: float, yaw: float, discs: Array, bounds: Array, radius: float) -> Array:
    """Return what arcs may touch, in the robot's frame (D + 4, 3): centres and distances of contact, then walls [m].

    A wall is its outward normal and the distance to contact.
    """
    cos, sin = math.cos(yaw), math.sin(yaw)
    found = np.empty((len(discs) + 4, 3))
    for k in range(len(discs)):
        dx, dy = discs[k, 0] - x, discs[k, 1] - y
        found[k, 0], found[k, 1] = cos * dx + sin * dy, cos * dy - sin * dx
        found[k, 2] = min(radius + discs[k, 2], max(math.hypot(dx, dy) - CLOSER, 0.0))
    for k in range(4):
        room = (bounds[k] - (y if k % 2 else x)) * (1.0 if k > 1 else -1.0)
        nx, ny = (sin, cos) if k % 2 else (cos, -sin)
        one = len(discs) + k
        found[one, 0], found[one, 1] = (nx, ny) if k > 1 else (-nx, -ny)
        found[one, 2] = room - min(radius, max(room - CLOSER, 0.0))
    return found


@leaf
def free_arc(curvature: float, near: Array, reach: float) -> float:
    """Return how far the robot moves on an arc of a curvature [1/m] up to the first contact, at most `reach` [m].

    Points of the arc are at the distance of contact at equal angles on both sides of its point closest to the obstacle.
    """
    k = curvature if abs(curvature) >= STRAIGHT else STRAIGHT
    side, r = math.copysign(1.0, k), 1 / abs(k)
    free = reach
    for one in range(len(near)):
        ox, oy, contact = near[one]
        if one < len(near) - 4:
            if math.hypot(ox, oy) - contact > free:
                continue
            centre = math.hypot(ox, oy - 1 / k)
            cosine = (r * r + centre * centre - contact * contact) / (2 * centre * r) if centre > 0.0 else 2.0
            towards = math.atan2(ox, r - oy * side)
        else:
            cosine = abs(k) * (contact - oy / k)
            towards = math.atan2(ox, -oy * side)
        if abs(cosine) < 1.0:
            half = math.acos(cosine)
            first = min((towards - half) % (2 * math.pi), (towards + half) % (2 * math.pi))
            free = min(free, first * r)
    return free
