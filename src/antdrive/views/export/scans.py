"""The scans of a drive: those in its log, or what the robot's lidar would have measured where the log holds none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.scans import ranges_of
from antdrive.views.export.scanning import exact_scans

LOGGED = "taken by the drive"
TAKEN_AGAIN = "taken at export, without noise, from the logged poses; the log holds no scans"
LEFT_OUT = "left out"
NONE = "none; the robot has no lidar"


class Scans(NamedTuple):
    """The scans of a drive.

    Attributes:
        source: where they come from, in words
        rows: of the log, at which they were taken (S,)
        ranges: what was measured (S, beams) [m]; infinite where nothing was in range, minus infinity where something was
            too near
    """

    source: str
    rows: npt.NDArray[np.int64]
    ranges: npt.NDArray[np.floating]

    @classmethod
    def of(cls, rollout: Rollout, *, again: bool = True) -> Scans:
        """The scans of a drive."""
        if len(rollout.scans):
            return cls(LOGGED, rollout.scan_rows.astype(np.int64), ranges_of(rollout.scans))
        if rollout.record.robot.lidar is not None and again:
            return cls(TAKEN_AGAIN, *_taken_again(rollout))
        source = NONE if rollout.record.robot.lidar is None else LEFT_OUT
        return cls(source, np.empty(0, dtype=np.int64), np.empty((0, 0)))


def _taken_again(rollout: Rollout) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float32]]:
    """The rows (S,) in which the lidar is due, and what it measures without noise from the logged poses (S, beams) [m]."""
    record, lidar = rollout.record, rollout.record.robot.lidar
    assert lidar is not None
    per_tick = max(1, record.physics_hz // record.control_hz)
    ticks = range(-(-len(rollout.t) // per_tick))
    rows = np.array([tick * per_tick for tick in ticks if lidar.due(tick, record.control_hz)], dtype=np.int64)
    return rows, exact_scans(lidar, record.world, rollout.pose[rows], rollout.movers[rows])
