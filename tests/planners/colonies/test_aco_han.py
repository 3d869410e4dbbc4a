import math

import numpy as np
import pytest

from antdrive.planners import AcoHan, PlanStatus, PotentialFieldAnts, Progress, keep_best, on_progress
from antdrive.planners.colonies.colony import ColonyGraph, IterationState, TourConstruction, cut
from antdrive.worlds import DIRECTIONS
from tests.planners.colonies.test_colony import DIRECT, OPEN, walks
from tests.planners.worlds_to_solve import catalogue


def state(graph, walked, best):
    """Return the first iteration of a colony, with these walks."""
    tours = cut(walked, graph, short=False)
    return IterationState(0, graph, walked, tours, None, best, 0, np.random.default_rng(0))


ROUND = [(0, 0), (0, 1), (0, 2), (0, 1), (1, 2), (2, 3)]  # with a loop


@pytest.mark.parametrize("elitism", [0, 7])
def test_trails_follow_equations_4_2_2_to_4_2_4(elitism):
    graph, planner = ColonyGraph.of(OPEN), AcoHan(evaporation=0.25, deposit=2.0, elitism=elitism)
    both = walks(DIRECT, ROUND)
    before = np.linspace(0.1, 1.2, 12)
    trail = before.copy()
    planner.update(trail, state(graph, both, both.only(0)))

    expected = 0.75 * before.reshape(3, 4)
    direct, wander = 2 * math.sqrt(2) + 1, 3 + 2 * math.sqrt(2)
    for cell in set(DIRECT):
        expected[cell] += (2.0 + elitism * 2.0) / direct
    for cell in set(ROUND):
        expected[cell] += 2.0 / wander
    np.testing.assert_allclose(trail.reshape(3, 4), expected, rtol=1e-12)


def test_the_listing_evaporates_only_where_ants_deposit():
    graph, planner = ColonyGraph.of(OPEN), AcoHan(evaporation=0.25, deposit=5.0, form="listing")
    one = walks(DIRECT)
    trail = np.ones(12)
    planner.update(trail, state(graph, one, one))
    expected = np.ones((3, 4))
    for cell in DIRECT:
        expected[cell] = 0.75 + 5.0 / (2 * math.sqrt(2) + 1)
    np.testing.assert_allclose(trail.reshape(3, 4), expected, rtol=1e-12)


def test_weights_follow_equation_4_2_1():
    graph, planner = ColonyGraph.of(OPEN), AcoHan(attraction=0.5, min_weight=0.0)
    trail = np.arange(12.0)
    weights = np.zeros((12, 8))
    planner.choice_weights(graph, trail, planner.heuristic_values(graph), weights)
    # From cell (1, 1) = 5 to the goal (2, 3): all eight neighbours are allowed.
    steps = [(0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)]
    tau = np.array([trail[(1 + r) * 4 + 1 + c] for r, c in steps])
    goal = np.array([1.0, 2.0]) / math.hypot(1, 2)
    omega = [max(0.0, float(np.dot(step, goal)) / math.hypot(*step)) for step in steps]
    np.testing.assert_allclose(weights[5], tau / tau.sum() + 0.5 * np.array(omega), rtol=1e-12)
    assert (weights[0] > 0).sum() <= 3  # a corner has three moves


def test_to_the_letter_the_pull_is_the_plain_dot_product_and_may_be_negative():
    graph, planner = ColonyGraph.of(OPEN), AcoHan(form="letter", min_weight=0.0)
    weights = np.zeros((12, 8))
    planner.choice_weights(graph, np.ones(12), planner.heuristic_values(graph), weights)
    # From cell (1, 1) = 5 the vector to the goal is (1, 2).
    np.testing.assert_allclose(weights[5], np.maximum(0.0, 1 / 8 + np.array([2, 3, 1, -1, -2, -3, -1, 1])))


def test_the_elite_is_the_tour_of_the_run_or_of_the_iteration():
    graph, before = ColonyGraph.of(OPEN), np.zeros(12)
    this = walks(ROUND)
    for elite_of, cells in (("run", DIRECT), ("iteration", [(0, 0), (0, 1), (1, 2), (2, 3)])):
        trails = []
        for elitism in (0, 7):
            trail = before.copy()
            AcoHan(elitism=elitism, elite_of=elite_of).update(trail, state(graph, this, walks(DIRECT)))
            trails.append(trail)
        expected = np.zeros((3, 4))
        expected[tuple(np.transpose(cells))] = 7 / (1 + 2 * math.sqrt(2))
        np.testing.assert_allclose((trails[1] - trails[0]).reshape(3, 4), expected, atol=1e-12)


def test_the_listing_adds_raw_pheromone_to_one_fixed_direction():
    graph, planner = ColonyGraph.of(OPEN), AcoHan(form="listing", min_weight=0.0)
    weights = np.zeros((12, 8))
    planner.choice_weights(graph, np.full(12, 3.0), planner.heuristic_values(graph), weights)
    north_east = (1 * 2 + 1 * 3) / math.hypot(2, 3)
    assert weights[0, 1] == pytest.approx(3.0 + north_east)
    assert weights[5, 1] == pytest.approx(3.0 + north_east)
    assert weights[5, 5] == pytest.approx(3.0)  # away from the goal: the trail alone


