"""Planners on grids with turns: by their capability they plan there, validly and whenever there is a path."""

import dataclasses

import numpy as np
import pytest

from antdrive.planners import PLANNERS, Query, capabilities_of, check_plan, load_planner
from antdrive.planners.iterative import IterativePlanner
from antdrive.worlds import rasterise
from tests.worlds.test_turns import LONG, world_of

ABLE = [name for name in PLANNERS if capabilities_of(load_planner(name)).turns]


def quick(name):
    planner = load_planner(name)
    return dataclasses.replace(planner, iterations=3) if isinstance(planner, IterativePlanner) else planner


@pytest.mark.parametrize("name", ABLE)
def test_a_plan_follows_the_turns_and_is_found_whenever_there_is_one(name):
    planner, rng, found, nodes = quick(name), np.random.default_rng(4), 0, 0
    for seed in (1, 2, 3):
        grid = rasterise(world_of(seed), 0.25, 0.6, LONG)
        nodes += len(grid.turns.cell) - grid.free.size
        for start, goal in rng.choice(np.argwhere(grid.free), (8, 2)).tolist():
            labels = grid.turns.label[start[0] * grid.shape[1] + start[1]]
            query = Query(grid, tuple(start), tuple(goal), start_label=int(labels[labels >= 0][-1]))
            plan, shortest = planner.plan(query, rng), load_planner("astar").plan(query, rng)
            assert check_plan(query, plan) == ""
            assert plan.cost >= shortest.cost - 1e-9
            assert plan.solved <= shortest.solved
            if capabilities_of(planner).complete:
                assert plan.solved == shortest.solved
            found += plan.solved
    assert nodes > 0  # some cells have several labels
    assert found > 3
