"""Compiled local avoidance: simulate candidate motions among predicted movers, and choose one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.robots.control._kernels_obstacles import ObstacleIndex, clearance_at, nearby
from antdrive.robots.control._kernels_path import PathSamples, point_at, project
from antdrive.robots.control._kernels_pursuit import MotionLimits, PursuitTuning, clip, pursue, reachable_twist
from antdrive.worlds._kernels import Array, kernel, segment_clearance

# The columns of a table of candidates.
KIND = 0  # FOLLOW_ROUTE or TWO_TWISTS
SPEED = 1  # the highest speed on the route, or the speed of the first twist [m/s]
YAW_RATE = 2  # of the first twist [rad/s]
DURATION = 3  # of the first twist [s]
NEXT_SPEED, NEXT_YAW_RATE = 4, 5  # of the second twist

# The kinds of candidates: pure pursuit along the route up to a speed, or one constant twist and then another.
FOLLOW_ROUTE, TWO_TWISTS = 0.0, 1.0

CONTACT_MARGIN = 0.005  # a mover that is already closer than the minimum counts as met at this clearance [m]
START_TIME = 0.25  # the time a standing robot needs to start moving [s]
ESCAPE_TIME = 1.2  # an escape from a mover that cannot be kept clear of is judged for this long [s]
ROUTE_END = 0.1  # closer to the route's end than this, the heading no longer counts [m]


class AvoidanceWeights(NamedTuple):
    """The settings of `Avoidance` as they apply to one robot.

    Attributes:
        step: time between two predicted instants [s]
        min_distance: what a candidate keeps between the robot's centre and a mover's surface [m]
        preferred_clearance: clearance beyond `min_distance` from which more makes no difference [m]
        clearance_weight: metres of the route that a metre of missing clearance costs
        cross_track_weight: metres of the route that a metre off the route costs
        heading_weight: metres of the route that a radian off its direction costs [m/rad]
        speed_weight: metres of the route that 1 m/s of final speed along the route is worth [s]
        persistence: metres of the route that keeping to the last decision is worth
        reversal_time: how far ahead a sudden reversal of a mover is considered [s]
        reversal_distance: what the robot's centre keeps to the surface of a mover that reverses [m]
        reversal_weight: metres of the route that each metre closer than that costs
        narrowest: distance from the robot's centre to its outline where that is nearest [m]
    """

    step: float
    min_distance: float
    preferred_clearance: float
    clearance_weight: float
    cross_track_weight: float
    heading_weight: float
    speed_weight: float
    persistence: float
    reversal_time: float
    reversal_distance: float
    reversal_weight: float
    narrowest: float


class Simulated(NamedTuple):
    """What following a candidate leads to.

    Attributes:
        contact: when it first meets a mover or an obstacle [s], inf if never
        clearance: least clearance to movers before that, beyond the minimum [m]
        intrusion: how far it intrudes on movers that reverse [m]
        x: where it ends [m]
        y: where it ends [m]
        yaw: heading at the end [rad]
        speed: speed at the end [m/s]
    """

    contact: float
    clearance: float
    intrusion: float
    x: float
    y: float
    yaw: float
    speed: float


@kernel
def first_contact(
    x0: float, y0: float, x1: float, y1: float, places: Array, k: int, radii: Array, near: Array,
    contact_distances: Array, min_distance: float,
) -> tuple[float, float]:  # fmt: skip
    """The share of a step after which a mover is at its contact distance, 2 if none is, and the clearance.

    The robot moves straight from (x0, y0) to (x1, y1), and each mover straight from its place k to the next.
    The clearance is the least to a mover's surface, beyond `min_distance`.
    """
    share, clearance = 2.0, math.inf
    for m in near:
        ax, ay = places[k, m, 0] - x0, places[k, m, 1] - y0
        ux, uy = places[k + 1, m, 0] - x1 - ax, places[k + 1, m, 1] - y1 - ay
        reach = contact_distances[m]
        length2 = ux * ux + uy * uy
        along = ax * ux + ay * uy
        f = clip(-along / length2, 0.0, 1.0) if length2 > 0.0 else 0.0
        away = math.hypot(ax + f * ux, ay + f * uy)
        clearance = min(clearance, away - radii[m] - min_distance)
        if away < reach:
            over = ax * ax + ay * ay - reach * reach
            root = math.sqrt(max(along * along - length2 * over, 0.0))
            share = min(share, max(0.0, (-along - root) / length2) if over > 0.0 and length2 > 0.0 else 0.0)
    return share, clearance


@kernel
def intrusion(x: float, y: float, places: Array, k: int, radii: Array, near: Array, distance: float) -> float:
    """How much closer than `distance` a point is to a mover at instant k, if movers reversed at instant 0."""
    most = 0.0
    for m in near:
        back_x, back_y = 2.0 * places[0, m, 0] - places[k, m, 0], 2.0 * places[0, m, 1] - places[k, m, 1]
        most = max(most, radii[m] + distance - math.hypot(x - back_x, y - back_y))
    return most


@kernel
def simulate(
    x: float, y: float, yaw: float, v: float, w: float, s: float, rotating: bool, candidate: Array,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
    weights: AvoidanceWeights, places: Array, radii: Array, near: Array, contact_distances: Array,
) -> Simulated:  # fmt: skip
    """A candidate followed through the instants of `places` (K + 1, M, 2), `weights.step` apart."""
    capped = MotionLimits(
        min(limits.speed, candidate[SPEED]), limits.yaw_rate, limits.acceleration, limits.yaw_acceleration,
        limits.lateral_acceleration, limits.half_track, limits.rim_speed,
    )  # fmt: skip
    step, min_distance = weights.step, weights.min_distance
    required = min(tuning.stopping_clearance, clearance_at(x, y, obstacles) - 1e-3)
    least, risk, now = math.inf, 0.0, 0.0
    for k in range(places.shape[0] - 1):
        if candidate[KIND] == FOLLOW_ROUTE:
            v1, w1, s, rotating, _ = pursue(x, y, yaw, v, w, s, rotating, path, obstacles, capped, tuning)
        else:
            second = now >= candidate[DURATION] - 1e-9
            speed = candidate[NEXT_SPEED] if second else candidate[SPEED]
            yaw_rate = candidate[NEXT_YAW_RATE] if second else candidate[YAW_RATE]
            v1, w1 = reachable_twist(speed, yaw_rate, v, w, step, limits)
        middle = yaw + 0.25 * (w + w1) * step
        length = 0.5 * (v + v1) * step
        x1, y1 = x + length * math.cos(middle), y + length * math.sin(middle)
        share, clearance = first_contact(x, y, x1, y1, places, k, radii, near, contact_distances, min_distance)
        if share <= 1.0:
            return Simulated(now + share * step, least, risk, x, y, yaw, v)
        if weights.reversal_weight > 0.0 and now < weights.reversal_time:
            risk = max(risk, intrusion(x1, y1, places, k + 1, radii, near, weights.reversal_distance))
        discs = nearby(x, y, obstacles)
        if abs(length) > 1e-6 and segment_clearance(x, y, x1, y1, discs, obstacles.bounds) < required:
            return Simulated(now, least, risk, x, y, yaw, v)
        least = min(least, clearance)
        x, y, yaw, v, w, now = x1, y1, yaw + 0.5 * (w + w1) * step, v1, w1, now + step
    return Simulated(math.inf, least, risk, x, y, yaw, v)


@kernel
def relevant_movers(
    x: float, y: float, limits: MotionLimits, tuning: PursuitTuning, weights: AvoidanceWeights, places: Array,
    radii: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """The movers that the robot can get near to (N,), and the distance that counts as contact (M,) [m].

    A mover that is already closer than the minimum may come closer still while the robot starts moving:
    otherwise every candidate would begin with a contact, and there would be nothing to choose.
    """
    near, contact_distances = np.empty(radii.shape[0], np.int64), np.empty(radii.shape[0])
    count = 0
    for m in range(radii.shape[0]):
        closest = math.inf
        for k in range(places.shape[0]):
            away = math.hypot(places[k, m, 0] - x, places[k, m, 1] - y)
            closest = min(closest, away - limits.speed * k * weights.step)
        if closest - radii[m] - weights.min_distance > weights.preferred_clearance:
            continue
        near[count] = m
        count += 1
        away = math.hypot(places[0, m, 0] - x, places[0, m, 1] - y)
        contact_distances[m] = radii[m] + weights.min_distance
        if away < contact_distances[m]:
            dx, dy = places[1, m, 0] - places[0, m, 0], places[1, m, 1] - places[0, m, 1]
            speed = math.hypot(dx, dy) / weights.step
            touching = radii[m] + tuning.robot_radius + CONTACT_MARGIN
            contact_distances[m] = max(min(touching, away - 1e-3), away - 1e-3 - START_TIME * speed)
    return near[:count], contact_distances


@kernel
def score(
    end: Simulated, s: float, window: float, path: PathSamples, tuning: PursuitTuning, weights: AvoidanceWeights
) -> float:
    """What a candidate without contact is worth: its progress, less what its shortcomings cost [m].

    `s` is the progress now [m], `window` how much farther the candidate can get at most [m].
    """
    xy, arc = path.xy, path.arc
    progress, k = project(end.x, end.y, s, window, xy, arc)
    px, py, k = point_at(progress, k, xy, arc)
    cross_track = math.hypot(end.x - px, end.y - py)
    qx, qy, _ = point_at(min(progress + tuning.lookahead_max, arc[-1]), k, xy, arc)
    bearing = math.atan2(qy - end.y, qx - end.x)
    off = 0.0
    if arc[-1] - progress > ROUTE_END:
        off = abs((end.yaw - bearing + math.pi) % (2.0 * math.pi) - math.pi)
    total = progress - weights.cross_track_weight * cross_track - weights.heading_weight * off
    total += weights.speed_weight * end.speed * math.cos(off)
    total -= weights.reversal_weight * end.intrusion
    total -= weights.clearance_weight * max(weights.preferred_clearance - end.clearance, 0.0)
    return total


@kernel
def choose(
    x: float, y: float, yaw: float, v: float, w: float, s: float, rotating: bool, candidates: Array,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
    weights: AvoidanceWeights, places: Array, radii: Array,
) -> tuple[int, float]:  # fmt: skip
    """Which of the candidates (N, 6) to take, and when that meets something [s], inf if never.

    Row 0 is the controller's own motion, row 1 the last decision. Row 0 is taken if it has the preferred
    clearance and no risk; otherwise the candidate without contact that scores best; if each has a contact,
    the one whose comes last.
    """
    near, contact_distances = relevant_movers(x, y, limits, tuning, weights, places, radii)
    if near.shape[0] == 0:
        return 0, math.inf
    span = weights.step * (places.shape[0] - 1)
    window = limits.speed * span + tuning.lookahead_max
    best, best_score, best_contact = 0, -math.inf, -1.0
    for n in range(candidates.shape[0]):
        end = simulate(
            x, y, yaw, v, w, s, rotating, candidates[n], path, obstacles, limits, tuning, weights, places, radii,
            near, contact_distances,
        )  # fmt: skip
        if end.contact < math.inf:
            if best_contact < math.inf and end.contact > best_contact + 1e-9:
                best, best_contact = n, end.contact
            continue
        if n == 0 and end.clearance >= weights.preferred_clearance and end.intrusion == 0.0:
            return 0, end.contact
        value = score(end, s, window, path, tuning, weights)
        if n <= 1:
            value += weights.persistence
        if best_contact < math.inf or value > best_score:
            best, best_score, best_contact = n, value, end.contact
    return best, best_contact


@kernel
def best_escape(
    x: float, y: float, yaw: float, v: float, w: float, s: float, rotating: bool, candidates: Array,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
    weights: AvoidanceWeights, places: Array, radii: Array,
) -> int:  # fmt: skip
    """The candidate that stays farthest from movers in the near future; -1 if each meets an obstacle or a mover.

    A mover that has turned towards the robot may leave no candidate that keeps the minimum. The minimum holds a
    margin, and the robot is narrower than its circumscribed circle, so a robot that dodges is often missed.
    """
    near, _ = relevant_movers(x, y, limits, tuning, weights, places, radii)
    soon = places[: min(places.shape[0], int(ESCAPE_TIME / weights.step) + 2)]
    bodies = radii + weights.narrowest
    best, most = -1, -math.inf
    for n in range(candidates.shape[0]):
        end = simulate(
            x, y, yaw, v, w, s, rotating, candidates[n], path, obstacles, limits, tuning, weights, soon, radii,
            near, bodies,
        )  # fmt: skip
        if end.contact == math.inf and end.clearance > most + 1e-6:
            best, most = n, end.clearance
    return best
