"""Compiled local avoidance: simulate candidate motions among predicted movers, and choose one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.robots.control._kernels_lines import (
    CHECKED,
    STEEPEST,
    advance,
    outline_clearance,
    outline_within,
    wrapped,
)
from antdrive.robots.control._kernels_obstacles import ObstacleIndex, clearance_at, nearby
from antdrive.robots.control._kernels_path import PathSamples, clearance_below, point_at, project, segment_at
from antdrive.robots.control._kernels_pursuit import (
    MotionLimits,
    PursuitTuning,
    clip,
    reachable_twist,
    slow_for_curvature,
)
from antdrive.worlds._kernels import Array, kernel, leaf, polygon_distance

# The columns of a table of candidates.
KIND = 0  # FOLLOW_ROUTE or TWO_TWISTS
SPEED = 1  # speed limit on the route, or speed of the first twist [m/s]
YAW_RATE = 2  # of the first twist [rad/s]
DURATION = 3  # of the first twist [s]
NEXT_SPEED, NEXT_YAW_RATE = 4, 5  # of the second twist

SHIFT = YAW_RATE  # of a line beside the route, to the left [m]

# The kinds of candidates: pure pursuit along the route up to a speed, one constant twist and then another, or a line beside
# the route up to a speed.
FOLLOW_ROUTE, TWO_TWISTS, BESIDE_ROUTE = 0.0, 1.0, 2.0

CONTACT_MARGIN = 0.005  # contact clearance of movers already closer than the minimum [m]
START_TIME = 0.25  # for a robot at rest to start moving [s]
ESCAPE_TIME = 1.2  # horizon of an escape when no candidate keeps its clearance [s]
CLOSER = 1e-3  # a robot that is closer to obstacles than required may come closer by this [m]
ROUNDING = 1e-6  # movers are skipped only with this slack, so that no result changes [m]
LEVELS = 64  # tabulated distances for progress
BESIDE_DISTANCE, BESIDE_TIME = 0.5, 0.3  # offsets decay over this distance, or this time at speed [m], [s]
OFF_ROUTE = 0.1  # a robot farther from its route is off it [m]
LEAST_ROOM, ROOM = 0.005, 0.1  # a robot that halts moves for so much more room, at least and at most [m]
ROOM_WEIGHT = 20.0  # value of a metre of room, in metres of progress
ROUTE_END = 0.1  # distance from the route's end below which the heading is ignored [m]


class AvoidanceWeights(NamedTuple):
    """The settings of `Avoidance` for one robot.

    Attributes:
        step: time between two predicted instants [s]
        min_distance: least distance from the robot to a mover's surface, plus `radius` [m]
        preferred_clearance: clearance beyond `min_distance` above which the cost is zero [m]
        clearance_weight: cost of each metre below the preferred clearance [m/m]
        cross_track_weight: cost of each metre off the route [m/m]
        heading_weight: cost of each radian off the route's direction [m/rad]
        speed_weight: worth of 1 m/s of final speed along the route [s]
        persistence: worth of keeping the last decision [m]
        reversal_time: horizon for a sudden reversal of a mover [s]
        reversal_distance: least distance from the robot to a reversing mover's surface, plus `radius` [m]
        reversal_weight: cost of each metre below that [m/m]
        radius: circumscribed radius of the robot [m]
        corners: of the robot's outline (K, 2); none for a disc around the axle [m]
        rounding: of that outline [m]
        outlined: whether the outline is kept from obstacles on every route, not only on those with turns
        loss: least distance of the circle from obstacles off the route [m]
        outline_loss: the same of the outline [m]
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
    radius: float
    corners: Array
    rounding: float
    outlined: bool
    loss: float
    outline_loss: float


class Required(NamedTuple):
    """Clearances that trails from a pose must keep from obstacles.

    Attributes:
        centre: of the robot's centre, -inf if only the outline counts [m]
        outline: of its outline, -inf if only the centre counts [m]
    """

    centre: float
    outline: float


class Trail(NamedTuple):
    """Result of following a candidate, regardless of movers.

    Attributes:
        steps: number of steps
        blocked: whether the last step comes too close to an obstacle
    """

    steps: int
    blocked: bool


class Encounter(NamedTuple):
    """Interaction of a candidate with movers.

    Attributes:
        contact: time of the first contact with a mover or an obstacle [s], inf if never
        clearance: least clearance to movers before that, beyond the minimum [m]; exact below the `cap` of `encounter`
        intrusion: depth of intrusion on reversing movers [m]
    """

    contact: float
    clearance: float
    intrusion: float


class Reachable(NamedTuple):
    """The relevant movers in each step, for all candidates.

    Attributes:
        near: their indices, step by step (K, M); a row is filled up to its count
        counts: number of relevant movers in each step (K,)
    """

    near: Array
    counts: Array


