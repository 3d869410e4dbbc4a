"""The dynamic window approach.

D. Fox, W. Burgard, S. Thrun, *The dynamic window approach to collision avoidance*, IEEE Robotics & Automation
Magazine 4(1), 1997.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from antdrive.base import Bounds, Floats, Pose
from antdrive.base.plane import wrap_angle
from antdrive.base.records import require_ranges
from antdrive.robots.control.observation import Briefing, ControllerCapabilities, Observation, Twist
from antdrive.robots.control.pursuit import TrackedPath

STRAIGHT = 1e-4  # least curvature of an arc; others are straight [1/m]
CLOSER = 1e-3  # a robot that is closer to obstacles than required may come closer by this [m]


class WindowState(NamedTuple):
    """State of `DynamicWindow`.

    Attributes:
        arc: progress along the path [m]
        radius: the robot's radius [m]
    """

    arc: float
    radius: float


@dataclass(frozen=True, kw_only=True)
class DynamicWindow:
    """The dynamic window approach: the best of the velocities that can be reached and stopped in time.

    The window holds the velocities (v, w) that the robot reaches within `interval`. Admissible are those with
    `v <= sqrt(2 dist(v, w) a)` and `|w| <= sqrt(2 dist(v, w) / |r| b)`, where `dist` is the length of the arc up to the first
    contact and `r` its radius (equation 14). The best maximises `heading_weight heading + distance_weight dist +
    speed_weight v` (equation 13), each part scaled to [0, 1]; the paper's smoothing of the sum is left out. `heading` is the
    alignment with the target after the interval and braking. The target is a point of the path at `lookahead`, so that the
    approach follows a global plan. The robot counts as a disc, and movers as discs at rest.

    Known weaknesses: it cuts corners towards its target, may stand before obstacles between it and the target, and notices
    late that a mover approaches. On routes for footprints it cannot drive.

    Attributes:
        interval: time to reach a velocity of the window [s]
        lookahead: distance to the target on the path [m]
        heading_weight: weight of the alignment with the target
        distance_weight: weight of the distance to the first contact
        speed_weight: weight of the speed
        reach: distance from which contacts no longer matter [m]
        margin: distance to keep from obstacles [m]
        speeds: number of speeds in the window
        yaw_rates: number of yaw rates in the window

    Raises:
        FieldError: an option is out of range.
    """

    interval: Annotated[float, Interval(ge=0.01, le=5.0)] = 0.25
    lookahead: Annotated[float, Interval(ge=1e-3, le=100.0)] = 0.6
    heading_weight: Annotated[float, Interval(ge=0.0, le=1e3)] = 2.0
    distance_weight: Annotated[float, Interval(ge=0.0, le=1e3)] = 0.2
    speed_weight: Annotated[float, Interval(ge=0.0, le=1e3)] = 0.2
    reach: Annotated[float, Interval(ge=0.01, le=100.0)] = 2.0
    margin: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.02
    speeds: Annotated[int, Interval(ge=2, le=200)] = 11
    yaw_rates: Annotated[int, Interval(ge=3, le=200)] = 21

    def __post_init__(self) -> None:
        require_ranges(self)

    @property
    def capabilities(self) -> ControllerCapabilities:
        """Capabilities of this controller."""
        return ControllerCapabilities(avoids_movers=True)

    def start(self, briefing: Briefing, path: TrackedPath) -> WindowState:
        """Return the state for a new path."""
        return WindowState(0.0, briefing.robot.radius)

    def step(self, now: Observation, path: TrackedPath, state: WindowState) -> tuple[Twist, WindowState]:
        """Return the best admissible velocity, or full braking without one."""
        state = state._replace(arc=path.nearest(now.pose, state.arc))
        top = path.speed_limit(state.arc)
        if not top:
            return Twist(0.0, 0.0), state
        speed, yaw_rate = self._window(now.command, path, top)
        free = self._free(now, path, state, speed, yaw_rate)
        limits = path.limits
        turning = np.abs(yaw_rate) / np.maximum(speed, STRAIGHT)  # 1 / |r|; turns on the spot have no contact
        stops = speed <= np.sqrt(2 * free * limits.acceleration)
        stops &= (speed == 0) | (np.abs(yaw_rate) <= np.sqrt(2 * free * turning * limits.yaw_acceleration))
        if not stops.any():
            return Twist(0.0, 0.0), state
        ahead = path.carrot(now.pose, state.arc, self.lookahead)
        aligned = 1 - np.abs(self._bearings(now.pose, ahead, speed, yaw_rate, path)) / math.pi
        worth = (
            self.heading_weight * aligned
            + self.distance_weight * free / self.reach
            + self.speed_weight * speed / limits.speed
        )
        best = int(np.where(stops, worth, -math.inf).argmax())
        return Twist(float(speed[best]), float(yaw_rate[best])), state

    def _window(self, last: Twist, path: TrackedPath, top: float) -> tuple[Floats, Floats]:
        """Return speeds and yaw rates of the dynamic window, up to the speed `top` [m/s]: arrays (N,)."""
        limits, t = path.limits, self.interval
        slowest, fastest = max(last.speed - limits.acceleration * t, 0.0), last.speed + limits.acceleration * t
        speeds = np.linspace(slowest, max(min(fastest, top), slowest), self.speeds)
        change = limits.yaw_acceleration * t
        low, high = max(last.yaw_rate - change, -limits.yaw_rate), min(last.yaw_rate + change, limits.yaw_rate)
        rates = np.linspace(low, high, self.yaw_rates)
        speed, rate = (side.ravel() for side in np.meshgrid(speeds, np.append(rates, 0.0) if low < 0 < high else rates))
        kept = speed * np.abs(rate) <= limits.lateral_acceleration
        return speed[kept], rate[kept]

    def _free(self, now: Observation, path: TrackedPath, state: WindowState, speed: Floats, yaw_rate: Floats) -> Floats:
        """Return the length of each arc up to the first contact, at most `reach` [m]; turns on the spot have none."""
        x, y, _ = now.pose
        movers = np.column_stack([now.movers.positions, now.movers.radii])
        discs = np.vstack([path.discs_near(now.pose, self.reach + state.radius), movers])
        near = np.hypot(discs[:, 0] - x, discs[:, 1] - y) - discs[:, 2] <= self.reach + state.radius
        moving = speed > 0
        curvature = np.divide(yaw_rate, speed, out=np.zeros_like(speed), where=moving)
        bounds = path.obstacles.bounds
        free = free_arcs(now.pose, curvature, discs[near], tuple(bounds), state.radius + self.margin, self.reach)
        return np.where(moving, free, self.reach)

    def _bearings(
        self, pose: Pose, target: tuple[float, float], speed: Floats, yaw_rate: Floats, path: TrackedPath
    ) -> Floats:
        """Return the bearing of the target after the interval and full braking, for each velocity (N,) [rad]."""
        limits, t = path.limits, self.interval
        length = speed * t + speed**2 / (2 * limits.acceleration)
        turn = yaw_rate * t + yaw_rate * np.abs(yaw_rate) / (2 * limits.yaw_acceleration)
        chord, middle = length * np.sinc(turn / (2 * math.pi)), pose[2] + turn / 2
        dx, dy = target[0] - pose[0] - chord * np.cos(middle), target[1] - pose[1] - chord * np.sin(middle)
        bearings: Floats = wrap_angle(np.arctan2(dy, dx) - pose[2] - turn)
        return bearings


def free_arcs(pose: Pose, curvature: Floats, discs: Floats, bounds: Bounds, radius: float, reach: float) -> Floats:
    """Return how far a disc moves forwards on each arc up to the first contact (N,) [m], at most `reach`.

    Args:
        pose: where the arcs start, tangent to the heading [m, m, rad]
        curvature: of the arcs (N,) [1/m]
        discs: obstacles: x, y and radius (D, 3) [m]
        bounds: the walls
        radius: of the moving disc; less where it is closer to an obstacle at the start [m]
        reach: greatest length [m]
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    k = np.where(np.abs(curvature) < STRAIGHT, STRAIGHT, curvature)[:, None]
    dx, dy = discs[:, 0] - pose[0], discs[:, 1] - pose[1]
    ox, oy = cos * dx + sin * dy, cos * dy - sin * dx  # in the robot's frame, where the arcs' centres are (0, 1 / k)
    away = np.hypot(ox, oy)
    contact = np.minimum(radius + discs[:, 2], np.maximum(away - CLOSER, 0.0))
    # Points of the arc are at distance `contact` from a disc at the angles where the cosine rule holds.
    centre = np.hypot(ox, oy - 1 / k)
    with np.errstate(invalid="ignore", divide="ignore"):
        half = np.arccos((1 / k**2 + centre**2 - contact**2) / (2 * centre / np.abs(k)))
    # The angle from the robot to the disc, counted in the direction of motion.
    towards = np.arctan2(ox, 1 / np.abs(k) - oy * np.sign(k))
    free = _first(towards, half, k)
    walls = np.array([[cos, -sin, bounds[2] - pose[0]], [-cos, sin, pose[0] - bounds[0]],
                      [sin, cos, bounds[3] - pose[1]], [-sin, -cos, pose[1] - bounds[1]]])  # fmt: skip
    nx, ny, room = walls.T  # outward normals in the robot's frame, and distances of the walls
    kept = np.minimum(radius, np.maximum(room - CLOSER, 0.0))
    # The arc's farthest point towards a wall is beyond its centre; the wall is reached at equal angles on both sides.
    with np.errstate(invalid="ignore"):
        half = np.arccos(np.abs(k) * (room - kept - ny / k))
    towards = np.arctan2(nx, -ny * np.sign(k))
    least = np.minimum(_least(free), _least(_first(towards, half, k)))
    lengths: Floats = np.minimum(least, reach)
    return lengths


def _first(towards: Floats, half: Floats, k: Floats) -> Floats:
    """Return the lengths of arcs up to the first of two angles `towards` -+ `half`; infinite where there are none."""
    begin = np.mod(towards - half, 2 * math.pi)
    end = np.mod(towards + half, 2 * math.pi)
    return np.where(np.isnan(half), math.inf, np.minimum(begin, end) / np.abs(k))


def _least(lengths: Floats) -> Floats:
    least: Floats = lengths.min(axis=1, initial=math.inf)
    return least