def test_each_loop_of_a_walk_is_cut_out_as_it_closes():
    graph, rng, loops = ColonyGraph.of(OPEN), np.random.default_rng(0), 0
    for _ in range(60):
        walk, kept = [(0, 0)], []
        while walk[-1] != (2, 3):
            (r, c), (dr, dc) = walk[-1], DIRECTIONS[rng.integers(8)]
            walk += [(r + dr, c + dc)] * (0 <= r + dr < 3 and 0 <= c + dc < 4)
        for cell in walk:
            kept = [*kept[: kept.index(cell)], cell] if cell in kept else [*kept, cell]
        tours = cut(walks(walk), graph, short=False)
        assert list(map(tuple, graph.cells(tours.cells[0, : tours.sizes[0]]).tolist())) == kept
        assert tours.lengths[0] == pytest.approx(walks(kept).lengths[0])
        loops += len(walk) - len(kept)
    assert loops > 100


@pytest.mark.parametrize("planner", [AcoHan(ants=50, iterations=8), PotentialFieldAnts(ants=50, iterations=20)])
def test_the_history_records_every_iteration(planner):
    query = catalogue()["forest"]
    result = planner.plan(query, np.random.default_rng(0))
    history, arrived = result.history, result.history.arrived > 0
    assert result.solved
    assert len(history) == planner.iterations
    assert (np.diff(history.best) <= 0).all()
    assert history.best[-1] == pytest.approx(result.cost, abs=1e-9)
    assert (history.iteration_best[arrived] <= history.iteration_mean[arrived] + 1e-9).all()
    assert np.isinf(history.iteration_best[~arrived]).all()
    assert (history.best <= history.iteration_best + 1e-9).all()
    assert (history.arrived <= 50).all()
    assert arrived.all() or not isinstance(planner, AcoHan)
    assert result.work_unit == "ant steps"
    assert result.field.shape == query.grid.shape
    assert (result.field[~query.grid.free] == 0).all()


def test_elitism_concentrates_pheromone_on_the_best_path():
    """Pheromone concentrates in a narrow region, as in experiments 1 to 4 of the thesis."""
    query = catalogue()["forest"]

    def share_on_path(elitism):
        fractions = []
        for seed in range(3):
            result = AcoHan(ants=100, iterations=20, elitism=elitism).plan(query, np.random.default_rng(seed))
            fractions.append(result.field[tuple(result.cells.T)].sum() / result.field.sum())
        return float(np.mean(fractions))

    assert share_on_path(100) > 1.3 * share_on_path(0)


def test_by_the_equation_alone_no_ant_leaves_a_dead_end_but_a_least_weight_lets_them():
    query = catalogue()["trap"]
    literal = AcoHan(ants=50, iterations=3, min_weight=0.0).plan(query, np.random.default_rng(0))
    assert literal.status is PlanStatus.STOPPED
    assert "nothing arrived within 3 iterations" in literal.reason
    assert AcoHan(ants=50, iterations=3).plan(query, np.random.default_rng(0)).solved


def test_an_ant_draws_the_same_random_numbers_in_a_colony_of_any_size():
    query = catalogue()["forest"]
    graph = ColonyGraph.of(query)

    def lengths(ants):
        planner = AcoHan(ants=ants)
        construction = TourConstruction.of(planner, graph)
        planner.choice_weights(
            graph, np.zeros(len(graph.mask)), planner.heuristic_values(graph), construction.weights[0]
        )
        return construction.construct(np.random.default_rng(4))[0].lengths

    np.testing.assert_array_equal(lengths(5), lengths(9)[:5])


def test_a_time_budget_ends_the_plan_early_with_a_reason():
    planner = AcoHan(ants=20, iterations=10_000, time_budget=0.05)
    result = planner.plan(catalogue()["empty"], np.random.default_rng(0))
    assert result.solved
    assert 0 < len(result.history) < 10_000
    assert "time budget of 0.05 s" in result.reason


def test_the_progress_callback_runs_after_every_iteration():
    seen = []
    planner = AcoHan(ants=20, iterations=4)
    with on_progress(seen.append):
        result = planner.plan(catalogue()["empty"], np.random.default_rng(0))
    planner.plan(catalogue()["empty"], np.random.default_rng(0))  # outside the block, so not watched
    assert [p.done for p in seen] == [1, 2, 3, 4]
    assert seen[-1].total == 4
    assert seen[-1].best == pytest.approx(result.cost)


def interrupt_after(count):
    class Interrupting(list[Progress]):
        def append(self, state):
            super().append(state)
            if state.done == count:
                raise KeyboardInterrupt

    return Interrupting()


def test_ctrl_c_is_raised_outside_keep_best():
    with on_progress(interrupt_after(3).append), pytest.raises(KeyboardInterrupt):
        AcoHan(ants=20, iterations=50).plan(catalogue()["empty"], np.random.default_rng(0))


def test_ctrl_c_within_keep_best_returns_the_best_path_so_far():
    with on_progress(interrupt_after(3).append), keep_best():
        result = AcoHan(ants=20, iterations=50).plan(catalogue()["empty"], np.random.default_rng(0))
    assert result.status is PlanStatus.STOPPED
    assert not result.solved
    assert result.cost == pytest.approx(result.history.best[-1])
    assert result.cells[0].tolist() == list(catalogue()["empty"].start)
    assert result.reason == "interrupted after 3 of 50 iterations"
    assert len(result.history) == 3


def test_ctrl_c_before_any_ant_arrives_is_stopped_without_a_path():
    with on_progress(interrupt_after(1).append), keep_best():
        result = AcoHan(ants=5, max_steps=2).plan(catalogue()["empty"], np.random.default_rng(0))
    assert result.status is PlanStatus.STOPPED
    assert "interrupted" in result.reason
