"""Further equations of papers against hand calculations on a few cells."""

import math

import numpy as np
import pytest

from antdrive.planners import PotentialFieldAnts, Query
from antdrive.planners.anyangle import _kernels_ga
from antdrive.planners.anyangle.lines import terrain
from antdrive.planners.colonies import _kernels_pfaco
from antdrive.planners.colonies.ant_system import AntSystem, ExploringAnts
from antdrive.planners.colonies.colony import ColonyGraph, IterationState, Walks
from antdrive.worlds import Disc, Grid, Task, World, rasterise

EAST, NORTH_EAST, NORTH, WEST = 0, 1, 2, 4


def graph(rows, cols, goal):
    return ColonyGraph.of(Query(Grid.from_free(np.ones((rows, cols))), (0, 0), goal))


ROW = graph(1, 3, (0, 2))  # cells 0, 1, 2 from start to goal
SQUARE = graph(2, 2, (1, 1))


def after(planner, over, walks, lengths, trail):
    """Return the trail after an iteration of these walks; all arrived, the first is the best."""
    cells = np.zeros((len(walks), max(map(len, walks))), dtype=np.int32)
    for row, walk in enumerate(walks):
        cells[row, : len(walk)] = walk
    made = Walks(cells, np.array([len(walk) for walk in walks]), np.array(lengths))
    planner.update(trail, IterationState(0, over, made, made, None, made.only(0), 0, np.random.default_rng(0)))
    return trail


def test_han2007_4_1_1_and_4_1_2():
    # The thesis' own example: (x - 12)^2 + (y - 12)^2 = 4 and the chromosome (0, 0), (10, 10), (20, 20). Its first line
    # ends 2.83 from the centre and is clear, its second passes through. Through (16, 6) both lines are clear: the
    # distances are 18 / sqrt(73) - 2 and 28 / sqrt(53) - 2.
    task = Task(World("thesis", (-0.5, -0.5, 20.5, 20.5), (Disc(12, 12, 2),)), (0.0, 0.0, 0.0), (20.0, 20.0), cell=1.0)
    land = terrain(Query.between(rasterise(task.world, 1.0), task))
    start, middle, goal = np.array([0.0, 0.0]), np.array([[10.0, 10.0]]), np.array([20.0, 20.0])
    assert _kernels_ga.feasible(np.empty((0, 2)), np.array([start, middle[0]]), land)
    assert not _kernels_ga.feasible(middle, np.array([start, goal]), land)
    assert _kernels_ga.feasible(np.array([[16.0, 6.0]]), np.array([start, goal]), land)


def test_han2007_fitness_is_the_distance_of_the_path():
    ends = np.array([[0.0, 0.0], [20.0, 20.0]])
    assert _kernels_ga.length_of(np.array([[3.0, 4.0], [20.0, 4.0]]), ends) == pytest.approx(5.0 + 17.0 + 16.0)


def test_suganthi2019_7_and_8():
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


def test_the_ranking_list_of_lee2008s_conventional_colony():
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


def test_the_initial_pheromone_of_lee2008s_conventional_colony_is_random():
    trail = AntSystem(initial=4.0, mix=0.25).initial_trail(SQUARE, np.random.default_rng(0))
    assert trail.shape == (4, 8)
    assert 3.0 < trail.min() < trail.max() <= 4.0  # a quarter is chance
    assert (AntSystem(initial=4.0).initial_trail(SQUARE, np.random.default_rng(0)) == 4.0).all()


@pytest.mark.parametrize(("form", "east"), [("letter", 5.0), ("local", 5.0), ("rise", 3.0)])
def test_lee2008_13(form, east):
    # At cell 1 of a row, with U = 1, 2, 5, U_ij to the west is 1 in each form (the least, attraction / 2); to the east
    # it is 5 to the letter, 5 - 1 + 1 above the lowest cell around, and 5 - 2 as a rise. Pheromone 2 and sqrt(3).
    planner = PotentialFieldAnts(attraction=2.0, repulsion=0.0, form=form)
    field = planner.potential(Query(Grid.from_free(np.ones((1, 3))), (0, 0), (0, 2)))
    trail, out, unseen = np.array([2.0, 1.0, math.sqrt(3)]), np.zeros(8), np.zeros((1, 1), dtype=np.uint8)
    drawn = planner.attractions(ROW, field)
    total = _kernels_pfaco.cumulate(1, 0, trail, drawn, ROW.mask, ROW.to, unseen, True, 2.0, out)
    assert out[EAST] == pytest.approx(3.0 * east)  # alpha is 2
    assert total - out[EAST] == pytest.approx(4.0)


def test_lee2008_rank_determines_the_deposit():
    empty = np.zeros((4, 3), dtype=np.int32), np.zeros(4, dtype=np.int64), np.zeros(4), np.zeros(4, dtype=np.int64)
    ranking = _kernels_pfaco.Ranking(*empty, np.zeros(2, dtype=np.int64))
    walk, trail = np.arange(3, dtype=np.int32), np.zeros(3)
    _kernels_pfaco.reward(walk, 3, 5.0, trail, ranking, 2.0, True)
    assert trail == pytest.approx([2.0] * 3)  # the first rank of four
    _kernels_pfaco.reward(walk, 3, 6.0, trail, ranking, 2.0, True)
    assert trail == pytest.approx([3.5] * 3)  # the second: 2 (1 - 1/4) more
    _kernels_pfaco.reward(walk, 3, 7.0, trail, ranking, 2.0, False)
    assert trail == pytest.approx([5.5] * 3)  # without grades the third deposits as much as the first
