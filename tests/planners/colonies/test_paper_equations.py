"""Every equation of the papers behind the planners against numbers worked out by hand, on grids of a few cells."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from antdrive.base import Floats
from antdrive.planners import AcoHan, MaxMinDStar, PotentialField, PotentialFieldAnts, Query
from antdrive.planners.anyangle import _kernels_ga
from antdrive.planners.anyangle.lines import terrain
from antdrive.planners.colonies import _kernels_mmas_dstar, _kernels_pfaco
from antdrive.planners.colonies.ant_system import AgeingAnts, AntSystem, ExploringAnts, ibraheem_beta
from antdrive.planners.colonies.colony import ChoiceContext, Colony, ColonyGraph, IterationState, Walks
from antdrive.planners.colonies.mmas import MaxMinAnts
from antdrive.planners.colonies.pfaco import AntPool
from antdrive.worlds import Disc, Grid, Task, World, rasterise

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


def test_han2007_4_1_1_and_4_1_2() -> None:
    # The thesis' own example: (x - 12)^2 + (y - 12)^2 = 4 and the chromosome (0, 0), (10, 10), (20, 20). Its first line
    # ends 2.83 from the centre and is clear, its second passes through. By way of (16, 6) both lines are clear: the
    # distances are 18 / sqrt(73) - 2 and 28 / sqrt(53) - 2.
    task = Task(World("thesis", (-0.5, -0.5, 20.5, 20.5), (Disc(12, 12, 2),)), (0.0, 0.0, 0.0), (20.0, 20.0), cell=1.0)
    land = terrain(Query.between(rasterise(task.world, 1.0), task))
    start, middle, goal = np.array([0.0, 0.0]), np.array([[10.0, 10.0]]), np.array([20.0, 20.0])
    assert _kernels_ga.feasible(np.empty((0, 2)), np.array([start, middle[0]]), land)
    assert not _kernels_ga.feasible(middle, np.array([start, goal]), land)
    assert _kernels_ga.feasible(np.array([[16.0, 6.0]]), np.array([start, goal]), land)


def test_han2007_fitness_is_the_distance_of_the_path() -> None:
    ends = np.array([[0.0, 0.0], [20.0, 20.0]])
    assert _kernels_ga.length_of(np.array([[3.0, 4.0], [20.0, 4.0]]), ends) == pytest.approx(5.0 + 17.0 + 16.0)


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
    both = after(ExploringAnts(evaporation=0.3), SQUARE, [best, other], [math.sqrt(2), 2.0], np.ones((4, 8)))
    assert both[0, NORTH_EAST] == pytest.approx(2.114214)  # 0.7 + 2 / 1.414214, as alpha is 1
    assert both[0, EAST] == pytest.approx(1.2)  # 0.7 + 1 / 2
    # One common ant, then an exploratory one: in eq. 7 only the common ant counts, and the best ant of either kind.
    walks, lengths = [other, best, other], [2.0, math.sqrt(2), 2.0]
    common = after(ExploringAnts(ants=1, evaporation=0.3), SQUARE, walks[:2], lengths[:2], np.ones((4, 8)))
    assert common[0, NORTH_EAST] == pytest.approx(1.407107)  # 0.7 + 1 / 1.414214 of the elite alone
    assert common[0, EAST] == pytest.approx(1.2)  # 0.7 + 1 / 2 of the common ant
    everyone = ExploringAnts(ants=1, evaporation=0.3, depositors="all", elite=25.0)
    trail = after(everyone, SQUARE, walks, lengths, np.ones((4, 8)))
    assert trail[0, NORTH_EAST] == pytest.approx(19.084776)  # 0.7 + 26 / 1.414214
    assert trail[0, EAST] == pytest.approx(1.7)  # 0.7 + 1 / 2 + 1 / 2


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


def test_lee2008_1() -> None:
    row = graph(1, 4, (0, 3))
    trail = np.ones((4, 8))
    trail[1, WEST] = 3.0
    # From cell 1: eta is 1 towards the goal, 1/3 away from it, squared 1/9; the pheromone is 1 and 3: weights 1 and 1/3.
    assert shares(AntSystem(alpha=1.0, beta=2.0), row, trail, 1) == pytest.approx({EAST: 0.75, WEST: 0.25})


def test_lee2008_2_to_4() -> None:
    # rho, 0.99, is the share retained: 0.99 * 2 + 1 / 2.
    trail = after(AntSystem(ants=500, beta=2.0, evaporation=0.01), ROW, [[0, 1, 2]], [2.0], np.full((3, 8), 2.0))
    assert trail[0, EAST] == pytest.approx(2.48)


def test_the_ranking_list_of_lee2008s_conventional_colony() -> None:
    planner = AntSystem(evaporation=0.01, ranks=2)
    walks = [[0, 1, 3], [0, 3], [0, 2, 3], [0, 1, 3]]
    lengths = [2.0, math.sqrt(2), 4.0, math.inf]
    trail = after(planner, SQUARE, walks, lengths, np.ones((4, 8)))
    assert trail[0, NORTH_EAST] == pytest.approx(1.697107)  # 0.99 + 1 / 1.414214: the first rank
    assert trail[0, EAST] == pytest.approx(1.24)  # 0.99 + 1/2 of 1 / 2: the second of two ranks
    assert trail[0, NORTH] == pytest.approx(0.99)  # off the list
    many = after(AntSystem(evaporation=0.01, ranks=10), SQUARE, walks, lengths, np.ones((4, 8)))
    assert many[0, NORTH] == pytest.approx(0.99 + 0.8 / 4)  # the third of ten; the ant that did not arrive adds nothing
    assert many[0, EAST] == pytest.approx(0.99 + 0.9 / 2)


def test_lee2008_7_9_and_11() -> None:
    free = np.ones((1, 6))
    free[0, 5] = 0
    field = PotentialField(k_att=2.0, k_rep=8.0, influence=2.0).potential(Query(Grid.from_free(free), (0, 0), (0, 3)))
    # To the goal: d^2 is 9, 4, 1, 0, 1; beside the obstacle 4 (1 - 1/2)^2 = 1 is added, 2 cells from it 0.
    assert field[0] == pytest.approx([9.0, 4.0, 1.0, 0.0, 2.0, math.inf])


def test_lee2008_5_6_and_8() -> None:
    # Down the gradient: from (0, 0) U falls by 9 - 4 = 5 to the east, by 13 - 9 over sqrt(2) = 2.83 aslant.
    query = Query(Grid.from_free(np.ones((3, 4))), (0, 0), (0, 3))
    plan = PotentialField(k_rep=0.0).plan(query, np.random.default_rng(0))
    assert plan.cells.tolist() == [[0, 0], [0, 1], [0, 2], [0, 3]]


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


def test_lee2008_rank_determines_the_deposit() -> None:
    empty = np.zeros((4, 3), dtype=np.int32), np.zeros(4, dtype=np.int64), np.zeros(4), np.zeros(4, dtype=np.int64)
    ranking = _kernels_pfaco.Ranking(*empty, np.zeros(2, dtype=np.int64))
    walk, trail = np.arange(3, dtype=np.int32), np.zeros(3)
    _kernels_pfaco.reward(walk, 3, 5.0, trail, ranking, 2.0)
    assert trail == pytest.approx([2.0] * 3)  # the first rank of four
    _kernels_pfaco.reward(walk, 3, 6.0, trail, ranking, 2.0)
    assert trail == pytest.approx([3.5] * 3)  # the second: 2 (1 - 1/4) more


# Stützle & Hoos 2000, as hasan tells it


def test_hasan_4() -> None:
    # Only the best ant deposits: 0.8 * 1 + 1 / 2; on the other's arcs 0.8 is left. Both are within the bounds.
    planner = MaxMinAnts(evaporation=0.2, p_best=0.9)
    trail = after(planner, SQUARE, [[0, 1, 3], [0, 2, 3]], [2.0, 2.0], np.ones((4, 8)))
    assert trail[0, EAST] == trail[1, NORTH] == pytest.approx(1.3)
    assert trail[0, NORTH] == pytest.approx(0.8)


def test_stuetzle_hoos_7_and_11() -> None:
    # A tour of 2 steps on 2 x 2 cells with 3 moves each, one of them back: tau_max = 1 / (0.2 * 2); with p_best = 0.81 a
    # step is right with probability 0.9, and tau_min = tau_max * 0.1 / ((2 - 1) * 0.9).
    best = Walks(np.array([[0, 1, 3]], dtype=np.int32), np.array([3]), np.array([2.0]))
    tau_min, tau_max = MaxMinAnts(evaporation=0.2, p_best=0.81).bounds(SQUARE, best)
    assert tau_max == pytest.approx(2.5)
    assert tau_min == pytest.approx(0.277778, rel=1e-5)


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
