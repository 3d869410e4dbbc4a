"""Local avoidance of movers: slow down, stop, back off or go around them, then resume the route.

In every control period the controller's motion is simulated among the predicted movers. If it keeps the preferred
clearance, it is used unchanged. Otherwise it competes with other candidates: the same route at lower speeds, and
sequences of two constant twists, forwards or backwards, within the robot's dynamic window
(after D. Fox, W. Burgard and S. Thrun, *The dynamic window approach to collision avoidance*,
IEEE Robotics & Automation Magazine 4, 1997). Every candidate must keep clear of static obstacles: along the route as the
controller does, elsewhere with the loss that margins hold. A robot that is closer may not come closer still. Standing
still is only one of the candidates, so the robot moves out of the path of an approaching mover. Where the controller would halt
before the end of the route, as avoidance may leave the robot, it moves to where it has more room, and a new route may begin.

Near movers ahead the robot keeps its `near_speed`, and it reverses slowly and not far. These limits cause no contact that a
robot without them avoids:

- Where every candidate within them ends in a contact, the robot first keeps its outline from obstacles instead of its circle;
  then they are lifted step by step, so a predicted contact has the same escapes.
- A prediction that is wrong could hide a contact. They hold only where movers move as predicted: a mover with another observed
  velocity, as among ground-truth positions, lifts them all. So does a mover faster than people: speed is the way out.
- A robot that crosses the lane of a mover that comes faster than `near_speed` is not slowed, nor one that leaves a mover behind.

If a nearby mover turns, there may be no candidate that keeps the minimum clearance. While the robot can still stop in time,
it takes the candidate with the latest contact with a mover. After that it takes the one that stays farthest from movers, and
stops only if every candidate ends in a contact. T. Fraichard and
H. Asama, *Inevitable collision states*, Advanced Robotics 18, 2004, also evaluate a state by its best escape.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.base.errors import require
from antdrive.robots.clearance import outline_of
from antdrive.robots.control import _kernels_avoidance as kernels
from antdrive.robots.control._kernels_pursuit import PursuitTuning, reachable_twist
from antdrive.robots.control.observation import Twist
from antdrive.robots.control.pursuit import PursuitState, TrackedPath
from antdrive.robots.spec import Footprint, RobotSpec

SPEED_WEIGHT = 0.3  # value of final speed along the route, in metres of progress [m per m/s]
WALKING = 1.5  # movers faster than this are not people [m/s]
SURPRISE = 0.1  # a mover has another velocity than predicted if they differ by more than this [m/s]
CROSSING = 0.5  # a robot crosses a mover's lane if the sine of the angle between both headings exceeds this
BESIDE = (0.2, 0.4, 0.6, 0.8, 1.0)  # distances from the route of the lines beside it that a robot may follow [m]
PERSISTENCE = 0.05  # value of keeping the last decision, in metres of progress [m]


class AvoidanceState(NamedTuple):
    """Avoidance state between two control periods.

    Attributes:
        candidate: the pair of twists being executed, a row of the candidate table; empty if there is none
        remaining: remaining time of its first twist [s]
        reversed: distance driven backwards and not yet forwards again [m]
    """

    candidate: tuple[float, ...] = ()
    remaining: float = 0.0
    reversed: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Avoidance:
    """Settings of local avoidance. Weights are costs in metres of progress along the route.

    Attributes:
        horizon: prediction horizon [s]
        step: time step of the prediction [s]
        min_clearance: minimum clearance to movers; a mover already closer may come only slightly closer [m]
        preferred_clearance: clearance beyond `min_clearance` at which the cost reaches zero [m]
        clearance_weight: cost of each metre below the preferred clearance [m/m]
        cross_track_weight: cost of each metre off the route [m/m]
        heading_weight: cost of each radian off the route's direction [m/rad]
        reversal_time: prediction horizon for a mover's sudden reversal [s]
        reversal_margin: clearance to a reversing mover beyond `min_clearance` [m]
        reversal_weight: cost of each metre below this clearance [m/m]; 0 ignores reversals
        near_distance: gap to a mover below which the robot keeps its `near_speed`, unless a contact follows [m]
        reverse_speed: highest speed backwards, unless a contact follows [m/s]
        reverse_distance: longest way backwards, unless a contact follows [m]

    Raises:
        ValueError: a setting is out of range.
    """

    horizon: float = 2.5
    step: float = 0.1
    min_clearance: float = 0.1
    preferred_clearance: float = 0.4
    clearance_weight: float = 1.5
    cross_track_weight: float = 0.6
    heading_weight: float = 0.3
    reversal_time: float = 0.6
    reversal_margin: float = 0.05
    reversal_weight: float = 6.0
    near_distance: float = 1.0
    reverse_speed: float = 0.3
    reverse_distance: float = 0.5

    def __post_init__(self) -> None:
        for key in ("horizon", "step"):
            require(key, getattr(self, key), above=0, at_most=60)
        for option in fields(self):
            require(option.name, getattr(self, option.name), at_least=0)

    @property
    def prediction_times(self) -> Floats:
        """Times of the predictions that `avoid` needs, from now (K + 1,) [s]."""
        return _instants(self.horizon, self.step)

    def avoid(
        self,
        tracked: TrackedPath,
        spec: RobotSpec,
        pose: Pose,
        last: Twist,
        before: PursuitState,
        wanted: Twist,
        state: AvoidanceState,
        places: Floats,
        radii: Floats,
        velocities: Floats | None = None,
        speed_limit: float = math.inf,
        backwards: float = math.inf,
        losses: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[Twist, bool, AvoidanceState]:
        """Return the next command, whether avoidance changed it, and the state for the next period.

        Args:
            tracked: the controller's path
            spec: the robot
            pose: its estimated pose
            last: the command of the previous period
            before: the controller's state before it chose `wanted`
            wanted: the controller's command for this period
            state: the state returned in the previous period
            places: the movers' predicted positions at the `prediction_times` (K + 1, M, 2) [m]
            radii: their radii (M,) [m]
            velocities: their observed velocities (M, 2) [m/s]; None: as predicted
            speed_limit: speed limit from the schedule of a timed plan [m/s]
            backwards: maximum reverse speed, for a robot that cannot see behind; ignored if obeying it causes a contact [m/s]
            losses: clearance of the circle and of the outline from obstacles off the route [m]
        """
        period, limits = tracked.tuning.period, tracked.limits
        halts = speed_limit > 0 and not (any(last) or any(wanted))  # the robot may have to back off again
        reversed_ = 0.0 if halts else max(0.0, state.reversed - last.speed * period)
        near = self.speed_near(spec, pose, last, places, radii)
        left = max(self.reverse_distance - reversed_, 0.0)
        slow = min(self.reverse_speed, math.sqrt(2 * limits.acceleration * left), backwards)
        tuning = _tuning(tracked, self.step)
        observed = self._predicted(places) if velocities is None else velocities
        outlined = not spec.footprint.is_disc
        limits_of = [
            (near, slow, False), (near, slow, outlined), (near, backwards, outlined), (math.inf, backwards, outlined),
            (math.inf, math.inf, outlined),
        ]  # fmt: skip
        if kernels.must_dodge(
            *pose[:2], places, observed, radii, WALKING, SURPRISE, self.step, self.horizon, spec.max_speed, spec.radius,
        ):  # fmt: skip
            limits_of[:3] = [(math.inf, backwards, False)]
        given_way = None  # a decision to slow down, unless the robot can pass beside its route by its outline
        for fastest, reverse, by_outline in dict.fromkeys(limits_of):
            weights = _weights(self, tuning.robot_radius, spec.footprint, by_outline, losses)
            most = min(fastest, spec.max_speed, limits.speed)
            candidates = self._candidates(spec, state, min(speed_limit, most), most, reverse, by_outline)
            situation = (
                *pose, *last, before.arc, before.turning, candidates, tracked.samples, tracked.obstacles,
                limits, tuning, weights, places, radii,
            )  # fmt: skip
            chosen, contact = kernels.choose(*situation)
            if given_way is not None:
                if contact < math.inf or candidates[chosen, kernels.KIND] != kernels.BESIDE_ROUTE:
                    candidates, chosen, contact = given_way
                break
            if contact == math.inf:
                if not (outlined and not by_outline and fastest < math.inf and _gives_way(candidates, chosen)):
                    break
                given_way = candidates, chosen, contact
        if chosen == 0 and contact == math.inf and wanted.speed <= candidates[0, kernels.SPEED]:
            return wanted, False, AvoidanceState(reversed=reversed_)
        turning = abs(last.yaw_rate) / limits.yaw_acceleration + self.step if last.yaw_rate else 0.0
        # A contact this soon counts as unavoidable if a mover is too close.
        too_late = 2 * self.step if kernels.is_close(*pose, places[0], radii, weights) else 0.0
        if contact < max(abs(last.speed) / limits.acceleration, turning, too_late):
            chosen = kernels.best_escape(*situation)
        twist, after = _execute(candidates[chosen] if chosen >= 0 else None, wanted, last, tracked, pose, before.arc)
        return twist, True, after._replace(reversed=reversed_)

    def speed_near(self, spec: RobotSpec, pose: Pose, last: Twist, places: Floats, radii: Floats) -> float:
        """Return the highest speed at which the robot can slow to its `near_speed` before it is near a mover [m/s].

        Movers behind the robot do not count, nor movers whose lane it crosses before them: those that come faster than
        `near_speed`, while the robot's heading leads out of the strip that they sweep. There, slowing down is the danger.

        Args:
            spec: the robot
            pose: its estimated pose
            last: the command of the previous period
            places: the movers' predicted positions at the `prediction_times` (K + 1, M, 2) [m]
            radii: their radii (M,) [m]
        """
        if not len(radii) or spec.near_speed >= spec.max_speed:
            return math.inf
        heading = np.array((math.cos(pose[2]), math.sin(pose[2])))
        velocities = self._predicted(places)
        to, speeds = places[0] - pose[:2], np.hypot(*velocities.T)
        away, moving = np.maximum(np.hypot(*to.T), 1e-9), np.maximum(speeds, 1e-9)
        closing = np.maximum(-(velocities * to).sum(axis=1) / away, 0.0)
        aside = np.abs(_cross(to, velocities)) / moving - radii - spec.radius - self.min_clearance
        crosses = (closing > spec.near_speed) & (aside < 0) & (np.abs(_cross(heading, velocities)) > CROSSING * moving)
        counts = (to @ heading > 0) & ~crosses
        gap = away - radii - spec.radius - self.near_distance - (closing + abs(last.speed)) * self.step
        both = closing + spec.near_speed
        # With x beyond `near_speed`: closing x / a + (x^2 + 2 near_speed x) / (2 a) <= gap.
        more = np.sqrt(both**2 + 2 * spec.max_acceleration * np.maximum(gap, 0.0)) - both
        return spec.near_speed + float(more.min(initial=math.inf, where=counts))

    def _predicted(self, places: Floats) -> Floats:
        """Return the movers' predicted velocities (M, 2) [m/s]."""
        return np.asarray((places[1] - places[0]) / self.step)

    def _candidates(
        self, spec: RobotSpec, state: AvoidanceState, speed_limit: float, fastest: float, reverse: float, beside: bool
    ) -> Floats:
        """Return the candidates (N, 6) within speed limits, `fastest` at most the robot's [m/s].

        Row 0 keeps the speed limit, row 1 is the last decision.
        """
        able = spec.max_speed, spec.max_yaw_rate, spec.max_lateral_acceleration
        table = _limited_table(*able, beside, fastest, reverse)
        if not state.candidate and speed_limit >= fastest:
            return table
        table = table.copy()
        table[0, kernels.SPEED] = speed_limit
        if state.candidate:
            table[1] = state.candidate
            table[1, kernels.DURATION] = state.remaining
        _limit_speeds(table[:2], fastest, reverse)
        return table


