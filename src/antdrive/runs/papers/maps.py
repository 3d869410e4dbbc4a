"""Maps of the papers. Random maps replace pictured ones: of the same size and kind, or candidates.

A path over square cells with eight moves measures a + b sqrt(2), with a straight and b diagonal moves. A printed length of
three or four digits has one such pair or very few. It determines the number of moves of each kind, whether the path can
be monotone, and how far apart start and goal can be. A candidate is a random map of the paper's size whose shortest path
is exactly as long as the paper's best. That length is an upper bound of the optimum on the paper's own map.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.planners import PLANNERS, Query
from antdrive.planners.colonies.mmas_dstar import closed_gates
from antdrive.worlds import DIRECTIONS, Disc, Grid, Task, World, load_task, rasterise

Circle: TypeAlias = tuple[float, float, float]  # x, y, radius
#: The fourteen obstacles of han2007's ACO listing, radius 1, on points (1, 1) to (20, 20).
HAN_ANTS = (
    *((4, 6), (14, 12), (13, 11), (8, 10), (10, 10), (14, 10), (14, 4)),
    *((8, 14), (13, 14), (4, 10), (16, 14), (10, 16), (17, 10), (19, 18)),
)
#: Two walls of obstacles of radius 1 for the genetic algorithm, one from each side; one bend does not suffice.
TWO_WALLS = tuple(
    [(6.0, y, 1.0) for y in (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0)]
    + [(14.0, y, 1.0) for y in (6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0)]
)
#: The six obstacles of its GA listing, radius 1, on points (0, 0) to (20, 20).
HAN_GENES = ((3, 3), (10, 10), (14, 10), (14, 4), (8, 14), (6, 18))


def optimum(query: Query) -> float:
    """Return the length of the shortest path with the same moves; inf if there is none."""
    return PLANNERS["astar"].plan(query, np.random.default_rng(0)).cost


def cutting_corners(query: Query) -> Query:
    """Return a query with moves to every free neighbour of eight, also diagonally past blocked cells."""
    free, padded = query.grid.free, np.pad(query.grid.free, 1)
    moves = np.zeros(free.shape, dtype=np.uint8)
    for bit, (row, col) in enumerate(DIRECTIONS):
        ahead = padded[1 + row : 1 + row + free.shape[0], 1 + col : 1 + col + free.shape[1]]
        moves |= (free & ahead).astype(np.uint8) << np.uint8(bit)
    return _with_moves(query, moves)


def closing_gates(query: Query) -> Query:
    """Return a query whose gate cells, between two diagonally opposite blocked ones, no move enters, as hasan closes them."""
    return _with_moves(query, closed_gates(query)[0])


def _with_moves(query: Query, moves: npt.NDArray[np.uint8]) -> Query:
    moves.setflags(write=False)
    return dataclasses.replace(query, grid=dataclasses.replace(query.grid, moves=moves))


def han_ants(*discs: Circle | None, circles: bool = False) -> Query:
    """Return han2007's map for ants and a point robot, in the thesis' units, with its obstacles or with `discs`."""
    listed = discs or tuple((float(x), float(y), 1.0) for x, y in HAN_ANTS)
    return _han("han2007-aco", 1, tuple(Disc(*disc) for disc in listed if disc is not None), circles)


def han_genes(*discs: Circle, circles: bool = False) -> Query:
    """Return han2007's map for the genetic algorithm, with its obstacles or with `discs` (x, y, radius)."""
    obstacles = discs or tuple((float(x), float(y), 1.0) for x, y in HAN_GENES)
    return _han("han2007-ga", 0, tuple(Disc(*disc) for disc in obstacles), circles)


def _han(name: str, first: int, discs: tuple[Disc, ...], circles: bool) -> Query:
    """Return a query from (first, first) to (20, 20); straight lines avoid blocked cells or, with `circles`, the discs."""
    world = World(name, (first - 0.5, first - 0.5, 20.5, 20.5), discs)
    grid = rasterise(world, 1.0)
    if circles:
        return Query.between(grid, Task(world, (float(first), float(first), 0.0), (20.0, 20.0), cell=1.0))
    return Query(grid, (0, 0), (20 - first, 20 - first))


