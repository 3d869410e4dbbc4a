"""Grids with turns: labels, moves, and searches over their nodes, against loops that share no code."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from antdrive.planners import (
    PLANNERS,
    PlanStatus,
    Query,
    agent_for,
    capabilities_of,
    load_planner,
    replanner_for,
    validate_plan,
)
from antdrive.worlds import DIRECTIONS, Disc, Task, World, rasterise
from antdrive.worlds.headings import Outline, sweep_clearance
from tests.worlds.headings.intervals import free_headings

LONG = Outline(np.array([(0.5, -0.2), (0.5, 0.2), (-0.3, 0.2), (-0.3, -0.2)]), 0.03)
STEP = math.pi / 4


def world_of(seed, count=7):
    rng = np.random.default_rng(seed)
    discs = [Disc(*rng.uniform(0.5, 3.5, 2).tolist(), float(rng.uniform(0.03, 0.15))) for _ in range(count)]
    return World("random", (0.0, 0.0, 4.0, 4.0), tuple(discs))


def interval_of(heading, free):
    """The number of the free interval that a heading lies in; -1 if none."""
    for n, (low, high) in enumerate(free):
        if 0 < (heading - low) % (2 * math.pi) < high - low or high - low >= 2 * math.pi:
            return n
    return -1


def drawn(world, grid):
    """Nodes as (cell, interval of headings) with their moves, by the exact functions and plain loops."""
    rows, cols = grid.shape
    centres = {(r, c): grid.xy([(r, c)])[0] for r in range(rows) for c in range(cols)}
    free = {at: free_headings(*xy, LONG, world.discs, world.bounds) for at, xy in centres.items()}
    label = {(at, k): interval_of(k * STEP, free[at]) for at in centres for k in range(8)}
    edges = {}
    for at, (x, y) in centres.items():
        for k, (dr, dc) in enumerate(DIRECTIONS):
            to = (at[0] + dr, at[1] + dc)
            if to not in centres or label[at, k] < 0 or label[to, k] < 0:
                continue
            if sweep_clearance(x, y, *centres[to], k * STEP, LONG, world.discs, world.bounds) > 0:
                edges.setdefault((at, label[at, k]), []).append((k, (to, label[to, k])))
    return label, edges


@pytest.fixture(scope="module", params=[1, 2])
def made(request):
    world = world_of(request.param)
    grid = rasterise(world, 0.2, 0.6, LONG)
    return world, grid, *drawn(world, grid)


def test_headings_share_a_label_where_free_turns_join_them(made):
    _, grid, label, _ = made
    assert len(grid.turns.cell) > grid.free.size  # some cells have two labels
    for i, row in enumerate(grid.turns.label):
        at = divmod(i, grid.shape[1])
        for a in range(8):
            assert (row[a] >= 0) == (label[at, a] >= 0)
            for b in range(8):
                if row[a] >= 0 and row[b] >= 0:
                    assert (row[a] == row[b]) == (label[at, a] == label[at, b])


def test_a_node_moves_where_the_swept_outline_is_clear(made):
    _, grid, label, edges = made
    for i, row in enumerate(grid.turns.label):
        at = divmod(i, grid.shape[1])
        for k in range(8):
            expected = any(move == k for move, _ in edges.get((at, label[at, k]), ())) if row[k] >= 0 else False
            assert bool(row[k] >= 0 and grid.turns.moves[row[k]] >> k & 1) == expected


def test_arrays_are_read_only_and_discs_have_none(made):
    world, grid, *_ = made
    for array in (grid.turns.cell, grid.turns.label, grid.turns.moves):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    assert not rasterise(world, 0.2, 0.6).turns


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.floats(-math.pi, math.pi))
def test_the_ends_of_a_task_lead_to_its_path(seed, yaw):
    world = world_of(seed)
    assume(all(math.hypot(one.x - 0.8, one.y - 0.8) > 0.7 for one in world.obstacles))
    assume(all(math.hypot(one.x - 3.2, one.y - 3.2) > one.radius for one in world.obstacles))
    task = Task(world, (0.8, 0.8, yaw), (3.2, 3.2), goal_tolerance=0.2)
    query = Query.between(rasterise(world, 0.1, 0.6, LONG), task)
    plan = load_planner("astar").plan(query, np.random.default_rng(0))
    assert validate_plan(query, plan) == ""
    if plan.solved:
        assert math.dist(query.grid.xy(plan.cells[-1:])[0], task.goal) <= task.goal_tolerance
    else:
        assert plan.status is PlanStatus.NO_PATH


def test_a_turn_that_is_not_free_is_no_plan():
    """Two rows of pillars: the outline drives along, but cannot turn between them."""
    pillars = tuple(Disc(x, y, 0.05) for x in np.arange(0.3, 4.0, 0.2).tolist() for y in (1.65, 2.25))
    world = World("lane", (0.0, 0.0, 4.0, 4.0), pillars)
    grid = rasterise(world, 0.1, 0.6, LONG)
    row, cols = grid.cell_at(2.0, 1.95)[0], grid.shape[1]
    cells = np.array([(row, 10), (row, 11), (row, 12), (row, 11)], dtype=np.int32)
    start = int(grid.turns.label[row * cols + 10, 0])
    plan = load_planner("astar").plan(Query(grid, (row, 10), (row, 12), start_label=start), np.random.default_rng(0))
    assert plan.cost == pytest.approx(0.2)
    back = type(plan)(status=PlanStatus.SOLVED, cells=cells, cost=0.3)
    problem = validate_plan(Query(grid, (row, 10), (row, 11), start_label=start), back)
    assert problem == f"cells: step 2 from ({row}, 12) to ({row}, 11) is no allowed move"


def test_planners_for_the_disc_and_agents_refuse_turns(made):
    _, grid, *_ = made
    at = tuple(np.argwhere(grid.free)[0].tolist())
    for name in (name for name in PLANNERS if not capabilities_of(load_planner(name)).turns):
        with pytest.raises(ValueError, match=r"^planner: \w+ plans for the disc; the grid has turns"):
            replanner_for(load_planner(name), Query(grid, at, at), np.random.default_rng(0))
    for name in ("astar", "mmas-dstar"):
        with pytest.raises(ValueError, match=r"^query: has a grid with turns; agents know cells, not headings"):
            agent_for(load_planner(name), Query(grid, at, at), np.random.default_rng(0))
