"""Exact distances to discs and walls.

Clearance is the distance to the nearest disc surface or wall, in metres, negative inside a disc or beyond a wall.
A robot of radius R moving along a segment has contact if the segment's clearance is at most R.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.worlds import _kernels
from antdrive.worlds.world import World


def point_clearance(world: World, points: npt.ArrayLike) -> Floats:
    """Return the clearance of each of `points` (N, 2), shape (N,) [m]; movers do not count."""
    xy = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 2)
    out = np.empty(len(xy))
    _kernels.point_clearances(xy, world.discs, np.asarray(world.bounds, dtype=np.float64), out)
    return out


def segment_clearance(world: World, starts: npt.ArrayLike, ends: npt.ArrayLike) -> Floats:
    """Return the clearance of each straight segment from `starts` to `ends` (N, 2), shape (N,) [m]; movers do not count."""
    a = np.ascontiguousarray(starts, dtype=np.float64).reshape(-1, 2)
    b = np.ascontiguousarray(ends, dtype=np.float64).reshape(-1, 2)
    out = np.empty(len(a))
    _kernels.segment_clearances(a, b, world.discs, np.asarray(world.bounds, dtype=np.float64), out)
    return out


def polyline_clearance(world: World, xy: npt.ArrayLike) -> float:
    """Return the clearance of a polyline `xy` (N, 2), N >= 1 [m]; movers do not count."""
    line = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    if len(line) == 1:
        return float(point_clearance(world, line)[0])
    bounds = np.asarray(world.bounds, dtype=np.float64)
    return float(_kernels.polyline_clearance(np.ascontiguousarray(line), world.discs, bounds))
