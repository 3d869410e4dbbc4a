"""Path quality and speed of the planners: `python -m benchmarks.planners [--quick] [--peer PYTHON] [TABLE ...]`.

Tables: quality, hard, papers, hasan, han2007, speed, peer; all but the last by default. One run on one core uses the same
grids; figures are medians over seeds, times are processor times. A gap is the excess length over the shortest path with the
same moves.

The papers' maps exist as pictures only. Recreated maps are random ones of the same size and kind, with their own optimum;
the papers' figures, shown beside them, belong to other maps.

The peer is python_motion_planning 1.1.1 (GPL, hence never imported here); PYTHON is an interpreter with it.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
import math
import statistics
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from antdrive.planners import PLANNERS, Planner, PlanResult, Query, capabilities_of, load_planner
from antdrive.planners.colonies.colony import ColonyGraph, TourConstruction
from antdrive.runs.papers.maps import blocks, environments, han_ants, optimum, scattered
from antdrive.worlds import DIRECTIONS, Disc, Grid, Task, World, forest, rasterise
from benchmarks.markdown import command_line, percent, print_tables, seconds, table

SMALLEST = ("--quick hasan",)
SEEDS = range(10)


# Grids


def random_grid(size: int, seed: int, blocked: float = 0.25) -> Query:
    """Each cell blocked with one probability."""
    return scattered(size, blocked, seed)


def cylinder_grid(size: int, seed: int) -> Query:
    """Return a grid of a forest of cylinders, with cells of 0.25 m, for a robot of radius 0.2 m."""
    side = 0.25 * size
    count = max(3, round(0.12 * side**2))
    rng = np.random.default_rng(seed)
    task = forest(rng, size=side, count=count, radius=(0.2, 0.8), clearance=0.6, robot_radius=0.2, cell=0.25)
    return Query.between(rasterise(task.world, 0.25, 0.2), task)


def maze(size: int, seed: int, opened: float = 0.0) -> Query:
    """Generate a perfect maze of size × size cells (odd), then open a fraction of its walls."""
    rng, n = np.random.default_rng(seed), size // 2
    free = np.zeros((size, size), dtype=np.bool_)
    free[1, 1] = True
    stack = [(0, 0)]
    while stack:
        r, c = stack[-1]
        ahead = [(r + dr, c + dc) for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0))]
        ahead = [(q, d) for q, d in ahead if 0 <= q < n and 0 <= d < n and not free[2 * q + 1, 2 * d + 1]]
        if not ahead:
            stack.pop()
            continue
        q, d = ahead[rng.integers(len(ahead))]
        free[2 * q + 1, 2 * d + 1] = free[r + q + 1, c + d + 1] = True
        stack.append((q, d))
    free[1:-1, 1:-1] |= rng.random((size - 2, size - 2)) < opened
    return Query(Grid.from_free(free), (1, 1), (size - 2, size - 2))


def cup(size: int) -> Query:
    """Return a query whose start lies deep in a cup closed towards the goal."""
    free = np.ones((size, size), dtype=np.bool_)
    low, high = size // 6, 5 * size // 6
    free[low : high + 1, high] = free[low, low:high] = free[high, low:high] = False
    return Query(Grid.from_free(free), (size // 2, size // 2), (size // 2, size - 2))


def solve(planner: Planner, query: Query, seed: int) -> PlanResult:
    """Plan with processor time as the plan's time, which is robust to load from other programs."""
    started = time.process_time()
    result = planner.plan(query, np.random.default_rng(seed))
    return dataclasses.replace(result, wall_s=time.process_time() - started)


# Tables


def summary(planner: Planner, queries: Sequence[Query]) -> tuple[str, str, str]:
    """How many arrived, the gaps of these (median / most), and the median time, once the planner is compiled."""
    solve(planner, queries[0], 0)
    results = [solve(planner, query, seed) for seed, query in enumerate(queries)]
    gaps = [r.cost / optimum(q) - 1 for r, q in zip(results, queries, strict=True) if r.solved]
    gap = f"{percent(statistics.median(gaps))} / {percent(max(gaps))}" if gaps else "–"
    return f"{len(gaps)}/{len(queries)}", gap, seconds(statistics.median(r.wall_s for r in results))


