"""Exact distances to discs and walls.

Clearance is measured to the nearest disc surface or wall, in metres, and is negative inside a disc or beyond a wall.
A robot of radius R swept along a segment touches something when the segment's clearance is at most R.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.worlds import _kernels
from antdrive.worlds.world import Floats, World


def point_clearance(world: World, points: npt.ArrayLike) -> Floats:
    """Clearance of each point, shape (N,) for points of shape (N, 2) [m]."""
    xy = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 2)
    out = np.empty(len(xy))
    _kernels.point_clearances(xy, world.discs, np.asarray(world.bounds, dtype=np.float64), out)
    return out


def segment_clearance(world: World, starts: npt.ArrayLike, ends: npt.ArrayLike) -> Floats:
    """Clearance of each straight segment, shape (N,) for ends of shape (N, 2) [m]."""
    a = np.ascontiguousarray(starts, dtype=np.float64).reshape(-1, 2)
    b = np.ascontiguousarray(ends, dtype=np.float64).reshape(-1, 2)
    out = np.empty(len(a))
    _kernels.segment_clearances(a, b, world.discs, np.asarray(world.bounds, dtype=np.float64), out)
    return out


def swept_clearance(world: World, starts: npt.ArrayLike, ends: npt.ArrayLike, radius: float) -> Floats:
    """Gap left by a disc of `radius` swept along each segment, shape (N,) [m]; it touches where this is <= 0."""
    return segment_clearance(world, starts, ends) - radius


def polyline_clearance(world: World, xy: npt.ArrayLike) -> float:
    """Clearance of a whole polyline of shape (N, 2), N >= 1 [m]."""
    line = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    if len(line) == 1:
        return float(point_clearance(world, line)[0])
    return float(segment_clearance(world, line[:-1], line[1:]).min())
