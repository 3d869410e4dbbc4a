"""The genetic algorithm of Han's thesis (2007), section 4.1."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from antdrive.base.plane import polyline_length
from antdrive.planners import GaHan, PlanStatus, Query, load_planner
from antdrive.worlds import Disc, Grid, Task, World, load_task, polyline_clearance, rasterise
from tests.planners.worlds_to_solve import catalogue, random_query, sealed

THESIS = 33.1798  # the length that the thesis prints for 3 via points, the best of 1, 2 and 3
FLOOR = 30.0711


def single() -> Query:
    """One obstacle of radius 5 at (10, 10) on the grid points (0, 0) to (20, 20), for a point robot."""
    world = World("single", (-0.5, -0.5, 20.5, 20.5), (Disc(10, 10, 5),))
    task = Task(world, (0.0, 0.0, 0.0), (20.0, 20.0), cell=1.0)
    return Query.between(rasterise(world, 1.0), task)


def solve(query: Query, seed: int = 0, **options: object):  # type: ignore[no-untyped-def]
    return dataclasses.replace(GaHan(), **options).plan(query, np.random.default_rng(seed))


def assert_feasible(result, query: Query) -> None:  # type: ignore[no-untyped-def]
    assert query.task is not None
    xy = query.grid.xy(result.waypoints)
    assert polyline_clearance(query.task.world, xy) > query.grid.inflate - 1e-12
    assert result.length == pytest.approx(polyline_length(xy), abs=1e-9)


def test_the_registered_defaults_are_those_of_the_thesis() -> None:
    assert (GaHan().population, GaHan().iterations, GaHan().crossover, GaHan().mutation) == (100, 100, 0.25, 0.2)
    assert GaHan().elitism


def test_the_median_of_20_seeds_beats_the_thesis() -> None:
    query = single()
    results = [solve(query, seed) for seed in range(20)]
    lengths = [result.length for result in results]
    assert min(lengths) > FLOOR
    assert np.median(lengths) < 31.0 < THESIS
    for result in results:
        assert_feasible(result, query)


def test_via_points_are_free_grid_points_and_the_ends_exact() -> None:
    query = single()
    for n in (1, 4):
        waypoints = solve(query, via_points=n).waypoints
        assert len(waypoints) == n + 2
        np.testing.assert_allclose(waypoints[[0, -1]], [query.start, query.goal], atol=1e-12)
        via = np.round(waypoints[1:-1]).astype(int)
        np.testing.assert_allclose(waypoints[1:-1], via, atol=1e-9)
        assert query.grid.free[tuple(via.T)].all()


def test_with_elitism_no_generation_is_worse_than_the_one_before() -> None:
    kept = solve(single(), elitism=True).history
    np.testing.assert_array_equal(kept.best, kept.iteration_best)
    assert (np.diff(kept.best) <= 0).all()
    lost = solve(single(), elitism=False).history
    assert (np.diff(lost.iteration_best) > 0).any()
    assert (np.diff(lost.best) <= 0).all()


def test_without_variation_the_best_of_the_first_population_takes_over() -> None:
    result = solve(single(), crossover=0.0, mutation=0.0, iterations=400)
    assert result.history.arrived.min() == 100
    assert result.history.iteration_mean[-1] < result.history.iteration_mean[0]
    assert result.history.best[-1] == result.history.best[0]


def test_eliminated_chromosomes_are_replaced_by_random_ones() -> None:
    result = solve(single(), mutation=1.0)
    assert (result.history.arrived[1:] < 100).all()
    assert result.work > 100 * 100
    assert result.field.shape == query_shape()
    assert result.field.max() == 100  # all 100 chromosomes start in the same cell


def query_shape() -> tuple[int, int]:
    return single().grid.shape


@pytest.mark.parametrize("name", ["han2007-single", "han2007-ga", "u-trap", "gate"])
def test_the_lines_through_the_catalogue_are_feasible(name: str) -> None:
    task = load_task(name)
    query = Query.between(rasterise(task.world, task.cell, 0.363), task)
    result = solve(query)
    assert result.solved, result.reason
    assert_feasible(result, query)


def test_a_line_that_chance_does_not_find_ends_the_plan_with_a_reason() -> None:
    result = solve(catalogue()["slalom"], via_points=1, tries=5000)
    assert result.status is PlanStatus.STOPPED
    assert result.reason == "no feasible chromosome found within 5000 tries"
    assert result.work == 5000
    assert solve(sealed()).status is PlanStatus.NO_PATH


def test_once_the_tries_are_used_up_only_survivors_breed() -> None:
    result = solve(single(), tries=200)
    assert result.solved
    assert len(result.history) == 100
    assert result.history.arrived[-1] > 0


def test_a_bare_grid_is_planned_on_its_free_cells() -> None:
    free = np.ones((20, 20))
    free[5:15, 5:15] = 0
    result = solve(Query(Grid.from_free(free), (1, 1), (18, 18)))
    assert result.solved
    assert result.length < result.cost
    rng = np.random.default_rng(2)
    for seed in range(20):
        query = random_query(rng, largest=10)
        answer = solve(query, seed, iterations=5, tries=2000)
        assert answer.solved == bool(len(answer.cells))


def test_options_are_checked() -> None:
    for options, message in (
        ({"via_points": 0}, "via_points: must be at least 1"),
        ({"population": 1}, "population: must be at least 2"),
        ({"crossover": 1.5}, "crossover: must be at least 0 and at most 1"),
        ({"tries": 0}, "tries: must be at least 1"),
    ):
        with pytest.raises(ValueError, match=message):
            dataclasses.replace(GaHan(), **options)
    assert load_planner("ga-han", via_points="2", elitism="no") == GaHan(via_points=2, elitism=False)