@leaf
def distance_to(dx: float, dy: float, yaw: float, weights: AvoidanceWeights) -> float:
    """Return the distance from the robot's outline to a point at (dx, dy) from its centre, plus `radius`.

    For a disc it is the distance from its centre, for other outlines no less.
    """
    if weights.corners.shape[0] == 0:
        return math.hypot(dx, dy)
    cos, sin = math.cos(yaw), math.sin(yaw)
    apart = polygon_distance(cos * dx + sin * dy, cos * dy - sin * dx, weights.corners)
    return float(apart - weights.rounding + weights.radius)


@leaf
def outline_contact(
    start: Array, end: Array, ax: float, ay: float, ux: float, uy: float, reach: float, weights: AvoidanceWeights
) -> float:
    """Return the fraction of a step until the outline is at `reach` from a point, 2 if it never is.

    The point moves by (ux, uy) from (ax, ay), relative to the robot's centre. Distances are those of `distance_to`, at poses at
    most `CHECKED` apart.
    """
    turned = end[2] - start[2]
    count = int((math.hypot(ux, uy) + abs(turned) * weights.radius) / CHECKED) + 1
    for n in range(count + 1):
        f = n / count
        if distance_to(ax + f * ux, ay + f * uy, start[2] + f * turned, weights) < reach:
            return f
    return 2.0


@leaf
def first_contact(
    start: Array, end: Array, places: Array, k: int, radii: Array, near: Array, contact_distances: Array,
    weights: AvoidanceWeights, cap: float,
) -> tuple[float, float]:  # fmt: skip
    """Return the fraction of a step until a mover is at its contact distance, 2 if none is, and the clearance.

    The robot moves straight from a pose `start` to `end`, and each mover straight from its position k to the next. The
    clearance is the least to a mover's surface, beyond `min_distance`, of the circle around the robot: robots prefer more room
    than their outline needs. Movers without contact farther than `cap` may be omitted. Only where the circle is too close, the
    outline is checked.
    """
    share, clearance, min_distance = 2.0, math.inf, weights.min_distance
    x0, y0, x1, y1 = start[0], start[1], end[0], end[1]
    for m in near:
        ax, ay = places[k, m, 0] - x0, places[k, m, 1] - y0
        ux, uy = places[k + 1, m, 0] - x1 - ax, places[k + 1, m, 1] - y1 - ay
        reach = contact_distances[m]
        length2 = ux * ux + uy * uy
        along = ax * ux + ay * uy
        f = clip(-along / length2, 0.0, 1.0) if length2 > 0.0 and along < 0.0 else 0.0
        dx, dy = ax + f * ux, ay + f * uy
        matters = max(reach, radii[m] + min_distance + min(clearance, cap)) + ROUNDING
        if dx * dx + dy * dy > matters * matters:
            continue
        away = math.hypot(dx, dy)
        clearance = min(clearance, away - radii[m] - min_distance)
        if away < reach and weights.corners.shape[0] > 0:
            share = min(share, outline_contact(start, end, ax, ay, ux, uy, reach, weights))
        elif away < reach:
            over = ax * ax + ay * ay - reach * reach
            root = math.sqrt(max(along * along - length2 * over, 0.0))
            share = min(share, max(0.0, (-along - root) / length2) if over > 0.0 and length2 > 0.0 else 0.0)
    return share, clearance


@leaf
def intrusion(pose: Array, places: Array, k: int, radii: Array, near: Array, weights: AvoidanceWeights) -> float:
    """Return how much closer than its `reversal_distance` a robot is to a mover at instant k, if movers reverse at instant 0."""
    most, distance = 0.0, weights.reversal_distance
    for m in near:
        dx = 2.0 * places[0, m, 0] - places[k, m, 0] - pose[0]
        dy = 2.0 * places[0, m, 1] - places[k, m, 1] - pose[1]
        matters = radii[m] + distance - most + ROUNDING
        if dx * dx + dy * dy <= matters * matters:
            most = max(most, radii[m] + distance - distance_to(dx, dy, pose[2], weights))
    return most


@leaf
def least_clearance(
    x: float, y: float, yaw: float, on_route: bool, outlined: bool, obstacles: ObstacleIndex, tuning: PursuitTuning,
    weights: AvoidanceWeights,
) -> Required:  # fmt: skip
    """Return the required clearances of trails from a pose.

    On the route they are the controller's, less if the pose is closer. Off the route they also hold the loss by noise; from a
    pose that is closer, no trail may come closer. Where the circle lacks room, a turn could bring the outline closer.
    """
    slack, centre = CLOSER if on_route else ROUNDING, -math.inf
    if not outlined:
        required = tuning.stopping_clearance
        if not on_route:
            required = max(required, tuning.robot_radius + weights.loss)
        here = clearance_at(x, y, obstacles)
        centre = min(required, here - slack)
        if here >= required or weights.corners.shape[0] == 0:
            return Required(centre, -math.inf)
    required = max(tuning.stopping_clearance - tuning.robot_radius, 0.0)
    if not on_route:
        required = max(required, weights.outline_loss)
    here = outline_clearance(x, y, yaw, obstacles, tuning, required + slack)
    return Required(centre, min(required, here - slack))


