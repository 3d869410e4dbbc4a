"""How fast a robot may drive along a route, everywhere: a forward-backward pass under its limits.

On a fixed path the fastest speeds follow from a limit at each place, lowered forwards to what acceleration reaches and
backwards to what braking can still obey (Bobrow, Dubowsky & Gibson, *Time-optimal control of robotic manipulators along
specified paths*, IJRR 4, 1985; for this form Lipp & Boyd, *Minimum-time speed optimisation over a fixed path*, Int. J.
Control 87, 2014). Here accelerating is checked against the yaw acceleration at the slower end of each step, so the result is
the fastest up to the step's length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from antdrive.robots.spec import RobotSpec
from antdrive.worlds import Floats, Route
from antdrive.worlds.errors import FieldError


@dataclass(frozen=True, eq=False)
class SpeedProfile:
    """Speeds along a route and when each place is reached. Where the robot turns on the spot a place comes twice."""

    arc: Floats  # (S,) length along the route [m], from 0
    speed: Floats  # (S,) [m/s], 0 at both ends
    time: Floats  # (S,) [s], from 0
    curvature: Floats  # (S,) of the line as it is driven, corners rounded [1/m]
    heading: Floats  # (S,) of that line, turns on the spot included, never jumping by a whole turn [rad]
    limit: Floats  # (S,) the speed there for a robot that need not gain it first: what it must not exceed [m/s]

    @property
    def duration(self) -> float:
        """How long the whole route takes [s]."""
        return float(self.time[-1])

    @property
    def yaw_rate(self) -> Floats:
        """(S,) [rad/s]."""
        return self.speed * self.curvature


def speed_profile(
    route: Route,
    robot: RobotSpec,
    *,
    blend: float = 0.2,
    stop_from: float = 1.0,
    braking: float = 1.0,
    step: float = 0.02,
) -> SpeedProfile:
    """The fastest speeds along a route from standing to standing.

    They keep the robot's speed, acceleration, lateral acceleration, yaw rate, yaw acceleration and wheel speeds. No robot
    follows a corner or a jump in curvature at speed, so the curvature is the route's averaged over `blend` [m] to both sides,
    nearer places weighing more. At corners of `stop_from` [rad] and more it stops and turns on the spot. `braking` is the
    fraction of the acceleration that braking may use; speeds are found every `step` [m] or closer.

    Raises:
        ValueError: a setting outside its range.
    """
    for key, value in (("blend", blend), ("stop_from", stop_from), ("step", step)):
        if not (math.isfinite(value) and value > 0):
            raise FieldError(key, f"must be greater than 0, got {value:g}")
    if not 0 < braking <= 1:
        raise FieldError("braking", f"must be greater than 0 and at most 1, got {braking:g}")
    from antdrive.robots.control import _kernels_profile

    places, headings, stops, turns = _headings(route, stop_from)
    arcs: list[Floats] = []
    speeds: list[Floats] = []
    times: list[Floats] = []
    curvatures: list[Floats] = []
    facings: list[Floats] = []
    limits: list[Floats] = []
    now, spun = 0.0, 0.0
    for first, last, turn in zip([0.0, *stops], [*stops, route.length], [0.0, *turns], strict=True):
        now += turning_time(turn, robot)
        spun += turn
        arc = np.linspace(first, last, max(3, math.ceil((last - first) / step) + 1))
        facing, curvature, change = _blended(arc, places, headings, blend)
        limit = np.empty(len(arc))
        _kernels_profile.limit_speed(
            curvature,
            change,
            robot.max_speed,
            robot.max_lateral_acceleration,
            robot.max_yaw_rate,
            robot.max_yaw_acceleration,
            robot.track / 2,
            robot.max_wheel_speed * robot.wheel_radius,
            limit,
        )
        limit[-1] = 0.0
        gain, yaw_gain = robot.max_acceleration, robot.max_yaw_acceleration
        _kernels_profile.brake_ahead(arc, curvature, change, braking * gain, yaw_gain, limit)
        speed = limit.copy()
        speed[0] = 0.0
        _kernels_profile.speed_up(arc, curvature, change, gain, yaw_gain, speed)
        time = now + np.concatenate(([0.0], np.cumsum(2.0 * np.diff(arc) / (speed[1:] + speed[:-1]))))
        now = float(time[-1])
        every = (arcs, speeds, times, curvatures, facings, limits)
        for parts, part in zip(every, (arc, speed, time, curvature, facing + spun, limit), strict=True):
            parts.append(part)
    return SpeedProfile(*map(np.concatenate, every))


def turning_time(angle: float, robot: RobotSpec) -> float:
    """How long a turn on the spot by an angle [rad] takes, from standing to standing [s]."""
    fastest = min(robot.max_yaw_rate, 2 * robot.max_wheel_speed * robot.wheel_radius / robot.track)
    spin_up = fastest / robot.max_yaw_acceleration
    if abs(angle) >= fastest * spin_up:
        return abs(angle) / fastest + spin_up
    return 2.0 * math.sqrt(abs(angle) / robot.max_yaw_acceleration)


def _headings(route: Route, stop_from: float) -> tuple[Floats, Floats, list[float], list[float]]:
    """The heading [rad] along the route as straight pieces between places, and where it stops, for which turns.

    Along an arc the heading grows evenly; at a corner a place comes twice. Turns on the spot are left out.
    """
    steps = np.diff(route.xy, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.diff(heading)
    turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
    heading = heading[0] + np.concatenate(([0.0], np.cumsum(turn)))
    leaving, reaching = heading.copy(), heading.copy()  # of each step, at its beginning and its end
    corner = np.ones(len(turn), dtype=np.bool_)
    if route.curvature is not None:
        bend = route.curvature[:-1]
        corner = (bend[:-1] != bend[1:]) | (bend[1:] == 0.0)  # else one of the points that stand for an arc
        middle = (heading[1:] + heading[:-1]) / 2
        leaving[1:][~corner] = reaching[:-1][~corner] = middle[~corner]
    arc = route.arc
    sharp = corner & (np.abs(turn) >= stop_from)
    spun = np.concatenate(([0.0], np.cumsum(np.where(sharp, turn, 0.0))))
    places = np.stack((arc[:-1], arc[1:]), axis=1).ravel()
    headings = np.stack((leaving - spun, reaching - spun), axis=1).ravel()
    return places, headings, arc[1:-1][sharp].tolist(), turn[sharp].tolist()


def _blended(s: Floats, places: Floats, headings: Floats, blend: float) -> tuple[Floats, Floats, Floats]:
    """Heading, curvature and its growth per metre at s, weighed by a triangle that reaches `blend` to both sides."""
    widths = np.diff(places)
    slopes = np.diff(headings) / np.where(widths > 0, widths, 1.0)
    once = np.concatenate(([0.0], np.cumsum(widths * (headings[1:] + headings[:-1]) / 2)))  # the heading's integral
    growth = once[:-1] * widths + headings[:-1] * widths**2 / 2 + slopes * widths**3 / 6
    twice = np.concatenate(([0.0], np.cumsum(growth)))  # and that one's

    def at(t: Floats) -> tuple[Floats, Floats, Floats]:
        inside = np.clip(t, places[0], places[-1])
        i = np.clip(np.searchsorted(places, inside, side="right") - 1, 0, len(slopes) - 1)
        d = inside - places[i]
        heading = headings[i] + slopes[i] * d
        first = once[i] + headings[i] * d + slopes[i] * d**2 / 2
        second = twice[i] + once[i] * d + headings[i] * d**2 / 2 + slopes[i] * d**3 / 6
        beyond = t - inside
        return heading, first + heading * beyond, second + first * beyond + heading * beyond**2 / 2

    before, here, after = at(s - blend), at(s), at(s + blend)
    change, curvature, heading = ((a - 2 * h + b) / blend**2 for a, h, b in zip(after, here, before, strict=True))
    return heading, curvature, change
