"""Speed limits along a route: by the robot's limits, the clearance and the lookahead.

On a fixed path, the fastest profile follows from a limit at each point: a forward pass enforces the acceleration, a
backward pass the deceleration (Bobrow, Dubowsky & Gibson, *Time-optimal control of robotic manipulators along specified
paths*, IJRR 4, 1985; in this form Lipp & Boyd, *Minimum-time speed optimisation over a fixed path*, Int. J. Control 87,
2014). Yaw acceleration is checked with the speed at the slower end of each step, so the result is optimal up to the
length of a step. `limits_along` adds the limits near obstacles; `_kernels_pursuit.speed_limit` applies the limits at run time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import FieldError
from antdrive.robots.clearance import footprint_clearance
from antdrive.robots.control import _kernels_path
from antdrive.robots.control._kernels_pursuit import PursuitTuning
from antdrive.robots.spec import RobotSpec
from antdrive.worlds import Route, World, point_clearance

BACKWARDS = 0.3  # highest speed on the part of a route that is driven backwards [m/s]


@dataclass(frozen=True, eq=False)
class SpeedProfile:
    """Speeds and times along a route; points with a rotation in place occur twice.

    Attributes:
        arc: length along the route, from 0 (S,) [m]
        speed: speed, 0 at both ends (S,) [m/s]
        time: arrival time, from 0 (S,) [s]
        curvature: curvature of the path with rounded corners (S,) [1/m]
        heading: unwrapped heading on that path, including rotations in place (S,) [rad]
        limit: speed limit, irrespective of the speed at earlier points (S,) [m/s]
    """

    arc: Floats
    speed: Floats
    time: Floats
    curvature: Floats
    heading: Floats
    limit: Floats

    @property
    def duration(self) -> float:
        """Duration of the route [s]."""
        return float(self.time[-1])

    @property
    def yaw_rate(self) -> Floats:
        """Yaw rate (S,) [rad/s]."""
        return self.speed * self.curvature


def speed_profile(
    route: Route,
    spec: RobotSpec,
    *,
    blend: float = 0.2,
    rotate_in_place_above: float = 1.0,
    braking: float = 1.0,
    step: float = 0.02,
) -> SpeedProfile:
    """Return the fastest speeds along a route, from rest to rest, within all limits of the robot.

    Args:
        route: the route
        spec: the robot, with its limits of speed, acceleration, lateral acceleration, yaw rate, yaw acceleration and
            wheels
        blend: distance on both sides for averaging the route's curvature with triangular weights, because robots cannot
            follow a jump in curvature at speed [m]
        rotate_in_place_above: minimum angle of a corner at which the robot stops and rotates in place [rad]
        braking: fraction of the robot's deceleration for braking
        step: longest distance between two samples [m]

    Raises:
        ValueError: a setting is out of range.
    """
    for key, value in (("blend", blend), ("rotate_in_place_above", rotate_in_place_above), ("step", step)):
        if not (math.isfinite(value) and value > 0):
            raise FieldError(key, f"must be greater than 0, got {value:g}")
    if not 0 < braking <= 1:
        raise FieldError("braking", f"must be greater than 0 and at most 1, got {braking:g}")

    places, headings, stops, turns = _headings(route, rotate_in_place_above)
    legs: list[tuple[Floats, ...]] = []
    now, turned = 0.0, 0.0
    for first, last, turn in zip([0.0, *stops], [*stops, route.length], [0.0, *turns], strict=True):
        now += turning_time(turn, spec)
        turned += turn
        arc = np.linspace(first, last, max(3, math.ceil((last - first) / step) + 1))
        heading, curvature, change = _blended(arc, places, headings, blend)
        speed, limit = _speeds(arc, curvature, change, spec, braking)
        time = now + np.concatenate(([0.0], np.cumsum(2.0 * np.diff(arc) / (speed[1:] + speed[:-1]))))
        now = float(time[-1])
        legs.append((arc, speed, time, curvature, heading + turned, limit))
    return SpeedProfile(*(np.concatenate(parts) for parts in zip(*legs, strict=True)))


def _speeds(arc: Floats, curvature: Floats, change: Floats, spec: RobotSpec, braking: float) -> tuple[Floats, Floats]:
    """Return speed and limit along a leg from rest to rest; the limit is independent of the initial speed."""
    from antdrive.robots.control import _kernels_profile

    limit = np.empty(len(arc))
    _kernels_profile.limit_speed(
        curvature,
        change,
        spec.max_speed,
        spec.max_lateral_acceleration,
        spec.max_yaw_rate,
        spec.max_yaw_acceleration,
        spec.track / 2,
        spec.max_wheel_speed * spec.wheel_radius,
        limit,
    )
    limit[-1] = 0.0
    acceleration, yaw_acceleration = spec.max_acceleration, spec.max_yaw_acceleration
    _kernels_profile.limit_braking(arc, curvature, change, braking * acceleration, yaw_acceleration, limit)
    speed = limit.copy()
    speed[0] = 0.0
    _kernels_profile.limit_acceleration(arc, curvature, change, acceleration, yaw_acceleration, speed)
    return speed, limit


def turning_time(angle: float, spec: RobotSpec) -> float:
    """Return the time to rotate in place by an angle [rad], from rest to rest [s]."""
    fastest = min(spec.max_yaw_rate, 2 * spec.max_wheel_speed * spec.wheel_radius / spec.track)
    spin_up = fastest / spec.max_yaw_acceleration
    if abs(angle) >= fastest * spin_up:
        return abs(angle) / fastest + spin_up
    return 2.0 * math.sqrt(abs(angle) / spec.max_yaw_acceleration)


def _headings(route: Route, rotate_in_place_above: float) -> tuple[Floats, Floats, list[float], list[float]]:
    """Return the piecewise linear heading along the route, and arc lengths and angles of rotations in place.

    The heading is given by arc lengths [m] and values [rad]. It is linear on arcs; a corner occurs twice. Rotations in
    place are omitted from it.
    """
    steps = np.diff(route.xy, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.diff(heading)
    turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
    heading = heading[0] + np.concatenate(([0.0], np.cumsum(turn)))
    at_start, at_end = heading.copy(), heading.copy()  # of each segment
    corner = np.ones(len(turn), dtype=np.bool_)
    if route.curvature is not None:
        bend = route.curvature[:-1]
        corner = (bend[:-1] != bend[1:]) | (bend[1:] == 0.0)  # other points are vertices of a sampled arc
        middle = (heading[1:] + heading[:-1]) / 2
        at_start[1:][~corner] = at_end[:-1][~corner] = middle[~corner]
    arc = route.arc
    sharp = corner & (np.abs(turn) >= rotate_in_place_above)
    rotated = np.concatenate(([0.0], np.cumsum(np.where(sharp, turn, 0.0))))
    places = np.stack((arc[:-1], arc[1:]), axis=1).ravel()
    headings = np.stack((at_start - rotated, at_end - rotated), axis=1).ravel()
    return places, headings, arc[1:-1][sharp].tolist(), turn[sharp].tolist()


def _blended(s: Floats, places: Floats, headings: Floats, blend: float) -> tuple[Floats, Floats, Floats]:
    """Return heading, curvature and its derivative at arc lengths s, averaged over `blend` on both sides.

    The weights are triangular. The heading is piecewise linear, so its average and the average's derivatives are exact
    second differences of its first and second integrals.
    """
    widths = np.diff(places)
    slopes = np.diff(headings) / np.where(widths > 0, widths, 1.0)
    integral = np.concatenate(([0.0], np.cumsum(widths * (headings[1:] + headings[:-1]) / 2)))
    growth = integral[:-1] * widths + headings[:-1] * widths**2 / 2 + slopes * widths**3 / 6
    second_integral = np.concatenate(([0.0], np.cumsum(growth)))

    def at(t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return heading, integral and second integral at t; the heading is constant beyond the ends."""
        inside = np.clip(t, places[0], places[-1])
        i = np.minimum(np.searchsorted(places, inside, side="right"), len(slopes)) - 1
        d, at_place, slope, so_far = inside - places[i], headings[i], slopes[i], integral[i]
        heading = at_place + slope * d
        first = so_far + at_place * d + slope * d**2 / 2
        second = second_integral[i] + so_far * d + at_place * d**2 / 2 + slope * d**3 / 6
        beyond = t - inside
        return heading, first + heading * beyond, second + first * beyond + heading * beyond**2 / 2

    change, curvature, heading = (
        (after - 2 * here + before) / blend**2 for before, here, after in at(np.stack((s - blend, s, s + blend)))
    )
    return heading, curvature, change


