"""Independent oracle for replanners: scipy's Dijkstra on a graph built here."""

import math

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from antdrive.planners import validate_plan
from antdrive.worlds import Grid

HALF = {0: (0, 1), 1: (1, 1), 2: (1, 0), 3: (1, -1)}  # bit: (row, column); each bidirectional move once


def ends(shape, dr, dc):
    """Return the start and end cells of a move, for all cells at once."""
    rows, cols = shape
    here = (slice(0, rows - dr), slice(max(0, -dc), cols - max(0, dc)))
    there = (slice(dr, rows), slice(max(0, dc), cols - max(0, -dc)))
    return here, there


def pictured(free):
    """Return the moves between free cells, by direction."""
    able = {}
    for k, (dr, dc) in HALF.items():
        here, there = ends(free.shape, dr, dc)
        able[k] = free[here] & free[there] & free[there[0], here[1]] & free[here[0], there[1]]
    return able


class World:
    """Free cells and closed moves, tracked by the test."""

    def __init__(self, grid):
        self.reset(grid)

    def reset(self, grid):
        self.cell, self.free = grid.cell, grid.free.copy()
        self.closed = {}
        for k, able in pictured(self.free).items():
            here, _ = ends(grid.shape, *HALF[k])
            self.closed[k] = able & ((grid.moves[here] >> k & 1) == 0)

    def optimum(self, start, goal):
        if not (self.free[start] and self.free[goal]):
            return math.inf
        index = np.arange(self.free.size).reshape(self.free.shape)
        a, b, w = [], [], []
        for k, able in pictured(self.free).items():
            here, there = ends(self.free.shape, *HALF[k])
            yes = able & ~self.closed[k]
            a.append(index[here][yes])
            b.append(index[there][yes])
            w.append(np.full(yes.sum(), math.hypot(*HALF[k])))
        graph = coo_array((np.concatenate(w), (np.concatenate(a), np.concatenate(b))), shape=(self.free.size,) * 2)
        return self.cell * float(dijkstra(graph.tocsr(), directed=False, indices=index[start])[index[goal]])


def agree(replanner, world):
    """Assert that the result is a path of the oracle's length; returns whether there is one."""
    query, result = replanner.query, replanner.result()
    floor = world.optimum(query.start, query.goal)
    assert result.solved == math.isfinite(floor)
    if not result.solved:
        assert result.reason
        return False
    assert abs(result.cost - floor) < 1e-9
    assert validate_plan(query, result) == ""
    return True


def change_at_random(make, query, rng, turns):
    """Report random changes to a replanner and compare it with the oracle after each; returns the number of paths."""
    world, replanner = World(query.grid), make(query)
    shape = query.grid.shape
    solved = 0
    for _ in range(turns):
        solved += agree(replanner, world)
        for _ in range(rng.integers(1, 3)):  # sometimes several changes between two results
            cells = rng.integers(0, shape, (int(rng.integers(0, 6)), 2))
            what = rng.random()
            if what < 0.45:
                replanner.block(cells)
                world.free[tuple(cells.T)] = False
            elif what < 0.92:
                replanner.clear(cells)
                world.free[tuple(cells.T)] = True
            else:
                grid = Grid.from_free(rng.random(shape) < rng.uniform(0.5, 1.0), cell=query.grid.cell)
                replanner.change(grid)
                world.reset(grid)
        path = replanner.result().cells if rng.random() < 0.5 else []
        if len(path) and rng.random() < 0.7:  # along the path
            replanner.move(tuple(map(int, path[min(len(path) - 1, int(rng.integers(0, 4)))])))
        elif rng.random() < 0.3:  # moved off the path
            replanner.move((int(rng.integers(0, shape[0])), int(rng.integers(0, shape[1]))))
    return solved
