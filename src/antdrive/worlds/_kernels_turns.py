"""Compiled nodes of grids that know turns: labels of headings, successors and predecessors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, Array, inline, kernel

NOWHERE = -1

#: The index in `DIRECTIONS` by row and column step, each + 1 (3, 3); 8 where there is no step.
HEADINGS = np.array([(5, 6, 7), (4, 8, 0), (3, 2, 1)], dtype=np.int64)


class MoveGraph(NamedTuple):
    """Nodes of a grid and their moves.

    Without turns a node is a flat cell, and `cell` and `label` have no entries.

    Attributes:
        mask: allowed moves of each node, one bit per direction (N,)
        cell: flat cell of each node (N,)
        label: node of each cell and heading, -1 where the heading is not free (cells, 8)
        cols: columns of the grid
    """

    mask: Array
    cell: Array
    label: Array
    cols: int


@inline
def cell_of(graph: MoveGraph, node: int) -> int:
    """Return the flat cell of a node."""
    return graph.cell[node] if len(graph.cell) else node


@inline
def after_move(graph: MoveGraph, node: int, k: int) -> Any:
    """Return the node that allowed move k leads to."""
    step = DROW[k] * graph.cols + DCOL[k]
    return np.int64(graph.label[graph.cell[node] + step, k]) if len(graph.cell) else node + step


@inline
def before_move(graph: MoveGraph, node: int, k: int) -> Any:
    """Return the node from which allowed move k led to a node."""
    step = DROW[k] * graph.cols + DCOL[k]
    return np.int64(graph.label[graph.cell[node] - step, k]) if len(graph.cell) else node - step


# Inner loops pass arrays: to take them from a graph there costs more than the search.


@inline
def beside(cell: Array, label: Array, cols: int, node: int, k: int) -> Any:
    """Return the node in direction k from which the opposite move, if it is allowed, leads to a node with turns; else -1.

    Beyond the first or last column it is a node of the next row, whose move is not allowed.
    """
    there = cell[node] + DROW[k] * cols + DCOL[k]
    joined = label[cell[node], (k + 4) & 7] == node and 0 <= there < len(label)
    return np.int64(label[there, (k + 4) & 7]) if joined else np.int64(NOWHERE)


@inline
def behind(mask: Array, cell: Array, label: Array, cols: int, node: int, k: int) -> Any:
    """Return the node in direction k from which the opposite move leads to a node with turns; -1 without one."""
    before = beside(cell, label, cols, node, k)
    return before if before >= 0 and mask[before] >> ((k + 4) & 7) & 1 else np.int64(NOWHERE)


@kernel
def count_labels(bits: Array) -> int:
    """Return the number of nodes: one for each cell, and one for each further label of a cell."""
    count = 0
    for i in range(len(bits)):
        here: Any = np.int64(bits[i])
        starts = 0
        for k in range(8):  # a label starts at a free heading that no free turn reaches from the one before
            starts += (here >> k) & ~(here >> (8 + (k + 7) % 8)) & 1
        count += max(1, starts)
    return count


@kernel
def number_labels(bits: Array, able: Array, cell: Array, label: Array, mask: Array) -> None:
    """Give the labels of each cell their nodes, and each node its moves.

    A label is a maximal run of free headings joined by free turns. A cell's first label is the node of the cell's number;
    others have the next numbers after all cells.

    `bits` (cells,) has the free headings (bits 0 to 7) and the free turns to the next heading (bits 8 to 15) of each cell,
    `able` (cells,) its clear moves. `cell` (N,), `label` (cells, 8) and `mask` (N,) are those of `MoveGraph`.
    """
    cells = len(bits)
    following = cells
    for i in range(cells):
        cell[i] = i
        here = np.int64(bits[i])
        first = 0
        for k in range(8):
            label[i, k] = NOWHERE
            if (here >> k) & ~(here >> (8 + (k + 7) % 8)) & 1:
                first = k
        node, used = i, False
        for step in range(8):
            k = (first + step) % 8
            if not (here >> k) & 1:
                continue
            joined = step > 0 and (here >> (8 + (k + 7) % 8)) & 1
            if used and not joined:
                node = following
                cell[node] = i
                following += 1
            used = True
            label[i, k] = node
            mask[node] |= (np.int64(able[i]) >> k & 1) << k


@kernel
def led_to(graph: MoveGraph, start: int) -> Array:
    """Return the nodes to which moves lead from a node (N,): a flood fill."""
    seen = np.zeros(len(graph.mask), dtype=np.bool_)
    stack = np.empty(len(graph.mask), dtype=np.int64)
    stack[0], size = start, 1
    seen[start] = True
    while size > 0:
        size -= 1
        node = stack[size]
        for k in range(8):
            if graph.mask[node] >> k & 1:
                after = after_move(graph, node, k)
                if not seen[after]:
                    seen[after] = True
                    stack[size] = after
                    size += 1
    return seen


@kernel
def leads_to(graph: MoveGraph, goals: Array) -> Array:
    """Return the first of some cells that moves from each node lead to, as its place among them, or NOWHERE (N,).

    Each cell in turn floods what no cell before it has, against the moves.
    """
    first = np.full(len(graph.mask), NOWHERE, dtype=np.int32)
    stack = np.empty(len(graph.mask), dtype=np.int64)
    for i in range(len(goals)):
        size = 0
        for k in range(8):
            node = np.int64(graph.label[goals[i], k])
            if node >= 0 and first[node] < 0:
                first[node] = i
                stack[size] = node
                size += 1
        while size > 0:
            size -= 1
            node = stack[size]
            here = graph.cell[node]
            for k in range(8):
                there = here - DROW[k] * graph.cols - DCOL[k]
                if graph.label[here, k] != node or there < 0 or there >= len(graph.label):
                    continue
                before = graph.label[there, k]
                # No move leaves the grid, so none leads here from the far end of a row.
                if before >= 0 and first[before] < 0 and graph.mask[before] >> k & 1:
                    first[before] = i
                    stack[size] = before
                    size += 1
    return first
