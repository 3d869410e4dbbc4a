"""Free headings, turns on the spot and straight sweeps of a convex outline.

Free headings are the slices of Lozano-Pérez (1983) at one point: each edge and each corner of the outline gives closed-form
bounds. Touching, within rounding, is not free.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.worlds.headings import _kernels_headings as kernels

TURN = 2 * math.pi


class Outline(NamedTuple):
    """A convex polygon offset outwards, in the frame of what it outlines: x ahead, y to the left.

    The origin, about which it turns, lies inside the offset polygon.

    Attributes:
        corners: the polygon's corners, counter-clockwise, K = 1 (a disc) or K >= 3 (K, 2) [m]
        reach: outward offset [m]
    """

    corners: Floats
    reach: float


def free_headings(x: float, y: float, outline: Outline, discs: Floats, bounds: npt.ArrayLike) -> Floats:
    """Return the intervals of heading at which the outline touches nothing, (N, 2) [rad].

    Sorted by start in [0, 2π); ends may exceed 2π. One row (0, 2π) if all headings are free. The ends of any other
    interval are not free.

    Args:
        x: position of the outline's origin [m]
        y: position of the outline's origin [m]
        outline: the outline
        discs: x, y and radius of each disc (M, 3) [m]
        bounds: the walls: xmin, ymin, xmax, ymax [m]
    """
    blocked = kernels.blocked_headings(
        x, y, outline.corners, outline.reach, discs, np.asarray(bounds, dtype=np.float64)
    )
    if not len(blocked):
        return np.array([[0.0, TURN]])
    starts, ends = blocked[np.argsort(blocked[:, 0])].T
    ends = np.maximum.accumulate(ends)
    lows = np.maximum(np.append(-TURN, ends[:-1]), ends[-1] - TURN)  # the last blocked interval may reach beyond 2π
    gaps = np.stack([lows, starts], axis=1)[lows < starts]
    gaps[gaps[:, 0] < 0] += TURN
    return np.asarray(gaps[np.argsort(gaps[:, 0])])


def turn_clear(
    x: float, y: float, yaw: float, turn: float, outline: Outline, discs: Floats, bounds: npt.ArrayLike
) -> bool:
    """Return whether the outline touches nothing on a whole turn on the spot.

    Args:
        x: position of the outline's origin [m]
        y: position of the outline's origin [m]
        yaw: heading before the turn [rad]
        turn: signed angle, counter-clockwise; 0 checks the heading alone [rad]
        outline: the outline
        discs: x, y and radius of each disc (M, 3) [m]
        bounds: the walls: xmin, ymin, xmax, ymax [m]
    """
    walls = np.asarray(bounds, dtype=np.float64)
    return bool(kernels.turn_clear(x, y, yaw, turn, outline.corners, outline.reach, discs, walls))


def sweep_clearance(
    x0: float, y0: float, x1: float, y1: float, yaw: float, outline: Outline, discs: Floats, bounds: npt.ArrayLike
) -> float:
    """Return the distance from the outline, swept along a line at constant heading, to the nearest disc or wall [m].

    0 or negative if it touches; the magnitude is then a bound on the depth, not the exact depth.

    Args:
        x0: start of the outline's origin [m]
        y0: start of the outline's origin [m]
        x1: end of the outline's origin [m]
        y1: end of the outline's origin [m]
        yaw: heading, independent of the line's direction [rad]
        outline: the outline
        discs: x, y and radius of each disc (M, 3) [m]
        bounds: the walls: xmin, ymin, xmax, ymax [m]
    """
    walls = np.asarray(bounds, dtype=np.float64)
    return float(kernels.sweep_clearance(x0, y0, x1, y1, yaw, outline.corners, outline.reach, discs, walls))
