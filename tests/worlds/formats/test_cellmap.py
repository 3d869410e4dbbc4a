"""Maps of cells: the discs that cover a map, and the map of a world of discs."""

import math
from collections import deque
from fractions import Fraction

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from antdrive.worlds import CellMap, Disc, World, cell_map, map_task, rasterise
from antdrive.worlds.formats.cellmap import conversion_progress, cover, largest_ground
from tests.worlds.oracles import worlds

CORNER = (math.sqrt(2) - 1) / 2
RESOLUTIONS = st.sampled_from([0.05, 0.1, 0.25, 1.0, 0.3])


@st.composite
def maps(draw, most=9):
    rows, cols = draw(st.integers(1, most)), draw(st.integers(1, most))
    share = draw(st.integers(1, 9))
    cells = draw(st.lists(st.integers(0, 9), min_size=rows * cols, max_size=rows * cols))
    free = np.array(cells).reshape(rows, cols) < share
    origin = draw(st.sampled_from([(0.0, 0.0), (-12.2, 3.7), (100.05, -51.35)]))
    return CellMap(free, draw(RESOLUTIONS), origin)


def centre(cells, row, col):
    return cells.origin[0] + (col + 0.5) * cells.resolution, cells.origin[1] + (row + 0.5) * cells.resolution


def joined(free, *starts):
    """The free cells that steps over shared sides lead to."""
    seen, todo = np.zeros_like(free), deque(starts)
    while todo:
        r, c = todo.popleft()
        if 0 <= r < free.shape[0] and 0 <= c < free.shape[1] and free[r, c] and not seen[r, c]:
            seen[r, c] = True
            todo += [(r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1)]
    return seen


def touched_by(free):
    """The blocked cells that share a point with a free one."""
    spots = np.argwhere(free)
    return [(r, c) for r, c in np.argwhere(~free) if len(spots) and np.abs(spots - (r, c)).max(axis=1).min() == 1]


def covered(cells, row, col, discs):
    """Whether one of the discs holds the four corners of a cell, in exact arithmetic."""
    side, x0, y0 = Fraction(cells.resolution), Fraction(cells.origin[0]), Fraction(cells.origin[1])
    corners = [(x0 + side * (col + i), y0 + side * (row + j)) for i in (0, 1) for j in (0, 1)]
    return any(
        all((x - Fraction(cx)) ** 2 + (y - Fraction(cy)) ** 2 <= Fraction(r) ** 2 for x, y in corners)
        for cx, cy, r in discs.tolist()
    )


def beyond_blocked(cells, points):
    """Distances from points to the nearest blocked cell, or to the map's edge."""
    xmin, ymin, xmax, ymax = cells.bounds
    x, y = points.T
    best = np.minimum.reduce([x - xmin, xmax - x, y - ymin, ymax - y])
    for row, col in np.argwhere(~cells.free):
        (cx, cy), half = centre(cells, row, col), cells.resolution / 2
        best = np.minimum(best, np.hypot(np.maximum(abs(x - cx) - half, 0), np.maximum(abs(y - cy) - half, 0)))
    return best


@given(maps(), st.sampled_from([None, 0.25, 0.6, 1.3]))
@settings(max_examples=25)
def test_cells_are_fully_covered_and_discs_reach_no_farther_than_the_overhang(cells, wanted):
    side = cells.resolution
    found = cover(cells, None if wanted is None else wanted * side)
    assert found.overhang <= (CORNER if wanted is None else wanted) * side + 1e-9
    needed = touched_by(cells.free)
    assert found.cells == len(needed)
    assert len(found.discs) <= len(needed)
    for row, col in needed:
        assert covered(cells, row, col, found.discs), (row, col)
    steps = (np.arange(9) + 0.5) / 9 - 0.5
    for row, col in np.argwhere(cells.free):
        points = np.array([(x, y) for x in steps for y in steps]) * side + centre(cells, row, col)
        for x, y, radius in found.discs:
            inside = points[np.hypot(*(points - (x, y)).T) <= radius]
            assert (beyond_blocked(cells, inside) <= found.overhang + 2e-9).all()


def test_solid_ground_takes_fewer_discs_than_cells_and_a_larger_overhang_fewer_still():
    free = np.ones((40, 40), dtype=bool)
    free[8:32, 8:32] = False
    counts = [len(cover(CellMap(free, 0.1), overhang).discs) for overhang in (None, 0.05, 0.1)]
    assert 92 / 3 > counts[0] > counts[1] > counts[2]


