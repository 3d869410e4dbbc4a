"""Properties of every incremental search."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.planners import DStar, DStarLite, PlanStatus, Query
from antdrive.worlds import Grid
from tests.planners.replanning.agreement import World, agree, change_at_random
from tests.planners.worlds_to_solve import random_discs, random_query

BOTH = pytest.mark.parametrize("planner", [DStar(), DStarLite()], ids=lambda p: type(p).__name__)
RNG = np.random.default_rng(0)  # unused by searches


def open_ground(rows=12, cols=12):
    return Query(Grid.from_free(np.ones((rows, cols))), (1, 1), (rows - 2, cols - 2))


@BOTH
@pytest.mark.parametrize(
    ("seed", "sequences", "turns", "largest", "discs"),
    [(2, 20, 8, 24, 14), *(pytest.param(seed, 200, 15, 40, 60, marks=pytest.mark.slow) for seed in ([3, 0], [3, 1]))],
)
def test_repairs_equal_the_oracle(planner, seed, sequences, turns, largest, discs):
    rng, solved = np.random.default_rng(seed), 0
    for _ in range(sequences):
        for query in (random_query(rng, largest), random_discs(rng, int(rng.integers(1, discs)))):
            solved += change_at_random(lambda q: planner.replanner(q, RNG), query, rng, turns)
    assert solved > 3 * sequences * turns // 4  # most must have a path for the test to be meaningful


changes = st.lists(
    st.tuples(
        st.sampled_from(["block", "clear", "move", "ask"]),
        st.lists(st.tuples(st.integers(0, 5), st.integers(0, 6)), min_size=1, max_size=4),
    ),
    max_size=14,
)


@BOTH
@settings(max_examples=60, deadline=None)
@given(bits=st.lists(st.booleans(), min_size=42, max_size=42), edits=changes)
def test_repairs_equal_the_oracle_after_any_sequence_of_changes(planner, bits, edits):
    free = np.array(bits).reshape(6, 7)
    query = Query(Grid.from_free(free), (0, 0), (5, 6))
    world, replanner = World(query.grid), planner.replanner(query, RNG)
    for what, cells in edits:
        if what == "ask":
            agree(replanner, world)
        elif what == "move":
            replanner.move(cells[0])
        else:
            getattr(replanner, what)(cells)
            world.free[tuple(np.transpose(cells))] = what == "clear"
    agree(replanner, world)


@BOTH
@pytest.mark.parametrize("end", ["start", "goal"])
def test_a_blocked_end_is_named_and_can_be_cleared(planner, end):
    replanner = planner.replanner(open_ground(), RNG)
    cost = replanner.result().cost
    replanner.block([getattr(replanner.query, end)])
    blocked = replanner.result()
    assert blocked.status is PlanStatus.NO_PATH
    assert f"the {end} cell" in blocked.reason
    replanner.clear([getattr(replanner.query, end)])
    assert replanner.result().cost == cost


@BOTH
def test_the_first_query_is_unchanged_and_the_present_one_is_read_only(planner):
    query = open_ground()
    replanner = planner.replanner(query, RNG)
    replanner.block([(5, 5)])
    assert query.grid.free.all()
    now = replanner.query.grid
    assert not now.free[5, 5]
    assert now.moves[5, 5] == 0
    with pytest.raises(ValueError, match="read-only"):
        now.free[0, 0] = False


@BOTH
def test_a_local_change_takes_a_fraction_of_the_work(planner):
    rng = np.random.default_rng(0)
    fractions = []
    for _ in range(10):
        free = rng.random((200, 200)) >= 0.2
        free[0, 0] = free[199, 199] = True
        replanner = planner.replanner(Query(Grid.from_free(free), (0, 0), (199, 199)), RNG)
        path = replanner.result().cells
        if len(path):
            replanner.block([path[8]])
            repaired = replanner.result()
            fresh = planner.plan(replanner.query, RNG)
            assert repaired.cost == pytest.approx(fresh.cost, abs=1e-9)
            fractions.append(repaired.work / fresh.work)
    assert len(fractions) > 5
    assert np.median(fractions) < 0.02


@BOTH
def test_named_changes_give_the_same_plans_as_comparing_grids(planner):
    rng = np.random.default_rng(5)
    for _ in range(20):
        free = rng.random((30, 40)) < 0.8
        free[[1, -2], [1, -2]] = True
        query = Query(Grid.from_free(free), (1, 1), (28, 38))
        one, other = (planner.replanner(query, RNG) for _ in range(2))
        for _ in range(5):
            one.result(), other.result()
            grid = Grid.from_free(free ^ (rng.random(free.shape) < 0.02))
            before = one.query.grid
            cells = np.flatnonzero((grid.free != before.free) | (grid.moves != before.moves))
            assert one.change(grid, cells) == other.change(grid)
            np.testing.assert_array_equal(one.query.grid.free, grid.free)
            np.testing.assert_array_equal(one.query.grid.moves, grid.moves)
            a, b = one.result(), other.result()
            np.testing.assert_array_equal(a.cells, b.cells)
            assert (a.cost, a.work) == (b.cost, b.work)


@BOTH
def test_misuse_is_refused_and_changes_nothing(planner):
    replanner = planner.replanner(open_ground(), RNG)
    with pytest.raises(ValueError, match=r"^cells: \(3, 12\) is outside the grid of 12 rows and 12 columns"):
        replanner.block([(2, 2), (3, 12)])
    assert replanner.query.grid.free.all()
    with pytest.raises(ValueError, match=r"^start: cell"):
        replanner.move((-1, 0))
    with pytest.raises(ValueError, match=r"^grid: must have the shape \(12, 12\), got \(3, 3\)"):
        replanner.change(Grid.from_free(np.ones((3, 3))))
    assert replanner.block([]) == 0
    assert replanner.result().solved