def han_scattered(count: int, seed: int, across: bool | None = None) -> tuple[Circle, ...]:
    """Draw han2007's obstacles of radius 1 (section 3): grid points at least 5 from start and goal, without repetition.

    With `across`, all or none of them touch the line from (0, 0) to (20, 20).
    """
    points = [(float(x), float(y)) for x in range(21) for y in range(21)]
    allowed = [
        (x, y, 1.0)
        for x, y in points
        if min(math.hypot(x, y), math.hypot(x - 20, y - 20)) >= 5
        and (across is None or (abs(x - y) <= SQRT2) == across)
    ]
    return tuple(allowed[i] for i in np.random.default_rng(seed).permutation(len(allowed))[:count])


def scattered(size: int, blocked: float, seed: int) -> Query:
    """Recreate a map of size x size cells, each blocked with probability `blocked`, from corner to corner."""
    return _crossable(lambda rng: rng.random((size, size)) >= blocked, seed)


def blocks(rows: int, cols: int, count: int, largest: int, seed: int) -> Query:
    """Recreate a map with `count` upright rectangles, each side 1 to `largest` cells, from corner to corner.

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
    """Return hasan's six environments of 50 x 50 cells as the catalogue's worlds have them, drawn from the paper's text."""
    queries = {}
    for name in HASAN:
        task = load_task(f"hasan-{name.split()[0]}")
        grid = rasterise(task.world, task.cell)
        queries[name] = Query(Grid.from_free(grid.free), grid.cell_at(*task.start[:2]), grid.cell_at(*task.goal))
    return queries


class Printed(NamedTuple):
    """What hasan's Table 1 prints of an environment that determines its walls."""

    ends: tuple[tuple[int, int], tuple[int, int]]  # start and goal
    steps: int  # of the ant's path
    gates: int  # closed cells


#: Hasan's environments. Table 1 prints column.row; a one-digit row may carry a zero: 26.80 is row 8 of 50. So 1.40 is row
#: 4, as the start lies in the "upper left corner" (l. 231).
HASAN: Mapping[str, Printed] = MappingProxyType(
    {
        "1a curved walls": Printed(((13, 21), (17, 27)), 65, 1),
        "2b overlapping curved walls": Printed(((8, 26), (24, 25)), 43, 2),
        "3c vertical rows": Printed(((49, 3), (0, 3)), 49, 0),
        "4d concentric circles": Printed(((24, 24), (45, 38)), 64, 2),
        "5e many shapes": Printed(((4, 1), (48, 2)), 91, 3),
        "5f the same, across the wall": Printed(((23, 16), (25, 15)), 66, 3),
    }
)
ROWS, COLS = np.ogrid[:50, :50]
STEPS_NEAR = 0.1  # relative deviation of a candidate's shortest path from the printed steps


@functools.cache
def environment(name: str, seed: int) -> Query:
    """Return a random candidate for one of hasan's environments, its gates open.

    Walls are drawn by the sentence on the environment (l. 227-231) until start and goal are free, no more gate cells than the
    printed ones are closed, and the shortest path has the printed steps within `STEPS_NEAR`. 5e and 5f are the same
    environment, so both must.
    """
    rng = np.random.default_rng([ord(name[0]), seed])
    alike = [one for one in HASAN if one[0] == name[0]]
    for _ in range(DRAWS):
        picture = DRAWN[name[0]](rng)
        if any(picture[end] for one in alike for end in HASAN[one].ends):
            continue
        queries = {one: _between(picture, *HASAN[one].ends) for one in alike}
        if all(_as_printed(query, HASAN[one]) for one, query in queries.items()):
            return queries[name]
    raise FieldError("name", f"no candidate found for {name}")


def _as_printed(query: Query, printed: Printed) -> bool:
    if closed_gates(query)[1] > printed.gates:
        return False
    steps = len(PLANNERS["astar"].plan(closing_gates(query), np.random.default_rng(0)).cells) - 1
    return abs(steps - printed.steps) <= STEPS_NEAR * printed.steps


def _between(blocked: Picture, start: tuple[int, int], goal: tuple[int, int]) -> Query:
    free = ~blocked
    free[start] = free[goal] = True
    return Query(Grid.from_free(free), start, goal)


