"""Pure pursuit with clearance-checked lookahead (after R. C. Coulter, CMU-RI-TR-92-01, 1992), or lines and turns on the spot.

The carrot is the point of the route whose straight-line distance from the robot is the lookahead. Before a drive, the
controller computes, at samples along the route, the longest lookahead whose straight line to the carrot keeps its
clearance. During the drive it shortens the lookahead until the arc to the carrot is clear. The robot is slow where the
lookahead is short, and rotates in place if the shortest arc is not clear.

A route with turns (`Route.turns`) is followed line by line instead, with the same speed rules (`_kernels_lines`).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Annotated, NamedTuple, get_type_hints

import numpy as np
import numpy.typing as npt
from annotated_types import Interval

from antdrive.base import Bounds, Floats, Point, Pose
from antdrive.base.caches import Keyed, cached
from antdrive.base.errors import FieldError, require
from antdrive.base.records import clamp_angle, meanings_of, require_ranges, unchecked_copy
from antdrive.robots.control import _kernels_lines, _kernels_obstacles, _kernels_path, _kernels_pursuit
from antdrive.robots.control._kernels_obstacles import ObstacleIndex
from antdrive.robots.control._kernels_path import PathSamples
from antdrive.robots.control._kernels_pursuit import MotionLimits, PursuitTuning
from antdrive.robots.control.observation import Briefing, ControllerCapabilities, Observation, Twist
from antdrive.robots.control.speed_limits import heading_error, limits_along, limits_along_lines, steady, steering_time
from antdrive.robots.spec import RobotSpec
from antdrive.worlds import Route, World
from antdrive.worlds.world import by_geometry

SPACING = 0.02  # distance between the samples along a route [m]
ROUNDING = 1e-9  # a point this close to a corner is beyond it [m]
SQUARE = 0.5  # minimum side of a square of the obstacle index [m]
SIDE = 1  # place of the side of an index of obstacles among the numbers of a packed path
EVERYTHING = 1e6  # side of the single square that holds all obstacles [m]
MAX_SQUARES = 250_000  # larger worlds have larger squares

#: The rules that can limit the robot's speed. Logs contain the index.
LIMITERS: tuple[str, ...] = (
    "cruise",  # no rule: the robot drives at its top speed
    "curvature",  # lateral acceleration or yaw rate in a curve
    "route",  # the route's bends, lines of sight or clearance, here or within braking distance
    "yaw rate",  # the yaw rate has not reached the curve's
    "goal",  # braking for the goal
    "rotate",  # rotating in place
    "creep",  # no arc to the carrot is clear: creep speed
    "braking",  # the stopping arc is not clear: full braking
    "done",  # standing at the goal
    "clearance",  # obstacles beside the robot are close
    "avoid",  # local avoidance of a mover
)

POSITIVE, FRACTION = Interval(ge=1e-3, le=100.0), Interval(ge=0.0, le=1.0)


@dataclass(frozen=True)
class ActsOn:
    """Mark of an option that acts only on routes with corners, or only on smooth ones."""

    corners: bool  # routes with corners: those whose curvature is unknown


CORNERS, SMOOTH = ActsOn(corners=True), ActsOn(corners=False)


class PursuitState(NamedTuple):
    """Controller state between two control periods.

    Attributes:
        arc: progress along the route [m]; never decreases
        turning: whether the robot rotates in place
        limiter: index into LIMITERS of the rule that limited the speed
    """

    arc: float = 0.0
    turning: bool = False
    limiter: int = 0


@dataclass(frozen=True, eq=False)
class TrackedPath:
    """A route prepared for tracking, with its precomputed data.

    Attributes:
        route: the route
        goal_distance: remaining route length at which the robot stops [m]
        samples: speed limits, lookaheads and headings along the route
        obstacles: index of the known obstacles by position
        limits: limits of the robot's drive
        tuning: the controller's settings for this robot and route
        backwards: whether the robot drives backwards
    """

    route: Route
    goal_distance: float
    samples: PathSamples
    obstacles: ObstacleIndex
    limits: MotionLimits
    tuning: PursuitTuning
    backwards: bool = False

    @functools.cached_property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(self.samples.arc[-1])

    @functools.cached_property
    def packed(self) -> tuple[Floats, ...]:
        """The path as the kernel takes it in every control period: arrays, the last of which holds all numbers.

        The dispatcher takes a third of the time of a period's kernel to walk through named tuples of numbers.
        """
        *samples, backwards = self.samples
        *obstacles, side = self.obstacles
        tuning = self.tuning._asdict()
        corners = tuning.pop("corners")
        numbers = np.array([backwards, side, *self.limits, *tuning.values()])
        return *samples, *obstacles, corners, numbers

    def nearest(self, pose: Pose, arc: float = 0.0, window: float = 1.0) -> float:
        """Return the arc length of the point nearest to a pose, from `arc` to `window` beyond it [m]."""
        return float(_kernels_path.project(pose[0], pose[1], arc, window, self.samples.xy, self.samples.arc)[0])

    def pose_at(self, arc: float) -> Pose:
        """Return the point of the route at an arc length [m], and the route's heading from there on [m, m, rad]."""
        xy, at = self.samples.xy, self.samples.arc
        k = _kernels_path.segment_at(arc + ROUNDING, at)
        x, y, _ = _kernels_path.point_at(arc, k, xy, at)
        return x, y, math.atan2(xy[k + 1, 1] - xy[k, 1], xy[k + 1, 0] - xy[k, 0])

    def carrot(self, pose: Pose, arc: float, lookahead: float) -> Point:
        """Return the first point beyond an arc length [m] at distance `lookahead` [m] from a pose; past the end, on its line."""
        xy, at = self.samples.xy, self.samples.arc
        x, y = _kernels_path.carrot_at(pose[0], pose[1], lookahead, arc, _kernels_path.segment_at(arc, at), xy, at)
        return x, y

    def speed_limit(self, arc: float, curvature: float = 0.0) -> float:
        """Return the highest speed [m/s] at an arc length [m] on a motion of a curvature [1/m]; 0 at the goal.

        It is the limit of pure pursuit: by the robot, by bends and obstacles of the route, and to stop at its end.
        """
        limits, tuning, remaining = self.limits, self.tuning, self.length - arc
        if remaining <= self.goal_distance:
            return 0.0
        i = min(int(arc / tuning.spacing), len(self.samples.speed) - 2)
        limit = min(
            limits.speed,
            *self.samples.speed[i : i + 2].tolist(),
            _kernels_pursuit.slow_for_curvature(curvature, limits.lateral_acceleration, limits.yaw_rate),
            _kernels_pursuit.brake_for_goal(remaining - self.goal_distance / 2, tuning.braking * limits.acceleration),
        )
        return float(max(limit, min(tuning.creep_speed, limits.speed)))

    def discs_near(self, pose: Pose, reach: float) -> Floats:
        """Return x, y and radius of the known obstacles of the square around a pose (D, 3) [m]: all within `reach` if indexed."""
        square = _kernels_obstacles.square_at(pose[0], pose[1], self.obstacles)
        first, last = self.obstacles.starts[square : square + 2].tolist()
        discs: Floats = self.obstacles.discs[first:last]
        return discs[np.hypot(discs[:, 0] - pose[0], discs[:, 1] - pose[1]) - discs[:, 2] <= reach]

    def with_obstacles(self, obstacles: ObstacleIndex) -> TrackedPath:
        """Return the path with an index of other `obstacles`."""
        *samples, _, _, _, _, corners, numbers = self.packed
        numbers = numbers.copy()
        *arrays, numbers[SIDE] = obstacles
        return unchecked_copy(self, obstacles=obstacles, packed=(*samples, *arrays, corners, numbers))

    @property
    def ignoring_turn_clearance(self) -> TrackedPath:
        """A copy whose rotations in place take the shorter turn, without contact checks."""
        return replace(self, tuning=self.tuning._replace(half_length=0.0, half_width=0.0, corners=np.empty((0, 2))))

    @property
    def preferring_arcs(self) -> TrackedPath:
        """A copy for which a robot at rest takes the same arcs as a moving one, instead of rotating in place first."""
        return replace(self, tuning=self.tuning._replace(rotate_above_at_rest=self.tuning.rotate_above))


