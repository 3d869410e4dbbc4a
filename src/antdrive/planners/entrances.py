"""Entrances of grids with turns: the nodes by which a robot enters them from its exact start pose."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import wrap_angle
from antdrive.worlds.world import PointWorld

if TYPE_CHECKING:
    from antdrive.base import Floats, Point, Pose
    from antdrive.worlds import Grid, Task, World
    from antdrive.worlds.headings import Outline

MAX_BACKWARDS = 0.5  # longest way that a robot backs out of a place where it cannot turn [m]
LEAD = 0.75  # farthest entrance from a start [m]
ROOM = 1e-4  # a start closer to obstacles than the margin leaves with this much less room than it has [m]
FAR = 25.0  # obstacles farther from a start than this meet no lead; robots are at most 20 m long [m]
STEP = math.pi / 4  # between the headings of a grid [rad]


def ends(grid: Grid, task: Task, within: float) -> tuple[int, int]:
    """Return the start's node and the goal's flat cell on a grid with turns; -1 for an end without any.

    The goal becomes the nearest free cell within a distance that moves reach from the start; without one, the nearest.

    Args:
        grid: a grid with turns
        task: the task whose world was rasterised
        within: farthest cell from the goal [m]
    """
    from antdrive.worlds import _kernels_turns

    goals, _ = _free_around(grid, task.goal, within)
    start = entrance(grid, task, goals)
    if start < 0 or not len(goals):
        return start, next(iter(goals.tolist()), -1)
    reached = np.zeros(grid.free.size, dtype=np.bool_)
    reached[grid.cells_of(_kernels_turns.led_to(grid.graph, start))] = True
    return start, int(goals[reached[goals].argmax()])


def entrance(grid: Grid, task: Task, goals: npt.NDArray[np.int64]) -> int:
    """Return the node by which the robot enters a grid with turns from its exact start; -1 if it cannot.

    A lead turns on the spot, drives straight to the centre of the node's cell, and turns to a heading of the node. The node
    is the nearest with a clear lead from which moves lead to a goal. Only where no lead forwards reaches such a node the
    robot leaves backwards, by at most `MAX_BACKWARDS`. Where no such node is near, it is any node of the nearest free cell.

    Args:
        grid: a grid with turns
        task: the task whose world was rasterised
        goals: flat cells (G,)
    """
    from antdrive.worlds import _kernels_turns

    near, away = _free_around(grid, task.start[:2], LEAD)
    if not len(near):
        return -1
    leading = _kernels_turns.leads_to(grid.graph, goals)
    labels = grid.turns.label[near]
    useful = np.where(labels >= 0, leading[labels], False).any(axis=1)
    if not useful.any():
        return int(labels[0].max())
    around = _around(task)
    outline = outline_at(around, grid.turns.outline)
    for most, backwards in ((LEAD, False), (MAX_BACKWARDS, True)):
        for node in _entrances(grid, around, outline, near[useful & (away <= most)], backwards):
            if leading[node]:
                return node
    return -1


def _free_around(grid: Grid, point: Point, within: float) -> tuple[npt.NDArray[np.int64], Floats]:
    """Return the free flat cells within some distance [m] of a point, nearest first, and their distances [m]."""
    row, col = grid.cell_at(*point)
    reach = math.ceil(within / grid.cell)
    low, left = max(0, row - reach), max(0, col - reach)
    near = np.argwhere(grid.free[low : row + reach + 1, left : col + reach + 1]) + (low, left)
    away = np.hypot(*(grid.xy(near) - point).T)
    order = np.argsort(away, kind="stable")
    order = order[away[order] <= within]
    return near[order, 0] * grid.shape[1] + near[order, 1], away[order]


def _around(task: Task) -> Task:
    """Return the task with the obstacles that leads may meet."""
    discs, (x, y, _) = task.world.discs, task.start
    close = np.hypot(discs[:, 0] - x, discs[:, 1] - y) - discs[:, 2] < FAR
    return dataclasses.replace(task, world=PointWorld.of(task.world.name, task.world.bounds, discs[close]))


def outline_at(task: Task, outline: Outline) -> Outline:
    """Return an outline with the margin that a task's start leaves it: near obstacles less than its own."""
    from antdrive.worlds.headings import sweep_clearance

    x, y, yaw = task.start
    room = sweep_clearance(x, y, x, y, yaw, outline, task.world.discs, task.world.bounds)
    return outline if room > 0 else outline._replace(reach=outline.reach + room - ROOM)


def lead_heading(pose: Pose, x: float, y: float, outline: Outline, world: World, *, backwards: bool) -> float:
    """Return the heading of a straight lead from a pose to (x, y) [rad]; NaN if it or the turn to it is not clear."""
    from antdrive.worlds.headings import sweep_clearance

    dx, dy = x - pose[0], y - pose[1]
    if math.hypot(dx, dy) < 1e-6:
        return pose[2]
    heading = math.atan2(-dy, -dx) if backwards else math.atan2(dy, dx)
    if sweep_clearance(pose[0], pose[1], x, y, heading, outline, world.discs, world.bounds) <= 0:
        return math.nan
    return heading if math.isfinite(clear_turn(pose, heading, outline, world)) else math.nan


def clear_turn(pose: Pose, heading: float, outline: Outline, world: World) -> float:
    """Return the shortest clear turn on the spot from a pose to a heading [rad]; NaN if neither way round is clear."""
    from antdrive.worlds.headings import turn_clear

    short = float(wrap_angle(heading - pose[2]))
    for turn in (short, short - math.copysign(2 * math.pi, short)):
        if turn_clear(*pose, turn, outline, world.discs, world.bounds):
            return turn
    return math.nan


def _entrances(
    grid: Grid, task: Task, outline: Outline, cells: npt.NDArray[np.int64], backwards: bool
) -> Iterator[int]:
    """Yield the nodes of some flat cells with a clear lead."""
    from antdrive.worlds.headings import turn_clear

    world = task.world
    for cell in cells.tolist():
        x, y = grid.xy([divmod(cell, grid.shape[1])])[0].tolist()
        heading = lead_heading(task.start, x, y, outline, world, backwards=backwards)
        if math.isnan(heading):
            continue
        for side in (math.floor(heading / STEP), math.ceil(heading / STEP)):
            node = int(grid.turns.label[cell, side % 8])
            if node >= 0 and turn_clear(x, y, heading, side * STEP - heading, outline, world.discs, world.bounds):
                yield node