def _arc(r: float, c: float, radius: float, opening: float, wide: float) -> Picture:
    """Return a wall of 50 x 50 cells along a circle with an opening of `wide` degrees in the direction `opening`."""
    blocked = np.zeros((50, 50), dtype=np.bool_)
    # Within 0.8 of the circle, without roots.
    row, col = np.nonzero(np.abs((ROWS - r) ** 2 + (COLS - c) ** 2 - radius**2 - 0.64) < 1.6 * radius)
    angle = np.degrees(np.arctan2(row - r, col - c)) - opening
    blocked[row, col] = np.abs((angle + 180) % 360 - 180) > wide / 2
    return blocked


def _curves(rng: np.random.Generator) -> Picture:
    """Draw two to six arcs: "curve shapes", some "open from different directions"."""
    drawn = rng.uniform((0, 0, 5, 0, 60), (50, 50, 20, 360, 200), (rng.integers(2, 7), 5))
    return np.asarray(np.any([_arc(*arc) for arc in drawn.tolist()], axis=0))


def _circles(rng: np.random.Generator) -> Picture:
    """Draw three to six circles around the start: "circular sequence shapes", some "open from different positions"."""
    gaps, openings, widths = rng.uniform((3, 0, 10), (8, 360, 60), (rng.integers(3, 7), 3)).T
    circles = [_arc(24, 24, *one) for one in zip(np.cumsum(gaps), openings, widths, strict=True)]
    return np.asarray(np.any(circles, axis=0))


def _rows(rng: np.random.Generator) -> Picture:
    """Draw upright walls with openings: a "vertical sequence of obstacles" and a "big area of free space"."""
    blocked = np.zeros((50, 50), dtype=np.bool_)
    for col in range(int(rng.integers(1, 6)), 50, int(rng.integers(5, 10))):
        top, bottom = np.sort(rng.integers(2, 48, 2))
        blocked[top:bottom, col] = True
        opening = int(rng.integers(2, 44))
        blocked[opening : opening + 6, col] = False
    return blocked


def _shapes(rng: np.random.Generator) -> Picture:
    """Draw rectangles and a wall across the middle, closed on the left and open on the right."""
    blocked = np.zeros((50, 50), dtype=np.bool_)
    for _ in range(30):
        (r, c), (height, width) = rng.integers(1, 45, 2), rng.integers(1, 5, 2)
        if not blocked[max(0, r - 1) : r + height + 1, max(0, c - 1) : c + width + 1].any():
            blocked[r : r + height, c : c + width] = True
    blocked[23:26] = False
    blocked[24, : 50 - int(rng.integers(2, 9))] = True
    return blocked


#: How the walls of hasan's environments 1 to 5 are drawn, and how often at most.
DRAWN = MappingProxyType({"1": _curves, "2": _curves, "3": _rows, "4": _circles, "5": _shapes})
DRAWS = 100_000


def _crossable(draw: Callable[[np.random.Generator], Picture], seed: int) -> Query:
    """Return a query from corner to corner on the first map drawn that has a path."""
    rng = np.random.default_rng(seed)
    while True:
        free = draw(rng)
        free[0, 0] = free[-1, -1] = True
        query = Query(Grid.from_free(free), (0, 0), (free.shape[0] - 1, free.shape[1] - 1))
        if math.isfinite(optimum(query)):
            return query


Picture = npt.NDArray[np.bool_]
SQRT2 = math.sqrt(2.0)
EQUAL = 1e-6  # tolerance of lengths; distinct sums of moves differ by more for all lengths here
TRIES = 300  # obstacles tried per map
MAPS = 1000  # maps tried per candidate
MEANDERS = 200_000  # paths drawn per winding candidate
LEGS = (
    (1, 5),
    (3, 10),
)  # lengths of a winding path's legs, straight and diagonal: from, to (exclusive) [moves]
APART, LATER = 3, 6  # cells of a winding path at least `LATER` moves apart are at least `APART` cells apart


