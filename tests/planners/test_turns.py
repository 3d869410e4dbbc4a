"""Planners on grids with turns: by their capability they plan and replan there, validly and whenever there is a path."""

import dataclasses
import functools
import heapq
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.planners import PLANNERS, Query, capabilities_of, load_planner, replanner_for, validate_plan
from antdrive.planners.iterative import IterativePlanner
from antdrive.worlds import DIRECTIONS, rasterise
from tests.worlds.test_turns import LONG, world_of

ABLE = [name for name in PLANNERS if capabilities_of(load_planner(name)).turns]
OPTIMAL = ["astar", "dijkstra", "dstar", "dstar-lite"]
REPLANNED = [name for name in ABLE if not capabilities_of(load_planner(name)).needs_motions]
REPAIRED = [name for name in ABLE if capabilities_of(load_planner(name)).own_replanner]


def quick(name):
    planner = load_planner(name)
    return dataclasses.replace(planner, iterations=3) if isinstance(planner, IterativePlanner) else planner


@functools.cache
def ground(seed, count=7):
    return rasterise(world_of(seed, count), 0.25, 0.6, LONG)


def query_of(grid, start, goal, heading):
    """A query between free cells by their numbers; the start is the node of a free heading."""
    free = np.argwhere(grid.free)
    row, col = free[start % len(free)].tolist()
    headings = np.flatnonzero(grid.turns.label[row * grid.shape[1] + col] >= 0)
    label = int(grid.turns.label[row * grid.shape[1] + col, headings[heading % len(headings)]])
    return Query(grid, (row, col), tuple(free[goal % len(free)].tolist()), start_label=label)


def shortest(grid, blocked, start, heading, goal):
    """The length of the shortest path by Dijkstra's algorithm over nodes, from a cell's label of a heading; loops only."""
    label, cols = grid.turns.label.tolist(), grid.shape[1]
    first = (start, label[start[0] * cols + start[1]][heading])
    if first[1] < 0 or not {start, goal}.isdisjoint(blocked) or not grid.free[goal]:
        return math.inf
    best, waiting = {first: 0.0}, [(0.0, 0, first)]
    while waiting:
        cost, _, node = heapq.heappop(waiting)
        if node[0] == goal:
            return cost
        if cost > best[node]:
            continue
        for k, (row, col) in enumerate(DIRECTIONS):
            to = (node[0][0] + row, node[0][1] + col)
            if not int(grid.turns.moves[node[1]]) >> k & 1 or to in blocked:
                continue
            after, new = (to, label[to[0] * cols + to[1]][k]), cost + grid.cell * math.hypot(row, col)
            if new < best.get(after, math.inf) - 1e-12:
                best[after] = new
                heapq.heappush(waiting, (new, len(best), after))
    return math.inf


def fits(name, query, plan, length):
    """Assert that a plan is valid, and of the given length as far as the planner promises; return whether it is solved."""
    assert validate_plan(query, plan) == ""
    assert plan.cost >= length - 1e-9
    if name in OPTIMAL:
        assert plan.cost == pytest.approx(length)
    if capabilities_of(load_planner(name)).complete:
        assert plan.solved == (length < math.inf)
    return plan.solved


@pytest.mark.parametrize("name", ABLE)
def test_a_plan_follows_the_turns_and_is_found_whenever_there_is_one(name):
    planner, rng, found, nodes = quick(name), np.random.default_rng(4), 0, 0
    for seed in (1, 2, 3):
        grid = ground(seed)
        nodes += len(grid.turns.cell) - grid.free.size
        for start, goal in rng.integers(0, 10_000, (8, 2)).tolist():
            query = query_of(grid, start, goal, -1)
            length = shortest(grid, set(), query.start, query.start_headings[0], query.goal)
            found += fits(name, query, planner.plan(query, rng), length)
    assert nodes > 0  # some cells have several labels
    assert found > 3


