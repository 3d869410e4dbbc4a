"""Reconstruction of a mapless robot's occupancy map from the scans of its log."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base.plane import relative_frame
from antdrive.base.types import Flags, Floats, Pose
from antdrive.sim.driving.mover_tracking import MAP_CELL
from antdrive.sim.driving.senses import start_ground
from antdrive.sim.driving.survey import RECENT, horizon_of, reset_ticks, turning_room
from antdrive.sim.log.rollout import Rollout, estimates_of, ranges_of
from antdrive.sim.log.sights import lidar_of, meet
from antdrive.sim.log.timeline import Timeline
from antdrive.sim.sensing.mapping import OccupancyMap
from antdrive.sim.sensing.tracking import SKIN


class MapReconstruction:
    """Occupancy map at any time of a drive. Times must be requested in increasing order.

    Scans are inserted at the robot's estimated poses. `resets` repeats the robot's resets of its map; `detections` records
    first detections of obstacles.

    Attributes:
        lidar: the robot's lidar
        map: occupied and free cells, in the frame of the estimated poses
        met: first detection of each cylinder, in the order of `record.world.obstacles` (N,) [s]; infinite before it

    Raises:
        ValueError: the log has no scans.
    """

    def __init__(self, rollout: Rollout, *, resets: bool = False, detections: bool = True) -> None:
        self.lidar = lidar_of(rollout).at(rollout.record.control_hz)
        self._rollout, self._timeline = rollout, Timeline(rollout)
        self._times = rollout.t[rollout.scan_rows]
        self._entered, self._detections = 0, detections
        self.met: Floats = np.full(len(rollout.record.world.obstacles), math.inf)
        self.map = self._empty_map(rollout.record.task.start)
        ticks = reset_ticks(rollout.record) if resets else ()
        self._reset_times = [tick / rollout.record.control_hz for tick in ticks]

    @property
    def seen(self) -> Flags:
        """Known cells of the map, free or hit (rows, cols)."""
        return np.asarray(self.map.seen_free | self.map.occupied)

    def advance(self, at: float) -> None:
        """Insert all scans up to a time [s]."""
        while self._reset_times and self._reset_times[0] <= at + 1e-9:
            reset_at = self._reset_times.pop(0)
            self._enter_until(reset_at)
            self._reset(reset_at)
        self._enter_until(at)

    def _enter_until(self, at: float) -> None:
        last = int(np.searchsorted(self._times, at + 1e-9, side="right"))
        for k in range(self._entered, last):
            self._enter(k)
        self._entered = max(self._entered, last)

    def _reset(self, at: float) -> None:
        """Reset the map to the latest scans, as the robot did in the same control period, after the scan."""
        record = self._rollout.record
        here = self._estimate(self._timeline.row(at))[:2]
        self.map = self.map.reset_around(here, turning_room(record.robot.radius), record.task.goal)
        recent = math.ceil(RECENT * self.lidar.rate)
        for k in range(max(0, self._entered - recent), self._entered):
            self._insert(k)

    def _empty_map(self, pose: Pose) -> OccupancyMap:
        record = self._rollout.record
        moving = record.perception is not None and record.perception.kind == "lidar"
        horizon = horizon_of(tracks_movers=moving)
        seen = OccupancyMap(self.lidar, MAP_CELL, pose[:2], horizon, goal=record.task.goal, moving=moving)
        movers = np.column_stack((self._rollout.movers[0], [mover.radius for mover in record.world.movers]))
        room = turning_room(record.robot.radius)
        seen.mark_free(pose[:2], room, start_ground(record.world, pose[:2], room, movers))
        return seen

    def _insert(self, k: int) -> None:
        row, ranges = int(self._rollout.scan_rows[k]), ranges_of(self._rollout.scans[k])
        self.map.insert(self._estimate(row), ranges, self._of_movers(row, ranges))

    def _enter(self, k: int) -> None:
        self._insert(k)
        if self._detections:
            meet(self._rollout, k, self.met)

    def _of_movers(self, row: int, ranges: Floats) -> Flags | None:
        """Return which beams of a scan hit tracked movers, omitted from the map (beams,); None without such movers."""
        tracks = self._rollout.tracks
        movers = tracks[slice(*np.searchsorted(tracks[:, 0], (row, row + 1)))].astype(np.float64)
        if not len(movers):
            return None
        points = self.map.endpoints(self._estimate(row), ranges)
        away = np.hypot(*(points[:, None] - movers[:, 2:4]).transpose(2, 0, 1)) - movers[:, 6]
        return np.asarray((away <= SKIN).any(axis=1))  # NaN for beams without a hit

    def _estimate(self, row: int) -> Pose:
        poses = estimates_of(self._rollout)
        x, y, yaw = poses[row].tolist()
        return x, y, yaw

    def drift(self, at: float) -> Floats:
        """Return the transform from the world to the robot's map (4,): cosine and sine of a rotation, then x and y [m]."""
        row = self._timeline.row(at)
        x, y, turn = relative_frame(self._rollout.pose[[row]], np.array([self._estimate(row)]))[0].tolist()
        return np.array([math.cos(turn), math.sin(turn), x, y])


def world_points(points: Floats, drift: Floats) -> Floats:
    """Transform points of the robot's map to the world (N, 2) [m]."""
    cos, sin, x, y = drift.tolist()
    return np.asarray((points - (x, y)) @ np.array([[cos, -sin], [sin, cos]]), dtype=np.float64)


def enclosed(cylinders: Floats) -> Flags:
    """Return which of the cylinders (N, 4) lie within another (N,); of equal ones, all but the first."""
    order = np.argsort(-cylinders[:, 2], kind="stable")
    x, y, radius = cylinders[order, :3].T
    inside = np.zeros(len(order), dtype=np.bool_)
    for k, number in enumerate(order):
        apart = (x[:k] - x[k]) ** 2 + (y[:k] - y[k]) ** 2
        inside[number] = (apart <= (radius[:k] - radius[k]) ** 2).any()
    return inside