@leaf
def outline_between(
    start: Array, end: Array, length: float, required: float, discs: Array, bounds: Array, tuning: PursuitTuning
) -> bool:
    """Return whether the outline is closer than required to an obstacle at poses of a step of a length, without its start."""
    sweep = abs(end[2] - start[2]) * tuning.robot_radius
    count = int((abs(length) + sweep) / CHECKED) + 1
    for n in range(count):
        share = (n + 1.0) / count
        x, y = start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
        if outline_within(required, x, y, start[2] + share * (end[2] - start[2]), discs, bounds, tuning):
            return True
    return False


@leaf
def passes_within(
    trail: Array,
    k: int,
    required: Required,
    obstacles: ObstacleIndex,
    tuning: PursuitTuning,
    step: float,
) -> bool:
    """Return whether the step after row k of a trail comes closer to an obstacle than required.

    A step is straight, or a few poses of the outline.
    """
    length, outlined = 0.5 * (trail[k, 3] + trail[k + 1, 3]) * step, required.outline > -math.inf
    if abs(length) <= 1e-6 and not outlined:
        return False
    ax, ay, bx, by = trail[k, 0], trail[k, 1], trail[k + 1, 0], trail[k + 1, 1]
    most, bounds = (required.outline + tuning.robot_radius if outlined else required.centre), obstacles.bounds
    discs = nearby(ax, ay, most + math.hypot(bx - ax, by - ay), obstacles)
    distance = clearance_below(most, ax, ay, bx, by, discs, bounds)
    if distance < required.centre:
        return True
    return outlined and distance < most and outline_between(
        trail[k], trail[k + 1], length, required.outline, discs, bounds, tuning
    )  # fmt: skip


@leaf
def meets_obstacle(
    trail: Array, required: Required, obstacles: ObstacleIndex, tuning: PursuitTuning, step: float
) -> bool:
    """Return whether a trail that was followed without obstacle checks comes closer to an obstacle than required."""
    k, steps = 0, trail.shape[0] - 1
    while k < steps and not passes_within(trail, k, required, obstacles, tuning, step):
        k += 1
    return bool(k < steps)


@leaf
def beside_route(
    x: float, y: float, yaw: float, v: float, s: float, candidate: Array, path: PathSamples, limits: MotionLimits,
    tuning: PursuitTuning,
) -> tuple[float, float]:  # fmt: skip
    """Return the wanted speed and yaw rate of a robot at progress s or more that steers to a line beside the route."""
    s, k = project(x, y, s, tuning.lookahead_max + limits.speed, path.xy, path.arc)
    px, py, k = point_at(s, k, path.xy, path.arc)
    length = path.arc[k + 1] - path.arc[k]
    ux, uy = (path.xy[k + 1, 0] - path.xy[k, 0]) / length, (path.xy[k + 1, 1] - path.xy[k, 1]) / length
    aside = (x - px) * uy - (y - py) * ux + candidate[SHIFT]
    reach = max(BESIDE_DISTANCE, BESIDE_TIME * v)
    back = clip(0.5 * aside / reach, -STEEPEST, STEEPEST)
    curvature = 2.0 * (back + wrapped(math.atan2(uy, ux) - yaw)) / reach
    speed = min(candidate[SPEED], slow_for_curvature(curvature, limits.lateral_acceleration, limits.yaw_rate))
    return speed, curvature * max(speed, abs(v))


@leaf
def follow(
    x: float, y: float, yaw: float, v: float, w: float, s: float, rotating: bool, candidate: Array,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
    step: float, first: int, looks: bool, required: Required, trail: Array,
) -> Trail:  # fmt: skip
    """Follow a candidate from step `first`, where the robot is at (x, y, yaw, v, w), to the last row of `trail` (K + 1, 5).

    A row of `trail` is position [m, m], heading [rad], speed [m/s] and yaw rate [rad/s]; those from `first` on are filled.
    Without `looks`, `meets_obstacle` checks obstacles later, and the trail does not end at one that comes closer than required.
    """
    trail[first, 0], trail[first, 1], trail[first, 2], trail[first, 3], trail[first, 4] = x, y, yaw, v, w
    capped = MotionLimits(
        min(limits.speed, candidate[SPEED]), limits.yaw_rate, limits.acceleration, limits.yaw_acceleration,
        limits.lateral_acceleration, limits.half_track, limits.rim_speed,
    )  # fmt: skip
    cos, sin, facing, now = 1.0, 0.0, 0.0, 0.0
    for k in range(trail.shape[0] - 1):
        if k < first:
            now += step
            continue
        if candidate[KIND] == FOLLOW_ROUTE:
            v1, w1, s, rotating, _ = advance(x, y, yaw, v, w, s, rotating, path, obstacles, capped, tuning)
        elif candidate[KIND] == BESIDE_ROUTE:
            speed, yaw_rate = beside_route(x, y, yaw, v, s, candidate, path, limits, tuning)
            v1, w1 = reachable_twist(speed, yaw_rate, v, w, step, limits)
        else:
            second = now >= candidate[DURATION] - 1e-9
            speed = candidate[NEXT_SPEED] if second else candidate[SPEED]
            yaw_rate = candidate[NEXT_YAW_RATE] if second else candidate[YAW_RATE]
            v1, w1 = reachable_twist(speed, yaw_rate, v, w, step, limits)
        middle = yaw + 0.25 * (w + w1) * step
        length = 0.5 * (v + v1) * step
        if middle != facing:
            cos, sin, facing = math.cos(middle), math.sin(middle), middle
        x1, y1 = x + length * cos, y + length * sin
        yaw1 = yaw + 0.5 * (w + w1) * step
        trail[k + 1, 0], trail[k + 1, 1], trail[k + 1, 2], trail[k + 1, 3], trail[k + 1, 4] = x1, y1, yaw1, v1, w1
        if looks and passes_within(trail, k, required, obstacles, tuning, step):
            return Trail(k + 1, True)
        x, y, yaw, v, w, now = x1, y1, yaw1, v1, w1, now + step
    return Trail(trail.shape[0] - 1, False)


