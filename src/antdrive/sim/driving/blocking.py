"""What movers block: the discs that they will cover soon, and the grid cells that those discs close."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.robots import TrackedPath
from antdrive.sim.driving.parts import Others
from antdrive.worlds import Disc, Grid, Task

if TYPE_CHECKING:
    from antdrive.planners import Query
    from antdrive.sim.driving.traffic import Zone

STEP = 0.25  # movers are predicted at least this often [s]
MIN_RADIUS = 0.01  # smaller discs are left out [m]


def covered_discs(
    predictor: Others,
    tick: int,
    ends: Floats,
    duration: float,
    grid: Grid,
    only: npt.NDArray[np.int64] | None = None,
    wider: float = 0.0,
) -> list[Disc]:
    """The discs that movers cover within `duration` [s] of a tick; with `only`, those of these movers, `wider` [m].

    Discs are made smaller where an end (N, 2) [m] would lie within the inflation around them: movers close
    neither end. The first of the ends is the robot's position.
    """
    x, y = ends[0].tolist()
    times = np.linspace(0.0, duration, 1 + math.ceil(duration / STEP))
    positions, radii = predictor.predict(tick, (x, y), times)
    if only is not None:
        wanted = np.isin(predictor.within_range(tick, (x, y)), only)
        positions, radii = positions[:, wanted], radii[wanted]
    room = np.hypot(*np.moveaxis(positions[:, :, None] - ends, -1, 0)).min(axis=-1) - grid.inflate - grid.cell
    radius = np.minimum(radii + wider, room)
    return [
        Disc(float(positions[k, m, 0]), float(positions[k, m, 1]), float(radius[k, m]))
        for k, m in np.argwhere(radius > MIN_RADIUS).tolist()
    ]


def blocked_cells(grid: Grid, discs: list[Disc]) -> npt.NDArray[np.bool_]:
    """Which free cells (R, C) have their centre within a disc grown by the grid's inflation."""
    rows, cols = grid.shape
    x = grid.origin[0] + grid.cell * np.arange(cols)
    y = grid.origin[1] + grid.cell * np.arange(rows)
    blocked = np.zeros(grid.shape, dtype=np.bool_)
    for disc in discs:
        reach = disc.radius + grid.inflate
        c0, c1 = np.searchsorted(x, (disc.x - reach, disc.x + reach))
        r0, r1 = np.searchsorted(y, (disc.y - reach, disc.y + reach))
        near = np.hypot(x[None, c0:c1] - disc.x, y[r0:r1, None] - disc.y) <= reach
        blocked[r0:r1, c0:c1] |= near
    return blocked & grid.free


def closed_cells(query: Query, discs: list[Disc], zone: Zone | None = None) -> npt.NDArray[np.bool_]:
    """Which cells (R, C) discs and a zone close; neither the start nor the goal is."""
    closed = blocked_cells(query.grid, discs)
    if zone is not None:
        closed |= zone.blocked
    closed[query.start] = closed[query.goal] = False
    return closed


def close_route(discs: list[Disc], tracked: TrackedPath, arc: float, reach: float, inflate: float) -> bool:
    """Whether a disc comes closer than `inflate` [m] to the route within `reach` [m] beyond an arc length on it [m]."""
    ahead = np.arange(arc, min(arc + reach, tracked.length), 0.1)
    if not discs or not len(ahead):
        return False
    movers = np.array([(disc.x, disc.y, disc.radius) for disc in discs])
    gaps = np.hypot(*np.moveaxis(points_at(tracked, ahead)[:, None] - movers[None, :, :2], -1, 0)) - movers[:, 2]
    return bool((gaps < inflate).any())


def points_at(tracked: TrackedPath, arcs: Floats) -> Floats:
    """The points (N, 2) of a route at arc lengths (N,) [m]."""
    route = tracked.route
    return np.stack([np.interp(arcs, route.arc, route.xy[:, k]) for k in (0, 1)], axis=1)


def with_obstacles(task: Task, discs: list[Disc]) -> Task:
    """A task with more obstacles in its world."""
    obstacles = (*task.world.obstacles, *discs)
    return dataclasses.replace(task, world=dataclasses.replace(task.world, obstacles=obstacles))
