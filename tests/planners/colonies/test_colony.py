"""Common parts of the ant planners (walking, shortcuts, trails on arcs), and the rules of each."""

import itertools
import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.planners import (
    PLANNERS,
    AgeingAnts,
    AntSystem,
    ExploringAnts,
    MaxMinAnts,
    MergingAnts,
    PlanStatus,
    PotentialFieldAnts,
    Query,
    load_planner,
)
from antdrive.planners.colonies import _kernels_colony
from antdrive.planners.colonies.ant_system import best_so_far_every, ibraheem_beta
from antdrive.planners.colonies.colony import (
    ChoiceContext,
    ColonyGraph,
    IterationState,
    TourConstruction,
    Walks,
    cut,
)
from antdrive.planners.colonies.pfaco import AntPool
from antdrive.worlds import DIRECTIONS, Grid
from tests.planners.worlds_to_solve import catalogue, optimum, random_query

OPEN = Query(Grid.from_free(np.ones((3, 4))), (0, 0), (2, 3))
GRAPH = ColonyGraph.of(OPEN)
DIRECT = [(0, 0), (1, 1), (2, 2), (2, 3)]
BEND = [(0, 0), (0, 1), (1, 2), (1, 3), (2, 3)]


def walks(*paths, graph=GRAPH):
    """Return walks with lengths summed in plain Python; an empty path is an ant that did not arrive."""
    cells = np.zeros((len(paths), max(map(len, paths))), dtype=np.int32)
    for a, path in enumerate(paths):
        cells[a, : len(path)] = [r * graph.shape[1] + c for r, c in path]
    lengths = [sum(math.dist(p, q) for p, q in itertools.pairwise(path)) if path else math.inf for path in paths]
    return Walks(cells, np.array([len(p) for p in paths]), np.array(lengths))


def state(tours, best=None, number=1, since=0, first=0):
    return IterationState(number, GRAPH, tours, tours, None, best, since, np.random.default_rng(0), first)


def arcs(path):
    """Return the arcs of a path as (cell, move)."""
    return [(r * 4 + c, DIRECTIONS.index((q - r, d - c))) for (r, c), (q, d) in itertools.pairwise(path)]


def grid_query(size, blocked, seed):
    """Return a solvable query from corner to corner of a random grid."""
    rng = np.random.default_rng(seed)
    while True:
        free = rng.random((size, size)) >= blocked
        free[0, 0] = free[-1, -1] = True
        query = Query(Grid.from_free(free), (0, 0), (size - 1, size - 1))
        if math.isfinite(optimum(query)):
            return query


def solve(planner, query, seed=0):
    return planner.plan(query, np.random.default_rng(seed))


# Walking


def test_moves_are_chosen_in_proportion_to_their_weights():
    graph = ColonyGraph.of(Query(Grid.from_free(np.ones((3, 3))), (1, 1), (0, 0)))
    weights = np.zeros((9, 8), dtype=np.float32)
    weights[4] = [1, 2, 0, 4, 3, 0, 6, 5]  # in the middle cell; moves 2 and 5 are not allowed
    count = 40_000
    seeds = np.random.default_rng(1).bit_generator.random_raw(count).astype(np.uint64)
    cells, sizes = np.zeros((count, 2), dtype=np.int32), np.zeros(count, dtype=np.int64)
    _kernels_colony.walk_ants(weights, graph.arrays, 1, 0.0, False, seeds, cells, sizes, np.zeros(count))
    went = np.array([(cells[:, 1] == 4 + step).mean() for step in graph.to])
    np.testing.assert_allclose(went, weights[4] / weights[4].sum(), atol=0.01)
    assert went[[2, 5]].max() == 0


@pytest.mark.parametrize("backtrack", [False, True])
def test_ants_walk_along_allowed_moves_and_visit_no_cell_twice(backtrack):
    query = catalogue()["forest"]
    graph, planner = ColonyGraph.of(query), AntSystem(ants=200, backtrack=backtrack)
    construction = TourConstruction.of(planner, graph)
    planner.choice_weights(
        graph,
        planner.initial_trail(graph, np.random.default_rng(0)),
        planner.heuristic_values(graph),
        construction.weights[0],
    )
    done, steps = construction.construct(np.random.default_rng(0))
    for cells, size in zip(done.cells, done.sizes, strict=True):
        path = graph.cells(cells[:size])
        assert len(set(cells[:size].tolist())) == size
        for here, step in zip(path, np.diff(path, axis=0), strict=False):
            assert int(query.grid.moves[tuple(here)]) >> DIRECTIONS.index(tuple(step)) & 1
    assert steps >= done.sizes.sum() - 200
    assert done.sizes.min() > 0 if backtrack else done.sizes.min() == 0


