"""Angles, polylines and frames in the plane, in numpy only, so that logs load without the compiler."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats, Pose

Angle = TypeVar("Angle", float, Floats)
HUGE = 1e7  # larger coordinates are printed with an exponent [m]


def wrap_angle(angle: Angle) -> Angle:
    """Wrap an angle into [-pi, pi).

    Args:
        angle: an angle or an array of angles [rad]
    """
    return (angle + math.pi) % (2 * math.pi) - math.pi


def segment_lengths(xy: npt.ArrayLike) -> Floats:
    """Return the length of each segment of a polyline, shape (N - 1,)."""
    points = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    steps = points[1:] - points[:-1]
    return np.asarray(np.hypot(steps[:, 0], steps[:, 1]))


def arc_lengths(xy: npt.ArrayLike) -> Floats:
    """Return the arc length at each point of a polyline, shape (N,), from 0.

    Args:
        xy: the polyline's points (N, 2)
    """
    return np.concatenate(([0.0], np.cumsum(segment_lengths(xy))))


def polyline_length(xy: npt.ArrayLike) -> float:
    """Return the length of a polyline, in the unit of its points.

    Args:
        xy: the polyline's points (N, 2)
    """
    return float(segment_lengths(xy).sum())


def world_to_map(frame: Pose, points: npt.ArrayLike) -> Floats:
    """Transform points (N, 2) or poses (N, 3) from the world's frame to its map's; bit-identical if the frames agree."""
    out = np.array(points, dtype=np.float64)
    x, y, yaw = frame
    if (x, y, yaw) == (0.0, 0.0, 0.0):
        return out
    cosine, sine = math.cos(yaw), math.sin(yaw)
    out[..., :2] = out[..., :2] @ np.array([[cosine, sine], [-sine, cosine]]) + (x, y)
    if out.shape[-1] > 2:
        out[..., 2] = wrap_angle(out[..., 2] + yaw)
    return out


def map_to_world(frame: Pose, points: npt.ArrayLike) -> Floats:
    """Transform points (N, 2) or poses (N, 3) from the map's frame to the world's: the inverse of `world_to_map`."""
    x, y, yaw = frame
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return world_to_map((-x * cosine - y * sine, x * sine - y * cosine, -yaw), points)


def format_number(value: float, decimals: int = 6) -> str:
    """Format a number as a person writes it: rounded, without trailing zeros; with an exponent if it is huge.

    Args:
        value: the number
        decimals: largest number of decimals
    """
    text = f"{round(float(value), decimals) + 0.0:.12g}"  # the sum has no negative zero
    return f"{value:.3g}" if "e+" in text else text


def format_numbers(values: Iterable[float]) -> str:
    """Format bounds, a pose or a position as a list: [0.15, 0, 3.9, 2.9]."""
    return f"[{', '.join(map(format_number, values))}]"


def disc_text(x: float, y: float, radius: float) -> str:
    """Return the place and size of a disc as written in a file: "at (2, 1.5) with radius 0.3"."""
    return f"at {_pair((x, y), None)} with radius {format_number(radius)}"


def format_position(frame: Pose, x: float, y: float, digits: int | None = 2) -> str:
    """Format a position of a world; with its map position if the world has a map frame.

    Args:
        frame: pose of the world's frame in its map
        x: position [m]
        y: position [m]
        digits: number of decimals of a computed position; None: as a person writes it
    """
    here = _pair((x, y), digits)
    if not any(frame):
        return here
    return f"{here} in the world, {_pair(world_to_map(frame, [(x, y)])[0].tolist(), digits)} in its map"


def _pair(point: Iterable[float], digits: int | None) -> str:
    one, other = (
        format_number(value) if digits is None or abs(value) > HUGE else f"{round(value, digits) + 0.0:.{digits}f}"
        for value in point
    )
    return f"({one}, {other})"


def relative_frame(inner: Floats, outer: Floats) -> Floats:
    """Return the poses (N, 3) of the inner frame in the outer one, from the poses of one body in both [m, rad]."""
    turn = outer[:, 2] - inner[:, 2]
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = inner[:, 0], inner[:, 1]
    return np.column_stack([outer[:, 0] - (cos * x - sin * y), outer[:, 1] - (sin * x + cos * y), turn])


def transform_points(points: Floats, frames: Floats) -> Floats:
    """Transform points (N, 2) [m] from frames (N, 3) to the frame around them."""
    cos, sin = np.cos(frames[:, 2]), np.sin(frames[:, 2])
    x, y = points[:, 0], points[:, 1]
    return frames[:, :2] + np.column_stack([cos * x - sin * y, sin * x + cos * y])
