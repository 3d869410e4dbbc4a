"""Measure what driving without a map adds to the drive loop: `python -m benchmarks.exploring`, part of `make bench`.

Prints Markdown.
Six of BARN's worlds, `jackal`, `--map none`, and the same drives with the map: with exact sensors, then with `--noise 1` and
odometry, alone and with matching. All times are processor time for each simulated second. *Loop* is the drive loop without
what follows it in the row; the share is what follows, over the loop. Each drive is repeated after a first one, in which files are
read and kernels loaded; of each part the least counts, so that other work on the machine disturbs the figures less. What reading
the clock takes is subtracted.

- scan: the exact rays, their noise
- match: the estimated pose corrected by the scan
- map: the scan entered
- watch: whether the route ahead is still clear, and the discs for the controller
- sight: how far the robot may go on ground that it has seen
- replans: plans, their smoothing, their preparation for the controller
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from antdrive.sim import Scenario, pipeline, run
from antdrive.sim.driving.caution import Caution
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.survey import Senses
from antdrive.sim.sensing import OccupancyMap
from antdrive.sim.sensing.matching import ScanMatcher
from benchmarks.cost import BARN
from benchmarks.drives import barn_tasks
from benchmarks.planners import table

WORLDS = ("world_0", "world_138", "world_186", "world_24", "world_288", "world_66")
EMPTY = 20_000  # calls of an empty function
PARTS = ("scan", "match", "map", "watch", "sight", "replans")
SENSORS: tuple[tuple[str, dict[str, Any]], ...] = (  # how the robot without a map senses
    ("exact", {}),
    ("noise 1, odometry", {"noise": 1.0, "localisation": "odometry"}),
    ("noise 1, matching", {"noise": 1.0, "localisation": "matching"}),
)


class Meter:
    """Adds up the processor time of functions by name; of calls within calls only the outermost counts.

    Reading the clock takes as long as a short function does. So an empty function is measured at first, and what it takes is
    subtracted.

    Attributes:
        spent: seconds by name
        calls: how often a function was called, by name
        within: what the clock shows for an empty function [s]
        whole: what measuring it takes [s]
    """

    def __init__(self) -> None:
        self.spent, self.calls = dict[str, float](), dict[str, int]()
        self._within = ""
        self.within = self.whole = 0.0
        self.watch(self, "nothing", "nothing")
        started = time.process_time()
        for _ in range(EMPTY):
            self.nothing()
        self.whole = (time.process_time() - started) / EMPTY
        self.within = self.spent["nothing"] / EMPTY

    def nothing(self) -> None:
        """Do nothing."""

    def begin(self) -> None:
        """Forget what was measured."""
        self.spent.clear()
        self.calls.clear()

    def parts(self) -> dict[str, float]:
        """What the parts took, and the loop without them [s]."""
        found = {part: self.spent.get(part, 0.0) - self.within * self.calls.get(part, 0) for part in PARTS}
        clocks = self.whole * sum(self.calls.get(part, 0) for part in PARTS)
        return {"loop": self.spent["loop"] - sum(found.values()) - clocks, **found}

    def watch(self, owner: Any, method: str, name: str) -> None:
        """Measure a function of a module or a class from now on."""
        inner: Callable[..., Any] = getattr(owner, method)

        def measured(*args: Any, **options: Any) -> Any:
            if self._within and self._within != "loop":
                return inner(*args, **options)
            outside, self._within = self._within, name
            started = time.process_time()
            try:
                return inner(*args, **options)
            finally:
                self.spent[name] = self.spent.get(name, 0.0) + time.process_time() - started
                self.calls[name] = self.calls.get(name, 0) + 1
                self._within = outside

        setattr(owner, method, measured)


def costs(meter: Meter, scenario: Scenario, drives: int) -> tuple[dict[str, float], bool]:
    """What the parts of a drive's loop cost for each simulated second [ms/s], and whether the drive was certified."""
    done = run(scenario)
    assert done.rollout is not None
    seconds, found = 1e-3 * float(done.rollout.t[-1]), list[dict[str, float]]()
    for _ in range(drives):
        meter.begin()
        run(scenario)
        found.append({part: spent / seconds for part, spent in meter.parts().items()})
    return {part: min(each[part] for each in found) for part in ("loop", *PARTS)}, done.succeeded


def rows(source: Path, drives: int) -> Iterator[list[str]]:
    meter = Meter()
    meter.watch(pipeline, "drive", "loop")
    for owner, method, name in (
        (Senses, "ranges", "scan"),
        (ScanMatcher, "corrected", "match"),
        (OccupancyMap, "insert", "map"),
        (Exploration, "trigger", "watch"),
        (Exploration, "refreshed", "watch"),
        (Caution, "limit", "sight"),
        (Exploration, "replan", "replans"),
    ):
        meter.watch(owner, method, name)
    tasks = barn_tasks(source)
    for sensors, settings in SENSORS:
        shares = []
        for world in WORLDS:
            noise = {"noise": settings["noise"]} if settings else {}
            given, _ = costs(meter, Scenario.of(tasks[world], "astar", "jackal", **noise), drives)
            found, certified = costs(
                meter, Scenario.of(tasks[world], "astar", "jackal", map="none", **settings), drives
            )
            shares.append(sum(found[part] for part in PARTS) / found["loop"])
            name = world if certified else f"{world} (not certified)"
            cells = [f"{found[part]:.2f}" for part in ("loop", *PARTS)]
            yield [sensors, name, f"{given['loop']:.1f}", *cells, f"{100 * shares[-1]:.0f} %"]
        yield [sensors, "median", *[""] * (2 + len(PARTS)), f"{100 * statistics.median(shares):.0f} %"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--barn", type=Path, default=BARN, help="folder or archive of BARN's world_*.world files")
    parser.add_argument("--drives", type=int, default=5, help="how often each drive is repeated")
    options = parser.parse_args()
    if not options.barn.exists():
        print(f"no worlds at {options.barn}; give --barn")
        return
    for line in table(
        ("sensors", "world", "loop with the map [ms/s]", "loop", *PARTS, "share"), rows(options.barn, options.drives)
    ):
        print(line, flush=True)


if __name__ == "__main__":
    main()
