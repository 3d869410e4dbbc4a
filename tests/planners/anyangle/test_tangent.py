"""The exact shortest path among discs against closed forms and a polygon oracle."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from antdrive.planners import AStar, PlanStatus, Query, Tangent, smooth
from antdrive.planners.anyangle import _kernels_tangent
from antdrive.planners.anyangle.tangent import Arc, Line, TangentPath, shortest
from antdrive.worlds import Disc, Task, World, forest, polyline_clearance, rasterise
from tests.planners.worlds_to_solve import catalogue

RNG = np.random.default_rng(0)  # unused by the planner
BOX = (-2.0, -2.0, 22.0, 22.0)
WIDE = (-100.0, -100.0, 100.0, 100.0)


# -- oracle: shortest paths among polygons instead of discs


def polygon_bound(discs, box, ends, *, inside, sides=24):
    """Return the shortest path among polygons: inscribed (a lower bound) or circumscribed (an upper bound)."""
    angles = np.arange(sides) * math.tau / sides
    stretch = 1.0 if inside else 1.0 / math.cos(math.pi / sides)
    normals = np.stack((np.cos(angles + math.pi / sides), np.sin(angles + math.pi / sides)), axis=1)
    corners = [np.array(ends)]
    corners += [np.stack((x + stretch * r * np.cos(angles), y + stretch * r * np.sin(angles)), 1) for x, y, r in discs]
    points = np.vstack(corners)
    fits = (points[:, 0] >= box[0]) & (points[:, 0] <= box[2]) & (points[:, 1] >= box[1]) & (points[:, 1] <= box[3])
    points = points[fits]
    rows, cols = np.triu_indices(len(points), 1)
    a, b = points[rows], points[cols]
    clear = np.ones(len(a), dtype=np.bool_)
    for x, y, r in discs:  # the part of each segment within all half planes of the polygon (Cyrus & Beck)
        apothem = stretch * r * math.cos(math.pi / sides)
        low, high = np.zeros(len(a)), np.ones(len(a))
        hit = np.ones(len(a), dtype=np.bool_)
        for normal in normals:
            depth_a, depth_b = ((p - (x, y)) @ normal - apothem + 1e-9 for p in (a, b))
            with np.errstate(divide="ignore", invalid="ignore"):
                t = depth_a / (depth_a - depth_b)
            low = np.where(depth_a > depth_b, np.maximum(low, t), low)
            high = np.where(depth_a < depth_b, np.minimum(high, t), high)
            hit &= ~((depth_a == depth_b) & (depth_a >= 0))
        clear &= ~(hit & (low < high))
    lengths = np.hypot(*(a - b).T)
    edges = (lengths[clear], (rows[clear], cols[clear]))
    graph = csr_matrix(edges, shape=(len(points), len(points)))
    return float(dijkstra(graph, directed=False, indices=0)[1])


def random_discs(rng, count):
    discs = [tuple(map(float, (*rng.uniform(0, 10, 2), rng.uniform(0.3, 2.4)))) for _ in range(count)]
    return [d for d in discs if min(math.dist(d[:2], end) for end in ((0.5, 0.5), (9.5, 9.5))) > d[2] + 0.05]


def test_the_length_lies_between_those_among_inner_and_outer_polygons():
    rng = np.random.default_rng(7)
    solved = sealed = 0
    for count in (1, 2, 3, 4, 5, 6, 8, 10, 12, 14) * 2:
        discs, ends, box = random_discs(rng, count), ((0.5, 0.5), (9.5, 9.5)), (0.0, 0.0, 10.0, 10.0)
        path = shortest(discs, box, 0.0, *ends)
        low, high = (polygon_bound(discs, box, ends, inside=inside) for inside in (True, False))
        if path is None:
            sealed += 1
            assert math.isinf(high)
        else:
            solved += 1
            assert low - 1e-6 <= path.length <= high + 1e-6
    assert solved >= 10
    assert sealed >= 1


# -- hand calculations


def test_the_path_around_one_disc_has_the_closed_form():
    """The radius-5 world of Han's thesis (2007): 30.071, where his genetic algorithm reached 33.1798."""
    path = shortest([(10, 10, 5)], BOX, 0.0, (0, 0), (20, 20))
    to_centre = math.hypot(10, 10)
    by_hand = 2 * math.sqrt(to_centre**2 - 25) + 5 * (math.pi - 2 * math.acos(5 / to_centre))
    assert path.length == pytest.approx(by_hand, abs=1e-12)
    assert path.length == pytest.approx(30.071, abs=5e-4)
    assert [type(piece) for piece in path.pieces] == [Line, Arc, Line]


