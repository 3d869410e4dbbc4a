"""Exact distances from a robot's footprint to discs and walls."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.robots import _kernels_footprint
from antdrive.robots.spec import Footprint
from antdrive.worlds import World


def footprint_clearance(world: World, footprint: Footprint, poses: npt.ArrayLike) -> Floats:
    """Distance from the footprint at each pose to the nearest disc surface or wall, shape (N,) [m].

    It is negative where the footprint overlaps a disc or a wall. Its size is then a bound on the depth of the
    overlap, not the exact depth.

    Args:
        world: the discs and walls
        footprint: the robot's footprint
        poses: x, y and yaw of the robot's centre, shape (N, 3) [m, rad]
    """
    rows = np.ascontiguousarray(poses, dtype=np.float64).reshape(-1, 3)
    out = np.empty(len(rows))
    bounds = np.asarray(world.bounds, dtype=np.float64)
    _kernels_footprint.footprint_clearances(rows, *shape_of(footprint), world.discs, bounds, out)
    return out


def shape_of(footprint: Footprint) -> tuple[Floats, Floats]:
    """A footprint as kernels take it: half length, half width and rounding (3,), and a polygon's corners (K, 2) [m]."""
    shape = np.array([footprint.half_length, footprint.half_width, footprint.rounding])
    return shape, np.array(footprint.corners, dtype=np.float64).reshape(-1, 2)
