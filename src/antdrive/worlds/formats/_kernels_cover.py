"""Compiled map operations: flood fill, distance transform and disc cover.

Lengths are in half cells: corners, edge midpoints and centres of cells are points (i, j) of an integer lattice, cell (r, c)
spans 2r..2r+2 by 2c..2c+2, and squared distances from lattice points to cells are integers.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, kernel

DROW4 = np.array([0, 1, 0, -1], dtype=np.int64)
DCOL4 = np.array([1, 0, -1, 0], dtype=np.int64)


@kernel
def flood(free: Array, row: int, col: int, reached: Array) -> None:
    """Mark in `reached` the free cells 4-connected to a cell."""
    rows, cols = free.shape
    if not free[row, col] or reached[row, col]:
        return
    todo = np.empty(rows * cols, dtype=np.int64)
    todo[0], count = row * cols + col, 1
    reached[row, col] = True
    while count:
        count -= 1
        r, c = todo[count] // cols, todo[count] % cols
        for k in range(4):
            rn, cn = r + DROW4[k], c + DCOL4[k]
            if 0 <= rn < rows and 0 <= cn < cols and free[rn, cn] and not reached[rn, cn]:
                reached[rn, cn] = True
                todo[count] = rn * cols + cn
                count += 1


@kernel
def squared_distances(free: Array, cap: int, out: Array) -> None:
    """Fill out[i, j] with the squared distance from a lattice point to the nearest free cell, at most cap squared.

    The point of a cell nearest to a lattice point is itself a lattice point, so integers are exact. Distances are computed
    along columns first, then along rows.
    """
    height, width = out.shape
    column = np.full((height, width), cap, dtype=np.int32)
    for r in range(free.shape[0]):
        for c in range(free.shape[1]):
            if free[r, c]:
                column[2 * r : 2 * r + 3, 2 * c : 2 * c + 3] = 0
    for i in range(1, height):
        for j in range(width):
            column[i, j] = min(column[i, j], column[i - 1, j] + 1)
    for i in range(height - 2, -1, -1):
        for j in range(width):
            column[i, j] = min(column[i, j], column[i + 1, j] + 1)
    for i in range(height):
        for j in range(width):
            best = column[i, j] ** 2
            step = 1
            while step * step < best and step <= cap:
                if j >= step:
                    best = min(best, step * step + column[i, j - step] ** 2)
                if j + step < width:
                    best = min(best, step * step + column[i, j + step] ** 2)
                step += 1
            out[i, j] = best


@kernel
def span(low: int, centre_i: int, centre_j: int, reach2: float, cols: int) -> tuple[int, int]:
    """Return the half-open range of columns in a row whose cells lie fully in a disc.

    The row spans `low` to `low` + 2; the disc has the centre (`centre_i`, `centre_j`) and the squared radius `reach2`.
    """
    far = max(abs(low - centre_i), abs(low + 2 - centre_i))
    rest = reach2 - far * far
    if rest < 0.0:
        return 0, 0
    half = math.sqrt(rest)
    first = max(0, int(math.ceil((centre_j - half) / 2)))
    last = min(cols, int(math.floor((centre_j + half) / 2)))
    return first, max(first, last)


@kernel
def greedy_cover(needed: Array, distance2: Array, extra: float, chosen: Array) -> int:
    """Choose discs until each needed cell lies fully in one of them, and return their number.

    Candidates are centred on lattice points and reach `extra` beyond the nearest free cell. Each step chooses the candidate
    with the most uncovered cells (Chvátal, *A greedy heuristic for the set-covering problem*, 1979)
    and shrinks it to those cells. A row of `chosen` is the centre i, j, the squared radius and the centre's squared
    distance to free cells.
    """
    rows, cols = needed.shape
    height, width = distance2.shape
    # Needed cells are numbered row by row; before[r, c] is the number of those before cell (r, c), so a span of columns
    # in a row is a range of numbers.
    before = np.zeros((rows, cols + 1), dtype=np.int64)
    count = 0
    for r in range(rows):
        for c in range(cols):
            before[r, c] = count
            count += needed[r, c]
        before[r, cols] = count
    column_of = np.empty(count, dtype=np.int64)
    for r in range(rows):
        for c in range(cols):
            if needed[r, c]:
                column_of[before[r, c]] = c
    left, covered = count, np.zeros(count, dtype=np.bool_)

    gain = np.zeros(height * width, dtype=np.int32)
    for i in range(height):
        for j in range(width):
            if distance2[i, j] > 0:
                reach = math.sqrt(distance2[i, j]) + extra
                reach2 = reach * reach + 1e-9
                for r in range(max(0, int((i - reach) / 2)), min(rows, int((i + reach) / 2) + 1)):
                    first, last = span(2 * r, i, j, reach2, cols)
                    gain[i * width + j] += before[r, last] - before[r, first]
    # Candidates are in stacks by their last known number of uncovered cells, which can only decrease.
    best = gain.max() if count else 0
    head, below = np.full(best + 1, -1, dtype=np.int32), np.empty(height * width, dtype=np.int32)
    for candidate in range(height * width - 1, -1, -1):
        below[candidate], head[gain[candidate]] = head[gain[candidate]], candidate

    taken = 0
    while left and best:
        candidate = head[best]
        if candidate < 0:
            best -= 1
            continue
        head[best] = below[candidate]
        i, j = candidate // width, candidate % width
        reach = math.sqrt(distance2[i, j]) + extra
        reach2 = reach * reach + 1e-9
        low, high = max(0, int((i - reach) / 2)), min(rows, int((i + reach) / 2) + 1)
        now = 0
        for r in range(low, high):
            first, last = span(2 * r, i, j, reach2, cols)
            for n in range(before[r, first], before[r, last]):
                now += not covered[n]
        if now < best:
            below[candidate], head[now] = head[now], candidate
            continue
        radius2 = 0
        for r in range(low, high):
            first, last = span(2 * r, i, j, reach2, cols)
            far_i = max(abs(2 * r - i), abs(2 * r + 2 - i))
            for n in range(before[r, first], before[r, last]):
                if not covered[n]:
                    covered[n] = True
                    far_j = max(abs(2 * column_of[n] - j), abs(2 * column_of[n] + 2 - j))
                    radius2 = max(radius2, far_i * far_i + far_j * far_j)
        left -= now
        chosen[taken, 0], chosen[taken, 1], chosen[taken, 2], chosen[taken, 3] = i, j, radius2, distance2[i, j]
        taken += 1
    return taken


@kernel
def points_between(points: Array, low: float, high: float, out: Array) -> int:
    """Fill `out` with points whose hull is the part of the hull of `points` between two heights; return their number.

    All pairs of points count as edges: those that are none lie inside of the hull.
    """
    found = 0
    for a in range(len(points)):
        if low <= points[a, 2] <= high:
            out[found], found = points[a], found + 1
        for b in range(a):
            first, step = points[a, 2], points[b, 2] - points[a, 2]
            for limit in (low, high):
                if (first < limit < first + step) or (first + step < limit < first):
                    out[found], found = points[a] + (limit - first) / step * (points[b] - points[a]), found + 1
    return found


@kernel
def mark_pieces(pieces: Array, low: float, high: float, corner: Array, cell: float, slack: float, tops: Array) -> None:
    """Raise tops[r, c] to the top of each convex piece that reaches into the cell between two heights.

    Pieces are given by points whose hull they are, (K, V, 3) with V <= 8; the part of a piece over a row of cells covers the
    columns from its least to its greatest x. All pairs of points count as edges.
    """
    rows, cols = tops.shape
    points, ends = np.empty((64, 3)), np.empty((rows, 2))
    for k in range(len(pieces)):
        count = points_between(pieces[k], low, high, points)
        if not count:
            continue
        x, y, top = points[:count, 0] - corner[0], points[:count, 1] - corner[1], pieces[k, :, 2].max()
        lowest = (y.min() + slack) / cell
        begin = int(max(math.floor(lowest), 0.0))
        stop = int(min(math.floor(max(lowest, (y.max() - slack) / cell)) + 1.0, rows))
        ends[begin:stop, 0], ends[begin:stop, 1] = np.inf, -np.inf
        for a in range(count):
            for b in range(a + 1):
                i, j = (a, b) if y[a] <= y[b] else (b, a)
                slope = (x[j] - x[i]) / (y[j] - y[i]) if y[j] - y[i] > slack else 0.0
                first, last = math.floor((y[i] - slack) / cell), math.floor((y[j] + slack) / cell)
                for r in range(int(max(first, begin)), int(min(last + 1.0, stop))):
                    from_y, to_y = max(y[i], r * cell - slack), min(y[j], (r + 1) * cell + slack)
                    one, two = x[i] + slope * (from_y - y[i]), x[j] - slope * (y[j] - to_y)
                    if from_y <= to_y:
                        ends[r, 0], ends[r, 1] = min(ends[r, 0], one, two), max(ends[r, 1], one, two)
        for r in range(begin, stop):
            if ends[r, 0] > ends[r, 1]:
                continue
            left = (ends[r, 0] + slack) / cell
            right = max(left, (ends[r, 1] - slack) / cell)
            for c in range(int(max(math.floor(left), 0.0)), int(min(math.floor(right) + 1.0, cols))):
                tops[r, c] = max(tops[r, c], top)
