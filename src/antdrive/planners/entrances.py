"""Entrances of grids with turns: the nodes by which a robot enters them from its exact start pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import wrap_angle
from antdrive.worlds.route import LEAD

if TYPE_CHECKING:
    from antdrive.base import Floats, Point, Pose
    from antdrive.worlds import Grid, Task, World
    from antdrive.worlds.headings import Outline

MAX_BACKWARDS = 0.5  # longest way that a robot backs out of a place where it cannot turn [m]
ROOM = 1e-4  # a start closer to obstacles than the margin leaves with this much less room than it has [m]
TURNING = 0.1  # a turn to an entrance counts as this much of a way [m/rad]


class Lead(NamedTuple):
    """Straight from an exact start to the centre of its cell: the robot's heading [rad], and whether it drives backwards."""

    heading: float
    backwards: bool


def ends(grid: Grid, task: Task, within: float) -> tuple[int, int]:
    """Return the start's node and the goal's flat cell on a grid with turns; -1 for an end without any.

    The goal becomes the nearest free cell within a distance [m] that moves reach from the start; without one, the nearest.
    """
    from antdrive.worlds import _kernels_turns

    goals, _ = _free_around(grid, task.goal, within)
    nearest = _kernels_turns.leads_to(grid.graph, goals)
    start = entrance(grid, task, nearest)
    place = int(nearest[start]) if start >= 0 else 0
    return start, int(goals[max(0, place)]) if len(goals) else -1


def entrance(grid: Grid, task: Task, nearest: npt.NDArray[np.int32]) -> int:
    """Return the node by which the robot enters a grid with turns from its exact start; -1 if it cannot.

    A lead turns on the spot, drives straight to the centre of the node's cell, and turns to a heading of the node. The node
    is the first, in the order of way and turn, with a clear lead from which moves lead to a goal: `nearest` (N,), -1 for none.
    Only where no lead forwards reaches such a node, the robot leaves backwards, by at most `MAX_BACKWARDS`. Where no such node
    is near, it is any node of the nearest free cell.
    """
    from antdrive.planners import _kernels_entrances

    near, away = _free_around(grid, task.start[:2], LEAD)
    if not len(near):
        return -1
    labels = grid.turns.label[near]
    useful = ((labels >= 0) & (nearest[labels] >= 0)).any(axis=1)
    if not useful.any():
        return int(labels[0].max())
    outline = outline_at(task, grid.turns.outline)
    around = _around(task, LEAD + float(np.hypot(*outline.corners.T).max()) + outline.reach + ROOM)
    centres = grid.xy(np.column_stack(np.divmod(near, grid.shape[1])))
    for most, backwards in ((LEAD, False), (MAX_BACKWARDS, True)):
        kept = np.flatnonzero(useful & (away <= most))
        kept = kept[_by_effort(centres[kept], task.start, backwards)]
        found = _kernels_entrances.first_entrance(
            *task.start, centres[kept], labels[kept], nearest, backwards, *outline, *around
        )
        if found >= 0:
            return int(found)
    return -1


def _free_around(grid: Grid, point: Point, within: float) -> tuple[npt.NDArray[np.int64], Floats]:
    """Return the free flat cells within a distance of a point, nearest first, and their distances [m]."""
    row, col = grid.cell_at(*point)
    reach = math.ceil(within / grid.cell)
    low, left = max(0, row - reach), max(0, col - reach)
    near = np.argwhere(grid.free[low : row + reach + 1, left : col + reach + 1]) + (low, left)
    away = np.hypot(*(grid.xy(near) - point).T)
    order = np.argsort(away, kind="stable")
    order = order[away[order] <= within]
    return near[order, 0] * grid.shape[1] + near[order, 1], away[order]


def _by_effort(centres: Floats, start: Pose, backwards: bool) -> npt.NDArray[np.int64]:
    """Return the order of some points (N, 2) [m] by the way to them and the turn towards them."""
    dx, dy = (centres - start[:2]).T
    turn = np.abs(wrap_angle(np.arctan2(dy, dx) + math.pi * backwards - start[2]))
    away = np.hypot(dx, dy)
    return np.argsort(away + np.where(away > ROOM, TURNING * turn, 0.0), kind="stable")


def _around(task: Task, within: float) -> tuple[Floats, Floats]:
    """Return the discs (N, 3) within a distance of the start, and the walls (4,) [m]."""
    discs, (x, y, _) = task.world.discs, task.start
    close = np.hypot(discs[:, 0] - x, discs[:, 1] - y) - discs[:, 2] < within
    return discs[close], np.asarray(task.world.bounds, dtype=np.float64)


def outline_at(task: Task, outline: Outline) -> Outline:
    """Return an outline with the margin that a task's start leaves it: near obstacles less than its own."""
    from antdrive.worlds.headings import sweep_clearance

    x, y, yaw = task.start
    clearance = sweep_clearance(x, y, x, y, yaw, outline, task.world.discs, task.world.bounds)
    return outline if clearance > 0 else outline._replace(reach=outline.reach + clearance - ROOM)


def lead_heading(pose: Pose, x: float, y: float, outline: Outline, world: World, *, backwards: bool) -> float:
    """Return the heading of a straight lead from a pose to (x, y) [rad]; NaN if it or the turn to it is not clear."""
    from antdrive.planners import _kernels_entrances

    walls = np.asarray(world.bounds, dtype=np.float64)
    return float(_kernels_entrances.lead_heading(*pose, x, y, backwards, *outline, world.discs, walls))


def clear_turn(pose: Pose, heading: float, outline: Outline, world: World) -> float:
    """Return the shortest clear turn on the spot from a pose to a heading [rad]; NaN if neither way round is clear."""
    from antdrive.planners import _kernels_entrances

    walls = np.asarray(world.bounds, dtype=np.float64)
    return float(_kernels_entrances.clear_turn(*pose, heading, *outline, world.discs, walls))


def clear_lead(task: Task, to: Point, heading: float | None, outline: Outline) -> Lead:
    """Return the clear lead from a task's start to a point, forwards if possible; from there the robot turns to a heading.

    Without a clear one it is the straight forwards: an estimated pose may overlap obstacles.
    """
    for backwards in (False, True):
        facing = lead_heading(task.start, *to, outline, task.world, backwards=backwards)
        if math.isfinite(facing) and (
            heading is None or math.isfinite(clear_turn((*to, facing), heading, outline, task.world))
        ):
            return Lead(facing, backwards)
    return Lead(math.atan2(to[1] - task.start[1], to[0] - task.start[0]), False)


def turn_at(pose: Pose, heading: float, task: Task, outlines: Sequence[Outline]) -> float:
    """Return the turn on the spot that is clear for the first outline possible, or the shorter one without any [rad]."""
    turns = (clear_turn(pose, heading, outline, task.world) for outline in outlines)
    return next(filter(math.isfinite, turns), float(wrap_angle(heading - pose[2])))
