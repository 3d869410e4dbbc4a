import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from antdrive.planners import PlanStatus, PotentialField, Query
from antdrive.planners.graph.apf import obstacle_distance
from antdrive.worlds import DIRECTIONS, Disc, Grid, Task, World, rasterise
from tests.planners.worlds_to_solve import catalogue, optimum, random_query

RNG = np.random.default_rng(0)  # unused by the planner
BARE = PotentialField(k_rep=0.0)


def among(*discs, cell=0.2):
    task = Task(World("made", (0, 0, 6, 6), discs), (1, 1, 0), (5, 5))
    return Query.between(rasterise(task.world, cell, 0.2), task)


def test_distances_to_blocked_cells_equal_scipys():
    rng = np.random.default_rng(1)
    for _ in range(60):
        free = rng.random(rng.integers(1, 40, 2)) < rng.random() ** 0.2
        distance = obstacle_distance(Query(Grid.from_free(free, cell=0.5), (0, 0), (0, 0)))
        if free.all():
            assert np.isinf(distance).all()
        else:
            np.testing.assert_allclose(distance, 0.5 * distance_transform_edt(free), rtol=1e-12)


def test_distances_to_discs_are_exact_within_reach():
    rng = np.random.default_rng(2)
    discs = tuple(Disc(*map(float, rng.uniform(2, 4, 2)), float(rng.uniform(0.1, 0.5))) for _ in range(8))
    query = among(*discs)
    x, y = query.grid.xy(np.argwhere(np.ones(query.grid.shape))).T.reshape(2, *query.grid.shape)
    true = np.min([np.sqrt((x - d.x) ** 2 + (y - d.y) ** 2) - d.radius - 0.2 for d in discs], axis=0)
    np.testing.assert_allclose(obstacle_distance(query), true, rtol=1e-12, atol=1e-12)
    near = obstacle_distance(query, 0.7)
    np.testing.assert_allclose(near[true <= 0.7], true[true <= 0.7], rtol=1e-12, atol=1e-12)
    assert (near[true > 0.7] > 0.7).all()


def test_the_potential_follows_equations_7_9_and_11():
    query = among(Disc(3.0, 2.0, 0.4))
    field = PotentialField(k_att=2.0, k_rep=3.0, influence=0.9).potential(query)
    (goal,) = query.grid.xy([query.goal])
    for r, c in [(3, 3), (12, 17), (7, 18), (25, 25), (6, 14), query.goal]:
        assert query.grid.free[r, c]
        ((x, y),) = query.grid.xy([(r, c)])
        u = 0.5 * 2.0 * ((x - goal[0]) ** 2 + (y - goal[1]) ** 2)
        d = math.hypot(x - 3, y - 2) - 0.4 - 0.2
        if d <= 0.9:
            u += 0.5 * 3.0 * (1 / d - 1 / 0.9) ** 2
        assert field[r, c] == pytest.approx(u, rel=1e-12)
    assert field[query.goal] == 0
    np.testing.assert_array_equal(np.isinf(field), ~query.grid.free)


def test_on_an_empty_grid_the_path_is_a_shortest_one():
    query = Query(Grid.from_free(np.ones((30, 40)), cell=0.25), (2, 3), (22, 37))
    assert PotentialField().plan(query, RNG).cost == pytest.approx(optimum(query), abs=1e-9)


@pytest.mark.parametrize("planner", [PotentialField(), BARE, PotentialField(k_rep=1.0, influence=2.0)])
def test_every_step_is_the_steepest_descent(planner):
    rng = np.random.default_rng(3)
    for _ in range(30):
        query = random_query(rng)
        result = planner.plan(query, RNG)
        if not result.solved:
            continue
        field, cells = result.field, result.cells
        assert (np.diff(field[tuple(cells.T)]) < 0).all()
        for (r, c), step in zip(cells, np.diff(cells, axis=0), strict=False):
            falls = {
                (dr, dc): (field[r, c] - field[r + dr, c + dc]) / math.hypot(dr, dc)
                for k, (dr, dc) in enumerate(DIRECTIONS)
                if query.grid.moves[r, c] >> k & 1
            }
            assert falls[tuple(step)] == pytest.approx(max(falls.values()), rel=1e-12)


def test_in_a_trap_the_local_minimum_is_reported():
    query = catalogue()["trap"]
    result = PotentialField().plan(query, RNG)
    assert result.status is PlanStatus.STOPPED
    assert len(result.cells) == 0
    assert math.isinf(result.cost)
    field = result.field
    stuck = [
        (r, c)
        for r, c in np.argwhere(query.grid.free)
        if f"stuck in a local minimum of the potential at cell ({r}, {c}), " in result.reason
    ]
    assert len(stuck) == 1
    ((r, c),) = stuck
    for k, (dr, dc) in enumerate(DIRECTIONS):
        if query.grid.moves[r, c] >> k & 1:
            assert field[r + dr, c + dc] >= field[r, c]
    away = query.grid.cell * math.dist((r, c), query.goal)
    assert f"{away:.2f} m from the goal" in result.reason


def test_a_goal_too_near_an_obstacle_is_not_reached():
    """The other known weakness of potential fields: repulsion moves the minimum away from the goal."""
    result = PotentialField(k_rep=5.0, influence=2.0).plan(among(Disc(4.4, 4.4, 0.2)), RNG)
    assert result.status is PlanStatus.STOPPED
