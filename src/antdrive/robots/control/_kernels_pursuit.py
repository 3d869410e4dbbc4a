"""Compiled pure pursuit: carrot, speed rules, the robot's limits, and the stopping check."""

from __future__ import annotations

import math
from typing import NamedTuple

from antdrive.robots.control._kernels_obstacles import (
    ObstacleIndex,
    arc_clearance,
    clearance_at,
    nearby,
    turn_clearance,
)
from antdrive.robots.control._kernels_path import PathSamples, carrot_at, point_at, project
from antdrive.worlds._kernels import Array, kernel, leaf

# The rules that can limit the speed, as indices into pursuit.LIMITERS.
CRUISE, CURVATURE, ROUTE, YAW_RATE, GOAL, ROTATE, CREEP, BRAKING, DONE, CLEARANCE = range(10)

HARDEST = 1.4  # largest deceleration to turn at top speed, times the limit; certificates allow 1.5
YAW_RATE_TIME = 0.2  # the yaw rate of a curve must be reachable within this time [s]
END_LOOKAHEAD = 0.35  # near the goal, the lookahead is at most this fraction of the remaining route
TURN_CLEARANCE = 0.005  # least clearance of a rotation in place, or almost the current one [m]
START_TOLERANCE = 5e-4  # arcs may be this much closer to obstacles than the robot is [m]


class MotionLimits(NamedTuple):
    """Limits of the robot's drive.

    Attributes:
        speed: forward speed [m/s]
        yaw_rate: yaw rate [rad/s]
        acceleration: acceleration and deceleration [m/s^2]
        yaw_acceleration: change of the yaw rate [rad/s^2]
        lateral_acceleration: speed times yaw rate [m/s^2]
        half_track: distance from the centre to a wheel [m]
        rim_speed: speed of a wheel's rim [m/s]
    """

    speed: float
    yaw_rate: float
    acceleration: float
    yaw_acceleration: float
    lateral_acceleration: float
    half_track: float
    rim_speed: float


class PursuitTuning(NamedTuple):
    """The controller's settings for one robot on one route.

    Attributes:
        period: control period [s]
        spacing: distance between the path's samples [m]
        lookahead_clearance: of the robot's centre on the arc to the carrot [m]
        stopping_clearance: of the robot's centre on the stopping arc [m]
        robot_radius: circumscribed radius of the robot [m]
        half_length: of the footprint, without its rounding; 0 to skip checks of rotations in place [m]
        half_width: the same across [m]
        rounding: radius of the footprint's corners [m]
        corners: of a polygonal footprint (K, 2) [m]; none for other footprints or to skip checks of rotations in place
        lookahead_time: lookahead divided by speed [s]
        lookahead_min: shortest lookahead [m]
        lookahead_max: longest lookahead [m]
        preferred_lookahead_min: shortest lookahead if it is clear [m]
        rotate_above: bearing of the carrot above which a moving robot rotates in place [rad]
        rotate_above_at_rest: the same for a robot at rest [rad]
        rotate_until: bearing below which the rotation ends [rad]
        braking: fraction of the deceleration for planned braking
        creep_speed: slowest forward speed [m/s]
        goal_distance: remaining route length at which the robot stops [m]
        min_speed_near_obstacles: speed limit at zero clearance [m/s]
        clearance_time: clearance divided by this is added to that limit [s]
        turn_in_clearance: clearance of the centre's stopping arc at which a robot that brakes for a rotation in place turns
            in [m]; inf: it keeps to its curve
    """

    period: float
    spacing: float
    lookahead_clearance: float
    stopping_clearance: float
    robot_radius: float
    half_length: float
    half_width: float
    rounding: float
    corners: Array
    lookahead_time: float
    lookahead_min: float
    lookahead_max: float
    preferred_lookahead_min: float
    rotate_above: float
    rotate_above_at_rest: float
    rotate_until: float
    braking: float
    creep_speed: float
    goal_distance: float
    min_speed_near_obstacles: float
    clearance_time: float
    turn_in_clearance: float


