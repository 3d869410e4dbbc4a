import math

import numpy as np
import pytest

from antdrive.planners import PlanStatus, PotentialFieldAnts, Query
from antdrive.planners.colonies import _kernels_pfaco
from antdrive.planners.colonies.colony import ColonyGraph
from antdrive.planners.colonies.pfaco import AntPool
from antdrive.runs.papers.maps import blocks
from antdrive.worlds import DIRECTIONS, Grid
from tests.planners.colonies.test_colony import solve
from tests.planners.worlds_to_solve import catalogue, optimum

OPEN = Query(Grid.from_free(np.ones((4, 5))), (0, 0), (3, 4))


@pytest.mark.parametrize("repulsion", [8.0, -8.0])  # eq. 7, taken literally, adds U_rep: obstacles attract
def test_the_potential_matches_a_hand_calculation(repulsion):
    free = np.ones((4, 5))
    free[0, 4] = 0
    planner = PotentialFieldAnts(attraction=2.0, repulsion=repulsion, influence=2.0)
    field = planner.potential(Query(Grid.from_free(free), (0, 0), (3, 4))).reshape(4, 5)
    # k/2 d^2 from the start (eq. 9), less k_rep/2 (1/d - 1/d0)^2 within d0 of a blocked cell (eq. 11)
    beside = 9.0 - repulsion / 2 * (1 - 0.5) ** 2
    aslant = 1.0 * (1 + 9) - repulsion / 2 * (1 / math.sqrt(2) - 0.5) ** 2
    expected = {(0, 0): 0.0, (3, 4): 25.0, (0, 3): beside, (1, 3): aslant, (2, 4): 20.0}
    for cell, value in expected.items():
        assert field[cell] == pytest.approx(value + 1.0), cell  # shifted above 0 by attraction / 2
    assert field[0, 4] == 0


def test_a_potential_measured_from_the_goal_is_highest_there():
    field = PotentialFieldAnts(attraction=2.0, repulsion=0.0, field="goal").potential(OPEN).reshape(4, 5)
    assert field[0, 0] == pytest.approx(1.0)  # the farthest cell, 5 from the goal
    assert field[3, 4] == pytest.approx(25.0 + 1.0)
    assert field[3, 3] == pytest.approx(16.0 + 1.0)


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        # U of the cells (0, 0) to (1, 2) is d^2 + 1: 1, 2, 5 and 2, 3, 6; k_att = 2.
        ("letter", {"east": 5.0, "west": 1.0, "north": 3.0, "north east": 6.0, "north west": 2.0}),
        ("rise", {"east": 3.0, "west": 1.0, "north": 1.0, "north east": 4.0, "north west": 1.0}),
        ("local", {"east": 5.0, "west": 1.0, "north": 3.0, "north east": 6.0, "north west": 2.0}),
        # The distances of these cells from the goal (1, 2).
        (
            "distance",
            {"east": 1.0, "west": 1 / math.sqrt(5), "north": 1.0, "north east": 100.0, "north west": 0.5},
        ),
    ],
)
def test_attractions_match_a_hand_calculation(form, expected):
    query = Query(Grid.from_free(np.ones((2, 3))), (0, 0), (1, 2))
    planner = PotentialFieldAnts(attraction=2.0, repulsion=0.0, form=form)
    graph = ColonyGraph.of(query)
    drawn = planner.attractions(graph, planner.potential(query))
    step = {(0, 1): "east", (0, -1): "west", (1, 0): "north", (1, 1): "north east", (1, -1): "north west"}
    attraction = {step[d]: drawn[1, k] for k, d in enumerate(DIRECTIONS) if drawn[1, k]}
    assert attraction == pytest.approx(expected)


def test_a_local_potential_is_measured_from_the_lowest_cell_around():
    query = Query(Grid.from_free(np.ones((1, 9))), (0, 0), (0, 8))
    planner = PotentialFieldAnts(attraction=2.0, repulsion=0.0, form="local")
    drawn = planner.attractions(ColonyGraph.of(query), planner.potential(query))
    assert sorted(drawn[6][drawn[6] > 0]) == pytest.approx([1.0, 49.0 - 25.0 + 1.0])  # back to 5, on to 7
    assert sorted(drawn[8][drawn[8] > 0]) == pytest.approx([1.0])
    letter = PotentialFieldAnts(attraction=2.0, repulsion=0.0, form="letter")
    drawn = letter.attractions(ColonyGraph.of(query), letter.potential(query))
    assert sorted(drawn[6][drawn[6] > 0]) == pytest.approx([26.0, 50.0])


