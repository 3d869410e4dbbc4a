import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base.plane import polyline_length
from antdrive.planners import AStar, Query, path_cost
from antdrive.planners.anyangle.lines import cells_along, cells_under, clear_line, route_ends
from antdrive.worlds import DIRECTIONS, Disc, Grid, Task, World, rasterise, segment_clearance
from tests.planners.worlds_to_solve import catalogue, optimum, random_query, sealed

RNG = np.random.default_rng(0)
coordinate = st.floats(-20.0, 20.0)


def is_a_path(query, cells):
    ends_match = tuple(cells[0]) == query.start and tuple(cells[-1]) == query.goal
    moves = (
        int(query.grid.moves[tuple(here)]) >> DIRECTIONS.index(tuple(step)) & 1
        for here, step in zip(cells[:-1], np.diff(cells, axis=0), strict=True)
    )
    return ends_match and all(moves)


def picture(*rows):
    """Build a bare grid from a drawing: '#' is blocked, the first row is at the bottom."""
    free = np.array([[c != "#" for c in row] for row in rows])
    return Query(Grid.from_free(free), (0, 0), (len(rows) - 1, len(rows[0]) - 1))


# -- straight lines


def test_contact_with_a_disc_or_a_wall_is_too_close():
    task = Task(World("w", (0, 0, 10, 10), (Disc(5, 5, 1),)), (1, 1, 0), (9, 9))
    query = Query.between(rasterise(task.world, 0.5, 0.5), task)
    assert not clear_line(query, (1, 6.5), (9, 6.5))
    assert clear_line(query, (1, 6.5001), (9, 6.5001))
    assert not clear_line(query, (0.5, 1), (0.5, 9))
    assert clear_line(query, (0.5001, 1), (0.5001, 9))


def test_a_line_is_clear_if_its_clearance_exceeds_the_inflation():
    rng = np.random.default_rng(3)
    query = catalogue()["forest"]
    lines = rng.uniform(0, 10, (500, 2, 2))
    room = segment_clearance(query.task.world, lines[:, 0], lines[:, 1])
    clear = [clear_line(query, tuple(a), tuple(b)) for a, b in lines]
    assert 10 < sum(clear) < 490
    assert clear == list(room > query.grid.inflate)


def test_on_a_bare_grid_a_clear_line_touches_no_blocked_cell_not_even_at_a_corner():
    query = picture(".....", "..#..", ".....")
    assert clear_line(query, (0, 0), (4, 0))
    assert clear_line(query, (0, 0), (1.4, 2))
    assert not clear_line(query, (0, 0), (3, 2))
    assert not clear_line(query, (1, 0), (2, 0.6))
    assert not clear_line(query, (1, 0.0), (2, 0.5))  # along the border
    assert not clear_line(query, (1, 1), (2, 0))  # through the corner
    assert not clear_line(query, (0, 0), (5, 0))  # out of the grid


def test_on_a_bare_grid_every_allowed_move_is_a_clear_line():
    rng = np.random.default_rng(4)
    for _ in range(20):
        query = random_query(rng, largest=10)
        grid = query.grid
        for row, col in np.argwhere(grid.free):
            for k, (dr, dc) in enumerate(DIRECTIONS):
                if 0 <= row + dr < grid.shape[0] and 0 <= col + dc < grid.shape[1]:
                    a, b = grid.xy([(row, col), (row + dr, col + dc)])
                    assert clear_line(query, tuple(a), tuple(b)) == bool(int(grid.moves[row, col]) >> k & 1)


# -- ends


def task_query(start, goal, tolerance=0.25):
    world = World("w", (0, 0, 10, 10), (Disc(2, 2, 0.5), Disc(8, 8, 0.5)))
    task = Task(world, (*start, 0.0), goal, goal_tolerance=tolerance)
    return Query.between(rasterise(world, 0.5, 0.4), task)


def test_ends_are_those_of_the_task_or_the_centres_of_cells():
    assert route_ends(task_query((1.1, 5.0), (9.0, 5.1)))[:2] == ((1.1, 5.0), (9.0, 5.1))
    bare = picture("...", "...")
    assert route_ends(bare) == ((0.0, 0.0), (2.0, 1.0), (), ())


def test_ends_without_room_are_replaced_by_the_centres_of_their_cells():
    query = task_query((2.6, 2.0), (7.4, 7.8), tolerance=0.8)
    ends = route_ends(query)
    np.testing.assert_allclose([ends.start, ends.goal], query.grid.xy([query.start, query.goal]))
    assert ends.lead_in == ((2.6, 2.0),)
    assert ends.lead_out == ()
    assert len(ends.with_leads([ends.start, ends.goal])) == 3


def test_a_goal_with_just_the_clearance_is_reached():
    goal = (7.1 + 2e-10, 8.0)
    query = task_query((1.0, 5.0), goal)
    ends = route_ends(query)
    assert ends.lead_out == (goal,)
    assert route_ends(query, touching=True).goal == goal


# -- cells beside a line


@pytest.mark.parametrize("world", catalogue())
def test_cells_along_a_path_are_allowed_moves_close_to_it(world):
    query = catalogue()[world]
    cells = AStar().plan(query, RNG).cells
    along = cells_along(query, cells)
    assert is_a_path(query, along)
    assert path_cost(along, query.grid.cell) == pytest.approx(optimum(query))


def test_cells_pass_obstacles_on_the_same_side_as_the_line():
    query = picture(*["." * 21] * 8, "." * 3 + "#" * 15 + "." * 3, *["." * 21] * 8)
    for row in (2.0, 14.0):
        along = cells_along(query, [(0, 0), (row, 1), (row, 19), (16, 20)])
        assert is_a_path(query, along)
        assert {int(r) for r, c in along if c == 10} <= set(range(int(row) - 1, int(row) + 2))


@given(st.lists(st.tuples(st.integers(0, 11), st.integers(0, 15)), min_size=1, max_size=6))
def test_cells_are_as_long_as_a_line_with_loops(via):
    query = Query(Grid.from_free(np.ones((12, 16)), cell=0.5), (1, 1), (10, 14))
    line = [query.start, *via, query.goal]
    along = cells_along(query, line)
    assert is_a_path(query, along)
    assert polyline_length(along) >= polyline_length(line) - 3.0


def test_a_line_with_loops_passes_blocked_and_isolated_cells_by():
    query = picture("." * 12, "." * 12, ".....###....", ".....#.#....", ".....###....", "." * 12, "." * 12)
    loops = [(0, 0), (6, 11), (3, 6), (0, 11), (6, 0), (3, 5), (0, 11), (6, 11)]
    along = cells_along(query, loops)
    assert is_a_path(query, along)
    assert {(6, 11), (0, 11), (6, 0)} <= {tuple(cell) for cell in along.tolist()}


def test_the_corridor_widens_until_it_contains_a_path():
    query = picture("....#....", "....#....", "....#....", ".........")
    assert is_a_path(query, cells_along(query, [(0, 0), (0, 8), (3, 8)]))
    assert len(cells_along(sealed(), [(1, 1), (6, 6)])) == 0


def test_cells_under_a_line_are_consecutive_neighbours_and_need_not_be_free():
    query = sealed()
    under = cells_under(query, [(1.2, 0.8), (6.0, 3.0), (6.0, 6.0)])
    assert tuple(under[0]) == query.start
    assert tuple(under[-1]) == query.goal
    assert np.abs(np.diff(under, axis=0)).max() == 1