@pytest.mark.parametrize("planner", [AntSystem(beta=20.0), ExploringAnts(beta=0.0, explorers=3, backtrack=False)])
def test_backtracking_ants_leave_a_trap_in_which_others_die(planner):
    size = 24
    free = np.ones((size, size), dtype=np.bool_)
    free[::2, 4:20] = False
    free[:, 20] = False
    free[0, 20] = True  # one exit from a comb of dead ends
    free[0, 4:21] = True
    query = Query(Grid.from_free(free), (11, 5), (11, 23))
    lost = solve(replace(planner, ants=5, iterations=2), query)
    assert lost.status is PlanStatus.STOPPED
    assert "nothing arrived within 2 iterations" in lost.reason
    assert not planner.capabilities.complete
    rescued = replace(planner, ants=5, iterations=2, backtrack=True)
    assert rescued.capabilities.complete
    assert solve(rescued, query).solved


def test_ants_that_give_up_deposit_nothing():
    planner = AntSystem(ants=10, iterations=2, max_steps=3, evaporation=0.5, initial=4.0)
    result = solve(planner, catalogue()["empty"])
    assert result.status is PlanStatus.STOPPED
    assert result.work == 10 * 2 * 3
    np.testing.assert_array_equal(np.unique(result.field), [1.0])


@dataclass(frozen=True, kw_only=True)
class Recorded(AntSystem):
    """Ants that record the ants of each update, and the weakest trail before it."""

    seen: list = field(default_factory=list)

    def update(self, trail, state):
        self.seen.append((state.number, state.first, len(state.tours), round(trail.min(), 9)))
        super().update(trail, state)

    def walked(self, iterations):
        """Iterate without the first call's rehearsal, and return the arrivals."""
        states = self.iterate(catalogue()["empty"], np.random.default_rng(0))
        return [one.arrived for one in itertools.islice(states, iterations)]


def test_trails_change_after_each_group_of_ants_and_start_anew():
    planner = Recorded(ants=3, evaporation=0.5, backtrack=True, update_every=2, restart_every=2)
    assert planner.walked(4) == [3, 3, 3, 3]
    groups = [(0, 2, 1.0), (2, 1, 0.5), (0, 2, 0.25), (2, 1, 0.125)]
    assert planner.seen == [(k, *groups[j + 2 * (k % 2)]) for k in range(4) for j in range(2)]


def test_a_group_of_ants_that_die_changes_no_trail():
    planner = Recorded(ants=3, max_steps=3, update_every=1)
    assert planner.walked(2) == [0, 0]
    assert planner.seen == []


@pytest.mark.parametrize("planner", [AntSystem(ants=7), ExploringAnts(ants=3, explorers=4), MergingAnts(ants=5)])
@pytest.mark.parametrize("threads", [2, 3])
def test_threads_do_not_change_the_plan(planner, threads):
    query = catalogue()["forest"]
    alone = solve(replace(planner, iterations=6), query, seed=3)
    shared = solve(replace(planner, iterations=6, threads=threads), query, seed=3)
    np.testing.assert_array_equal(alone.cells, shared.cells)
    np.testing.assert_array_equal(alone.history.iteration_mean, shared.history.iteration_mean)
    np.testing.assert_array_equal(alone.field, shared.field)
    assert alone.work == shared.work


@pytest.mark.parametrize("world", ["trap", "forest"])
@pytest.mark.parametrize("name", [name for name, planner in PLANNERS.items() if hasattr(planner, "backtrack")])
def test_every_ant_planner_arrives_with_backtrack_and_shortcut(name, world):
    options = {"ants": 5, "iterations": 3, "backtrack": True, "shortcut": True}
    query = catalogue()[world]
    result = load_planner(name, **options).plan(query, np.random.default_rng(0))
    assert result.solved
    graph = ColonyGraph.of(query)
    flat = (result.cells @ [graph.shape[1], 1]).astype(np.int32)[np.newaxis]
    again = cut(Walks(flat, np.array([flat.size]), np.array([result.cost])), graph, short=True)
    assert again.sizes[0] == flat.size  # the path cannot be cut any shorter


# Cutting short


