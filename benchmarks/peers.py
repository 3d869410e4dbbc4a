"""Speed of `astar` relative to other libraries' A*: `python -m benchmarks.peers [--archive FILE]`.

Needs the extra `peers`, best in a separate environment. FILE is a .tar.xz with the MovingAI maps in `MOVINGAI` and their
problems. Solvers alternate on the same grids and queries within one run, so ratios are comparable where times are not. Each
path is checked against the solver's own corner rule and the optimum under it, by scipy. Ratios are peer time over `astar`
time. Prints Markdown.
"""

from __future__ import annotations

import math
import statistics
import tarfile
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.planners import Query, load_planner
from antdrive.worlds import Disc, Grid, World, rasterise
from antdrive.worlds.formats.movingai import import_movingai_map, import_movingai_problems
from benchmarks.markdown import command_line, missing, print_table
from tools.shared_data import MOVINGAI as ARCHIVE

try:
    import nano_astar
    import pyastar2d
    import python_motion_planning as pmp
    import scipy.sparse
    import tcod.path
    from w9_pathfinding.envs import DiagonalMovement
    from w9_pathfinding.envs import Grid as W9Grid
    from w9_pathfinding.pf import AStar as W9AStar
except ImportError as error:
    missing(f"{error}: the extra `peers` brings what is measured against")

Cell = tuple[int, int]
Solve = Callable[[Cell, Cell], Any]  # the peer's own kind of path

MOVINGAI = {"512² game (AR0011SR)": "AR0011SR", "512² random 25 %": "random512-25-0", "512² maze": "maze512-8-0"}
TURNS = 5
SMALLEST = ("--queries 1 --fresh 1",)
RNG = np.random.default_rng(0)
ROOT2 = math.sqrt(2.0)


@dataclass(frozen=True)
class Solver:
    """A library's A*: `prepare` takes a picture of free cells and gives the function that is timed."""

    name: str
    prepare: Callable[[Any], Solve]
    cells: Callable[[Any], Any] = lambda path: path  # its path as (row, col)
    cuts: bool = False  # whether diagonals may cut corners
    diagonal: float = ROOT2  # what it takes a diagonal to cost
    largest: int = 512


def antdrive(free: Any) -> Solve:
    grid, planner = Grid.from_free(free), load_planner("astar")
    return lambda start, goal: planner.plan(Query(grid, start, goal), RNG).cells


def nano(free: Any) -> Solve:
    blocked = np.ascontiguousarray(~free).astype(np.uint8)
    return lambda start, goal: nano_astar.astar(blocked, start, goal)[0]


def w9(free: Any) -> Solve:
    weights = np.where(free, 1.0, -1.0).tolist()
    rule = DiagonalMovement.only_when_no_obstacle
    finder = W9AStar(W9Grid(weights, diagonal_movement=rule, diagonal_movement_cost_multiplier=ROOT2))
    return lambda start, goal: finder.find_path(start[::-1], goal[::-1])


def tcod_graph(free: Any) -> Solve:
    cost = free.astype(np.int8)
    graph = tcod.path.CustomGraph(free.shape)
    room = np.pad(cost, 1)
    for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
        graph.add_edge((dr, dc), 70, cost=cost)
    for dr, dc in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        rows, cols = free.shape
        beside = room[1 + dr : 1 + dr + rows, 1:-1] & room[1:-1, 1 + dc : 1 + dc + cols]
        graph.add_edge((dr, dc), 99, cost=cost, condition=beside)
    graph.set_heuristic(cardinal=70, diagonal=99)

    def solve(start: Cell, goal: Cell) -> Any:
        finder = tcod.path.Pathfinder(graph)
        finder.add_root(start)
        return finder.path_to(goal)

    return solve


def tcod_astar(free: Any) -> Solve:
    finder = tcod.path.AStar(free.astype(np.int8), diagonal=ROOT2)
    return lambda start, goal: [start, *finder.get_path(*start, *goal)]


def pyastar(free: Any) -> Solve:
    weights = np.where(free, 1.0, np.inf).astype(np.float32)
    return lambda start, goal: pyastar2d.astar_path(weights, start, goal, allow_diagonal=True)


def motion_planning(free: Any) -> Solve:
    rows, cols = free.shape
    env = pmp.Grid(cols + 2, rows + 2)  # it walls its own border
    env.update(env.obstacles | {(int(c) + 1, int(r) + 1) for r, c in np.argwhere(~free)})
    inside = [(c + 1, r + 1) for r in range(rows) for c in range(cols)]
    assert not any(cell in env.obstacles for cell, ok in zip(inside, free.ravel(), strict=True) if ok)

    def solve(start: Cell, goal: Cell) -> Any:
        return pmp.AStar((start[1] + 1, start[0] + 1), (goal[1] + 1, goal[0] + 1), env).plan()[1]

    return solve


