"""What suites cost, and whether they flake: `python -m benchmarks.suites [--scenarios 200] [--jobs 2]`, or `--repeats N`.

`--scenarios` makes a suite of random worlds, accepts it, and checks it without films; collecting it is timed apart. Processor
seconds are those of all processes, so that they can be compared between busy and quiet machines.

`--repeats N` drives the tests of `examples/regression_suite` N times over, in the order of the file and shuffled, in one
process, with `pytest -n 2` and with `antdrive check --jobs 2`, and counts tests that failed and drives that were not the first
ones, bit for bit.
"""

from __future__ import annotations

import argparse
import itertools
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import yaml

from benchmarks.planners import table
from benchmarks.suite_runs import EXAMPLE, PLUGINS, Tests, environment, with_check, with_pytest


def suite(scenarios: int) -> str:
    """A suite of random worlds: forests with a turtlebot and barn worlds with a jackal, five seeds each."""
    entries = {}
    for k in range(max(1, scenarios // 10)):
        entries[f"forest-{k}"] = {"world": {"generate": "forest", "seed": k}, "robot": "turtlebot"}
        entries[f"barn-{k}"] = {"world": {"generate": "barn", "seed": k}, "robot": "jackal"}
    defaults = {"planner": "astar", "noise": 1, "seeds": "0-4"}
    return yaml.safe_dump({"schema": 1, "defaults": defaults, "scenarios": entries}, sort_keys=False)


def timed(folder: Path, *words: str) -> tuple[str, str, str]:
    """The wall time and the processor time of a command, and what it printed last."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [sys.executable, "-m", *words]
    done = subprocess.run(command, cwd=folder, env=environment(None, None), capture_output=True, text=True, check=False)
    wall, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    said = [line.strip() for line in done.stdout.splitlines() if line.strip()] or [done.stderr[-200:]]
    return f"{wall:.1f} s", f"{used:.1f} s", said[-1]


def speed(scenarios: int, jobs: int) -> Iterator[list[str]]:
    """A row for each command on a suite of its own."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "many.drive.yaml").write_text(suite(scenarios))
        results = ("--film", "never", "--results", "results")
        for words in (
            ("pytest", "--collect-only", "-q", *PLUGINS),
            ("antdrive", "accept", "many.drive.yaml", "--jobs", str(jobs)),
            ("antdrive", "check", "many.drive.yaml", "--jobs", str(jobs), *results),
        ):
            yield [f"`{' '.join(words[:2])}`, {scenarios} scenarios", *timed(folder, *words)]


def ways() -> Iterator[tuple[str, Callable[[Path], Tests]]]:
    """Ways to run the tests of a folder, by turns, each time in another order."""
    for seed in itertools.count(1):
        shuffled = {"ANTDRIVE_SHUFFLE": str(seed), "PYTHONHASHSEED": str(seed)}
        yield "antdrive check --jobs 2", lambda folder: with_check(folder, "--jobs", "2")
        yield "pytest, shuffled", lambda folder, env=shuffled: with_pytest(folder, env=env)  # type: ignore[misc]
        yield "pytest -n 2", lambda folder: with_pytest(folder, "-n", "2")
        yield "pytest", lambda folder: with_pytest(folder)


def repeats(times: int) -> Iterator[list[str]]:
    """A row for each way to run the example's tests."""
    found: dict[str, list[int]] = {}
    first: Tests = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(shutil.copytree(EXAMPLE, Path(name) / "checkout", ignore=shutil.ignore_patterns("__pycache__")))
        for way, run in itertools.islice(ways(), times):
            tests = run(folder)
            first = {**tests, **first}
            failed = sum(not test["passed"] for test in tests.values())
            other = sum(test["digest"] != first[name]["digest"] for name, test in tests.items())
            counts = found.setdefault(way, [0, 0, 0])
            counts[:] = [a + b for a, b in zip(counts, (len(tests), failed, other), strict=True)]
            print(way, counts, file=sys.stderr)
    for way, counts in found.items():
        yield [f"`{way}`", *map(str, counts)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", type=int, default=200, help="of the generated suite")
    parser.add_argument("--jobs", type=int, default=2, help="processes of accept and check")
    parser.add_argument("--repeats", type=int, default=0, help="how often to run the example's tests instead")
    arguments = parser.parse_args()
    if arguments.repeats:
        found = table(["run with", "tests", "failed", "other drive"], repeats(arguments.repeats))
    else:
        heads = ["command", "wall time", "processor time", "says"]
        found = table(heads, speed(arguments.scenarios, arguments.jobs))
    for line in found:
        print(line)


if __name__ == "__main__":
    main()
