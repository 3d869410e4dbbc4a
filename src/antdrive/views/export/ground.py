"""The ground as occupancy grids: what the planner was given, or what a robot without a map had seen at some moments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import in_map
from antdrive.base.types import Pose
from antdrive.sim.log.rollout import Rollout

FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # as ROS has them
PERIOD = 1.0  # between two maps of a robot that has none at first [s]


@dataclass(frozen=True, eq=False)
class GroundGrid:
    """An occupancy grid."""

    at: float  # when it was known [s]
    cell: float  # side of a cell [m]
    origin: Pose  # the pose of the lower left corner of cell (0, 0) in the grid's frame: x, y [m], yaw [rad]
    cells: npt.NDArray[np.int8]  # FREE, OCCUPIED or UNKNOWN (rows, cols)


def planned_ground(rollout: Rollout) -> GroundGrid:
    """The grid that the drive was planned on, in the frame of the map: free where the robot's centre may be."""
    from antdrive.worlds.grid import rasterise

    record = rollout.record
    free = rasterise(record.task.world, record.cell, record.inflate).free
    x0, y0, _, _ = record.task.world.bounds
    x, y, yaw = in_map(record.task.frame, [(x0, y0, 0.0)])[0].tolist()
    return GroundGrid(float(rollout.t[0]), record.cell, (x, y, yaw), np.where(free, FREE, OCCUPIED).astype(np.int8))


def known_ground(rollout: Rollout) -> Iterator[GroundGrid]:
    """What a robot without a map had seen, in the frame of its estimated poses: at first, every second, and at last."""
    from antdrive.views.recollection import Recollection

    seen = Recollection(rollout, forgetting=True, meeting=False)
    end = float(rollout.t[-1])
    times = [*np.arange(float(rollout.t[0]), end, PERIOD).tolist(), end]
    for at in times:
        seen.advance(at)
        occupied, free = seen.map.occupied, seen.map.seen_free
        rows, cols = (np.flatnonzero((occupied | free).any(axis=axis)) for axis in (1, 0))
        part = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
        cells = np.where(occupied[part], OCCUPIED, np.where(free[part], FREE, UNKNOWN)).astype(np.int8)
        x, y, cell = *seen.map.origin, seen.map.cell
        yield GroundGrid(at, cell, (x + cols[0] * cell, y + rows[0] * cell, 0.0), cells)
