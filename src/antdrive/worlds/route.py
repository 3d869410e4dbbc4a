"""Routes, and the rule that joins a task's start and goal to the grid.

Planning and all checks share the rule. A start or a goal need not lie at the centre of a free cell. A straight lead, at
most `end_reach` long, or `LEAD` for a footprint, joins it to a free cell nearby. If the start has less clearance than paths
keep, only its lead may be as close to obstacles as the start. If the goal has less clearance, or plans keep a footprint clear,
the path may end anywhere within the goal tolerance. The line of an any-angle planner is at most `DETOUR` longer than its path of
cells.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.plane import arc_lengths
from antdrive.base.types import Floats

ROUNDING = 1e-9  # tolerance of an arc length [m]
DETOUR = 3.0  # largest excess of an any-angle planner's line over its path of cells [cells]
LEAD = 0.75  # farthest entrance of a footprint from its start [m]
NEAR = 1.5  # largest distance of a route's end from a start or goal that it reaches [cells]


def cells_beside(inflate: float, cell: float) -> int:
    """Return the largest distance from an end to its grid cell, in rows and in columns.

    A farther cell would need a planned lead.
    """
    return max(3, math.ceil(inflate / cell) + 1)


def end_reach(inflate: float, cell: float) -> float:
    """Return the largest distance from an end to the centre of its grid cell [m]."""
    return math.sqrt(2.0) * (cells_beside(inflate, cell) + 0.5) * cell


def short_of_goal(tolerance: float, cell: float) -> float:
    """Return how far from a goal without room a route may end [m]."""
    return max(tolerance, NEAR * cell)


def longest_line(cost: float, leads: float, cell: float) -> float:
    """Return the largest length of an any-angle line for a path of cells [m]."""
    return cost + leads + DETOUR * cell


@dataclass(frozen=True, eq=False)
class Route:
    """A polyline in world coordinates for the robot to follow.

    Attributes:
        xy: the points (N, 2), N >= 2, read-only [m]; consecutive duplicates are removed
        curvature: curvature of the exact curve from each point to the next (N,) [1/m]; None: unknown
        kind: how the plan was smoothed
        note: why the requested smoothing was not applied; empty if it was
        turns: turn on the spot at each point (N,) [rad], counter-clockwise, 0 at the end; None: the robot may cut corners
        backwards_until: arc length up to which the robot drives backwards, that of a point [m]; only with turns

    Raises:
        FieldError: points are not finite, not of shape (N, 2) or all equal, the length of curvature or turns differs, a turn is
            a full one or more, or the robot drives backwards up to no point.
    """

    xy: Floats
    curvature: Floats | None = None
    kind: str = "none"
    note: str = ""
    turns: Floats | None = None
    backwards_until: float = 0.0

    def __post_init__(self) -> None:
        xy = np.array(self.xy, dtype=np.float64)
        if xy.ndim != 2 or xy.shape[1] != 2 or not np.isfinite(xy).all():
            raise FieldError("xy", f"must be finite numbers of shape (N, 2), got shape {xy.shape}")
        moves_on = (xy[1:] != xy[:-1]).any(axis=1)
        distinct = moves_on.all()
        for key in ("curvature", "turns"):
            if getattr(self, key) is None:
                continue
            values = np.array(getattr(self, key), dtype=np.float64)
            if values.shape != xy.shape[:1] or not np.isfinite(values).all():
                raise FieldError(key, f"must be {len(xy)} finite numbers, got shape {values.shape}")
            # The last of equal points has the next segment's curvature, and the whole turn.
            values = values if distinct else values[np.append(moves_on, True)]
            values.setflags(write=False)
            object.__setattr__(self, key, values)
        xy = np.ascontiguousarray(xy if distinct else xy[np.insert(moves_on, 0, True)])
        if len(xy) < 2:
            raise FieldError("xy", "must have at least two different points")
        xy.setflags(write=False)
        object.__setattr__(self, "xy", xy)
        if self.turns is not None and np.abs(self.turns).max() >= 2 * math.pi:
            raise FieldError("turns", f"must be less than a full turn, got {np.abs(self.turns).max():g}")
        if self.backwards_until:
            nearest = self.arc[np.abs(self.arc - self.backwards_until).argmin()].item()
            if self.turns is None or not abs(nearest - self.backwards_until) <= ROUNDING:
                raise FieldError(
                    "backwards_until",
                    f"must be the arc length of a point of a route with turns, got {self.backwards_until:g}",
                )
            object.__setattr__(self, "backwards_until", nearest)

    @functools.cached_property
    def arc(self) -> Floats:
        """Arc length at each point, shape (N,) [m], from 0."""
        return arc_lengths(self.xy)

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(self.arc[-1])

    @property
    def facing(self) -> Floats:
        """Heading of a robot on the segment after each point but the last, (N - 1,) [rad]."""
        ahead = np.where(self.arc[:-1] < self.backwards_until, -1.0, 1.0)
        along = np.diff(self.xy, axis=0) * ahead[:, None]
        return np.arctan2(along[:, 1], along[:, 0])
