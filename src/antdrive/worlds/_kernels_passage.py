"""Compiled gaps between obstacles, and the gap whose closing separates two points."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, doubled_rows, inline, kernel


@kernel
def gaps(discs: Array, order: Array, bounds: Array, most: float) -> Array:
    """Return the gaps of at most `most` [m] as rows (N, 3): width [m] and the two obstacles; the walls are N, N + 1, ...

    Args:
        discs: x, y, radius [m]
        order: indices of the discs by rising left edge
    """
    count = discs.shape[0]
    out, size = np.empty((max(64, 8 * count), 3)), 0
    for a in range(count):
        i = order[a]
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        for wall in range(4):
            edge = bounds[wall]
            width = (x - edge if wall == 0 else y - edge if wall == 1 else edge - x if wall == 2 else edge - y) - r
            if width <= most:
                if size == out.shape[0]:
                    out = doubled_rows(out)
                out[size, 0], out[size, 1], out[size, 2] = width, i, count + wall
                size += 1
        for b in range(a + 1, count):
            j = order[b]
            if discs[j, 0] - discs[j, 2] > x + r + most:
                break
            dx, dy, reach = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2] + r + most
            if dx * dx + dy * dy > reach * reach:
                continue
            if size == out.shape[0]:
                out = doubled_rows(out)
            out[size, 0], out[size, 1], out[size, 2] = math.hypot(dx, dy) - r - discs[j, 2], min(i, j), max(i, j)
            size += 1
    return out[:size]


@inline
def is_left(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> bool:
    """Return whether p is left of the line from a to b, or on it."""
    return bool((bx - ax) * (py - ay) - (by - ay) * (px - ax) >= 0.0)


@kernel
def separating(narrow: Array, discs: Array, bounds: Array, start: Array, goal: Array) -> int:
    """Return the first gap whose closing separates start from goal if the gaps close in this order; -1 if none does.

    A closed gap is a line between two obstacles. Lines form a loop around one of the two points if it crosses the
    segment between them an odd number of times. The obstacles form a union-find forest; each has the parity of the
    crossings on its way to its root. The walls are one obstacle: no line beyond them crosses the segment.
    """
    count = discs.shape[0]
    parent, odd = np.arange(count + 1), np.zeros(count + 1, dtype=np.bool_)
    ends = np.empty((2, 2), dtype=np.int64)
    for k in range(narrow.shape[0]):
        i, j = int(narrow[k, 1]), int(narrow[k, 2])
        ax, ay = discs[i, 0], discs[i, 1]
        bx, by = ax, ay
        if j < count:
            bx, by = discs[j, 0], discs[j, 1]
        elif (j - count) % 2 == 0:
            bx = bounds[j - count]
        else:
            by = bounds[j - count]
        parity = is_left(start[0], start[1], goal[0], goal[1], ax, ay) != is_left(
            start[0], start[1], goal[0], goal[1], bx, by
        ) and is_left(ax, ay, bx, by, start[0], start[1]) != is_left(ax, ay, bx, by, goal[0], goal[1])
        for end in range(2):
            node, crossings = min(j, count) if end else i, 0
            while parent[node] != node:
                above = parent[node]
                odd[node] ^= odd[above]  # halve the path; a root's parity is even
                parent[node] = parent[above]
                crossings += odd[node]
                node = parent[node]
            ends[end, 0], ends[end, 1] = node, crossings
        parity ^= (ends[0, 1] + ends[1, 1]) % 2 == 1
        if ends[0, 0] != ends[1, 0]:
            parent[ends[0, 0]], odd[ends[0, 0]] = ends[1, 0], parity
        elif parity:
            return k
    return -1
