import itertools
import math

import numpy as np
import pytest

from antdrive.planners import PLANNERS, AStar, Dijkstra, Query, path_cost, reachable
from antdrive.worlds import DIRECTIONS, Grid
from tests.planners.worlds_to_solve import catalogue, optimum, optimum_by_scipy, random_discs, random_query, thinned

RNG = np.random.default_rng(0)  # unused by searches
SEARCHES = [Dijkstra(), AStar()]


def check(query):
    floor = optimum(query)
    assert reachable(query) == math.isfinite(floor)
    for search in SEARCHES:
        result = search.plan(query, RNG)
        assert result.solved == math.isfinite(floor)
        assert result.cost == pytest.approx(floor, abs=1e-9)
        if result.solved:
            assert result.cost == pytest.approx(path_cost(result.cells, query.grid.cell), abs=1e-9)


@pytest.mark.parametrize(
    ("draw", "count"),
    [
        (random_query, 100),
        (random_discs, 40),
        pytest.param(lambda rng: random_query(rng, largest=40), 1000, marks=pytest.mark.slow),
        pytest.param(lambda rng: random_discs(rng, count=int(rng.integers(1, 60))), 1000, marks=pytest.mark.slow),
    ],
    ids=["grids", "discs", "many grids", "many discs"],
)
def test_costs_equal_the_oracle(draw, count):
    rng = np.random.default_rng(1)
    for _ in range(count):
        check(draw(rng))


@pytest.mark.parametrize("side", [9, 40])
def test_costs_equal_the_oracle_for_any_set_of_two_way_moves(side):
    """The search must not assume a relation between the moves of neighbouring cells."""
    rng = np.random.default_rng(4)
    for _ in range(60):
        query = thinned(rng, side, cut=0.3)
        floor = optimum_by_scipy(query)
        for search in SEARCHES:
            assert search.plan(query, RNG).cost == pytest.approx(floor, abs=1e-9)


def test_the_first_path_that_closes_the_goal_may_not_be_the_shortest():
    """Two corridors of 24 straight (24) and 17 diagonal moves (24.04): both end in one bucket of the open list."""
    rows_of_diagonals = [20, 21, 22, 21, 20, 21, 22, 21, 20, 21, 20, 19, 20, 19, 18, 17, 16, 15]
    diagonals = [(row, 5 + i) for i, row in enumerate(rows_of_diagonals)]
    turns = [
        (20, 5), (18, 5), (18, 6), (17, 6), (17, 10), (16, 10), (16, 14), (15, 14), (15, 17), (16, 17), (16, 19),
    ]  # fmt: skip
    straights = _corridor([*turns, (15, 19), (15, 22)])
    tail = [(15, 22), (15, 23), (15, 24), (16, 25), (17, 26), (18, 27), (19, 28), (20, 29)]
    assert (len(straights), len(diagonals)) == (25, 18)

    moves = np.zeros((30, 40), dtype=np.uint8)
    for path in (diagonals, straights, tail):
        for (r, c), (rn, cn) in itertools.pairwise(path):
            k = DIRECTIONS.index((rn - r, cn - c))
            moves[r, c] |= 1 << k
            moves[rn, cn] |= 1 << (k + 4) % 8
    free = moves > 0
    for array in (free, moves):
        array.setflags(write=False)  # as a grid's: kernels are compiled for that
    query = Query(Grid(free, moves), (20, 5), (20, 29))
    for search in SEARCHES:
        assert search.plan(query, RNG).cost == pytest.approx(26 + 5 * math.sqrt(2), abs=1e-9)


def test_grid_paths_are_longer_than_the_exact_shortest_as_the_docstring_says():
    gaps = []
    for query in catalogue().values():
        exact = PLANNERS["tangent"].plan(query, RNG)
        gaps.append(AStar().plan(query, RNG).cost / exact.line_length - 1)
    assert len(gaps) == 5
    assert (float(np.median(gaps)), max(gaps)) == pytest.approx((0.117, 0.212), abs=0.001)
    ground = Query(Grid.from_free(np.ones((200, 200))), (0, 0), (82, 198))  # 22.5 degrees: 2.414 to the side of 1
    assert AStar().plan(ground, RNG).cost / math.hypot(82, 198) == pytest.approx(1.0824, abs=1e-4)


def _corridor(turns):
    cells = [turns[0]]
    for row, col in turns[1:]:
        while cells[-1] != (row, col):
            r, c = cells[-1]
            cells.append((r + int(np.sign(row - r)), c + int(np.sign(col - c))))
    return cells


def test_the_ring_of_buckets_suffices_for_a_long_maze():
    free = np.ones((61, 61), dtype=np.bool_)
    free[1::4, :-1] = False
    free[3::4, 1:] = False
    check(Query(Grid.from_free(free), (0, 0), (60, 60)))


def test_the_open_list_grows():
    """From the middle of an empty grid, the open list outgrows its initial 1024 entries."""
    query = Query(Grid.from_free(np.ones((701, 701))), (350, 350), (700, 699))
    result = Dijkstra().plan(query, RNG)
    assert result.cost == pytest.approx(1 + 349 * math.sqrt(2), abs=1e-9)
    assert result.work > 480_000


def test_astar_expands_no_more_cells_than_dijkstra_on_an_empty_grid():
    query = Query(Grid.from_free(np.ones((50, 50))), (25, 5), (30, 45))
    informed, blind = (s.plan(query, RNG).work for s in (AStar(), Dijkstra()))
    assert informed <= 41 < blind
