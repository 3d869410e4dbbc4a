"""Cost and flakiness of suites: `python -m benchmarks.suites [--scenarios 200] [--jobs 2]`, or
`--repeats N [--within M] [--results FILE.jsonl]`.

`--scenarios` generates a suite of random worlds, accepts it, and checks it without films; collection is timed separately.
Processor seconds cover all processes, so busy and quiet machines are comparable.

`--repeats N` runs the tests of `examples/regression_suite` N times: in file order and shuffled, in one process and with
`pytest -n 2`, M times per pytest run, and occasionally with `antdrive check --jobs 2`. It counts failed tests and drives that
differ from the first, bit for bit. Each finished round is a line of the results file; a later call resumes until the file has
N rounds, and a call without `--repeats` summarises the file. The exit code is 1 if a test failed or a drive differed.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import yaml

from benchmarks.markdown import append_line, command_line, current_commit, print_table, read_lines
from tests.audit.suite_runs import EXAMPLE, PLUGINS, Tests, environment, rounds_with_pytest, with_check

SMALLEST = ("--scenarios 2 --jobs 1", "--repeats 1 --within 1")


def suite(scenarios: int) -> str:
    """Write a suite of random worlds: forests with a turtlebot and barn worlds with a jackal, five seeds each."""
    entries = {}
    for k in range(max(1, scenarios // 10)):
        entries[f"forest-{k}"] = {"world": {"generate": "forest", "seed": k}, "robot": "turtlebot"}
        entries[f"barn-{k}"] = {"world": {"generate": "barn", "seed": k}, "robot": "jackal"}
    defaults = {"planner": "astar", "noise": 1, "margin": 0.03, "seeds": "0-4"}
    return yaml.safe_dump({"schema": 1, "defaults": defaults, "scenarios": entries}, sort_keys=False)


def timed(folder: Path, *words: str) -> tuple[str, str, str]:
    """Run a command. Return its wall time, its processor time and its last line."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [sys.executable, "-m", *words]
    done = subprocess.run(command, cwd=folder, env=environment(None, None), capture_output=True, text=True, check=False)
    wall, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    said = [line.strip() for line in done.stdout.splitlines() if line.strip()] or [done.stderr[-200:]]
    return f"{wall:.1f} s", f"{used:.1f} s", said[-1]


def speed(scenarios: int, jobs: int) -> Iterator[list[str]]:
    """Return one row per command, each on its own suite."""
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


def ways(within: int) -> Iterator[tuple[str, Callable[[Path], list[Tests]]]]:
    """Ways to run the tests of a folder, by turns, each time in another order; what comes is the result of each round."""
    for seed in itertools.count(1):
        shuffled = {"ANTDRIVE_SHUFFLE": str(seed), "PYTHONHASHSEED": str(seed)}
        yield "antdrive check --jobs 2", lambda folder: [with_check(folder, "--jobs", "2")]
        yield "pytest, shuffled", functools.partial(rounds_with_pytest, times=within, env=shuffled)
        yield "pytest -n 2", lambda folder: rounds_with_pytest(folder, "-n", "2", times=within)
        yield "pytest", functools.partial(rounds_with_pytest, times=within)


def repeats(times: int, within: int, results: Path | None) -> list[Round]:
    """Return the rounds of a results file, after running at least the missing ones.

    Args:
        times: how many rounds
        within: how many of them are made in one run of pytest
        results: the file; None: all rounds are new, and none is kept
    """
    found = [Round(**line) for line in read_lines(results)]
    sessions = max((one.session for one in found), default=-1) + 1
    with tempfile.TemporaryDirectory() as name:
        folder = Path(shutil.copytree(EXAMPLE, Path(name) / "checkout", ignore=shutil.ignore_patterns("__pycache__")))
        for session, (way, run) in itertools.islice(enumerate(ways(within)), sessions, None):
            if len(found) >= times:
                break
            made = run(folder)
            for tests in made:
                digests = {name: str(test["digest"]) for name, test in tests.items()}
                failed = {name: str(test["message"])[:2000] for name, test in tests.items() if not test["passed"]}
                found.append(Round(session, len(found), way, digests, failed, current_commit()))
                append_line(results, dataclasses.asdict(found[-1]))
            failures = sum(len(one.failed) for one in found[-len(made) :])
            print(f"{len(found)} rounds; {way}: {len(made)} of them, {failures} failed", file=sys.stderr, flush=True)
    return found


@dataclasses.dataclass(frozen=True)
class Round:
    """One run of the example's tests.

    Attributes:
        session: the run of pytest or `antdrive check`, counted from 0; it decides the way and the order of the tests
        number: counted from 0
        way: how the tests were run
        digests: of each test's drive
        failed: the messages of tests that failed, by name
        commit: the commit of antdrive
    """

    session: int
    number: int
    way: str
    digests: dict[str, str]
    failed: dict[str, str]
    commit: str


def others(rounds: Sequence[Round]) -> list[int]:
    """How many drives of each round are not those of the first round that has the test, bit for bit."""
    first: dict[str, str] = {}
    for one in rounds:
        first = {**one.digests, **first}
    return [sum(first[name] != digest for name, digest in one.digests.items()) for one in rounds]


def counted(rounds: Sequence[Round]) -> Iterator[list[str]]:
    """Return one row per way to run the tests."""
    other = dict(zip((one.number for one in rounds), others(rounds), strict=True))
    for way in dict.fromkeys(one.way for one in rounds):
        mine = [one for one in rounds if one.way == way]
        tests, failed = sum(len(one.digests) for one in mine), sum(len(one.failed) for one in mine)
        yield [f"`{way}`", *map(str, (len(mine), tests, failed, sum(other[one.number] for one in mine)))]


def main() -> None:
    arguments = command_line(
        __doc__,
        scenarios=(200, "of the generated suite"),
        jobs=(2, "processes of accept and check"),
        repeats=(0, "how often to run the example's tests instead"),
        within=(10, "how often one run of pytest runs them"),
        results=(Path, "file with a line for each of these runs, to go on with"),
    )
    rounds: list[Round] = []
    if arguments.repeats or arguments.results:
        rounds = repeats(arguments.repeats, arguments.within, arguments.results)
        print_table("run with | rounds | tests | failed | other drive", counted(rounds))
    else:
        print_table("command | wall time | processor time | says", speed(arguments.scenarios, arguments.jobs))
    for one in rounds:
        for name, message in one.failed.items():
            print(f"round {one.number}, {one.way}: {name}: {message.strip().splitlines()[0]}")
    if any(one.failed for one in rounds) or any(others(rounds)):
        sys.exit(1)


if __name__ == "__main__":
    main()