def test_without_a_memory_walks_return_to_cells_and_the_path_loses_its_loops():
    query = Query(Grid.from_free(np.ones((6, 6))), (0, 0), (5, 5))
    planner = PotentialFieldAnts(ants=4, ranks=3, iterations=4, form="letter", memory="none")
    graph, rng = ColonyGraph.of(query), np.random.default_rng(0)
    pool = AntPool.of(planner, graph, rng)
    pool.run(np.ones(36), np.where(graph.at_neighbours(np.ones(36)) > 0, 1.0, 0.0), 1.0)
    assert len(set(pool.best.tolist())) == len(pool.best)
    walk = pool.ranking.walks[0, : pool.ranking.sizes[0]].tolist()
    assert len(set(walk)) < len(walk)
    result = solve(planner, query)
    assert result.solved
    assert result.history.best[-1] == pytest.approx(result.cost)


def test_ants_cross_a_large_map_unless_they_follow_the_letter():
    # The claim of lee2008 with a fifth of its ants; docs/papers/lee2008.md has the figures with all ants.
    query = blocks(100, 100, 25, 16, 300)
    gaps = {
        form: solve(PotentialFieldAnts(ants=100, iterations=60, form=form), query).cost
        for form in ("local", "rise", "letter", "distance")
    }
    assert optimum(query) <= min(gaps["local"], gaps["rise"])
    assert max(gaps["local"], gaps["rise"]) <= 1.2 * optimum(query)
    assert not gaps["letter"] <= 2 * optimum(query)


def test_a_potential_measured_from_the_goal_gives_shorter_paths_to_a_goal_that_is_not_the_farthest_cell():
    query = catalogue()["slalom"]
    start, goal = (solve(PotentialFieldAnts(iterations=30, field=field), query).cost for field in ("start", "goal"))
    assert optimum(query) <= goal < 1.08 * optimum(query) < start


def test_the_ranking_list_is_kept_by_length_times_cells():
    room, count = 12, 5
    ranking = _kernels_pfaco.Ranking(
        walks=np.zeros((count, room), dtype=np.int32),
        sizes=np.zeros(count, dtype=np.int64),
        costs=np.zeros(count),
        order=np.zeros(count, dtype=np.int64),
        counts=np.zeros(2, dtype=np.int64),
    )
    rng, seen = np.random.default_rng(2), []
    for number in range(60):
        size, length = int(rng.integers(2, room)), float(rng.uniform(1, 9))
        walk = np.full(room, number, dtype=np.int32)
        listed = sorted(seen)[:count]
        rank = _kernels_pfaco.enter(walk, size, length, ranking)
        seen.append(size * length)  # eq. 15
        better = sum(cost <= size * length for cost in listed)
        assert rank == (-1 if better == count else better)
        best = sorted(seen)[:count]
        np.testing.assert_allclose(ranking.costs[ranking.order[: len(best)]], best)
        if rank >= 0:
            row = ranking.order[rank]
            assert ranking.sizes[row] == size
            assert (ranking.walks[row, :size] == number).all()
    assert ranking.counts[_kernels_pfaco.LISTED] == count


def test_the_stage_follows_from_the_number_of_entries():
    planner = PotentialFieldAnts(ants=30, ranks=10)
    assert [planner.stage(n) for n in (0, 19, 20, 49, 50, 1000)] == [1, 1, 2, 2, 3, 3]


