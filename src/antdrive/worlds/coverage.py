"""The share of a floor that a robot reaches, with the floor's rooms and doors.

Rooms are separated at local minima of clearance: the critical points of S. Thrun, *Learning metric-topological maps for
indoor mobile robot navigation*, Artificial Intelligence 99, 1998.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Point
from antdrive.worlds import _kernels_coverage, _kernels_turns
from antdrive.worlds.geometry import point_clearance, segment_clearance
from antdrive.worlds.grid import DIRECTIONS, Grid, rasterise
from antdrive.worlds.world import World

Cells = npt.NDArray[np.bool_]

NARROW = 0.7  # a door's clearance is at most this fraction of the maximum in both rooms; 0.707 at crossing corridors
LEAST_ROOM = 1.0  # a room is larger [m²]
OPPOSITE = -0.5  # cosine of the angle between the directions to a door's two sides
TOUCH = 1e-9  # an obstacle reaches further into a gap that is not empty [m]


@dataclass(frozen=True)
class Door:
    """A narrow passage between two rooms.

    Attributes:
        width: distance between its two obstacles [m]
        at: its middle [m]
        rooms: the numbers of the rooms on both sides
        passed: whether the robot drives from one room into the other here
    """

    width: float
    at: Point
    rooms: tuple[int, int]
    passed: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Return the door as plain values."""
        return {"width": self.width, "at": list(self.at), "passed": self.passed}


@dataclass(frozen=True, eq=False)
class Coverage:
    """The part of a floor that a robot reaches.

    Attributes:
        by: the robot's grid; its cells may be larger than those of the arrays below
        floor: where a point gets (R, C)
        reached: where the robot's centre gets (R, C)
        rooms: number of each cell's room (R, C), -1 off the floor
        doors: the doors, the narrowest first
        rooms_reached: the numbers of the rooms at the robot's positions, the middles of its own grid's cells
    """

    by: Grid
    floor: Cells
    reached: Cells
    rooms: npt.NDArray[np.int64]
    doors: tuple[Door, ...]
    rooms_reached: frozenset[int]

    @property
    def share(self) -> float:
        """The reached fraction of the floor."""
        return share_of(self.reached, self.floor)

    @property
    def room_count(self) -> int:
        """The number of rooms."""
        return int(self.rooms.max(initial=-1)) + 1

    def as_dict(self) -> dict[str, Any]:
        """Return share, rooms and doors as plain values."""
        rooms = {"rooms": self.room_count, "rooms_reached": len(self.rooms_reached)}
        return {"share": self.share, **rooms, "doors": [door.as_dict() for door in self.doors]}


def reached_cells(grid: Grid, ends: Iterable[Point]) -> Cells:
    """Return the cells (R, C) that allowed moves connect to any of the given positions [m].

    On a grid with turns, the robot sets out at any free heading.
    """
    reached = np.zeros(grid.shape, dtype=np.bool_)
    reached.ravel()[grid.cells_of(_reached_nodes(grid, ends))] = True
    return reached


def _reached_nodes(grid: Grid, ends: Iterable[Point]) -> npt.NDArray[np.bool_]:
    """Return the nodes (N,) of `reached_cells`."""
    reached = np.zeros(len(grid.graph.mask), dtype=np.bool_)
    for x, y in ends:
        for node in grid.nodes_at(grid.cell_at(x, y)):
            if grid.graph.mask[node]:
                reached |= _kernels_turns.led_to(grid.graph, node)
    return reached


def share_of(reached: Cells, floor: Cells) -> float:
    """Return the fraction of a floor's cells that are reached."""
    return int(np.count_nonzero(reached & floor)) / max(1, int(np.count_nonzero(floor)))