def quality(quick: bool) -> Iterator[str]:
    """Every planner of the registry with its own defaults."""
    sizes = (20, 50) if quick else (20, 50, 100)
    seeds = SEEDS[:3] if quick else SEEDS
    heads = ["planner", *(f"{size}×{size}" for size in sizes)]
    for kind, make in (("25 % of cells blocked at random", random_grid), ("cylinders", cylinder_grid)):
        queries = {size: [make(size, seed) for seed in seeds] for size in sizes}
        rows = []
        for name, planner in PLANNERS.items():
            if capabilities_of(planner).needs_world and make is random_grid:
                continue
            solve(planner, queries[20][0], 0)  # compiled where a query is small
            rows.append([f"`{name}`", *(", ".join(summary(planner, queries[size])) for size in sizes)])
        yield f"{kind.capitalize()}; arrived, gap median / most, time"
        yield ""
        yield from table(heads, rows)


def hard(quick: bool) -> Iterator[str]:
    """`ants` where a way is hard to find or long."""
    kinds: dict[str, Callable[[int], Query]] = {
        "200×200, 25 % blocked": lambda seed: random_grid(200, seed),
        "100×100, 35 % blocked": lambda seed: random_grid(100, seed, 0.35),
        "200×200 cylinders": lambda seed: cylinder_grid(200, seed),
        "101×101 maze, one way": lambda seed: maze(101, seed),
        "201×201 maze, 5 % of its walls open": lambda seed: maze(201, seed, 0.05),
        "100×100, in a cup": lambda seed: cup(100),
    }
    planner, rows = load_planner("ants"), []
    for label, make in kinds.items():
        queries = [make(seed) for seed in SEEDS[: 2 if quick else 5]]
        length = statistics.median(len(solve(load_planner("astar"), query, 0).cells) for query in queries)
        rows.append([label, f"{length:.0f}", *summary(planner, queries)])
    yield from table(["map", "cells of the shortest way", "`ants` arrived", "gap median / most", "time"], rows)


