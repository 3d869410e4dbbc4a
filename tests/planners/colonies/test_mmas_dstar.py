import heapq
import math

import numpy as np
import pytest

from antdrive.planners import MaxMinDStar, Query
from antdrive.runs.papers.maps import environments
from antdrive.worlds import DIRECTIONS, Grid
from tests.planners.colonies.test_colony import solve
from tests.planners.worlds_to_solve import catalogue, optimum, random_query


def environment_5f():
    """Return a world like hasan's: start and goal on the left, separated by a horizontal wall that is open on the right."""
    free = np.random.default_rng(5).random((50, 50)) >= 0.06
    free[23:26] = True
    free[24, :47] = False
    return Query(Grid.from_free(free), (23, 16), (25, 15))


def pheromone_by_heap(query):
    """Return the cost of the path to the goal, at 1 or 1.4 per move, times 0.98."""
    cost, queue = {query.goal: 0.0}, [(0.0, query.goal)]
    while queue:
        here, cell = heapq.heappop(queue)
        for k, (dr, dc) in enumerate(DIRECTIONS):
            if int(query.grid.moves[cell]) >> k & 1:
                near, there = (cell[0] + dr, cell[1] + dc), here + (1.4 if dr and dc else 1.0)
                if there < cost.get(near, math.inf) - 1e-9:
                    cost[near] = there
                    heapq.heappush(queue, (there, near))
    return {cell: 0.98 * value for cell, value in cost.items()}


def test_pheromone_is_cost_times_the_fraction_retained():
    rng = np.random.default_rng(4)
    for _ in range(20):
        query = random_query(rng, largest=15)
        expected = pheromone_by_heap(query)
        if query.start not in expected:
            continue
        _, pheromone, work, notes = MaxMinDStar(gates=False).spread(query)
        field = pheromone.reshape(query.grid.shape)
        assert not notes
        assert work == np.isfinite(field).sum()
        # Cells nearer to the goal than the start have their final pheromone; spreading stops at the start.
        for cell, value in expected.items():
            if value < expected[query.start] - 1e-9:
                assert field[cell] == pytest.approx(value)


@pytest.mark.parametrize("alpha_max", [26.0, 1.0])
def test_cycles_in_front_of_a_wall_are_detected_and_broken(alpha_max):
    query = environment_5f()
    result = solve(MaxMinDStar(alpha_max=alpha_max), query)
    assert result.solved
    assert "went in circles" in result.reason
    assert ("beta was set to 0" in result.reason) == (alpha_max == 1.0)
    assert len({tuple(cell) for cell in result.cells}) == len(result.cells)
    assert result.cost <= 1.1 * optimum(query)
    assert result.work_unit == "cells propagated"


def test_on_an_empty_grid_the_exponents_stay_the_same():
    result = solve(MaxMinDStar(), catalogue()["empty"])
    assert result.reason == ""
    assert result.cost == pytest.approx(optimum(catalogue()["empty"]))
    assert np.isfinite(result.field).all()


def test_gate_cells_are_closed_unless_there_is_no_other_path():
    free = np.fliplr(~np.eye(9, dtype=np.bool_))  # a wall from corner to corner
    free[4, 4] = True  # between two of its cells: a gate
    gate = Query(Grid.from_free(free), (1, 1), (7, 7))
    result = solve(MaxMinDStar(), gate)
    assert "reopened 1 gate cells" in result.reason
    assert result.cost == pytest.approx(optimum(gate))
    free[6:9, :3] = True  # a wider detour
    wide = Query(Grid.from_free(free), (1, 1), (7, 7))
    around = solve(MaxMinDStar(), wide)
    assert "gate" not in around.reason
    assert [4, 4] not in around.cells.tolist()
    assert solve(MaxMinDStar(gates=False), wide).cost == pytest.approx(optimum(wide))


def test_it_always_arrives():
    rng = np.random.default_rng(8)
    for _ in range(60):
        query = random_query(rng)
        assert solve(MaxMinDStar(), query).solved == math.isfinite(optimum(query))


def test_without_distance_the_path_is_the_cheapest_at_one_and_one_point_four():
    rng = np.random.default_rng(9)
    for _ in range(20):
        query = random_query(rng)
        expected = pheromone_by_heap(query)
        if query.start in expected and query.start != query.goal:
            cells = solve(MaxMinDStar(beta=0.0, gates=False), query).cells
            steps = np.abs(np.diff(cells, axis=0)).sum(axis=1)
            assert 0.98 * np.where(steps == 2, 1.4, 1.0).sum() == pytest.approx(expected[query.start])


def test_closing_cells_leaves_the_moves_of_a_grid_with_these_cells_blocked():
    from antdrive.planners.colonies._kernels_mmas_dstar import close_cells

    rng = np.random.default_rng(6)
    for _ in range(100):
        free = rng.random(rng.integers(1, 9, 2)) >= 0.2
        cells = rng.integers(0, free.shape, (int(rng.integers(0, 5)), 2))
        moves = Grid.from_free(free).moves.copy()
        close_cells(moves, cells)
        free[tuple(cells.T)] = False
        np.testing.assert_array_equal(moves, Grid.from_free(free).moves)


def test_evaporation_changes_no_path():
    rng = np.random.default_rng(10)
    for _ in range(10):
        query = random_query(rng)
        one, other = (solve(MaxMinDStar(evaporation=lost), query).cells.tolist() for lost in (0.02, 0.6))
        assert one == other


def test_a_cell_that_keeps_its_first_cost_may_have_a_higher_one():
    query = environments()["4d concentric circles"]
    (_, lowest, *_), (_, first, *_) = (
        MaxMinDStar(gates=False, lowers=lowers).spread(query) for lowers in (True, False)
    )
    final = lowest < lowest[query.start_node]
    assert (first[final] >= lowest[final] - 1e-9).all()
    assert (first[final] > lowest[final] + 1e-9).any()
    assert solve(MaxMinDStar(beta=0.0, lowers=False), query).solved


def test_with_fixed_exponents_an_ant_that_circles_has_no_path():
    query = environment_5f()
    result = solve(MaxMinDStar(alpha_max=None), query)
    assert not result.solved
    assert result.reason == "the ant went in circles with alpha 1 and beta 1"
    assert solve(MaxMinDStar(alpha_max=None), catalogue()["empty"]).solved
    robot = MaxMinDStar(alpha_max=None).agent(query, np.random.default_rng(0))
    for _ in range(200):
        robot.step([])
    assert not robot.arrived
    assert robot.stats.cycles
    raised = MaxMinDStar().agent(query, np.random.default_rng(0))
    for _ in range(200):
        raised.step([])
    assert raised.arrived
