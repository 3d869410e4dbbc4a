"""Scans from many poses at once, without noise, and without compiled code: loading it takes longer than a drive's scans."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Bounds, Floats
from antdrive.robots.lidar import Lidar
from antdrive.worlds.world import World

AT_ONCE = 500_000  # beams and discs of all scans that are computed together
SURE = 1e-6  # a disc's angle is taken to be larger by this, whatever the rounding [rad]

Whole = npt.NDArray[np.int64]


def exact_scans(lidar: Lidar, world: World, poses: Floats, movers: Floats) -> npt.NDArray[np.float32]:
    """What `antdrive.sim.sensing.Scanner` measures without noise, scan by scan (S, beams) [m]."""
    seen = world.discs[np.array([disc.height >= lidar.height for disc in world.obstacles], dtype=np.bool_)]
    tall = np.array([mover.height >= lidar.height for mover in world.movers], dtype=np.bool_)
    radii = np.array([mover.radius for mover in world.movers])[tall]
    ranges = np.empty((len(poses), lidar.beams), dtype=np.float32)
    parts = -(-len(poses) * (lidar.beams + len(seen)) // AT_ONCE)
    for rows in np.array_split(np.arange(len(poses)), max(1, parts)):
        eyes = np.array([lidar.pose_on((x, y, yaw)) for x, y, yaw in poses[rows].tolist()])
        moving = np.dstack([movers[rows][:, tall], np.broadcast_to(radii, (len(rows), len(radii)))])
        standing = np.broadcast_to(seen, (len(rows), *seen.shape))
        true = _to_walls(lidar, eyes, world.bounds)
        _lower_by_discs(lidar, eyes, np.concatenate([standing, moving], axis=1), true)
        ranges[rows] = _measured(lidar, true)
    return ranges


def _to_walls(lidar: Lidar, eyes: Floats, bounds: Bounds) -> Floats:
    """How far the walls are along each beam (S, beams) [m]; 0 for a lidar that is not between them."""
    turns = eyes[:, 2:] - lidar.yaw + lidar.angles
    distance = np.full(turns.shape, np.inf)
    within = np.ones(len(eyes), dtype=np.bool_)
    for axis, ways in enumerate((np.cos(turns), np.sin(turns))):
        low, high = bounds[axis] - eyes[:, axis], bounds[axis + 2] - eyes[:, axis]
        within &= (low < 0) & (high > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            np.minimum(distance, np.where(ways > 0, high[:, None] / ways, low[:, None] / ways), out=distance)
    distance[~within] = 0.0
    return distance


def _lower_by_discs(lidar: Lidar, eyes: Floats, discs: Floats, true: Floats) -> None:
    """Lower the true distances (S, beams) to the first of the discs (S, D, 3) that each beam meets."""
    off = discs[:, :, :2] - eyes[:, None, :2]
    away, radius = np.hypot(off[..., 0], off[..., 1]), discs[:, :, 2]
    inside = away <= radius
    true[inside.any(axis=1)] = 0.0
    scan, disc = np.nonzero(~inside & (away - radius <= lidar.max_range))
    cos, sin, (dx, dy) = np.cos(eyes[scan, 2]), np.sin(eyes[scan, 2]), off[scan, disc].T
    ahead, left, r = cos * dx + sin * dy, cos * dy - sin * dx, radius[scan, disc]
    first = float(lidar.angles[0]) - lidar.yaw
    middle = (np.arctan2(left, ahead) - first) / lidar.spacing
    half = (np.arcsin(r / away[scan, disc]) + SURE) / lidar.spacing
    turn = 2 * np.pi / lidar.spacing
    for turned in (-turn, 0.0, turn):  # an angle is the same a turn further
        low = np.maximum(np.ceil(middle + turned - half), 0).astype(np.int64)
        high = np.minimum(np.floor(middle + turned + half), lidar.beams - 1).astype(np.int64)
        met, beam = _each(low, high)
        angle = first + lidar.spacing * beam
        ux, uy = np.cos(angle), np.sin(angle)
        across = ahead[met] * uy - left[met] * ux
        rest = r[met] ** 2 - across**2
        reach = np.maximum(ahead[met] * ux + left[met] * uy - np.sqrt(np.maximum(rest, 0.0)), 0.0)
        hit = rest >= 0
        np.minimum.at(true, (scan[met[hit]], beam[hit]), reach[hit])


def _each(low: Whole, high: Whole) -> tuple[Whole, Whole]:
    """All whole numbers from low to high (N,), those of one after those of the other: whose each is, and which."""
    counts = np.maximum(high - low + 1, 0)
    whose = np.repeat(np.arange(len(low)), counts)
    return whose, np.arange(len(whose)) - np.repeat(np.cumsum(counts) - counts, counts) + low[whose]


def _measured(lidar: Lidar, true: Floats) -> Floats:
    """What the lidar says of true distances: multiples of its resolution within its limits, infinities beyond them."""
    step = lidar.resolution
    value = np.floor(true / step + 0.5) * step if step > 0 else true
    value = np.clip(value, lidar.min_range, lidar.max_range)
    return np.where(true > lidar.max_range, np.inf, np.where(true < lidar.min_range, -np.inf, value))
