"""Speed limits along a route: by the robot's limits, the clearance and the lookahead.

On a fixed path, the fastest profile follows from a limit at each point: a forward pass enforces the acceleration, a
backward pass the deceleration (Bobrow, Dubowsky & Gibson, *Time-optimal control of robotic manipulators along specified
paths*, IJRR 4, 1985; in this form Lipp & Boyd, *Minimum-time speed optimisation over a fixed path*, Int. J. Control 87,
2014). Yaw acceleration is checked with the speed at the slower end of each step, so the result is optimal up to the
length of a step. `limits_along` adds the limits near obstacles; `_kernels_pursuit.speed_limit` applies the limits at run time.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from antdrive.base import Floats
from antdrive.robots.clearance import footprint_clearance
from antdrive.robots.control import _kernels_path
from antdrive.robots.control._kernels_obstacles import ObstacleIndex
from antdrive.robots.control._kernels_pursuit import PursuitTuning
from antdrive.robots.spec import RobotSpec
from antdrive.worlds import Route, World

UNKNOWN = np.empty(0)  # curvature of a route with corners
UNKNOWN.setflags(write=False)
STEP = 0.02  # longest distance between two samples of a profile [m]
BACKWARDS = 0.3  # highest speed on the part of a route that is driven backwards [m/s]
#: Heading error at noise 1 that the yaw acceleration must undo, and the largest drift to the side meanwhile [rad], [m].
HEADING_ERROR, DRIFT = 0.08, 0.025


def speed_profile(
    route: Route, spec: RobotSpec, blend: float, rotate_in_place_above: float, braking: float, step: float = STEP
) -> Floats:
    """Return the fastest speeds along a route, from rest to rest, within all limits of the robot (6, S).

    The rows are arc length [m], speed [m/s], arrival time [s], curvature of the path with rounded corners [1/m], unwrapped
    heading on it, including rotations in place [rad], and the speed limit irrespective of the speed at earlier points [m/s].
    Points with a rotation in place occur twice.

    Args:
        route: the route
        spec: the robot
        blend: distance on both sides for averaging the route's curvature with triangular weights, because robots cannot
            follow a jump in curvature at speed [m]
        rotate_in_place_above: minimum angle of a corner at which the robot stops and rotates in place [rad]
        braking: fraction of the robot's deceleration for braking
        step: longest distance between two samples [m]
    """
    from antdrive.robots.control import _kernels_profile

    rows: Floats = _kernels_profile.profile_along(
        route.xy, route.arc, UNKNOWN if route.curvature is None else route.curvature, blend, blend**2,
        rotate_in_place_above, step, spec.max_speed, spec.max_lateral_acceleration, spec.max_yaw_rate,
        spec.max_yaw_acceleration, spec.track / 2, spec.max_wheel_speed * spec.wheel_radius, spec.max_acceleration,
        braking * spec.max_acceleration,
    )  # fmt: skip
    return rows


def heading_error(spec: RobotSpec, noise: float) -> float:
    """Return the heading error by noise and slip that the yaw acceleration must undo [rad].

    `noise` is the factor on the robot's documented noise; above 1 the error no longer grows.
    """
    return HEADING_ERROR * min(noise, 1.0) if spec.noise.nonzero else 0.0


def steering_time(spec: RobotSpec, error: float) -> float:
    """Return the shortest lookahead time T whose steering the yaw acceleration can follow [s].

    Pure pursuit returns to a straight with the natural frequency sqrt(2) / T. An oscillation of the heading by `error` [rad]
    then needs the yaw acceleration 2 `error` / T^2. A robot that cannot reach it lags behind its commands and weaves.
    """
    return math.sqrt(2 * error / spec.max_yaw_acceleration)


def steady(spec: RobotSpec, error: float) -> RobotSpec:
    """Return the robot, no faster than it can hold a line: it drifts at most `DRIFT` while it undoes a heading error [rad].

    From rest to rest that takes 2 sqrt(error / a) with the yaw acceleration a; on average half of the error is left.
    """
    drift = error * math.sqrt(error / spec.max_yaw_acceleration)  # per speed [s]
    return replace(spec, max_speed=DRIFT / drift) if spec.max_speed * drift > DRIFT else spec


def limits_along(
    route: Route, obstacles: ObstacleIndex, spec: RobotSpec, lookahead: Floats, tuning: PursuitTuning, blend: float
) -> Floats:
    """Return speed limit, curvature and heading at the samples of a route (3, S)."""
    from antdrive.robots.control import _kernels_profile

    samples: Floats = _kernels_profile.samples_along(
        speed_profile(route, spec, blend, tuning.rotate_above, tuning.braking), route.xy, route.arc, lookahead, obstacles,
        tuning.spacing, spec.radius, tuning.lookahead_time,
        tuning.min_speed_near_obstacles, tuning.clearance_time, tuning.braking * spec.max_acceleration,
    )  # fmt: skip
    return samples


def limits_along_lines(
    route: Route, world: World, spec: RobotSpec, spacing: float, near_obstacles: tuple[float, float], braking: float
) -> Floats:
    """Return the speed limit at the samples of a route of lines (S,) [m/s], by the footprint's clearance.

    Stops at corners are not included. `near_obstacles` holds a speed [m/s] and a time [s]: the limit near
    obstacles is speed + clearance / time.
    """
    at = spacing * np.arange(int(route.length / spacing) + 2)
    xy = np.stack([np.interp(at, route.arc, values) for values in route.xy.T], axis=1)
    facing = route.facing[np.clip(np.searchsorted(route.arc, at, side="right") - 1, 0, len(route.xy) - 2)]
    clearance = footprint_clearance(world, spec.footprint, np.column_stack([xy, facing]))
    speed: Floats = np.minimum(spec.max_speed, near_obstacles[0] + np.maximum(clearance, 0.0) / near_obstacles[1])
    speed[at < route.backwards_until] = min(BACKWARDS, spec.max_speed)
    _kernels_path.brake_backwards(speed, spacing, braking)
    return speed