@pytest.mark.parametrize("name", REPLANNED)
def test_a_replan_after_any_change_fits_the_grid_as_it_is(name):
    rng, found = np.random.default_rng(6), 0
    for seed in (1, 2):
        grid, blocked = ground(seed), set()
        query = query_of(grid, *rng.integers(0, 10_000, 3).tolist())
        heading, replanner = query.start_headings[0], replanner_for(quick(name), query, rng)
        for turn in range(8):
            now, plan = replanner.query, replanner.result()
            found += fits(name, now, plan, shortest(grid, blocked, now.start, heading, now.goal))
            if turn % 4 == 3:  # another world: labels come and go
                grid, blocked = ground(seed, 5 + turn), set()
                replanner.change(grid)
            elif turn % 4 == 2:
                replanner.clear(sorted(blocked))
                blocked = set()
            else:
                cells = [at for at in map(tuple, rng.integers(0, grid.shape, (5, 2)).tolist()) if at != now.start]
                replanner.block(cells)
                blocked |= set(cells)
            if len(plan.cells) > 1 and turn % 2:
                heading = DIRECTIONS.index(tuple((plan.cells[1] - plan.cells[0]).tolist()))
                replanner.move(tuple(plan.cells[1].tolist()), heading)
    assert found > 3


CELL = st.tuples(st.integers(0, 15), st.integers(0, 15))
EDITS = st.one_of(
    st.tuples(st.sampled_from(["block", "clear"]), st.lists(CELL, min_size=1, max_size=6)),
    st.tuples(st.just("move"), st.tuples(CELL, st.integers(0, 7))),
    st.tuples(st.just("change"), st.integers(5, 8)),
    st.tuples(st.just("ask"), st.none()),
)


@pytest.mark.parametrize("name", [name for name in REPAIRED if name in OPTIMAL])
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 3), st.integers(0, 999), st.integers(0, 999), st.lists(EDITS, max_size=10))
def test_repairs_are_as_short_as_plans_from_scratch_after_any_edits(name, seed, start, goal, edits):
    grid, blocked = ground(seed), set()
    query = query_of(grid, start, goal, 0)
    heading, replanner = query.start_headings[0], load_planner(name).replanner(query, np.random.default_rng(0))
    for what, how in [*edits, ("ask", None)]:
        if what == "ask":
            now, plan = replanner.query, replanner.result()
            fits(name, now, plan, shortest(grid, blocked, now.start, heading, now.goal))
        elif what == "move":
            heading = how[1]
            replanner.move(*how)
        elif what == "change":
            grid, blocked = ground(seed, how), set()
            replanner.change(grid)
        else:
            getattr(replanner, what)(how)
            blocked = blocked | set(how) if what == "block" else blocked - set(how)


@pytest.mark.parametrize("name", REPAIRED)
def test_a_path_is_followed_without_work_only_at_its_headings(name):
    query = next(
        query
        for query in (query_of(ground(1), start, goal, 0) for start in range(0, 60, 7) for goal in range(0, 60, 5))
        if len(query.grid.nodes_at(query.start)) > 1 and quick("astar").plan(query, None).cost > 0.5
    )
    replanner = load_planner(name).replanner(query, np.random.default_rng(0))
    first = replanner.result()
    at, heading = tuple(first.cells[1].tolist()), DIRECTIONS.index(tuple((first.cells[1] - first.cells[0]).tolist()))
    replanner.move(at, heading)
    assert replanner.result().cells.tolist() == first.cells[1:].tolist()
    assert replanner.result().work == 0
    labels = query.grid.turns.label[query.start[0] * query.grid.shape[1] + query.start[1]]
    other = next(k for k in range(8) if k not in query.start_headings and labels[k] >= 0)
    replanner.move(query.start, other)
    assert validate_plan(replanner.query, replanner.result()) == ""
    assert replanner.query.start_node != query.start_node


def test_a_grid_of_the_other_kind_is_refused():
    query = query_of(ground(1), 0, 9, 0)
    replanner = load_planner("dstar-lite").replanner(query, np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"^grid: must have turns exactly if the first grid has"):
        replanner.change(rasterise(world_of(1), 0.25, 0.6))