@given(maps(), st.data())
@settings(max_examples=25)
def test_planners_use_the_exact_cells_of_the_map(cells, data):
    """The robot fits through a passage one cell wide between discs."""
    spots = [tuple(spot) for spot in np.argwhere(cells.free).tolist()]
    assume(spots)
    start, goal = data.draw(st.sampled_from(spots)), data.draw(st.sampled_from(spots))
    ends = centre(cells, *start), centre(cells, *goal)
    if start == goal:
        ends = ends[0], (ends[1][0] + cells.resolution / 10, ends[1][1])
    task = map_task(cells, (*ends[0], 0.0), ends[1], name="m")
    grid = rasterise(task.world, task.cell, 0.25 * cells.resolution)
    seen = joined(grid.free, grid.cell_at(*ends[0]), grid.cell_at(*ends[1]))
    meant = joined(cells.free, start, goal)
    np.testing.assert_allclose(
        grid.xy(np.argwhere(seen)), [centre(cells, *cell) for cell in np.argwhere(meant)], atol=1e-9
    )


def test_unreachable_cells_need_no_discs_and_the_bounds_are_drawn_in():
    free = np.zeros((20, 30), dtype=bool)
    free[5:8, 10:14] = True
    alone = map_task(CellMap(free, 1.0, (100.0, 0.0)), (110.5, 5.5, 0.0), (113.5, 7.5), name="room")
    free[15:18, 2:25] = True
    other = map_task(CellMap(free, 1.0, (100.0, 0.0)), (110.5, 5.5, 0.0), (113.5, 7.5), name="room")
    assert alone == other
    assert alone.world.obstacles == ()  # the bounds are its walls
    assert alone.world.bounds == (110.0, 5.0, 114.0, 8.0)
    both = map_task(CellMap(free, 1.0, (100.0, 0.0)), (110.5, 5.5, 0.0), (113.5, 16.5), name="room")
    assert "start and goal are not joined" in (both.world.source or "")


MAP = CellMap(np.array([[True, True, True, False], [True, True, True, True]]), 0.5)


# The map of a world


@given(worlds(), st.sampled_from([0.25, 0.3, 0.7, 1.1, 30.0]))
@settings(max_examples=20)
def test_a_cell_is_free_when_no_disc_and_no_wall_reaches_into_it(world, resolution):
    cells = cell_map(world, resolution)
    xmin, ymin, xmax, ymax = world.bounds
    assert cells.origin == (xmin, ymin)
    assert cells.free.shape == (
        math.ceil((ymax - ymin) / resolution - 1e-9),
        math.ceil((xmax - xmin) / resolution - 1e-9),
    )
    for (row, col), free in np.ndenumerate(cells.free):
        left, low = xmin + col * resolution, ymin + row * resolution
        depth = max(
            left + resolution - xmax, low + resolution - ymax
        )  # how deep a wall or a disc reaches into the cell
        for disc in world.obstacles:
            x, y = min(max(disc.x, left), left + resolution), min(max(disc.y, low), low + resolution)
            depth = max(depth, disc.radius - math.dist((x, y), (disc.x, disc.y)))
        assert free == (depth <= 1e-9)


def test_a_disc_that_only_touches_a_cell_does_not_block_it():
    world = World("one", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.5),))
    assert cell_map(world, 1.0).free.sum() == 8
    assert cell_map(World("one", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.50001),)), 1.0).free.sum() == 4


def test_a_conversion_says_how_far_it_is():
    free = np.ones((20, 20), dtype=np.bool_)
    free[8:12, 3:15] = False
    shares = []
    with conversion_progress(shares.append):
        map_task(CellMap(free, 0.1), (0.3, 0.3, 0.0), (1.7, 1.7), name="made")
    map_task(CellMap(free, 0.1), (0.3, 0.3, 0.0), (1.7, 1.7), name="nobody watches")
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) == 3


def test_usual_ends_keep_away_from_the_edge_of_a_map():
    start, goal = largest_ground(CellMap(np.ones((9, 9), dtype=bool), 1.0), 2)
    assert (start[:2], goal) == ((2.5, 2.5), (6.5, 6.5))