def coverage(
    world: World, grids: Sequence[Grid], start: Point, entries: Sequence[Point] | None = None
) -> tuple[Coverage, ...]:
    """Return what a robot reaches on each of its grids, on the cells of the finest.

    Args:
        world: the world
        grids: the robot's grids
        start: the robot's start [m]
        entries: where the robot enters each grid [m]; None: at the start
    """
    entries = entries or [start] * len(grids)
    bare = rasterise(world, min(grid.cell for grid in grids))
    floor = reached_cells(bare, [start, *entries])
    clearance = np.zeros(bare.shape)
    clearance[floor] = point_clearance(world, bare.xy(np.argwhere(floor)))
    order = np.flatnonzero(floor)
    order = order[np.argsort(-clearance.ravel()[order], kind="stable")]
    rooms = np.full(bare.shape, -1)
    _kernels_coverage.rooms(bare.moves, clearance, order, NARROW, LEAST_ROOM / bare.cell**2, rooms)
    rooms[floor] = np.unique(rooms[floor], return_inverse=True)[1]
    masks = [_on_cells_of(bare, grid, reached_cells(grid, [at])) for grid, at in zip(grids, entries, strict=True)]
    crossed = [_crossings(bare, rooms, grid, at) for grid, at in zip(grids, entries, strict=True)]
    doors: list[list[Door]] = [[] for _ in grids]
    for border in _borders(bare, rooms):
        low, high = np.unique(rooms[tuple(border.T)]).tolist()
        room = clearance[tuple(border.T)]
        widest = border[room >= room.max() - bare.cell]
        spots = np.concatenate([widest, *_middles(bare, rooms, widest, low + high)])
        most = room.max() + 2 * bare.cell
        found = [door for at in bare.xy(spots) if (door := _door(world, at, most, (low, high)))]
        here = np.ravel_multi_index(tuple(border.T), bare.shape)
        for (_, steps), passed in zip(crossed, doors, strict=True) if found else ():
            passed.append(replace(min(found, key=_order), passed=bool(np.isin(steps, here).all(axis=1).any())))
    return tuple(
        Coverage(grid, floor, mask, rooms, tuple(sorted(passed, key=_order)), entered)
        for grid, mask, passed, (entered, _) in zip(grids, masks, doors, crossed, strict=True)
    )


def _crossings(
    bare: Grid, rooms: npt.NDArray[np.int64], grid: Grid, entry: Point
) -> tuple[frozenset[int], npt.NDArray[np.int64]]:
    """Return the rooms that a robot's moves from where it enters its grid lead to, and the steps between rooms.

    Steps are pairs of flat cells of `bare` (N, 2).
    """
    nodes, scale = _reached_nodes(grid, [entry]), grid.cell / bare.cell
    middles = (
        np.minimum((np.arange(count) + 0.5) * scale, most - 1).astype(np.int64)
        for count, most in zip(grid.shape, bare.shape, strict=True)
    )
    room, flat = rooms[np.ix_(*middles)].ravel(), rooms.ravel()
    parts = np.linspace(0, 1, 2 + math.ceil(2 * (scale - 1)))  # samples so close that no cell of `bare` is skipped
    steps = []
    for k, (dr, dc) in enumerate(DIRECTIONS):
        cells = grid.cells_of(nodes & (grid.graph.mask >> k & 1 > 0))
        cells = np.unique(cells[room[cells] != room[cells + dr * grid.shape[1] + dc]])
        line = np.column_stack(np.divmod(cells, grid.shape[1]))[:, None] + parts[:, None] * (dr, dc)  # (N, P, 2)
        rc = np.floor((line + 0.5) * scale).astype(np.int64)
        at = np.ravel_multi_index(tuple(np.moveaxis(rc, 2, 0)), bare.shape)
        before, after = at[:, :-1].ravel(), at[:, 1:].ravel()
        steps.append(np.column_stack([before, after])[flat[before] != flat[after]])
    return frozenset(np.unique(room[grid.cells_of(nodes)]).tolist()) - {-1}, np.concatenate(steps)


def _on_cells_of(bare: Grid, grid: Grid, cells: Cells) -> Cells:
    """Return cells of a grid (R, C) as those of another of the same world."""
    if grid.shape == bare.shape:
        return cells
    rows, cols = (
        np.minimum((np.arange(count) + 0.5) * bare.cell / grid.cell, most - 1).astype(np.int64)
        for count, most in zip(bare.shape, grid.shape, strict=True)
    )
    return cells[np.ix_(rows, cols)]


