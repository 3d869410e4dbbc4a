"""Time to repair a plan relative to planning from scratch: `python -m benchmarks.replan`.

A robot crosses 200 x 200 cells. It repeatedly takes a few steps along its path; then a patch of up to 3 x 3 cells ahead is
blocked, or an earlier patch is cleared. The time to report the change and repair the path is compared with planning the same
query from scratch, by the same planner and by `astar`; lengths must agree. For `ants`, which continue on their trails, there
are fewer worlds, and the gap to the optimum is reported. Prints Markdown.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from antdrive.planners import Planner, Query, load_planner, replanner_for
from antdrive.worlds import Disc, Grid, World, rasterise
from benchmarks.markdown import command_line

SIDE = 200
SMALLEST = ("--worlds 1 --changes 3",)


def discs(rng: np.random.Generator) -> Grid:
    """Among 150 cylinders."""
    made = tuple(Disc(*map(float, rng.uniform(0, 40, 2)), float(rng.uniform(0.3, 1.2))) for _ in range(150))
    return rasterise(World("discs", (0, 0, 40, 40), made), 0.2, 0.2)


def scattered(rng: np.random.Generator) -> Grid:
    """Return a grid with a fifth of its cells blocked at random."""
    return Grid.from_free(rng.random((SIDE, SIDE)) >= 0.2)


def corner_to_corner(grid: Grid) -> Query:
    free = np.argwhere(grid.free)
    ends = (free[np.abs(free - corner).sum(axis=1).argmin()] for corner in (5, SIDE - 6))
    return Query(grid, *(tuple(map(int, end)) for end in ends))


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    began = time.perf_counter()
    answer = call()
    return time.perf_counter() - began, answer


def drive(planner: Planner, query: Query, changes: int, rng: np.random.Generator) -> list[tuple[float, ...]]:
    """For each change the seconds for the repair, for planning anew and for `astar`, and the gaps of repair and new plan."""
    replanner, astar = replanner_for(planner, query, rng), load_planner("astar")
    replanner.block([])  # the first edit prepares the grid once
    blocked: list[Any] = []
    rows = []
    for turn in range(changes):
        path = replanner.result().cells
        if len(path) < 40:
            break
        replanner.move(tuple(map(int, path[int(rng.integers(1, 8))])))
        if turn % 3 == 2:
            patch, edit = blocked.pop(0), replanner.clear
        else:
            ahead = path[int(rng.integers(12, 20))]
            patch = np.clip(ahead + rng.integers(-1, 2, (5, 2)), 0, SIDE - 1)
            patch = patch[replanner.query.grid.free[tuple(patch.T)]]
            blocked.append(patch)
            edit = replanner.block

        def repair(edit: Callable[[Any], int] = edit, patch: Any = patch) -> Any:
            edit(patch)
            return replanner.result()

        took, repaired = timed(repair)
        now = replanner.query
        again = Query(Grid(now.grid.free.copy(), now.grid.moves.copy(), now.grid.cell), now.start, now.goal)
        anew, planned = timed(lambda again=again: planner.plan(again, rng))
        other, optimal = timed(lambda again=again: astar.plan(again, rng))
        if not optimal.solved:
            break
        rows.append((took, anew, other, repaired.cost / optimal.cost - 1, planned.cost / optimal.cost - 1))
    return rows


def measured(planner: Planner, kind: Callable[[np.random.Generator], Grid], worlds: int, changes: int) -> Any:
    """Return the columns of `drive` over a number of worlds."""
    rng = np.random.default_rng(0)
    drive(planner, corner_to_corner(kind(rng)), changes, rng)  # warms up
    return np.array([row for _ in range(worlds) for row in drive(planner, corner_to_corner(kind(rng)), changes, rng)]).T


def main() -> None:
    given = command_line(__doc__, worlds=(40, "of each kind; a tenth of them for ants"), changes=(12, "in each world"))
    print(
        "| 200×200 | planner | repair, µs: median | 90 % | 99 % | anew, µs | anew / repair | `astar`, µs | `astar` / repair |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for kind in (discs, scattered):
        for name in ("dstar-lite", "dstar"):
            repair, anew, astar, *gaps = measured(load_planner(name), kind, given.worlds, given.changes)
            assert np.abs(gaps).max() < 1e-12
            spread = " | ".join(f"{q:.0f}" for q in np.percentile(repair * 1e6, [50, 90, 99]))
            print(
                f"| {kind.__name__} | `{name}` | {spread} | {np.median(anew) * 1e6:.0f} | {np.median(anew / repair):.1f} |"
                f" {np.median(astar) * 1e6:.0f} | {np.median(astar / repair):.1f} |"
            )
    print(
        "\n| 200×200 | going on, ms: median | 90 % | gap: median | most | anew, ms | gap: median | most | anew / going on |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for kind in (discs, scattered):
        warm, cold, _, *gaps = measured(load_planner("ants"), kind, max(1, given.worlds // 10), given.changes)
        spread = " | ".join(f"{q:.0f}" for q in np.percentile(warm * 1e3, [50, 90]))
        lacks = [f"{100 * np.median(gap):.2f} % | {100 * gap.max():.2f} %" for gap in gaps]
        print(
            f"| {kind.__name__}, `ants` | {spread} | {lacks[0]} | {np.median(cold) * 1e3:.0f} | {lacks[1]} |"
            f" {np.median(cold / warm):.1f} |"
        )


if __name__ == "__main__":
    main()
