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
import numpy.typing as npt

from robots import _kernels
from robots.spec import RobotSpec
from worlds import Floats, Pose, Route, World

#: What can hold the robot's speed, by the code in the log.
LIMITERS: tuple[str, ...] = (
    "cruise",  # the robot's own top speed
    "curvature",  # lateral acceleration or yaw rate in a curve
    "route",  # the route's corners, or how far its lines of sight are clear, here or within braking distance
    "yaw",  # the yaw rate of the curve must be reached first
    "goal",  # braking distance to the goal
    "turn",  # turning on the spot
    "creep",  # no clear arc: straight on, very slowly
    "clearance",  # the arc on which it can still stop is not clear: full braking
    "done",  # standing at the goal
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
class Guide:
    """A route made ready for following: what the controller needs at every period, computed once."""

    route: Route
    lookahead: Floats  # (S,) longest clear lookahead at i * ds along the route [m]
    speed: Floats  # (S,) speed limit there, braking included [m/s]
    arc: Floats  # (N,) length along the route at its points [m]
    discs: Floats  # (M, 3) the obstacles known to the controller, repeated for each square that they are near to
    starts: npt.NDArray[np.int64]  # where each square's rows of `discs` start
    bounds: Floats  # (4,)
    goal_distance: float  # the robot stops when this little of the route remains [m]
    limits: Floats  # the robot's limits, as `_kernels.pursue` unpacks them
    tuning: Floats  # the controller's settings, as `_kernels.pursue` unpacks them

    @property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(self.arc[-1])


@dataclass(frozen=True, kw_only=True)
class PurePursuit:
    """The controller's settings. Distances in metres, angles in radians, times in seconds.

    Raises:
        ValueError: a setting outside its range.
    """

    lookahead_time: float = 0.4  # the carrot is this far ahead in time
    lookahead_min: float = 0.12
    lookahead_max: float = 1.0
    guard: float = 0.4  # fraction of the margin that carrot lines and arcs must leave free
    floor: float = 0.2  # fraction of the margin that the stopping arc must leave free
    turn_from: float = 1.0  # turn on the spot when the carrot is farther off the heading than this
    turn_to: float = 0.08  # and until it is nearer than this
    braking: float = 0.7  # fraction of the acceleration limit that planned braking uses
    creep: float = 0.04  # the slowest forward speed [m/s]
    goal_distance: float = 0.01  # the robot stops when this little of the route remains

    def __post_init__(self) -> None:
        for key in ("lookahead_time", "lookahead_min", "lookahead_max", "turn_to", "creep", "goal_distance"):
            if not 1e-3 <= getattr(self, key) <= 100:
                raise ValueError(f"{key}: must be between 0.001 and 100, got {getattr(self, key):g}")
        if self.lookahead_max < self.lookahead_min:
            raise ValueError(f"lookahead_max: must be at least lookahead_min ({self.lookahead_min:g})")
        for key in ("guard", "floor"):
            if not 0 <= getattr(self, key) <= 1:
                raise ValueError(f"{key}: must be between 0 and 1, got {getattr(self, key):g}")
        if not 0 < self.braking <= 1:
            raise ValueError(f"braking: must be between 0 and 1, got {self.braking:g}")
        if not self.turn_to < self.turn_from < math.pi / 2:
            raise ValueError(f"turn_from: must lie between turn_to and pi/2, got {self.turn_from:g}")

    def guide(
        self, route: Route, world: World, robot: RobotSpec, margin: float, period: float, tolerance: float = math.inf
    ) -> Guide:
        """Prepare a route for a robot that keeps `margin` [m] and is controlled every `period` [s].

        Where the goal's `tolerance` [m] is small, the robot drives closer to the route's end than it would otherwise.
        """
        goal_distance = min(self.goal_distance, tolerance / 2)
        ds = 0.02
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
        speed = np.minimum(lookahead / self.lookahead_time, robot.max_speed)
        _kernels.slow_for_corners(
            route.xy, arc, ds, self.lookahead_time, robot.max_lateral_acceleration, self.turn_from, speed
        )
        _kernels.brake_backwards(speed, ds, self.braking * robot.max_acceleration)
        limits = np.array(
            [
                robot.max_speed,
                robot.max_yaw_rate,
                robot.max_acceleration,
                robot.max_yaw_acceleration,
                robot.max_lateral_acceleration,
                robot.track / 2,
                robot.max_wheel_speed * robot.wheel_radius,
            ]
        )
        tuning = np.array(
            [
                period,
                ds,
                side,
                guard,
                self.lookahead_time,
                self.lookahead_min,
                self.lookahead_max,
                self.turn_from,
                self.turn_to,
                self.braking,
                self.creep,
                goal_distance,
                robot.radius + self.floor * margin,
            ]
        )
        return Guide(route, lookahead, speed, arc, discs, starts, bounds, goal_distance, limits, tuning)

    def step(self, guide: Guide, pose: Pose, command: Twist, state: Progress) -> tuple[Twist, Progress]:
        """The next command, from the pose now and the command given last."""
        speed, yaw_rate, arc, turning, limiter = _kernels.pursue(
            *pose, *command, state.arc, state.turning,
            guide.route.xy, guide.arc, guide.lookahead, guide.speed, guide.discs, guide.starts, guide.bounds,
            guide.limits, guide.tuning,
        )  # fmt: skip
        return Twist(speed, yaw_rate), Progress(arc, turning, limiter)