def _gives_way(candidates: Floats, chosen: int) -> bool:
    """Return whether a candidate ends more slowly than the controller's motion may."""
    row = candidates[chosen]
    two = row[kernels.KIND] == kernels.TWO_TWISTS and row[kernels.DURATION] < math.inf
    return bool(row[kernels.NEXT_SPEED if two else kernels.SPEED] < candidates[0, kernels.SPEED])


def _cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _execute(
    candidate: Floats | None, wanted: Twist, last: Twist, tracked: TrackedPath, pose: Pose, arc: float
) -> tuple[Twist, AvoidanceState]:
    """Return a candidate's command and state; None means that no candidate avoids a contact."""
    limits, period = tracked.limits, tracked.tuning.period
    if candidate is None:
        # The robot stops: a contact while standing is attributed to the mover.
        speed, yaw_rate, state = 0.0, 0.0, AvoidanceState()
    elif candidate[kernels.KIND] == kernels.FOLLOW_ROUTE:
        slowest = last.speed - limits.acceleration * period
        speed = min(wanted.speed, max(float(candidate[kernels.SPEED]), slowest))
        yaw_rate = wanted.yaw_rate * (speed / wanted.speed if wanted.speed > 0 else 1.0)
        return Twist(speed, yaw_rate), AvoidanceState()
    elif candidate[kernels.KIND] == kernels.BESIDE_ROUTE:
        speed, yaw_rate = kernels.beside_route(
            *pose, last.speed, arc, candidate, tracked.samples, limits, tracked.tuning
        )
        state = AvoidanceState(tuple(candidate.tolist()))
    else:
        first = candidate[kernels.DURATION] > 1e-9
        speed = float(candidate[kernels.SPEED if first else kernels.NEXT_SPEED])
        yaw_rate = float(candidate[kernels.YAW_RATE if first else kernels.NEXT_YAW_RATE])
        remaining = max(0.0, float(candidate[kernels.DURATION]) - period)
        state = AvoidanceState(tuple(candidate.tolist()), remaining)
    return Twist(*reachable_twist(speed, yaw_rate, *last, period, limits)), state


