"""Failures found by search: `python -m benchmarks.falsify [--seeds N] [--budget N] [--worlds N] [--jobs N] [TABLE ...]`.

Tables:

- methods: a careless set-up (no smoothing, no margin, the robot's noise, `jackal`), guided search against random worlds
- default: random worlds against the set-up that `antdrive run` has without options, and the same with noise
"""

from __future__ import annotations

import argparse
import collections
import statistics
from collections.abc import Iterator

from joblib import Parallel, delayed

from antdrive.sim import Scenario, run
from antdrive.sim.falsify.failure import failure_of
from antdrive.sim.falsify.handover import fingerprint_of, run_elsewhere
from antdrive.sim.falsify.hunt import Finding, Hunt, find_failures
from antdrive.sim.falsify.search import METHODS
from antdrive.sim.falsify.space import feasible
from benchmarks.planners import table

CARELESS = Scenario.of("empty", "astar", "jackal", margin=0.0, noise=1.0, smoothing="none")
DEFAULT = Scenario.of("empty")


def repeats(findings: tuple[Finding, ...]) -> int:
    """How many failures give the same bits in another process, fail in the same way, and have a path."""
    if not findings:
        return 0
    elsewhere = run_elsewhere([finding.scenario for finding in findings])
    count = 0
    for finding, there in zip(findings, elsewhere, strict=True):
        done = run(finding.scenario)
        same = fingerprint_of(done) == there and failure_of(done) == finding.failure
        count += same and feasible(finding.scenario.task, finding.scenario.inflate)
    return count


def methods(arguments: argparse.Namespace) -> Iterator[str]:
    """Guided search against random worlds, the careless set-up."""
    calls = [(method, seed) for method in METHODS for seed in range(arguments.seeds)]
    found: dict[str, list[Hunt]] = collections.defaultdict(list)
    hunts = Parallel(arguments.jobs)(
        delayed(find_failures)(
            CARELESS, budget=arguments.budget, seed=seed, method=method, obstacles=arguments.obstacles
        )
        for method, seed in calls
    )
    for (method, _), hunt in zip(calls, hunts, strict=True):
        found[method].append(hunt)
    rows = []
    for method, hunted in found.items():
        failures, distinct = [len(hunt.findings) for hunt in hunted], [len(hunt.distinct) for hunt in hunted]
        again = sum(repeats(hunt.findings) for hunt in hunted)
        rows.append(
            [
                method,
                str(arguments.budget),
                f"{statistics.median(failures):g} ({min(failures)}–{max(failures)})",
                f"{statistics.median(distinct):g} ({min(distinct)}–{max(distinct)})",
                f"{again} of {sum(failures)}",
            ]
        )
    heads = ["method", "runs", "failures: median (range)", "different", "feasible and repeated bit for bit"]
    yield from table(heads, rows)


def default(arguments: argparse.Namespace) -> Iterator[str]:
    """Random worlds against the default set-up."""
    rows = []
    for name, setup in (("default", DEFAULT), ("with noise 1", Scenario.of("empty", noise=1.0))):
        share = arguments.worlds // 2 // max(1, arguments.parts)
        hunts = Parallel(arguments.jobs)(
            delayed(find_failures)(setup, budget=share, seed=seed, method="random", obstacles=10)
            for seed in range(arguments.parts)
        )
        kinds = collections.Counter(finding.failure.sentence for hunt in hunts for finding in hunt.findings)
        found = [finding for hunt in hunts for finding in hunt.findings]
        places = ", ".join(finding.scenario.task.world.name for finding in found[:5])
        rows.append([name, str(sum(hunt.runs for hunt in hunts)), str(len(found)), str(dict(kinds) or "–"), places])
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
