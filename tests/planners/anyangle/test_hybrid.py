"""Ants for the corridor, a genetic algorithm for the line (after Han 2007, section 6.3)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.base.plane import polyline_length
from antdrive.planners import AcoHan, Hybrid, PlanResult, PlanStatus, Query, Tangent, keep_best, load_planner, watch
from antdrive.planners.iterative import Progress
from antdrive.worlds import Disc, Grid, Task, World, load_task, polyline_clearance, rasterise
from tests.planners.worlds_to_solve import catalogue, optimum

FLOOR = 30.0711


def single() -> Query:
    """One obstacle of radius 5 at (10, 10) on the grid points (0, 0) to (20, 20), for a point robot."""
    world = World("single", (-0.5, -0.5, 20.5, 20.5), (Disc(10, 10, 5),))
    task = Task(world, (0.0, 0.0, 0.0), (20.0, 20.0), cell=1.0)
    return Query.between(rasterise(world, 1.0), task)


def of_catalogue(name: str) -> Query:
    task = load_task(name)
    return Query.between(rasterise(task.world, task.cell, 0.363), task)


def solve(query: Query, seed: int = 0, **options: object) -> PlanResult:
    return dataclasses.replace(Hybrid(), **options).plan(query, np.random.default_rng(seed))  # type: ignore[arg-type]


def test_the_line_comes_within_two_percent_of_the_shortest() -> None:
    query = single()
    for seed in range(10):
        assert FLOOR < solve(query, seed).length < 1.02 * FLOOR  # type: ignore[operator]


@pytest.mark.parametrize("name", ["empty", "forest", "gate", "han2007-aco", "han2007-ga", "slalom", "u-trap"])
def test_the_line_keeps_the_clearance_and_is_near_the_shortest(name: str) -> None:
    query = of_catalogue(name)
    assert query.task is not None
    floor = Tangent().plan(query, np.random.default_rng(0)).length
    assert floor is not None
    # Where the grid has no free cells in the best corridor, ants cannot find it.
    corridor = {"forest": 1.06, "han2007-aco": 1.10}.get(name, 1.03)
    for seed in range(3):
        result = solve(query, seed)
        assert result.solved, result.reason
        xy = query.grid.xy(result.line)
        assert polyline_clearance(query.task.world, xy) > query.grid.inflate - 1e-9
        assert result.length == pytest.approx(polyline_length(xy), abs=1e-9)
        assert floor - 1e-9 <= result.length <= corridor * floor  # type: ignore[operator]


def test_the_genetic_algorithm_improves_on_the_pulled_path() -> None:
    query = of_catalogue("slalom")
    history = solve(query).history
    assert (np.diff(history.best) <= 1e-12).all()
    assert len(history) == Hybrid().iterations
    assert history.best[-1] < history.best[29] - 0.05
    assert history.best[29] < optimum(query) - 0.05


def test_all_chromosomes_are_feasible_in_every_generation() -> None:
    result = solve(of_catalogue("forest"), iterations=40)
    assert (result.history.arrived[30:] == Hybrid().population).all()
    assert result.field is not None
    assert result.field.max() == Hybrid().population


def test_a_straight_line_stays_straight() -> None:
    query = of_catalogue("empty")
    assert query.task is not None
    assert solve(query).length == pytest.approx(np.hypot(*np.subtract(query.task.goal, query.task.start[:2])))


def test_interrupted_during_the_ants_it_returns_their_pulled_path() -> None:
    query = of_catalogue("u-trap")

    def stop(progress: Progress) -> None:
        if progress.done == 3:
            raise KeyboardInterrupt

    with watch(stop), keep_best():
        result = solve(query)
    assert result.status is PlanStatus.STOPPED
    assert result.reason == "interrupted after 3 of 200 iterations"
    assert result.length == pytest.approx(result.history.best[-1])


def test_the_plan_stops_if_no_ant_arrives() -> None:
    query = catalogue()["slalom"]
    lost = dataclasses.replace(AcoHan(), max_steps=2)
    hybrid = Hybrid(iterations=5)
    object.__setattr__(hybrid, "_ants", lambda: lost)
    result = hybrid.plan(query, np.random.default_rng(0))
    assert result.status is PlanStatus.STOPPED
    assert "nothing arrived within 5 iterations" in result.reason


def test_a_bare_grid_is_planned_on_its_free_cells() -> None:
    free = np.ones((30, 30))
    free[5:25, 14] = 0
    result = solve(Query(Grid.from_free(free), (15, 2), (15, 27)))
    by_hand = np.hypot(11.5, 9.5) + 1 + np.hypot(12.5, 9.5)  # past the corners of the blocked column
    assert by_hand <= result.length <= 1.02 * by_hand  # type: ignore[operator]


def test_the_colony_is_an_ant_planner_by_name() -> None:
    with pytest.raises(InputError, match=r"planner\.colony: must be an ant planner, one of aco-han, .*; got 'astar'"):
        load_planner("hybrid", colony="astar")
    with pytest.raises(ValueError, match=r"^colony: must be an ant planner, one of aco-han, .*; got 'aco-ham'"):
        Hybrid(colony="aco-ham")
    assert load_planner("hybrid", colony="aco-han-elite").plan(single(), np.random.default_rng(0)).solved
