"""Grids and queries for tests of planners, and an independent oracle."""

import dataclasses
import heapq
import math

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from antdrive.planners import PLANNERS, Query, load_planner
from antdrive.worlds import DIRECTIONS, Disc, Grid, Task, World, rasterise


def optimum(query):
    """Return the length of the shortest path [m], inf if there is none, by a plain Dijkstra."""
    moves = query.grid.moves
    best, queue = {query.start: 0.0}, [(0.0, query.start)]
    while queue:
        g, cell = heapq.heappop(queue)
        if cell == query.goal:
            return g * query.grid.cell
        if g > best[cell]:
            continue
        for k, (dr, dc) in enumerate(DIRECTIONS):
            if int(moves[cell]) >> k & 1:
                near = cell[0] + dr, cell[1] + dc
                reached = g + math.hypot(dr, dc)
                if reached < best.get(near, math.inf):
                    best[near] = reached
                    heapq.heappush(queue, (reached, near))
    return math.inf


def optimum_by_scipy(query):
    """Return the length of the shortest path by scipy, for grids too large for `optimum`."""
    rows, cols = query.grid.shape
    moves = query.grid.moves
    links = []
    for k, (dr, dc) in enumerate(DIRECTIONS):
        r, c = np.nonzero(moves >> k & 1)
        links.append((r * cols + c, (r + dr) * cols + c + dc, np.full(len(r), math.hypot(dr, dc))))
    origin, target, length = (np.concatenate(part) for part in zip(*links, strict=True))
    graph = csr_matrix((length, (origin, target)), shape=(rows * cols, rows * cols))
    reached = dijkstra(graph, indices=query.start[0] * cols + query.start[1])
    return float(reached[query.goal[0] * cols + query.goal[1]]) * query.grid.cell


def thinned(rng, side, cut):
    """Return a grid with arbitrary moves: each bidirectional move is removed with probability `cut`."""
    picture = Grid.from_free(rng.random((side, side)) >= 0.05)
    moves = picture.moves.copy()
    for k, (dr, dc) in enumerate(DIRECTIONS[:4]):
        r, c = np.nonzero((moves >> k & 1 == 1) & (rng.random(moves.shape) < cut))
        moves[r, c] &= np.uint8(255 - (1 << k))
        moves[r + dr, c + dc] &= np.uint8(255 - (1 << (k + 4)))
    moves.setflags(write=False)  # as a grid's: kernels are compiled for that
    ends = rng.choice(np.argwhere(picture.free), size=2)
    return Query(Grid(picture.free, moves), *(tuple(map(int, end)) for end in ends))


def random_query(rng, largest=24):
    """Draw a query with random blocked cells and two random free ends; some have no path."""
    shape = rng.integers(1, largest, size=2)
    free = rng.random(shape) >= rng.uniform(0.0, 0.5)
    free[tuple(shape // 2)] = True
    ends = rng.choice(np.argwhere(free), size=2)
    return Query(Grid.from_free(free, cell=0.5), *(tuple(map(int, end)) for end in ends))


def random_discs(rng, count=14):
    """Draw a query among random discs, which may also close moves between free cells."""
    discs = tuple(Disc(*rng.uniform(0, 10, 2), rng.uniform(0.05, 0.9)) for _ in range(count))
    grid = rasterise(World("random", (0, 0, 10, 10), discs), 0.5, rng.uniform(0, 0.4))
    free = np.argwhere(grid.free)
    if not len(free):
        return Query(Grid.from_free(np.ones((2, 2))), (0, 0), (1, 1))
    ends = rng.choice(free, size=2)
    return Query(grid, *(tuple(map(int, end)) for end in ends))


def _wall(x0, y0, x1, y1):
    count = max(2, int(math.hypot(x1 - x0, y1 - y0) / 0.3) + 1)
    return [
        Disc(float(x), float(y), 0.2)
        for x, y in zip(np.linspace(x0, x1, count), np.linspace(y0, y1, count), strict=True)
    ]


def _query(size, discs, start, goal):
    task = Task(World("test", (0, 0, size, size), tuple(discs)), (*start, 0.0), goal)
    return Query.between(rasterise(task.world, 0.5, 0.25), task)


def _forest():
    rng, discs = np.random.default_rng(3), []
    while len(discs) < 40:
        x, y = rng.uniform(0, 10, 2)
        if min(math.hypot(x - 1, y - 1), math.hypot(x - 9, y - 9)) > 1.3:
            discs.append(Disc(float(x), float(y), float(rng.uniform(0.15, 0.4))))
    return discs


def catalogue():
    """Return small worlds, each with one difficulty; all have a path."""
    corner, far = (1.0, 1.0), (9.0, 9.0)
    slalom = _wall(2.5, 0, 2.5, 7) + _wall(5, 3, 5, 10) + _wall(7.5, 0, 7.5, 7)
    gate = _wall(5, 0, 5, 1) + _wall(5, 2.5, 5, 10)
    trap = _wall(3, 2, 7, 2) + _wall(7, 2, 7, 8) + _wall(3, 8, 7, 8)
    return {
        "empty": _query(10, [], corner, far),
        "slalom": _query(10, slalom, corner, far),
        "gate": _query(10, gate, (1.0, 8.0), (9.0, 8.0)),
        "trap": _query(10, trap, (4.0, 5.0), (9.0, 5.0)),
        "forest": _query(10, _forest(), corner, far),
    }


def quick(name, **budget):
    """Return the planner with a budget small enough for a test, if it has a budget."""
    known = {f.name for f in dataclasses.fields(PLANNERS[name])}
    return load_planner(name, **{key: value for key, value in budget.items() if key in known})


def sealed():
    """Return a query with the goal behind a closed wall."""
    free = np.ones((8, 8), dtype=np.bool_)
    free[:, 4] = False
    return Query(Grid.from_free(free), (1, 1), (6, 6))
