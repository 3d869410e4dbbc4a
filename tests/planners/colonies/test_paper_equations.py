"""Every equation of the papers on ants against numbers worked out by hand, on grids of a few cells."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from antdrive.planners import AcoHan, MaxMinDStar, PotentialFieldAnts, Query
from antdrive.planners.colonies import _kernels_mmas_dstar, _kernels_pfaco
from antdrive.planners.colonies.ant_system import AgeingAnts, AntSystem, ExploringAnts, ibraheem_beta
from antdrive.planners.colonies.colony import ChoiceContext, Colony, ColonyGraph, IterationState, Walks
from antdrive.planners.colonies.pfaco import AntPool
from antdrive.worlds import Floats, Grid

EAST, NORTH_EAST, NORTH, WEST = 0, 1, 2, 4


def graph(rows: int, cols: int, goal: tuple[int, int]) -> ColonyGraph:
    return ColonyGraph.of(Query(Grid.from_free(np.ones((rows, cols))), (0, 0), goal))


ROW = graph(1, 3, (0, 2))  # cells 0, 1, 2 from start to goal
SQUARE = graph(2, 2, (1, 1))


def after(planner: Colony, over: ColonyGraph, walks: list[list[int]], lengths: list[float], trail: Floats) -> Floats:
    """The trail after an iteration of these walks, all arrived, the first the best."""
    cells = np.zeros((len(walks), max(map(len, walks))), dtype=np.int32)
    for row, walk in enumerate(walks):
        cells[row, : len(walk)] = walk
    made = Walks(cells, np.array([len(walk) for walk in walks]), np.array(lengths))
    planner.update(trail, IterationState(0, over, made, made, None, made.only(0), 0, np.random.default_rng(0)))
    return trail


def shares(planner: Colony, over: ColonyGraph, trail: Floats, cell: int, kind: int = 0) -> dict[int, float]:
    """The probability of each move from a cell."""
    weights = np.zeros((len(over.mask), 8), dtype=np.float32)
    planner.choice_weights(over, trail, planner.heuristic_values(over), weights, ChoiceContext(kind))
    row = weights[cell] / weights[cell].sum()
    return {k: float(row[k]) for k in range(8) if row[k] > 0}


# han2007


def test_han2007_4_2_1() -> None:
    # At cell 1 the shares of pheromone are 1/4 and 3/4; east points to the goal, west away: 1.75 and 0.25.
    found = shares(AcoHan(), ROW, np.array([1.0, 5.0, 3.0]), 1)
    assert found == pytest.approx({EAST: 1.75 / 2.0, WEST: 0.25 / 2.0})


def test_han2007_4_2_2_and_4_2_3() -> None:
    trail = after(AcoHan(evaporation=0.1), ROW, [[0, 1, 2]], [2.0], np.ones(3))
    assert trail == pytest.approx([1.4] * 3)  # 0.9 * 1 + 1 / 2


def test_han2007_4_2_4() -> None:
    trail = after(AcoHan(evaporation=0.1, elitism=4), ROW, [[0, 1, 2]], [2.0], np.ones(3))
    assert trail == pytest.approx([3.4] * 3)  # 1.4 + 4 / 2


# suganthi2019


def test_suganthi2019_1_and_6() -> None:
    trail = np.ones((4, 8))
    trail[0, EAST] = 2.0
    found = shares(AntSystem(beta=1.0, heuristic="step"), SQUARE, trail, 0)
    # Pheromone over length: 2 / 1, 1 / 1.41421, 1 / 1; together 3.70711.
    assert found == pytest.approx({EAST: 0.539504, NORTH_EAST: 0.190744, NORTH: 0.269752}, rel=1e-5)


def test_suganthi2019_2_to_4() -> None:
    trail = after(AntSystem(evaporation=0.3), ROW, [[0, 1, 2], [0, 1, 2]], [2.0, 2.0], np.ones((3, 8)))
    assert trail[0, EAST] == trail[1, EAST] == pytest.approx(1.7)  # 0.7 + 1 / 2 + 1 / 2
    assert trail[1, WEST] == pytest.approx(0.7)


def test_suganthi2019_5() -> None:
    trail = np.ones((4, 8))
    trail[0, EAST] = 2.0
    found = shares(ExploringAnts(), SQUARE, trail, 0, kind=1)
    # 1 / length over pheromone: 0.5, 0.707107, 1; together 2.207107.
    assert found == pytest.approx({EAST: 0.226541, NORTH_EAST: 0.320377, NORTH: 0.453082}, rel=1e-5)


def test_suganthi2019_7_and_8() -> None:
    best, other = [0, 3], [0, 1, 3]
    planner = ExploringAnts(evaporation=0.3, elite=1.0)
    trail = after(planner, SQUARE, [best, other], [math.sqrt(2), 2.0], np.ones((4, 8)))
    assert trail[0, NORTH_EAST] == pytest.approx(2.114214)  # 0.7 + 2 / 1.414214
    assert trail[0, EAST] == pytest.approx(1.2)  # 0.7 + 1 / 2


# ibraheem2016


def test_ibraheem2016_1_and_6() -> None:
    row = graph(1, 4, (0, 3))
    # From cell 1: 1 cell is left from cell 2 and 3 are from cell 0; with beta 2 the weights are 1 and 1/9.
    assert shares(AntSystem(beta=2.0), row, np.ones((4, 8)), 1) == pytest.approx({EAST: 0.9, WEST: 0.1})


def test_ibraheem2016_table_1() -> None:
    assert [ibraheem_beta(size) for size in (10, 20, 30, 40)] == pytest.approx([2.2, 4.4, 6.6, 8.8])


def test_ibraheem2016_2_to_4() -> None:
    trail = after(AntSystem(evaporation=0.3, deposit=3.0), ROW, [[0, 1, 2]], [2.0], np.full((3, 8), 2.0))
    assert trail[0, EAST] == pytest.approx(2.9)  # 0.7 * 2 + 3 / 2


def test_ibraheem2016_5() -> None:
    # 2 - 0.5 * 0.5 - 0.25 m; the last, 0.75, is below Q_min.
    assert AgeingAnts(q_max=2.0, q_min=1.0).aged(np.full(4, 0.5)) == pytest.approx([1.5, 1.25, 1.0, 1.0])


# lee2008


def test_lee2008_9_and_11() -> None:
    free = np.ones((1, 7))
    free[0, 6] = 0
    query = Query(Grid.from_free(free), (0, 0), (0, 5))
    field = PotentialFieldAnts(attraction=2.0, repulsion=8.0, influence=2.0).potential(query)
    # d^2 is 0, 1, 4, 9, 16, 25; beside the obstacle 4 (1 - 1/2)^2 = 1 less; the shift is attraction / 2 = 1.
    assert field == pytest.approx([1.0, 2.0, 5.0, 10.0, 17.0, 25.0, 0.0])


@pytest.mark.parametrize(("form", "east"), [("letter", 5.0), ("local", 5.0), ("rise", 3.0)])
def test_lee2008_13(form: Any, east: float) -> None:
    # At cell 1 of a row, with U = 1, 2, 5, U_ij to the west is 1 in each form (the least, attraction / 2); to the east
    # it is 5 to the letter, 5 - 1 + 1 above the lowest cell around, and 5 - 2 as a rise. Pheromone 2 and sqrt(3).
    planner = PotentialFieldAnts(attraction=2.0, repulsion=0.0, form=form)
    field = planner.potential(Query(Grid.from_free(np.ones((1, 3))), (0, 0), (0, 2)))
    trail, out, unseen = np.array([2.0, 1.0, math.sqrt(3)]), np.zeros(8), np.zeros((1, 1), dtype=np.uint8)
    drawn = planner.attractions(ROW, field)
    total = _kernels_pfaco.cumulate(1, 0, trail, drawn, ROW.mask, ROW.offset, unseen, True, 2.0, out)
    assert out[EAST] == pytest.approx(3.0 * east)  # alpha is 2
    assert total - out[EAST] == pytest.approx(4.0)


def test_lee2008_14() -> None:
    first: list[Floats] = []

    class Seen(Exception): ...

    def look(self: AntPool, trail: Floats, heuristic: Floats, alpha: float) -> tuple[Floats, int]:
        first.append(trail.copy())
        raise Seen

    query = Query(Grid.from_free(np.ones((1, 3))), (0, 0), (0, 2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(AntPool, "run", look)
        for mix in (0.0, 0.3):
            with pytest.raises(Seen):
                next(PotentialFieldAnts(mix=mix, repulsion=0.0).iterate(query, np.random.default_rng(5)))
    chance = np.random.default_rng(5).random(3)
    # U is 0.5, 1, 2.5, hence 0.2, 0.4, 1 as a share of the largest.
    assert first[0] == pytest.approx([0.2, 0.4, 1.0])
    assert first[1] == pytest.approx(0.3 * chance + 0.7 * np.array([0.2, 0.4, 1.0]))


def test_lee2008_15() -> None:
    empty = np.zeros((3, 9), dtype=np.int32), np.zeros(3, dtype=np.int64), np.zeros(3), np.zeros(3, dtype=np.int64)
    ranking = _kernels_pfaco.Ranking(*empty, np.zeros(2, dtype=np.int64))
    walk = np.arange(9, dtype=np.int32)
    assert _kernels_pfaco.enter(walk, 5, 4.0, ranking) == 0  # 5 cells, length 4: cost 20
    assert _kernels_pfaco.enter(walk, 4, 4.5, ranking) == 0  # cost 18: longer, but of fewer cells
    assert ranking.costs[ranking.order[:2]].tolist() == [18.0, 20.0]


# hasan


def test_hasan_pheromone() -> None:
    query = Query(Grid.from_free(np.ones((2, 4))), (0, 0), (1, 3))
    _, pheromone, _, _ = MaxMinDStar().spread(query)
    # From (0, 0) two straight moves and a diagonal one: 0.98 (1 + 1 + 1.4) = 3.332; from (0, 2) 0.98 * 1.4 = 1.372.
    assert pheromone[0] == pytest.approx(3.332)
    assert pheromone[2] == pytest.approx(1.372)


def test_hasan_1() -> None:
    over = graph(1, 4, (0, 3))
    pheromone = np.array([2.0, 0.0, 3.0, 1.0])

    def decided(alpha: float, beta: float) -> int:
        # From cell 1: cell 0 has 2^alpha 3^beta, cell 2 has 3^alpha 1^beta; the smaller one is taken.
        made = _kernels_mmas_dstar.decide(over.mask, over.offset, 4, 1, 3, alpha, beta, pheromone)
        return int(made)

    assert decided(1.0, 0.0) == 0  # 2 < 3
    assert decided(1.0, 1.0) == 2  # 6 > 3
    assert decided(3.0, 1.0) == 0  # 24 < 27
