"""From a plan in cells to the line that is driven in the world."""

from __future__ import annotations

import math

import numpy as np

from antdrive.planners.plan import PlanResult
from antdrive.worlds import Floats, Grid, Route, Task, point_clearance, segment_clearance
from antdrive.worlds.errors import FieldError
from antdrive.worlds.plane import segment_lengths


def route_along(plan: PlanResult, grid: Grid, task: Task) -> Route:
    """The plan's own line in metres, from the exact start to the goal, without points that lie on a straight line.

    The first or last point of the plan is left out where the straight way past it is as clear as the grid asks, so that no
    kink remains between the start and the centre of its cell. Where the goal itself has less room than the grid asks, the
    route ends at the plan's last point.

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
        # The robot already stands where it should: a route of a tenth of a millimetre is over before it begins.
        yaw = task.start[2]
        xy = np.vstack([xy[0], xy[0] + 1e-4 * np.array([math.cos(yaw), math.sin(yaw)])])
    return Route(xy)


def _join(xy: Floats, end: Floats, grid: Grid, task: Task) -> Floats:
    if len(xy) > 1 and segment_clearance(task.world, [end], [xy[1]])[0] >= grid.inflate - 1e-9:
        xy = xy[1:]
    return np.vstack([end, xy])


def _straightened(xy: Floats) -> Floats:
    far = segment_lengths(xy[:-1]) > 1e-6  # points that rounding alone tells apart have no direction
    xy = np.vstack([xy[:1], xy[1:-1][far], xy[-1:]])
    if len(xy) > 2 and np.hypot(*(xy[-1] - xy[-2])) <= 1e-6:
        xy = np.vstack([xy[:-2], xy[-1:]])
    ahead, behind = xy[2:] - xy[1:-1], xy[1:-1] - xy[:-2]
    cross = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
    straight = (np.abs(cross) < 1e-12) & ((ahead * behind).sum(axis=1) > 0)
    return xy[np.concatenate(([True], ~straight, [True]))]
