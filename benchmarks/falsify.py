"""Failures found by search: `python -m benchmarks.falsify [--seeds N] [--budget N] [--worlds N] [--jobs N] [--results FILE.jsonl]
[TABLE ...]`.

With a file of results each search is a line as soon as it is over, and a later call makes those that are missing.

Tables:

- methods: a careless set-up (no smoothing, no margin, the robot's noise, `turtlebot`), guided search against random worlds
- default: random worlds against the set-up that `antdrive run` has without options, and the same with noise
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import statistics
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from antdrive.sim import Scenario, run
from antdrive.sim.falsify.failure import failure_of
from antdrive.sim.falsify.handover import fingerprint_of, run_elsewhere
from antdrive.sim.falsify.hunt import Finding, Hunt, find_failures
from antdrive.sim.falsify.search import METHODS
from antdrive.sim.falsify.space import feasible
from benchmarks.planners import table
from benchmarks.resuming import append_line, current_commit, read_lines

SETUPS = {
    "careless": Scenario.of("empty", "astar", "turtlebot", margin=0.0, noise=1.0, smoothing="none"),
    "default": Scenario.of("empty"),
    "with noise 1": Scenario.of("empty", noise=1.0),
}


@dataclasses.dataclass(frozen=True)
class Search:
    """What a search found, as a line of the file of results.

    Attributes:
        table: methods or default
        setup: the name of the set-up
        method: guided or random
        seed: of the search
        budget: runs that it may make
        obstacles: cylinders in each world
        runs: runs that it made
        failures: how each failure failed, in words, in their order
        worlds: the name of each failure's world
        distinct: how many failures differ from all before them
        repeated: how many failures repeat in another process bit for bit, in a world with a path
        commit: the commit of antdrive
    """

    table: str
    setup: str
    method: str
    seed: int
    budget: int
    obstacles: int
    runs: int
    failures: list[str]
    worlds: list[str]
    distinct: int
    repeated: int
    commit: str

    @property
    def key(self) -> tuple[Any, ...]:
        """What is asked for."""
        return self.table, self.setup, self.method, self.seed, self.budget, self.obstacles


def search(table: str, setup: str, method: str, seed: int, budget: int, obstacles: int) -> Hunt:
    """The search of a key of `Search`."""
    return find_failures(SETUPS[setup], budget=budget, seed=seed, method=method, obstacles=obstacles)


def as_line(asked: tuple[Any, ...], hunt: Hunt) -> Search:
    """What a search found, and whether it repeats."""
    found = [finding.failure.sentence for finding in hunt.findings]
    worlds = [finding.scenario.task.world.name for finding in hunt.findings]
    again = sum(map(repeats, hunt.findings))
    return Search(*asked, hunt.runs, found, worlds, len(hunt.distinct), again, current_commit())


def repeats(finding: Finding) -> bool:
    """Whether a failure gives the same bits in another process, fails in the same way, and has a path."""
    done = run(finding.scenario)
    same = run_elsewhere([finding.scenario]) == [fingerprint_of(done)]
    room = feasible(finding.scenario.task, finding.scenario.inflate)
    return same and room and failure_of(done) == finding.failure


def searched(arguments: argparse.Namespace, asked: Sequence[tuple[Any, ...]]) -> list[Search]:
    """The searches that are asked for: those of the file of results, and all others now, each a line as soon as it is over."""
    known = {one.key: one for one in (Search(**line) for line in read_lines(arguments.results))}
    missing = [key for key in asked if key not in known]
    for first in range(0, len(missing), arguments.jobs):
        keys = missing[first : first + arguments.jobs]
        hunts = Parallel(arguments.jobs)(delayed(search)(*key) for key in keys)
        for key, hunt in zip(keys, hunts, strict=True):
            known[key] = as_line(key, hunt)
            append_line(arguments.results, dataclasses.asdict(known[key]))
            print(*key, f"{len(hunt.findings)} failures", file=sys.stderr, flush=True)
    return [known[key] for key in asked]


def methods(arguments: argparse.Namespace) -> Iterator[str]:
    """Guided search against random worlds, the careless set-up."""
    seeds, budget, obstacles = range(arguments.seeds), arguments.budget, arguments.obstacles
    # Seed by seed, so that an unfinished file has as many of each method.
    asked = [("methods", "careless", method, seed, budget, obstacles) for seed in seeds for method in METHODS]
    done, rows = searched(arguments, asked), []
    for method in METHODS:
        mine = [one for one in done if one.method == method]
        failures, distinct = [len(one.failures) for one in mine], [one.distinct for one in mine]
        rows.append(
            [
                method,
                str(arguments.budget),
                f"{statistics.median(failures):g} ({min(failures)}–{max(failures)})",
                f"{statistics.median(distinct):g} ({min(distinct)}–{max(distinct)})",
                f"{sum(one.repeated for one in mine)} of {sum(failures)}",
            ]
        )
    heads = ["method", "runs", "failures: median (range)", "different", "feasible and repeated bit for bit"]
    yield from table(heads, rows)


def default(arguments: argparse.Namespace) -> Iterator[str]:
    """Random worlds against the default set-up."""
    share, names = arguments.worlds // 2 // max(1, arguments.parts), ("default", "with noise 1")
    asked = [("default", name, "random", seed, share, 10) for seed in range(arguments.parts) for name in names]
    done, rows = searched(arguments, asked), []
    for name in names:
        mine = [one for one in done if one.setup == name]
        kinds = collections.Counter(text for one in mine for text in one.failures)
        worlds = [world for one in mine for world in one.worlds]
        runs = sum(one.runs for one in mine)
        rows.append([name, str(runs), str(len(worlds)), str(dict(kinds) or "–"), ", ".join(worlds[:5])])
    yield from table(["set-up", "worlds", "failures", "kinds", "worlds"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", help="tables to print; default: all")
    parser.add_argument("--seeds", type=int, default=10, help="searches of each method")
    parser.add_argument("--budget", type=int, default=100, help="runs of each search")
    parser.add_argument("--obstacles", type=int, default=10, help="cylinders in each world")
    parser.add_argument("--worlds", type=int, default=1000, help="random worlds against the default set-up")
    parser.add_argument("--parts", type=int, default=10, help="into how many searches these are divided")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--results", type=Path, help="file with a line for each search, to go on with")
    arguments = parser.parse_args()
    makers = {"methods": methods, "default": default}
    for name in arguments.tables or makers:
        if name not in makers:
            parser.error(f"no table is called {name!r}; choose from {', '.join(makers)}")
        print(f"## {name}\n")
        for line in makers[name](arguments):
            print(line, flush=True)


if __name__ == "__main__":
    main()
