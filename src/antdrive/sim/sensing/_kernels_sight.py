"""Compiled free-path queries: how far a robot can move before its footprint meets unknown ground or a hit."""

from __future__ import annotations

import math

from antdrive.sim.sensing._kernels_mapping import GRAINS, MapArrays, grain_disc
from antdrive.worlds._kernels import Array, kernel, leaf, polygon_distance

MEETING = 1e-3  # distance at which the footprint meets a disc [m]
SAMPLES = 8  # samples of the path, for its part of the map
GIVE = 2e-3  # discs that overlap the footprint shrink to this distance from it [m]


@leaf
def clear_way(
    x0: float, y0: float, yaw: float, speed: float, yaw_rate: float, half_length: float, half_width: float,
    rounding: float, corners: Array, limit: float, arrays: tuple[Array, ...],
) -> float:  # fmt: skip
    """Return how far a footprint gets on a twist's arc from a pose [m], at most `limit`; for a turn on the spot [rad].

    The footprint is a rounded rectangle; `corners` (K, 2), if any, replace it by a polygon.
    """
    pose, shape, m = (x0, y0, yaw), (half_length, half_width, rounding), MapArrays(*arrays)
    radius = math.hypot(shape[0], shape[1]) + shape[2]
    for k in range(corners.shape[0]):
        radius = max(radius, math.hypot(corners[k, 0], corners[k, 1]) + rounding)
    cell = m.frame[2]
    turns = speed == 0.0
    if turns and yaw_rate == 0.0:
        return limit
    # The robot's velocity per metre of the path, or per radian of the turn.
    forward = 0.0 if turns else math.copysign(1.0, speed)
    bend = math.copysign(1.0, yaw_rate) if turns else yaw_rate / abs(speed)
    best = within_map(pose, forward, bend, radius, limit, m)
    rows, cols = m.free.shape
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x_min, x_max, y_min, y_max = (
        0.0,
        0.0,
        0.0,
        0.0,
    )  # of the way, from samples half of whose distance is added to its reach
    for k in range(1, SAMPLES + 1):
        ahead, left = on_arc(forward, bend, best * k / SAMPLES)
        x, y = cos * ahead - sin * left, sin * ahead + cos * left
        x_min, x_max, y_min, y_max = min(x_min, x), max(x_max, x), min(y_min, y), max(y_max, y)
    reach = radius + cell + 0.5 * best / SAMPLES
    row_low = max(0, int(math.floor((pose[1] + y_min - reach - m.frame[1]) / cell)))
    row_high = min(rows - 1, int(math.floor((pose[1] + y_max + reach - m.frame[1]) / cell)))
    col_low = max(0, int(math.floor((pose[0] + x_min - reach - m.frame[0]) / cell)))
    col_high = min(cols - 1, int(math.floor((pose[0] + x_max + reach - m.frame[0]) / cell)))
    for row in range(row_low, row_high + 1):
        for col in range(col_low, col_high + 1):
            if m.free[row, col]:
                continue
            x, y = m.frame[0] + (col + 0.5) * cell - pose[0], m.frame[1] + (row + 0.5) * cell - pose[1]
            ahead, left = cos * x + sin * y, cos * y - sin * x
            if not on_the_way(ahead, left, forward, bend, radius + 1.5 * cell, best):
                continue
            if not m.occupied[row, col]:
                best = contact(ahead, left, math.sqrt(0.5) * cell, forward, bend, shape, corners, best)
                continue
            at = m.slot[row, col]
            for k in range(GRAINS * GRAINS):
                if m.odds[at, k] > 0.0:
                    gx, gy, size = grain_disc(m.box, at, k)
                    dx, dy = gx - pose[0], gy - pose[1]
                    best = contact(cos * dx + sin * dy, cos * dy - sin * dx, size, forward, bend, shape, corners, best)
    return best


@leaf
def within_map(
    pose: tuple[float, float, float], forward: float, bend: float, radius: float, limit: float, m: MapArrays
) -> float:
    """Return how far the disc around the robot stays on the map; ground beyond is unknown."""
    cell = m.frame[2]
    rows, cols = m.free.shape
    done = 0.0
    while True:
        ahead, left = on_arc(forward, bend, done)
        x = pose[0] + math.cos(pose[2]) * ahead - math.sin(pose[2]) * left
        y = pose[1] + math.sin(pose[2]) * ahead + math.cos(pose[2]) * left
        room = min(min(x - m.frame[0], m.frame[0] + cols * cell - x), min(y - m.frame[1], m.frame[1] + rows * cell - y))
        if room < radius:
            return done
        if done >= limit or forward == 0.0:
            return limit
        done = min(limit, done + max(room - radius, MEETING))


@kernel
def on_arc(forward: float, bend: float, done: float) -> tuple[float, float]:
    """Return the robot's position after a path, relative to its start: ahead and to the left."""
    turn = bend * done
    if forward == 0.0:
        return 0.0, 0.0
    if abs(turn) < 1e-6:
        return forward * done, 0.5 * forward * turn * done
    return forward * math.sin(turn) / bend, forward * (1.0 - math.cos(turn)) / bend


@kernel
def on_the_way(ahead: float, left: float, forward: float, bend: float, reach: float, limit: float) -> bool:
    """Whether a point may come within `reach` of the robot's centre; False only if it does not."""
    away = math.sqrt(ahead * ahead + left * left)
    if forward == 0.0 or away <= reach:
        return bool(away <= reach)
    if away > limit + reach:
        return False
    if abs(bend) < 1e-6:
        return bool(abs(left) <= reach + 1e-3 and forward * ahead > 0.0)
    # The path lies on a circle around the centre of the turn, at (0, forward / bend).
    beside = left - forward / bend
    return bool(abs(math.sqrt(ahead * ahead + beside * beside) - 1.0 / abs(bend)) <= reach)


@leaf
def contact(
    ahead: float, left: float, size: float, forward: float, bend: float, shape: tuple[float, float, float], corners: Array,
    limit: float,
) -> float:  # fmt: skip
    """Return how far the robot gets before it meets a disc at (ahead, left), at most `limit`.

    Steps are as long as the distance allows (conservative advancement). A disc that overlaps the robot at first shrinks: the
    robot may leave it or drive along it, but not come nearer.
    """
    done = 0.0
    while done < limit:
        turn = bend * done
        cos, sin = math.cos(turn), math.sin(turn)
        x, y = 0.0, 0.0
        if forward != 0.0:
            bent = abs(turn) > 1e-6
            x = forward * sin / bend if bent else forward * done
            y = forward * (1.0 - cos) / bend if bent else 0.5 * forward * turn * done
        dx, dy = ahead - x, left - y
        if corners.shape[0] > 0:
            gap = polygon_distance(cos * dx + sin * dy, cos * dy - sin * dx, corners) - shape[2]
        else:
            qx, qy = abs(cos * dx + sin * dy) - shape[0], abs(cos * dy - sin * dx) - shape[1]
            out_x, out_y = max(qx, 0.0), max(qy, 0.0)
            gap = math.sqrt(out_x * out_x + out_y * out_y) + min(max(qx, qy), 0.0) - shape[2]
        if done == 0.0 and gap - size < GIVE:
            size = gap - GIVE
        away = gap - size
        if away <= MEETING:
            return done
        done += away / (abs(forward) + abs(bend) * (math.sqrt(dx * dx + dy * dy) + away))
    return limit