def motion_limits(spec: RobotSpec) -> MotionLimits:
    """Return the limits of a robot's drive."""
    return MotionLimits(
        speed=spec.max_speed,
        yaw_rate=spec.max_yaw_rate,
        acceleration=spec.max_acceleration,
        yaw_acceleration=spec.max_yaw_acceleration,
        lateral_acceleration=spec.max_lateral_acceleration,
        half_track=spec.track / 2,
        rim_speed=spec.max_wheel_speed * spec.wheel_radius,
    )


@dataclass(frozen=True, kw_only=True)
class PurePursuit:
    """Pure pursuit whose lookahead keeps clear of obstacles; routes for footprints are lines and turns on the spot.

    Known weaknesses: it follows the route and does not leave it for an obstacle that no plan knows; where no arc is clear it
    creeps or stops.

    Attributes:
        lookahead_time: lookahead divided by speed; the speed is at most the clear lookahead divided by this [s]
        preferred_lookahead_min: lookahead at low speed; reduced to `lookahead_min` where it is not clear [m]
        lookahead_min: shortest lookahead [m]
        lookahead_max: longest lookahead [m]
        lookahead_margin: fraction of the safety margin kept by lines and arcs to the carrot
        stopping_margin: fraction of the safety margin kept by the stopping arc
        rotate_in_place_above: bearing of the carrot above which the robot rotates in place [rad]
        rotate_in_place_above_at_rest: the same for a robot at rest [rad]
        rotate_in_place_until: bearing below which the rotation ends [rad]
        braking: fraction of the robot's deceleration for planned braking
        blend: length over which the route's curvature is averaged [m]
        corner_lookahead_time: `lookahead_time` for routes with corners, such as those through cells [s]
        corner_blend: `blend` for such routes [m]
        min_speed_near_obstacles: speed limit at zero clearance [m/s]
        clearance_time: the limit grows by clearance / `clearance_time` [s]
        creep_speed: slowest forward speed [m/s]
        goal_distance: remaining route length at which the robot stops, at most half the goal tolerance [m]

    Raises:
        ValueError: a setting is out of range.
    """

    lookahead_time: Annotated[float, POSITIVE, SMOOTH] = 0.25
    preferred_lookahead_min: Annotated[float, POSITIVE] = 0.3
    lookahead_min: Annotated[float, POSITIVE] = 0.12
    lookahead_max: Annotated[float, POSITIVE] = 1.0
    lookahead_margin: Annotated[float, FRACTION] = 0.4
    stopping_margin: Annotated[float, FRACTION] = 0.2
    rotate_in_place_above: float = 1.0
    rotate_in_place_above_at_rest: Annotated[float, POSITIVE] = 0.2
    rotate_in_place_until: Annotated[float, POSITIVE] = 0.08
    braking: float = 0.7
    blend: Annotated[float, POSITIVE, SMOOTH] = 0.2
    corner_lookahead_time: Annotated[float, POSITIVE, CORNERS] = 0.4
    corner_blend: Annotated[float, POSITIVE, CORNERS] = 0.6
    min_speed_near_obstacles: Annotated[float, POSITIVE] = 0.5
    clearance_time: Annotated[float, POSITIVE] = 0.05
    creep_speed: Annotated[float, POSITIVE] = 0.04
    goal_distance: Annotated[float, POSITIVE] = 0.01

    def __post_init__(self) -> None:
        clamp_angle(self, "rotate_in_place_above", math.nextafter(math.pi / 2, 0.0))
        require_ranges(self)
        if self.lookahead_max < self.lookahead_min:
            raise FieldError("lookahead_max", f"must be at least lookahead_min ({self.lookahead_min:g})")
        require("braking", self.braking, above=0, at_most=1)
        if not self.rotate_in_place_until < self.rotate_in_place_above < math.pi / 2:
            raise FieldError(
                "rotate_in_place_above",
                f"must be between rotate_in_place_until and pi/2, got {self.rotate_in_place_above:g}",
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
        noise: float = 0.0,
    ) -> TrackedPath:
        """Prepare a route for tracking.

        Args:
            route: the route
            world: the world known to the controller
            spec: the robot
            margin: the route's safety margin beyond the robot's radius [m]
            period: control period [s]
            tolerance: goal tolerance [m]; a small one makes the robot stop closer to the route's end
            spacing: distance between the samples of lookaheads and speed limits [m]
            indexed: whether to index the obstacles by position, which pays off on long drives
            noise: factor on the documented noise, for which robots of low yaw acceleration look farther ahead and drive slower
        """
        error = heading_error(spec, noise)
        spec = steady(spec, error)
        tuning = self._tuning(route, spec, margin, period, min(self.goal_distance, tolerance / 2))
        time = max(tuning.lookahead_time, steering_time(spec, error))
        tuning = tuning._replace(spacing=spacing, lookahead_time=time)
        obstacles = (
            indexed_obstacles(world, self.lookahead_max + tuning.lookahead_clearance)
            if indexed
            else obstacles_around(route.xy[0], world.discs, world.bounds)
        )
        samples = self._samples(route, world, spec, obstacles, tuning)
        return TrackedPath(route, tuning.goal_distance, samples, obstacles, motion_limits(spec), tuning)

    @property
    def capabilities(self) -> ControllerCapabilities:
        """Capabilities of this controller."""
        return ControllerCapabilities(turns=True)

    def start(self, briefing: Briefing, path: TrackedPath) -> PursuitState:
        """Return the state for a new path, whatever the `briefing`."""
        return PursuitState()

    def step(self, now: Observation, path: TrackedPath, state: PursuitState) -> tuple[Twist, PursuitState]:
        """Return the command for what the robot knows `now`, and the state for the next period."""
        return self.pursue(path, now.pose, now.command, state)

    def pursue(
        self, tracked: TrackedPath, pose: Pose, command: Twist, state: PursuitState
    ) -> tuple[Twist, PursuitState]:
        """Return the next command and the state for the next period.

        Args:
            tracked: the path to follow, from `prepare`
            pose: the robot's estimated pose
            command: the command of the previous period
            state: the state returned by the last call; initially `PursuitState()`
        """
        if tracked.backwards:  # backwards is forwards with the heading turned by pi
            reversed_ = (pose[0], pose[1], pose[2] + math.pi), Twist(-command.speed, command.yaw_rate)
            ahead, after = self.pursue(replace(tracked, backwards=False), *reversed_, state)
            return Twist(-ahead.speed, ahead.yaw_rate), after
        # Each kind of route has a kernel of its own, so that a drive compiles one.
        lines = len(tracked.samples.turns)
        advance = _kernels_lines.follow_packed if lines else _kernels_pursuit.pursue_packed
        speed, yaw_rate, arc, turning, limiter = advance(*pose, *command, state.arc, state.turning, *tracked.packed)
        return Twist(speed, yaw_rate), PursuitState(arc, turning, limiter)

    def _samples(
        self, route: Route, world: World, spec: RobotSpec, obstacles: ObstacleIndex, tuning: PursuitTuning
    ) -> PathSamples:
        """Return what the controller precomputes along a route."""
        if route.turns is not None:
            near_obstacles = self.min_speed_near_obstacles, self.clearance_time
            braking = self.braking * spec.max_acceleration
            speed = limits_along_lines(route, world, spec, tuning.spacing, near_obstacles, braking)
            unused = np.empty(0)
            return PathSamples(
                route.xy, route.arc, unused, speed, unused, unused, route.turns, float(route.backwards_until)
            )
        spacing = tuning.spacing
        lookahead: Floats = np.empty(int(route.arc[-1] / spacing) + 2)
        _kernels_path.clear_lookaheads(
            route.xy, route.arc, obstacles, tuning.lookahead_clearance, spacing, self.lookahead_min,
            self.lookahead_max, lookahead,
        )  # fmt: skip
        limiting = spec.radius + (spec.max_speed - self.min_speed_near_obstacles) * self.clearance_time
        if limiting > self.lookahead_max + tuning.lookahead_clearance:  # farther than the index reaches
            obstacles = obstacles_around(route.xy[0], world.discs, world.bounds)
        blend = self.blend if route.curvature is not None else self.corner_blend
        speed, curvature, heading = limits_along(route, obstacles, spec, lookahead, tuning, blend)
        if route.curvature is None:
            curvature[:] = np.nan
        return PathSamples(route.xy, route.arc, lookahead, speed, curvature, heading)

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
            turn_in_clearance=math.inf,
        )


