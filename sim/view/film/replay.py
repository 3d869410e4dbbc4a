"""A log read at any moment: poses between its rows, wheel angles, the trail, contacts."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.sim.log.record import DECISION
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.view.scene import Scene, jumping

Floats = npt.NDArray[np.float64]

SMOOTHING = 0.6  # a following camera looks at the mean place of this long before and after [s]

SLOW = 4.0  # a film is this much slower around a contact
AROUND = (0.3, 0.1)  # from so long before to so long after it, at the film's usual speed [s]


class Renewal(NamedTuple):
    """A replan, as a film tells it."""

    t: float  # [s]
    cause: str
    solved: bool
    route: Floats  # (N, 2) followed from then on [m]

    @property
    def told(self) -> str:
        """In words; empty for the decisions of a robot that decides at every cell."""
        if self.cause == DECISION:
            return ""
        return f"{'new route' if self.solved else 'no new route'}: {self.cause}"


class Replay:
    """A run as functions of time [s]."""

    def __init__(self, rollout: Rollout) -> None:
        scene = Scene.of(rollout)
        robot = scene.robot
        rows = max(1, len(rollout.t))
        self.t = rollout.t if len(rollout.t) else np.zeros(1)
        pose = rollout.pose if len(rollout.pose) else np.array([scene.start])
        self._pose = np.column_stack([pose[:, :2], np.unwrap(pose[:, 2])])
        self._twist = rollout.twist if len(rollout.twist) else np.zeros((rows, 2))
        self._clearance = rollout.clearance if len(rollout.clearance) else np.full(rows, np.nan)
        self._least = np.minimum.accumulate(self._clearance)
        self._movers = rollout.movers if len(rollout.movers) else np.empty((rows, 0, 2))
        self._jumping = jumping(self._movers)
        self.renewals: list[Renewal] = []
        route = rollout.route
        for replan in rollout.record.replans:
            route = np.array(replan.route, dtype=np.float64) if replan.solved else route
            self.renewals.append(Renewal(replan.t, replan.trigger, replan.solved, route))
        rim = self._twist[:, 1] * robot.track / 2
        steps = np.diff(self.t)
        self._angles = []
        for speeds in (self._twist[:, 0] - rim, self._twist[:, 0] + rim):
            turned = (speeds[1:] + speeds[:-1]) / 2 * steps / robot.wheel_radius
            self._angles.append(np.concatenate([[0.0], np.cumsum(turned)]))
        self._contact_times = self.t[np.clip(rollout.contacts[:, 0].astype(np.int64), 0, rows - 1)]
        self._contact_points = [
            contact_point(scene, self._pose[step], index, self._movers[step])
            for step, index in np.minimum(rollout.contacts[:1, :2].astype(np.int64), (rows - 1, 2**31)).tolist()
        ]

    @property
    def duration(self) -> float:
        """How long the run took [s]."""
        return float(self.t[-1] - self.t[0])

    def slow(self, speed: float) -> tuple[float, float] | None:
        """The part of the run around the first contact that is shown slowly in a film of a speed; None without one."""
        if not len(self._contact_times):
            return None
        first = float(self._contact_times[0])
        return max(0.0, first - AROUND[0] * speed), min(self.duration, first + AROUND[1] * speed)

    def pose(self, at: float) -> tuple[float, float, float]:
        """Where the robot is."""
        x, y, yaw = (float(np.interp(at, self.t, column)) for column in self._pose.T)
        return x, y, yaw

    def smooth(self, at: float) -> tuple[float, float]:
        """Where the robot is around a moment, on average."""
        moments = at + SMOOTHING * np.linspace(-1, 1, 25)
        x, y = (float(np.interp(moments, self.t, self._pose[:, axis]).mean()) for axis in (0, 1))
        return x, y

    def wheels(self, at: float) -> tuple[float, float]:
        """How far the left and the right wheel have turned [rad]."""
        left, right = (float(np.interp(at, self.t, angle)) for angle in self._angles)
        return left, right

    def movers(self, at: float) -> Floats:
        """Where the moving obstacles are (M, 2); one that jumps is where it was until it has."""
        row, share = self._between(at)
        here = self._movers[row]
        if share == 0.0:
            return np.asarray(here)
        step = np.where(self._jumping[row, :, None], 0.0, self._movers[row + 1] - here)
        return np.asarray(here + share * step)

    def mover_velocities(self, at: float) -> Floats:
        """How the moving obstacles move (M, 2) [m/s]; 0 where the log does not say."""
        if len(self.t) < 2:
            return np.zeros((self._movers.shape[1], 2))
        row = min(self._row(at), len(self.t) - 2)
        step = np.where(self._jumping[row, :, None], 0.0, self._movers[row + 1] - self._movers[row])
        return np.asarray(step / (self.t[row + 1] - self.t[row]))

    def _between(self, at: float) -> tuple[int, float]:
        """The last row at or before a moment, and the share of the way to the next."""
        row = self._row(at)
        if row + 1 >= len(self.t) or at <= self.t[row]:
            return row, 0.0
        return row, float((at - self.t[row]) / (self.t[row + 1] - self.t[row]))

    def renewed(self, at: float) -> int:
        """How many replans there were until a moment."""
        return sum(renewal.t <= at + 1e-9 for renewal in self.renewals)

    def speed(self, at: float) -> float:
        """The measured forward speed [m/s]; standing reads 0, not -0."""
        return float(np.interp(at, self.t, self._twist[:, 0])) + 0.0

    def clearance(self, at: float) -> float:
        """The distance to what is nearest [m]."""
        return float(np.interp(at, self.t, self._clearance))

    def least_clearance(self, at: float) -> float:
        """The smallest distance in any row so far [m]."""
        return float(self._least[self._row(at)])

    def trail(self, since: float, until: float) -> tuple[Floats, Floats]:
        """Points (N, 2) driven through between two moments, and the speeds (N,) there."""
        count = max(2, math.ceil((until - since) * 60) + 1)
        moments = np.linspace(since, until, count)
        points = np.column_stack([np.interp(moments, self.t, self._pose[:, axis]) for axis in (0, 1)])
        return points, np.interp(moments, self.t, self._twist[:, 0])

    def touched(self, at: float) -> tuple[float, float, float] | None:
        """Where the first contact was, and how long ago the latest began or went on [s]; None before any."""
        past = self._contact_times[self._contact_times <= at + 1e-9]
        if not len(past):
            return None
        x, y = self._contact_points[0]
        return x, y, float(at - past.max())

    def _row(self, at: float) -> int:
        return int(np.clip(np.searchsorted(self.t, at + 1e-9, side="right") - 1, 0, len(self.t) - 1))


def contact_point(scene: Scene, pose: npt.ArrayLike, index: int, movers: Floats) -> tuple[float, float]:
    """The point of an obstacle, mover at (M, 2) or wall (left, right, bottom, top) that is nearest to the footprint."""
    x, y, yaw = (float(value) for value in np.asarray(pose))
    foot = scene.robot.footprint
    discs = np.vstack([scene.obstacles[:, :3], np.column_stack([movers, scene.mover_radii])])
    if index >= len(discs):
        x0, y0, x1, y1 = scene.bounds
        return ((x0, y), (x1, y), (x, y0), (x, y1))[(index - len(discs)) % 4]
    ox, oy, radius = (float(value) for value in discs[index])
    cosine, sine = math.cos(yaw), math.sin(yaw)
    ahead = min(max((ox - x) * cosine + (oy - y) * sine, -foot.half_length), foot.half_length)
    aside = min(max((oy - y) * cosine - (ox - x) * sine, -foot.half_width), foot.half_width)
    nx, ny = x + ahead * cosine - aside * sine, y + ahead * sine + aside * cosine
    gap = math.hypot(nx - ox, ny - oy)
    if gap < 1e-9:
        return ox, oy
    return ox + radius * (nx - ox) / gap, oy + radius * (ny - oy) / gap
