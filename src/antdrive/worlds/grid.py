"""Planning grids: free square cells and collision-free moves between them.

Cells are (row, col), rows along +y; cell (0, 0) is at the world's lower-left corner.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError, require
from antdrive.base.types import Floats, Point
from antdrive.worlds import _kernels, _kernels_turns
from antdrive.worlds._kernels_turns import HEADINGS, MoveGraph
from antdrive.worlds.headings import Outline, _kernels_headings
from antdrive.worlds.limits import MAX_CELLS
from antdrive.worlds.world import World

#: The eight moves by bit of `Grid.moves`, as (row, column) steps: E, NE, N, NW, W, SW, S, SE.
DIRECTIONS: tuple[tuple[int, int], ...] = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))


def _none(*shape: int, dtype: npt.DTypeLike = np.int32) -> npt.NDArray[Any]:
    made = np.empty(shape, dtype=dtype)
    made.setflags(write=False)
    return made


#: The outline of a disc, which has no heading.
DISC = Outline(_none(0, 2, dtype=np.float64), 0.0)


@dataclass(frozen=True, eq=False)
class Turns:
    """Labels of turns of an oriented outline; empty for a disc, which turns everywhere.

    A node is a label of a cell: a maximal run of its eight headings joined by free turns on the spot. Moves are driven facing
    ahead, so move k needs heading k.

    Attributes:
        outline: the robot's outline, with its margin
        cell: flat cell of each node (N,), read-only
        label: node of each flat cell and heading, -1 where it is not free (R * C, 8), read-only
        moves: bit k is set where the node may make the move `DIRECTIONS[k]` (N,), read-only
        joints: bit k is set where the turn from heading k to the next is free, of each flat cell (R * C,), read-only
    """

    outline: Outline = DISC
    cell: npt.NDArray[np.int32] = field(default_factory=functools.partial(_none, 0))
    label: npt.NDArray[np.int32] = field(default_factory=functools.partial(_none, 0, 8))
    moves: npt.NDArray[np.uint8] = field(default_factory=functools.partial(_none, 0, dtype=np.uint8))
    joints: npt.NDArray[np.uint8] = field(default_factory=functools.partial(_none, 0, dtype=np.uint8))

    def __bool__(self) -> bool:
        return len(self.cell) > 0

    @classmethod
    def of(cls, outline: Outline, bits: npt.NDArray[np.uint16], able: npt.NDArray[np.uint8]) -> Turns:
        """Label the free headings of each cell.

        Args:
            outline: the robot's outline, with its margin
            bits: free headings (bits 0 to 7), and free turns to the next heading (bits 8 to 15) (R, C)
            able: clear moves, one bit per direction (R, C)
        """
        count = _kernels_turns.count_labels(bits.ravel())
        cell, label = np.empty(count, dtype=np.int32), np.empty((bits.size, 8), dtype=np.int32)
        moves = np.zeros(count, dtype=np.uint8)
        _kernels_turns.number_labels(bits.ravel(), able.ravel(), cell, label, moves)
        joints = (bits.ravel() >> 8).astype(np.uint8)
        for array in (cell, label, moves, joints):
            array.setflags(write=False)
        return cls(outline, cell, label, moves, joints)


#: The turns of a disc.
NO_TURNS = Turns()


@dataclass(frozen=True, eq=False)
class Grid:
    """Free cells and allowed moves, for a robot of radius `inflate`.

    Attributes:
        free: whether the robot, centred on the cell, touches nothing (R, C), read-only; with turns, at some heading
        moves: bit k is set where the move `DIRECTIONS[k]` is allowed (R, C), read-only; with turns, for some label
        cell: side of a cell [m]
        origin: centre of cell (0, 0), x and y [m]
        inflate: the robot's radius plus the margin [m]
        turns: labels of turns; empty for a disc
    """

    free: npt.NDArray[np.bool_]
    moves: npt.NDArray[np.uint8]
    cell: float = 1.0
    origin: Point = (0.0, 0.0)
    inflate: float = 0.0
    turns: Turns = NO_TURNS

    @property
    def graph(self) -> MoveGraph:
        """Nodes and their moves, for compiled code."""
        turns = self.turns
        return MoveGraph(turns.moves if turns else self.moves.ravel(), turns.cell, turns.label, self.shape[1])

    def nodes_at(self, cell: tuple[int, int]) -> list[int]:
        """Return the nodes of a cell (row, col) with a free heading; without turns its flat index."""
        flat = cell[0] * self.shape[1] + cell[1]
        return sorted(set(self.turns.label[flat].tolist()) - {_kernels_turns.NOWHERE}) if self.turns else [flat]

    def cells_of(self, nodes: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
        """Return the flat cells of marked nodes (N,), with repetitions."""
        marked = np.flatnonzero(nodes)
        return self.turns.cell[marked].astype(np.int64) if self.turns else marked

    def nodes_along(self, start: int, cells: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
        """Return the nodes (N,) of a path from node `start` along `cells` (N, 2); undefined after a move that is not allowed."""
        flat: npt.NDArray[np.int64] = cells[:, 0].astype(np.int64) * self.shape[1] + cells[:, 1]
        if self.turns:
            steps = np.diff(cells.astype(np.int64), axis=0)
            flat[1:] = self.turns.label[flat[1:], HEADINGS[steps[:, 0] + 1, steps[:, 1] + 1]]
            flat[0] = start
        return flat

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, cols = self.free.shape
        return rows, cols

    def xy(self, cells: npt.ArrayLike) -> Floats:
        """Return the centres of `cells` (N, 2), which may be fractional, in world coordinates, shape (N, 2) [m].

        Only this method converts (row, col) to (x, y).
        """
        rc = np.asarray(cells, dtype=np.float64).reshape(-1, 2)
        return np.asarray(rc[:, ::-1] * self.cell + np.asarray(self.origin))

    def fractional(self, xy: npt.ArrayLike) -> Floats:
        """Return the fractional cells (N, 2) of points `xy` (N, 2) [m]: the inverse of `Grid.xy`."""
        points = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        return np.asarray((points - np.asarray(self.origin)) / self.cell)[:, ::-1]

    def cell_at(self, x: float, y: float) -> tuple[int, int]:
        """Return the (row, col) of the cell that contains the point (`x`, `y`) [m], or of the cell nearest to it."""
        rows, cols = self.shape
        row = math.floor((y - self.origin[1]) / self.cell + 0.5)
        col = math.floor((x - self.origin[0]) / self.cell + 0.5)
        return min(max(row, 0), rows - 1), min(max(col, 0), cols - 1)

    def _repr_html_(self) -> str:
        from antdrive.worlds.svg import card, cells_svg

        rows, cols = self.shape
        facts = {
            "cells": f"{rows} × {cols}",
            "free": f"{100 * self.free.mean():.1f} %",
            "cell": f"{self.cell:g} m",
            "radius + margin": f"{self.inflate:g} m",
        }
        return card(cells_svg(self.free), f"grid of {rows} × {cols} cells", facts)

    @classmethod
    def from_free(cls, free: npt.ArrayLike, cell: float = 1.0, origin: Point = (0.0, 0.0)) -> Grid:
        """Return a grid of given free cells; a diagonal move requires both orthogonal neighbours free.

        Args:
            free: which cells are free (R, C)
            cell: side of a cell [m]
            origin: centre of cell (0, 0) [m]
        """
        cells = np.array(free, dtype=np.bool_, ndmin=2, order="C")
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


def rasterise(world: World, cell: float, inflate: float = 0.0, outline: Outline = DISC) -> Grid:
    """Rasterise a world for a robot of a given size.

    A cell is free if a disc of radius `inflate` at its centre has no contact. A move is allowed if both cells are
    free, the disc swept along it has no contact (exact segment-disc distance), and, for a diagonal, both orthogonal
    neighbours are free.

    For an oriented outline, a cell has labels of turns. A move is allowed if the outline, facing ahead, has no contact in
    both cells and between them.

    Args:
        world: the obstacles and walls; movers do not count
        cell: side of a cell [m]
        inflate: the robot's radius plus the margin [m]
        outline: the robot's outline with its margin; without corners the robot is the disc

    Raises:
        InputError: the cell size is not positive or cuts the world into too many cells.
        FieldError: the inflation is negative.
    """
    if not cell > 0:
        raise FieldError("cell", f"must be greater than 0, got {cell:g}").as_input()
    require("inflate", inflate, at_least=0)
    width, height = world.size
    rows, cols = (max(1, math.ceil(side / cell - 1e-9)) for side in (height, width))
    if rows * cols > MAX_CELLS:
        problem = f"{cell:g} m cuts this world into {rows} x {cols} cells; the limit is {MAX_CELLS}"
        raise FieldError("cell", problem).as_input()
    free = np.empty((rows, cols), dtype=np.bool_)
    closed = np.zeros((rows, cols), dtype=np.uint8)
    x0, y0 = world.bounds[0] + cell / 2, world.bounds[1] + cell / 2
    bounds = np.asarray(world.bounds, dtype=np.float64)
    if len(outline.corners):
        bits, able = np.empty((rows, cols), dtype=np.uint16), np.empty((rows, cols), dtype=np.uint8)
        _kernels_headings.heading_bits(world.discs, bounds, x0, y0, cell, *outline, bits)
        _kernels_headings.clear_moves(world.discs, bounds, x0, y0, cell, *outline, bits, able)
        free = (bits & 0xFF) > 0
        free.setflags(write=False)
        able.setflags(write=False)
        return Grid(free, able, cell, (x0, y0), inflate, Turns.of(outline, bits, able))
    _kernels.rasterise(world.discs, bounds, x0, y0, cell, inflate, free, closed)
    return Grid._finish(free, closed, cell, (x0, y0), inflate)
