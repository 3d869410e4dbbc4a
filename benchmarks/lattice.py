"""Independent oracle of footprint plans: a lattice of headings on the cells' centres, flooded from the start.

Shares no code with antdrive's geometry, grids or planners. A state is (row, column, heading). From it lead the straight move
forward to the lattice point ahead, and turns on the spot to the two next headings. A move is clear if the convex hull of the
outline at both ends is (the exact swept region); a turn if the outline is at every degree. Between two degrees a corner comes
at most 0.3 mm closer. An outline is a convex polygon and the distance that it keeps: one corner and a radius make a disc.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit

Point = tuple[float, float]
STRAIGHT = ((0, 1), (1, 1), (1, 0), (1, -1))  # (columns, rows) of a move; negated: four more headings
SKEW = ((2, 1), (1, 2), (2, -1), (1, -2))
SLACK = 1e-9  # touching counts as blocked, whatever the rounding of floats [m]


class Shape(NamedTuple):
    """A robot's outline about its axle's centre.

    Attributes:
        corners: (K, 2) corners of a convex polygon [m]
        reach: the distance kept from it [m]
    """

    corners: Sequence[Point]
    reach: float


class Flood(NamedTuple):
    """The states that the start reaches.

    Attributes:
        crossed: whether the goal is among them
        states: how many there are
    """

    crossed: bool
    states: int


def hull(points: Sequence[Point]) -> list[Point]:
    """Return the corners of the convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    sides = []
    for side in (ordered, ordered[::-1]):
        chain: list[Point] = []
        for x, y in side:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                    break
                chain.pop()
            chain.append((x, y))
        sides += chain[:-1]
    return sides


def moves(headings: int) -> list[tuple[int, int, float]]:
    """Return the moves as (rows, columns, heading [rad]), sorted by heading.

    Args:
        headings: 8, or 16 with moves of two cells by one
    """
    if headings not in (8, 16):
        raise ValueError(f"headings: 8 or 16, got {headings}")
    half = STRAIGHT + (SKEW if headings == 16 else ())
    steps = [(sign * rows, sign * columns) for columns, rows in half for sign in (1, -1)]
    return sorted(((r, c, math.atan2(r, c) % math.tau) for r, c in steps), key=lambda step: step[2])


def flood(
    shape: Shape,
    discs: Any,
    bounds: Sequence[float],
    start: Sequence[float],
    goal: Point,
    tolerance: float,
    *,
    cell: float = 0.05,
    headings: int = 8,
) -> Flood:
    """Flood the lattice from the start.

    Args:
        shape: the robot's outline
        discs: (N, 3) obstacles' centres and radii [m]
        bounds: xmin, ymin, xmax, ymax of the room [m]
        start: x, y [m] and heading [rad]; any lattice point within half a cell starts, with the next lattice heading
        goal: its x and y [m]
        tolerance: distance from the goal that counts as arrived [m]
        cell: distance between lattice points [m]
        headings: 8, or 16 with moves of two cells by one
    """
    steps = moves(headings)
    angles = np.array([angle for _, _, angle in steps])
    heading = int(np.argmin(np.abs((angles - start[2] + math.pi) % math.tau - math.pi)))
    corners = hull(shape.corners)
    swept = [hull([*corners, *((x + cell * math.hypot(r, c), y) for x, y in corners)]) for r, c, _ in steps]
    longest = max(map(len, swept))
    sizes = np.array(list(map(len, swept)))
    padded = np.array([[*one, *[one[-1]] * (longest - len(one))] for one in swept], dtype=float)
    crossed, states = _flood(
        np.array(corners, dtype=float).reshape(-1, 2), padded, sizes, shape.reach + SLACK,
        np.asarray(discs, dtype=float).reshape(-1, 3), np.array(bounds, dtype=float), np.array(start[:2], dtype=float),
        heading, np.array(goal, dtype=float), tolerance, cell, np.array([step[:2] for step in steps]), angles,
    )  # fmt: skip
    return Flood(bool(crossed), int(states))


