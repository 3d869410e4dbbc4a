"""The genetic algorithm of Han's thesis (2007), section 4.1, alone and in the hybrid (after section 6.3)."""

import dataclasses

import numpy as np
import pytest

from antdrive.base.plane import polyline_length
from antdrive.planners import AcoHan, GaHan, Hybrid, PlanStatus, Query, Tangent, keep_best, load_planner, on_progress
from antdrive.worlds import Disc, Grid, Task, World, load_task, polyline_clearance, rasterise
from tests.planners.worlds_to_solve import catalogue, optimum, random_query, sealed

THESIS = 33.1798  # length in the thesis for 3 via points, the best of 1, 2 and 3
FLOOR = 30.0711


def single():
    """Return a point robot's query: one obstacle of radius 5 at (10, 10) on the grid points (0, 0) to (20, 20)."""
    world = World("single", (-0.5, -0.5, 20.5, 20.5), (Disc(10, 10, 5),))
    task = Task(world, (0.0, 0.0, 0.0), (20.0, 20.0), cell=1.0)
    return Query.between(rasterise(world, 1.0), task)


def solve(query, seed=0, **options):
    return dataclasses.replace(GaHan(), **options).plan(query, np.random.default_rng(seed))


def assert_feasible(result, query):
    xy = query.grid.xy(result.waypoints)
    assert polyline_clearance(query.task.world, xy) > query.grid.inflate - 1e-12
    assert result.length == pytest.approx(polyline_length(xy), abs=1e-9)


def test_the_median_of_20_seeds_beats_the_thesis():
    query = single()
    results = [solve(query, seed) for seed in range(20)]
    lengths = [result.length for result in results]
    assert min(lengths) > FLOOR
    assert np.median(lengths) < 31.0 < THESIS
    for result in results:
        assert_feasible(result, query)


def test_via_points_are_free_grid_points_and_the_ends_exact():
    query = single()
    for n in (1, 4):
        waypoints = solve(query, via_points=n).waypoints
        assert len(waypoints) == n + 2
        np.testing.assert_allclose(waypoints[[0, -1]], [query.start, query.goal], atol=1e-12)
        via = np.round(waypoints[1:-1]).astype(int)
        np.testing.assert_allclose(waypoints[1:-1], via, atol=1e-9)
        assert query.grid.free[tuple(via.T)].all()


def test_with_elitism_no_generation_is_worse_than_the_one_before():
    kept = solve(single(), elitism=True).history
    np.testing.assert_array_equal(kept.best, kept.iteration_best)
    assert (np.diff(kept.best) <= 0).all()
    lost = solve(single(), elitism=False).history
    assert (np.diff(lost.iteration_best) > 0).any()
    assert (np.diff(lost.best) <= 0).all()


def test_without_variation_the_best_of_the_first_population_takes_over():
    result = solve(single(), crossover=0.0, mutation=0.0, iterations=400)
    assert result.history.arrived.min() == 100
    assert result.history.iteration_mean[-1] < result.history.iteration_mean[0]
    assert result.history.best[-1] == result.history.best[0]


def test_an_elite_that_is_no_parent_has_no_copies():
    alone = solve(single(), population=2, crossover=0.0, mutation=0.0, iterations=30, elite_breeds=False).history
    assert alone.iteration_mean[-1] == alone.iteration_mean[0] > alone.best[-1]
    copied = solve(single(), population=2, crossover=0.0, mutation=0.0, iterations=30).history
    assert copied.iteration_mean[-1] == copied.best[-1] == alone.best[-1]


def test_eliminated_chromosomes_are_replaced_by_random_ones():
    result = solve(single(), mutation=1.0)
    assert (result.history.arrived[1:] < 100).all()
    assert result.work > 100 * 100
    assert result.field.shape == query_shape()
    assert result.field.max() == 100  # all 100 chromosomes start in the same cell


def query_shape():
    return single().grid.shape


@pytest.mark.parametrize("name", ["han2007-single", "han2007-ga", "u-trap", "gate"])
def test_the_lines_through_the_catalogue_are_feasible(name):
    task = load_task(name)
    query = Query.between(rasterise(task.world, task.cell, 0.363), task)
    result = solve(query)
    assert result.solved, result.reason
    assert_feasible(result, query)


