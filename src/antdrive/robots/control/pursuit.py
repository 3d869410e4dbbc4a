"""Pure pursuit that cuts corners only where there is room (after R. C. Coulter, CMU-RI-TR-92-01, 1992).

The carrot is the point of the route at the lookahead distance from the robot, measured straight. Before a drive, the
controller computes for samples along the route how far ahead the robot may look so that the straight line to
the carrot keeps clear of obstacles. During the drive it shortens the lookahead further until the arc to the
carrot is clear. The robot is slow where the lookahead is short, and rotates in place where not even the
shortest arc is clear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats, Pose
from antdrive.base.caches import Keyed, cached
from antdrive.base.errors import FieldError
from antdrive.robots.control import _kernels_obstacles, _kernels_path, _kernels_pursuit
from antdrive.robots.control._kernels_obstacles import ObstacleIndex
from antdrive.robots.control._kernels_path import PathSamples
from antdrive.robots.control._kernels_pursuit import MotionLimits, PursuitTuning
from antdrive.robots.control.speed_limits import limits_along, speed_profile
from antdrive.robots.spec import RobotSpec
from antdrive.worlds import Route, World
from antdrive.worlds.world import by_geometry

SPACING = 0.02  # distance between the samples along a route [m]
SQUARE = 0.5  # least side of the squares that the obstacles are sorted into [m]
EVERYTHING = 1e6  # side of a square that holds all obstacles [m]
MAX_SQUARES = 250_000  # in larger worlds the squares are larger instead

#: The rules that can limit the robot's speed. Logs hold a rule's index.
LIMITERS: tuple[str, ...] = (
    "cruise",  # no rule: the robot drives at its top speed
    "curvature",  # lateral acceleration or yaw rate in a curve
    "route",  # the route's bends, lines of sight or clearance, here or within braking distance
    "yaw rate",  # the robot has not yet reached the yaw rate that the curve needs
    "goal",  # braking for the goal
    "rotate",  # rotating in place
    "creep",  # no arc to the carrot is clear: the robot advances very slowly
    "braking",  # the arc on which the robot can stop is not clear: full braking
    "done",  # standing at the goal
    "clearance",  # the obstacles beside the robot are close
    "avoid",  # local avoidance of a mover
)


class Twist(NamedTuple):
    """A velocity of the robot.

    Attributes:
        speed: forward speed [m/s]
        yaw_rate: counter-clockwise yaw rate [rad/s]
    """

    speed: float
    yaw_rate: float


class PursuitState(NamedTuple):
    """What the controller remembers between two control periods.

    Attributes:
        arc: how far along the route the robot has got [m]; it never decreases
        turning: whether the robot rotates in place
        limiter: index into LIMITERS of the rule that limited the speed
    """

    arc: float = 0.0
    turning: bool = False
    limiter: int = 0


@dataclass(frozen=True, eq=False)
class TrackedPath:
    """A route prepared for tracking: what the controller needs in every period, computed once.

    Attributes:
        route: the route
        goal_distance: the robot stops when this much of the route remains [m]
        samples: speed limits, lookaheads and headings along the route
        obstacles: the obstacles that the controller knows, by place
        limits: what the robot's drive can do
        tuning: the controller's settings for this robot and route
        backwards: whether the robot follows it tail first
    """

    route: Route
    goal_distance: float
    samples: PathSamples
    obstacles: ObstacleIndex
    limits: MotionLimits
    tuning: PursuitTuning
    backwards: bool = False

    @property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(self.samples.arc[-1])

    def with_obstacles(self, obstacles: ObstacleIndex) -> TrackedPath:
        """The same path among other obstacles.

        Args:
            obstacles: what the controller is to know
        """
        return TrackedPath(
            self.route, self.goal_distance, self.samples, obstacles, self.limits, self.tuning, self.backwards
        )

    @property
    def ignoring_turn_clearance(self) -> TrackedPath:
        """The same path for a robot that turns on the spot the shorter way round, whatever is in its way."""
        return replace(self, tuning=self.tuning._replace(half_length=0.0, half_width=0.0, corners=np.empty((0, 2))))

    @property
    def preferring_arcs(self) -> TrackedPath:
        """The same path for a robot that takes every clear arc a driving robot would take, instead of turning first."""
        return replace(self, tuning=self.tuning._replace(rotate_above_at_rest=self.tuning.rotate_above))


@dataclass(frozen=True, kw_only=True)
class PurePursuit:
    """A pure-pursuit controller, given by its settings.

    Attributes:
        lookahead_time: the lookahead is the speed times this [s]
        preferred_lookahead_min: shortest lookahead where there is room for it [m]
        lookahead_min: shortest lookahead anywhere [m]
        lookahead_max: longest lookahead [m]
        lookahead_margin: share of the safety margin that lines and arcs to the carrot keep free
        stopping_margin: share of the safety margin that the arc on which the robot can stop keeps free
        rotate_in_place_above: the robot rotates in place when the carrot's bearing exceeds this [rad]
        rotate_in_place_above_at_rest: the same for a robot that stands [rad]
        rotate_in_place_until: rotating in place ends when the bearing falls below this [rad]
        braking: share of the robot's deceleration that planned braking uses
        blend: distance over which changes of the route's curvature are spread [m]
        corner_lookahead_time: `lookahead_time` for routes with corners, such as those through cells [s]
        corner_blend: `blend` for such routes [m]
        min_speed_near_obstacles: speed allowed without any clearance beside the robot [m/s]
        clearance_time: the clearance beside the robot, divided by this, is added to that speed [s]
        creep_speed: slowest forward speed [m/s]
        goal_distance: the robot stops when this much of the route remains; half the goal's tolerance if less [m]

    Raises:
        ValueError: a setting is out of range.
    """

    lookahead_time: float = 0.25
    preferred_lookahead_min: float = 0.3
    lookahead_min: float = 0.12
    lookahead_max: float = 1.0
    lookahead_margin: float = 0.4
    stopping_margin: float = 0.2
    rotate_in_place_above: float = 1.0
    rotate_in_place_above_at_rest: float = 0.2
    rotate_in_place_until: float = 0.08
    braking: float = 0.7
    blend: float = 0.2
    corner_lookahead_time: float = 0.4
    corner_blend: float = 0.6
    min_speed_near_obstacles: float = 0.5
    clearance_time: float = 0.05
    creep_speed: float = 0.04
    goal_distance: float = 0.01

    def __post_init__(self) -> None:
        for key in _POSITIVE:
            if not 1e-3 <= getattr(self, key) <= 100:
                raise FieldError(key, f"must be between 0.001 and 100, got {getattr(self, key):g}")
        if self.lookahead_max < self.lookahead_min:
            raise FieldError("lookahead_max", f"must be at least lookahead_min ({self.lookahead_min:g})")
        for key in ("lookahead_margin", "stopping_margin"):
            if not 0 <= getattr(self, key) <= 1:
                raise FieldError(key, f"must be between 0 and 1, got {getattr(self, key):g}")
        if not 0 < self.braking <= 1:
            raise FieldError("braking", f"must be greater than 0 and at most 1, got {self.braking:g}")
        if not self.rotate_in_place_until < self.rotate_in_place_above < math.pi / 2:
            raise FieldError(
                "rotate_in_place_above",
                f"must lie between rotate_in_place_until and pi/2, got {self.rotate_in_place_above:g}",
            )

    def prepare(
        self,
        route: Route,
        world: World,
        spec: RobotSpec,
        margin: float,
        period: float,
        tolerance: float = math.inf,
        spacing: float = SPACING,
        indexed: bool = True,
    ) -> TrackedPath:
        """Prepare a route for tracking.

        Args:
            route: the route
            world: the world as the controller knows it
            spec: the robot
            margin: the safety margin that the route keeps beyond the robot's radius [m]
            period: control period [s]
            tolerance: goal tolerance [m]; where it is small, the robot stops closer to the route's end
            spacing: distance between the samples at which lookaheads and speed limits are worked out [m]
            indexed: whether the obstacles are sorted by place; that pays where the robot drives among them for long
        """
        tuning = self._tuning(route, spec, margin, period, min(self.goal_distance, tolerance / 2))
        tuning = tuning._replace(spacing=spacing)
        obstacles = (
            self._index(world, tuning.lookahead_clearance) if indexed else unsorted_obstacles(world.discs, world.bounds)
        )
        lookahead: Floats = np.empty(int(route.arc[-1] / spacing) + 2)
        _kernels_path.clear_lookaheads(
            route.xy, route.arc, obstacles, tuning.lookahead_clearance, spacing, self.lookahead_min,
            self.lookahead_max, lookahead,
        )  # fmt: skip
        at = spacing * np.arange(len(lookahead))
        profile = speed_profile(
            route,
            spec,
            blend=self.blend if route.curvature is not None else self.corner_blend,
            rotate_in_place_above=self.rotate_in_place_above,
            braking=self.braking,
        )
        curvature = np.interp(at, profile.arc, profile.curvature)
        heading = np.interp(at, profile.arc, profile.heading)
        if route.curvature is None:
            curvature[:] = np.nan
        near_obstacles = self.min_speed_near_obstacles, self.clearance_time
        braking = self.braking * spec.max_acceleration
        speed = limits_along(route, world, spec.radius, profile, lookahead, tuning, near_obstacles, braking)
        limits = MotionLimits(
            speed=spec.max_speed,
            yaw_rate=spec.max_yaw_rate,
            acceleration=spec.max_acceleration,
            yaw_acceleration=spec.max_yaw_acceleration,
            lateral_acceleration=spec.max_lateral_acceleration,
            half_track=spec.track / 2,
            rim_speed=spec.max_wheel_speed * spec.wheel_radius,
        )
        samples = PathSamples(route.xy, route.arc, lookahead, speed, curvature, heading)
        return TrackedPath(route, tuning.goal_distance, samples, obstacles, limits, tuning)

    def step(self, tracked: TrackedPath, pose: Pose, command: Twist, state: PursuitState) -> tuple[Twist, PursuitState]:
        """The next command and the state for the next period.

        Args:
            tracked: the path to follow, from `prepare`
            pose: the robot's estimated pose
            command: the command of the last period
            state: the state that the last call returned; at first a `PursuitState()`
        """
        if tracked.backwards:  # a robot with two driven wheels, seen from behind, is one that drives forwards
            seen = (pose[0], pose[1], pose[2] + math.pi), Twist(-command.speed, command.yaw_rate)
            ahead, after = self.step(replace(tracked, backwards=False), *seen, state)
            return Twist(-ahead.speed, ahead.yaw_rate), after
        speed, yaw_rate, arc, turning, limiter = _kernels_pursuit.pursue(
            *pose, *command, state.arc, state.turning,
            tracked.samples, tracked.obstacles, tracked.limits, tracked.tuning,
        )  # fmt: skip
        return Twist(speed, yaw_rate), PursuitState(arc, turning, limiter)

    def _tuning(
        self, route: Route, spec: RobotSpec, margin: float, period: float, goal_distance: float
    ) -> PursuitTuning:
        return PursuitTuning(
            period=period,
            spacing=SPACING,
            lookahead_clearance=spec.radius + self.lookahead_margin * margin,
            stopping_clearance=spec.radius + self.stopping_margin * margin,
            robot_radius=spec.radius,
            half_length=spec.footprint.half_length,
            half_width=spec.footprint.half_width,
            rounding=spec.footprint.rounding,
            corners=np.array(spec.footprint.corners, dtype=np.float64).reshape(-1, 2),
            lookahead_time=self.corner_lookahead_time if route.curvature is None else self.lookahead_time,
            lookahead_min=self.lookahead_min,
            lookahead_max=self.lookahead_max,
            preferred_lookahead_min=self.preferred_lookahead_min,
            rotate_above=self.rotate_in_place_above,
            rotate_above_at_rest=self.rotate_in_place_above_at_rest,
            rotate_until=self.rotate_in_place_until,
            braking=self.braking,
            creep_speed=self.creep_speed,
            goal_distance=goal_distance,
            min_speed_near_obstacles=self.min_speed_near_obstacles,
            clearance_time=self.clearance_time,
        )

    def _index(self, world: World, clearance: float) -> ObstacleIndex:
        """The world's obstacles, by the squares from which the longest lookahead can come close to them."""
        bounds = np.asarray(world.bounds, dtype=np.float64)
        side = max(SQUARE, math.sqrt(math.prod(world.size) / MAX_SQUARES))
        distance = self.lookahead_max + clearance + side
        discs, starts = _discs_by_square(by_geometry(world), side, distance)
        return ObstacleIndex(discs, starts, bounds, side)


def unsorted_obstacles(discs: Floats, bounds: Bounds | Floats) -> ObstacleIndex:
    """Obstacles that all lie in one square."""
    return ObstacleIndex(discs, np.array([0, len(discs)]), np.asarray(bounds, dtype=np.float64), EVERYTHING)


@cached(16)
def _discs_by_square(world: Keyed[World], side: float, distance: float) -> tuple[Floats, npt.NDArray[np.int64]]:
    bounds = np.asarray(world.value.bounds, dtype=np.float64)
    return _kernels_obstacles.index_discs(world.value.discs, bounds, side, distance)


_POSITIVE = (
    "lookahead_time",
    "preferred_lookahead_min",
    "lookahead_min",
    "lookahead_max",
    "rotate_in_place_above_at_rest",
    "rotate_in_place_until",
    "blend",
    "corner_lookahead_time",
    "corner_blend",
    "min_speed_near_obstacles",
    "clearance_time",
    "creep_speed",
    "goal_distance",
)