def test_contact_closes_a_gap_between_discs_and_at_walls():
    box = (0.0, 0.0, 10.0, 10.0)
    column = [(5.0, 1.0 + 2 * k, 1.0) for k in range(5)]  # wall to wall, each touching the next
    assert shortest(column, box, 0.0, (1, 5), (9, 5)) is None
    lower = [(x, y - 1e-6 * (k == 0), r) for k, (x, y, r) in enumerate(column)]
    through = shortest(lower, box, 0.0, (1, 5), (9, 5))
    assert through is not None
    assert shortest([(x, y, r - 0.1) for x, y, r in column], box, 0.1, (1, 5), (9, 5)) is None
    assert shortest([(5, 4, 4)], box, 0.0, (1, 9), (9, 9)) is not None
    assert shortest([(5, 4, 4), (5, 9, 1)], box, 0.0, (1, 9), (9, 9)) is None


def test_a_straight_line_that_only_grazes_discs_is_the_path():
    path = shortest([(3, 1, 1), (5, -1, 1), (7, 1, 1)], WIDE, 0.0, (0, 0), (10, 0))
    assert path.length == pytest.approx(10, abs=1e-9)


def uncovered(discs, box, i):
    """Return the free arcs of disc i from all its neighbours at once: their begins and widths."""
    x, y, r = discs[i]
    spans = [
        (math.atan2(w - y, v - x), math.acos((r * r + d * d - s * s) / (2 * r * d)))
        for k, (v, w, s) in enumerate(discs)
        if k != i and (d := math.hypot(v - x, w - y)) <= r + s
    ]
    walls = (box[2] - x, box[3] - y, x - box[0], y - box[1])
    spans += [(k * math.pi / 2, math.acos(d / r)) for k, d in enumerate(walls) if d <= r]
    covered = sorted(((middle - half) % math.tau, 2 * half) for middle, half in spans)
    arcs, reach = [], max(low + wide for low, wide in covered)  # one turn, then count the gaps of the next
    for low, wide in ((low + math.tau, wide) for low, wide in covered):
        if low > reach + 2e-9:
            arcs.append((reach % math.tau, low - reach))
        reach = max(reach, low + wide)
    return arcs


def test_the_free_arcs_of_discs_in_a_heap_are_those_that_no_neighbour_covers():
    rng, box = np.random.default_rng(3), np.array([0.0, 0.0, 10.0, 10.0])
    free = 0
    for radii in ((1.0, 1.0), (0.5, 1.4)):
        discs = np.column_stack(
            (rng.uniform(2, 9.5, (160, 1)), rng.uniform(3, 7, (160, 1)), rng.uniform(*radii, (160, 1)))
        )
        ring = np.arange(150) * math.tau / 150
        discs = np.vstack((discs, np.column_stack((2 + np.cos(ring), 8 + np.sin(ring), np.full(150, 1.5)))))
        discs = discs[_kernels_tangent.keep_outer(discs, box)]
        rims = _kernels_tangent.free_arcs(discs, box)
        for i in range(len(discs)):
            arcs = slice(rims.first[i], rims.first[i + 1])
            found = np.sort(np.column_stack((rims.begin[arcs], rims.width[arcs])), axis=0)
            assert found == pytest.approx(np.sort(np.array(uncovered(discs, box, i)).reshape(-1, 2), axis=0), abs=1e-6)
            free += len(found)
    assert free > 100


