"""Properties of every planner in the registry, including planners added to `PLANNERS`."""

import dataclasses
import math

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.planners import PLANNERS, PlanStatus, Query, capabilities_of, validate_plan
from antdrive.worlds import Grid
from tests.planners.worlds_to_solve import catalogue, optimum, quick, random_query, sealed

CATALOGUE = catalogue()
NEEDS_WORLD = [name for name, planner in PLANNERS.items() if capabilities_of(planner).needs_world]
ON_GRIDS = [name for name in PLANNERS if name not in NEEDS_WORLD]
INCOMPLETE = [name for name, planner in PLANNERS.items() if not capabilities_of(planner).complete]


def solve(name, query, seed=0):
    """Return a planner's answer after `validate_plan` accepts it."""
    result = quick(name, ants=60, iterations=12).plan(query, np.random.default_rng(seed))
    assert validate_plan(query, result) == ""
    return result


@pytest.mark.parametrize("world", CATALOGUE)
@pytest.mark.parametrize("name", PLANNERS)
def test_every_world_of_the_catalogue_is_solved_along_allowed_moves(name, world):
    query = CATALOGUE[world]
    result = solve(name, query)
    if name in INCOMPLETE and not result.solved:
        assert result.status is PlanStatus.STOPPED
        assert result.reason
        assert not len(result.cells)
        return
    assert result.status is PlanStatus.SOLVED, result.reason
    assert result.cost >= optimum(query) - 1e-9
    assert result.work > 0


@pytest.mark.parametrize("name", ON_GRIDS)
def test_answers_on_random_grids_are_valid(name):
    rng = np.random.default_rng(11)
    for seed in range(40):
        query = random_query(rng, largest=12)
        result, floor = solve(name, query, seed), optimum(query)
        assert (result.status is PlanStatus.NO_PATH) == math.isinf(floor)
        if result.solved:
            assert result.cost >= floor - 1e-9


@pytest.mark.parametrize("name", PLANNERS)
def test_the_same_seed_gives_the_same_plan(name):
    one, two = (solve(name, CATALOGUE["forest"], seed=5) for _ in range(2))
    np.testing.assert_array_equal(one.cells, two.cells)
    np.testing.assert_array_equal(one.history.iteration_mean, two.history.iteration_mean)
    assert one.work == two.work


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_draws_no_random_numbers_if_and_only_if_it_is_deterministic(name):
    rng = np.random.default_rng(5)
    before = rng.bit_generator.state
    quick(name, ants=10, iterations=2).plan(CATALOGUE["forest"], rng)
    assert (rng.bit_generator.state == before) is capabilities_of(PLANNERS[name]).deterministic


@pytest.mark.parametrize("name", ON_GRIDS)
def test_an_enclosed_goal_has_no_path(name):
    result = solve(name, sealed())
    assert result.status is PlanStatus.NO_PATH
    assert len(result.cells) == 0
    assert "allowed moves" in result.reason


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("name", ON_GRIDS)
def test_a_blocked_end_has_no_path(name, end):
    free = np.ones((5, 5), dtype=np.bool_)
    free[0, 0] = False
    ends = {"start": (4, 4), "goal": (4, 4), end: (0, 0)}
    result = solve(name, Query(Grid.from_free(free), **ends))
    assert result.status is PlanStatus.NO_PATH
    assert end in result.reason


@pytest.mark.parametrize("name", ON_GRIDS)
def test_a_start_at_the_goal_is_a_path_of_one_cell(name):
    result = solve(name, Query(Grid.from_free(np.ones((3, 3))), (1, 1), (1, 1)))
    assert result.solved
    assert result.cells.tolist() == [[1, 1]]
    assert result.cost == 0.0


@pytest.mark.parametrize("name", NEEDS_WORLD)
def test_a_planner_that_needs_a_world_refuses_a_bare_grid(name):
    with pytest.raises(InputError, match="has no task"):
        solve(name, sealed())


@pytest.mark.parametrize("name", PLANNERS)
def test_the_result_records_its_options(name):
    planner = quick(name, ants=60, iterations=12)
    result = planner.plan(CATALOGUE["empty"], np.random.default_rng(0))
    assert set(result.options) == {f.name for f in dataclasses.fields(planner)}
    assert result.wall_s > 0