@functools.cache
def _candidate_table(max_speed: float, max_yaw_rate: float, lateral_acceleration: float, beside: bool) -> Floats:
    """Return a robot's candidates (N, 6): the controller's motion at full and lower speeds, and pairs of twists.

    Row 1 is a placeholder for the last decision. The second twist of a pair drives straight or stops. With `beside`, the last
    rows follow lines beside the route.
    """
    fractions = (1.0, 1.0, 0.7, 0.45, 0.2)
    rows = [(kernels.FOLLOW_ROUTE, fraction * max_speed, 0.0, 0.0, 0.0, 0.0) for fraction in fractions]
    rows.append((kernels.TWO_TWISTS, 0.0, 0.0, 0.0, 0.0, 0.0))
    for speed in (1.0, 0.6, 0.3, 0.0, -0.3, -0.6, -1.0):
        v = speed * max_speed
        most = min(max_yaw_rate, lateral_acceleration / abs(v)) if v else max_yaw_rate
        for turn in (0.0, 0.25, -0.25, 0.6, -0.6, 1.0, -1.0):
            w = turn * most
            rows.append((kernels.TWO_TWISTS, v, w, math.inf, 0.0, 0.0))
            if not (v or w):
                continue
            for duration in (0.4, 0.9):
                rows.append((kernels.TWO_TWISTS, v, w, duration, 0.0, 0.0))
                ahead = (v,) if v else (max_speed, -max_speed)
                rows += [(kernels.TWO_TWISTS, v, w, duration, next_speed, 0.0) for next_speed in ahead if w]
    for fraction, shift in itertools.product((1.0, 0.45, 0.2), BESIDE if beside else ()):
        rows += [(kernels.BESIDE_ROUTE, fraction * max_speed, side, 0.0, 0.0, 0.0) for side in (shift, -shift)]
    return np.array(rows)


