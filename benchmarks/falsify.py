"""Falsification of configurations: `python -m benchmarks.falsify [--seeds N] [--budget N] [--worlds N] [--setups NAME ...]
[--jobs N] [--results FILE.jsonl] [TABLE ...]`.

With a results file, each finished search is one line, and a later call runs the missing searches, so a table can be measured
in pieces and extended. Every failure is repeated in another process.

Tables:

- methods: careless configurations (A*, no smoothing, no margin, the robot's noise), guided search against random worlds
- default: random worlds against the default configuration of `antdrive run`
- noise: the same with the robot's noise
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

from antdrive.runs.failures.failure import Attempt, failure_of
from antdrive.runs.failures.hunt import METHODS, Finding, Hunt, find_failures
from antdrive.runs.pool import Pool
from antdrive.sim import Scenario, run
from antdrive.worlds.passage import feasible
from benchmarks.markdown import append_line, chosen, command_line, current_commit, print_tables, read_lines, table

SMALLEST = ("--seeds 1 --budget 2 --worlds 2",)
CARELESS: dict[str, Any] = {"margin": 0.0, "noise": 1.0, "smoothing": "none"}
SETUPS = {
    "careless turtlebot": Scenario.of("empty", "astar", "turtlebot", **CARELESS),
    "careless jackal": Scenario.of("empty", "astar", "jackal", **CARELESS),
    "default": Scenario.of("empty"),
    "noise 1": Scenario.of("empty", noise=1.0, margin=0.03),
}
PIECE = 100  # worlds per search with the default configuration; about ten seconds


@dataclasses.dataclass(frozen=True)
class Search:
    """Result of a search, as a line of the results file.

    Attributes:
        setup: the name of the set-up
        method: guided or random
        seed: of the search
        budget: runs that it may make
        obstacles: cylinders in each world
        runs: runs that it made
        driven: in how many of them the robot drove; in the others the grid had no path
        failures: how each failure failed, in words, in their order
        worlds: the name of each failure's world
        distinct: how many failures differ from all before them
        repeated: how many failures repeat in another process bit for bit, in a world with a path
        commit: the commit of antdrive
    """

    setup: str
    method: str
    seed: int
    budget: int
    obstacles: int
    runs: int
    driven: int
    failures: list[str]
    worlds: list[str]
    distinct: int
    repeated: int
    commit: str

    @property
    def key(self) -> tuple[Any, ...]:
        """What is asked for."""
        return self.setup, self.method, self.seed, self.budget, self.obstacles


def search(key: tuple[Any, ...]) -> tuple[tuple[Any, ...], Hunt]:
    """Run the search of a key. Return the key and the result."""
    setup, method, seed, budget, obstacles = key
    hunt = find_failures(SETUPS[setup], budget=budget, seed=seed, method=method, obstacles=obstacles)
    return key, hunt


def as_line(asked: tuple[Any, ...], hunt: Hunt) -> Search:
    """Return a search result of another process, with whether its failures repeat in this one."""
    found = [finding.failure.sentence for finding in hunt.findings]
    worlds = [finding.scenario.task.world.name for finding in hunt.findings]
    again = sum(map(repeats, hunt.findings))
    return Search(*asked, hunt.runs, hunt.driven, found, worlds, len(hunt.distinct), again, current_commit())


def repeats(finding: Finding) -> bool:
    """Return whether a failure repeats bit for bit, fails in the same way, and has a path."""
    done = run(finding.scenario)
    room = feasible(finding.scenario.task, finding.scenario.inflate)
    return (
        room and Attempt(done.scenario, done).fingerprint == finding.fingerprint and failure_of(done) == finding.failure
    )


def searched(arguments: argparse.Namespace, asked: Sequence[tuple[Any, ...]]) -> list[Search]:
    """Return the requested searches: those in the results file, and the others after running them."""
    known = {one.key: one for one in (Search(**line) for line in read_lines(arguments.results))}
    missing = [key for key in asked if key not in known]
    with Pool(arguments.jobs) as pool:
        for number, (key, hunt) in enumerate(pool.results(search, missing, in_order=False)):
            known[key] = as_line(key, hunt)
            append_line(arguments.results, dataclasses.asdict(known[key]))
            found = f"{known[key].driven} of {hunt.runs} driven, {len(hunt.findings)} failures"
            print(f"{number + 1}/{len(missing)}", *key, found, file=sys.stderr, flush=True)
    return [known[key] for key in asked]


def methods(arguments: argparse.Namespace) -> Iterator[str]:
    """Compare guided search with random worlds on careless configurations."""
    budget, obstacles = arguments.budget, arguments.obstacles
    names = chosen(
        arguments.setups.split(",") if arguments.setups else [name for name in SETUPS if "careless" in name], SETUPS
    )
    # Seed by seed, so that an unfinished file is balanced over configurations and methods.
    asked = [
        (name, method, seed, budget, obstacles)
        for seed in range(arguments.seeds)
        for name in names
        for method in METHODS
    ]
    done, rows = searched(arguments, asked), []
    for name, method in ((name, method) for name in names for method in METHODS):
        mine = [one for one in done if (one.setup, one.method) == (name, method)]
        failures, distinct = [len(one.failures) for one in mine], [one.distinct for one in mine]
        rows.append(
            [
                name,
                method,
                f"{len(mine)} × {budget}",
                f"{statistics.median(failures):g} ({min(failures)}–{max(failures)})",
                f"{statistics.median(distinct):g} ({min(distinct)}–{max(distinct)})",
                f"{sum(one.repeated for one in mine)} of {sum(failures)}",
            ]
        )
    heads = ["set-up", "method", "searches × runs", "failures: median (range)", "different: median (range)"]
    yield from table([*heads, "feasible and repeated bit for bit"], rows)


def default(arguments: argparse.Namespace) -> Iterator[str]:
    """Test the default configuration in random worlds."""
    yield from _worlds(arguments, "default")


def noise(arguments: argparse.Namespace) -> Iterator[str]:
    """Test the default configuration with noise 1 and a margin of 3 cm in random worlds."""
    yield from _worlds(arguments, "noise 1")


def _worlds(arguments: argparse.Namespace, name: str) -> Iterator[str]:
    """Test a configuration in random worlds."""
    pieces = range(-(-arguments.worlds // PIECE))
    budgets = [min(PIECE, arguments.worlds - PIECE * seed) for seed in pieces]
    asked = [(name, "random", seed, budgets[seed], arguments.obstacles) for seed in pieces]
    done = searched(arguments, asked)
    kinds = collections.Counter(text for one in done for text in one.failures)
    worlds = [world for one in done for world in one.worlds]
    facts = [str(sum(one.runs for one in done)), str(sum(one.driven for one in done)), str(len(worlds))]
    facts += [f"{sum(one.repeated for one in done)} of {len(worlds)}"]
    said = "; ".join(f"{count} × {text}" for text, count in kinds.most_common()) or "–"
    heads = ["set-up", "worlds", "driven", "failures", "repeated", "kinds", "worlds with failures"]
    yield from table(heads, [[name, *facts, said, ", ".join(worlds[:10]) or "–"]])


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "tables to print; default: all"),
        seeds=(10, "searches of each set-up and method"),
        budget=(100, "runs of each of these searches"),
        setups=("", f"of the table methods: some of {', '.join(SETUPS)}, with commas; default: the careless"),
        obstacles=(10, "cylinders in each world"),
        worlds=(1000, "random worlds of the tables default and noise"),
        jobs=(2, "searches at the same time"),
        results=(Path, "file with a line for each search, to go on with"),
    )
    print_tables(given.tables, {f.__name__: f for f in (methods, default, noise)}, given)


if __name__ == "__main__":
    main()
