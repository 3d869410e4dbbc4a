"""Hypothesis strategies for worlds and tasks; they need `pip install hypothesis`."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import InputError
from antdrive.planners import PLANNERS, Query
from antdrive.robots import RobotSpec, load_robot
from antdrive.worlds import Disc, Task, World, rasterise

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

ROOM = 0.3  # between the walls and the robot at start and goal [m]


def worlds(
    *, obstacles: int = 8, size: tuple[float, float] = (3.0, 8.0), radius: tuple[float, float] = (0.1, 0.8)
) -> SearchStrategy[World]:
    """Return a strategy for worlds of static cylinders, in whole centimetres; they shrink to few, small cylinders.

    Args:
        obstacles: largest number of cylinders
        size: the least and the largest length of a side [m]
        radius: the least and the largest radius of a cylinder [m]

    Raises:
        InputError: hypothesis is not installed, or a range contains no whole centimetre.
    """
    st = _strategies()
    sides, radii = st.tuples(_metres(st, *size), _metres(st, *size)), _metres(st, *radius)

    def filled(side: tuple[float, float]) -> SearchStrategy[World]:
        disc = st.builds(Disc, x=_metres(st, 0.0, side[0]), y=_metres(st, 0.0, side[1]), radius=radii)
        return st.lists(disc, max_size=obstacles).map(lambda discs: World("generated", (0.0, 0.0, *side), tuple(discs)))  # type: ignore[no-any-return]

    return sides.flatmap(filled)  # type: ignore[no-any-return]


def tasks(
    robot: str | RobotSpec = "turtlebot",
    *,
    clearance: float = 0.1,
    cell: float = 0.2,
    obstacles: int = 8,
    size: tuple[float, float] = (3.0, 8.0),
    radius: tuple[float, float] = (0.1, 0.8),
    solvable: bool = True,
) -> SearchStrategy[Task]:
    """Return a strategy for tasks from corner to corner that a robot can start and, by default, solve.

    Cylinders at the start or goal are omitted, then the last ones until a path is open.

    Args:
        robot: a robot, or its name or file
        clearance: free space beyond the robot's radius at start and goal and along the path [m]
        cell: grid resolution [m]
        obstacles: largest number of cylinders
        size: the least and the largest length of a side [m]
        radius: the least and the largest radius of a cylinder [m]
        solvable: whether the grid must have a path

    Raises:
        InputError: hypothesis is not installed, or the robot is unknown.
    """
    st = _strategies()
    body = robot if isinstance(robot, RobotSpec) else load_robot(robot)
    reach = body.radius + clearance
    keep = reach + cell  # keeps the cells of start and goal free
    least = max(size[0], 4 * (reach + ROOM))

    def crossed(world: World, yaw: float) -> Task:
        xmax, ymax = world.bounds[2:]
        start, goal = (reach + ROOM, reach + ROOM), (xmax - reach - ROOM, ymax - reach - ROOM)
        free = tuple(
            disc
            for disc in world.obstacles
            if all((disc.x - x) ** 2 + (disc.y - y) ** 2 > (disc.radius + keep) ** 2 for x, y in (start, goal))
        )
        task = Task(dataclasses.replace(world, obstacles=free), (*start, yaw), goal, cell=cell)
        while solvable and task.world.obstacles and not _solved(task, reach):
            fewer = dataclasses.replace(task.world, obstacles=task.world.obstacles[:-1])
            task = dataclasses.replace(task, world=fewer)
        return task

    yaws = st.integers(0, 157).map(lambda hundredths: hundredths / 100)
    return st.builds(crossed, worlds(obstacles=obstacles, size=(least, max(least, size[1])), radius=radius), yaws)  # type: ignore[no-any-return]


def _solved(task: Task, reach: float) -> bool:
    import numpy as np

    query = Query.between(rasterise(task.world, task.cell, reach), task)
    return PLANNERS["astar"].plan(query, np.random.default_rng(0)).solved


def _metres(st: Any, least: float, most: float) -> Any:
    """Return a strategy for lengths in whole centimetres between two bounds [m]."""
    first, last = math.ceil(100 * least - 1e-9), math.floor(100 * most + 1e-9)
    if first > last:
        raise InputError(f"antdrive.testing: no whole centimetre between {least:g} m and {most:g} m; widen the range")
    return st.integers(first, last).map(lambda centimetres: centimetres / 100)


def _strategies() -> Any:
    try:
        from hypothesis import strategies
    except ImportError:
        raise InputError("antdrive.testing: hypothesis is not installed; pip install hypothesis") from None
    return strategies
