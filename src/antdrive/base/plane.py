"""Angles, polylines and frames in the plane, in numpy only, so that logs load without the compiler."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats, Pose

Angle = TypeVar("Angle", float, Floats)
HUGE = 1e7  # larger coordinates are printed with an exponent [m]


def wrap_angle(angle: Angle) -> Angle:
    """Wrap an angle, or an array of angles, into [-pi, pi) [rad]."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def segment_lengths(xy: npt.ArrayLike) -> Floats:
    """Return the length of each segment of a polyline, shape (N - 1,)."""
    points = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    steps = points[1:] - points[:-1]
    return np.asarray(np.hypot(steps[:, 0], steps[:, 1]))


def arc_lengths(xy: npt.ArrayLike) -> Floats:
    """Return the arc length at each point of a polyline `xy` (N, 2), shape (N,), from 0."""
    return np.concatenate(([0.0], np.cumsum(segment_lengths(xy))))


def polyline_length(xy: npt.ArrayLike) -> float:
    """Return the length of a polyline `xy` (N, 2), in the unit of its points."""
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


def poses_at(moments: Floats, t: Floats, pose: Floats, beyond: float | None = None) -> Floats:
    """Return poses (T, 3) at times `t` (T,) interpolated at other times (N,), with unwrapped headings, shape (N, 3).

    Beyond the ends of `t` they are held, or all values are `beyond`.
    """
    turned = np.column_stack([pose[:, :2], np.unwrap(pose[:, 2])])
    return np.stack([np.interp(moments, t, column, beyond, beyond) for column in turned.T], axis=-1)


def end_in_world(frame: Pose, end: Any) -> Any:
    """Transform a start or a goal, or None, from the map's frame to the world's."""
    return tuple(map_to_world(frame, [end])[0].tolist()) if end is not None and any(frame) else end


def tidy(value: float) -> float:
    """Return a number without its rounding error: 3.9 for 3.9000000000000004; one with more than nine decimals as it is."""
    rounded = round(value, 9) + 0.0
    return rounded if abs(value - rounded) <= 1e-12 * max(1.0, abs(value)) else value


def format_number(value: float, decimals: int = 6) -> str:
    """Format a number as a person writes it: rounded, without trailing zeros; with an exponent if it is huge."""
    text = f"{round(float(value), decimals) + 0.0:.12g}"  # the sum has no negative zero
    return f"{value:.3g}" if "e+" in text else text


def format_fixed(value: float, decimals: int) -> str:
    """Format a measured number with this number of decimals; with an exponent if it is huge."""
    return f"{value:.3g}" if abs(value) > HUGE else f"{round(float(value), decimals) + 0.0:.{decimals}f}"


def format_numbers(values: Iterable[float]) -> str:
    """Format bounds or a pose as a list: [0.15, 0, 3.9, 2.9]."""
    return f"[{', '.join(map(format_number, values))}]"


def format_point(point: Iterable[float], decimals: int | None = None) -> str:
    """Format a position (2,) as a person writes it, (9.85, 5), or a measured one with this number of decimals."""
    one, other = (format_number(v) if decimals is None else format_fixed(v, decimals) for v in point)
    return f"({one}, {other})"


def format_disc(x: float, y: float, radius: float) -> str:
    """Format place and size of a disc as a person writes them: "at (2, 1.5) with radius 0.3"."""
    return f"at {format_point((x, y))} with radius {format_number(radius)}"


def format_position(frame: Pose, x: float, y: float, decimals: int | None = 2) -> str:
    """Format a position of a world as `format_point` does; with its map position if the world has a map frame."""
    here = format_point((x, y), decimals)
    if not any(frame):
        return here
    there = world_to_map(frame, [(x, y)])[0].tolist()
    return f"{here} in the world, {format_point(there, decimals)} in its map"


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