def _order(door: Door) -> tuple[float, Point]:
    """Return the sort key of doors: by width."""
    return door.width, door.at


def _borders(grid: Grid, rooms: npt.NDArray[np.int64]) -> Iterable[npt.NDArray[np.int64]]:
    """Yield the cells (N, 2) at each connected border of two rooms."""
    pairs: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for k, (dr, dc) in enumerate(DIRECTIONS[:4]):
        here = np.argwhere(grid.moves >> k & 1 > 0)
        there = here + (dr, dc)
        a, b = rooms[tuple(here.T)], rooms[tuple(there.T)]
        for p, q, u, v in zip(*(x[(a != b) & (a >= 0)].tolist() for x in (here, there, a, b)), strict=True):
            pairs.setdefault((min(u, v), max(u, v)), set()).update((tuple(p), tuple(q)))
    for cells in pairs.values():
        while cells:
            todo = [cells.pop()]
            group = list(todo)
            while todo:
                r, c = todo.pop()
                near = cells & {(r + dr, c + dc) for dr, dc in DIRECTIONS}
                cells -= near
                todo += near
                group += near
            yield np.array(sorted(group))


def _middles(
    grid: Grid, rooms: npt.NDArray[np.int64], cells: npt.NDArray[np.int64], both: int
) -> Iterable[npt.NDArray[np.float64]]:
    """Yield the middles (N, 2) of the moves from cells into the other of two rooms, whose numbers sum to `both`."""
    for k, step in enumerate(DIRECTIONS):
        here = cells[grid.moves[tuple(cells.T)] >> k & 1 > 0]
        over = rooms[tuple(here.T)] + rooms[tuple((here + step).T)] == both
        over &= rooms[tuple(here.T)] != rooms[tuple((here + step).T)]
        yield here[over] + np.array(step) / 2


def _door(world: World, point: npt.NDArray[np.float64], most: float, rooms: tuple[int, int]) -> Door | None:
    """Return the door at a border of two rooms: the narrowest gap around a point of the border.

    Its obstacles are at most `most` [m] from the point. None if no empty gap is there: the border ends at other rooms.
    """
    discs, (xmin, ymin, xmax, ymax) = world.discs, world.bounds
    x, y = point.tolist()
    feet = np.array([(xmin, y), (x, ymin), (xmax, y), (x, ymax)])  # the nearest points of the walls
    centres, radii = np.vstack([discs[:, :2], feet]), np.append(discs[:, 2], np.zeros(4))
    away = centres - point
    near = np.flatnonzero(np.hypot(*away.T) - radii <= most)
    first, second = near[np.stack(np.triu_indices(len(near), 1))]
    ends = np.stack([centres[first], centres[second]])
    wall = second >= len(discs)  # the gap is perpendicular to it
    axis = (second[wall] - len(discs)) % 2
    ends[1, wall, 1 - axis] = ends[0, wall, 1 - axis]
    sides = ends - point
    across = (sides[0] * sides[1]).sum(axis=1) < OPPOSITE * np.hypot(*sides[0].T) * np.hypot(*sides[1].T)
    gaps = np.hypot(*(ends[1] - ends[0]).T)
    widths = gaps - radii[first] - radii[second]
    tried = np.flatnonzero(across & (widths > 0))
    tried = tried[np.argsort(widths[tried], kind="stable")]
    along = (ends[1, tried] - ends[0, tried]) / gaps[tried, None]
    rims = ends[0, tried] + along * radii[first[tried], None], ends[1, tried] - along * radii[second[tried], None]
    empty = np.flatnonzero(segment_clearance(world, *rims) > -TOUCH)
    if not len(empty):
        return None
    k = empty[0]
    mid_x, mid_y = ((rims[0][k] + rims[1][k]) / 2).tolist()
    return Door(float(widths[tried[k]]), (mid_x, mid_y), rooms)