@dataclass(frozen=True)
class MoveCount:
    """Number of moves of each kind in a path."""

    straight: int  # of length 1
    diagonal: int  # of length sqrt(2)

    @property
    def length(self) -> float:
        """The length of the path [cells]."""
        return self.straight + SQRT2 * self.diagonal

    def monotone(self, rows: int, cols: int) -> bool:
        """Return whether a monotone path over `rows` and `cols` can have these moves."""
        return self.straight + 2 * self.diagonal == rows + cols and self.diagonal <= min(rows, cols)


@functools.cache
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
    margin: int = 1,
    obstacles: int | None = None,
) -> Query:
    """Return a random map whose shortest path has the given straight and diagonal moves, made once per process.

    It begins with random obstacles. Further ones are put onto the shortest path until it has, but never exceeds, the
    wanted length. Obstacles keep `margin` free cells from start and goal. With `obstacles`, the map has exactly this
    number of separate ones, as `separate_obstacles` counts them.
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
        _clear_ends(free, start, goal, margin=margin)
        query = _lengthened(rng, free, start, goal, moves.length, largest, thin, margin)
        if query is not None and obstacles in (None, separate_obstacles(query.grid.free)):
            return query
    raise FieldError("moves", f"no map of {shape[0]} x {shape[1]} cells found whose shortest path has {moves}")


def winding_candidate(shape: tuple[int, int], moves: MoveCount, seed: int, *, largest: int) -> Query:
    """Return a random map whose shortest path has these moves and winds, as it is too long for a monotone one.

    A path with these moves is drawn first, and its ends are start and goal. Walls then close every shorter path, without
    touching the drawn one.
    """
    rng = np.random.default_rng(seed)
    for _ in range(MEANDERS):
        cells = _meander(rng, shape, moves)
        if cells is not None:
            query = _walled(rng, shape, cells, moves.length, largest)
            if query is not None:
                return query
    raise FieldError("moves", f"no map of {shape[0]} x {shape[1]} cells found whose shortest path winds with {moves}")


def _meander(rng: np.random.Generator, shape: tuple[int, int], moves: MoveCount) -> npt.NDArray[np.int64] | None:
    """Draw the cells (N, 2) of a random path with these moves; None if it does not fit or comes near itself."""
    left, way = [moves.straight, moves.diagonal], int(rng.integers(8))
    steps: list[tuple[int, int]] = []
    while any(left):
        aslant = way & 1
        count = min(left[aslant], int(rng.integers(*LEGS[aslant])))
        if not count:
            return None
        steps += [DIRECTIONS[way]] * count
        left[aslant] -= count
        # Where two diagonal moves meet at a right angle, two straight ones would pass the cell between them.
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
    """Put walls across all paths shorter than a given one; None if some cannot be closed."""
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
    margin: int,
) -> Query | None:
    """Add obstacles until the shortest path has this length; None if that fails."""
    query, cells, shortest = _solved(free, start, goal)
    for _ in range(TRIES):
        if shortest > length + EQUAL:
            return None
        if shortest > length - EQUAL:
            return query
        changed = free.copy()
        near = length - shortest < 2.0  # a large obstacle would overshoot
        _put(rng, changed, cells[rng.integers(len(cells))], 1 if near else largest, thin)
        _clear_ends(changed, start, goal, margin=margin)
        tried = _solved(changed, start, goal)
        if tried[2] <= length + EQUAL:
            free, (query, cells, shortest) = changed, tried
    return None


def _solved(free: Picture, start: tuple[int, int], goal: tuple[int, int]) -> tuple[Query, npt.NDArray[np.int32], float]:
    """Return the query of a map, a shortest path and its length; inf if there is none."""
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


def _clear_ends(free: Picture, *ends: tuple[int, int], margin: int) -> None:
    """Free the cells around both ends, up to `margin` cells away."""
    for row, col in ends:
        free[max(0, row - margin) : row + margin + 1, max(0, col - margin) : col + margin + 1] = True


def separate_obstacles(free: Picture) -> int:
    """Return the number of obstacles of a map: groups of blocked cells that touch by a side or a corner."""
    left, count = {(int(row), int(col)) for row, col in np.argwhere(~free)}, 0
    while left:
        count, group = count + 1, [left.pop()]
        for row, col in group:
            near = {(row + dr, col + dc) for dr, dc in DIRECTIONS} & left
            left -= near
            group += near
    return count
