"""Oracles: slow, simple functions that share no code with the compiled ones; and random worlds to compare them on."""

import math
from collections import deque

import numpy as np
from hypothesis import strategies as st

from antdrive.worlds import DIRECTIONS, Disc, World


def clearance_of_point(world, x, y):
    xmin, ymin, xmax, ymax = world.bounds
    surfaces = [np.sqrt((x - d.x) ** 2 + (y - d.y) ** 2) - d.radius for d in world.obstacles]
    return min([x - xmin, xmax - x, y - ymin, ymax - y, *surfaces])


def clearance_of_segment(world, a, b):
    """Ternary search for the closest point: the distance to a disc is convex along a segment."""
    p, q = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    best = min(clearance_of_point(world, *p), clearance_of_point(world, *q))
    for disc in world.obstacles:
        low, high = 0.0, 1.0
        for _ in range(120):
            one, two = low + (high - low) / 3, high - (high - low) / 3
            if np.hypot(*(p + one * (q - p) - (disc.x, disc.y))) < np.hypot(*(p + two * (q - p) - (disc.x, disc.y))):
                high = two
            else:
                low = one
        best = min(best, np.hypot(*(p + low * (q - p) - (disc.x, disc.y))) - disc.radius)
    return float(best)


def segment_distances(points, a, b):
    """Distances (S, P) from segments to points: perpendicular where the foot lies inside, else to an end."""
    along = (b - a)[:, None, :]
    to_a, to_b = points[None] - a[:, None], points[None] - b[:, None]
    length = np.linalg.norm(along, axis=2)
    cross = np.abs(along[..., 0] * to_a[..., 1] - along[..., 1] * to_a[..., 0])
    inside = ((to_a * along).sum(2) > 0) & ((to_b * along).sum(2) < 0)
    ends = np.minimum(np.linalg.norm(to_a, axis=2), np.linalg.norm(to_b, axis=2))
    return np.where(inside, cross / np.where(length > 0, length, 1.0), ends)


def moves_by_force(grid, world):
    """Whether each move of each cell is allowed, from the definition (R, C, 8); NaN where rounding could decide."""
    rows, cols = grid.shape
    discs = np.array([(d.x, d.y, d.radius) for d in world.obstacles]).reshape(-1, 3)
    centres = grid.xy(np.argwhere(np.ones(grid.shape))).reshape(rows, cols, 2)
    moves = np.zeros((rows, cols, 8))
    for k, (dr, dc) in enumerate(DIRECTIONS):
        for r in range(rows):
            for c in range(cols):
                r2, c2 = r + dr, c + dc
                if not (0 <= r2 < rows and 0 <= c2 < cols and grid.free[r, c] and grid.free[r2, c2]):
                    continue
                if dr and dc and not (grid.free[r2, c] and grid.free[r, c2]):
                    continue
                moves[r, c, k] = 1
        starts = centres.reshape(-1, 2)
        gap = segment_distances(discs[:, :2], starts, starts + np.array([dc, dr]) * grid.cell) - discs[:, 2]
        least = gap.min(axis=1, initial=np.inf).reshape(rows, cols)
        moves[..., k] *= least > grid.inflate
        moves[..., k] = np.where(np.abs(least - grid.inflate) < 1e-9, np.nan, moves[..., k])
    return moves


def reachable(grid, start, goal):
    """Breadth-first search over `Grid.moves`."""
    queue, seen = deque([start]), {start}
    while queue:
        r, c = queue.popleft()
        if (r, c) == goal:
            return True
        for k, (dr, dc) in enumerate(DIRECTIONS):
            there = (r + dr, c + dc)
            if int(grid.moves[r, c]) & (1 << k) and there not in seen:
                seen.add(there)
                queue.append(there)
    return False


def passable(task, grid):
    return reachable(grid, grid.cell_at(*task.start[:2]), grid.cell_at(*task.goal))


def coordinates(low=-5.0, high=5.0):
    return st.floats(low, high, allow_nan=False).map(lambda v: round(v, 4))


@st.composite
def worlds(draw, max_discs=6):
    discs = draw(
        st.lists(
            st.builds(Disc, coordinates(), coordinates(), st.floats(0.01, 2.0).map(lambda v: round(v, 4))),
            max_size=max_discs,
        )
    )
    return World("made up", (-5.0, -4.0, 5.0, 6.0), tuple(discs))


def rotation(roll, pitch, yaw):
    """The rotation matrix of roll, pitch and yaw about fixed axes, as a product of turns about one axis each."""
    turns = []
    for axis, angle in enumerate((roll, pitch, yaw)):
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = math.cos(angle)
        turn[j, i], turn[i, j] = math.sin(angle), -math.sin(angle)
        turns.append(turn)
    return turns[2] @ turns[1] @ turns[0]
