"""From a plan in cells to a route in the world, in metres."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import FieldError
from antdrive.base.plane import segment_lengths
from antdrive.planners.plan import PlanResult
from antdrive.worlds import Grid, Route, Task, point_clearance, segment_clearance


def route_along(plan: PlanResult, grid: Grid, task: Task) -> Route:
    """The plan's own line in metres, from the exact start to the goal, without points that lie on a straight line.

    The first or last point of the plan is left out if the straight line past it keeps the grid's clearance,
    so that no kink remains between the start and the centre of its cell. If the goal itself has less room
    than the grid's clearance, the route ends at the plan's last point.

    Args:
        plan: a plan with a path
        grid: the grid that it was made on
        task: the task that the grid was made from

    Raises:
        ValueError: the plan has no path.
    """
    if not plan.solved:
        raise FieldError("plan", "has no path to follow")
    xy = _join(grid.xy(plan.line), np.array(task.start[:2]), grid, task)
    if point_clearance(task.world, [task.goal])[0] >= grid.inflate - 1e-9:
        xy = _join(xy[::-1], np.array(task.goal), grid, task)[::-1]
    xy = _straightened(xy)
    if np.ptp(xy, axis=0).max() < 1e-6:
        # The robot is at the goal already; a route needs two points, so it is a tenth of a millimetre long.
        yaw = task.start[2]
        xy = np.vstack([xy[0], xy[0] + 1e-4 * np.array([math.cos(yaw), math.sin(yaw)])])
    return Route(xy)


def _join(xy: Floats, end: Floats, grid: Grid, task: Task) -> Floats:
    if len(xy) > 1 and segment_clearance(task.world, [end], [xy[1]])[0] >= grid.inflate - 1e-9:
        xy = xy[1:]
    return np.vstack([end, xy])


def _straightened(xy: Floats) -> Floats:
    far = segment_lengths(xy[:-1]) > 1e-6  # points that differ by rounding alone have no direction
    xy = np.vstack([xy[:1], xy[1:-1][far], xy[-1:]])
    if len(xy) > 2 and np.hypot(*(xy[-1] - xy[-2])) <= 1e-6:
        xy = np.vstack([xy[:-2], xy[-1:]])
    ahead, behind = xy[2:] - xy[1:-1], xy[1:-1] - xy[:-2]
    cross = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
    straight = (np.abs(cross) < 1e-12) & ((ahead * behind).sum(axis=1) > 0)
    return xy[np.concatenate(([True], ~straight, [True]))]