@njit(cache=False)
def apart(px, py, corners, reach):  # type: ignore[no-untyped-def]
    """Return whether a point is farther than `reach` from a convex counter-clockwise polygon (or segment, or point)."""
    count = len(corners)
    if count == 1:
        return math.hypot(px - corners[0, 0], py - corners[0, 1]) > reach
    inside = count > 2
    for i in range(count):
        ax, ay = corners[i]
        bx, by = corners[(i + 1) % count]
        ex, ey, wx, wy = bx - ax, by - ay, px - ax, py - ay
        if ex * wy - ey * wx < 0:
            inside = False
        along = min(1.0, max(0.0, (wx * ex + wy * ey) / (ex * ex + ey * ey)))
        if math.hypot(wx - along * ex, wy - along * ey) <= reach:
            return False
    return not inside


@njit(cache=False)
def clear(x, y, angle, corners, reach, discs, bounds):  # type: ignore[no-untyped-def]
    """Return whether the outline at a pose keeps `reach` from discs and walls."""
    cos, sin = math.cos(angle), math.sin(angle)
    far = 0.0
    for cx, cy in corners:
        far = max(far, math.hypot(cx, cy))
        wx, wy = x + cos * cx - sin * cy, y + sin * cx + cos * cy
        if min(wx - bounds[0], wy - bounds[1], bounds[2] - wx, bounds[3] - wy) <= reach:
            return False
    for dx, dy, radius in discs:
        wx, wy = dx - x, dy - y
        if math.hypot(wx, wy) > far + reach + radius:
            continue
        if not apart(cos * wx + sin * wy, cos * wy - sin * wx, corners, reach + radius):
            return False
    return True


@njit(cache=False)
def turns(x, y, angle, other, corners, reach, discs, bounds):  # type: ignore[no-untyped-def]
    """Return whether a turn on the spot is clear, at every degree and both ends."""
    parts = math.ceil(abs(other - angle) * 180.0 / math.pi - 1e-9)
    free = True
    for part in range(parts + 1):
        free = free and clear(x, y, angle + (other - angle) * part / parts, corners, reach, discs, bounds)
    return free


@njit(cache=False)
def within(x, y, far, discs):  # type: ignore[no-untyped-def]
    """Return the discs that come within `far` of a point."""
    kept = np.zeros(len(discs), np.bool_)
    for i in range(len(discs)):
        dx, dy, room = discs[i, 0] - x, discs[i, 1] - y, far + discs[i, 2]
        kept[i] = dx * dx + dy * dy <= room * room
    return discs[kept]


@njit(cache=False)
def _flood(corners, swept, sizes, reach, discs, bounds, start, heading, goal, tolerance, cell, steps, angles):  # type: ignore[no-untyped-def]
    rows, columns = round((bounds[3] - bounds[1]) / cell), round((bounds[2] - bounds[0]) / cell)
    count = len(angles)
    seen = np.zeros((rows, columns, count), np.bool_)
    stack = np.empty((rows * columns * count, 3), np.int64)
    size, states, crossed = 0, 0, False
    far = reach + np.sqrt((swept**2).sum(axis=2)).max()
    for r in range(rows):
        for c in range(columns):
            x, y = bounds[0] + (c + 0.5) * cell, bounds[1] + (r + 0.5) * cell
            near = max(abs(x - start[0]), abs(y - start[1])) <= 0.5 * cell + 1e-9
            if near and clear(x, y, angles[heading], corners, reach, discs, bounds):
                seen[r, c, heading] = True
                stack[size] = r, c, heading
                size += 1
    while size:
        size -= 1
        r, c, k = stack[size]
        states += 1
        x, y = bounds[0] + (c + 0.5) * cell, bounds[1] + (r + 0.5) * cell
        close = within(x, y, far, discs)
        if math.hypot(x - goal[0], y - goal[1]) <= tolerance:
            crossed = True
        nr, nc = r + steps[k, 0], c + steps[k, 1]
        new = 0 <= nr < rows and 0 <= nc < columns and not seen[nr, nc, k]
        if new and clear(x, y, angles[k], swept[k, : sizes[k]], reach, close, bounds):
            seen[nr, nc, k] = True
            stack[size] = nr, nc, k
            size += 1
        for side in (-1, 1):
            j = (k + side) % count
            if not seen[r, c, j]:
                turn = (angles[j] - angles[k] + math.pi) % (2 * math.pi) - math.pi
                if turns(x, y, angles[k], angles[k] + turn, corners, reach, close, bounds):
                    seen[r, c, j] = True
                    stack[size] = r, c, j
                    size += 1
    return crossed, states