def test_a_line_that_chance_does_not_find_ends_the_plan_with_a_reason():
    result = solve(catalogue()["slalom"], via_points=1, tries=5000)
    assert result.status is PlanStatus.STOPPED
    assert result.reason == "no feasible chromosome found within 5000 tries"
    assert result.work == 5000
    assert solve(sealed()).status is PlanStatus.NO_PATH


def test_once_the_tries_are_used_up_only_survivors_breed():
    result = solve(single(), tries=200)
    assert result.solved
    assert len(result.history) == 100
    assert result.history.arrived[-1] > 0


def test_a_bare_grid_is_planned_on_its_free_cells():
    free = np.ones((20, 20))
    free[5:15, 5:15] = 0
    result = solve(Query(Grid.from_free(free), (1, 1), (18, 18)))
    assert result.solved
    assert result.length < result.cost
    rng = np.random.default_rng(2)
    for seed in range(8):
        query = random_query(rng, largest=10)
        answer = solve(query, seed, iterations=3, tries=500)
        assert answer.solved == bool(len(answer.cells))


def of_catalogue(name):
    task = load_task(name)
    return Query.between(rasterise(task.world, task.cell, 0.363), task)


def hybrid(query, seed=0, **options):
    return dataclasses.replace(Hybrid(), **options).plan(query, np.random.default_rng(seed))


def test_the_line_comes_within_two_percent_of_the_shortest():
    query = single()
    for seed in range(10):
        assert FLOOR < hybrid(query, seed).length < 1.02 * FLOOR


@pytest.mark.parametrize("name", ["empty", "forest", "gate", "han2007-aco", "han2007-ga", "slalom", "u-trap"])
def test_the_line_keeps_the_clearance_and_is_near_the_shortest(name):
    query = of_catalogue(name)
    floor = Tangent().plan(query, np.random.default_rng(0)).length
    # Ants cannot find the best corridor if the grid has no free cells there.
    corridor = {"forest": 1.06, "han2007-aco": 1.10}.get(name, 1.03)
    for seed in range(3):
        result = hybrid(query, seed)
        assert result.solved, result.reason
        xy = query.grid.xy(result.line)
        assert polyline_clearance(query.task.world, xy) > query.grid.inflate - 1e-9
        assert result.length == pytest.approx(polyline_length(xy), abs=1e-9)
        assert floor - 1e-9 <= result.length <= corridor * floor


def test_the_genetic_algorithm_improves_on_the_pulled_path():
    query = of_catalogue("slalom")
    history = hybrid(query).history
    assert (np.diff(history.best) <= 1e-12).all()
    assert len(history) == Hybrid().iterations
    assert history.best[-1] < history.best[29] - 0.05
    assert history.best[29] < optimum(query) - 0.05


def test_all_chromosomes_are_feasible_in_every_generation():
    result = hybrid(of_catalogue("forest"), iterations=40)
    assert (result.history.arrived[30:] == Hybrid().population).all()
    assert result.field.max() == Hybrid().population


def test_interrupted_during_the_ants_it_returns_their_pulled_path():
    query = of_catalogue("u-trap")

    def stop(progress):
        if progress.done == 3:
            raise KeyboardInterrupt

    with on_progress(stop), keep_best():
        result = hybrid(query)
    assert result.status is PlanStatus.STOPPED
    assert result.reason == "interrupted after 3 of 200 iterations"
    assert result.length == pytest.approx(result.history.best[-1])


def test_the_plan_stops_if_no_ant_arrives():
    query = catalogue()["slalom"]
    lost = dataclasses.replace(AcoHan(), max_steps=2)
    planner = Hybrid(iterations=5)
    object.__setattr__(planner, "_ants", lambda: lost)
    result = planner.plan(query, np.random.default_rng(0))
    assert result.status is PlanStatus.STOPPED
    assert "nothing arrived within 5 iterations" in result.reason


def test_a_bare_grid_is_passed_near_its_corners():
    free = np.ones((30, 30))
    free[5:25, 14] = 0
    result = hybrid(Query(Grid.from_free(free), (15, 2), (15, 27)))
    by_hand = np.hypot(11.5, 9.5) + 1 + np.hypot(12.5, 9.5)  # past the corners of the blocked column
    assert by_hand <= result.length <= 1.02 * by_hand


def test_the_colony_is_an_ant_planner_by_name():
    assert load_planner("hybrid", colony="aco-han-elite").plan(single(), np.random.default_rng(0)).solved
