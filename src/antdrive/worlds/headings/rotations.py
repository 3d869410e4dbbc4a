"""Free headings, turns on the spot and straight sweeps of a convex outline.

Free headings are the slices of Lozano-Pérez (1983) at one point: each edge and each corner of the outline gives closed-form
bounds. Touching, within rounding, is not free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.worlds.headings import _kernels_headings as kernels


class Outline(NamedTuple):
    """A convex polygon offset outwards, in the frame of what it outlines: x ahead, y to the left.

    The origin, about which it turns, lies inside the offset polygon.

    Attributes:
        corners: the polygon's corners, counter-clockwise, K = 1 (a disc) or K >= 3 (K, 2) [m]
        reach: outward offset [m]
    """

    corners: Floats
    reach: float


def turn_clear(
    x: float, y: float, yaw: float, turn: float, outline: Outline, discs: Floats, bounds: npt.ArrayLike
) -> bool:
    """Return whether the outline touches nothing on a whole turn on the spot at (x, y) [m].

    The signed angle `turn` begins at the heading `yaw`; 0 checks the heading alone [rad]. `discs` (M, 3) are x, y and radius,
    `bounds` the walls: xmin, ymin, xmax, ymax [m].
    """
    walls = np.asarray(bounds, dtype=np.float64)
    return bool(kernels.turn_clear(x, y, yaw, turn, outline.corners, outline.reach, discs, walls))


def sweep_clearance(
    x0: float, y0: float, x1: float, y1: float, yaw: float, outline: Outline, discs: Floats, bounds: npt.ArrayLike
) -> float:
    """Return the distance from the outline, swept along a line at constant heading, to the nearest disc or wall [m].

    0 or negative if it touches; the magnitude is then a bound on the depth, not the exact depth. The outline's origin goes from
    (x0, y0) to (x1, y1) [m]. Its heading `yaw` is independent of that line [rad]. `discs` and `bounds` are as for `turn_clear`.
    """
    walls = np.asarray(bounds, dtype=np.float64)
    return float(kernels.sweep_clearance(x0, y0, x1, y1, yaw, outline.corners, outline.reach, discs, walls))
