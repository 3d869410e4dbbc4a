"""The polyline that a robot is asked to follow, and how far the ends of a path on a grid may lie from a task's.

The rule for ends is one for planning and for every check. A start or a goal need not lie at the centre of a free cell. The
robot gets to a free cell near it on a straight line, no longer than `end_reach`. Where the start has less room than paths
keep, that line, and nothing else of the path, may come as close to an obstacle as the start itself. Where the goal has less
room, the path ends within the goal's tolerance of it. The line of a planner that is not bound to the grid has a path of cells
beside it, which is as long but for `DETOUR`.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.plane import arc_lengths
from antdrive.base.types import Floats

DETOUR = 3.0  # cells by which the line of a planner that is not bound to the grid may be longer than its cells


def cells_beside(inflate: float, cell: float) -> int:
    """How many rows and columns away from its own cell an end may be joined to the grid.

    Getting to farther cells would take a plan of its own.
    """
    return max(3, math.ceil(inflate / cell) + 1)


def end_reach(inflate: float, cell: float) -> float:
    """The farthest that the centre of such a cell can be from the end [m]."""
    return math.sqrt(2.0) * (cells_beside(inflate, cell) + 0.5) * cell


def longest_line(cost: float, leads: float, cell: float) -> float:
    """The greatest length of a line beside a path of cells [m]."""
    return cost + leads + DETOUR * cell


@dataclass(frozen=True, eq=False)
class Route:
    """The polyline, in world coordinates, that a robot is asked to follow.

    Attributes:
        xy: the points (N, 2), N >= 2, read-only [m]; of equal neighbours only one is kept
        curvature: of the exact curve from each point to the next (N,) [1/m]; None: not known
        kind: how the plan was smoothed
        note: why the plan was not smoothed as asked; empty where it was

    Raises:
        FieldError: points that are not finite, not of shape (N, 2) or all equal, or a curvature of another length.
    """

    xy: Floats
    curvature: Floats | None = None
    kind: str = "none"
    note: str = ""

    def __post_init__(self) -> None:
        xy = np.array(self.xy, dtype=np.float64)
        if xy.ndim != 2 or xy.shape[1] != 2 or not np.isfinite(xy).all():
            raise FieldError("xy", f"must be finite numbers of shape (N, 2), got shape {xy.shape}")
        moves_on = np.any(np.diff(xy, axis=0) != 0.0, axis=1)
        if self.curvature is not None:
            curvature = np.array(self.curvature, dtype=np.float64)
            if curvature.shape != xy.shape[:1] or not np.isfinite(curvature).all():
                raise FieldError("curvature", f"must be {len(xy)} finite numbers, got shape {curvature.shape}")
            curvature = curvature[np.append(moves_on, True)]  # the last of equal points holds the next segment's
            curvature.setflags(write=False)
            object.__setattr__(self, "curvature", curvature)
        xy = np.ascontiguousarray(xy[np.insert(moves_on, 0, True)])
        if len(xy) < 2:
            raise FieldError("xy", "a route needs at least two different points")
        xy.setflags(write=False)
        object.__setattr__(self, "xy", xy)

    @functools.cached_property
    def arc(self) -> Floats:
        """The length along the route at each point, shape (N,) [m], from 0."""
        return arc_lengths(self.xy)

    @property
    def length(self) -> float:
        """The whole length [m]."""
        return float(self.arc[-1])