def test_a_heap_of_thousands_of_discs_costs_little_more_than_its_rim():
    """A bin within a disc lists one disc, and rims without free arcs do not matter."""
    rng, box = np.random.default_rng(5), (0.0, 0.0, 20.0, 20.0)
    discs = np.column_stack((rng.uniform(8, 12, (3000, 2)), np.full(3000, 3.0)))
    path = shortest(discs, box, 0.3, (0.5, 0.5), (19, 19))
    assert path.work < 100
    assert len(_kernels_tangent.bins(discs, np.array(box)).items) < 5 * len(discs)
    rims = _kernels_tangent.free_arcs(discs, np.array(box))
    outer = discs[np.diff(rims.first) > 0]
    assert len(outer) < 100
    assert path.pieces == shortest(outer, box, 0.3, (0.5, 0.5), (19, 19)).pieces


def test_an_end_without_the_clearance_has_no_path():
    assert shortest([(5, 5, 1)], WIDE, 0.5, (3.6, 5), (0, 0)) is None
    assert shortest([(5, 5, 1)], WIDE, 0.5, (3.5, 5), (0, 0)) is not None
    assert shortest([], (0, 0, 10, 10), 0.5, (0.4, 5), (5, 5)) is None
    assert shortest([], (0, 0, 1, 10), 0.6, (0.5, 5), (0.5, 6)) is None


def test_the_path_from_a_point_to_itself_has_length_zero():
    path = shortest([(5, 5, 1)], WIDE, 0.1, (1, 1), (1, 1))
    assert path.length == 0.0
    assert len(path.polyline(1e-3, [(5, 5, 1)], WIDE, 0.1)) == 2


def test_duplicate_and_nested_discs_do_not_change_the_path():
    discs = [(3.0, 3.0, 1.5), (6.0, 7.0, 2.0)]
    more = [
        *discs,
        discs[0],
        (3.2, 3.1, 0.4),
        (6.0, 8.0, 1.0),
    ]  # a copy, one inside another, one touching another from inside
    lengths = {round(shortest(order, BOX, 0.1, (0, 0), (9, 9)).length, 9) for order in (discs, more, more[::-1])}
    assert len(lengths) == 1


# -- properties

coordinate = st.floats(0.0, 10.0).map(lambda v: round(v, 2))
START, GOAL, WALLS = (0.5, 1.0), (9.5, 8.0), (0.0, 0.0, 10.0, 10.0)
some_discs = st.lists(st.tuples(coordinate, coordinate, st.sampled_from([0.2, 0.5, 1.0, 1.7])), max_size=12).map(
    lambda discs: [d for d in discs if all(math.dist(d[:2], end) > d[2] + 0.11 for end in (START, GOAL))]
)


def length(discs, start=START, goal=GOAL):
    path = shortest(discs, WALLS, 0.1, start, goal)
    return math.inf if path is None else path.length


@settings(max_examples=60)
@given(some_discs)
def test_the_length_does_not_change_when_ends_are_swapped_or_the_world_is_turned(discs):
    expected = pytest.approx(length(discs), abs=1e-7)
    assert length(discs, GOAL, START) == expected
    for turn in (
        lambda x, y: (10 - x, y),
        lambda x, y: (y, x),
        lambda x, y: (10 - y, x),
        lambda x, y: (10 - x, 10 - y),
    ):
        assert length([(*turn(x, y), r) for x, y, r in discs], turn(*START), turn(*GOAL)) == expected


@settings(max_examples=40)
@given(some_discs, st.sampled_from([1e-1, 1e-3, 1e-5]))
def test_the_polyline_keeps_the_clearance_and_stays_close(discs, bulge):
    path = shortest(discs, WALLS, 0.1, START, GOAL)
    assume(path is not None)
    assert isinstance(path, TangentPath)
    line = path.polyline(bulge, np.array(discs).reshape(-1, 3), WALLS, 0.1)
    world = World("w", WALLS, tuple(Disc(*d) for d in discs))
    assert polyline_clearance(world, line) >= 0.1 - 1e-9
    longer = np.hypot(*np.diff(line, axis=0).T).sum() - path.length
    assert -1e-7 <= longer <= 20 * bulge
    for before, after in itertools.pairwise(path.pieces):
        assert math.dist(before.end, after.start) < 1e-7
    for arc in (piece for piece in path.pieces if isinstance(piece, Arc)):
        rim = np.array([arc.at(abs(arc.sweep) * k / 50) for k in range(51)])
        assert polyline_clearance(world, rim[25:26]) >= 0.1 - 1e-9
        assert min(polyline_clearance(world, point[None]) for point in rim) >= 0.1 - 1e-9


