"""A world cut into square cells: which are free, and which moves between them a robot can sweep.

Cells are (row, col) with the row along +y; cell (0, 0) holds the world's lower-left corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.worlds import _kernels
from antdrive.worlds.errors import InputError
from antdrive.worlds.world import Floats, Point, World

#: The eight moves by bit of `Grid.moves`, as (row, column) steps: E, NE, N, NW, W, SW, S, SE.
DIRECTIONS: tuple[tuple[int, int], ...] = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))

MAX_CELLS = 25_000_000  # a guard against a resolution mistyped by orders of magnitude


@dataclass(frozen=True, eq=False)
class Grid:
    """Free cells and allowed moves, for a robot of radius `inflate`."""

    free: npt.NDArray[np.bool_]  # (R, C), read-only
    moves: npt.NDArray[np.uint8]  # (R, C), bit k set when the move DIRECTIONS[k] is allowed, read-only
    cell: float = 1.0  # side of a cell [m]
    origin: Point = (0.0, 0.0)  # centre of cell (0, 0) [m]
    inflate: float = 0.0  # robot radius + margin [m]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, cols = self.free.shape
        return rows, cols

    def xy(self, cells: npt.ArrayLike) -> Floats:
        """World coordinates (N, 2) [m] of cells (N, 2); fractional cells are allowed.

        This is the one place where (row, col) becomes (x, y).
        """
        rc = np.asarray(cells, dtype=np.float64).reshape(-1, 2)
        return np.asarray(rc[:, ::-1] * self.cell + np.asarray(self.origin))

    def fractional(self, xy: npt.ArrayLike) -> Floats:
        """Fractional cells (N, 2) of world coordinates (N, 2) [m]: `xy` the other way round."""
        points = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        return np.asarray((points - np.asarray(self.origin)) / self.cell)[:, ::-1]

    def cell_at(self, x: float, y: float) -> tuple[int, int]:
        """The (row, col) of the cell that holds a point; points outside get the nearest cell."""
        rows, cols = self.shape
        row = math.floor((y - self.origin[1]) / self.cell + 0.5)
        col = math.floor((x - self.origin[0]) / self.cell + 0.5)
        return min(max(row, 0), rows - 1), min(max(col, 0), cols - 1)

    def _repr_html_(self) -> str:
        from antdrive.worlds.drawing import card, cells_svg

        rows, cols = self.shape
        facts = {
            "cells": f"{rows} × {cols}",
            "free": f"{100 * self.free.mean():.1f} %",
            "cell": f"{self.cell:g} m",
            "inflated by": f"{self.inflate:g} m",
        }
        return card(cells_svg(self.free), f"grid of {rows} × {cols} cells", facts)

    @classmethod
    def from_free(cls, free: npt.ArrayLike, cell: float = 1.0, origin: Point = (0.0, 0.0)) -> Grid:
        """A grid from an occupancy picture alone; diagonals need both orthogonal neighbours free."""
        cells = np.array(free, dtype=np.bool_, ndmin=2)
        return cls._finish(cells, np.zeros(cells.shape, dtype=np.uint8), cell, origin, 0.0)

    @classmethod
    def _finish(
        cls, free: npt.NDArray[np.bool_], closed: npt.NDArray[np.uint8], cell: float, origin: Point, inflate: float
    ) -> Grid:
        moves = np.zeros(free.shape, dtype=np.uint8)
        _kernels.allowed_moves(free, closed, moves)
        free.setflags(write=False)
        moves.setflags(write=False)
        return cls(free, moves, cell, origin, inflate)


def rasterise(world: World, cell: float, inflate: float = 0.0) -> Grid:
    """The grid of a world for a robot of radius `inflate` (its radius plus the margin) [m].

    A cell is free when a disc of that radius at its centre touches nothing. A move is allowed when both cells are free,
    the disc swept along the move touches nothing (exact segment-disc distance), and, for a diagonal, both orthogonal
    neighbours are free.

    Raises:
        InputError: the cell size is not positive or cuts the world into absurdly many cells.
        ValueError: the inflation is negative.
    """
    if not cell > 0:
        raise InputError(f"cell: must be greater than 0, got {cell:g}")
    if not inflate >= 0:
        raise ValueError(f"inflate: must be at least 0, got {inflate:g}")
    width, height = world.size
    rows, cols = (max(1, math.ceil(side / cell - 1e-9)) for side in (height, width))
    if rows * cols > MAX_CELLS:
        raise InputError(f"cell: {cell:g} m cuts this world into {rows} x {cols} cells; the limit is {MAX_CELLS}")
    free = np.empty((rows, cols), dtype=np.bool_)
    closed = np.zeros((rows, cols), dtype=np.uint8)
    x0, y0 = world.bounds[0] + cell / 2, world.bounds[1] + cell / 2
    bounds = np.asarray(world.bounds, dtype=np.float64)
    _kernels.rasterise(world.discs, bounds, x0, y0, cell, inflate, free, closed)
    return Grid._finish(free, closed, cell, (x0, y0), inflate)
