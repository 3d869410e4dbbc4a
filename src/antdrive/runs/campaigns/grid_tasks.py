"""Starts and goals that a campaign gives its worlds: listed, or drawn at random where the largest robot has room."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.planners import PLANNERS, Query
from antdrive.robots import RobotSpec, overlap_at
from antdrive.runs.campaigns.campaign import Campaign, RandomTasks
from antdrive.runs.campaigns.grid_worlds import NamedTask
from antdrive.sim.log.binding import canonical_hash
from antdrive.worlds import Disc, Grid, Task, rasterise

NAMED = "named"  # the value of a campaign's key tasks that means those of the worlds' files
TRIES = 1000  # pairs that are drawn for one task
ROOM = 0.03  # the margin of drawn tasks where the campaign's margins are chosen later [m]


def campaign_tasks(campaign: Campaign, worlds: Sequence[NamedTask], robots: Sequence[RobotSpec]) -> Iterator[NamedTask]:
    """The tasks of a campaign: each world with each of its starts and goals.

    Raises:
        InputError: a start or goal is impossible in a world, or too few were found.
    """
    if isinstance(campaign.tasks, RandomTasks):
        margins = [ROOM if margin == "auto" else float(margin) for margin in campaign.entry.margin]
        inflate = max(robot.radius for robot in robots) + max(margins)
        for world in _each_once(worlds):
            yield from _drawn(campaign, campaign.tasks, world, robots, inflate)
    elif campaign.entry.tasks == NAMED:
        for world in worlds:
            if not world.others:
                raise campaign.error(
                    ("tasks",), f"the file of world {world.world} lists no tasks; write them there, or own"
                )
            for name, task in world.others.items():
                yield dataclasses.replace(world, name=name, task=task, catalogue=None)
    elif campaign.tasks:
        for world in _each_once(worlds):
            yield from _listed(campaign, world)
    else:
        yield from worlds


def _each_once(worlds: Sequence[NamedTask]) -> Iterable[NamedTask]:
    """The worlds, each with the first of its own tasks, which others take the place of."""
    found: dict[str, NamedTask] = {}
    for one in worlds:
        found.setdefault(one.world, one)
    return found.values()


def _listed(campaign: Campaign, world: NamedTask) -> Iterator[NamedTask]:
    assert isinstance(campaign.tasks, tuple)
    for i, entry in enumerate(campaign.tasks):
        x, y, yaw = entry.start
        try:
            task = dataclasses.replace(world.task, start=(x, y, yaw), goal=(entry.goal[0], entry.goal[1]))
        except FieldError as error:
            raise campaign.error(("tasks", i, error.key), f"in world {world.world}: {error.problem}") from None
        yield dataclasses.replace(world, name=entry.name or str(i), task=task, catalogue=None)


def _drawn(
    campaign: Campaign, asked: RandomTasks, world: NamedTask, robots: Sequence[RobotSpec], inflate: float
) -> Iterator[NamedTask]:
    """Random tasks in one world. They depend on it, the seed and what needs room, not on the campaign's other worlds."""
    unseen = tuple(dict.fromkeys(Disc(d.x, d.y, d.radius, d.height) for one in campaign.settings for d in one.unseen))
    content = int(canonical_hash(world.task)[:16], 16)
    rng = np.random.default_rng([asked.seed, content])
    cell = max(entry.cell or world.task.cell for entry in campaign.settings)
    grid = rasterise(world.task.world, cell, inflate)
    free = np.argwhere(grid.moves > 0)
    for number in range(asked.random):
        task = _draw(rng, grid, free, asked.min_distance, world.task, robots, unseen) if len(free) else None
        if task is None:
            problem = (
                f"no start and goal {asked.min_distance:g} m apart with a path between them found in {TRIES} draws in world "
                f"{world.world} for a robot of radius {inflate:.3g} m with its margin; use a smaller min_distance"
            )
            raise campaign.error(("tasks",), problem)
        yield dataclasses.replace(world, name=f"random-{asked.seed}-{number}", task=task, catalogue=None)


def _draw(
    rng: np.random.Generator,
    grid: Grid,
    free: np.ndarray,
    distance: float,
    own: Task,
    robots: Sequence[RobotSpec],
    unseen: tuple[Disc, ...],
) -> Task | None:
    """A task with the start and the goal in free cells, the robot facing the goal; None if none was found."""
    for _ in range(TRIES):
        (x, y), (goal_x, goal_y) = grid.xy(free[rng.integers(len(free), size=2)]).tolist()
        if math.hypot(goal_x - x, goal_y - y) < max(distance, own.goal_tolerance):
            continue
        start = x, y, math.atan2(goal_y - y, goal_x - x)
        try:
            task = dataclasses.replace(own, start=start, goal=(goal_x, goal_y))
        except FieldError:
            continue
        fits = not any(overlap_at(task.world, robot, start, unseen) for robot in robots)
        if fits and PLANNERS["astar"].plan(Query.between(grid, task), rng).solved:
            return task
    return None
