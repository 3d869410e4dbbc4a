"""The catalogue of worlds: validity and passability."""

import dataclasses
import itertools

import numpy as np
import pytest

from antdrive.runs.papers.maps import environments
from antdrive.worlds import Disc, Trajectories, forest, list_worlds, load_task, point_clearance, rasterise
from antdrive.worlds.generators.generate import generate
from tests.worlds.oracles import passable

TURTLEBOT, JACKAL = 0.18, 0.333  # radii [m]
MARGIN = 0.05  # [m]

#: Every world of the catalogue, and whether each robot gets through with the margin.
PASSABLE = {
    "empty": (True, True), "forest": (True, True), "gate": (True, True), "han2007-aco": (True, True),
    "han2007-ga": (True, True), "han2007-single": (True, True), "hasan-1a": (True, True),
    "hasan-1a-moving": (True, True), "hasan-2b": (True, True), "hasan-2b-moving": (True, True),
    "hasan-3c": (True, False), "hasan-3c-moving": (True, False), "hasan-4d": (True, True),
    "hasan-4d-moving": (True, True), "hasan-5e": (True, True), "hasan-5e-moving": (True, True),
    "hasan-5f": (True, False), "hasan-5f-moving": (True, False), "no-path": (False, False),
    "office": (True, True), "people-aisle": (True, True), "people-corridor": (True, True),
    "people-crossing": (True, True), "people-doorway": (True, True), "plaza-moving": (True, True),
    "slalom": (True, True), "u-trap": (True, True),
}  # fmt: skip
#: Grid points of the thesis' listings, 0.5 m each.
ACO = [(4, 6), (14, 12), (13, 11), (8, 10), (10, 10), (14, 10), (14, 4)]
ACO += [(8, 14), (13, 14), (4, 10), (16, 14), (10, 16), (17, 10), (19, 18)]
#: hasan's six cases: start and goal of Table 1 as (column, row); 26.80 is read as 26.8.
HASAN = {
    "1a": ((21, 13), (27, 17)), "2b": ((26, 8), (25, 24)), "3c": ((3, 49), (3, 0)),
    "4d": ((24, 24), (38, 45)), "5e": ((1, 4), (2, 48)), "5f": ((16, 23), (15, 25)),
}  # fmt: skip
GA = [(3, 3), (10, 10), (14, 10), (14, 4), (8, 14), (6, 18)]


@pytest.fixture(params=PASSABLE)
def task(request):
    return load_task(request.param)


def test_the_table_lists_the_whole_catalogue():
    assert list(list_worlds()) == list(PASSABLE)


@pytest.mark.parametrize(("radius", "who"), [(TURTLEBOT, 0), (JACKAL, 1)])
def test_robots_get_through_where_the_table_says(task, radius, who):
    grid = rasterise(task.world, task.cell, radius + MARGIN)
    assert passable(task, grid) == PASSABLE[task.world.name][who]


def test_both_ends_have_room_for_every_robot(task):
    # The ends of hasan's worlds lie in cells next to walls.
    room = TURTLEBOT + MARGIN if task.world.name.startswith("hasan") else JACKAL + 0.2
    assert (point_clearance(task.world, [task.start[:2], task.goal]) > room).all()


def test_a_catalogue_world_has_the_name_of_its_file_and_a_source(task):
    assert task.world.name in PASSABLE
    assert task.world.source
    assert task.goal_tolerance == 0.25


def test_a_world_has_the_size_of_a_room_or_a_floor_and_a_grid_that_ants_can_walk(task):
    """Colonies with default options find paths over 160 cells and plan them in seconds."""
    most = {"hasan": 25, "offic": 40}.get(task.world.name[:5], 15)
    assert all(6 <= side <= most for side in task.world.size)
    rows, cols = rasterise(task.world, task.cell).shape
    assert 20 <= rows <= (60 if most < 40 else 100)
    assert 20 <= cols <= (60 if most < 40 else 160)


def test_the_office_is_the_generators():
    task = load_task("office")
    made = generate("office", np.random.default_rng(0), {})
    assert task.world.obstacles == made.world.obstacles
    assert (task.world.bounds, task.start, task.goal) == (made.world.bounds, made.start, made.goal)