class Carrot(NamedTuple):
    """The route point that the robot steers for, relative to the robot.

    Attributes:
        lookahead: its lookahead distance [m]
        left: its offset to the left of the robot's heading [m]
        distance: its distance [m]
        bearing: its direction relative to the heading [rad]
        clear: whether the arc to it keeps clear of obstacles
    """

    lookahead: float
    left: float
    distance: float
    bearing: float
    clear: bool


@leaf
def clip(value: float, low: float, high: float) -> float:
    """Return the value clipped to [low, high]."""
    return min(max(value, low), high)


@leaf
def keep_wheels_within(v: float, w: float, last: float, period: float, limits: MotionLimits) -> tuple[float, float]:
    """Scale speed and yaw rate together to keep both wheels within their speed limit.

    If that brakes too hard from the speed `last`, the yaw rate is reduced instead: a robot at its wheels' top speed cannot
    both turn in and keep its deceleration limit.
    """
    rim = abs(v) + abs(w) * limits.half_track
    if rim > limits.rim_speed:
        v, w = v * limits.rim_speed / rim, w * limits.rim_speed / rim
        slowest = min(abs(last) - HARDEST * limits.acceleration * period, limits.rim_speed)
        if abs(v) < slowest:
            v, w = math.copysign(slowest, v), math.copysign((limits.rim_speed - slowest) / limits.half_track, w)
    return v, w


@leaf
def reachable_yaw_rate(wanted: float, w: float, period: float, limits: MotionLimits) -> float:
    """Return the yaw rate closest to the wanted one that is reachable from `w` within a period."""
    change = limits.yaw_acceleration * period
    return clip(wanted, max(w - change, -limits.yaw_rate), min(w + change, limits.yaw_rate))


@leaf
def reachable_twist(
    speed: float, yaw_rate: float, v: float, w: float, period: float, limits: MotionLimits
) -> tuple[float, float]:
    """Return the speed and yaw rate closest to the wanted ones that are reachable from (v, w) within a period."""
    change = limits.acceleration * period
    new_v = clip(speed, v - change, v + change)
    new_w = reachable_yaw_rate(yaw_rate, w, period, limits)
    return keep_wheels_within(new_v, new_w, v, period, limits)


@leaf
def slow_for_curvature(curvature: float, lateral_acceleration: float, yaw_rate: float) -> float:
    """Return the highest speed in a curve for the given lateral acceleration and yaw rate.

    v^2 |k| <= a and v |k| <= w.
    """
    k = abs(curvature)
    if k < 1e-9:
        return math.inf
    return min(math.sqrt(lateral_acceleration / k), yaw_rate / k)


@leaf
def slow_for_yaw_rate(curvature: float, yaw_rate: float, yaw_acceleration: float, time: float) -> float:
    """Return the highest speed at which a curve's yaw rate is reachable within `time` from the current one.

    v |k| <= w + a t, with the yaw rate w counted in the direction of the curve.
    """
    k = abs(curvature)
    if k < 1e-9:
        return math.inf
    turning = yaw_rate if curvature > 0 else -yaw_rate
    return max(turning + yaw_acceleration * time, 0.0) / k


@leaf
def slow_for_clearance(clearance: float, min_speed: float, time: float) -> float:
    """Return the speed limit near obstacles: `min_speed` plus clearance / time.

    After the proximity heuristic of S. Macenski et al., Regulated pure pursuit for robot path tracking,
    Autonomous Robots 47, 2023, with the clearance in place of the costmap's cost.
    """
    return min_speed + max(clearance, 0.0) / time


@leaf
def brake_for_goal(remaining: float, deceleration: float) -> float:
    """Return the speed from which the robot can stop in `remaining` metres: v^2 = 2 a d."""
    return math.sqrt(2.0 * deceleration * max(remaining, 0.0))


