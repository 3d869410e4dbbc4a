"""Properties of every replanner, whichever planner it is made for."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from antdrive.planners import (
    PLANNERS,
    Capabilities,
    MergingAnts,
    Planner,
    PlanResult,
    PlanStatus,
    Query,
    ReplanFromScratch,
    Replanner,
    WarmStartedColony,
    agent_for,
    capabilities_of,
    load_planner,
    path_cost,
    replanner_for,
)
from antdrive.planners.colonies.warm_start import even_out
from antdrive.worlds import DIRECTIONS, Grid
from tests.planners.replanning.agreement import World
from tests.planners.worlds_to_solve import catalogue, optimum, random_discs, random_query, sealed

ON_CELLS = [
    name
    for name, planner in PLANNERS.items()
    if not (capabilities_of(planner).needs_world or capabilities_of(planner).needs_motions)
]
OPTIMAL = {"dijkstra", "astar", "dstar", "dstar-lite"}
MAY_MISS = {name for name in ON_CELLS if not capabilities_of(PLANNERS[name]).complete}


def quick(name: str) -> Planner:
    planner: Any = PLANNERS[name]
    known = {f.name for f in dataclasses.fields(planner)}
    return load_planner(name, **{k: v for k, v in {"ants": 30, "iterations": 8}.items() if k in known})


def made(name: str, query: Query, seed: int = 0) -> Replanner:
    return replanner_for(quick(name), query, np.random.default_rng(seed))


@pytest.mark.parametrize("name", ON_CELLS)
def test_after_any_change_the_answer_fits_the_grid_as_it_is(name: str) -> None:
    rng = np.random.default_rng(4)
    solved = 0
    for turn in range(14):
        query = (random_query, random_discs)[turn % 2](rng)
        replanner, world = made(name, query, turn), World(query.grid)
        assert isinstance(replanner, Replanner)
        for _ in range(5):
            now, result = replanner.query, replanner.result()
            floor = world.optimum(now.start, now.goal)
            if result.solved:
                assert tuple(result.cells[0]) == now.start
                assert tuple(result.cells[-1]) == now.goal
                for here, step in zip(result.cells, np.diff(result.cells, axis=0), strict=False):
                    assert int(now.grid.moves[tuple(here)]) >> DIRECTIONS.index(tuple(map(int, step))) & 1
                assert result.cost == pytest.approx(path_cost(result.cells, now.grid.cell), abs=1e-9)
                assert result.cost >= floor - 1e-9
                assert result.waypoints is None
            else:
                assert result.reason
            if name not in MAY_MISS:
                assert result.solved == math.isfinite(floor)
            if name in OPTIMAL:
                assert result.cost == pytest.approx(floor, abs=1e-9)
            solved += result.solved
            cells = rng.integers(0, query.grid.shape, (int(rng.integers(1, 6)), 2))
            free = bool(rng.random() < 0.5)
            (replanner.clear if free else replanner.block)(cells)
            world.free[tuple(cells.T)] = free
            if len(result.cells) > 2 and rng.random() < 0.7:
                replanner.move(tuple(map(int, result.cells[1])))
            elif rng.random() < 0.3:
                replanner.move(tuple(map(int, rng.integers(0, query.grid.shape))))
    assert solved > 20


@pytest.mark.parametrize("name", ON_CELLS)
def test_following_a_path_takes_no_work(name: str) -> None:
    replanner = made(name, catalogue()["empty"])
    first = replanner.result()
    if not first.solved:
        assert name in MAY_MISS
        return
    replanner.move(tuple(map(int, first.cells[3])))
    rest = replanner.result()
    assert rest.work == 0
    np.testing.assert_array_equal(rest.cells, first.cells[3:])
    assert rest.cost == pytest.approx(path_cost(rest.cells, replanner.query.grid.cell))


@pytest.mark.parametrize("name", ON_CELLS)
def test_a_cleared_cell_opens_a_path(name: str) -> None:
    replanner = made(name, sealed())
    assert replanner.result().status is PlanStatus.NO_PATH
    replanner.clear([(4, 4)])
    result = replanner.result()
    assert result.solved or name in MAY_MISS
    replanner.block([replanner.query.start])
    assert "the start cell" in replanner.result().reason


@pytest.mark.parametrize("name", ["ants", "mmas", "ga-han"])
def test_the_same_seed_gives_the_same_answers(name: str) -> None:
    def answered() -> list[list[list[int]]]:
        replanner, answers = made(name, catalogue()["forest"], seed=3), []
        for r in range(5, 14, 4):
            answers.append(replanner.result().cells.tolist())
            replanner.block([(r, r), (r, r + 1)])
        return answers

    assert answered() == answered()


def test_a_planner_s_own_replanner_is_used_if_it_has_one() -> None:
    query, rng = catalogue()["empty"], np.random.default_rng(0)
    kinds = {name: type(replanner_for(PLANNERS[name], query, rng)).__name__ for name in ("dstar", "dstar-lite", "ants")}
    assert kinds == {"dstar": "DStarSearch", "dstar-lite": "DStarLiteSearch", "ants": "WarmStartedColony"}
    assert isinstance(replanner_for(PLANNERS["mmas"], query, rng), ReplanFromScratch)


def test_a_planner_that_declares_nothing_plans_anew_after_every_change() -> None:
    """As other people's planners may: only `plan` is needed."""

    class Bare:
        def plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
            return PLANNERS["astar"].plan(query, rng)

    query, rng = catalogue()["empty"], np.random.default_rng(0)
    assert capabilities_of(Bare()) == Capabilities()
    replanner = replanner_for(Bare(), query, rng)
    before = replanner.result()
    replanner.block([before.cells[len(before.cells) // 2]])
    assert replanner.result().solved
    assert agent_for(Bare(), query, rng).step([]) == tuple(before.cells[1])


@pytest.mark.parametrize(("name", "instead"), [("tangent", "discs"), ("sipp", "motions")])
def test_a_planner_that_does_not_plan_on_cells_alone_is_refused(name: str, instead: str) -> None:
    with pytest.raises(ValueError, match=instead):
        replanner_for(PLANNERS[name], catalogue()["empty"], np.random.default_rng(0))


def cylinders(seed: int) -> Query:
    rng = np.random.default_rng(seed)
    free = rng.random((40, 40)) >= 0.2
    free[0, 0] = free[39, 39] = True
    query = Query(Grid.from_free(free), (0, 0), (39, 39))
    return query if math.isfinite(optimum(query)) else cylinders(seed + 100)


def test_a_warm_started_colony_takes_a_fraction_of_the_work_and_stays_near_the_optimum() -> None:
    shares, gaps = [], []
    for seed in range(6):
        query, rng = cylinders(seed), np.random.default_rng(seed)
        ants = WarmStartedColony(MergingAnts(), query, rng)
        for _ in range(3):
            path = ants.result().cells
            if len(path) < 20:
                break
            ants.move(tuple(map(int, path[2])))
            ants.block(path[8:10])
            if not math.isfinite(optimum(ants.query)):
                break
            warm = ants.result()
            cold = MergingAnts().plan(ants.query, rng)
            shares.append(warm.work / cold.work)
            gaps.append(warm.cost / optimum(ants.query) - 1)
    assert len(shares) > 8
    assert np.median(shares) < 0.5
    assert np.median(gaps) < 0.01
    assert max(gaps) < 0.1


def test_trails_are_evened_out_by_distance() -> None:
    trail = np.full((49, 8), 2.0)
    trail[0] = 10.0
    even_out(trail, (7, 7), np.array([24]), 2)  # the middle of 7 x 7
    shown = trail[:, 0].reshape(7, 7)
    expected = np.full((7, 7), 2.0)
    expected[1:6, 1:6] = 2 + 8 / 3
    expected[2:5, 2:5] = 2 + 16 / 3
    expected[3, 3] = expected[0, 0] = 10
    np.testing.assert_allclose(shown, expected)


@pytest.mark.parametrize("key", ["settled", "reach"])
def test_misuse_is_refused_by_name(key: str) -> None:
    with pytest.raises(ValueError, match=f"^{key}: must be"):
        WarmStartedColony(MergingAnts(), catalogue()["empty"], np.random.default_rng(0), **{key: 0})