@pytest.mark.parametrize(
    ("name", "points", "radius", "first", "last"),
    [("han2007-aco", ACO, 1, 1, 20), ("han2007-ga", GA, 1, 0, 20), ("han2007-single", [(10, 10)], 5, 0, 20)],
)
def test_the_thesis_worlds_stand_on_its_grid_points(name, points, radius, first, last):
    task = load_task(name)
    assert task.world.obstacles == tuple(Disc(x / 2, y / 2, radius / 2) for x, y in points)
    assert task.start[:2] == (first / 2, first / 2)
    assert task.goal == (last / 2, last / 2)
    grid = rasterise(task.world, task.cell)
    for point in (first, 7, last):
        cell = grid.cell_at(point / 2, point / 2)
        assert grid.xy([cell])[0].tolist() == pytest.approx([point / 2, point / 2])
    # One more cell outside the map on every side.
    assert grid.shape == (last - first + 3,) * 2


@pytest.mark.parametrize("case", HASAN)
def test_hasans_worlds_are_recreated_in_fifty_by_fifty_cells(case):
    task, moving = load_task(f"hasan-{case}"), load_task(f"hasan-{case}-moving")
    for world in (task.world, moving.world):
        assert (world.source or "").startswith("recreated, not copied, after A. H. Hasan")
    grid = rasterise(task.world, task.cell, TURTLEBOT + MARGIN)
    assert grid.shape == (50, 50)
    start, goal = ((row, col) for col, row in HASAN[case])
    np.testing.assert_allclose(grid.xy([start, goal]), [task.start[:2], task.goal])
    # A cylinder blocks its own cell and no other, so the free cells are those that the paper's robot can enter.
    blocked = {grid.cell_at(disc.x, disc.y) for disc in task.world.obstacles}
    assert {tuple(cell) for cell in np.argwhere(~grid.free).tolist()} == blocked
    assert set(np.unique([disc.radius for disc in task.world.obstacles])) == {task.cell / 2}
    assert (moving.world.obstacles, moving.start, moving.goal) == (task.world.obstacles, task.start, task.goal)
    assert (len(task.world.movers), len(moving.world.movers)) == (0, 1)


@pytest.mark.parametrize("case", HASAN)
def test_hasans_mover_walks_over_free_cells_from_a_random_one(case):
    task = load_task(f"hasan-{case}-moving")
    free = rasterise(task.world, task.cell, 0.2)
    homes = set()
    for seed in range(5):
        stops = Trajectories.of(task.world, task.start[:2], seed).positions(np.arange(100) * 0.8)[:, 0]
        cells = [free.cell_at(*stop) for stop in stops]
        np.testing.assert_allclose(free.xy(cells), stops, atol=1e-9)
        assert all(free.free[cell] for cell in cells)
        assert all(max(abs(r - q), abs(c - d)) <= 1 for (r, c), (q, d) in itertools.pairwise(cells))
        homes.add(cells[0])
    assert len(homes) == 5


def test_hasans_worlds_are_the_environments_of_the_papers_experiments():
    drawn = {name.split()[0]: query for name, query in environments().items()}
    assert list(drawn) == list(HASAN)
    for case, query in drawn.items():
        task = load_task(f"hasan-{case}")
        grid = rasterise(task.world, task.cell, TURTLEBOT + MARGIN)
        assert (grid.free == query.grid.free).all()
        assert (grid.moves == query.grid.moves).all()
        assert [grid.cell_at(*end) for end in (task.start[:2], task.goal)] == [query.start, query.goal]


def test_the_gate_is_just_wide_enough():
    task = load_task("gate")
    assert passable(task, rasterise(task.world, task.cell, 0.39))
    assert not passable(task, rasterise(task.world, task.cell, 0.41))
    assert not passable(task, rasterise(task.world, 0.02, 0.401))


def test_in_no_path_not_even_a_point_leaves_the_ring():
    task = load_task("no-path")
    assert not passable(task, rasterise(task.world, 0.02))


def test_the_straight_line_of_the_trap_ends_in_the_u():
    task = load_task("u-trap")
    way = np.linspace(task.start[:2], task.goal, 200)
    hits = np.flatnonzero(point_clearance(task.world, way) < 0)
    assert len(hits)
    assert way[hits[0], 0] > 7.5


def test_the_forest_comes_from_the_generator():
    made = forest(
        np.random.default_rng(3),
        size=12.0,
        count=64,
        radius=(0.15, 0.45),
        clearance=0.8,
        spacing=0.25,
        robot_radius=0.383,
    )
    kept = load_task("forest")
    assert "default_rng(3), size=12.0, count=64" in (kept.world.source or "")
    assert made.world.obstacles == kept.world.obstacles
    assert dataclasses.replace(made, world=kept.world, start=kept.start) == kept
