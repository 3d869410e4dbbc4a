"""Overhead of mapless driving in the drive loop: `python -m benchmarks.exploring`, part of `make bench`.

Prints Markdown.
Six of BARN's worlds, `jackal`, `--map none`, and the same drives with the map: with exact sensors, then with `--noise 1` and
odometry, alone and with matching. All times are milliseconds per simulated second. *Loop* is the control periods of the
drive loop without the following columns. *To know* is the ratio of scans, matching, map, route check and replans to the rest
of the loop; *all* includes the stopping constraint. Drives with one seed are identical, so the minimum over several drives
counts for each call (processor time for replans), and load from other programs has little effect.

- scan: exact rays and their noise
- match: correction of the estimated pose
- map: insertion of the scan
- watch: route check, and discs for the controller
- sight: stopping constraint
- replans: plans, smoothing, preparation for the controller
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.sim import Scenario, run
from antdrive.sim.driving.body import Body
from antdrive.sim.driving.driver import Driver
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.stopping_constraint import StoppingConstraint
from antdrive.sim.sensing import OccupancyMap, Scanner
from antdrive.sim.sensing.matching import ScanMatcher
from benchmarks.drives import barn_tasks
from benchmarks.markdown import command_line, print_table
from tools.shared_data import BARN

SMALLEST = ("--drives 1 --worlds 1",)
WORLDS = ("world_0", "world_138", "world_186", "world_24", "world_288", "world_66")
PERIOD = "loop"
PARTS = ("scan", "match", "map", "watch", "sight", "replans")
SENSORS: tuple[tuple[str, dict[str, Any]], ...] = (  # sensors of the mapless robot
    ("exact", {}),
    ("noise 1, odometry", {"noise": 1.0, "localisation": "odometry"}),
    ("noise 1, matching", {"noise": 1.0, "localisation": "matching"}),
)


class Meter:
    """Profiler of functions by name; counts only outermost calls, and excludes them from control periods.

    Attributes:
        calls: what each call took, by name [s]
    """

    def __init__(self) -> None:
        self.calls: dict[str, list[float]] = {}
        self._within, self._inside = "", 0.0

    def watch(self, owner: Any, method: str, name: str) -> None:
        """Start to measure a function of a module or class."""
        inner: Callable[..., Any] = getattr(owner, method)

        def measured(*args: Any, **options: Any) -> Any:
            if self._within and self._within != PERIOD:
                return inner(*args, **options)
            outside, self._within = self._within, name
            if name == PERIOD:
                self._inside = 0.0
            # Reading the processor time takes longer than short calls, which are seldom interrupted.
            clock = time.process_time if name == "replans" else time.perf_counter
            began, started = time.perf_counter(), clock()
            try:
                return inner(*args, **options)
            finally:
                spent = clock() - started
                self._within = outside
                self._inside += time.perf_counter() - began if outside else 0.0
                self.calls.setdefault(name, []).append(spent - self._inside if name == PERIOD else spent)

        setattr(owner, method, measured)


def costs(meter: Meter, scenario: Scenario, drives: int) -> tuple[dict[str, float], bool]:
    """Return the cost of each part of the drive loop [ms per simulated second], and whether the drive was certified."""
    done = run(scenario)  # reads files and loads kernels
    assert done.rollout is not None
    found: dict[str, list[list[float]]] = {}
    for _ in range(drives):
        meter.calls = {}
        run(scenario)
        for name, calls in meter.calls.items():
            found.setdefault(name, []).append(calls)
    seconds = 1e-3 * float(done.rollout.t[-1])
    least = {name: float(np.min(calls, axis=0).sum()) / seconds for name, calls in found.items()}
    return {part: least.get(part, 0.0) for part in (PERIOD, *PARTS)}, done.succeeded


def rows(source: Path, drives: int, worlds: int) -> Iterator[list[str]]:
    meter = Meter()
    for owner, method in ((Body, "observe"), (Driver, "act"), (Body, "step")):
        meter.watch(owner, method, PERIOD)
    for owner, method, name in (
        (Scanner, "scan", "scan"),
        (ScanMatcher, "corrected", "match"),
        (OccupancyMap, "insert", "map"),
        (Exploration, "trigger", "watch"),
        (Exploration, "_refreshed", "watch"),
        (StoppingConstraint, "limit", "sight"),
        (Exploration, "replan", "replans"),
    ):
        meter.watch(owner, method, name)
    tasks = barn_tasks(source)
    for sensors, settings in SENSORS:
        to_know, everything = [], []
        for world in WORLDS[:worlds]:
            noise = {"noise": settings["noise"]} if settings else {}
            given, _ = costs(meter, Scenario.of(tasks[world], "astar", "jackal", **noise), drives)
            found, certified = costs(
                meter, Scenario.of(tasks[world], "astar", "jackal", map="none", **settings), drives
            )
            total, sight = sum(found[part] for part in PARTS), found["sight"]
            to_know.append((total - sight) / (found[PERIOD] + sight))
            everything.append(total / found[PERIOD])
            name = world if certified else f"{world} (not certified)"
            cells = [f"{found[part]:.2f}" for part in (PERIOD, *PARTS)]
            yield [sensors, name, f"{given[PERIOD]:.1f}", *cells, shown(to_know[-1]), shown(everything[-1])]
        medians = [shown(statistics.median(shares)) for shares in (to_know, everything)]
        yield [sensors, "median", *[""] * (2 + len(PARTS)), *medians]


def shown(share: float) -> str:
    return f"{100 * share:.0f} %"


def main() -> None:
    given = command_line(
        __doc__,
        barn=(BARN, "folder or archive of BARN's world_*.world files"),
        drives=(8, "how often each drive is repeated"),
        worlds=(len(WORLDS), "how many of the worlds"),
    )
    heads = ("sensors", "world", "loop with the map [ms/s]", "loop", *PARTS, "to know", "all")
    print_table(heads, rows(given.barn, given.drives, given.worlds))


if __name__ == "__main__":
    main()