def paper_maps(quick: bool) -> Iterator[tuple[str, str, str, dict[str, Any], list[Query], str]]:
    """Paper, map, planner, its options there, recreated maps, and what the paper printed."""
    seeds = SEEDS[:3] if quick else SEEDS
    # suganthi2019, Table 2: sizes; the blocked share is not stated.
    common = {"alpha": 1.0, "beta": 1.0, "evaporation": 0.3, "deposit": 1.0, "heuristic": "step", "iterations": 100}
    dying = {"backtrack": False, "shortcut": False, "depositors": "all", "ties": "share"}  # not the planner's defaults
    printed = {
        10: (13.899, 13.899, 13.899), 20: (28.627, 38.627, 28.627), 30: (46.527, 59.355, 42.184), 50: (96.125, 109.761, 94.326),
    }  # fmt: skip
    for size, figures in printed.items():
        queries = [random_grid(size, seed, 0.15) for seed in seeds]
        for name, options, figure in (
            ("as", {"ants": 50, **common}, figures[0]),
            ("pfaco", {"ants": 50, "iterations": 100, "ranks": 15, "form": "letter"}, figures[1]),
            ("iaco", {"ants": 25, "explorers": 75, **common, **dying}, figures[2]),
        ):
            yield "suganthi2019", f"{size}×{size}, 15 % blocked", name, options, queries, f"{figure:g}"
    # ibraheem2016, Table 2: the text counts 5 and 10 obstacles on the smaller maps, none on the larger.
    for size, count, figures in (
        (10, 5, (15.07, 1.217, 15.07, 1.155)), (20, 10, (28.6274, 9.073, 28.6274, 7.839)),
        (30, 15, (45.9411, 52.854, 45.1127, 52.017)), (40, 20, (62.6690, 134.771, 61.8406, 132.678)),
    ):  # fmt: skip
        queries = [blocks(size, size, count, size // 4, seed) for seed in seeds]
        options = {"ants": 50, "iterations": 100, "evaporation": 0.3}
        for name, length, wall in (("as", *figures[:2]), ("maco", *figures[2:])):
            yield "ibraheem2016", f"{size}×{size}, {count} blocks", name, options, queries, f"{length:g}, {wall:g} s"
    # lee2008, Tables I and II.
    for number, (rows, cols), figures in (
        (1, (25, 25), (72.0833, 13326, 59.2548, 602)), (2, (50, 44), (83.3970, 3926, 64.0833, 274)),
        (3, (100, 100), (154.2376, 16552, 123.6102, 1063)), (4, (100, 100), (175.2376, 17953, 135.8234, 1201)),
        (5, (100, 100), (168.6518, 22641, 131.6812, 1593)),
    ):  # fmt: skip
        queries = [blocks(rows, cols, 25, max(rows, cols) // 6, 100 * number + seed) for seed in seeds]
        place = f"{number}: {rows}×{cols}, 25 obstacles"
        # The number of iterations is not stated; the paper's times are hours for the one, minutes for the other.
        old = {"ants": 500, "beta": 2.0, "evaporation": 0.01, "iterations": 1000}
        new = {"iterations": 200, "form": "letter"}
        for name, options, length, wall in (("as", old, *figures[:2]), ("pfaco", new, *figures[2:])):
            yield "lee2008", place, name, options, queries, f"{length:g}, {wall:g} s"


def papers(quick: bool) -> Iterator[str]:
    """Each paper's planners at its own parameters, then with our two options; `ants` on the same maps."""
    rows = []
    for paper, place, name, options, queries, printed in paper_maps(quick):
        row = [paper, place, f"`{name}`", printed]
        helped = load_planner(name, **{**options, "iterations": 100, "backtrack": True, "shortcut": True})
        planners = (load_planner(name, **options), helped, load_planner("ants"))
        row += [", ".join(summary(planner, queries)) for planner in planners]
        row.insert(4, f"{statistics.median(map(optimum, queries)):.1f}")
        rows.append(row)
    yield "Recreated maps; arrived, gap median / most, time"
    yield ""
    heads = (
        "paper | map | planner | printed | shortest here | by the paper | backtrack, shortcut, 100 iterations | `ants`"
    )
    yield from table(heads, rows)


# hasan's environments, 50×50


def hasan_cases() -> Iterator[tuple[str, Query, str]]:
    """Name, recreated environment with the paper's start and goal, and what it printed."""
    printed = (
        "1531, 65, 3.82 s", "1134, 43, 2.96 s", "1208, 49, 2.98 s", "1689, 64, 4.08 s", "1541, 91, 5.64 s", "1346, 66, 4.76 s",
    )  # fmt: skip
    for (name, query), figures in zip(environments().items(), printed, strict=True):
        yield name, query, figures


def hasan(quick: bool) -> Iterator[str]:
    """hasan's planner where nothing moves."""
    rows = []
    for name, query, printed in hasan_cases():
        planner = load_planner("mmas-dstar")
        solve(planner, query, 0)
        r = solve(planner, query, 0)
        ours = f"{r.work}, {len(r.cells) - 1}, {seconds(r.wall_s)}"
        rows.append([name, printed, ours, percent(r.cost / optimum(query) - 1), r.reason or "–"])
    yield "Recreated environments of 50×50 cells, standing still; cells propagated, steps, time"
    yield ""
    yield from table(["environment", "printed", "`mmas-dstar`", "gap", "what it had to do"], rows)


# han2007


def han_disc() -> Query:
    """One disc of radius 5 at (10, 10) on the grid points (0, 0) to (20, 20), for a point robot."""
    world = World("han2007-single", (-0.5, -0.5, 20.5, 20.5), (Disc(10.0, 10.0, 5.0),))
    task = Task(world, (0.0, 0.0, 0.0), (20.0, 20.0), cell=1.0)
    return Query.between(rasterise(world, 1.0), task)


def han2007(quick: bool) -> Iterator[str]:
    """Run the thesis' genetic algorithm on one disc, and its experiment 6 with ants: means of ten trials."""
    query = han_disc()
    floor = solve(load_planner("tangent"), query, 0).line_length
    rows = [["han2007, printed, 3 via points", "33.1798", "", "", "", ""]]
    for name, options in (
        *(("ga-han", {"via_points": n}) for n in (1, 2, 3, 6)),
        *(("hybrid", {"colony": colony}) for colony in ("aco-han", "ants")),
    ):
        planner = load_planner(name, **options)
        solve(planner, query, 0)
        results = [solve(planner, query, seed) for seed in range(20)]
        lengths = [r.line_length for r in results]
        middle = statistics.median(lengths)
        label = f"`{name}`, {next(iter(options)).replace('_', ' ')} {next(iter(options.values()))}"
        rows.append(
            [label, f"{middle:.3f}", percent(middle / floor - 1), f"{min(lengths):.3f}", f"{max(lengths):.3f}",
             seconds(statistics.median(r.wall_s for r in results))]
        )  # fmt: skip
    yield f"One disc of radius 5, length of the line, 20 seeds; the shortest (`tangent`) is {floor:.3f}"
    yield ""
    yield from table(["", "median", "gap", "best", "worst", "time"], rows)
    query = han_ants()
    variants: dict[str, dict[str, Any]] = {
        "`aco-han`": {},
        "`aco-han`, elitism 100": {"elitism": 100},
        "`aco-han`, listing, at most 50 steps": {"form": "listing", "deposit": 5.0, "max_steps": 50},
        "`aco-han`, shortcut": {"shortcut": True},
    }
    yield f"Fourteen obstacles, 50 iterations, mean length of 10 trials (worst); the shortest is {optimum(query):.3f}"
    yield ""
    rows = [["han2007, printed", "45.357", "38.6223", "36.237"]]
    for label, options in variants.items():
        best, last = [label], [f"{label}: best of the last iteration"]
        for ants in (10, 100, 500):
            results = [solve(load_planner("aco-han", ants=ants, **options), query, seed) for seed in range(10)]
            costs = [r.cost for r in results]
            best.append(
                f"{statistics.mean(costs):.3f} ({max(costs):.2f}), {seconds(statistics.median(r.wall_s for r in results))}"
            )
            ends = [r.history.iteration_best[-1] for r in results]
            none = sum(map(math.isinf, ends))
            mean = statistics.mean(e for e in ends if math.isfinite(e))
            last.append(f"{mean:.3f}" + (f", none arrived in {none}" if none else ""))
        rows += [best, last]
    yield from table(["", "10 ants", "100 ants", "500 ants"], rows)
    rows = []
    for name in ("ants", "mmas", "ga-han", "hybrid"):
        if name in PLANNERS and not capabilities_of(PLANNERS[name]).needs_world:
            results = [solve(load_planner(name), query, seed) for seed in range(3 if quick else 10)]
            solved = [r for r in results if r.solved]
            line = f"{statistics.mean(r.length or r.cost for r in solved):.3f}" if solved else "–"
            grid = f"{statistics.mean(r.cost for r in solved):.3f}" if solved else "–"
            wall = seconds(statistics.median(r.wall_s for r in results))
            rows.append([f"`{name}`", f"{len(solved)}/{len(results)}", grid, line, wall])
    yield from table(["the same map", "arrived", "path of cells", "line driven", "time"], rows)


# Speed


def speed(quick: bool) -> Iterator[str]:
    """ibraheem2016's settings, and the walking alone."""
    printed = {10: 1.217, 20: 9.073, 30: 52.854, 40: 134.771}
    planner = load_planner("as", ants=50, iterations=100)
    rows = []
    for size, paper in printed.items():
        queries = [blocks(size, size, size // 2, size // 4, seed) for seed in SEEDS]
        solve(planner, queries[0], 0)
        results = [solve(planner, query, seed) for seed, query in enumerate(queries)]
        wall = statistics.median(r.wall_s for r in results)
        rate = statistics.median(r.work / r.wall_s for r in results) / 1e6
        rows.append([f"{size}×{size}", f"{paper:g} s", seconds(wall), f"{paper / wall:,.0f} ×", f"{rate:.1f} M"])
    yield "`as`, 50 ants, 100 iterations (ibraheem2016); recreated maps"
    yield ""
    yield from table(["map", "printed", "ours", "ratio", "ant steps/s, all told"], rows)
    rows = []
    for size in (20, 40, 100):
        query = random_grid(size, 0, 0.2)
        for label, options in (("die in dead ends", {}), ("backtrack", {"backtrack": True})):
            colony: Any = load_planner("as", ants=2000, **options)
            ground, rng = ColonyGraph.of(query), np.random.default_rng(0)
            walk = TourConstruction.of(colony, ground)
            colony.choice_weights(
                ground, colony.initial_trail(ground, rng), colony.heuristic_values(ground), walk.weights[0]
            )
            rates = []
            for _ in range(5):
                started = time.process_time()
                _, steps = walk.construct(rng)
                rates.append(steps / (time.process_time() - started))
            rows.append([f"{size}×{size}", label, f"{statistics.median(rates) / 1e6:.1f} M"])
    yield "Walking alone, one core, 20 % blocked"
    yield ""
    yield from table(["grid", "ants", "ant steps/s"], rows)


# A peer

PEER = """
import json, random, sys, time
import numpy
import python_motion_planning as pmp
answers = []
for seed, (free, start, goal) in enumerate(json.load(sys.stdin)):
    random.seed(seed)
    numpy.random.seed(seed)
    rows, cols = len(free), len(free[0])
    blocked = {(r + 1, c + 1) for r in range(rows) for c in range(cols) if not free[r][c]}
    blocked |= {(r, c) for r in range(rows + 2) for c in (0, cols + 1)} | {(r, c) for r in (0, rows + 1) for c in range(cols + 2)}
    world = pmp.Grid(rows + 2, cols + 2)
    world.update(blocked)
    planner = pmp.ACO(tuple(i + 1 for i in start), tuple(i + 1 for i in goal), world)
    started = time.process_time()
    try:
        cells = [[r - 1, c - 1] for r, c in planner.plan()[1]]
    except Exception:
        cells = []
    answers.append([time.process_time() - started, cells])
print(json.dumps(answers))
"""


def path_length(cells: Sequence[Sequence[int]], query: Query) -> float:
    """Return the length of a peer's path in either direction; inf without a path."""
    cells = [tuple(cell) for cell in cells]
    if cells and cells[0] != query.start:
        cells = cells[::-1]
    if not cells or cells[0] != query.start or cells[-1] != query.goal:
        return math.inf
    length = 0.0
    for (r, c), (q, d) in itertools.pairwise(cells):
        if (q - r, d - c) not in DIRECTIONS or not int(query.grid.moves[r, c]) >> DIRECTIONS.index((q - r, d - c)) & 1:
            return math.inf
        length += math.hypot(q - r, d - c)
    return length


def peer(quick: bool, python: str) -> Iterator[str]:
    """python_motion_planning's ACO, 50 ants and 100 iterations as it comes."""
    kinds = [("10×10, 10 % blocked", 10, 0.1), ("20×20, 20 % blocked", 20, 0.2), ("30×30, 10 % blocked", 30, 0.1)]
    seeds = SEEDS[: 2 if quick else 5]
    rows = []
    for kind, size, blocked in kinds[: 2 if quick else 3]:
        queries = [random_grid(size, seed, blocked) for seed in seeds]
        maps = [(q.grid.free.tolist(), q.start, q.goal) for q in queries]
        done = subprocess.run([python, "-c", PEER], input=json.dumps(maps), capture_output=True, text=True, check=True)
        answers = json.loads(done.stdout)
        lengths = [path_length(cells, query) for (_, cells), query in zip(answers, queries, strict=True)]
        theirs = statistics.median(wall for wall, _ in answers)
        arrived = sum(map(math.isfinite, lengths))
        gap = [length / optimum(q) - 1 for length, q in zip(lengths, queries, strict=True) if math.isfinite(length)]
        middle = percent(statistics.median(gap)) if gap else "–"
        label = "python_motion_planning 1.1.1"
        rows.append([kind, label, f"{arrived}/{len(seeds)}", middle, seconds(theirs), "1", "–"])
        for name, options in (
            ("as", {"beta": 5.0, "evaporation": 0.1}),
            ("as", {"beta": 5.0, "evaporation": 0.1, "backtrack": True, "shortcut": True}),
            ("mmas", {}),
            ("ants", {}),
        ):
            planner = load_planner(name, **options)
            solve(planner, queries[0], 0)
            results, walls = [], []
            for seed, query in enumerate(queries):
                trials = [solve(planner, query, seed) for _ in range(10)]
                walls.append(statistics.median(r.wall_s for r in trials))
                results.append(trials[0])
            gap = [r.cost / optimum(q) - 1 for r, q in zip(results, queries, strict=True) if r.solved]
            ratio = statistics.median(t / w for (t, _), w in zip(answers, walls, strict=True))
            longer = sum(r.cost > length + 1e-9 for r, length in zip(results, lengths, strict=True))
            wall = statistics.median(walls)
            words = [", its settings"] * bool(options) + [", backtrack, shortcut"] * ("backtrack" in options)
            label = f"`{name}`{''.join(words)}"
            rows.append([kind, label, f"{len(gap)}/{len(seeds)}", percent(statistics.median(gap)), seconds(wall), f"{ratio:,.0f}",
                         str(longer)])  # fmt: skip
    yield from table(["grid", "planner", "arrived", "gap", "time", "times faster", "longer than the peer's"], rows)


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "which to print"),
        quick=(False, "fewer seeds and sizes"),
        peer=(str, "an interpreter with python_motion_planning 1.1.1"),
    )
    makers: dict[str, Any] = {f.__name__: f for f in (quality, hard, papers, hasan, han2007, speed)}
    if given.peer:
        makers["peer"] = functools.partial(peer, python=given.peer)
    print_tables(given.tables, makers, given.quick)


if __name__ == "__main__":
    main()