@leaf
def stopping_clearance(
    x: float,
    y: float,
    yaw: float,
    v: float,
    w: float,
    deceleration: float,
    period: float,
    obstacles: ObstacleIndex,
    most: float,
) -> float:
    """Return the clearance of the stopping arc, at most `most`: one more period, then braking.

    A velocity is admissible if the robot can stop before the next obstacle on its arc (D. Fox, W. Burgard and
    S. Thrun, The dynamic window approach to collision avoidance, IEEE Robotics & Automation Magazine 4, 1997).
    """
    length = v * period + 0.5 * v * v / deceleration
    sweep = w / v * length
    chord = length if abs(sweep) < 1e-6 else 2.0 * v / w * math.sin(0.5 * sweep)
    ex, ey = x + chord * math.cos(yaw + 0.5 * sweep), y + chord * math.sin(yaw + 0.5 * sweep)
    discs = nearby(x, y, most + length, obstacles)
    return arc_clearance(x, y, yaw, w / v, sweep, ex, ey, discs, obstacles.bounds, most)


@leaf
def find_carrot(
    x: float, y: float, yaw: float, v: float, s: float, k: int, clearance: float, longest: float,
    obstacles: ObstacleIndex, xy: Array, arc: Array, tuning: PursuitTuning,
) -> Carrot:  # fmt: skip
    """Return the carrot at the longest lookahead, at most `longest`, whose arc keeps `clearance`.

    The lookahead shrinks until the arc is clear, so corners are cut only where there is room. If no arc is clear, the
    carrot is that of the shortest lookahead.
    """
    shortest = tuning.lookahead_min
    look = clip(max(tuning.lookahead_time * v, tuning.preferred_lookahead_min), shortest, longest)
    while True:
        cx, cy = carrot_at(x, y, look, s, k, xy, arc)
        dx, dy = cx - x, cy - y
        ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
        left = math.cos(yaw) * dy - math.sin(yaw) * dx
        distance = math.hypot(dx, dy)
        bearing = math.atan2(left, ahead)
        if abs(bearing) < tuning.rotate_above:
            curvature = 2.0 * left / (distance * distance)
            discs, bounds = (
                nearby(x, y, clearance + distance, obstacles),
                obstacles.bounds,
            )  # arcs of less than half a circle
            if arc_clearance(x, y, yaw, curvature, 2.0 * bearing, cx, cy, discs, bounds, clearance) >= clearance:
                return Carrot(look, left, distance, bearing, True)
        if look <= shortest:
            return Carrot(look, left, distance, bearing, False)
        look = max(0.75 * look, shortest)


@leaf
def should_rotate(rotating: bool, v: float, carrot: Carrot, tuning: PursuitTuning) -> bool:
    """Return whether to rotate in place: with hysteresis, and sooner if no arc is clear or the robot is at rest."""
    limit = tuning.rotate_above if v > tuning.creep_speed else tuning.rotate_above_at_rest
    if rotating:
        limit = tuning.rotate_until
    elif not carrot.clear:
        limit = min(limit, tuning.rotate_until)
    return abs(carrot.bearing) > limit


@leaf
def curvature_to_drive(
    v: float, s: float, k: int, i: int, j: int, carrot: Carrot, path: PathSamples, tuning: PursuitTuning
) -> float:
    """Return the curvature of the arc to the carrot (Coulter 1992), corrected if the route's curvature is known.

    The arc to a carrot on a bend cuts the bend. So the command follows the route's curvature, one period ahead, and the
    carrot corrects only the cross-track error: the difference between its arc and the arc to the same carrot from the
    route.
    """
    curvature = 2.0 * carrot.left / (carrot.distance * carrot.distance)
    if math.isnan(path.curvature[i]):
        return curvature
    f = min((s - i * tuning.spacing) / tuning.spacing, 1.0)
    px, py, _ = point_at(s, k, path.xy, path.arc)
    cx, cy = carrot_at(px, py, carrot.lookahead, s, k, path.xy, path.arc)
    facing = path.heading[i] + f * (path.heading[j] - path.heading[i])
    left = math.cos(facing) * (cy - py) - math.sin(facing) * (cx - px)
    curvature -= 2.0 * left / ((cx - px) * (cx - px) + (cy - py) * (cy - py))
    ahead = min(s + max(v, 0.0) * tuning.period, path.arc[-1]) / tuning.spacing
    h = min(int(ahead), path.curvature.shape[0] - 2)
    curvature += path.curvature[h] + (ahead - h) * (path.curvature[h + 1] - path.curvature[h])
    return float(curvature)