@kernel
def follow_all(
    s: float, rotating: bool, candidates: Array, path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits,
    tuning: PursuitTuning, step: float, route: Required, off: Required, trails: Array, steps: Array, blocked: Array,
) -> None:  # fmt: skip
    """Fill `trails` (N, K + 1, 5), `steps` and `blocked` (N,) for the candidates after the first.

    All begin like the first trail. Candidates with the same first twist share its trail up to their second one.
    """
    stem = -1
    for n in range(1, candidates.shape[0]):
        candidate, trail = candidates[n], trails[n]
        first = 0
        if candidate[KIND] == TWO_TWISTS and stem >= 0 and (
            candidate[SPEED] == candidates[stem, SPEED] and candidate[YAW_RATE] == candidates[stem, YAW_RATE]
        ):  # fmt: skip
            now = 0.0
            while first < steps[stem] and now < candidate[DURATION] - 1e-9:
                first, now = first + 1, now + step
        for k in range(first + 1):
            for j in range(5):
                trail[k, j] = trails[max(stem, 0), k, j]
        if stem >= 0 and first == steps[stem]:
            steps[n], blocked[n] = steps[stem], blocked[stem]
            continue
        required = route if candidate[KIND] == FOLLOW_ROUTE else off
        got = follow(
            trail[first, 0], trail[first, 1], trail[first, 2], trail[first, 3], trail[first, 4], s, rotating,
            candidate, path, obstacles, limits, tuning, step, first, True, required, trail,
        )  # fmt: skip
        steps[n], blocked[n] = got.steps, got.blocked
        if candidate[KIND] == TWO_TWISTS and candidate[DURATION] == math.inf:
            stem = n


@leaf
def encounter(
    trail: Array, end: Trail, places: Array, radii: Array, near: Array, by_step: Reachable, contact_distances: Array,
    weights: AvoidanceWeights, cap: float,
) -> Encounter:  # fmt: skip
    """Return the interaction of a candidate's trail with the movers `near`, step by step those of `by_step`."""
    least, risk, now = math.inf, 0.0, 0.0
    for k in range(end.steps):
        share, clearance = 2.0, math.inf
        if by_step.counts[k] > 0:
            share, clearance = first_contact(
                trail[k], trail[k + 1], places, k, radii, by_step.near[k, : by_step.counts[k]], contact_distances,
                weights, min(cap, least),
            )  # fmt: skip
        if share <= 1.0:
            return Encounter(now + share * weights.step, least, risk)
        if weights.reversal_weight > 0.0 and now < weights.reversal_time:
            risk = max(risk, intrusion(trail[k + 1], places, k + 1, radii, near, weights))
        if end.blocked and k == end.steps - 1:
            return Encounter(now, least, risk)
        least = min(least, clearance)
        now += weights.step
    return Encounter(math.inf, least, risk)


