"""Mover tracking of a drive, with its log."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Pose
from antdrive.robots.lidar import Lidar
from antdrive.sim.driving.parts import Drive, table_logged
from antdrive.sim.sensing.mapping import OccupancyMap
from antdrive.sim.sensing.tracking import Ground, MappedGround, MoverTracker, TrackedMovers, ends

MAP_CELL = 0.05  # side of the map's cells [m]
PERSON = 0.5  # width of a person [m]


class MoverTracking:
    """Mover tracker of a drive, with its log.

    Attributes:
        tracker: detects and tracks movers
        tick: the control period of the last scan
        hz: control periods per second
        sight: area covered by its beams within `reach` [m^2]
        reach: range up to which beams lie no farther apart than a map cell [m]
    """

    def __init__(self, lidar: Lidar, hz: int, pose_xy: float = 0.0, pose_yaw: float = 0.0) -> None:
        lidar = lidar.at(hz)
        self.tracker, self.tick = MoverTracker(lidar, pose_xy, pose_yaw), 0
        self.sight, self.reach = 0.0, min(lidar.max_range, MAP_CELL / lidar.spacing)
        self._last: tuple[Pose, Floats, npt.NDArray[np.bool_]] | None = None
        self._known_corners: Floats | None = None
        self.hz, self._spacing, self._lidar = hz, lidar.spacing, lidar
        self._settle = max(2, round(self.tracker.rules[False].settle * lidar.rate))
        self._log: list[tuple[int, TrackedMovers]] = []

    def read(self, ground: Ground, pose: Pose, ranges: Floats, tick: int) -> npt.NDArray[np.bool_]:
        """Update the tracks with a scan; return which beams hit tracked movers (beams,)."""
        theirs = self.tracker.update(ground, pose, ranges, tick / self.hz)
        self.tick = tick
        crossed = np.clip(ranges, 0.0, self.reach)
        self.sight = float(0.5 * self._spacing * (crossed * crossed).sum())
        self._log.append((tick, self.tracker.movers()))
        self._last, self._known_corners = (pose, ranges, theirs), None
        return theirs

    @property
    def corners(self) -> Floats:
        """Where ground that may hide people from the last scan begins, movers apart (N, 2) [m].

        These are ends of surfaces at least as wide as a person, and with as much space behind.
        """
        if self._known_corners is None:
            self._known_corners = self._corners(*self._last) if self._last else np.empty((0, 2))
        return self._known_corners

    def _corners(self, pose: Pose, ranges: Floats, theirs: npt.NDArray[np.bool_]) -> Floats:
        """Return the corners that a scan shows (N, 2) [m]."""
        far = np.clip(ranges, 0.0, self._lidar.max_range)
        steps = np.diff(far)
        jumps = np.flatnonzero(np.abs(steps) > PERSON)
        first, last = np.append(0, jumps + 1), np.append(jumps, len(far) - 1)  # beams of each surface
        begins, finishes = (ends(self._lidar, pose, far, beams) for beams in (first, last))
        wide = np.hypot(*(finishes - begins).T) >= PERSON
        nearer = np.where(steps[jumps] > 0, jumps, jumps + 1)
        hides = np.where(steps[jumps] > 0, wide[:-1], wide[1:]) & np.isfinite(ranges[nearer]) & ~theirs[nearer]
        return ends(self._lidar, pose, ranges, nearer[hides])

    def ground(self, seen: OccupancyMap) -> MappedGround:
        """Return the ground of a robot that makes its own map, before the map takes the scan."""
        return MappedGround(seen, self._settle)

    def standing(self, seen: OccupancyMap, pose: Pose, ranges: Floats, tick: int) -> Floats:
        """Return an unprocessed scan without hits on possible movers (beams,) [m]: those ranges are infinite."""
        ground = self.ground(seen)
        return np.where(self.tracker.suspected(ground, pose, ranges, tick / self.hz), np.inf, ranges)

    def logged(self, log: Drive, per_tick: int) -> dict[str, Any]:
        """Return the array `tracks` of a log (K, 7)."""
        lines = (
            (tick, np.column_stack((movers.numbers, movers.positions, movers.velocities, movers.radii)))
            for tick, movers in self._log
        )
        return {"tracks": table_logged(lines, 7, log, per_tick)}
