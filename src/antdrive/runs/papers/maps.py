"""The papers' maps. Where a paper only shows a picture, a random map of the same size and kind takes its place."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from antdrive.planners import PLANNERS, Query
from antdrive.worlds import Disc, Grid, World, rasterise

Picture = npt.NDArray[np.bool_]

#: The fourteen obstacles of han2007's ACO listing, radius 1, on points (1, 1) to (20, 20).
HAN_ANTS = (
    *((4, 6), (14, 12), (13, 11), (8, 10), (10, 10), (14, 10), (14, 4)),
    *((8, 14), (13, 14), (4, 10), (16, 14), (10, 16), (17, 10), (19, 18)),
)
#: Two walls of obstacles of radius 1 in the genetic algorithm's map, one from each side: no line with a single bend passes.
TWO_WALLS = tuple(
    [(6.0, y, 1.0) for y in (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0)]
    + [(14.0, y, 1.0) for y in (6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0)]
)
#: The six obstacles of its GA listing, radius 1, on points (0, 0) to (20, 20).
HAN_GENES = ((3, 3), (10, 10), (14, 10), (14, 4), (8, 14), (6, 18))


def optimum(query: Query) -> float:
    """The length of the shortest path with the same moves; inf if there is none."""
    return PLANNERS["astar"].plan(query, np.random.default_rng(0)).cost


def han_ants(*discs: tuple[float, float, float] | None) -> Query:
    """han2007's map for ants, in the thesis' units, for a point robot: with the listing's obstacles, or with others."""
    listed = discs or tuple((float(x), float(y), 1.0) for x, y in HAN_ANTS)
    found = tuple(Disc(*disc) for disc in listed if disc is not None)
    return Query(rasterise(World("han2007-aco", (0.5, 0.5, 20.5, 20.5), found), 1.0), (0, 0), (19, 19))


def han_genes(*discs: tuple[float, float, float]) -> Query:
    """han2007's map for the genetic algorithm, with the listing's obstacles or with `discs` (x, y, radius)."""
    found = discs or tuple((float(x), float(y), 1.0) for x, y in HAN_GENES)
    world = World("han2007-ga", (-0.5, -0.5, 20.5, 20.5), tuple(Disc(*disc) for disc in found))
    return Query(rasterise(world, 1.0), (0, 0), (20, 20))


def scattered(size: int, blocked: float, seed: int) -> Query:
    """A recreated map of size x size cells, each blocked with probability `blocked`, from corner to corner."""
    return _crossable(lambda rng: rng.random((size, size)) >= blocked, seed)


def blocks(rows: int, cols: int, count: int, largest: int, seed: int) -> Query:
    """A recreated map with `count` upright rectangles, each side 1 to `largest` cells, from corner to corner.

    The 3 x 3 cells at both corners are free.
    """

    def draw(rng: np.random.Generator) -> Picture:
        free = np.ones((rows, cols), dtype=np.bool_)
        for _ in range(count):
            height, width = rng.integers(1, largest + 1, 2)
            row, col = rng.integers(0, rows - height + 1), rng.integers(0, cols - width + 1)
            free[row : row + height, col : col + width] = False
        free[:3, :3] = free[-3:, -3:] = True
        return free

    return _crossable(draw, seed)


def environments() -> dict[str, Query]:
    """hasan's six environments of 50 x 50 cells, recreated from the paper's text, with its starts and goals."""
    row, col = np.mgrid[:50, :50]

    def arc(r: float, c: float, radius: float, opening: float, wide: float) -> Picture:
        angle = np.degrees(np.arctan2(row - r, col - c)) - opening
        shut = np.abs((angle + 180) % 360 - 180) > wide / 2
        return np.asarray((np.abs(np.hypot(row - r, col - c) - radius) < 0.8) & shut)

    def query(blocked: Picture, start: tuple[int, int], goal: tuple[int, int]) -> Query:
        free = ~blocked
        free[start] = free[goal] = True
        return Query(Grid.from_free(free), start, goal)

    vertical = np.zeros((50, 50), dtype=np.bool_)
    vertical[6:44, 8:48:8] = True
    vertical[20:26] = False
    rng = np.random.default_rng(5)
    shapes = np.zeros((50, 50), dtype=np.bool_)
    for _ in range(30):
        r, c = rng.integers(1, 45, 2)
        height, width = rng.integers(1, 5, 2)
        shapes[r : r + height, c : c + width] = True
    shapes[23:26] = False
    shapes[24, :47] = True
    curved = arc(5, 8, 18.6, 185, 170) | arc(38, 30, 7, 90, 90) | arc(36, 8, 6, 270, 90) | arc(14, 40, 6, 0, 90)
    overlapping = arc(2, 26, 11, 270, 220) | arc(34, 26, 16, 90, 220) | arc(36, 40, 6, 90, 90)
    circles = arc(24, 24, 6, 0, 40) | arc(24, 24, 12, 180, 30) | arc(24, 24, 18, 0, 25)
    return {
        "1a curved walls": query(curved, (13, 21), (17, 27)),
        "2b overlapping curved walls": query(overlapping, (8, 26), (24, 25)),
        "3c vertical rows": query(vertical, (49, 3), (0, 3)),
        "4d concentric circles": query(circles, (24, 24), (45, 38)),
        "5e many shapes": query(shapes, (4, 1), (48, 2)),
        "5f the same, across the wall": query(shapes, (23, 16), (25, 15)),
    }


def _crossable(draw: Callable[[np.random.Generator], Picture], seed: int) -> Query:
    """From corner to corner over the first map that `draw` gives on which there is a path."""
    rng = np.random.default_rng(seed)
    while True:
        free = draw(rng)
        free[0, 0] = free[-1, -1] = True
        query = Query(Grid.from_free(free), (0, 0), (free.shape[0] - 1, free.shape[1] - 1))
        if math.isfinite(optimum(query)):
            return query
