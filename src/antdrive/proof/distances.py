"""Closed-form distances from outlines at poses to discs, walls and other outlines, signed and exact.

They share no code with the compiled geometry of drives, so that each checks the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.types import Bounds, Floats, Point
from antdrive.robots.spec import Footprint
from antdrive.worlds.limits import MAX_NEAR_DISTANCES
from antdrive.worlds.world import World

BLOCK = 60  # rows that share one search for the nearest discs
ROUNDED = 1e-9  # error of a distance in floating point [m]


def to_world(foot: Footprint, pose: Floats, world: World) -> Floats:
    """Return the distances (T,) [m] from an outline at poses (T, 3) to the nearest cylinder or wall of a world.

    Raises:
        FieldError: the rows leap between so many obstacles that checking them would take too long.
    """
    sides = max(1, len(foot.corners))
    best = to_walls(foot, pose, world.bounds).min(axis=1)
    for block, near in _blocks(pose[:, :2], foot.radius, world.discs):
        for rows in np.array_split(block, 1 + len(block) * len(near) * sides // 1_000_000):
            best[rows] = np.minimum(best[rows], to_discs(foot, pose[rows], near[None, :, :2], near[:, 2]).min(axis=1))
    return np.asarray(best)


def to_outline(foot: Footprint, pose: Floats, other: Footprint, at: Floats) -> Floats:
    """Return the distances (T,) [m] from an outline at poses (T, 3) to another at poses `at` (T, 3).

    Negative if they overlap; nan where a pose is.
    """
    here, there = _placed(foot, pose), _placed(other, at)
    near = to_discs(foot, pose, there, np.array(other.rounding)).min(axis=1)
    if there.shape[1] == 1:
        return np.asarray(near)
    near = np.minimum(near, to_discs(other, at, here, np.array(foot.rounding)).min(axis=1))
    # Outlines that no side of either parts overlap, even if each has all its corners outside the other.
    apart = np.maximum(_beyond_sides(here, there), _beyond_sides(there, here))
    return np.asarray(np.where(apart < 0, apart - foot.rounding - other.rounding, near))


def _placed(foot: Footprint, pose: Floats) -> Floats:
    """Return the corners (T, K, 2) [m] of an outline without its rounding at poses (T, 3); a disc has one."""
    a, b = foot.half_length, foot.half_width
    corners = foot.corners or (((a, b), (-a, b), (-a, -b), (a, -b)) if a or b else ((0.0, 0.0),))
    body = np.array([complex(*corner) for corner in corners])
    placed = (pose[:, 0] + 1j * pose[:, 1])[:, None] + np.exp(1j * pose[:, 2])[:, None] * body
    return np.stack([placed.real, placed.imag], axis=-1)


def _beyond_sides(corners: Floats, points: Floats) -> Floats:
    """Return by how much the side of a polygon (T, K, 2) that parts it best from points (T, N, 2) does, shape (T,) [m]."""
    here, seen = corners[..., 0] + 1j * corners[..., 1], points[..., 0] + 1j * points[..., 1]
    edge = np.roll(here, -1, axis=1) - here
    length = np.abs(edge)
    along = np.conj(edge) / np.where(length > 0, length, 1.0)
    outside = -((seen[:, :, None] - here[:, None]) * along[:, None]).imag.max(axis=1)
    return np.asarray(np.where(length == 0, -math.inf, outside).max(axis=1))


def to_discs(foot: Footprint, pose: Floats, centres: Floats, radii: Floats) -> Floats:
    """Return the distances (T, N) [m] from a footprint at poses (T, 3) to discs (N,) at centres (T or 1, N, 2)."""
    x, y, yaw = (column[:, None] for column in pose.T)
    body = (centres[..., 0] + 1j * centres[..., 1] - (x + 1j * y)) * np.exp(-1j * yaw)  # in the robot's frame
    if foot.corners:
        return _polygon_to_points(foot.corners, body) - foot.rounding - radii
    ahead, aside = np.abs(body.real) - foot.half_length, np.abs(body.imag) - foot.half_width
    outside = np.sqrt(np.maximum(ahead, 0.0) ** 2 + np.maximum(aside, 0.0) ** 2)
    return np.asarray(outside + np.minimum(np.maximum(ahead, aside), 0.0) - foot.rounding - radii)


def to_walls(foot: Footprint, pose: Floats, bounds: Bounds) -> Floats:
    """Return the distances from a footprint at poses (T, 3) to the left, right, lower and upper wall (T, 4) [m]."""
    if foot.corners:
        corners = _placed(foot, pose)
        low, high = corners.min(axis=1) - bounds[:2], bounds[2:] - corners.max(axis=1)
        return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1) - foot.rounding
    x, y, yaw = pose.T
    half, rotation = np.array([foot.half_length, foot.half_width]), np.abs(np.stack([np.cos(yaw), np.sin(yaw)]))
    reach_x, reach_y = half @ rotation + foot.rounding, half[::-1] @ rotation + foot.rounding
    xmin, ymin, xmax, ymax = bounds
    return np.stack([x - reach_x - xmin, xmax - x - reach_x, y - reach_y - ymin, ymax - y - reach_y], axis=1)


def _polygon_to_points(corners: tuple[Point, ...], points: npt.NDArray[np.complex128]) -> Floats:
    """Return the distance from a convex polygon to points x + iy (...) in its frame, negative within it [m].

    Each point is rotated into the frame of each edge: the edge along the real axis, the inside to the left.
    """
    here = np.array([complex(*corner) for corner in corners])
    if len(here) == 1:
        return np.asarray(np.abs(points - here[0]))
    edge = np.roll(here, -1) - here
    seen = (points[..., None] - here) * (np.conj(edge) / np.abs(edge))
    apart = np.abs(seen - np.clip(seen.real, 0.0, np.abs(edge))).min(axis=-1)
    depth = seen.imag.min(axis=-1)
    return np.asarray(np.where(depth >= 0, -depth, apart))


def _blocks(places: Floats, radius: float, discs: Floats) -> Iterator[tuple[npt.NDArray[np.int64], Floats]]:
    """Yield blocks of rows (B,) with the discs (N, 3) that may be nearest to the footprint there."""
    if not len(discs):
        return
    count = 0
    for first in range(0, len(places), BLOCK):
        block = places[first : first + BLOCK]
        spread = math.sqrt(float(((block - block[0]) ** 2).sum(axis=1).max()))
        # The distances of centre and footprint differ by at most the radius.
        dx, dy = discs[:, 0] - block[0, 0], discs[:, 1] - block[0, 1]
        away = np.sqrt(dx * dx + dy * dy) - discs[:, 2]
        near = discs[away <= away.min() + 2 * spread + radius + ROUNDED]
        count += len(block) * len(near)
        if count > MAX_NEAR_DISTANCES:
            raise FieldError(
                "pose",
                f"{len(places)} rows that leap between {len(discs)} obstacles take more than {MAX_NEAR_DISTANCES:.0e} "
                f"distances to check, by row {first}; a drive takes a few for each row",
            )
        yield np.arange(first, first + len(block)), near
