"""Pure pursuit that cuts corners only where there is room (after Coulter 1992).

The carrot is the route point at the true lookahead distance from the robot. Before a drive the controller measures how far
ahead the robot may look at every place of the route so that the straight line to the carrot keeps its distance from
everything; during it, the lookahead shrinks further until the arc to be driven does. Where that is short the robot is slow,
and where not even the shortest arc is clear it turns on the spot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from antdrive.robots import _kernels
from antdrive.robots.control.profile import speed_profile
from antdrive.robots.spec import RobotSpec
from antdrive.worlds import Pose, Route, World, point_clearance
from antdrive.worlds.errors import FieldError

#: What can hold the robot's speed, by the code in the log.
LIMITERS: tuple[str, ...] = (
    "cruise",  # the robot's own top speed
    "curvature",  # lateral acceleration or yaw rate in a curve
    "route",  # the route's bends, its lines of sight or the room beside it, here or within braking distance
    "yaw",  # the yaw rate of the curve must be reached first
    "goal",  # braking distance to the goal
    "turn",  # turning on the spot
    "creep",  # no clear arc: straight on, very slowly
    "clearance",  # the arc on which it can still stop is not clear: full braking
    "done",  # standing at the goal
    "room",  # how little room there is beside the robot
    "yield",  # a mover that would be met
)


class Twist(NamedTuple):
    """A body velocity."""

    speed: float  # forward [m/s]
    yaw_rate: float  # counter-clockwise [rad/s]


class Progress(NamedTuple):
    """What the controller remembers between two periods."""

    arc: float = 0.0  # how far along the route the robot has got [m]; never falls
    turning: bool = False  # whether it is turning on the spot
    limiter: int = 0  # index into LIMITERS: the rule that held the speed


@dataclass(frozen=True, eq=False)
class TrackedPath:
    """A route made ready for following: what the controller needs at every period, computed once."""

    route: Route
    goal_distance: float  # the robot stops when this little of the route remains [m]
    line: _kernels.Line
    known: _kernels.Known
    limits: _kernels.Limits
    tuning: _kernels.Tuning

    @property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(self.line.arc[-1])


@dataclass(frozen=True, kw_only=True)
class PurePursuit:
    """The controller's settings. Distances in metres, angles in radians, times in seconds.

    Raises:
        ValueError: a setting outside its range.
    """

    lookahead_time: float = 0.25  # the carrot is this far ahead in time
    lookahead_floor: float = 0.3  # and not less than this where there is room
    lookahead_min: float = 0.12  # the least that it ever is
    lookahead_max: float = 1.0
    guard: float = 0.4  # fraction of the margin that carrot lines and arcs must leave free
    floor: float = 0.2  # fraction of the margin that the stopping arc must leave free
    turn_from: float = 1.0  # turn on the spot when the carrot is farther off the heading than this
    turn_rest: float = 0.2  # or, when standing, farther than this
    turn_to: float = 0.08  # and until it is nearer than this
    braking: float = 0.7  # fraction of the acceleration limit that planned braking uses
    blend: float = 0.2  # over which changes of curvature are spread [m]
    raw_lookahead_time: float = 0.4  # the same two for lines with corners, as cells give, which only the carrot rounds
    raw_blend: float = 0.6
    near_speed: float = 0.5  # allowed with no room left beside the robot [m/s], and faster the more there is:
    near_time: float = 0.05  # a metre a second more for each room of this many metres
    creep: float = 0.04  # the slowest forward speed [m/s]
    goal_distance: float = 0.01  # the robot stops when this little of the route remains

    def __post_init__(self) -> None:
        for key in _LENGTHS_AND_TIMES:
            if not 1e-3 <= getattr(self, key) <= 100:
                raise FieldError(key, f"must be between 0.001 and 100, got {getattr(self, key):g}")
        if self.lookahead_max < self.lookahead_min:
            raise FieldError("lookahead_max", f"must be at least lookahead_min ({self.lookahead_min:g})")
        for key in ("guard", "floor"):
            if not 0 <= getattr(self, key) <= 1:
                raise FieldError(key, f"must be between 0 and 1, got {getattr(self, key):g}")
        if not 0 < self.braking <= 1:
            raise FieldError("braking", f"must be between 0 and 1, got {self.braking:g}")
        if not self.turn_to < self.turn_from < math.pi / 2:
            raise FieldError("turn_from", f"must lie between turn_to and pi/2, got {self.turn_from:g}")

    def guide(
        self, route: Route, world: World, robot: RobotSpec, margin: float, period: float, tolerance: float = math.inf
    ) -> TrackedPath:
        """Prepare a route for a robot that keeps `margin` [m] and is controlled every `period` [s].

        Where the goal's `tolerance` [m] is small, the robot drives closer to the route's end than it would otherwise.
        """
        goal_distance = min(self.goal_distance, tolerance / 2)
        ds = 0.02
        raw = route.curvature is None
        ahead, blend = (self.raw_lookahead_time, self.raw_blend) if raw else (self.lookahead_time, self.blend)
        guard = robot.radius + self.guard * margin
        arc = route.arc
        bounds = np.asarray(world.bounds, dtype=np.float64)
        # The known obstacles are sorted into squares: of half a metre, or more where the world is huge.
        side = max(0.5, math.sqrt(math.prod(world.size) / 250_000))
        discs, starts = _kernels.bucket(world.discs, bounds, side, self.lookahead_max + guard + side)
        lookahead = np.empty(int(arc[-1] / ds) + 2)
        _kernels.clear_lookaheads(
            route.xy,
            arc,
            discs,
            starts,
            side,
            bounds,
            guard,
            ds,
            self.lookahead_min,
            self.lookahead_max,
            lookahead,
        )
        profile = speed_profile(route, robot, blend=blend, stop_from=self.turn_from, braking=self.braking)
        at = ds * np.arange(len(lookahead))
        speed = np.minimum(lookahead / ahead, np.interp(at, profile.arc, profile.limit))
        curvature, heading = (np.interp(at, profile.arc, line) for line in (profile.curvature, profile.heading))
        if raw:
            curvature[:] = np.nan
        places = np.stack([np.interp(at, arc, line) for line in route.xy.T], axis=1)
        room = point_clearance(world, places) - robot.radius
        speed = np.minimum(speed, self.near_speed + np.maximum(room, 0.0) / self.near_time)
        for stop in profile.arc[:-1][np.diff(profile.arc) == 0]:
            speed[int(stop / ds) : int(stop / ds) + 2] = 0.0
        _kernels.brake_backwards(speed, ds, self.braking * robot.max_acceleration)
        return TrackedPath(
            route,
            goal_distance,
            _kernels.Line(route.xy, arc, lookahead, speed, curvature, heading),
            _kernels.Known(discs, starts, bounds, side),
            _kernels.Limits(
                speed=robot.max_speed,
                yaw_rate=robot.max_yaw_rate,
                acceleration=robot.max_acceleration,
                yaw_acceleration=robot.max_yaw_acceleration,
                lateral=robot.max_lateral_acceleration,
                half_track=robot.track / 2,
                rim=robot.max_wheel_speed * robot.wheel_radius,
            ),
            _kernels.Tuning(
                period=period,
                ds=ds,
                guard=guard,
                floor=robot.radius + self.floor * margin,
                radius=robot.radius,
                look_time=ahead,
                look_min=self.lookahead_min,
                look_max=self.lookahead_max,
                look_floor=self.lookahead_floor,
                turn_from=self.turn_from,
                turn_to=self.turn_to,
                turn_rest=self.turn_rest,
                braking=self.braking,
                creep=self.creep,
                close=goal_distance,
                near_speed=self.near_speed,
                near_time=self.near_time,
            ),
        )

    def step(self, guide: TrackedPath, pose: Pose, command: Twist, state: Progress) -> tuple[Twist, Progress]:
        """The next command, from the pose now and the command given last."""
        speed, yaw_rate, arc, turning, limiter = _kernels.pursue(
            *pose, *command, state.arc, state.turning,
            guide.line, guide.known, guide.limits, guide.tuning,
        )  # fmt: skip
        return Twist(speed, yaw_rate), Progress(arc, turning, limiter)


_LENGTHS_AND_TIMES = (
    "lookahead_time", "lookahead_floor", "lookahead_min", "lookahead_max", "turn_to", "turn_rest", "blend",
    "raw_lookahead_time", "raw_blend", "near_speed", "near_time", "creep", "goal_distance",
)  # fmt: skip