@leaf
def speed_limit(
    w: float, curvature: float, route_speed: float, clearance: float, remaining: float, clear: bool,
    limits: MotionLimits, tuning: PursuitTuning,
) -> tuple[float, int]:  # fmt: skip
    """Return the lowest speed limit of all rules, and its rule."""
    target, limiter = limits.speed, CRUISE
    bound = slow_for_curvature(curvature, limits.lateral_acceleration, limits.yaw_rate)
    if bound < target:
        target, limiter = bound, CURVATURE
    if route_speed < target:
        target, limiter = route_speed, ROUTE
    bound = slow_for_clearance(clearance, tuning.min_speed_near_obstacles, tuning.clearance_time)
    if bound < target:
        target, limiter = bound, CLEARANCE
    bound = slow_for_yaw_rate(curvature, w, limits.yaw_acceleration, YAW_RATE_TIME)
    if bound < target:
        target, limiter = bound, YAW_RATE
    bound = brake_for_goal(remaining - 0.5 * tuning.goal_distance, tuning.braking * limits.acceleration)
    if bound < target:
        target, limiter = bound, GOAL
    if not clear:
        target, limiter = min(target, tuning.creep_speed), CREEP
    return max(target, min(tuning.creep_speed, limits.speed)), limiter


@leaf
def clear_turn(
    x: float, y: float, yaw: float, bearing: float, distance: float, obstacles: ObstacleIndex, tuning: PursuitTuning
) -> float:
    """Return the angle to rotate in place towards a bearing; 0 if the footprint has contact in both directions.

    `distance` is from the centre to the nearest obstacle. An obstacle beyond the circumscribed radius blocks no turn. A
    nearer one also blocks a centred rectangle's longer turn, which leads two corners past it; a polygon with one far corner
    may still pass it.
    """
    hx, hy, rounding, corners = tuning.half_length, tuning.half_width, tuning.rounding, tuning.corners
    if distance > tuning.robot_radius or (hx == 0.0 and hy == 0.0 and corners.shape[0] == 0):
        return bearing
    discs, bounds = nearby(x, y, math.inf, obstacles), obstacles.bounds
    now = turn_clearance(x, y, yaw, 0.0, hx, hy, rounding, corners, discs, bounds)
    least = min(TURN_CLEARANCE, now - START_TOLERANCE)
    if turn_clearance(x, y, yaw, bearing, hx, hy, rounding, corners, discs, bounds) >= least:
        return bearing
    if corners.shape[0] > 0:
        longer = bearing - math.copysign(2.0 * math.pi, bearing)
        if turn_clearance(x, y, yaw, longer, hx, hy, rounding, corners, discs, bounds) >= least:
            return longer
    return 0.0


@leaf
def speed_off_route(
    route_speed: float, x: float, y: float, s: float, k: int, xy: Array, arc: Array, limits: MotionLimits,
    tuning: PursuitTuning,
) -> float:  # fmt: skip
    """Return the route's speed limit for a robot at (x, y) off the route, whose nearest point is at arc length s.

    The limit holds on the route, and the robot can brake on its path there. Otherwise a robot that left the route at a sharp
    corner, where the limit is 0, would creep back. Within the shortest lookahead the robot counts as on the route.
    """
    px, py, _ = point_at(s, k, xy, arc)
    spare = math.hypot(px - x, py - y) - tuning.lookahead_min
    if spare <= 0.0:
        return route_speed
    return math.sqrt(route_speed * route_speed + 2.0 * tuning.braking * limits.acceleration * spare)