def limits_along(
    route: Route,
    world: World,
    radius: float,
    profile: SpeedProfile,
    lookahead: Floats,
    tuning: PursuitTuning,
    near_obstacles: tuple[float, float],
    braking: float,
) -> Floats:
    """Return the speed limit at the samples of a route (S,) [m/s]: the minimum of profile, clearance and lookahead.

    `near_obstacles` holds a speed [m/s] and a time [s]: the limit near obstacles is speed + clearance / time.
    """
    spacing = tuning.spacing
    at = spacing * np.arange(len(lookahead))
    xy = np.stack([np.interp(at, route.arc, values) for values in route.xy.T], axis=1)
    clearance = point_clearance(world, xy) - radius
    speed: Floats = np.minimum(lookahead / tuning.lookahead_time, np.interp(at, profile.arc, profile.limit))
    speed = np.minimum(speed, near_obstacles[0] + np.maximum(clearance, 0.0) / near_obstacles[1])
    for stop in profile.arc[:-1][np.diff(profile.arc) == 0]:
        speed[int(stop / spacing) : int(stop / spacing) + 2] = 0.0
    _kernels_path.brake_backwards(speed, spacing, braking)
    return speed


def limits_along_lines(
    route: Route, world: World, spec: RobotSpec, spacing: float, near_obstacles: tuple[float, float], braking: float
) -> Floats:
    """Return the speed limit at the samples of a route of lines (S,) [m/s], by the footprint's clearance.

    Stops at corners are not included. `near_obstacles` is that of `limits_along`.
    """
    at = spacing * np.arange(int(route.length / spacing) + 2)
    xy = np.stack([np.interp(at, route.arc, values) for values in route.xy.T], axis=1)
    facing = route.facing[np.clip(np.searchsorted(route.arc, at, side="right") - 1, 0, len(route.xy) - 2)]
    clearance = footprint_clearance(world, spec.footprint, np.column_stack([xy, facing]))
    speed: Floats = np.minimum(spec.max_speed, near_obstacles[0] + np.maximum(clearance, 0.0) / near_obstacles[1])
    speed[at < route.backwards_until] = min(BACKWARDS, spec.max_speed)
    _kernels_path.brake_backwards(speed, spacing, braking)
    return speed
