"""Read a log at any moment: poses between its rows, wheel angles, the driven path, contacts."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.base.types import Floats
from antdrive.sim.log.record import DECISION
from antdrive.sim.log.rollout import Rollout
from antdrive.views.scene import Scene, contact_point, jumps

CAMERA_WINDOW = 0.6  # a following camera looks at the robot's mean position over this time before and after [s]

SLOW_MOTION = 4.0  # a film is this many times slower around a contact
SLOW_BEFORE, SLOW_AFTER = 0.3, 0.1  # slow motion starts and ends this long before and after a contact [s]


class ReplanEvent(NamedTuple):
    """A replan during the run."""

    t: float  # when [s]
    trigger: str  # why the robot replanned
    solved: bool  # whether it found a new route
    route: Floats  # the polyline followed from then on (N, 2) [m]

    @property
    def caption(self) -> str:
        """The replan in a few words; empty for the steps of a robot that plans anew at every cell."""
        if self.trigger == DECISION:
            return ""
        return f"{'new route' if self.solved else 'no new route'}: {self.trigger}"


class Playback:
    """A run as functions of time [s], interpolated between the rows of its log."""

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
        self._jumps = jumps(self._movers)
        lidar, hz = rollout.record.robot.lidar, rollout.record.physics_hz
        self._tracks = rollout.tracks.astype(np.float64)
        self._scan_rows = (
            math.ceil(hz / lidar.rate) + hz // rollout.record.control_hz if lidar else 0
        )  # between two scans
        self.replans: list[ReplanEvent] = []
        route = rollout.route
        for replan in rollout.record.replans:
            route = np.array(replan.route, dtype=np.float64) if replan.solved else route
            self.replans.append(ReplanEvent(replan.t, replan.trigger, replan.solved, route))
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

    def slow_motion(self, speed: float) -> tuple[float, float] | None:
        """When slow motion around the first contact starts and ends [s]; None without a contact."""
        if not len(self._contact_times):
            return None
        first = float(self._contact_times[0])
        return max(0.0, first - SLOW_BEFORE * speed), min(self.duration, first + SLOW_AFTER * speed)

    def pose(self, at: float) -> tuple[float, float, float]:
        """The robot's x, y [m] and heading [rad], which has no jumps at ±pi."""
        x, y, yaw = (float(np.interp(at, self.t, column)) for column in self._pose.T)
        return x, y, yaw

    def camera_target(self, at: float) -> tuple[float, float]:
        """Where a following camera looks [m]: the robot's mean position around a moment."""
        moments = at + CAMERA_WINDOW * np.linspace(-1, 1, 25)
        x, y = (float(np.interp(moments, self.t, self._pose[:, axis]).mean()) for axis in (0, 1))
        return x, y

    def wheels(self, at: float) -> tuple[float, float]:
        """How far the left and the right wheel have turned [rad]."""
        left, right = (float(np.interp(at, self.t, angle)) for angle in self._angles)
        return left, right

    def movers(self, at: float) -> Floats:
        """The movers' positions (M, 2) [m]; a mover that jumps stays in place until the row after the jump."""
        row, share = self._between(at)
        here = self._movers[row]
        if share == 0.0:
            return np.asarray(here)
        step = np.where(self._jumps[row, :, None], 0.0, self._movers[row + 1] - here)
        return np.asarray(here + share * step)

    def mover_velocities(self, at: float) -> Floats:
        """The movers' velocities (M, 2) [m/s]; 0 during a jump and in a log of one row."""
        if len(self.t) < 2:
            return np.zeros((self._movers.shape[1], 2))
        row = min(self._row(at), len(self.t) - 2)
        step = np.where(self._jumps[row, :, None], 0.0, self._movers[row + 1] - self._movers[row])
        return np.asarray(step / (self.t[row + 1] - self.t[row]))

    def followed(self, at: float) -> Floats:
        """The movers that the robot follows with its lidar (N, 5): x, y [m], velocity [m/s] and radius [m], at the last scan."""
        end = int(np.searchsorted(self._tracks[:, 0], self._row(at), side="right"))
        if not end or self._tracks[end - 1, 0] < self._row(at) - self._scan_rows:
            return np.empty((0, 5))
        begin = int(np.searchsorted(self._tracks[:, 0], self._tracks[end - 1, 0], side="left"))
        return self._tracks[begin:end, 2:].copy()

    def _between(self, at: float) -> tuple[int, float]:
        """The last row at or before a moment, and the fraction of the time to the next row that is over."""
        row = self._row(at)
        if row + 1 >= len(self.t) or at <= self.t[row]:
            return row, 0.0
        return row, float((at - self.t[row]) / (self.t[row + 1] - self.t[row]))

    def replan_count(self, at: float) -> int:
        """The number of replans up to a moment."""
        return sum(event.t <= at + 1e-9 for event in self.replans)

    def speed(self, at: float) -> float:
        """The measured forward speed [m/s]."""
        return float(np.interp(at, self.t, self._twist[:, 0])) + 0.0  # never -0.0, which would be shown as such

    def clearance(self, at: float) -> float:
        """The distance from the robot to the nearest obstacle, mover or wall [m]."""
        return float(np.interp(at, self.t, self._clearance))

    def min_clearance(self, at: float) -> float:
        """The smallest clearance of all rows up to a moment [m]."""
        return float(self._least[self._row(at)])

    def trail(self, since: float, until: float) -> tuple[Floats, Floats]:
        """The points (N, 2) [m] of the path driven between two moments, and the speeds (N,) there [m/s]."""
        count = max(2, math.ceil((until - since) * 60) + 1)
        moments = np.linspace(since, until, count)
        points = np.column_stack([np.interp(moments, self.t, self._pose[:, axis]) for axis in (0, 1)])
        return points, np.interp(moments, self.t, self._twist[:, 0])

    def contact(self, at: float) -> tuple[float, float, float] | None:
        """The point x, y of the first contact [m], and the time since the latest one [s]; None before any."""
        past = self._contact_times[self._contact_times <= at + 1e-9]
        if not len(past):
            return None
        x, y = self._contact_points[0]
        return x, y, float(at - past.max())

    def _row(self, at: float) -> int:
        return int(np.clip(np.searchsorted(self.t, at + 1e-9, side="right") - 1, 0, len(self.t) - 1))
