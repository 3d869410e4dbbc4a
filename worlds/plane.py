"""Angles and polylines in the plane. Needs numpy alone: logs are read without the compiler."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from antdrive.worlds.types import Floats

Angle = TypeVar("Angle", float, Floats)


def wrap_angle(angle: Angle) -> Angle:
    """The same direction as an angle from -pi up to but not including pi.

    Args:
        angle: one angle or an array of them [rad]
    """
    return (angle + math.pi) % (2 * math.pi) - math.pi


def segment_lengths(xy: npt.ArrayLike) -> Floats:
    """The length of each segment of a polyline, shape (N - 1,).

    Args:
        xy: the polyline's points (N, 2)
    """
    steps = np.diff(np.asarray(xy, dtype=np.float64).reshape(-1, 2), axis=0)
    return np.asarray(np.hypot(*steps.T))


def arc_lengths(xy: npt.ArrayLike) -> Floats:
    """The length along a polyline at each of its points, shape (N,), from 0.

    Args:
        xy: the polyline's points (N, 2)
    """
    return np.concatenate(([0.0], np.cumsum(segment_lengths(xy))))


def polyline_length(xy: npt.ArrayLike) -> float:
    """The whole length of a polyline, in the unit of its points.

    Args:
        xy: the polyline's points (N, 2)
    """
    return float(segment_lengths(xy).sum())