@functools.lru_cache(maxsize=64)
def _limited_table(
    max_speed: float, max_yaw_rate: float, lateral_acceleration: float, beside: bool, fastest: float, reverse: float
) -> Floats:
    """Return a robot's candidates (N, 6) within speed limits [m/s]; callers copy them before they change them."""
    table = _candidate_table(max_speed, max_yaw_rate, lateral_acceleration, beside).copy()
    _limit_speeds(table, fastest, reverse)
    return table


def _limit_speeds(table: Floats, fastest: float, reverse: float) -> None:
    """Limit the speeds of candidates (N, 6) in place, forwards and backwards [m/s]."""
    for column in (kernels.SPEED, kernels.NEXT_SPEED):
        speeds = table[:, column]
        np.minimum(np.maximum(speeds, -min(reverse, fastest), out=speeds), fastest, out=speeds)


@functools.lru_cache(maxsize=64)
def _instants(horizon: float, step: float) -> Floats:
    """Return the times of a prediction (K + 1,) [s], read-only."""
    times = np.arange(math.ceil(horizon / step - 1e-9) + 1) * np.float64(step)
    times.flags.writeable = False
    return times


@functools.lru_cache(maxsize=4)
def _tuning(tracked: TrackedPath, step: float) -> PursuitTuning:
    """Return the controller's settings on a path, for steps of a prediction [s]."""
    return tracked.tuning._replace(period=step)


@functools.lru_cache(maxsize=64)
def _weights(
    avoidance: Avoidance, radius: float, footprint: Footprint, outlined: bool = False,
    losses: tuple[float, float] = (0.0, 0.0),
) -> kernels.AvoidanceWeights:  # fmt: skip
    """Return the settings for a robot whose circle counts with a given radius [m]; `outlined`: or its outline.

    `losses` are those of `Avoidance.avoid` [m].
    """
    outline = outline_of(footprint, 0.0)
    return kernels.AvoidanceWeights(
        step=avoidance.step,
        min_distance=radius + avoidance.min_clearance,
        preferred_clearance=avoidance.preferred_clearance,
        clearance_weight=avoidance.clearance_weight,
        cross_track_weight=avoidance.cross_track_weight,
        heading_weight=avoidance.heading_weight,
        speed_weight=SPEED_WEIGHT,
        persistence=PERSISTENCE,
        reversal_time=avoidance.reversal_time,
        reversal_distance=radius + avoidance.min_clearance + avoidance.reversal_margin,
        reversal_weight=avoidance.reversal_weight,
        radius=footprint.radius,
        corners=outline.corners,
        rounding=outline.reach,
        outlined=outlined,
        loss=losses[0],
        outline_loss=losses[1],
    )
