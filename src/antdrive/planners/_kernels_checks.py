"""Compiled checks of plans."""

from __future__ import annotations

import numpy as np

from antdrive.worlds._kernels import Array, leaf
from antdrive.worlds._kernels_turns import HEADINGS, MoveGraph


@leaf
def faulty_step(cells: Array, rows: int, graph: MoveGraph, start: int, off_grid: bool) -> tuple[int, int, bool, int]:
    """Return the first cell outside the grid, the first step that is no allowed move, -1 for none; of this, whether it leads to
    a neighbour; and the number of diagonal steps before it.

    Args:
        cells: (row, col) of each cell of a path (N, 2), of 64 bits
        rows: rows of the grid
        graph: its moves
        start: the path's first node
        off_grid: cells need only be neighbours
    """
    for i in range(len(cells)):
        if not (0 <= cells[i, 0] < rows and 0 <= cells[i, 1] < graph.cols):
            return i, -1, False, 0
    turning, apart, diagonal = len(graph.cell) > 0, -1, 0
    for i in range(len(cells) - 1):
        dr, dc = cells[i + 1, 0] - cells[i, 0], cells[i + 1, 1] - cells[i, 1]
        if max(abs(dr), abs(dc)) != 1:
            apart = i
            break
        diagonal += abs(dr * dc)
    if off_grid or (turning and apart >= 0):
        return -1, apart, False, diagonal
    node = np.int64(start)
    for i in range(apart if apart >= 0 else len(cells) - 1):
        heading = HEADINGS[cells[i + 1, 0] - cells[i, 0] + 1, cells[i + 1, 1] - cells[i, 1] + 1]
        if not graph.mask[node] >> heading & 1:
            return -1, i, True, diagonal
        node = cells[i + 1, 0] * graph.cols + cells[i + 1, 1]
        if turning:
            node = np.int64(graph.label[node, heading])
    return -1, apart, False, diagonal
