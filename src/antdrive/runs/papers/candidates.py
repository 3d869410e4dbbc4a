"""Maps that exist as pictures only: what a printed length says about them, and random maps on which it is the shortest.

A path over square cells with eight moves measures a + b sqrt(2): a straight moves and b diagonal ones. A printed length of
three or four digits has one such pair or very few, so it tells how many moves of each kind the path has, whether it can be
monotone, and how far apart start and goal can be. A candidate is a random map of the paper's size on which the shortest
path has exactly the length that the paper's best planner printed. That length bounds the optimum of the paper's own map
from above; a candidate takes it as the optimum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.planners import PLANNERS, Query
from antdrive.worlds import DIRECTIONS, Grid

Picture = npt.NDArray[np.bool_]
SQRT2 = math.sqrt(2.0)
EQUAL = 1e-6  # lengths that differ by less are the same: two sums of moves differ by more for all lengths here
TRIES = 300  # obstacles tried before a map is begun anew
MAPS = 1000  # maps begun before a candidate is given up
MEANDERS = 200_000  # paths drawn before a winding candidate is given up
LEGS = (
    (1, 5),
    (3, 10),
)  # how many moves a winding path goes on in one direction, along an axis and aslant: at least, below
APART, LATER = 3, 6  # cells of a winding path that are `LATER` moves or more apart lie `APART` cells apart or more


@dataclass(frozen=True)
class MoveCount:
    """How many moves of each kind a path has."""

    straight: int  # of length 1
    diagonal: int  # of length sqrt(2)

    @property
    def length(self) -> float:
        """The length of the path [cells]."""
        return self.straight + SQRT2 * self.diagonal

    def monotone(self, rows: int, cols: int) -> bool:
        """Whether these moves can lead from start to goal without a move back, `rows` and `cols` cells apart."""
        return self.straight + 2 * self.diagonal == rows + cols and self.diagonal <= min(rows, cols)


def move_counts(printed: float, digits: int = 3) -> list[MoveCount]:
    """The moves that a printed length can stand for."""
    found = []
    for diagonal in range(int(printed / SQRT2) + 1):
        straight = round(printed - SQRT2 * diagonal)
        if abs(straight + SQRT2 * diagonal - printed) < 10.0**-digits:
            found.append(MoveCount(straight, diagonal))
    return found


def candidate(
    shape: tuple[int, int],
    start: tuple[int, int],
    goal: tuple[int, int],
    moves: MoveCount,
    seed: int,
    *,
    blocked: float = 0.0,
    blocks: int = 0,
    largest: int = 1,
    thin: bool = False,
    walls: int = 0,
) -> Query:
    """A random map on which the shortest path has as many straight and diagonal moves as `moves` says.

    It begins with random obstacles; then further ones are put onto the shortest path, as long as it does not become longer
    than wanted, until it is as long as wanted.

    Raises:
        FieldError: no such map was found.
    """
    rng = np.random.default_rng(seed)
    for _ in range(MAPS):
        free = rng.random(shape) >= blocked
        for row in rng.choice(np.arange(3, shape[0] - 3), walls, replace=False):
            opening = int(rng.integers(shape[1] - 1))
            free[row] = False
            free[row, opening : opening + 2] = True
        for _ in range(blocks):
            _put(rng, free, rng.integers(0, shape), largest, thin)
        _clear_ends(free, start, goal)
        found = _lengthened(rng, free, start, goal, moves.length, largest, thin)
        if found is not None:
            return found
    raise FieldError("moves", f"no map of {shape[0]} x {shape[1]} cells was found whose shortest path has {moves}")


def winding_candidate(shape: tuple[int, int], moves: MoveCount, seed: int, *, largest: int) -> Query:
    """A random map whose shortest path has these moves and winds: a length for which no way can be monotone.

    A path of the wanted moves is drawn first, and start and goal are its ends. Walls are then put across every way that
    is shorter, and never onto the path, until none is left.

    Raises:
        FieldError: no such map was found.
    """
    rng = np.random.default_rng(seed)
    for _ in range(MEANDERS):
        cells = _meander(rng, shape, moves)
        if cells is not None:
            query = _walled(rng, shape, cells, moves.length, largest)
            if query is not None:
                return query
    raise FieldError(
        "moves", f"no map of {shape[0]} x {shape[1]} cells was found whose shortest path winds with {moves}"
    )


def _meander(rng: np.random.Generator, shape: tuple[int, int], moves: MoveCount) -> npt.NDArray[np.int64] | None:
    """The cells (N, 2) of a random path over these moves; None if it does not fit or comes near itself."""
    left, way = [moves.straight, moves.diagonal], int(rng.integers(8))
    steps: list[tuple[int, int]] = []
    while any(left):
        aslant = way & 1
        count = min(left[aslant], int(rng.integers(*LEGS[aslant])))
        if not count:
            return None
        steps += [DIRECTIONS[way]] * count
        left[aslant] -= count
        # Where two diagonal moves meet at a right angle, two straight ones lead past the cell between them.
        way = (way + int(rng.choice((-1, 1) if aslant else (-2, -1, 1, 2)))) % 8
    cells = np.vstack([(0, 0), steps]).cumsum(axis=0)
    cells -= cells.min(axis=0)
    room = np.array(shape) - cells.max(axis=0)
    if (room < 1).any():
        return None
    cells += rng.integers(0, room)
    distance = np.abs(cells[:, None] - cells).max(axis=2)
    return None if (distance[np.triu_indices(len(cells), LATER)] < APART).any() else cells


def _walled(
    rng: np.random.Generator, shape: tuple[int, int], cells: npt.NDArray[np.int64], length: float, largest: int
) -> Query | None:
    """Walls across all ways that are shorter than a path; None if some cannot be closed."""
    kept = np.zeros(shape, dtype=np.bool_)
    kept[tuple(cells.T)] = True
    kept[cells[:-1, 0], cells[1:, 1]] = kept[cells[1:, 0], cells[:-1, 1]] = True  # a diagonal move needs both corners
    free = np.ones(shape, dtype=np.bool_)
    start, goal = (int(cells[0, 0]), int(cells[0, 1])), (int(cells[-1, 0]), int(cells[-1, 1]))
    while True:
        query, path, shortest = _solved(free, start, goal)
        if shortest > length - EQUAL:
            return query
        others = path[~kept[tuple(path.T)]]
        if not len(others):
            return None
        _put(rng, free, others[rng.integers(len(others))], largest, thin=True)
        free |= kept


def _lengthened(
    rng: np.random.Generator,
    free: Picture,
    start: tuple[int, int],
    goal: tuple[int, int],
    length: float,
    largest: int,
    thin: bool,
) -> Query | None:
    """The map with more obstacles, such that the shortest path has this length; None if that was not achieved."""
    query, cells, shortest = _solved(free, start, goal)
    for _ in range(TRIES):
        if shortest > length + EQUAL:
            return None
        if shortest > length - EQUAL:
            return query
        changed = free.copy()
        near = length - shortest < 2.0  # a large obstacle would overshoot
        _put(rng, changed, cells[rng.integers(len(cells))], 1 if near else largest, thin)
        _clear_ends(changed, start, goal)
        tried = _solved(changed, start, goal)
        if tried[2] <= length + EQUAL:
            free, (query, cells, shortest) = changed, tried
    return None


def _solved(free: Picture, start: tuple[int, int], goal: tuple[int, int]) -> tuple[Query, npt.NDArray[np.int32], float]:
    """The query of a map, a shortest path and its length, inf if there is none."""
    query = Query(Grid.from_free(free), start, goal)
    plan = PLANNERS["astar"].plan(query, np.random.default_rng(0))
    return query, plan.cells, plan.cost


def _put(rng: np.random.Generator, free: Picture, cell: npt.NDArray[np.integer], largest: int, thin: bool) -> None:
    """Block a rectangle with sides of 1 to `largest` cells that covers a cell; a thin one is a wall of one cell's width."""
    height, width = (int(side) for side in rng.integers(1, largest + 1, 2))
    if thin:
        height, width = (1, width) if rng.random() < 0.5 else (height, 1)
    row, col = int(cell[0]) - int(rng.integers(height)), int(cell[1]) - int(rng.integers(width))
    free[max(0, row) : row + height, max(0, col) : col + width] = False


def _clear_ends(free: Picture, *ends: tuple[int, int]) -> None:
    """Free the cells around both ends."""
    for row, col in ends:
        free[max(0, row - 1) : row + 2, max(0, col - 1) : col + 2] = True
