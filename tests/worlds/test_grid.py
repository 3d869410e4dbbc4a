"""Grids against the definitions of free cells and allowed moves, with their kernels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.worlds import DIRECTIONS, Disc, Grid, World, rasterise
from antdrive.worlds._kernels import DCOL, DROW, doubled, doubled_rows
from tests.worlds.oracles import clearance_of_point, moves_by_force, worlds


def test_kernels_and_grids_number_the_moves_alike():
    assert tuple(zip(DROW.tolist(), DCOL.tolist(), strict=True)) == DIRECTIONS


def test_a_doubled_array_keeps_what_it_held():
    for length in (1, 2, 5):
        vector, table = np.arange(length) + 7, np.arange(3 * length).reshape(length, 3) + 7.0
        assert doubled(vector).shape == (2 * length,)
        assert doubled(vector).dtype == vector.dtype
        np.testing.assert_array_equal(doubled(vector)[:length], vector)
        assert doubled_rows(table).shape == (2 * length, 3)
        np.testing.assert_array_equal(doubled_rows(table)[:length], table)


def test_fractional_cells_are_the_inverse_of_places():
    free, moves = np.ones((3, 4), np.bool_), np.zeros((3, 4), np.uint8)
    cells = np.array([(0.0, 0.0), (1.5, 3.0), (2.0, 0.25)])
    grid = Grid(free, moves, cell=0.5, origin=(2.0, -1.0))
    np.testing.assert_allclose(grid.xy(cells), [(2.0, -1.0), (3.5, -0.25), (2.125, 0.0)])
    np.testing.assert_allclose(grid.fractional(grid.xy(cells)), cells)
    np.testing.assert_array_equal(Grid(free, moves).xy([(1, 2)]), [(2.0, 1.0)])


def bits(grid):
    """The moves as truth values, (R, C, 8)."""
    return (grid.moves[..., None] >> np.arange(8) & 1).astype(bool)


def crowd(seed, count=30):
    rng = np.random.default_rng(seed)
    discs = tuple(Disc(*rng.uniform(0, 10, 2).tolist(), float(rng.uniform(0.1, 1.0))) for _ in range(count))
    return World("crowd", (0.0, 0.0, 10.0, 10.0), discs)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("cell", "inflate"), [(0.31, 0.17), (0.5, 0.0), (0.77, 0.4)])
def test_moves_are_as_defined_in_a_crowd(seed, cell, inflate):
    world = crowd(seed)
    grid = rasterise(world, cell, inflate)
    expected = moves_by_force(grid, world)
    sure = ~np.isnan(expected)
    assert (bits(grid)[sure] == expected[sure].astype(bool)).all()


@pytest.mark.parametrize(("cell", "radius", "on_lattice"), [(0.05, 0.4, False), (0.25, 0.75, True), (0.25, 0.5, True)])
def test_moves_are_as_defined_where_discs_are_much_larger_than_cells(cell, radius, on_lattice):
    """150 columns; on the lattice of centres many lie exactly on a rim, and all numbers here have no rounding errors."""
    rng, step = np.random.default_rng(5), cell / 2
    wide, high = 150 * cell, 24 * cell
    centres = np.column_stack((rng.uniform(0, wide, 40), rng.uniform(-high, 2 * high, 40)))
    centres = np.round(centres / step) * step if on_lattice else centres
    world = World("wide", (0.0, -8.0, wide, high), tuple(Disc(x, y, radius - 0.25 * cell) for x, y in centres.tolist()))
    grid = rasterise(world, cell, 0.25 * cell)
    rows, cols = grid.shape
    at = grid.xy(np.argwhere(np.ones(grid.shape))).reshape(rows, cols, 2)
    inside = np.all((at - world.bounds[:2] > grid.inflate) & (world.bounds[2:] - at > grid.inflate), axis=-1)
    off = at[..., None, :] - centres
    free = inside & np.all((off**2).sum(axis=-1) > radius**2, axis=-1)
    assert (grid.free == free).all()
    for bit, (dr, dc) in enumerate(DIRECTIONS[:4]):
        step_to = np.array([dc, dr]) * cell
        along = np.clip(-(off @ step_to) / (step_to @ step_to), 0.0, 1.0)
        away = ((off + along[..., None] * step_to) ** 2).sum(axis=-1).min(axis=-1)
        there = np.zeros_like(free)
        there[: rows - dr, max(0, -dc) : cols - max(0, dc)] = free[dr:, max(0, dc) : cols + min(0, dc)]
        moves = free & there & (away > radius**2)
        if dr and dc:  # both neighbours are free
            moves[:-1] &= free[1:]
            moves[:, max(0, -dc) : cols - max(0, dc)] &= free[:, max(0, dc) : cols + min(0, dc)]
        sure = np.abs(away - radius**2) > (0 if on_lattice and not (dr and dc) else 1e-9)
        assert (bits(grid)[..., bit] == moves)[sure].all()


@settings(max_examples=25)
@given(worlds(), st.floats(0.4, 1.5), st.floats(0.0, 0.6))
def test_a_cell_is_free_when_the_robot_fits_at_its_centre(world, cell, inflate):
    grid = rasterise(world, cell, inflate)
    for r, c in np.argwhere(np.ones(grid.shape)):
        clearance = clearance_of_point(world, *grid.xy([(r, c)])[0])
        assert abs(clearance - inflate) < 1e-9 or grid.free[r, c] == (clearance > inflate)


def test_the_order_of_obstacles_changes_nothing():
    """As many in a heap as a lidar's hits on a wall."""
    rng = np.random.default_rng(4)
    x = np.sort(rng.uniform(0.5, 5.5, 200))
    discs = [Disc(*values) for values in zip(x, 2 + 0.3 * np.sin(x), rng.uniform(0.005, 0.02, 200), strict=True)]
    one, other = (
        rasterise(World("wall", (0.0, 0.0, 6.0, 4.0), tuple(some)), 0.05, 0.3)
        for some in (discs, [discs[k] for k in rng.permutation(200)])
    )
    assert np.array_equal(one.free, other.free)
    assert np.array_equal(one.moves, other.moves)