@given(st.integers(0, 10_000))
def test_a_tour_cut_short_has_allowed_moves_and_is_never_longer(seed):
    rng = np.random.default_rng(seed)
    query = random_query(rng)
    graph, planner = ColonyGraph.of(query), AntSystem(ants=4, beta=0.0, backtrack=True)
    if query.start == query.goal:
        return
    construction = TourConstruction.of(planner, graph)
    planner.choice_weights(
        graph, planner.initial_trail(graph, rng), planner.heuristic_values(graph), construction.weights[0]
    )
    before, _ = construction.construct(rng)
    after = cut(before, graph, short=True)
    for a in range(len(before)):
        old, new = (w.cells[a, : w.sizes[a]].tolist() for w in (before, after))
        if not old:
            assert not new
            continue
        assert (old[0], old[-1]) == (new[0], new[-1])
        assert after.lengths[a] <= before.lengths[a] + 1e-9
        places = [old.index(cell) for cell in new]
        assert places == sorted(places)
        near = [{i + int(graph.to[k]) for k in range(8) if int(graph.mask[i]) >> k & 1} for i in new]
        for here, there, reach in zip(places, places[1:], near, strict=False):
            assert there == max(p for p in range(here + 1, len(old)) if old[p] in reach)


# Ant system (suganthi2019 section III, ibraheem2016 section 3.1)


def test_arcs_evaporate_and_receive_q_over_length():
    planner = AntSystem(evaporation=0.25, deposit=3.0)
    before = np.linspace(0.1, 2.0, 96).reshape(12, 8)
    trail = before.copy()
    planner.update(trail, state(walks(DIRECT, BEND, [])))
    expected = 0.75 * before
    for path, length in ((DIRECT, 1 + 2 * math.sqrt(2)), (BEND, 3 + math.sqrt(2))):
        for arc in arcs(path):
            expected[arc] += 3.0 / length
    np.testing.assert_allclose(trail, expected, rtol=1e-12)


@pytest.mark.parametrize("heuristic", ["goal", "step"])
def test_weights_are_pheromone_and_heuristic_to_their_powers(heuristic):
    planner = AntSystem(alpha=2.0, beta=1.5, heuristic=heuristic)
    trail = np.random.default_rng(0).uniform(0.1, 2.0, (12, 8))
    weights = np.zeros((12, 8), dtype=np.float32)
    planner.choice_weights(GRAPH, trail, planner.heuristic_values(GRAPH), weights)
    expected = [
        trail[5, k] ** 2
        * (1 / math.hypot(dr, dc) if heuristic == "step" else 1 / math.dist((1 + dr, 1 + dc), (2, 3))) ** 1.5
        for k, (dr, dc) in enumerate(DIRECTIONS)
    ]
    np.testing.assert_allclose(weights[5] / weights[5].sum(), np.array(expected) / sum(expected), rtol=1e-5)
    assert ((weights > 0) == (GRAPH.mask[:, None] >> np.arange(8) & 1)).all()


def test_a_large_beta_on_a_large_grid_underflows_no_weight_to_zero():
    query = Query(Grid.from_free(np.ones((120, 120))), (0, 0), (119, 119))
    graph, planner = ColonyGraph.of(query), AntSystem(beta=60.0)
    weights = np.zeros((len(graph.mask), 8), dtype=np.float32)
    planner.choice_weights(
        graph, planner.initial_trail(graph, np.random.default_rng(0)), planner.heuristic_values(graph), weights
    )
    assert ((weights > 0) == (graph.mask[:, None] >> np.arange(8) & 1)).all()
    np.testing.assert_allclose(weights.max(axis=1), 1.0, rtol=1e-6)


def test_beta_follows_the_rule_of_ibraheem2016():
    assert [ibraheem_beta(size) for size in (10, 20, 30, 40)] == pytest.approx([2.2, 4.4, 6.6, 8.8])


def test_older_ants_deposit_less_by_equation_5():
    planner = AgeingAnts(ants=4, q_max=2.0, q_min=1.0)
    rand = np.array([0.0, 0.5, 1.0, 0.2])
    # Q_max - (Q_max - Q_min) / 2 * rand - (Q_max - Q_min) / M * m, not below Q_min
    np.testing.assert_allclose(planner.aged(rand, 0, 4), [1.75, 1.25, 1.0, 1.0])
    np.testing.assert_allclose(planner.aged(rand[:1], 2, 4), [1.25])  # the third ant, on its own
    amounts = planner.amounts(state(walks(DIRECT, [], BEND)))
    assert amounts[1] == 0
    assert (1.0 / walks(DIRECT, BEND).lengths <= amounts[[0, 2]]).all()
    assert (amounts[[0, 2]] <= 2.0 / walks(DIRECT, BEND).lengths).all()


