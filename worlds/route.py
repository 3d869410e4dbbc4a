"""The line a robot is asked to follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antdrive.worlds.world import Floats


@dataclass(frozen=True, eq=False)
class Route:
    """The world-frame polyline a robot is asked to follow.

    Raises:
        ValueError: not of shape (N, 2) with N >= 2, not finite, or without length; curvature of another length.
    """

    xy: Floats  # (N, 2) [m], N >= 2, read-only, no two neighbours equal
    curvature: Floats | None = None  # (N,) of the exact line from each point on to the next [1/m]; None: not known
    kind: str = "none"  # how the line was made
    note: str = ""  # why it was not made as asked, if so

    def __post_init__(self) -> None:
        xy = np.array(self.xy, dtype=np.float64)
        if xy.ndim != 2 or xy.shape[1] != 2 or not np.isfinite(xy).all():
            raise ValueError(f"xy: must be finite numbers of shape (N, 2), got shape {xy.shape}")
        fresh = np.any(np.diff(xy, axis=0) != 0.0, axis=1)
        if self.curvature is not None:
            curvature = np.array(self.curvature, dtype=np.float64)
            if curvature.shape != xy.shape[:1] or not np.isfinite(curvature).all():
                raise ValueError(f"curvature: must be {len(xy)} finite numbers, got shape {curvature.shape}")
            curvature = curvature[np.append(fresh, True)]  # of equal points the last knows how the line goes on
            curvature.setflags(write=False)
            object.__setattr__(self, "curvature", curvature)
        xy = np.ascontiguousarray(xy[np.insert(fresh, 0, True)])
        if len(xy) < 2:
            raise ValueError("xy: a route needs at least two different points")
        xy.setflags(write=False)
        object.__setattr__(self, "xy", xy)

    @property
    def arc(self) -> Floats:
        """Length along the route at each point, shape (N,) [m], from 0."""
        steps = np.hypot(*np.diff(self.xy, axis=0).T)
        return np.concatenate(([0.0], np.cumsum(steps)))

    @property
    def length(self) -> float:
        """The whole length [m]."""
        return float(self.arc[-1])
