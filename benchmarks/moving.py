"""hasan's six cases with movers, cell by cell: `python -m benchmarks.moving [--seeds N]`. Prints Markdown.

The environments are recreated (`antdrive.sim.papers.maps`) with the paper's start and goal. The paper has
one mover; here 1 and 10 start on random free cells. In every step each mover goes to a random free
neighbouring cell other than the robot's, then the robot decides. With the same seed, movers go the same way
for every planner until they meet the robot. `mmas-dstar` uses one rule for its exponents in all cases; the
table shows the exponents that the paper chose for each case. The total cost is defined as in the paper: the
cost-to-go in cells, summed over all cells visited.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from antdrive.planners import Cell, OnlinePlanner, Query, load_planner, online_for
from antdrive.sim.papers.maps import environments
from antdrive.worlds import DIRECTIONS, Grid
from benchmarks.planners import seconds, table

#: hasan, Table 1: alpha/beta, cells propagated, steps, total cost, seconds; basic D*'s total cost and seconds.
PRINTED = {
    "1a": ("7/1", 1531, 65, 2491.8, 3.82, 3318.4, 3.90),
    "2b": ("5/1", 1134, 43, 1052.4, 2.96, 2559.8, 10.06),
    "3c": ("1/1", 1208, 49, 1238.6, 2.98, 1238.6, 3.49),
    "4d": ("5/1", 1689, 64, 2281.2, 4.08, 5857.8, 11.23),
    "5e": ("3/1", 1541, 91, 5086.4, 5.64, 5380.6, 32.89),
    "5f": ("1/0 or 26/1", 1346, 66, 2477.8, 4.76, 3249.2, 10.04),
}


class Strollers:
    """Movers of one cell each that go to a random free neighbouring cell in every step."""

    def __init__(self, grid: Grid, count: int, rng: np.random.Generator, away: tuple[Cell, ...]) -> None:
        self._grid, self._rng = grid, rng
        free = [tuple(map(int, cell)) for cell in np.argwhere(grid.free)]
        chosen = rng.permutation(len(free))
        self._cells = [free[i] for i in chosen if free[i] not in away][:count]

    @property
    def cells(self) -> npt.NDArray[np.int64]:
        """The cells that movers are in (N, 2)."""
        return np.array(self._cells, dtype=np.int64).reshape(-1, 2)

    def step(self, robot: Cell) -> None:
        for n, (r, c) in enumerate(self._cells):
            moves = int(self._grid.moves[r, c])
            near = [(r + dr, c + dc) for k, (dr, dc) in enumerate(DIRECTIONS) if moves >> k & 1]
            draw = self._rng.random()  # one number per step, whatever the robot does
            near = [cell for cell in near if cell != robot and cell not in self._cells]
            if near:
                self._cells[n] = near[int(draw * len(near))]


def drive(robot: OnlinePlanner, query: Query, movers: Strollers, limit: int = 5000) -> bool:
    """Whether the robot reaches the goal within `limit` decisions. A move into a mover fails the benchmark."""
    for _ in range(limit):
        if robot.arrived:
            return True
        movers.step(robot.cell)
        before, to = robot.cell, robot.step(movers.cells)
        if to is not None:
            step = DIRECTIONS.index((to[0] - before[0], to[1] - before[1]))
            assert int(query.grid.moves[before]) >> step & 1, "a move that is not allowed"
            assert list(to) not in movers.cells.tolist(), "a move into a mover"
    return robot.arrived


def runs(name: str, query: Query, count: int, seeds: range) -> Iterator[tuple[bool, OnlinePlanner, float]]:
    for seed in seeds:
        movers = Strollers(query.grid, count, np.random.default_rng([seed, count]), (query.start, query.goal))
        started = time.perf_counter()
        robot = online_for(load_planner(name), query, np.random.default_rng(seed))
        yield drive(robot, query, movers), robot, time.perf_counter() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20, help="number of runs per case and planner")
    seeds = range(parser.parse_args().seeds)
    for count in (1, 10):
        rows = []
        for case, query in environments().items():
            exponents, cells, steps, cost, wall, dstar_cost, dstar_wall = PRINTED[case[:2]]
            rows.append([case, "hasan, printed", exponents, "", str(steps), f"{cost:g}", str(cells), "", f"{wall:g} s"])
            rows.append(["", "its D*", "", "", "", f"{dstar_cost:g}", "", "", f"{dstar_wall:g} s"])
            for name in ("mmas-dstar", "dstar", "dstar-lite"):
                for _ in runs(name, query, count, range(1)):
                    pass  # compile before timing
                done = list(runs(name, query, count, seeds))
                tallies = [robot.tally for _, robot, _ in done]
                spread = {
                    key: f"{statistics.median(values):.0f} ({min(values):.0f}–{max(values):.0f})"
                    for key in ("steps", "cost", "propagated")
                    if (values := [getattr(tally, key) for tally in tallies])
                }
                rows.append([
                    "", f"`{name}`", "the rule" if name == "mmas-dstar" else "",
                    f"{sum(ok for ok, _, _ in done)}/{len(done)}", *spread.values(),
                    f"{statistics.mean(t.cycles for t in tallies):.1f}",
                    seconds(statistics.median(wall for _, _, wall in done)),
                ])  # fmt: skip
        print(f"{count} mover{'s' if count > 1 else ''}; median (range) of {len(seeds)} seeds\n")
        heads = [
            "case",
            "",
            "alpha/beta",
            "arrived",
            "steps",
            "total cost",
            "cells propagated",
            "cycles broken",
            "time",
        ]
        print("\n".join(table(heads, rows)))


if __name__ == "__main__":
    main()