SOLVERS = (
    Solver("antdrive `astar`", antdrive),
    Solver("nano-astar 0.1.2", nano),
    Solver("w9-pathfinding 0.1.3", w9, lambda path: [(y, x) for x, y in path]),
    Solver("tcod 21.2 CustomGraph", tcod_graph, diagonal=99 / 70),
    Solver("tcod 21.2 AStar", tcod_astar, cuts=True),
    Solver("pyastar2d 1.1.4", pyastar, cuts=True, diagonal=1.0),
    Solver("python_motion_planning 1.1.1", motion_planning, lambda p: [(y - 1, x - 1) for x, y in p], largest=100),
)


def optimum(free: Any, solver: Solver) -> Callable[[Cell, Cell], float]:
    """Return the optimal cost under a solver's own rule and prices, by scipy's Dijkstra."""
    rows, cols = free.shape
    index = np.arange(rows * cols).reshape(rows, cols)
    parts = []
    for dr, dc, price in ((0, 1, 1.0), (1, 0, 1.0), (1, 1, solver.diagonal), (1, -1, solver.diagonal)):
        here = (slice(0, rows - dr), slice(max(0, -dc), cols - max(0, dc)))
        there = (slice(dr, rows), slice(max(0, dc), cols - max(0, -dc)))
        able = free[here] & free[there]
        if dr and dc and not solver.cuts:
            able &= free[there[0], here[1]] & free[here[0], there[1]]
        parts.append((index[here][able], index[there][able], np.full(able.sum(), price)))
    a, b, w = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    graph = scipy.sparse.coo_array((w, (a, b)), shape=(rows * cols,) * 2).tocsr()

    def least(start: Cell, goal: Cell) -> float:
        costs = scipy.sparse.csgraph.dijkstra(graph, directed=False, indices=index[start])
        return float(costs[index[goal]])

    return least


def judge(free: Any, solver: Solver, path: Any, start: Cell, goal: Cell) -> tuple[float, bool]:
    """Return a path's cost by the solver's own prices, and whether it cuts a corner. Fail if it is not a path."""
    cells = np.asarray(path, dtype=np.int64).reshape(-1, 2)
    if tuple(cells[0]) != start:
        cells = cells[::-1]
    assert tuple(cells[0]) == start, solver.name
    assert tuple(cells[-1]) == goal, solver.name
    assert free[tuple(cells.T)].all(), solver.name
    steps = np.diff(cells, axis=0)
    assert (np.abs(steps).max(axis=1) == 1).all(), solver.name
    slanted = np.abs(steps).sum(axis=1) == 2
    corners = free[cells[:-1, 0] + steps[:, 0], cells[:-1, 1]] & free[cells[:-1, 0], cells[:-1, 1] + steps[:, 1]]
    return float(np.where(slanted, solver.diagonal, 1.0).sum()), bool((slanted & ~corners).any())


def disc_picture(rng: np.random.Generator) -> Any:
    """100 x 100 cells among discs."""
    discs = tuple(Disc(*map(float, rng.uniform(0, 50, 2)), float(rng.uniform(0.5, 2.0))) for _ in range(80))
    return rasterise(World("discs", (0, 0, 50, 50), discs), 0.5, 0.3).free.copy()


def far_queries(free: Any, count: int, rng: np.random.Generator) -> list[tuple[Cell, Cell]]:
    """Pairs of connected cells, at least half the grid's side apart."""
    cells, grid, planner = np.argwhere(free), Grid.from_free(free), load_planner("astar")
    found: list[tuple[Cell, Cell]] = []
    while len(found) < count:
        (r0, c0), (r1, c1) = rng.choice(cells, size=2).tolist()
        apart = max(abs(r0 - r1), abs(c0 - c1)) >= max(free.shape) / 2
        if apart and planner.plan(Query(grid, (r0, c0), (r1, c1)), rng).solved:
            found.append(((r0, c0), (r1, c1)))
    return found


