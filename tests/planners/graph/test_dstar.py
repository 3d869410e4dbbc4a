"""D* and D* Lite: costs, queue and repairs."""

import heapq
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.planners import DStar, DStarLite, Query
from antdrive.planners.graph import _kernels_incremental as kernels
from antdrive.planners.graph._kernels_incremental import DIAGONAL, STRAIGHT
from antdrive.worlds import Grid
from tests.planners.replanning.agreement import World, agree

RNG = np.random.default_rng(0)


def test_integer_costs_solve_pells_equation():
    assert abs(DIAGONAL**2 - 2 * STRAIGHT**2) == 1


whole = st.integers(0, 10**8)


@given(whole, whole, whole, whole)
def test_integer_costs_compare_as_the_lengths_do(a, b, c, d):
    """Compare a + b sqrt(2) with c + d sqrt(2) exactly, by squaring."""
    p, q = a - c, b - d  # the sign of p + q sqrt(2)
    sign = (p > 0) - (p < 0) if p * p > 2 * q * q else (q > 0) - (q < 0)
    cost = p * STRAIGHT + q * DIAGONAL
    assert (cost > 0) - (cost < 0) == sign


@given(st.lists(st.tuples(st.integers(0, 19), st.integers(0, 5), st.integers(0, 5)), max_size=80))
def test_the_heap_keeps_its_order_after_any_insertions_and_removals(operations):
    heap, place = np.empty((20, 3), dtype=np.int64), np.full(20, -1, dtype=np.int32)
    keys = {}
    size = 0
    for cell, first, second in operations:
        if first == 5 and cell in keys:
            size = kernels.take(heap, place, size, cell)
            del keys[cell]
        else:
            size = kernels.put(heap, place, size, cell, first, second)
            keys[cell] = first, second
        assert size == len(keys)
        if keys:
            assert tuple(heap[0, :2]) == min(keys.values())
    drained = []
    while size:
        drained.append(tuple(map(int, heap[0, :2])))
        size = kernels.take(heap, place, size, int(heap[0, 2]))
    assert drained == heapq.nsmallest(len(keys), keys.values())
    assert (place == -1).all()


def test_it_expands_cells_towards_the_robot_only():
    query = Query(Grid.from_free(np.ones((60, 60))), (30, 5), (30, 50))
    lite, plain = (planner.plan(query, RNG).work for planner in (DStarLite(), DStar()))
    assert lite <= 60 < plain


def test_keys_stay_right_through_a_long_drive_with_changes_behind_and_ahead():
    """Thousands of moves between few repairs: the case for k_m."""
    rng = np.random.default_rng(4)
    query = Query(Grid.from_free(rng.random((30, 30)) >= 0.15), (0, 0), (29, 29))
    replanner, world = DStarLite().replanner(query, np.random.default_rng(0)), World(query.grid)
    free = np.argwhere(query.grid.free)
    for turn in range(300):
        for r, c in rng.choice(free, size=5):
            replanner.move((int(r), int(c)))
        cells = rng.integers(0, 30, (3, 2))
        edit = replanner.block if turn % 2 else replanner.clear
        edit(cells)
        world.free[tuple(cells.T)] = turn % 2 == 0
        agree(replanner, world)


def test_equally_long_paths_do_not_lead_in_circles():
    """An empty grid has many shortest paths, and every repair leaves cells with outdated costs."""
    query = Query(Grid.from_free(np.ones((25, 25))), (12, 0), (12, 24))
    replanner, world = DStarLite().replanner(query, np.random.default_rng(0)), World(query.grid)
    for row, column in itertools.product((12, 11, 13, 10), (12, 8, 16)):
        for tell, value in ((replanner.block, False), (replanner.clear, True)):
            tell([(row, column)])
            world.free[row, column] = value
            assert agree(replanner, world)
    assert replanner.result().cost == 24


def test_the_cost_of_thousands_of_steps_is_exact():
    free = np.ones((81, 81), dtype=np.bool_)
    free[1::4, :-1] = False
    free[3::4, 1:] = False
    query = Query(Grid.from_free(free), (0, 0), (80, 80))
    result = DStarLite().plan(query, RNG)
    assert abs(result.cost - World(query.grid).optimum(query.start, query.goal)) < 1e-9
    assert math.isfinite(result.cost)


@pytest.mark.parametrize("size", [1, 2])
def test_grids_of_a_few_cells_are_solved(size):
    query = Query(Grid.from_free(np.ones((size, size))), (0, 0), (size - 1, size - 1))
    assert DStar().plan(query, RNG).cost == pytest.approx((size - 1) * 2**0.5)