@leaf
def rotation(new_v: float, v: float, w: float, bearing: float, limits: MotionLimits, tuning: PursuitTuning) -> float:
    """Return the yaw rate for a rotation in place.

    The robot first brakes on its current curve and rotates once it is almost at rest, so that the footprint stays where it
    was checked. The yaw rate falls to 0 together with the bearing.
    """
    if abs(new_v) < tuning.creep_speed:
        return math.copysign(min(limits.yaw_rate, math.sqrt(limits.yaw_acceleration * abs(bearing))), bearing)
    return w * new_v / v if v > 0.0 else 0.0


@leaf
def turn_in(
    x: float, y: float, yaw: float, new_v: float, w: float, bearing: float, held: float, obstacles: ObstacleIndex,
    limits: MotionLimits, tuning: PursuitTuning,
) -> float:  # fmt: skip
    """Return the yaw rate of a robot that brakes for a rotation in place, which is `held` on its current curve.

    It turns in on the way if it then stops where it has room to rotate: `turn_in_clearance`, or as much as on its curve.
    """
    period, deceleration, most = tuning.period, limits.acceleration, tuning.turn_in_clearance
    fastest = min(math.sqrt(limits.yaw_acceleration * abs(bearing)), limits.lateral_acceleration / new_v)
    turned = reachable_yaw_rate(math.copysign(fastest, bearing), w, period, limits)
    kept = stopping_clearance(x, y, yaw, new_v, held, deceleration, period, obstacles, most)
    clear = stopping_clearance(x, y, yaw, new_v, turned, deceleration, period, obstacles, most)
    return turned if clear >= min(max(kept, tuning.robot_radius), most) else held


@leaf
def full_braking(
    x: float, y: float, yaw: float, v: float, w: float, curvature: float, required: float,
    obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
) -> tuple[float, float]:  # fmt: skip
    """Return speed and yaw rate of full braking, on the current curve as long as it is clear.

    The last command passed the check of its stopping arc, so its curve is clear if the robot drives as commanded. If slip or
    a corrected estimate has moved that arc closer to obstacles than `required`, the robot steers towards `curvature` while
    braking, if it then stops farther from them.
    """
    period, deceleration = tuning.period, limits.acceleration
    new_v = max(v - deceleration * period, 0.0)
    held = w * new_v / v if v > 0.0 else 0.0
    if new_v == 0.0:
        return new_v, held
    clear = stopping_clearance(x, y, yaw, new_v, held, deceleration, period, obstacles, required)
    if clear >= required:
        return new_v, held
    steered = reachable_yaw_rate(curvature * new_v, w, period, limits)
    if stopping_clearance(x, y, yaw, new_v, steered, deceleration, period, obstacles, required) <= clear:
        return new_v, held
    return keep_wheels_within(new_v, steered, v, period, limits)


