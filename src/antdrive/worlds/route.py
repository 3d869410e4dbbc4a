"""The polyline that a robot is asked to follow."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.plane import arc_lengths
from antdrive.base.types import Floats


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
