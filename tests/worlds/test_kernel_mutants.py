"""The small kernels and conversions that everything else is made of."""

import numpy as np

from antdrive.worlds import Grid
from antdrive.worlds._kernels import DCOL, DROW, doubled, doubled_rows
from antdrive.worlds.grid import DIRECTIONS


def test_kernels_and_grids_number_the_moves_alike() -> None:
    assert tuple(zip(DROW.tolist(), DCOL.tolist(), strict=True)) == DIRECTIONS


def test_a_doubled_array_keeps_what_it_held() -> None:
    for length in (1, 2, 5):
        vector, table = np.arange(length) + 7, np.arange(3 * length).reshape(length, 3) + 7.0
        assert doubled(vector).shape == (2 * length,)
        assert doubled(vector).dtype == vector.dtype
        np.testing.assert_array_equal(doubled(vector)[:length], vector)
        assert doubled_rows(table).shape == (2 * length, 3)
        np.testing.assert_array_equal(doubled_rows(table)[:length], table)


def test_fractional_cells_are_the_inverse_of_places() -> None:
    free, moves = np.ones((3, 4), np.bool_), np.zeros((3, 4), np.uint8)
    cells = np.array([(0.0, 0.0), (1.5, 3.0), (2.0, 0.25)])
    grid = Grid(free, moves, cell=0.5, origin=(2.0, -1.0))
    np.testing.assert_allclose(grid.xy(cells), [(2.0, -1.0), (3.5, -0.25), (2.125, 0.0)])
    np.testing.assert_allclose(grid.fractional(grid.xy(cells)), cells)
    np.testing.assert_array_equal(Grid(free, moves).xy([(1, 2)]), [(2.0, 1.0)])