def test_exploratory_ants_avoid_what_common_ants_follow():
    planner = ExploringAnts()
    trail = np.ones((12, 8))
    trail[5, 1] = 4.0
    tables = [np.zeros((12, 8), dtype=np.float32) for _ in planner.kinds]
    for kind, table in enumerate(tables):
        planner.choice_weights(GRAPH, trail, planner.heuristic_values(GRAPH), table, ChoiceContext(kind))
    assert planner.kinds == (25, 75)
    eta = 1 / math.sqrt(2)
    assert tables[0][5, 1] / tables[0][5, 0] == pytest.approx(4 * eta)  # eq. 1
    assert tables[1][5, 1] / tables[1][5, 0] == pytest.approx(eta / 4)  # eq. 5


def test_a_deposit_of_later_ants_knows_their_kind():
    late = ExploringAnts(ants=2, elite=0.0).amounts(state(walks(BEND, DIRECT, []), first=1))
    lengths = walks(BEND, DIRECT, []).lengths
    np.testing.assert_allclose(late, [1 / lengths[0], 0, 0])  # the second of these ants is exploratory


# MAX-MIN ant system (Stützle & Hoos 2000)


def test_the_bounds_match_a_hand_calculation():
    best = walks(DIRECT)
    tau_min, tau_max = MaxMinAnts(evaporation=0.2, p_best=0.05).bounds(GRAPH, best)
    assert tau_max == pytest.approx(1 / (0.2 * (1 + 2 * math.sqrt(2))))
    right = 0.05 ** (1 / 3)
    options = (4 * 3 + 6 * 5 + 2 * 8) / 12 - 1  # moves per cell, without the one back
    assert tau_min == pytest.approx(tau_max * (1 - right) / ((options - 1) * right))


def test_trails_stay_within_their_bounds():
    @dataclass(frozen=True, kw_only=True)
    class Watched(MaxMinAnts):
        def update(self, trail, state):
            super().update(trail, state)
            tau_min, tau_max = self.bounds(state.graph, state.best)
            assert tau_min - 1e-12 <= trail.min()
            assert trail.max() <= tau_max + 1e-12
            ranges.append((trail.min() / tau_min, trail.max() / tau_max))

    ranges = []
    solve(Watched(ants=10, iterations=40, patience=15), catalogue()["forest"])
    assert ranges[0][0] > 1  # all trails begin at the upper bound,
    assert ranges[0][1] == pytest.approx(1)
    assert min(low for low, _ in ranges) == pytest.approx(1)  # and those that no ant uses end at the lower bound


def test_only_the_best_ant_deposits():
    planner = MaxMinAnts(evaporation=0.2)
    tau_min, tau_max = planner.bounds(GRAPH, walks(DIRECT))
    trail = np.full((12, 8), 0.5 * (tau_min + tau_max))
    expected = 0.8 * trail
    for arc in arcs(DIRECT):
        expected[arc] += 1 / (1 + 2 * math.sqrt(2))
    planner.update(trail, state(walks(BEND, DIRECT), best=walks(DIRECT)))
    np.testing.assert_allclose(trail, np.clip(expected, tau_min, tau_max), rtol=1e-12)


def test_stagnation_resets_all_trails_to_the_upper_bound():
    planner = MaxMinAnts(patience=7)
    tau_max = planner.bounds(GRAPH, walks(DIRECT))[1]
    trail = np.full((12, 8), 0.4 * tau_max)
    planner.update(trail, state(walks(BEND), best=walks(DIRECT), since=6))
    assert trail.max() < tau_max
    planner.update(trail, state(walks(BEND), best=walks(DIRECT), since=7))
    np.testing.assert_array_equal(trail, tau_max)


def test_the_best_tour_so_far_deposits_ever_more_often():
    assert [best_so_far_every(number) for number in (0, 24, 25, 75, 125, 250, 1000)] == [25, 25, 5, 3, 2, 1, 1]
    now, ever = walks(BEND), walks(DIRECT)
    assert MaxMinAnts().depositor(state(now, best=ever, number=26)).lengths[0] == now.lengths[0]
    assert MaxMinAnts().depositor(state(now, best=ever, number=30)) is ever


# Merging ants


def test_the_merged_tour_uses_only_arcs_that_ants_used():
    across = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 3)]
    other = [(0, 0), (1, 0), (1, 1), (1, 2), (1, 3), (2, 3)]
    merged = MergingAnts().daemon_action(GRAPH, walks(across, other), None)
    assert merged.lengths[0] == pytest.approx(5)  # no diagonal was walked
    merged = MergingAnts().daemon_action(GRAPH, walks(across, other), walks(DIRECT))
    assert merged.lengths[0] == pytest.approx(1 + 2 * math.sqrt(2))
    crossing = [(0, 0), (1, 1), (1, 2), (2, 2), (2, 3)], [(0, 0), (0, 1), (1, 2), (2, 3)]
    merged = MergingAnts().daemon_action(GRAPH, walks(*crossing), None)
    assert merged.lengths[0] == pytest.approx(1 + 2 * math.sqrt(2))  # begins as one, ends as the other
    assert MergingAnts().daemon_action(GRAPH, walks([]), None) is None


