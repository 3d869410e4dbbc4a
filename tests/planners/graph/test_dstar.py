from __future__ import annotations

import numpy as np
import pytest

from antdrive.planners import DStar, Query
from antdrive.planners.graph._kernels_incremental import COST, NEVER, STRAIGHT
from antdrive.planners.graph.dstar import DStarSearch
from antdrive.worlds import DIRECTIONS, Grid
from tests.planners.replanning.agreement import World, agree

RNG = np.random.default_rng(0)


def corridor() -> DStarSearch:
    """Two ways to the goal: a short one along row 1, a long one along row 5."""
    free = np.zeros((7, 12), dtype=np.bool_)
    free[1, 1:11] = free[5, 1:11] = True
    free[1:6, [1, 10]] = True
    return DStar().replanner(Query(Grid.from_free(free), (1, 1), (1, 10)), RNG)


def test_a_blocked_corridor_raises_the_costs_of_paths_through_it() -> None:
    repair = corridor()
    assert repair.result().cost == 9
    repair.block([(1, 6)])
    assert repair.result().cost == 4 + 9 + 4
    heights = repair._h.reshape(7, 12)
    assert heights[1, 1] == 17 * STRAIGHT
    assert heights[1, 5] >= NEVER  # RAISE; what the robot does not need is not worked out
    assert heights[1, 7] == 3 * STRAIGHT  # between the block and the goal nothing changed
    repair.move((1, 5))
    assert repair.result().cost == 17 + 4


def test_a_new_gap_lowers_the_costs_of_cells_behind_it() -> None:
    repair = corridor()
    repair.block([(1, 6)])
    repair.result()
    repair.clear([(1, 6)])
    assert repair.result().cost == 9
    assert repair._h.reshape(7, 12)[1, 5] == 5 * STRAIGHT


def test_a_change_away_from_the_path_is_not_processed() -> None:
    repair = corridor()
    repair.result()
    repair.block([(3, 1)])  # farther from the goal than the robot
    assert repair.result().work == 0


def test_backpointers_of_processed_states_lead_to_the_goal() -> None:
    rng = np.random.default_rng(5)
    query = Query(Grid.from_free(rng.random((30, 30)) >= 0.2), (0, 0), (29, 29))
    repair, world = DStar().replanner(query, RNG), World(query.grid)
    for _ in range(20):
        for tell, value in ((repair.block, False), (repair.clear, True)):
            cells = rng.integers(1, 29, (4, 2))
            tell(cells)
            world.free[tuple(cells.T)] = value
        agree(repair, world)
        floor = int(repair._heap[0, 0]) if repair._state[0] else NEVER
        settled = np.flatnonzero((repair._h < min(floor, NEVER)) & (repair._place < 0) & (repair._h > 0))
        for cell in settled:
            k = int(repair._back[cell])
            row, col = divmod(int(cell), 30)
            parent = (row + DIRECTIONS[k][0]) * 30 + col + DIRECTIONS[k][1]
            assert repair.query.grid.moves[row, col] >> k & 1
            assert repair._h[cell] == repair._h[parent] + COST[k]


@pytest.mark.parametrize("size", [1, 2])
def test_grids_of_a_few_cells_are_solved(size: int) -> None:
    query = Query(Grid.from_free(np.ones((size, size))), (0, 0), (size - 1, size - 1))
    assert DStar().plan(query, RNG).cost == pytest.approx((size - 1) * 2**0.5)
