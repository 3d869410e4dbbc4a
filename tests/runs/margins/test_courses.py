"""Courses: planning finds a way through them, and the way is as narrow as planning allows."""

import itertools

import numpy as np
import pytest

from antdrive.planners import PLANNERS, Query, smooth
from antdrive.robots import load_robot
from antdrive.runs.margins.courses import course
from antdrive.worlds import Task, rasterise


def made(robot: str, margin: float, seed: int) -> tuple[Task, float]:
    spec = load_robot(robot)
    return course(spec, spec.radius + margin, np.random.default_rng(seed)), spec.radius + margin


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize("margin", [0.0, 0.12])
def test_a_course_has_a_path_that_touches_its_pillars_surroundings(robot: str, margin: float) -> None:
    spare = []
    for seed in range(20):
        task, inflate = made(robot, margin, seed)
        grid = rasterise(task.world, task.cell, inflate)
        plan = PLANNERS["astar"].plan(Query.between(grid, task), np.random.default_rng(0))
        assert plan.solved, seed
        route = smooth(plan, grid, task, kind="taut").xy
        dense = np.concatenate([np.linspace(a, b, 50) for a, b in itertools.pairwise(route)])
        discs = task.world.discs
        gap = np.hypot(*(dense[:, None] - discs[:, :2]).T) - discs[:, 2, None]
        spare.append(float(gap.min()) - inflate)
    assert min(spare) >= -1e-9
    assert np.median(spare) < 1e-3


def test_courses_differ_by_seed_and_only_by_seed() -> None:
    assert made("jackal", 0.05, 3) == made("jackal", 0.05, 3)
    assert made("jackal", 0.05, 3) != made("jackal", 0.05, 4)