def problems(folder: Path, name: str, count: int, rng: np.random.Generator) -> tuple[Any, list[tuple[Cell, Cell]]]:
    """Load a MovingAI map and some of the longer half of its problems."""
    free = import_movingai_map(folder / f"{name}.map").free.copy()
    listed = sorted(import_movingai_problems(folder / f"{name}.map.scen"), key=lambda p: p.optimal)
    picked = rng.choice(len(listed) // 2, size=count, replace=False) + len(listed) // 2
    return free, [(listed[i].start, listed[i].goal) for i in picked]


@dataclass
class Row:
    """What one solver did on one map."""

    seconds: list[float]  # by query, the median of the turns
    over: float  # longest path's excess over the optimum under its own rule
    cut: int  # queries whose path cuts a corner


def measure(free: Any, queries: Sequence[tuple[Cell, Cell]]) -> dict[str, Row]:
    """Every solver on one map, in turns."""
    solvers = [s for s in SOLVERS if max(free.shape) <= s.largest]
    ready = {s.name: s.prepare(free) for s in solvers}
    least = {key: optimum(free, s) for s in solvers if (key := (s.cuts, s.diagonal))}
    floors: dict[tuple[bool, float], list[float]] = {
        key: [solve(start, goal) for start, goal in queries] for key, solve in least.items()
    }
    rows = {s.name: Row([], 0.0, 0) for s in solvers}
    for i, (start, goal) in enumerate(queries):
        took: dict[str, list[float]] = {s.name: [] for s in solvers}
        for turn in range(TURNS):
            for s in solvers:
                if turn and s.largest < 512:
                    continue
                began = time.perf_counter()
                path = ready[s.name](start, goal)
                took[s.name].append(time.perf_counter() - began)
                if not turn:
                    cost, cut = judge(free, s, s.cells(path), start, goal)
                    rows[s.name].over = max(rows[s.name].over, cost / floors[s.cuts, s.diagonal][i] - 1)
                    rows[s.name].cut += cut
        for name, times in took.items():
            rows[name].seconds.append(statistics.median(times))
    return rows


def one_shot(maps: int, rng: np.random.Generator) -> dict[str, list[float]]:
    """From a picture of free cells never seen before to a path: preparing the map counts."""
    solvers = [s for s in SOLVERS if s.largest >= 512]
    took: dict[str, list[float]] = {s.name: [] for s in solvers}
    for turn in range(maps + 1):
        free = disc_picture(rng)
        (query,) = far_queries(free, 1, rng)
        for s in solvers:
            picture = free.copy()
            began = time.perf_counter()
            s.prepare(picture)(*query)
            if turn:  # the first warms up
                took[s.name].append(time.perf_counter() - began)
    return took


def ratio(times: Sequence[float], ours: Sequence[float]) -> str:
    """Median of the ratios query by query, and ratio of the sums."""
    return f"{statistics.median(a / b for a, b in zip(times, ours, strict=True)):.2f} / {sum(times) / sum(ours):.2f}"


def main() -> None:
    rng = np.random.default_rng(1)
    given = command_line(
        __doc__,
        archive=(ARCHIVE, "of MovingAI's maps"),
        queries=(25, "on each map"),
        fresh=(60, "maps that are met for the first time"),
    )
    archive, queries = given.archive, given.queries
    picture = disc_picture(rng)
    maps: dict[str, tuple[Any, list[tuple[Cell, Cell]]]] = {
        "100×100 discs": (picture, far_queries(picture, queries, rng))
    }
    with tempfile.TemporaryDirectory() as folder:
        if archive.exists():
            with tarfile.open(archive) as tar:
                tar.extractall(folder, filter="data")
            maps |= {title: problems(Path(folder), name, queries, rng) for title, name in MOVINGAI.items()}
        else:
            print(f"No MovingAI maps at {archive}: only the discs are measured.\n")
    results = {title: measure(*made) for title, made in maps.items()}
    fresh = one_shot(given.fresh, rng)
    ours = SOLVERS[0].name

    heads = ["solver", *maps, "fresh 100×100 map, one query"]
    print(f"Median of {queries} queries, ms\n")
    times, ratios = [], []
    for s in SOLVERS:
        found = [r.get(s.name) for r in results.values()]
        rows = [row for row in found if row]
        cut, over = sum(row.cut for row in rows), max(row.over for row in rows)
        share = f"in {cut} of {queries * len(rows)} paths" if cut else "none"
        new = s.name in fresh
        last = f"{statistics.median(fresh[s.name]) * 1e3:.3f}" if new else ""
        times.append([s.name, *(f"{statistics.median(row.seconds) * 1e3:.3f}" if row else "" for row in found), last])
        cells = [
            ratio(row.seconds, r[ours].seconds) if row else "" for row, r in zip(found, results.values(), strict=True)
        ]
        ratios.append([s.name, *cells, ratio(fresh[s.name], fresh[ours]) if new else "", share, f"{over:.1%}"])
    print_table(heads, times)
    print("Time relative to `astar`: median of the ratios query by query / ratio of the sums\n")
    print_table([*heads, "corners cut", "over its own optimum"], ratios)


if __name__ == "__main__":
    main()