@given(st.integers(0, 19), st.integers(0, 29))
def test_a_cell_holds_its_own_centre(row, col):
    grid = rasterise(World("w", (-3.0, 2.0, 12.0, 12.0)), 0.5)
    assert grid.shape == (20, 30)
    x, y = grid.xy([(row, col)])[0]
    assert grid.cell_at(x, y) == (row, col)
    assert (x, y) == pytest.approx((-3.0 + 0.5 * (col + 0.5), 2.0 + 0.5 * (row + 0.5)))


def test_a_point_outside_belongs_to_the_nearest_cell():
    grid = rasterise(World("w", (0.0, 0.0, 3.0, 2.0)), 0.5)
    assert grid.cell_at(-9, 9) == (3, 0)
    assert grid.cell_at(9, -9) == (0, 5)


@pytest.mark.parametrize(
    ("side", "cell", "cells"), [(1.1, 0.1, 11), (0.3, 0.1, 3), (2.1, 0.7, 3), (1.15, 0.1, 12), (1.101, 0.1, 12)]
)
def test_a_side_that_the_cells_fill_exactly_has_no_cell_more(side, cell, cells):
    """1.1 / 0.1 is 11.000000000000002."""
    assert rasterise(World("w", (0.0, 0.0, side, 2 * side)), cell).shape[1] == cells


def test_cells_that_the_walls_cut_are_kept():
    assert rasterise(World("w", (0.0, 0.0, 3.1, 1.9)), 0.5).shape == (4, 7)
    assert rasterise(World("w", (0.0, 0.0, 0.3, 0.3)), 0.1).shape == (3, 3)


def test_a_grid_from_its_free_cells_alone_cuts_no_corners():
    grid = Grid.from_free([[True, True, False], [True, False, True], [True, True, True]])
    here = bits(grid)
    assert not here[0, 1].tolist()[DIRECTIONS.index((1, 1))]
    assert not here[1, 0].tolist()[DIRECTIONS.index((-1, 1))]
    assert here[2, 1].tolist() == [k in (0, 4) for k in range(8)]


def test_a_grid_cannot_be_written_to():
    grid = rasterise(crowd(0), 0.5)
    for array in (grid.free, grid.moves):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1


@pytest.mark.parametrize(
    ("cell", "inflate", "key"),
    [(0.0, 0.0, "cell"), (-1.0, 0.0, "cell"), (0.5, -0.1, "inflate"), (1e-4, 0.0, "cell"), (float("nan"), 0, "cell")],
)
def test_unusable_sizes_are_named(cell, inflate, key):
    with pytest.raises(ValueError, match=f"^{key}: "):
        rasterise(crowd(0), cell, inflate)
