"""Compiled potential field: arrays in, arrays out, no validation.

Equation numbers as in Lee et al. 2008.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, SQRT2, Array, inline, kernel


@inline
def parabola(x: int, site: int, height: Array) -> int:
    """Return the squared distance from column x of a row to the nearest blocked cell in column `site`."""
    distance2: int = (x - site) * (x - site) + height[site]
    return distance2


@kernel
def squared_distances(free: Array, out: Array) -> bool:
    """Fill `out` with squared distances to the nearest blocked cell [cells^2]; returns whether there is one.

    Exact, in integers and linear time: A. Meijster, J. Roerdink and W. Hesselink, *A general algorithm for
    computing distance transforms in linear time*, 2000. Cells outside the grid do not count as blocked.
    """
    rows, cols = free.shape
    far = rows + cols  # farther than any cell
    some = False
    for c in range(cols):  # along columns
        steps = far
        for r in range(rows):
            if not free[r, c]:
                steps, some = 0, True
            out[r, c] = steps
            steps = min(far, steps + 1)
        steps = far
        for r in range(rows - 1, -1, -1):
            steps = min(steps, out[r, c])
            out[r, c] = steps * steps
            steps = min(far, steps + 1)
    if not some:
        return False
    site, begins = np.empty(cols, dtype=np.int64), np.empty(cols, dtype=np.int64)
    height = np.empty(cols, dtype=np.int64)
    for r in range(rows):  # along rows: the lower envelope of one parabola per column
        height[:] = out[r]
        top = 0
        site[0], begins[0] = 0, 0
        for c in range(1, cols):
            while top >= 0 and parabola(begins[top], site[top], height) > parabola(begins[top], c, height):
                top -= 1
            if top < 0:
                top, site[0] = 0, c
                continue
            old = site[top]
            cross = 1 + (c * c - old * old + height[c] - height[old]) // (2 * (c - old))
            if cross < cols:
                top += 1
                site[top], begins[top] = c, cross
        for c in range(cols - 1, -1, -1):
            out[r, c] = parabola(c, site[top], height)
            if c == begins[top]:
                top -= 1
    return True


@kernel
def disc_distances(discs: Array, x0: float, y0: float, cell: float, inflate: float, reach: float, out: Array) -> None:
    """Lower `out` to the distance from each cell's centre to the nearest inflated disc, up to `reach`."""
    rows, cols = out.shape
    for j in range(discs.shape[0]):
        x, y, radius = discs[j, 0], discs[j, 1], discs[j, 2] + inflate
        far = radius + reach
        for r in range(max(0, math.ceil((y - far - y0) / cell)), min(rows - 1, math.floor((y + far - y0) / cell)) + 1):
            for c in range(
                max(0, math.ceil((x - far - x0) / cell)), min(cols - 1, math.floor((x + far - x0) / cell)) + 1
            ):
                out[r, c] = min(out[r, c], math.hypot(x0 + c * cell - x, y0 + r * cell - y) - radius)


@kernel
def roll_down(moves: Array, field: Array, r0: int, c0: int, r1: int, c1: int) -> Array:
    """Return the cells (N, 2) along the steepest descent of the potential (eq. 5), to the goal or a local minimum."""
    cells = np.empty((64, 2), dtype=np.int32)
    r, c, n = r0, c0, 1
    cells[0, 0], cells[0, 1] = r, c
    while r != r1 or c != c1:
        best, way = 0.0, -1
        for k in range(8):
            if moves[r, c] & (1 << k):
                fall = field[r, c] - field[r + DROW[k], c + DCOL[k]]
                if k & 1:
                    fall /= SQRT2
                if fall > best:
                    best, way = fall, k
        if way < 0:
            break
        r, c = r + DROW[way], c + DCOL[way]
        if n == len(cells):
            cells = np.concatenate((cells, np.empty_like(cells)))
        cells[n, 0], cells[n, 1] = r, c
        n += 1
    return cells[:n].copy()