@kernel
def relevant_movers(
    x: float, y: float, yaw: float, limits: MotionLimits, tuning: PursuitTuning, weights: AvoidanceWeights, places: Array,
    radii: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Return the movers within the robot's reach (N,), and their contact distances (M,) [m].

    A mover already closer than the minimum may come closer while the robot starts moving: otherwise every candidate would
    begin with a contact.
    """
    near, contact_distances = np.empty(radii.shape[0], np.int64), np.empty(radii.shape[0])
    count = 0
    for m in range(radii.shape[0]):
        matters = radii[m] + weights.min_distance + weights.preferred_clearance + ROUNDING
        meets = False
        for k in range(places.shape[0]):
            dx, dy = places[k, m, 0] - x, places[k, m, 1] - y
            driven = limits.speed * k * weights.step
            if dx * dx + dy * dy > (matters + driven) * (matters + driven):
                continue
            closest = math.hypot(dx, dy) - driven
            if closest - radii[m] - weights.min_distance <= weights.preferred_clearance:
                meets = True
                break
        if not meets:
            continue
        near[count] = m
        count += 1
        away = distance_to(places[0, m, 0] - x, places[0, m, 1] - y, yaw, weights)
        contact_distances[m] = radii[m] + weights.min_distance
        if away < contact_distances[m]:
            dx, dy = places[1, m, 0] - places[0, m, 0], places[1, m, 1] - places[0, m, 1]
            speed = math.hypot(dx, dy) / weights.step
            touching = radii[m] + tuning.robot_radius + CONTACT_MARGIN
            contact_distances[m] = max(min(touching, away - 1e-3), away - 1e-3 - START_TIME * speed)
    return near[:count], contact_distances


@leaf
def is_close(x: float, y: float, yaw: float, places: Array, radii: Array, weights: AvoidanceWeights) -> bool:
    """Return whether a mover at `places` (M, 2) is closer than the minimum."""
    for m in range(radii.shape[0]):
        dx, dy = places[m, 0] - x, places[m, 1] - y
        within = math.hypot(dx, dy) - radii[m] < weights.min_distance
        if within and distance_to(dx, dy, yaw, weights) - radii[m] < weights.min_distance:
            return True
    return False


@leaf
def must_dodge(
    x: float, y: float, places: Array, observed: Array, radii: Array, walking: float, surprise: float, step: float,
    horizon: float, max_speed: float, radius: float,
) -> bool:  # fmt: skip
    """Return whether a mover that may come near within the horizon is faster than people, or not as fast as predicted.

    `places` are (K, M, 2) [m], a `step` [s] apart, and `observed` velocities (M, 2) [m/s]; `walking` and `surprise` are the
    limits [m/s]. The robot has this radius and top speed.
    """
    for m in range(radii.shape[0]):
        speed = math.hypot(observed[m, 0], observed[m, 1])
        vx, vy = (places[1, m, 0] - places[0, m, 0]) / step, (places[1, m, 1] - places[0, m, 1]) / step
        unlike = math.hypot(observed[m, 0] - vx, observed[m, 1] - vy) > surprise
        if speed > walking or unlike:
            gap = math.hypot(places[0, m, 0] - x, places[0, m, 1] - y) - radii[m] - radius
            if gap < horizon * (speed + max_speed):
                return True
    return False


@kernel
def reachable_by_step(
    x: float, y: float, speed: float, weights: AvoidanceWeights, places: Array, radii: Array, near: Array, cap: float
) -> Reachable:
    """Return the movers among `near` that a robot up to `speed` can get closer to than `cap`, in each step."""
    rows, counts = np.empty((places.shape[0] - 1, near.shape[0]), np.int64), np.zeros(places.shape[0] - 1, np.int64)
    for k in range(places.shape[0] - 1):
        for m in near:
            dx, dy = places[k, m, 0] - x, places[k, m, 1] - y
            ux, uy = places[k + 1, m, 0] - places[k, m, 0], places[k + 1, m, 1] - places[k, m, 1]
            moves = speed * (k + 1) * weights.step + math.sqrt(ux * ux + uy * uy)
            matters = moves + radii[m] + weights.min_distance + cap + ROUNDING
            if dx * dx + dy * dy <= matters * matters:
                rows[k, counts[k]] = m
                counts[k] += 1
    return Reachable(rows, counts)


@leaf
def fastest(v: float, candidates: Array, limits: MotionLimits) -> float:
    """Return an upper bound of the candidates' speeds [m/s]."""
    most = max(abs(v), limits.speed)
    for n in range(candidates.shape[0]):
        most = max(most, max(abs(candidates[n, SPEED]), abs(candidates[n, NEXT_SPEED])))
    return most


@leaf
def worth(
    end: Array, s: float, window: float, path: PathSamples, tuning: PursuitTuning, weights: AvoidanceWeights
) -> float:
    """Return the worth of a candidate that ends at `end`, a row of its trail, without movers nearby [m].

    It is the progress minus the costs. `s` is the current progress [m], `window` the largest further progress [m].
    """
    x, y, yaw, v = end[0], end[1], end[2], end[3]
    xy, arc = path.xy, path.arc
    progress, k = project(x, y, s, window, xy, arc)
    px, py, k = point_at(progress, k, xy, arc)
    cross_track = math.hypot(x - px, y - py)
    qx, qy, _ = point_at(min(progress + tuning.lookahead_max, arc[-1]), k, xy, arc)
    bearing = math.atan2(qy - y, qx - x)
    off = 0.0
    if arc[-1] - progress > ROUTE_END:
        off = abs((yaw - bearing + math.pi) % (2.0 * math.pi) - math.pi)
    total = progress - weights.cross_track_weight * cross_track - weights.heading_weight * off
    total += weights.speed_weight * v * math.cos(off)
    return float(total)


@leaf
def among_movers(alone: float, met: Encounter, weights: AvoidanceWeights) -> float:
    """Return the worth of a candidate among movers, from its worth `alone` without movers nearby [m]."""
    value = alone - weights.reversal_weight * met.intrusion
    return value - weights.clearance_weight * max(weights.preferred_clearance - met.clearance, 0.0)


@leaf
def progress_by_distance(
    x: float, y: float, yaw: float, s: float, window: float, path: PathSamples, farthest: float, out: Array
) -> float:
    """Fill `out` (N,) with the largest progress within distances of 0 to `farthest` from (x, y) [m].

    The nearest point on a segment is no farther along it than the robot's projection. Return the largest angle between the
    robot's heading and a segment within reach [rad].
    """
    xy, arc = path.xy, path.arc
    k, aligned = segment_at(s, arc), 1.0
    out[:] = s
    while k < xy.shape[0] - 1 and arc[k] <= s + window:
        length = arc[k + 1] - arc[k]
        ux, uy = (xy[k + 1, 0] - xy[k, 0]) / length, (xy[k + 1, 1] - xy[k, 1]) / length
        ahead = (xy[k, 0] - x) * ux + (xy[k, 1] - y) * uy
        aligned = min(aligned, ux * math.cos(yaw) + uy * math.sin(yaw))
        for i in range(out.shape[0]):
            distance = farthest * i / (out.shape[0] - 1)
            if distance >= ahead - ROUNDING:
                out[i] = max(out[i], min(min(arc[k + 1], s + window), arc[k] + distance - ahead))
        k += 1
    return math.acos(max(aligned, -1.0))


@leaf
def travel(
    candidate: Array, v: float, w: float, span: float, step: float, off: float, limits: MotionLimits
) -> tuple[float, float]:
    """Return upper bounds of a candidate's progress along the route [m] and its final speed [m/s].

    `off` is the largest angle between the robot's heading and the route. A robot that drives backwards makes no progress
    unless it turns by more than a right angle minus `off`.
    """
    brake, first, second = 0.5 / limits.acceleration, candidate[SPEED], candidate[NEXT_SPEED]
    until = min(candidate[DURATION] + step, span)
    if candidate[KIND] != TWO_TWISTS:
        first, second, until = min(first, limits.speed), 0.0, span
    over = max(abs(v) - abs(first), 0.0) if v * first > 0.0 else v
    slowing = over * over * brake + limits.acceleration * step * step
    fall = max(abs(first) - abs(second), 0.0) if first * second >= 0.0 else abs(first)
    driven = abs(first) * until + abs(second) * (span - until) + (fall * fall * brake if until < span else 0.0)
    speed = max(abs(first), abs(v))
    if until < span:
        speed = max(abs(second), speed - limits.acceleration * (span - until))
    if candidate[KIND] == TWO_TWISTS and first < 0.0 and second <= 0.0:
        turning = max(abs(w), abs(candidate[YAW_RATE]))
        if off + turning * min(until + turning / limits.yaw_acceleration, span) < 0.5 * math.pi:
            driven = 0.0
    return slowing + driven + ROUNDING, speed


@kernel
def limit_worths(
    x: float, y: float, yaw: float, v: float, w: float, s: float, candidates: Array, path: PathSamples,
    limits: MotionLimits, tuning: PursuitTuning, weights: AvoidanceWeights, span: float, window: float,
) -> Array:  # fmt: skip
    """Return upper bounds of the candidates' (N, 6) worths without following them (N,) [m]."""
    most = fastest(v, candidates, limits)
    brake, step = 0.5 / limits.acceleration, weights.step
    farthest = most * span + (v * v + most * most) * brake + limits.acceleration * step * step + 2.0 * ROUNDING
    progress = np.empty(LEVELS + 1)
    off = progress_by_distance(x, y, yaw, s, window, path, farthest, progress)
    limit = np.empty(candidates.shape[0])
    for n in range(candidates.shape[0]):
        distance, speed = travel(candidates[n], v, w, span, step, off, limits)
        i = min(int(LEVELS * distance / farthest) + 1, LEVELS)
        limit[n] = progress[i] + weights.speed_weight * speed + ROUNDING
        if n <= 1:
            limit[n] += weights.persistence
    return limit


@leaf
def passes_all(trail: Array, places: Array, near: Array) -> bool:
    """Return whether the robot comes no closer to any of the movers `near` at the end of its trail."""
    k = trail.shape[0] - 1
    for m in near:
        now = math.hypot(places[k, m, 0] - trail[k, 0], places[k, m, 1] - trail[k, 1])
        before = math.hypot(places[k - 1, m, 0] - trail[k - 1, 0], places[k - 1, m, 1] - trail[k - 1, 1])
        if now < before:
            return False
    return True


@leaf
def off_route(x: float, y: float, s: float, path: PathSamples, limits: MotionLimits, tuning: PursuitTuning) -> bool:
    """Return whether a robot at progress s or more is off its route, whose margin then holds no loss for it."""
    s, k = project(x, y, s, tuning.lookahead_max + limits.speed, path.xy, path.arc)
    px, py, _ = point_at(s, k, path.xy, path.arc)
    return math.hypot(x - px, y - py) > OFF_ROUTE


@leaf
def halts(trail: Array, s: float, window: float, path: PathSamples, end: float) -> bool:
    """Return whether a trail ends with a robot that stands, farther than `end` from the end of its route [m]."""
    k = trail.shape[0] - 1
    if trail[k, 3] != 0.0 or trail[k, 4] != 0.0 or trail[k - 1, 3] != 0.0 or trail[k - 1, 4] != 0.0:
        return False
    progress, _ = project(trail[k, 0], trail[k, 1], s, window, path.xy, path.arc)
    return bool(path.arc[-1] - progress > end)


@leaf
def room_at(row: Array, outlined: bool, obstacles: ObstacleIndex, tuning: PursuitTuning) -> float:
    """Return the clearance of the robot's circle, or of its outline, at a row of a trail [m]."""
    if outlined:
        return float(outline_clearance(row[0], row[1], row[2], obstacles, tuning, tuning.robot_radius))
    return float(clearance_at(row[0], row[1], obstacles) - tuning.robot_radius)


@kernel
def choose(
    x: float, y: float, yaw: float, v: float, w: float, s: float, rotating: bool, candidates: Array,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
    weights: AvoidanceWeights, places: Array, radii: Array,
) -> tuple[int, float]:  # fmt: skip
    """Return the index of the chosen candidate (N, 6), and the time of its first contact [s], inf if never.

    Row 0 is the controller's motion, row 1 the last decision. Row 0 is chosen if it has the preferred clearance and no
    risk; otherwise the candidate of highest worth without contact; if all have contact, the one with the latest contact that
    keeps clear of obstacles, -1 if none does. A line beside the route has worth only where it leads past all movers.

    Without movers, too, the controller's motion must keep clear of obstacles after another decision, whose speed it may be
    unable to brake, off the route, and where the circle has less room than on it. A robot that would halt before the end of its
    route, and not for movers, makes room for a new one.

    Obstacles only exclude candidates, and movers only lower their worth. So the search is best-first: the candidate with the
    highest bound is followed, which lowers its bound to its worth without movers. When it is first again, it is evaluated
    among obstacles and movers. The search ends when no bound exceeds the best worth.
    """
    near, contact_distances = relevant_movers(x, y, yaw, limits, tuning, weights, places, radii)
    turns = path.turns.shape[0] > 0
    tight = not turns and clearance_at(x, y, obstacles) < tuning.stopping_clearance
    going = candidates[0, SPEED] > 0.0  # no earlier rule lets the robot stand
    end = max(ROUTE_END, tuning.goal_distance)
    held = going and v == 0.0 and w == 0.0 and path.arc[-1] - s > end
    strayed = off_route(x, y, s, path, limits, tuning)
    if near.shape[0] == 0 and not (tight or held or strayed) and candidates[1, KIND] == FOLLOW_ROUTE:
        return 0, math.inf
    outlined = weights.outlined or turns
    count, instants, cap = candidates.shape[0], places.shape[0], weights.preferred_clearance
    by_step = reachable_by_step(x, y, fastest(v, candidates, limits), weights, places, radii, near, cap)
    trails, steps, blocked = np.empty((count, instants, 5)), np.empty(count, np.int64), np.empty(count, np.bool_)
    route = least_clearance(x, y, yaw, not strayed, outlined, obstacles, tuning, weights)
    off = least_clearance(x, y, yaw, False, outlined, obstacles, tuning, weights)
    own = follow(
        x, y, yaw, v, w, s, rotating, candidates[0], path, obstacles, limits, tuning, weights.step, 0, True, route, trails[0],
    )  # fmt: skip
    steps[0], blocked[0] = own.steps, own.blocked
    span = weights.step * (instants - 1)
    window = limits.speed * span + tuning.lookahead_max
    alone = encounter(trails[0], Trail(own.steps, False), places, radii, near, by_step, contact_distances, weights, cap)
    undisturbed = alone.contact == math.inf and alone.clearance >= cap and alone.intrusion == 0.0
    met = alone
    if own.blocked:
        met = encounter(trails[0], own, places, radii, near, by_step, contact_distances, weights, cap)
    if undisturbed and not own.blocked and not (going and halts(trails[0], s, window, path, end)):
        return 0, math.inf
    limit = limit_worths(x, y, yaw, v, w, s, candidates, path, limits, tuning, weights, span, window)
    if (candidates[1] == candidates[0]).all():
        limit[1] = -math.inf  # never better than row 0
    limit[0] = -math.inf  # evaluated below
    followed = np.zeros(count, np.bool_)
    best, best_score = -1, -math.inf
    if met.contact == math.inf:
        value = worth(trails[0, instants - 1], s, window, path, tuning, weights)
        best, best_score = 0, among_movers(value, met, weights) + weights.persistence
    while True:
        n = int(np.argmax(limit))
        if limit[n] == -math.inf or limit[n] < best_score or (limit[n] == best_score and n > best):
            break
        if not followed[n]:
            follow(
                x, y, yaw, v, w, s, rotating, candidates[n], path, obstacles, limits, tuning, weights.step, 0, False,
                off, trails[n],
            )  # fmt: skip
            followed[n] = True
            limit[n] = worth(trails[n, instants - 1], s, window, path, tuning, weights)
            if n <= 1:
                limit[n] += weights.persistence
            continue
        beside, required = candidates[n, KIND] == BESIDE_ROUTE, off
        if candidates[n, KIND] == FOLLOW_ROUTE:
            required = route
        if (beside and not passes_all(trails[n], places, near)) or meets_obstacle(
            trails[n], required, obstacles, tuning, weights.step
        ):
            limit[n] = -math.inf
            continue
        met = encounter(
            trails[n], Trail(instants - 1, False), places, radii, near, by_step, contact_distances, weights, cap
        )
        value = among_movers(worth(trails[n, instants - 1], s, window, path, tuning, weights), met, weights)
        if n <= 1:
            value += weights.persistence
        if met.contact == math.inf and (value > best_score or (value == best_score and n < best)):
            best, best_score = n, value
        limit[n] = -math.inf
    if best >= 0 and not (undisturbed and going and halts(trails[best], s, window, path, end)):
        return best, math.inf
    follow_all(
        s, rotating, candidates, path, obstacles, limits, tuning, weights.step, route, off, trails, steps, blocked
    )  # fmt: skip
    if best >= 0:
        here, best_score = room_at(trails[0, 0], outlined, obstacles, tuning), -math.inf
        for n in range(1, count):
            if blocked[n] or candidates[n, KIND] != TWO_TWISTS:
                continue
            room = min(room_at(trails[n, instants - 1], outlined, obstacles, tuning) - here, ROOM)
            met = encounter(
                trails[n], Trail(steps[n], False), places, radii, near, by_step, contact_distances, weights, cap
            )
            if room < LEAST_ROOM or met.contact < math.inf:
                continue
            value = among_movers(ROOM_WEIGHT * room, met, weights) + (weights.persistence if n == 1 else 0.0)
            if value > best_score:
                best, best_score = n, value
        return best, math.inf
    best, latest = -1, -1.0
    for n in range(count):
        if blocked[n]:
            continue
        met = encounter(
            trails[n], Trail(steps[n], False), places, radii, near, by_step, contact_distances, weights, cap
        )
        if met.contact > latest + 1e-9:
            best, latest = n, met.contact
    return best, latest


@kernel
def best_escape(
    x: float, y: float, yaw: float, v: float, w: float, s: float, rotating: bool, candidates: Array,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
    weights: AvoidanceWeights, places: Array, radii: Array,
) -> int:  # fmt: skip
    """Return the candidate that stays farthest from movers in the near future; -1 if all have contact.

    A mover that has turned towards the robot may leave no candidate with the least clearance. That clearance includes a
    margin, so dodging often avoids the contact.
    """
    near, _ = relevant_movers(x, y, yaw, limits, tuning, weights, places, radii)
    outlined = weights.outlined or path.turns.shape[0] > 0
    soon, instants = min(places.shape[0], int(ESCAPE_TIME / weights.step) + 2), places.shape[0]
    bodies, count = radii + weights.radius, candidates.shape[0]
    by_step = reachable_by_step(x, y, math.inf, weights, places[:soon], radii, near, math.inf)
    trails, steps, blocked = np.empty((count, instants, 5)), np.empty(count, np.int64), np.empty(count, np.bool_)
    strayed = off_route(x, y, s, path, limits, tuning)
    route = least_clearance(x, y, yaw, not strayed, outlined, obstacles, tuning, weights)
    off = least_clearance(x, y, yaw, False, outlined, obstacles, tuning, weights)
    own = follow(
        x, y, yaw, v, w, s, rotating, candidates[0], path, obstacles, limits, tuning, weights.step, 0, True, route, trails[0],
    )  # fmt: skip
    steps[0], blocked[0] = own.steps, own.blocked
    follow_all(
        s, rotating, candidates, path, obstacles, limits, tuning, weights.step, route, off, trails, steps, blocked
    )  # fmt: skip
    best, most = -1, -math.inf
    for n in range(count):
        if blocked[n]:
            continue
        met = encounter(trails[n], Trail(soon - 1, False), places, radii, near, by_step, bodies, weights, math.inf)
        if met.contact == math.inf and met.clearance > most + 1e-6:
            best, most = n, met.clearance
    return best
