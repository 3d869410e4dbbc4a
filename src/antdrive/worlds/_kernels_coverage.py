"""Compiled segmentation of a floor into rooms."""

from __future__ import annotations

import numpy as np

from antdrive.worlds._kernels import DCOL, DROW, Array, kernel


@kernel
def rooms(moves: Array, clearance: Array, order: Array, ratio: float, least: float, out: Array) -> None:
    """Fill `out` (R, C) with the number of each cell's room, the flat index of a cell of it; other cells keep theirs.

    Rooms grow in the order of falling clearance. Two that meet are one if the clearance there is more than `ratio` of
    the lesser one's maximum, or if one of them has fewer than `least` cells yet.

    Args:
        order: flat indices of the cells by falling clearance
    """
    rows, cols = out.shape
    parent, area = np.full(rows * cols, -1), np.zeros(rows * cols)
    peak = np.zeros(rows * cols)
    for at in order:
        r, c = at // cols, at % cols
        here, level = -1, clearance[r, c]
        for k in range(8):
            rn, cn = r + DROW[k], c + DCOL[k]
            if not moves[r, c] >> k & 1 or parent[rn * cols + cn] < 0:
                continue
            there = rn * cols + cn
            while parent[there] != there:
                parent[there] = parent[parent[there]]
                there = parent[there]
            if here < 0:
                here = there
            elif here != there:
                low, high = (here, there) if peak[here] < peak[there] else (there, here)
                if level > ratio * peak[low] or min(area[low], area[high]) < least:
                    parent[low], here = high, high
                    area[high] += area[low]
        if here < 0:
            here, peak[at] = at, level
        parent[at] = here
        area[here] += 1
    for at in order:
        root = at
        while parent[root] != root:
            root = parent[root]
        out[at // cols, at % cols] = root
