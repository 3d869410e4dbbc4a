"""The frame of the estimated poses, in which a robot without a map has its map and its tracks, laid in the world."""

from __future__ import annotations

import numpy as np

from antdrive.base.types import Floats


def frame_at(inner: Floats, outer: Floats) -> Floats:
    """Where a frame lies in another one, if something has a pose in each: x, y and yaw of its origin (N, 3) [m, rad]."""
    turn = outer[:, 2] - inner[:, 2]
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = inner[:, 0], inner[:, 1]
    return np.column_stack([outer[:, 0] - (cos * x - sin * y), outer[:, 1] - (sin * x + cos * y), turn])


def laid(points: Floats, frames: Floats) -> Floats:
    """Where points of frames lie in the frame around them (N, 2) [m]."""
    cos, sin = np.cos(frames[:, 2]), np.sin(frames[:, 2])
    x, y = points[:, 0], points[:, 1]
    return frames[:, :2] + np.column_stack([cos * x - sin * y, sin * x + cos * y])
