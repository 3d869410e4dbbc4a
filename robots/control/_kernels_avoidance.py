"""The inner loop of yielding: ways of driving on, followed until something would be met. Arrays in, arrays out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.robots._kernels import (
    Array,
    Known,
    Limits,
    Line,
    Tuning,
    clip,
    keep_wheels_within,
    nearby,
    point_at,
    project,
    pursue,
)
from antdrive.worlds._kernels import kernel, segment_clearance

PURSUE, TWISTS = 0.0, 1.0  # the kinds of ways: along the route up to a speed; one twist after another
LEAST = 0.005  # of the room to movers, if need be [m]
START = 0.25  # that a robot takes to get going [s]
WIDTH = 6  # of a way's row: its kind, then the top speed, or the first twist, how long it lasts [s], and the second


class AvoidanceWeights(NamedTuple):
    """What keeping clear of movers asks for."""

    step: float  # between two instants that are looked at [s]
    keep: float  # from the robot's centre to a mover's surface, at least [m]
    comfort: float  # beyond that, room that is worth a detour [m]
    worth: float  # metres of the route that a metre of that room is worth
    lateral: float  # and a metre off the route
    turn: float  # and a radian off its heading
    doubt: float  # a mover may turn back within this time [s]
    berth: float  # beyond `keep`, the room to where it would be then [m]
    wary: float  # metres of the route that each metre less is worth


@kernel
def first_contact(
    x0: float, y0: float, x1: float, y1: float, places: Array, k: int, radii: Array, near: Array, reaches: Array,
    keep: float,
) -> tuple[float, float]:  # fmt: skip
    """The share of a step after which a mover's centre comes within its reach, 2 if none does.

    And the least room to their surfaces beyond `keep`.
    """
    share, room = 2.0, math.inf
    for m in near:
        ax, ay = places[k, m, 0] - x0, places[k, m, 1] - y0
        ux, uy = places[k + 1, m, 0] - x1 - ax, places[k + 1, m, 1] - y1 - ay
        reach = reaches[m]
        length2 = ux * ux + uy * uy
        along = ax * ux + ay * uy
        f = clip(-along / length2, 0.0, 1.0) if length2 > 0.0 else 0.0
        away = math.hypot(ax + f * ux, ay + f * uy)
        room = min(room, away - radii[m] - keep)
        if away < reach:
            over = ax * ax + ay * ay - reach * reach
            root = math.sqrt(max(along * along - length2 * over, 0.0))
            share = min(share, max(0.0, (-along - root) / length2) if over > 0.0 and length2 > 0.0 else 0.0)
    return share, room


@kernel
def intrusion(x: float, y: float, places: Array, k: int, radii: Array, near: Array, reach: float) -> float:
    """How much closer than `reach` a point is to where some mover would be at the k-th instant, had it turned back at once."""
    most = 0.0
    for m in near:
        back_x, back_y = 2.0 * places[0, m, 0] - places[k, m, 0], 2.0 * places[0, m, 1] - places[k, m, 1]
        most = max(most, radii[m] + reach - math.hypot(x - back_x, y - back_y))
    return most


@kernel
def follow(
    x: float, y: float, yaw: float, v: float, w: float, s: float, turning: bool, way: Array,
    line: Line, known: Known, limits: Limits, tuning: Tuning, care: AvoidanceWeights,
    places: Array, radii: Array, near: Array, reaches: Array,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """A way followed through all of `places` (K + 1, M, 2), `care.step` apart, as a control period of that length would.

    When it first meets something [s] (inf: never), the least room to movers before, the deepest intrusion, and where it ends:
    x, y, yaw, speed.
    """
    capped = Limits(
        min(limits.speed, way[1]), limits.yaw_rate, limits.acceleration, limits.yaw_acceleration, limits.lateral,
        limits.half_track, limits.rim,
    )  # fmt: skip
    floor = min(tuning.floor, own_clearance(x, y, known) - 1e-3)
    least, risk, now = math.inf, 0.0, 0.0
    for k in range(places.shape[0] - 1):
        if way[0] == PURSUE:
            v1, w1, s, turning, _ = pursue(x, y, yaw, v, w, s, turning, line, known, capped, tuning)
        else:
            late = now >= way[3] - 1e-9
            v1 = clip(
                way[4] if late else way[1], v - limits.acceleration * care.step, v + limits.acceleration * care.step
            )
            turn = limits.yaw_acceleration * care.step
            want = way[5] if late else way[2]
            w1 = clip(want, max(w - turn, -limits.yaw_rate), min(w + turn, limits.yaw_rate))
            v1, w1 = keep_wheels_within(v1, w1, limits.half_track, limits.rim)
        middle = yaw + 0.25 * (w + w1) * care.step
        length = 0.5 * (v + v1) * care.step
        x1, y1 = x + length * math.cos(middle), y + length * math.sin(middle)
        share, room = first_contact(x, y, x1, y1, places, k, radii, near, reaches, care.keep)
        if share <= 1.0:
            return now + share * care.step, least, risk, x, y, yaw, v
        if care.wary > 0.0 and now < care.doubt:
            risk = max(risk, intrusion(x1, y1, places, k + 1, radii, near, care.keep + care.berth))
        discs = nearby(x, y, known.discs, known.starts, known.bounds, known.side)
        if abs(length) > 1e-6 and segment_clearance(x, y, x1, y1, discs, known.bounds) < floor:
            return now, least, risk, x, y, yaw, v
        least = min(least, room)
        x, y, yaw, v, w, now = x1, y1, yaw + 0.5 * (w + w1) * care.step, v1, w1, now + care.step
    return math.inf, least, risk, x, y, yaw, v


@kernel
def own_clearance(x: float, y: float, known: Known) -> float:
    """From a point to the nearest disc surface or wall."""
    return segment_clearance(
        x, y, x, y, nearby(x, y, known.discs, known.starts, known.bounds, known.side), known.bounds
    )


@kernel
def choose(
    x: float, y: float, yaw: float, v: float, w: float, s: float, turning: bool, ways: Array,
    line: Line, known: Known, limits: Limits, tuning: Tuning, care: AvoidanceWeights, places: Array, radii: Array,
) -> tuple[int, float, float]:  # fmt: skip
    """Which of the ways (N, WIDTH) to take; when that meets something (inf: never) [s]; the room it has.

    Row 0 is taken if it has all the room that is worth something, and no risk. Else that which gets farthest, room counted in.
    If each meets something, the one that does so last.
    """
    near, reaches = np.empty(radii.shape[0], np.int64), np.empty(radii.shape[0])
    count = 0
    span = care.step * (places.shape[0] - 1)
    for m in range(radii.shape[0]):
        steps = places.shape[0] - 1
        closest = math.inf
        for k in range(steps + 1):
            closest = min(closest, math.hypot(places[k, m, 0] - x, places[k, m, 1] - y) - limits.speed * k * care.step)
        if closest - radii[m] - care.keep <= care.comfort:
            near[count] = m
            count += 1
            # What has come nearer already may come nearer only while the robot gets going; else nothing but to be met
            # would be left to choose.
            away = math.hypot(places[0, m, 0] - x, places[0, m, 1] - y)
            reaches[m] = radii[m] + care.keep
            if away < reaches[m]:
                pace = math.hypot(places[1, m, 0] - places[0, m, 0], places[1, m, 1] - places[0, m, 1]) / care.step
                reaches[m] = max(min(radii[m] + tuning.radius + LEAST, away - 1e-3), away - 1e-3 - START * pace)
    near = near[:count]
    if count == 0:
        return 0, math.inf, math.inf
    xy, arc = line.xy, line.arc
    best, best_score, best_late, best_room = 0, -math.inf, -1.0, 0.0
    for n in range(ways.shape[0]):
        late, room, risk, ex, ey, eyaw, ev = follow(
            x, y, yaw, v, w, s, turning, ways[n], line, known, limits, tuning, care, places, radii, near, reaches
        )
        free = late == math.inf
        if n == 0 and free and room >= care.comfort and risk == 0.0:
            return 0, late, room
        if not free:
            if best_late < math.inf and late > best_late + 1e-9:
                best, best_late, best_room = n, late, room
            continue
        end, k = project(ex, ey, s, limits.speed * span + tuning.look_max, xy, arc)
        px, py, k = point_at(end, k, xy, arc)
        off = math.hypot(ex - px, ey - py)
        qx, qy, _ = point_at(min(end + tuning.look_max, arc[-1]), k, xy, arc)
        bearing = math.atan2(qy - ey, qx - ex)
        astray = abs((eyaw - bearing + math.pi) % (2.0 * math.pi) - math.pi) if arc[-1] - end > 0.1 else 0.0
        score = end - care.lateral * off - care.turn * astray + 0.3 * ev * math.cos(astray)
        score -= care.wary * risk
        score -= care.worth * max(care.comfort - room, 0.0)
        if n <= 1:
            score += 0.05  # as it wants to, or as it last decided, where others are no better
        if best_late < math.inf or score > best_score:
            best, best_score, best_late, best_room = n, score, late, room
    return best, best_late, best_room
