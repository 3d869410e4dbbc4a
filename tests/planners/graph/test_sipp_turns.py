"""Safe-interval planning on grids with turns, against an independent oracle in discrete time."""

import dataclasses
import heapq
import math

import numpy as np
import pytest

from antdrive.base.plane import wrap_angle
from antdrive.planners import AStar, Query, plan_in_time, replanner_for, validate_plan
from antdrive.worlds import DIRECTIONS, Disc, Task, World, rasterise
from antdrive.worlds.headings import Outline, sweep_clearance, turn_clear
from tests.planners.graph.test_sipp import ABOVE, BELOW, SPEED, TICK, first_tick, some_mover

OBLONG = Outline(np.array([(0.25, -0.08), (0.25, 0.08), (-0.15, 0.08), (-0.15, -0.08)]), 0.02)
RADIUS = math.hypot(0.25, 0.08) + 0.02
SIDE, CELL, HORIZON = 2.8, 0.4, 15.0
EIGHTH = math.pi / 4
TURN = 0.4  # time of a turn by 45° [s]
YAW_RATE = EIGHTH / TURN


def small_world(seed):
    rng = np.random.default_rng([23, seed])
    discs = tuple(Disc(*rng.uniform(0, SIDE, 2).tolist(), float(rng.uniform(0.02, 0.1))) for _ in range(8))
    world = World("small", (0.0, 0.0, SIDE, SIDE), discs)
    grid = rasterise(world, CELL, RADIUS, OBLONG)
    movers = [dataclasses.replace(some_mover(rng, SIDE), radius=0.05) for _ in range(int(rng.integers(1, 3)))]
    return world, grid, movers, rng


def turned(grid, world):
    """Return the ways of the outline between cells and headings, by the exact sweeps and turns."""
    rows, cols = grid.shape
    ways = {}
    for r in range(rows):
        for c in range(cols):
            x, y = grid.origin[0] + c * CELL, grid.origin[1] + r * CELL
            for k, (dr, dc) in enumerate(DIRECTIONS):
                onward = []
                q, d = r + dr, c + dc
                there = (x + dc * CELL, y + dr * CELL)
                swept = sweep_clearance(x, y, *there, k * EIGHTH, OBLONG, world.discs, world.bounds)
                if 0 <= q < rows and 0 <= d < cols and swept > 0:
                    onward.append(((q, d, k), there, CELL * math.hypot(dr, dc) / SPEED))
                for side in (-1, 1):
                    if turn_clear(x, y, k * EIGHTH, side * EIGHTH, OBLONG, world.discs, world.bounds):
                        onward.append(((r, c, (k + side) % 8), (x, y), TURN))
                ways[r, c, k] = (x, y), onward
    return ways


def some_query(grid, rng):
    """Return a query between two cells, and the headings at its start."""
    nodes = np.unique(grid.turns.label[grid.turns.label >= 0])
    start = int(rng.choice(nodes))
    flat = int(grid.turns.cell[start])
    goal = rng.choice(np.argwhere(grid.free))
    query = Query(grid, divmod(flat, grid.shape[1]), tuple(goal.tolist()), start_label=start)
    return query, np.flatnonzero(grid.turns.label[flat] == start).tolist()


@pytest.mark.parametrize(
    "seeds", [range(1, 4), pytest.param(range(8, 24), marks=pytest.mark.slow)], ids=["few", "many"]
)
@pytest.mark.parametrize("stay", [False, True], ids=["arrive", "stay"])
def test_no_path_of_an_outline_arrives_sooner_and_none_is_missed(seeds, stay):
    gaps, without = [], 0
    for seed in seeds:
        world, grid, movers, rng = small_world(seed)
        ways = turned(grid, world)
        query, headings = some_query(grid, rng)
        starts, goals = ([(*cell, k) for k in ks] for cell, ks in ((query.start, headings), (query.goal, range(8))))
        plan = plan_in_time(query, movers, speed=SPEED, yaw_rate=YAW_RATE, horizon=HORIZON, stay=stay)
        bounds = [
            first_tick(ways, starts, goals, movers, HORIZON, inflate=RADIUS, slack=slack, hurry=hurry, stay=stay)
            for slack, hurry in ((ABOVE, False), (BELOW, True))
        ]
        assert validate_plan(query, plan) == ""
        assert bounds[1] - TICK - 1e-9 <= plan.duration <= bounds[0] + 1e-9
        if plan.solved:
            heading = np.arctan2(*np.diff(plan.xy, axis=0).T[::-1])
            least = np.abs(wrap_angle(np.diff(heading))) / YAW_RATE
            assert (plan.leave[1:-1] - plan.arrive[1:-1] >= least - 1e-9).all()
            assert plan.clearance(movers, step=0.002) >= RADIUS
        without += math.isinf(bounds[1])
        if math.isfinite(bounds[0]):
            gaps.append(bounds[0] - bounds[1])
    assert np.median(gaps) < 1.0
    assert len(gaps) > len(seeds) / 4
    assert without > 0