class ControllerOption(NamedTuple):
    """An option of the controller.

    Attributes:
        default: default value
        unit: its unit; empty: none
        meaning: what it does
        acts_on: the routes on which it acts; None: all
    """

    default: float
    unit: str
    meaning: str
    acts_on: ActsOn | None

    @property
    def routes(self) -> str:
        """The routes on which it acts, in words."""
        return "all" if self.acts_on is None else "with corners" if self.acts_on.corners else "smooth"


def controller_options() -> Mapping[str, ControllerOption]:
    """Return the controller's options by name."""
    meanings, hints = meanings_of(PurePursuit), get_type_hints(PurePursuit, include_extras=True)
    options = {}
    for field in fields(PurePursuit):
        marks = getattr(hints[field.name], "__metadata__", ())
        text, _, unit = meanings[field.name].partition(" [")
        acts_on = next((mark for mark in marks if isinstance(mark, ActsOn)), None)
        options[field.name] = ControllerOption(
            getattr(PurePursuit(), field.name), unit.removesuffix("]"), text, acts_on
        )
    return options


def indexed_obstacles(world: World, reach: float, side: float = SQUARE) -> ObstacleIndex:
    """Return an index of a world's obstacles by squares of at least a side: each lists those within reach of its points [m]."""
    bounds = np.asarray(world.bounds, dtype=np.float64)
    side = max(side, math.sqrt(math.prod(world.size) / MAX_SQUARES))
    discs, starts = _discs_by_square(by_geometry(world), side, reach + side)
    return ObstacleIndex(discs, starts, bounds, bounds[:2], side)


def obstacles_around(centre: Floats, discs: Floats, bounds: Bounds | Floats) -> ObstacleIndex:
    """Return an obstacle index with a single square around a point (2,) [m]."""
    away = np.hypot(discs[:, 0] - centre[0], discs[:, 1] - centre[1]) - discs[:, 2]
    ordered, walls = discs[np.argsort(away, kind="stable")], np.asarray(bounds, dtype=np.float64)
    return ObstacleIndex(ordered, np.array([0, len(discs)]), walls, centre - EVERYTHING / 2, EVERYTHING)


@cached(16)
def _discs_by_square(world: Keyed[World], side: float, distance: float) -> tuple[Floats, npt.NDArray[np.int64]]:
    bounds = np.asarray(world.value.bounds, dtype=np.float64)
    return _kernels_obstacles.index_discs(world.value.discs, bounds, side, distance)