def test_converged_pheromone_is_rebuilt_from_the_list():
    planner = PotentialFieldAnts(ants=4, ranks=20, deposit=2.0, min_pheromone=0.5)
    graph, rng = ColonyGraph.of(OPEN), np.random.default_rng(0)
    pool = AntPool.of(planner, graph, rng)
    for rank in range(20):
        walk = np.array([0, 6 if rank < 2 else 5, 12, 19], dtype=np.int32)
        _kernels_pfaco.enter(walk, 4, 1.0 + rank, pool.ranking)
    free, trail = np.ones(20, dtype=np.bool_), np.full(20, 9.0)
    planner.rebuild(trail, free, 2, pool, rng)  # the best tenth: two paths
    amounts = 2.0 * (1 - np.arange(20) / 20)
    assert trail[6] == pytest.approx(0.5 + amounts[:2].sum())
    assert trail[5] == 0.5
    planner.rebuild(trail, free, 3, pool, rng)
    assert trail[5] == pytest.approx(0.5 + amounts[2:].sum())
    assert trail[12] == pytest.approx(0.5 + amounts.sum())
    assert trail[1] == 0.5
    planner.rebuild(trail, free, 1, pool, rng)
    assert 0.5 <= trail.min() < trail.max() < 1


def test_pheromone_decays_every_tick_but_not_below_its_minimum():
    # A blocked-in start: walks end at once, so an iteration of four ants is one tick.
    free = np.ones((3, 3))
    free[0, 1] = free[1, 0] = free[1, 1] = 0
    query = Query(Grid.from_free(free), (0, 0), (2, 2))
    planner = PotentialFieldAnts(ants=4, evaporation=0.5, min_pheromone=0.3, convergence=1e-9)
    pool = AntPool.of(planner, ColonyGraph.of(query), np.random.default_rng(0))
    trail = np.array([1, 0, 1, 0, 0, 0.4, 2, 1, 1])
    arrivals, steps = pool.run(trail, np.ones((9, 8)), 1.0)
    np.testing.assert_allclose(trail, [1, 0, 0.5, 0, 0, 0.3, 1, 0.5, 0.5])
    assert (len(arrivals), steps) == (0, 4)


def test_ants_with_generations_wait_for_the_last_before_pheromone_changes():
    query = Query(Grid.from_free(np.ones((1, 4))), (0, 0), (0, 3))  # a corridor, so all walks take three ticks
    planner = PotentialFieldAnts(ants=2, ranks=4, evaporation=0.5, deposit=8.0, generations=True, convergence=1e-9)
    graph = ColonyGraph.of(query)
    pool = AntPool.of(planner, graph, np.random.default_rng(0))
    trail = np.ones(4)
    arrivals, steps = pool.run(trail, np.ones((4, 8)), 1.0)
    assert (arrivals.tolist(), steps) == ([3.0, 3.0], 6)
    assert trail == pytest.approx([0.5 + 8.0 + 6.0] * 4)  # evaporated once, then the first rank and the second of four
    assert pool.ants.sizes.tolist() == [1, 1]  # back at the start
    pool = AntPool.of(
        PotentialFieldAnts(ants=2, ranks=4, evaporation=0.5, deposit=8.0), graph, np.random.default_rng(0)
    )
    pool.run(trail := np.ones(4), np.ones((4, 8)), 1.0)
    assert trail == pytest.approx([(0.25 + 8.0 + 6.0) / 2] * 4)  # evaporates every tick, also after the deposits


def test_paths_come_close_to_the_shortest():
    query = catalogue()["forest"]
    result = solve(PotentialFieldAnts(), query)
    assert result.cost <= 1.1 * optimum(query)
    short = solve(PotentialFieldAnts(shortcut=True), query)
    assert optimum(query) - 1e-9 <= short.cost <= 1.05 * optimum(query)


def test_backtracking_ants_leave_dead_ends():
    free = np.zeros((5, 30), dtype=np.bool_)
    free[2] = True
    free[1, ::2] = free[3, 1::2] = True  # teeth of a double comb, each a dead end
    query = Query(Grid.from_free(free), (2, 0), (2, 29))
    assert not PotentialFieldAnts().capabilities.complete
    assert PotentialFieldAnts(backtrack=True).capabilities.complete
    lost = solve(PotentialFieldAnts(ants=3, iterations=2, beta_1=0.0, max_steps=29), query)
    assert lost.status is PlanStatus.STOPPED
    assert solve(PotentialFieldAnts(ants=3, iterations=2, beta_1=0.0, backtrack=True), query).cost == pytest.approx(29)
