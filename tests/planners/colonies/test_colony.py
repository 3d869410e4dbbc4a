"""Walking, cutting tours short, trails on arcs: what the ant planners share, and the rules of each."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.planners import (
    PLANNERS,
    AgeingAnts,
    AntSystem,
    Colony,
    ExploringAnts,
    MaxMinAnts,
    MergingAnts,
    PlanResult,
    PlanStatus,
    Query,
    load_planner,
)
from antdrive.planners.colonies import _kernels_colony as _kernels_ants
from antdrive.planners.colonies.ant_system import ibraheem_beta
from antdrive.planners.colonies.colony import ChoiceContext, ColonyGraph, IterationState, Walks, _Walk, cut_short
from antdrive.planners.colonies.mmas import best_every
from antdrive.worlds import DIRECTIONS, Floats, Grid
from tests.planners.worlds_to_solve import catalogue, optimum, random_query

OPEN = Query(Grid.from_free(np.ones((3, 4))), (0, 0), (2, 3))
GROUND = ColonyGraph.of(OPEN)
DIRECT = [(0, 0), (1, 1), (2, 2), (2, 3)]
BEND = [(0, 0), (0, 1), (1, 2), (1, 3), (2, 3)]


def walks(*paths: list[tuple[int, int]], ground: ColonyGraph = GROUND) -> Walks:
    """Walks with lengths by plain Python; an empty one did not arrive."""
    cells = np.zeros((len(paths), max(map(len, paths))), dtype=np.int32)
    for a, path in enumerate(paths):
        cells[a, : len(path)] = [r * ground.shape[1] + c for r, c in path]
    lengths = [sum(math.dist(p, q) for p, q in itertools.pairwise(path)) if path else math.inf for path in paths]
    return Walks(cells, np.array([len(p) for p in paths]), np.array(lengths))


def season(tours: Walks, best: Walks | None = None, number: int = 1, since: int = 0) -> IterationState:
    return IterationState(number, GROUND, tours, tours, None, best, since, np.random.default_rng(0))


def arcs(path: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """(cell, move) of each step."""
    return [(r * 4 + c, DIRECTIONS.index((q - r, d - c))) for (r, c), (q, d) in itertools.pairwise(path)]


def grid_query(size: int, blocked: float, seed: int) -> Query:
    """Corner to corner over a random picture that can be crossed."""
    rng = np.random.default_rng(seed)
    while True:
        free = rng.random((size, size)) >= blocked
        free[0, 0] = free[-1, -1] = True
        query = Query(Grid.from_free(free), (0, 0), (size - 1, size - 1))
        if math.isfinite(optimum(query)):
            return query


def solve(planner: Colony, query: Query, seed: int = 0) -> PlanResult:
    return planner.plan(query, np.random.default_rng(seed))


# Walking


def test_the_wheel_gives_each_move_its_share() -> None:
    ground = ColonyGraph.of(Query(Grid.from_free(np.ones((3, 3))), (1, 1), (0, 0)))
    weights = np.zeros((9, 8), dtype=np.float32)
    weights[4] = [1, 2, 0, 4, 3, 0, 6, 5]  # from the middle cell; moves 2 and 5 attract nobody
    count = 40_000
    seeds = np.random.default_rng(1).bit_generator.random_raw(count).astype(np.uint64)
    cells, sizes = np.zeros((count, 2), dtype=np.int32), np.zeros(count, dtype=np.int64)
    _kernels_ants.walk_ants(
        weights, ground.mask, ground.offset, 4, 0, 1, 0.0, False, seeds, cells, sizes, np.zeros(count)
    )
    went = np.array([(cells[:, 1] == 4 + step).mean() for step in ground.offset])
    np.testing.assert_allclose(went, weights[4] / weights[4].sum(), atol=0.01)
    assert went[[2, 5]].max() == 0


@pytest.mark.parametrize("retreat", [False, True])
def test_ants_walk_allowed_moves_and_never_come_back(retreat: bool) -> None:
    query = catalogue()["forest"]
    ground, planner = ColonyGraph.of(query), AntSystem(ants=200, retreat=retreat)
    walk = _Walk.of(planner, ground)
    planner.weigh(ground, planner.lay(ground, np.random.default_rng(0)), planner.desire(ground), walk.weights[0])
    done, steps = walk.go(np.random.default_rng(0))
    for cells, size in zip(done.cells, done.sizes, strict=True):
        path = ground.cells(cells[:size])
        assert len(set(cells[:size].tolist())) == size
        for here, step in zip(path, np.diff(path, axis=0), strict=False):
            assert int(query.grid.moves[tuple(here)]) >> DIRECTIONS.index(tuple(step)) & 1
    assert steps >= done.sizes.sum() - 200
    assert done.sizes.min() > 0 if retreat else done.sizes.min() == 0


@pytest.mark.parametrize("planner", [AntSystem(beta=20.0), ExploringAnts(beta=0.0, explorers=3)])
def test_retreat_leaves_a_trap_in_which_ants_die(planner: Colony) -> None:
    size = 24
    free = np.ones((size, size), dtype=np.bool_)
    free[::2, 4:20] = False
    free[:, 20] = False
    free[0, 20] = True  # one way out of a comb of dead ends
    free[0, 4:21] = True
    query = Query(Grid.from_free(free), (11, 5), (11, 23))
    lost = solve(replace(planner, ants=5, iterations=2), query)
    assert lost.status is PlanStatus.STOPPED
    assert "nothing arrived within 2 iterations" in lost.reason
    assert not planner.capabilities.complete
    found = replace(planner, ants=5, iterations=2, retreat=True)
    assert found.capabilities.complete
    assert solve(found, query).solved


def test_ants_that_take_too_long_leave_nothing() -> None:
    planner = AntSystem(ants=10, iterations=2, max_steps=3, evaporation=0.5, initial=4.0)
    result = solve(planner, catalogue()["empty"])
    assert result.status is PlanStatus.STOPPED
    assert result.work == 10 * 2 * 3
    assert result.field is not None
    np.testing.assert_array_equal(np.unique(result.field), [1.0])


@pytest.mark.parametrize("planner", [AntSystem(ants=7), ExploringAnts(ants=3, explorers=4), MergingAnts(ants=5)])
@pytest.mark.parametrize("threads", [2, 3])
def test_threads_do_not_change_the_plan(planner: Colony, threads: int) -> None:
    query = catalogue()["forest"]
    alone = solve(replace(planner, iterations=6), query, seed=3)
    shared = solve(replace(planner, iterations=6, threads=threads), query, seed=3)
    np.testing.assert_array_equal(alone.cells, shared.cells)
    np.testing.assert_array_equal(alone.history.iteration_mean, shared.history.iteration_mean)
    np.testing.assert_array_equal(alone.field, shared.field)  # type: ignore[arg-type]
    assert alone.work == shared.work


@pytest.mark.parametrize("world", ["trap", "forest"])
@pytest.mark.parametrize("name", [name for name, planner in PLANNERS.items() if hasattr(planner, "retreat")])
def test_every_ant_planner_arrives_that_retreats_and_cuts_short(name: str, world: str) -> None:
    options = {"ants": 5, "iterations": 3, "retreat": True, "shortcut": True}
    query = catalogue()[world]
    result = load_planner(name, **options).plan(query, np.random.default_rng(0))
    assert result.solved
    ground = ColonyGraph.of(query)
    flat = (result.cells @ [ground.shape[1], 1]).astype(np.int32)[np.newaxis]
    again = cut_short(Walks(flat, np.array([flat.size]), np.array([result.cost])), ground)
    assert again.sizes[0] == flat.size  # nothing is left to be cut


# Cutting short


@given(st.integers(0, 10_000))
def test_a_tour_cut_short_is_legal_and_never_longer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    query = random_query(rng)
    ground, planner = ColonyGraph.of(query), AntSystem(ants=4, beta=0.0, retreat=True)
    if query.start == query.goal:
        return
    walk = _Walk.of(planner, ground)
    planner.weigh(ground, planner.lay(ground, rng), planner.desire(ground), walk.weights[0])
    before, _ = walk.go(rng)
    after = cut_short(before, ground)
    for a in range(len(before)):
        old, new = (w.cells[a, : w.sizes[a]].tolist() for w in (before, after))
        if not old:
            assert not new
            continue
        assert (old[0], old[-1]) == (new[0], new[-1])
        assert after.lengths[a] <= before.lengths[a] + 1e-9
        places = [old.index(cell) for cell in new]
        assert places == sorted(places)
        near = [{i + int(ground.offset[k]) for k in range(8) if int(ground.mask[i]) >> k & 1} for i in new]
        for here, there, reach in zip(places, places[1:], near, strict=False):
            assert there == max(p for p in range(here + 1, len(old)) if old[p] in reach)


def test_a_walk_around_a_corner_is_cut_by_hand() -> None:
    detour = [(0, 0), (0, 1), (0, 2), (1, 2), (1, 1), (2, 1), (2, 2), (2, 3)]
    tours = cut_short(walks(detour), GROUND)
    # From (0, 0) the walk comes by at (1, 1) last; from there at (2, 2).
    assert GROUND.cells(tours.cells[0, : tours.sizes[0]]).tolist() == [[0, 0], [1, 1], [2, 2], [2, 3]]
    assert tours.lengths[0] == pytest.approx(1 + 2 * math.sqrt(2))


# Ant system (suganthi2019 section III, ibraheem2016 section 3.1)


def test_arcs_evaporate_and_receive_q_over_length() -> None:
    planner = AntSystem(evaporation=0.25, deposit=3.0)
    before = np.linspace(0.1, 2.0, 96).reshape(12, 8)
    trail = before.copy()
    planner.update(trail, season(walks(DIRECT, BEND, [])))
    expected = 0.75 * before
    for path, length in ((DIRECT, 1 + 2 * math.sqrt(2)), (BEND, 3 + math.sqrt(2))):
        for arc in arcs(path):
            expected[arc] += 3.0 / length
    np.testing.assert_allclose(trail, expected, rtol=1e-12)


@pytest.mark.parametrize("heuristic", ["goal", "step"])
def test_weights_are_pheromone_and_heuristic_to_their_powers(heuristic: str) -> None:
    planner = AntSystem(alpha=2.0, beta=1.5, heuristic=heuristic)  # type: ignore[arg-type]
    trail = np.random.default_rng(0).uniform(0.1, 2.0, (12, 8))
    weights = np.zeros((12, 8), dtype=np.float32)
    planner.weigh(GROUND, trail, planner.desire(GROUND), weights)
    expected = [
        trail[5, k] ** 2
        * (1 / math.hypot(dr, dc) if heuristic == "step" else 1 / math.dist((1 + dr, 1 + dc), (2, 3))) ** 1.5
        for k, (dr, dc) in enumerate(DIRECTIONS)
    ]
    np.testing.assert_allclose(weights[5] / weights[5].sum(), np.array(expected) / sum(expected), rtol=1e-5)
    assert ((weights > 0) == (GROUND.mask[:, None] >> np.arange(8) & 1)).all()


def test_a_great_beta_on_a_great_grid_closes_no_move() -> None:
    query = Query(Grid.from_free(np.ones((120, 120))), (0, 0), (119, 119))
    ground, planner = ColonyGraph.of(query), AntSystem(beta=60.0)
    weights = np.zeros((len(ground.mask), 8), dtype=np.float32)
    planner.weigh(ground, planner.lay(ground, np.random.default_rng(0)), planner.desire(ground), weights)
    assert ((weights > 0) == (ground.mask[:, None] >> np.arange(8) & 1)).all()
    np.testing.assert_allclose(weights.max(axis=1), 1.0, rtol=1e-6)


def test_beta_follows_the_rule_of_ibraheem2016() -> None:
    assert ibraheem_beta(10) == pytest.approx(2.2)
    assert ibraheem_beta(40) == pytest.approx(8.8)


def test_older_ants_leave_less_by_equation_5() -> None:
    planner = AgeingAnts(most=2.0, least=1.0)
    rand = np.array([0.0, 0.5, 1.0, 0.2])
    # Q_max - (Q_max - Q_min) / 2 * rand - (Q_max - Q_min) / M * m, not below Q_min
    np.testing.assert_allclose(planner.aged(rand), [1.75, 1.25, 1.0, 1.0])
    amounts = planner.amounts(season(walks(DIRECT, [], BEND)))
    assert amounts[1] == 0
    assert (1.0 / walks(DIRECT, BEND).lengths <= amounts[[0, 2]]).all()
    assert (amounts[[0, 2]] <= 2.0 / walks(DIRECT, BEND).lengths).all()


def test_exploratory_ants_shun_what_common_ants_follow() -> None:
    planner = ExploringAnts()
    trail = np.ones((12, 8))
    trail[5, 1] = 4.0
    tables = [np.zeros((12, 8), dtype=np.float32) for _ in planner.castes]
    for caste, table in enumerate(tables):
        planner.weigh(GROUND, trail, planner.desire(GROUND), table, ChoiceContext(caste))
    assert planner.castes == (25, 75)
    eta = 1 / math.sqrt(2)
    assert tables[0][5, 1] / tables[0][5, 0] == pytest.approx(4 * eta)  # eq. 1
    assert tables[1][5, 1] / tables[1][5, 0] == pytest.approx(eta / 4)  # eq. 5


def test_the_elite_of_an_iteration_leaves_more() -> None:
    tours = walks(BEND, DIRECT, [])
    amounts = ExploringAnts(elite=2.0, deposit=5.0).amounts(season(tours))
    np.testing.assert_allclose(amounts, [5 / tours.lengths[0], 3 * 5 / tours.lengths[1], 0])  # eq. 7-8


# MAX-MIN ant system (Stützle & Hoos 2000)


def test_bounds_by_hand() -> None:
    best = walks(DIRECT)
    least, most = MaxMinAnts(evaporation=0.2, p_best=0.05).bounds(GROUND, best)
    assert most == pytest.approx(1 / (0.2 * (1 + 2 * math.sqrt(2))))
    right = 0.05 ** (1 / 3)
    options = (4 * 3 + 6 * 5 + 2 * 8) / 12 - 1  # moves per cell, but the one back
    assert least == pytest.approx(most * (1 - right) / ((options - 1) * right))


def test_trails_stay_within_their_bounds() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Watched(MaxMinAnts):
        def update(self, trail: Floats, season: IterationState) -> None:
            super().update(trail, season)
            assert season.best is not None
            least, most = self.bounds(season.ground, season.best)
            assert least - 1e-12 <= trail.min()
            assert trail.max() <= most + 1e-12
            ranges.append((trail.min() / least, trail.max() / most))

    ranges: list[tuple[float, float]] = []
    solve(Watched(ants=10, iterations=40, patience=15), catalogue()["forest"])
    assert ranges[0][0] > 1  # all trails begin high,
    assert ranges[0][1] == pytest.approx(1)
    assert min(low for low, _ in ranges) == pytest.approx(1)  # and those that nobody uses end at the bottom


def test_one_ant_deposits() -> None:
    planner = MaxMinAnts(evaporation=0.2)
    least, most = planner.bounds(GROUND, walks(DIRECT))
    trail = np.full((12, 8), 0.5 * (least + most))
    expected = 0.8 * trail
    for arc in arcs(DIRECT):
        expected[arc] += 1 / (1 + 2 * math.sqrt(2))
    planner.update(trail, season(walks(BEND, DIRECT), best=walks(DIRECT)))
    np.testing.assert_allclose(trail, np.clip(expected, least, most), rtol=1e-12)


def test_stagnation_lays_the_trails_anew() -> None:
    planner = MaxMinAnts(patience=7)
    most = planner.bounds(GROUND, walks(DIRECT))[1]
    trail = np.full((12, 8), 0.4 * most)
    planner.update(trail, season(walks(BEND), best=walks(DIRECT), since=6))
    assert trail.max() < most
    planner.update(trail, season(walks(BEND), best=walks(DIRECT), since=7))
    np.testing.assert_array_equal(trail, most)


def test_the_best_of_all_deposits_ever_more_often() -> None:
    assert [best_every(number) for number in (0, 24, 25, 75, 125, 250, 1000)] == [25, 25, 5, 3, 2, 1, 1]
    now, ever = walks(BEND), walks(DIRECT)
    assert MaxMinAnts().depositor(season(now, best=ever, number=26)).lengths[0] == now.lengths[0]  # type: ignore[union-attr]
    assert MaxMinAnts().depositor(season(now, best=ever, number=30)) is ever


# Merging ants


def test_the_joint_tour_takes_only_arcs_that_ants_took() -> None:
    across = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 3)]
    other = [(0, 0), (1, 0), (1, 1), (1, 2), (1, 3), (2, 3)]
    joint = MergingAnts().join(GROUND, walks(across, other), None)
    assert joint is not None
    assert joint.lengths[0] == pytest.approx(5)  # no diagonal was walked
    joint = MergingAnts().join(GROUND, walks(across, other), walks(DIRECT))
    assert joint is not None
    assert joint.lengths[0] == pytest.approx(1 + 2 * math.sqrt(2))
    crossing = [(0, 0), (1, 1), (1, 2), (2, 2), (2, 3)], [(0, 0), (0, 1), (1, 2), (2, 3)]
    joint = MergingAnts().join(GROUND, walks(*crossing), None)
    assert joint is not None
    assert joint.lengths[0] == pytest.approx(1 + 2 * math.sqrt(2))  # begins as one, ends as the other
    assert MergingAnts().join(GROUND, walks([]), None) is None


def test_a_move_attracts_by_the_detour_it_makes() -> None:
    desire = MergingAnts(greed=1.5).desire(GROUND)
    # From (1, 1) to the goal (2, 3) it is 1 + sqrt(2) over open ground.
    assert desire[5, 1] == pytest.approx(1.0)  # (2, 2): on the way
    assert desire[5, 0] == pytest.approx(1.0)  # (1, 2): too
    assert desire[5, 4] == pytest.approx(math.exp(-1.5 * 2), rel=1e-5)  # (1, 0): there and back


def test_it_ends_at_once_where_nothing_can_be_shorter() -> None:
    result = solve(MergingAnts(), catalogue()["empty"])
    assert len(result.history) < 10
    assert result.cost == pytest.approx(optimum(catalogue()["empty"]))


def test_it_ends_when_it_has_settled() -> None:
    query = catalogue()["slalom"]
    history = solve(MergingAnts(settled=9), query).history
    assert (np.flatnonzero(history.best > history.best[-1] + 1e-9).max(initial=-1)) == len(history) - 11


@pytest.mark.parametrize("world", ["slalom", "gate", "trap", "forest"])
def test_merging_ants_find_the_shortest_way_through_the_catalogue(world: str) -> None:
    query = catalogue()[world]
    assert solve(MergingAnts(), query).cost == pytest.approx(optimum(query))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [20, 50])
def test_merging_ants_find_the_shortest_way_over_random_grids(size: int, seed: int) -> None:
    query = grid_query(size, 0.25, seed)
    assert solve(MergingAnts(), query, seed).cost == pytest.approx(optimum(query))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_merging_ants_come_within_a_percent_over_large_grids(seed: int) -> None:
    query = grid_query(100, 0.25, seed)
    assert solve(MergingAnts(), query, seed).cost <= 1.01 * optimum(query)


def test_merging_ants_get_through_a_maze() -> None:
    free = np.zeros((21, 21), dtype=np.bool_)
    free[1::2, 1:-1] = True
    for row in range(2, 20, 2):
        free[row, 1 if row % 4 else 19] = True
    query = Query(Grid.from_free(free), (1, 1), (19, 19))
    assert solve(MergingAnts(iterations=5), query).cost == pytest.approx(optimum(query))


@pytest.mark.parametrize(
    ("kind", "key", "value"),
    [
        (AntSystem, "alpha", -1.0), (AntSystem, "beta", -1.0), (AntSystem, "initial", 0.0), (AntSystem, "threads", 0),
        (AntSystem, "heuristic", "smell"), (AgeingAnts, "least", 0.0), (AgeingAnts, "most", 0.01),
        (ExploringAnts, "explorers", -1), (ExploringAnts, "elite", -1.0), (MaxMinAnts, "p_best", 1.0),
        (MaxMinAnts, "patience", 0), (MergingAnts, "scouts", -1), (MergingAnts, "settled", 0),
        (MergingAnts, "beta", 2.0), (MergingAnts, "heuristic", "step"),
    ],
)  # fmt: skip
def test_options_out_of_range_are_refused_by_name(kind: type[Colony], key: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"^{key}: must be"):
        kind(**{key: value})  # type: ignore[arg-type]