def test_on_open_ground_a_plan_lasts_as_long_as_its_lead_its_moves_and_its_turns():
    world = World("open", (0.0, 0.0, 4.0, 4.0))
    grid = rasterise(world, CELL, RADIUS, OBLONG)
    x, y = grid.xy([(5, 2)])[0].tolist()
    for (dx, dy, yaw), turns in (
        ((0.0, 0.0, 0.0), 0.0),
        ((0.0, 0.0, 2.0), 2.0),
        ((0.0, 0.0, -3.0), 3.0),
        ((-0.1, 0.0, 0.3), 0.3),
        ((0.0, -0.1, 0.3), math.pi - 0.3),
    ):
        task = Task(world, (x + dx, y + dy, yaw), grid.xy([(5, 7)])[0].tolist(), cell=CELL)
        query = dataclasses.replace(Query.between(grid, task), start=(5, 2))
        plan = plan_in_time(query, (), speed=SPEED, yaw_rate=YAW_RATE)
        assert plan.arrive[0] == 0.0
        assert plan.duration == pytest.approx(turns / YAW_RATE + (5 * CELL + math.hypot(dx, dy)) / SPEED)
    corner = Query(grid, (2, 2), (5, 8), start_label=int(grid.turns.label[2 * grid.shape[1] + 2, 0]))
    plan = plan_in_time(corner, (), speed=SPEED, yaw_rate=YAW_RATE)
    assert plan.duration == pytest.approx(CELL * (3 + 3 * math.sqrt(2)) / SPEED + TURN)
    assert plan.work <= 9  # the bound on open ground is exact


def test_a_turn_goes_the_long_way_round_where_the_short_one_is_not_free():
    """A post between the headings E and NE of a cell, both free, stops the nose of a long triangle."""
    nose = Outline(np.array([(0.25, 0.0), (-0.1, 0.04), (-0.1, -0.04)]), 0.02)
    x, y = 1.0, 1.0  # of cell (2, 2)
    post = Disc(x + 0.28 * math.cos(EIGHTH / 2), y + 0.28 * math.sin(EIGHTH / 2), 0.02)
    closed = np.ones((7, 7), dtype=np.bool_)
    closed[[2, 2, 3], [1, 2, 3]] = False
    for discs, eighths in (((), 1), ((post,), 7)):
        grid = rasterise(World("post", (0.0, 0.0, 2.8, 2.8), discs), CELL, 0.27, nose)
        edited = replanner_for(AStar(), Query(grid, (2, 1), (3, 3)), np.random.default_rng(0))
        edited.block(np.argwhere(closed))
        grid = edited.query.grid
        query = Query(grid, (2, 1), (3, 3), start_label=int(grid.turns.label[2 * 7 + 1, 0]))
        plan = plan_in_time(query, (), speed=SPEED, yaw_rate=YAW_RATE)
        assert plan.duration == pytest.approx(CELL * (1 + math.sqrt(2)) / SPEED + eighths * TURN)


def soonest(ways, starts, goal):
    """Return the duration of the quickest way to a cell without movers, by Dijkstra's algorithm [s]."""
    queue, done = [(0.0, state) for state in starts], set()
    while queue:
        time, state = heapq.heappop(queue)
        if state[:2] == goal:
            return time
        if state in done:
            continue
        done.add(state)
        for to, _, lasts in ways[state][1]:
            heapq.heappush(queue, (time + lasts, to))
    return math.inf


def test_without_movers_it_is_the_quickest_way():
    found = 0
    for seed in range(3):
        world, grid, _, rng = small_world(seed)
        ways = turned(grid, world)
        for _ in range(40):
            query, headings = some_query(grid, rng)
            plan = plan_in_time(query, (), speed=SPEED, yaw_rate=YAW_RATE)
            assert plan.duration == pytest.approx(soonest(ways, [(*query.start, k) for k in headings], query.goal))
            found += plan.solved
    assert found > 30
