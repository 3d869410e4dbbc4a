"""Distances between a robot's footprint and the obstacles and walls, in numpy except for one kernel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Pose
from antdrive.base.plane import format_disc
from antdrive.robots.spec import Footprint, RobotSpec
from antdrive.worlds import Disc, World
from antdrive.worlds.motions import first_place
from antdrive.worlds.world import obstacle_name

if TYPE_CHECKING:
    from antdrive.worlds.headings import Outline

TOUCHING = 1e-4  # surfaces closer than this touch [m]


def footprint_clearance(world: World, footprint: Footprint, poses: npt.ArrayLike) -> Floats:
    """Return the distance from the footprint at each of `poses` (N, 3) [m, rad] to the nearest disc or wall, shape (N,) [m].

    Negative for overlaps; the magnitude is then a bound on the depth, not the exact depth. Movers do not count.
    """
    from antdrive.robots import _kernels_footprint

    rows = np.ascontiguousarray(poses, dtype=np.float64).reshape(-1, 3)
    out = np.empty(len(rows))
    bounds = np.asarray(world.bounds, dtype=np.float64)
    _kernels_footprint.footprint_clearances(rows, *kernel_shape(footprint), world.discs, bounds, out)
    return out


def kernel_shape(footprint: Footprint) -> tuple[Floats, Floats]:
    """Return a footprint for kernels: half length, half width and rounding (3,), and corners (K, 2) [m]."""
    shape = np.array([footprint.half_length, footprint.half_width, footprint.rounding])
    return shape, np.array(footprint.corners, dtype=np.float64).reshape(-1, 2)


def outline_of(footprint: Footprint, margin: float) -> Outline:
    """Return a footprint with a margin [m] as the outline of plans; without corners for a disc around the axle."""
    from antdrive.worlds.headings import Outline  # imports the compiler

    a, b, box = footprint.half_length, footprint.half_width, footprint.corners
    corners = () if footprint.is_disc else box or ((a, b), (-a, b), (-a, -b), (a, -b))
    return Outline(np.array(corners, dtype=np.float64).reshape(-1, 2), footprint.rounding + margin)


def footprint_distances(world: World, spec: RobotSpec, poses: npt.ArrayLike) -> Floats:
    """Return the signed distance from the footprint to each obstacle, then to each of `WALLS`, (P, N + 4) [m]."""
    x, y, yaw = np.asarray(poses, dtype=np.float64).reshape(-1, 3, 1).swapaxes(0, 1)
    foot, discs = spec.footprint, world.discs
    cos, sin = np.cos(yaw), np.sin(yaw)
    dx, dy = discs[:, 0] - x, discs[:, 1] - y
    if foot.corners:
        to_discs = _beyond_polygon(foot, cos * dx + sin * dy, cos * dy - sin * dx) - foot.rounding - discs[:, 2]
        cx, cy = np.array(foot.corners).T
        at_x, at_y = x + cos * cx - sin * cy, y + sin * cx + cos * cy
        xmin, ymin, xmax, ymax = world.bounds
        room = at_x.min(1) - xmin, at_y.min(1) - ymin, xmax - at_x.max(1), ymax - at_y.max(1)
        return np.hstack([to_discs, np.stack(room, axis=1) - foot.rounding])
    ahead, beside = np.abs(cos * dx + sin * dy) - foot.half_length, np.abs(cos * dy - sin * dx) - foot.half_width
    outside = np.hypot(np.maximum(ahead, 0.0), np.maximum(beside, 0.0))
    to_discs = outside + np.minimum(np.maximum(ahead, beside), 0.0) - foot.rounding - discs[:, 2]
    reach_x = foot.half_length * np.abs(cos) + foot.half_width * np.abs(sin) + foot.rounding
    reach_y = foot.half_length * np.abs(sin) + foot.half_width * np.abs(cos) + foot.rounding
    xmin, ymin, xmax, ymax = world.bounds
    return np.hstack([to_discs, x - reach_x - xmin, y - reach_y - ymin, xmax - x - reach_x, ymax - y - reach_y])


def _beyond_polygon(footprint: Footprint, x: Floats, y: Floats) -> Floats:
    """Return the signed distance from a footprint's polygon to points in its frame, negative inside [m]."""
    corners = np.array(footprint.corners)
    over, apart = np.full(x.shape, -np.inf), np.full(x.shape, np.inf)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = float(np.hypot(bx - ax, by - ay))
        ex, ey = ((bx - ax) / length, (by - ay) / length) if length else (0.0, 0.0)
        along = np.clip((x - ax) * ex + (y - ay) * ey, 0.0, length)
        apart = np.minimum(apart, np.hypot(x - ax - along * ex, y - ay - along * ey))
        over = np.maximum(over, (x - ax) * ey - (y - ay) * ex if length else np.inf)
    return np.where(over <= 0, over, apart)


def overlap_at(world: World, spec: RobotSpec, pose: Pose, unseen: tuple[Disc, ...] = ()) -> str:
    """Describe the footprint's deepest overlap at a pose at a run's start; empty if there is none.

    Surfaces closer than `TOUCHING` touch. `unseen` obstacles count, and movers, except wanderers whose place depends on the
    seed.
    """
    starts = {i: first_place(mover, world.bounds, world.discs) for i, mover in enumerate(world.movers)}
    movers = {i: Disc(*place, world.movers[i].radius) for i, place in starts.items() if place is not None}
    full = World(world.name, world.bounds, (*movers.values(), *world.obstacles, *unseen))
    gap = footprint_distances(full, spec, [pose])[0]
    worst = int(gap.argmin())
    if gap[worst] > TOUCHING:
        return ""
    depth = -float(gap[worst])
    touches = f"overlaps {{}} by {depth:.3g} m" if depth > 1e-9 else "touches {}"
    if worst < len(movers):
        mover = movers[index := list(movers)[worst]]
        return touches.format(f"movers[{index}], which starts {format_disc(mover.x, mover.y, mover.radius)}")
    known = World(world.name, world.bounds, (*world.obstacles, *unseen))
    return touches.format(obstacle_name(known, worst - len(movers), len(unseen)))
