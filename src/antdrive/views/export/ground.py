"""The ground as occupancy grids: what the planner was given, or what a robot without a map had seen at some moments."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import in_map
from antdrive.base.types import Pose
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.world import World

FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # as ROS has them
PERIOD = 1.0  # between two maps of a robot that has none at first [s]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class GroundGrid:
    """An occupancy grid.

    Attributes:
        at: when it was known [s]
        cell: side of a cell [m]
        origin: the pose of the lower left corner of cell (0, 0) in the grid's frame: x, y [m], yaw [rad]
        cells: FREE, OCCUPIED or UNKNOWN (rows, cols)
    """

    at: float
    cell: float
    origin: Pose
    cells: npt.NDArray[np.int8]


def planned_ground(rollout: Rollout) -> GroundGrid:
    """The grid that the drive was planned on, in the frame of the map: free where the robot's centre may be."""
    record = rollout.record
    free = free_cells(record.task.world, record.cell, record.inflate)
    x0, y0, _, _ = record.task.world.bounds
    x, y, yaw = in_map(record.task.frame, [(x0, y0, 0.0)])[0].tolist()
    return GroundGrid(float(rollout.t[0]), record.cell, (x, y, yaw), np.where(free, FREE, OCCUPIED).astype(np.int8))


def free_cells(world: World, cell: float, inflate: float) -> Mask:
    """The cells that `antdrive.worlds.grid.rasterise` has as free (rows, cols), without loading compiled code for it."""
    xmin, ymin, xmax, ymax = world.bounds
    cols, rows = (max(1, math.ceil(side / cell - 1e-9)) for side in world.size)
    x, y = xmin + cell / 2 + np.arange(cols) * cell, ymin + cell / 2 + np.arange(rows) * cell
    within = [np.minimum(at - low, high - at) > inflate for at, low, high in ((x, xmin, xmax), (y, ymin, ymax))]
    free = np.logical_and.outer(within[1], within[0])
    radii = world.discs[:, 2] + inflate
    # One more cell on each side than needed: rounding must leave out no cell at the edge.
    first = np.floor((world.discs[:, :2] - radii[:, None] - (x[0], y[0])) / cell).astype(int) - 1
    last = np.ceil((world.discs[:, :2] + radii[:, None] - (x[0], y[0])) / cell).astype(int) + 2
    (left, low), (right, high) = np.maximum(first, 0).T.tolist(), np.maximum(last, 0).T.tolist()
    for i, (cx, cy, _) in enumerate(world.discs.tolist()):
        across, along = x[left[i] : right[i]] - cx, y[low[i] : high[i]] - cy
        apart2 = across * across + (along * along)[:, None]
        free[low[i] : high[i], left[i] : right[i]] &= apart2 > radii[i] * radii[i]
    return np.asarray(free)


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