@settings(max_examples=30)
@given(some_discs, st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=3))
def test_no_clear_polyline_is_shorter(discs, via):
    line = np.array([START, *via, GOAL])
    assume(line[1:-1].min() > 0.1)
    assume(line[1:-1].max() < 9.9)
    apart = [d for d in discs if polyline_clearance(World("w", (-9, -9, 19, 19), (Disc(*d),)), line) > 0.1]
    assert length(apart) <= np.hypot(*np.diff(line, axis=0).T).sum() + 1e-9


# -- the planner


@pytest.mark.parametrize("world", catalogue())
def test_the_path_is_no_longer_than_that_on_the_grid_and_keeps_the_clearance(world):
    query = catalogue()[world]
    result = Tangent().plan(query, RNG)
    assert result.solved
    xy = query.grid.xy(result.line)
    np.testing.assert_allclose(xy[[0, -1]], [query.task.start[:2], query.task.goal], atol=1e-12)
    assert polyline_clearance(query.task.world, xy) >= query.grid.inflate - 1e-9
    ends = query.grid.xy([query.start, query.goal])
    slack = math.dist(ends[0], query.task.start[:2]) + math.dist(ends[1], query.task.goal)
    assert result.length <= AStar().plan(query, RNG).cost + slack
    route = smooth(result, query.grid, query.task, kind="none")
    assert route.length == pytest.approx(result.length, abs=0.02)


def test_a_start_without_room_is_left_through_the_centre_of_its_cell():
    task = Task(World("w", (0, 0, 10, 10), (Disc(2, 2, 0.5),)), (2.6, 2.0, 0.0), (8.0, 8.0))
    query = Query.between(rasterise(task.world, 0.5, 0.4), task)
    result = Tangent().plan(query, RNG)
    xy = query.grid.xy(result.line)
    np.testing.assert_allclose(xy[0], (2.6, 2.0))
    np.testing.assert_allclose(xy[1], query.grid.xy([query.start])[0])
    assert polyline_clearance(task.world, xy[1:]) >= 0.4 - 1e-9
    assert result.length == pytest.approx(np.hypot(*np.diff(xy, axis=0).T).sum(), abs=1e-3)


def test_a_goal_without_room_is_reached_at_the_centre_of_its_cell():
    task = Task(World("w", (0, 0, 10, 10), (Disc(8, 8, 0.5),)), (2.0, 2.0, 0.0), (7.4, 7.8), goal_tolerance=0.7)
    query = Query.between(rasterise(task.world, 0.5, 0.3), task)
    result = Tangent().plan(query, RNG)
    xy = query.grid.xy(result.line)
    np.testing.assert_allclose(xy[-1], query.grid.xy([query.goal])[0])
    assert polyline_clearance(task.world, xy) >= 0.3 - 1e-9


def test_an_end_without_room_or_a_cell_to_reach_has_no_path_with_a_reason():
    fence = [Disc(2 + 0.7 * math.cos(a), 2 + 0.7 * math.sin(a), 0.3) for a in np.linspace(0, math.tau, 8)]
    world = World("w", (0, 0, 10, 10), tuple(fence))
    for start, goal, end in (((2.0, 2.0), (8.0, 8.0), "start"), ((8.0, 8.0), (2.0, 2.0), "goal")):
        task = Task(world, (*start, 0.0), goal)
        result = Tangent().plan(Query.between(rasterise(world, 0.5, 0.45), task), RNG)
        assert result.status is PlanStatus.NO_PATH
        assert result.reason.startswith(f"the {end} has too little room")


def test_a_gap_too_narrow_for_the_grid_is_found():
    discs = [Disc(5.0, y, 1.0) for y in (0.5, 2.5, 4.5)] + [Disc(5.0, y, 1.0) for y in (7.2, 9.2)]
    task = Task(World("w", (0, 0, 10, 10), tuple(discs)), (2.0, 2.0, 0.0), (8.0, 2.0))
    query = Query.between(rasterise(task.world, 1.0, 0.3), task)
    assert not AStar().plan(query, RNG).solved
    result = Tangent().plan(query, RNG)
    assert result.solved
    assert math.isinf(result.cost)
    assert np.abs(np.diff(result.cells, axis=0)).max() == 1
    assert tuple(result.cells[0]) == query.start
    assert polyline_clearance(task.world, smooth(result, query.grid, task, kind="none").xy) >= 0.3 - 1e-9


