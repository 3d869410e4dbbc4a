"""Playback of a log at any time: interpolated poses, driven path and contacts."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from antdrive.base.types import Floats, Point
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.timeline import Timeline
from antdrive.sim.policy import Trigger
from antdrive.views.scene import Scene, contact_point, jumps, nearest_points

CAMERA_WINDOW = 0.6  # half the window over which a following camera's target is averaged [s]

TRAIL_STEP = 0.02  # between two points of a driven path [s]

SLOW_MOTION = 4.0  # slow-down factor around a contact
SLOW_BEFORE, SLOW_AFTER = 0.3, 0.1  # slow motion before and after a contact [s]
LEFT, ZOOM_OUT = 2.0, 0.5  # rest of a drive from which on the camera leaves a contact, and the time it takes [s]

#: Causes of replans in films, where they differ from the log's words.
REPLAN_CAUSES: dict[str, str] = {
    Trigger.OBSTRUCTED: "blocked",
    Trigger.DISCOVERED: "obstacle found",
    Trigger.STRAYED: "off route",
}


class ReplanEvent(NamedTuple):
    """Replan during the run."""

    t: float  # time [s]
    trigger: str  # cause
    solved: bool  # whether a new route was found
    route: Floats  # route from then on (N, 2) [m]

    @property
    def caption(self) -> str:
        """Caption of the replan; empty for a robot that re-plans at every cell."""
        if self.trigger == Trigger.DECISION:
            return ""
        return f"{'NEW' if self.solved else 'NO NEW'} ROUTE: {REPLAN_CAUSES.get(self.trigger, self.trigger).upper()}"


class Playback(Timeline):
    """Run as functions of time [s], interpolated between the rows of its log."""

    def __init__(self, rollout: Rollout) -> None:
        super().__init__(rollout)
        self.scene, rows = Scene.of(rollout), len(rollout.t)
        scene = self.scene
        self._forward = np.ascontiguousarray(rollout.twist[:, 0])
        self._clearance, self._movers = rollout.clearance, rollout.movers
        self._least = np.minimum.accumulate(self._clearance)
        self._driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rollout.pose[:, :2], axis=0).T))])
        self._limiter, self._jumps = rollout.limiter, jumps(self._movers)
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
        self._contact_times = self.t[np.clip(rollout.contacts[:, 0].astype(np.int64), 0, rows - 1)]
        self._contact_points = [
            contact_point(scene, self._columns[:, step], index, self._movers[step])
            for step, index in np.minimum(rollout.contacts[:1, :2].astype(np.int64), (rows - 1, 2**31)).tolist()
        ]

    def slow_motion(self, speed: float) -> tuple[float, float] | None:
        """Return start and end of the slow motion around the first contact [s]; None without a contact."""
        if not len(self._contact_times):
            return None
        first = float(self._contact_times[0])
        return max(0.0, first - SLOW_BEFORE * speed), min(self.duration, first + SLOW_AFTER * speed)

    def closeness(self, at: float, speed: float) -> float:
        """Return how close the camera is to the first contact: 0 before the slow motion, 1 at the contact."""
        slow = self.slow_motion(speed)
        if slow is None:
            return 0.0
        first = float(self._contact_times[0])
        part = min((at - slow[0]) / max(first - slow[0], 1e-9), 1.0)
        if self.duration - slow[1] > LEFT:
            part = min(part, 1.0 - (at - slow[1]) / (ZOOM_OUT * speed))
        return max(0.0, part) ** 2 * (3 - 2 * max(0.0, part))

    def pose(self, at: float) -> tuple[float, float, float]:
        """Return the robot's x, y [m] and unwrapped heading [rad]."""
        x, y, yaw = self.poses(at).tolist()
        return x, y, yaw

    def camera_target(self, at: float) -> tuple[float, float]:
        """Return the target of a following camera [m]: the robot's mean position around a time."""
        moments = at + CAMERA_WINDOW * np.linspace(-1, 1, 25)
        x, y = (float(column.mean()) for column in self.poses(moments).T[:2])
        return x, y

    def movers(self, at: float) -> Floats:
        """Return the movers' positions (M, 2) [m]; a mover that jumps keeps its position until the row after the jump."""
        row, fraction = self.between(at)
        here = self._movers[row]
        if fraction == 0.0:
            return np.asarray(here)
        step = np.where(self._jumps[row, :, None], 0.0, self._movers[row + 1] - here)
        return np.asarray(here + fraction * step)

    def mover_velocities(self, at: float) -> Floats:
        """Return the movers' velocities (M, 2) [m/s]; 0 during a jump and in a log of one row."""
        if len(self.t) < 2:
            return np.zeros((self._movers.shape[1], 2))
        row = min(self.row(at), len(self.t) - 2)
        step = np.where(self._jumps[row, :, None], 0.0, self._movers[row + 1] - self._movers[row])
        return np.asarray(step / (self.t[row + 1] - self.t[row]))

    def tracked(self, at: float) -> Floats:
        """Return the movers tracked by lidar at the last scan (N, 5): x, y [m], velocity [m/s] and radius [m]."""
        end = int(np.searchsorted(self._tracks[:, 0], self.row(at), side="right"))
        if not end or self._tracks[end - 1, 0] < self.row(at) - self._scan_rows:
            return np.empty((0, 5))
        begin = int(np.searchsorted(self._tracks[:, 0], self._tracks[end - 1, 0], side="left"))
        return self._tracks[begin:end, 2:].copy()

    def replan_count(self, at: float) -> int:
        """Return the number of replans up to a time."""
        return sum(event.t <= at + 1e-9 for event in self.replans)

    def speed(self, at: float) -> float:
        """Return the measured forward speed [m/s]."""
        return float(np.interp(at, self.t, self._forward)) + 0.0  # never -0.0

    def clearance(self, at: float) -> float:
        """Return the distance from the robot to the nearest obstacle, mover or wall [m]."""
        return float(np.interp(at, self.t, self._clearance))

    def min_clearance(self, at: float) -> float:
        """Return the smallest clearance up to a time [m]."""
        return min(float(self._least[self.row(at)]), self.clearance(at))

    def nearest_points(self, at: float) -> tuple[Point, Point]:
        """Return the nearest two points of the footprint and of an obstacle, mover or wall [m]."""
        return nearest_points(self.scene, self.pose(at), self.movers(at))

    def limited_lengths(self) -> Floats:
        """Return the length driven under each limiter (L,) [m]."""
        ways = np.diff(self._driven, prepend=0.0)
        return np.asarray(np.bincount(self._limiter, ways, minlength=256), dtype=np.float64)

    def driven(self, at: float) -> float:
        """Return the length of the path driven up to a time [m]."""
        return float(np.interp(at, self.t, self._driven))

    def trail(self, until: float) -> list[tuple[Floats, int]]:
        """Return the path driven up to a time as polylines (N, 2) [m], each with its limiter."""
        moments = np.append(np.arange(0.0, until, TRAIL_STEP), until)
        rows = np.searchsorted(self.t, (moments[1:] + moments[:-1]) / 2, side="right") - 1
        limiters, points = self._limiter[np.clip(rows, 0, len(self.t) - 1)], self.poses(moments)[:, :2]
        cuts = [0, *(1 + np.flatnonzero(np.diff(limiters))).tolist(), len(limiters)]
        return [(points[i : j + 1], int(limiters[i])) for i, j in pairwise(cuts) if j > i]

    @property
    def first_contact(self) -> Point | None:
        """Point of the first contact [m]; None without any."""
        return self._contact_points[0] if self._contact_points else None

    def touched(self, at: float) -> bool:
        """Return whether there was a contact up to a time."""
        return bool((self._contact_times <= at + 1e-9).any())
