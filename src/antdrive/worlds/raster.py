"""Grids that follow a changing list of discs.

An update rasterises only tiles near discs that changed. Free cells and moves are those of `rasterise`, bit for bit.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Bounds, Floats
from antdrive.worlds import _kernels_raster as kernels
from antdrive.worlds.grid import rasterise
from antdrive.worlds.world import World


class Raster:
    """The grid of a disc-shaped robot among discs that come and go.

    Attributes:
        grid: the grid; its arrays are read-only views that reflect every update

    Args:
        bounds: the walls [m]
        cell: side of a cell [m]
        inflate: the robot's radius plus the margin [m]
    """

    def __init__(self, bounds: Bounds, cell: float, inflate: float) -> None:
        empty = rasterise(World("without discs", bounds), cell, inflate)
        self._free, self._moves = empty.free.copy(), empty.moves.copy()
        free, moves = self._free.view(), self._moves.view()
        for array in (free, moves):
            array.setflags(write=False)
        self.grid = dataclasses.replace(empty, free=free, moves=moves)
        self._discs, self._bounds = np.empty((0, 3)), np.asarray(bounds, dtype=np.float64)
        rows, cols = empty.shape
        self._blocked = np.zeros((rows, cols // 64 + 1), dtype=np.uint64)
        self._closed = np.zeros((rows, cols), dtype=np.uint8)
        self._edits: list[npt.NDArray[np.int64]] = []

    @property
    def updates(self) -> int:
        """Number of updates that changed cells."""
        return len(self._edits)

    def update(self, discs: Floats) -> None:
        """Replace the discs (N, 3): x, y, radius [m]. Lists in nearly the same order cost least."""
        grid = self.grid
        changed = kernels.adapt(
            self._discs, discs, self._bounds, *grid.origin, grid.cell, grid.inflate, self._blocked, self._closed,
            self._free, self._moves,
        )  # fmt: skip
        self._discs = discs
        if len(changed):
            self._edits.append(changed)

    def changed_since(self, updates: int) -> npt.NDArray[np.int64]:
        """Return the flat cells that changed, themselves or their moves, after a number of updates, in order (K,)."""
        edits = self._edits[updates:]
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *edits]))