def test_in_a_forest_of_400_discs_a_tenth_of_all_tangents_is_checked():
    task = forest(
        np.random.default_rng(1), size=40, count=400, radius=(0.3, 0.7), clearance=1, spacing=0.1, robot_radius=0.25
    )
    query = Query.between(rasterise(task.world, 0.25, 0.3), task)
    assert 0 < Tangent().plan(query, RNG).work < 4 * math.comb(400, 2) / 10


def test_a_lattice_of_discs_that_all_touch_is_solved():
    """Three or four rims meet in one point, as in BARN worlds."""
    rng = np.random.default_rng(5).random((30, 30)) < 0.25
    rng[:4, :4] = rng[-4:, -4:] = False
    discs = [(0.15 * c, 0.15 * r, 0.075) for r, c in np.argwhere(rng)]
    box, ends = (-0.5, -0.5, 5.0, 5.0), ((0.0, 0.0), (4.4, 4.4))
    for inflate in (0.0, 0.075, 0.1):
        path = shortest(discs, box, inflate, *ends)
        world = World("w", box, tuple(Disc(*d) for d in discs))
        grid = rasterise(world, 0.05, inflate)
        query = Query(grid, *(grid.cell_at(*end) for end in ends))
        optimum = AStar().plan(query, RNG)
        assert (path is not None) or not optimum.solved
        if path is not None:
            assert path.length <= optimum.cost + 0.2
            assert polyline_clearance(world, path.polyline(1e-3, discs, box, inflate)) >= inflate - 1e-9


# -- shortcuts of the search


@settings(max_examples=30)
@given(some_discs, st.sampled_from([0.3, 0.999, 1.0, 1.05, 2.0]))
def test_an_expected_length_changes_no_path(discs, fraction):
    path = shortest(discs, WALLS, 0.1, START, GOAL)
    expected = 1.0 if path is None else fraction * path.length + 1e-9
    again = shortest(discs, WALLS, 0.1, START, GOAL, expected=expected)
    assert (path is None) == (again is None)
    if path and again:
        assert again.length == pytest.approx(path.length, abs=1e-12)
        assert fraction < 1.0 or again.work <= path.work


def test_among_many_discs_a_path_on_the_grid_bounds_the_search(monkeypatch):
    query = catalogue()["forest"]
    free = Tangent().plan(query, RNG)
    monkeypatch.setattr("antdrive.planners.anyangle.tangent.MANY_DISCS", 0)
    bounded = Tangent().plan(query, RNG)
    assert bounded.length == free.length
    np.testing.assert_array_equal(bounded.line, free.line)
    assert bounded.work < free.work


@settings(max_examples=40)
@given(some_discs, st.floats(-12, 12), st.floats(-12, 12), st.floats(0, 1.7), st.sampled_from([-1, 1]), st.data())
def test_every_tangent_to_a_free_arc_is_checked(discs, dx, dy, radius, turn, data):
    assume(discs)
    table = np.array(discs)
    rims = _kernels_tangent.free_arcs(table, np.array(WALLS))
    i = data.draw(st.integers(0, len(discs) - 1))
    other = data.draw(st.sampled_from([-1, 1]))
    across = other * radius - turn * table[i, 2]
    d = math.hypot(dx, dy)
    assume(d > abs(across))
    angle = (math.atan2(dy, dx) - math.asin(across / d) - turn * math.pi / 2) % math.tau
    touched = any(
        (angle - begin) % math.tau < width - 1e-9
        for begin, width in zip(
            rims.begin[rims.first[i] :], rims.width[rims.first[i] : rims.first[i + 1]], strict=False
        )
    )
    passed_over = _kernels_tangent.misses(rims, i, turn, dx, dy, across)
    assert not (touched and passed_over)