@leaf
def pursue(
    x: float, y: float, yaw: float, v: float, w: float, progress: float, rotating: bool,
    path: PathSamples, obstacles: ObstacleIndex, limits: MotionLimits, tuning: PursuitTuning,
) -> tuple[float, float, float, bool, int]:  # fmt: skip
    """Compute one control period: next speed and yaw rate, progress, whether to rotate, and the limiter."""
    period = tuning.period
    s, k = project(x, y, progress, tuning.lookahead_max, path.xy, path.arc)
    remaining = path.arc[-1] - s
    i = min(int(s / tuning.spacing), path.lookahead.shape[0] - 1)
    j = min(i + 1, path.lookahead.shape[0] - 1)

    distance = clearance_at(x, y, obstacles)
    clearance = min(tuning.lookahead_clearance, distance - START_TOLERANCE)
    # Near the end a shorter lookahead makes the robot stop at the route's end, not beside it.
    near_end = max(END_LOOKAHEAD * remaining, tuning.lookahead_min)
    longest = min(min(path.lookahead[i], path.lookahead[j]), near_end)
    carrot = find_carrot(x, y, yaw, v, s, k, clearance, longest, obstacles, path.xy, path.arc, tuning)

    rotating = should_rotate(rotating, v, carrot, tuning)
    at_goal = remaining <= tuning.goal_distance
    curvature = 0.0
    if at_goal:
        target, limiter = 0.0, DONE
    elif rotating:
        target, limiter = 0.0, ROTATE
    else:
        curvature = curvature_to_drive(v, s, k, i, j, carrot, path, tuning)
        route_speed = min(path.speed[i], path.speed[j])
        route_speed = speed_off_route(route_speed, x, y, s, k, path.xy, path.arc, limits, tuning)
        target, limiter = speed_limit(
            w, curvature, route_speed, distance - tuning.robot_radius, remaining, carrot.clear, limits, tuning
        )

    new_v = clip(target, v - limits.acceleration * period, v + limits.acceleration * period)
    if rotating and not at_goal:
        bearing = clear_turn(x, y, yaw, carrot.bearing, distance, obstacles, tuning)
        wanted = rotation(new_v, v, w, bearing, limits, tuning)
        if new_v >= tuning.creep_speed and tuning.turn_in_clearance < math.inf:
            wanted = turn_in(x, y, yaw, new_v, w, carrot.bearing, wanted, obstacles, limits, tuning)
    else:
        wanted = curvature * new_v
    new_w = reachable_yaw_rate(wanted, w, period, limits)
    new_v, new_w = keep_wheels_within(new_v, new_w, v, period, limits)

    # Overrides the rules above: the stopping arc must be clear.
    required = min(tuning.stopping_clearance, clearance)
    if (
        new_v > tuning.creep_speed
        and stopping_clearance(x, y, yaw, new_v, new_w, limits.acceleration, period, obstacles, required) < required
    ):
        limiter = BRAKING
        new_v, new_w = full_braking(x, y, yaw, v, w, curvature, required, obstacles, limits, tuning)
    return new_v, new_w, s, rotating, limiter


@kernel
def unpacked(
    xy: Array, arc: Array, lookahead: Array, speed: Array, curvature: Array, heading: Array, turns: Array,
    discs: Array, starts: Array, bounds: Array, corner: Array, corners: Array, n: Array,
) -> tuple[PathSamples, ObstacleIndex, MotionLimits, PursuitTuning]:  # fmt: skip
    """Return samples, obstacles, limits and tuning of a path in the form of `TrackedPath.packed`."""
    tuning = PursuitTuning(
        n[9], n[10], n[11], n[12], n[13], n[14], n[15], n[16], corners, n[17], n[18], n[19], n[20], n[21], n[22], n[23],
        n[24], n[25], n[26], n[27], n[28], n[29],
    )  # fmt: skip
    return (
        PathSamples(xy, arc, lookahead, speed, curvature, heading, turns, n[0]),
        ObstacleIndex(discs, starts, bounds, corner, n[1]),
        MotionLimits(n[2], n[3], n[4], n[5], n[6], n[7], n[8]),
        tuning,
    )


@kernel
def pursue_packed(
    x: float, y: float, yaw: float, v: float, w: float, progress: float, turning: bool,
    xy: Array, arc: Array, lookahead: Array, speed: Array, curvature: Array, heading: Array, turns: Array,
    discs: Array, starts: Array, bounds: Array, corner: Array, corners: Array, n: Array,
) -> tuple[float, float, float, bool, int]:  # fmt: skip
    """Compute one control period along a path in the form of `TrackedPath.packed`."""
    path, obstacles, limits, tuning = unpacked(
        xy, arc, lookahead, speed, curvature, heading, turns, discs, starts, bounds, corner, corners, n
    )
    return pursue(x, y, yaw, v, w, progress, turning, path, obstacles, limits, tuning)