def test_the_heuristic_of_merging_ants_falls_with_the_detour():
    heuristic = MergingAnts(greed=1.5).heuristic_values(GRAPH)
    # From (1, 1) to the goal (2, 3) it is 1 + sqrt(2) over open graph.
    assert heuristic[5, 1] == pytest.approx(1.0)  # (2, 2): no detour
    assert heuristic[5, 0] == pytest.approx(1.0)  # (1, 2): no detour either
    assert heuristic[5, 4] == pytest.approx(math.exp(-1.5 * 2), rel=1e-5)  # (1, 0): one cell there and one back


def test_merging_ants_stop_at_once_at_the_shortest_tour_possible():
    result = solve(MergingAnts(), catalogue()["empty"])
    assert len(result.history) < 10
    assert result.cost == pytest.approx(optimum(catalogue()["empty"]))


def test_merging_ants_stop_after_settled_iterations_without_a_better_tour():
    query = catalogue()["slalom"]
    history = solve(MergingAnts(settled=9), query).history
    assert (np.flatnonzero(history.best > history.best[-1] + 1e-9).max(initial=-1)) == len(history) - 11


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [20, 50])
def test_merging_ants_find_the_shortest_paths_on_random_grids(size, seed):
    query = grid_query(size, 0.25, seed)
    assert solve(MergingAnts(), query, seed).cost == pytest.approx(optimum(query))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_merging_ants_come_within_a_percent_over_large_grids(seed):
    query = grid_query(100, 0.25, seed)
    assert solve(MergingAnts(), query, seed).cost <= 1.01 * optimum(query)


@pytest.mark.parametrize("best", [1, 2, 3])
@pytest.mark.parametrize("ties", ["arc", "ant", "share"])
def test_the_additional_deposit_of_the_best_ants_depends_on_ties(best, ties):
    tours = walks(BEND, *[DIRECT] * best, [])
    trail = np.zeros((12, 8))
    ExploringAnts(elite=2.0, deposit=5.0, ties=ties).update(trail, state(tours))
    extra = {"arc": 2, "ant": 2 * best, "share": 2}[ties]  # eq. 7-8 of suganthi2019; all tours but BEND are one
    assert [trail[arc] for arc in arcs(DIRECT)] == pytest.approx([(best + extra) * 5 / tours.lengths[1]] * 3)
    assert [trail[arc] for arc in arcs(BEND)[:-1]] == pytest.approx([5 / tours.lengths[0]] * 3)


def test_by_the_letter_of_equation_8_each_arc_of_two_best_tours_receives_the_full_deposit():
    other = [(0, 0), (0, 1), (1, 2), (2, 3)]  # as long as DIRECT
    trails = {ties: np.zeros((12, 8)) for ties in ("arc", "ant", "share")}
    for ties, trail in trails.items():
        ExploringAnts(elite=2.0, ties=ties, depositors="all").update(trail, state(walks(DIRECT, other)))
    full = 1 / walks(DIRECT).lengths[0]
    for arc in {*arcs(DIRECT), *arcs(other)}:
        assert {ties: trail[arc] / full for ties, trail in trails.items()} == pytest.approx(
            {"arc": 3, "ant": 3, "share": 2}
        )


@pytest.mark.parametrize("mix", [0.0, 0.3, 1.0])
def test_the_first_pheromone_is_chance_by_the_given_share(mix, monkeypatch):
    """Eq. 14 of lee2008: mix x chance + (1 - mix) x potential / its largest value."""
    first = []

    def record(self, trail, heuristic, alpha):
        first.append(trail.copy())
        return np.empty(0), 0

    monkeypatch.setattr(AntPool, "run", record)
    query = Query(Grid.from_free(np.ones((20, 30))), (0, 0), (19, 29))
    planner = PotentialFieldAnts(mix=mix, min_pheromone=1e-9)
    next(planner.iterate(query, np.random.default_rng(3)))
    field = planner.potential(query)
    chance = first[0] - (1 - mix) * field / field.max()
    assert chance.min() >= -1e-12
    assert chance.max() <= mix
    assert chance.mean() == pytest.approx(mix / 2, abs=0.03 * mix + 1e-9)
    assert chance.std() == pytest.approx(mix / np.sqrt(12), abs=0.03 * mix + 1e-9)
