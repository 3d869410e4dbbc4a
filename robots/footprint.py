"""Exact distances from a robot's footprint to discs and walls."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.robots import _kernels
from antdrive.robots.spec import Footprint
from antdrive.worlds import Floats, World


def footprint_clearance(world: World, footprint: Footprint, poses: npt.ArrayLike) -> Floats:
    """Distance from the footprint at each pose (N, 3) to the nearest disc surface or wall, shape (N,) [m].

    It is negative where the footprint overlaps a disc or a wall; then its size is a bound on the depth, not the exact depth.
    """
    rows = np.ascontiguousarray(poses, dtype=np.float64).reshape(-1, 3)
    shape = np.array([footprint.half_length, footprint.half_width, footprint.rounding])
    out = np.empty(len(rows))
    _kernels.footprint_clearances(rows, shape, world.discs, np.asarray(world.bounds, dtype=np.float64), out)
    return out
