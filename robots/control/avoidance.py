"""Keeping clear of what moves, whatever the route: slow down, stop, back off or go round, and resume.

In every control period the way that the controller would drive on is followed ahead in time, among the movers as they are
predicted. Where it has room, nothing is changed. Where it has not, it competes with others: the same route more slowly,
and pairs of twists, one after the other, as the dynamic window allows (after D. Fox, W. Burgard and S. Thrun, *The dynamic
window approach to collision avoidance*, 1997), backwards too. All keep clear of what stands still; what would be met by
standing is met by stopping, too, so a robot gives way to a mover that comes for it.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from antdrive.robots._kernels import clip, keep_wheels_within
from antdrive.robots.control import _kernels_avoidance as kernels
from antdrive.robots.control.pursuit import LIMITERS, Progress, TrackedPath, Twist
from antdrive.robots.spec import RobotSpec
from antdrive.worlds import Floats, Pose
from antdrive.worlds.errors import FieldError

YIELD = LIMITERS.index("yield")


class AvoidanceState(NamedTuple):
    """What the robot last decided, and is still about."""

    way: tuple[float, ...] = ()  # a pair of twists, see `_kernels_yield`; empty: the controller's own
    left: float = 0.0  # of the first [s]


@dataclass(frozen=True, kw_only=True)
class Avoidance:
    """The settings of yielding.

    Raises:
        ValueError: a setting outside its range.
    """

    horizon: float = 2.5  # movers are predicted so far ahead [s]
    step: float = 0.1  # and looked at so often [s]
    keep: float = 0.1  # room to movers that a way must have, or what is left of it [m]
    comfort: float = 0.4  # and, beyond that, room that is worth a detour [m]
    worth: float = 1.5  # metres of the route that each metre of it is worth
    lateral: float = 0.6  # and each metre off the route
    turn: float = 0.3  # and each radian off its heading
    doubt: float = 0.6  # a mover may turn back at any time: it is thought of for so long [s]
    berth: float = 0.05  # and beyond `keep`, this room is kept to where it would be [m]
    wary: float = 6.0  # metres of the route that each metre less is worth; 0: movers do as predicted

    def __post_init__(self) -> None:
        for key in ("horizon", "step"):
            if not 0 < getattr(self, key) <= 60:
                raise FieldError(key, f"must be greater than 0 and at most 60, got {getattr(self, key):g}")
        for key in ("keep", "comfort", "worth", "lateral", "turn", "doubt", "berth", "wary"):
            if not 0 <= getattr(self, key) < math.inf:
                raise FieldError(key, f"must be at least 0, got {getattr(self, key):g}")

    @property
    def ahead(self) -> Floats:
        """The times from now (K + 1,) at which movers' places are asked for [s]."""
        return np.arange(math.ceil(self.horizon / self.step - 1e-9) + 1) * np.float64(self.step)

    def avoid(
        self,
        guide: TrackedPath,
        robot: RobotSpec,
        pose: Pose,
        last: Twist,
        before: Progress,
        wanted: Twist,
        resolve: AvoidanceState,
        places: Floats,
        radii: Floats,
        top: float = math.inf,
    ) -> tuple[Twist, bool, AvoidanceState]:
        """The command to give instead of the controller's `wanted`, whether it differs, and what was decided.

        `last` is the command before, `before` the controller's memory then; `places` (K + 1, M, 2) are where movers of
        `radii` (M,) are expected `ahead` from now [m]; `top` is how fast it wants to be at most [m/s].
        """
        care = kernels.AvoidanceWeights(
            self.step, guide.tuning.radius + self.keep, self.comfort, self.worth, self.lateral, self.turn,
            self.doubt, self.berth, self.wary,
        )  # fmt: skip
        ways = _ways(robot.max_speed, robot.max_yaw_rate, robot.max_lateral_acceleration)
        if resolve.way or top < robot.max_speed:
            ways = ways.copy()
        ways[0, 1] = min(robot.max_speed, top)
        if resolve.way:
            ways[1] = (*resolve.way[:3], resolve.left, *resolve.way[4:])
        chosen, late, _ = kernels.choose(
            *pose, *last, before.arc, before.turning, ways,
            guide.line, guide.known, guide.limits, guide.tuning._replace(period=self.step), care, places, radii,
        )  # fmt: skip
        if chosen == 0 and late == math.inf:
            return wanted, False, AvoidanceState()
        limits, dt = guide.limits, guide.tuning.period
        way = ways[chosen]
        away = np.hypot(*(places[0] - pose[:2]).T) - radii
        soon = 2 * self.step if away.min(initial=math.inf) < care.keep else 0.0
        if late < max(abs(last.speed) / limits.acceleration, soon):  # it will be met in any case: better standing
            v, w = 0.0, 0.0
            resolve = AvoidanceState()
        elif way[0] == kernels.PURSUE:
            top = float(way[1])
            v = min(wanted.speed, max(top, last.speed - limits.acceleration * dt))
            w = wanted.yaw_rate * (v / wanted.speed if wanted.speed > 0 else 1.0)
            return Twist(v, w), True, AvoidanceState()
        else:
            first = way[3] > 1e-9
            v, w = (float(way[1]), float(way[2])) if first else (float(way[4]), float(way[5]))
            resolve = AvoidanceState(tuple(way.tolist()), max(0.0, float(way[3]) - dt))
        v = clip(v, last.speed - limits.acceleration * dt, last.speed + limits.acceleration * dt)
        turn = limits.yaw_acceleration * dt
        w = clip(w, max(last.yaw_rate - turn, -limits.yaw_rate), min(last.yaw_rate + turn, limits.yaw_rate))
        return Twist(*keep_wheels_within(v, w, limits.half_track, limits.rim)), True, resolve


@functools.cache
def _ways(fastest: float, yaw_rate: float, lateral: float) -> Floats:
    """What a robot chooses from (N, 6): the controller's own way twice, that more slowly, and pairs of twists.

    The second of a pair goes on with the first, or straight ahead, or stands.
    """
    rows = [(kernels.PURSUE, share * fastest, 0.0, 0.0, 0.0, 0.0) for share in (1.0, 1.0, 0.7, 0.45, 0.2)]
    rows.append((kernels.TWISTS, 0.0, 0.0, 0.0, 0.0, 0.0))
    for speed in (1.0, 0.6, 0.3, 0.0, -0.3, -0.6, -1.0):
        v = speed * fastest
        most = min(yaw_rate, lateral / abs(v)) if v else yaw_rate
        for turn in (0.0, 0.25, -0.25, 0.6, -0.6, 1.0, -1.0):
            w = turn * most
            if not (v or w):
                continue
            rows.append((kernels.TWISTS, v, w, math.inf, 0.0, 0.0))
            for lasts in (0.4, 0.9):
                rows.append((kernels.TWISTS, v, w, lasts, 0.0, 0.0))
                rows += [(kernels.TWISTS, v, w, lasts, on, 0.0) for on in ((v,) if v else (fastest, -fastest)) if w]
    return np.array(rows)
