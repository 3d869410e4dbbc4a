"""Sampling oracle of outlines: distances in plain numpy, no shared code; worlds and outlines to compare on."""

import math

import numpy as np
from hypothesis import strategies as st

from antdrive.worlds.headings import Outline

#: Samples this close to touching decide nothing: rounding of either side could [m].
BAND = 1e-9
OUTLINES = {
    "rectangle": Outline(np.array([(0.5, -0.3), (0.5, 0.3), (-0.5, 0.3), (-0.5, -0.3)]), 0.03),
    "rectangle ahead of the axle": Outline(np.array([(0.6, -0.3), (0.6, 0.3), (-0.3, 0.3), (-0.3, -0.3)]), 0.03),
    "sharp rectangle": Outline(np.array([(0.7, -0.2), (0.7, 0.25), (-0.1, 0.25), (-0.1, -0.2)]), 0.0),
    "triangle": Outline(np.array([(0.5, 0.0), (-0.3, 0.35), (-0.3, -0.35)]), 0.05),
    "hexagon": Outline(0.4 * np.array([(np.cos(a), 0.8 * np.sin(a)) for a in np.arange(6) * np.pi / 3 + 0.2]), 0.1),
    "axle in the rounding": Outline(np.array([(0.4, -0.2), (0.4, 0.2), (0.05, 0.2), (0.05, -0.2)]), 0.15),
    "disc": Outline(np.array([(0.0, 0.0)]), 0.4),
    "disc off the axle": Outline(np.array([(0.2, 0.1)]), 0.35),
    "needle": Outline(np.array([(0.02, 0.0), (0.0, 0.02), (-0.02, 0.0), (0.0, -0.02)]), 0.01),
}


def gap(outline, x, y, yaw, discs, bounds, along=(0.0, 0.0)):
    """Distance of the outline at poses (N,), swept by `along`, from the nearest disc or wall, (N,); negative if it touches."""
    x, y, yaw = (np.atleast_1d(np.asarray(v, dtype=float))[:, None] for v in np.broadcast_arrays(x, y, yaw))
    cx, cy = outline.corners.T
    at = np.stack([x + np.cos(yaw) * cx - np.sin(yaw) * cy, y + np.sin(yaw) * cx + np.cos(yaw) * cy], axis=2)
    if any(along):
        at = np.array([hull(np.vstack([one, one + along])) for one in at])
    xmin, ymin, xmax, ymax = bounds
    room = np.minimum(at - (xmin, ymin), np.array((xmax, ymax)) - at).min(axis=(1, 2))
    after = np.roll(at, -1, axis=1)
    edge = (after - at)[:, None]
    to = discs[None, :, None, :2] - at[:, None]
    length2 = (edge**2).sum(-1)
    share = np.clip((to * edge).sum(-1) / np.where(length2 > 0, length2, 1.0), 0.0, 1.0)
    apart = np.linalg.norm(to - share[..., None] * edge, axis=-1).min(-1, initial=np.inf)
    cross = edge[..., 0] * to[..., 1] - edge[..., 1] * to[..., 0]
    inside = ((cross > 0) | (length2 == 0)).all(-1) if at.shape[1] > 2 else np.zeros(apart.shape, bool)
    least = np.where(inside, -1.0, apart - discs[:, 2]).min(-1, initial=np.inf)
    return np.minimum(room, least) - outline.reach


def hull(points):
    """Convex hull of points (N, 2), counter-clockwise, padded with its first corner to N rows (gift wrapping)."""
    found = [min(range(len(points)), key=lambda i: tuple(points[i]))]
    while True:
        here, best = found[-1], None
        for i, point in enumerate(points):
            if math.dist(point, points[here]) == 0:
                continue
            (ax, ay), (bx, by) = points[here if best is None else best] - points[here], point - points[here]
            turn = ax * by - ay * bx
            if (
                best is None
                or turn < -1e-15
                or (turn <= 1e-15 and math.dist(point, points[here]) > math.dist(points[best], points[here]))
            ):
                best = i
        if best is None or math.dist(points[best], points[found[0]]) == 0 or len(found) == len(points):
            break
        found.append(best)
    return points[found + [found[0]] * (len(points) - len(found))]


def sampled(outline, x, y, low, high, discs, bounds, steps=400):
    """The least gap of a turn between two headings, from samples, and a bound on how much smaller the true one is."""
    yaws = np.linspace(low, high, steps)
    size = np.hypot(*outline.corners.T).max()
    return gap(outline, x, y, yaws, discs, bounds).min(), size * abs(high - low) / (steps - 1)


def crowd(seed, count=40, size=6.0):
    """Discs (N, 3) and walls."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0, size, (count, 2)), rng.uniform(0.04, 0.3, count)]), (0.0, 0.0, size, size)


@st.composite
def outlines(draw):
    """Convex polygons around the origin, and discs around it."""
    reach = draw(st.floats(0.0, 0.3))
    if draw(st.booleans()) and reach > 0.01:
        far, direction = draw(st.floats(0.0, 0.95 * reach)), draw(st.floats(0.0, 6.28))
        return Outline(np.array([(far * math.cos(direction), far * math.sin(direction))]), reach)
    count = draw(st.integers(3, 8))
    first = draw(st.floats(0.0, 1.0))
    a, b = draw(st.floats(0.1, 0.8)), draw(st.floats(0.1, 0.8))
    angles = first + 2 * np.pi * np.arange(count) / count
    points = np.column_stack([a * np.cos(angles), b * np.sin(angles)])
    shift = 0.4 * points[draw(st.integers(0, count - 1))]  # the triangle's inner part contains the origin
    return Outline(points - shift * draw(st.floats(0.0, 1.0)), reach)
