"""Mapless replans by stage: `python -m benchmarks.replans [--sizes 10,20,50,100] [--against CHECKOUT]`.

Prints Markdown. `jackal` crosses a random forest of each size from corner to corner with `--map none` and exact sensors, with
each planner. Times are milliseconds of processor time. `--against` drives the same worlds with the code of another checkout,
in turn; *ratio* is its time for all replans over that of this checkout, the median of the pairs.

- discs: discs of the hits on the map
- grid: rasterising
- search: change of the replanner, plan and check
- smooth: smoothing
- prepare: preparation for the controller
- rest: everything else, with the choice of obstacles beside the route
- changed: cells that differ from the replan before, the median share
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

SMALLEST = ("--sizes 10 --planners astar --pairs 1",)
DENSITY, RADII, GAP = 0.06, (0.3, 1.5), 1.0  # cylinders per square metre; their radii and gaps [m]
WHOLE = "whole"
EXPLORING, ROUTES = "antdrive.sim.driving.exploring", "antdrive.sim.driving.routes"
#: Functions of each stage, as module, class (empty: the module itself) and name; older checkouts lack some.
STAGES = (
    ("discs", EXPLORING, "Exploration", "_known"),
    ("grid", EXPLORING, "", "rasterise"),
    ("grid", ROUTES, "RoutePlanner", "observed"),
    ("search", ROUTES, "RoutePlanner", "around"),
    ("search", EXPLORING, "Exploration", "_ask"),
    ("smooth", EXPLORING, "", "smooth"),
    ("prepare", EXPLORING, "Exploration", "_prepare"),
    (WHOLE, EXPLORING, "Exploration", "replan"),
)
NAMES = ("discs", "grid", "search", "smooth", "prepare")


class Stages:
    """Processor time of each replan by stage, and the cells that changed.

    Attributes:
        rows: for each replan its milliseconds by stage, and the share of changed cells under `changed`
    """

    def __init__(self) -> None:
        self.rows: list[dict[str, float]] = []
        self._open: list[float] = []  # for each stage under way: time of stages within it, and of comparisons [s]
        self._row: dict[str, float] = {}
        self._last: dict[Any, Any] = {}
        for name, module, owner, function in STAGES:
            try:
                holder = importlib.import_module(module)
            except ImportError:
                continue
            holder = getattr(holder, owner) if owner else holder
            if hasattr(holder, function):
                setattr(holder, function, self._measured(name, getattr(holder, function)))

    def _measured(self, name: str, inner: Callable[..., Any]) -> Callable[..., Any]:
        def measured(*args: Any, **options: Any) -> Any:
            if not self._open and name != WHOLE:
                return inner(*args, **options)
            if name == WHOLE:
                self._row = dict.fromkeys((*NAMES, "rest", "changed"), 0.0)
            began = time.process_time()
            self._open.append(0.0)
            try:
                answer = inner(*args, **options)
            finally:
                spent = time.process_time() - began
                within = self._open.pop()
                key = "rest" if name == WHOLE else name
                self._row[key] += 1e3 * (spent - within)
            if name == "grid":
                self._compare(answer)
            if self._open:
                self._open[-1] += time.process_time() - began
            else:
                self.rows.append(self._row)
            return answer

        return measured

    def _compare(self, grid: Any) -> None:
        free, moves = self._last.get((grid.shape, grid.inflate), (grid.free, grid.moves))
        differ = (free != grid.free) | (moves != grid.moves)
        self._row["changed"] = max(self._row["changed"], float(differ.mean()))
        self._last[grid.shape, grid.inflate] = grid.free.copy(), grid.moves.copy()


def drive(size: int, planner: str) -> list[dict[str, float]]:
    """Drive through the forest of a size, after one of 10 m that loads kernels."""
    from antdrive.sim import Scenario, run
    from antdrive.worlds import forest

    stages = Stages()
    for side in (10, size):
        stages.rows.clear()
        count = round(DENSITY * side * side)
        task = forest(np.random.default_rng(1), size=side, count=count, radius=RADII, gap=GAP)
        run(Scenario.of(task, planner, "jackal", map="none"))
    return stages.rows


def driven(checkout: Path, size: int, planner: str) -> list[dict[str, float]]:
    """Drive in a process of its own, with the code of a checkout."""
    folder = checkout / "src" if (checkout / "src").is_dir() else checkout
    command = [sys.executable, "-P", __file__, "--drive", f"{size},{planner}"]
    done = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": str(folder.resolve())}, capture_output=True, text=True, check=True
    )
    replans: list[dict[str, float]] = json.loads(done.stdout)
    return replans


def rows(given: argparse.Namespace) -> Iterator[list[str]]:
    here = Path(__file__).parent.parent
    other = Path(given.against) if given.against else None
    for size in map(int, given.sizes.split(",")):
        for planner in given.planners.split(","):
            ratios = []
            for _ in range(given.pairs):
                found = driven(here, size, planner)
                before = driven(other, size, planner) if other is not None else []
                ratios.append(total(before) / total(found) if found else np.nan)
            for name, replans in (("this", found), (str(given.against), before)):
                if replans:
                    yield line(f"{size} m", planner, name, replans, ratios if name == "this" else ratios[:0])


def total(replans: list[dict[str, float]]) -> float:
    """Return the time of replans [ms]."""
    return sum(sum(row[name] for name in (*NAMES, "rest")) for row in replans)


def line(size: str, planner: str, name: str, replans: list[dict[str, float]], ratios: list[float]) -> list[str]:
    whole = [total([row]) for row in replans]
    spread = (f"{value:.2f}" for value in (*np.percentile(whole, [50, 95]), max(whole)))
    stages = (f"{statistics.median(row[key] for row in replans):.2f}" for key in (*NAMES, "rest"))
    changed = f"{100 * statistics.median(row['changed'] for row in replans):.2f} %"
    ratio = f"{statistics.median(ratios):.2f}" if ratios and ratios[0] > 0 else ""
    return [size, planner, name, str(len(replans)), *spread, *stages, changed, ratio]


def main() -> None:
    if sys.argv[1:2] == ["--drive"]:
        size, planner = sys.argv[2].split(",")
        print(json.dumps(drive(int(size), planner)))
        return
    from benchmarks.markdown import command_line, print_table

    given = command_line(
        __doc__,
        sizes=("10,20,50,100", "sides of the worlds [m]"),
        planners=("astar,dstar-lite", "planners"),
        pairs=(3, "drives of each checkout"),
        against=("", "another checkout"),
    )
    heads = ("world", "planner", "code", "replans", "median", "95 %", "worst", *NAMES, "rest", "changed", "ratio")
    print_table(heads, rows(given))


if __name__ == "__main__":
    main()
