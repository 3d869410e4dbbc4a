"""`antdrive shrink`."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import file_lines, show, this_command, working
from antdrive.cli.options import argument, flag, option
from antdrive.cli.output import film_drives, results_folder
from antdrive.cli.parse import log_at
from antdrive.cli.scenario_options import with_chosen_margin
from antdrive.runs.results_folder import mark_of
from antdrive.views.run_folder import write_result, write_run

if TYPE_CHECKING:
    from antdrive.runs.failures.shrinker import Shrunk
    from antdrive.runs.suites.demands import Bound
    from antdrive.runs.suites.suite import SuiteCase
    from antdrive.sim.scenario import Scenario

MARKER = "shrink.json"  # identifies the failure in its folder


def shrink(
    failure: Annotated[str, argument("ROLLOUT|SUITE::SCENARIO", "Failed drive (log or folder) or test of a suite.")],
    bound: Annotated[
        str | None,
        option(
            "BOUND",
            'Failure, such as "min_clearance_m < 0.02".  [default: anything but a certified success]',
            "--while",
        ),
    ] = None,
    planner: Annotated[str | None, option("FILE.py:CLASS", "Class of the log's planner, if not registered.")] = None,
    seconds: Annotated[
        float, option("SECONDS", "Search time [s]; repeating the command continues.", min=1.0, max=1e6)
    ] = 60.0,
    out: options.Out = None,
    film: Annotated[bool, flag("Film the reproducer.", "--film/--no-film")] = True,
    figures: options.Figures = True,
    jobs: Annotated[int, option("NUMBER", "Processes.", min=1, max=64)] = 1,
    json: options.Json = False,
) -> bool:
    """Reduce a failure to a minimal reproducer.

    Removes obstacles, movers, noise and digits, and moves start, goal and walls closer, while the failure stays the same:
    outcome, kind of contact and cause, or the broken bound or baseline of a test. Writes the world, a suite with the
    scenario, the log and a film. Exit code 0: the result fails in the same way in another process.
    """
    from antdrive.runs.failures.failure import parse_bound
    from antdrive.runs.failures.handover import scenario_name
    from antdrive.runs.failures.reproducers import write_reproducer
    from antdrive.runs.failures.shrinker import shrink as make_small

    if planner is not None and "::" in failure:
        raise InputError(f"--planner: applies to logs only; the suite names the planner of {failure}")
    scenario, case = _of_a_test(failure) if "::" in failure else (_of_a_log(failure, planner), None)
    crossed = parse_bound(bound) if bound is not None else _broken_bound(case, scenario)
    name = f"{scenario_name(scenario.task.world.name)}-small"
    mark = mark_of(scenario.key, str(crossed))
    with results_folder(out, Path("out") / name, MARKER, mark) as (folder, _):
        with working("shrinking") as progress:
            journal = folder / "journal.json"
            shrunk = make_small(scenario, bound=crossed, seconds=seconds, journal=journal, jobs=jobs, progress=progress)
        small, suite, repeats = write_reproducer(shrunk, name, folder, bound=crossed)
        files = {"suite": str(suite), "world": str(folder / "worlds" / f"{name}.yaml")}
        report: dict[str, Any] = {"files": files}
        if small.run is not None:  # else the planner raises an error
            files = {**write_run(small.run, folder, this_command(), figures=figures)["files"], **files}
            if film and small.rollout is not None:
                files["film"] = film_drives([small.rollout], folder / f"{name}.mp4")["file"]
            report = write_result(small.run, files, this_command())
    report |= {
        "failure": dataclasses.asdict(shrunk.failure),
        "summary": shrunk.summary,
        "complete": shrunk.complete,
        "repeats": repeats,
        "trials": shrunk.runs,
        "recalled": shrunk.recalled,
    }
    show(json, report, _lines(shrunk, files, repeats))
    return repeats


def _of_a_test(words: str) -> "tuple[Scenario, SuiteCase]":
    """Return the scenario of a suite's test, and the test."""
    from antdrive.runs.suites.scenarios import scenario_of, select

    cases = select([words])
    if len(cases) > 1:
        raise InputError(f"{words}: name one of {', '.join(case.address for case in cases[:5])}")
    return scenario_of(cases[0], with_chosen_margin), cases[0]


def _broken_bound(case: "SuiteCase | None", scenario: "Scenario") -> "Bound | None":
    """Return the bound of a test or its baseline that the drive breaks although it ends as expected."""
    from antdrive.runs.failures.failure import Attempt, bound_broken_in

    if case is None or not (case.demands.bounds or case.entry.baseline):
        return None
    done = Attempt.of(scenario).run
    return None if done is None else bound_broken_in(case, done)


def _of_a_log(words: str, planner: str | None) -> "Scenario":
    """Rebuild the scenario of a log from its record."""
    from antdrive.base.errors import input_error
    from antdrive.runs.suites.suite import SUFFIX
    from antdrive.sim.log.rollout import read_record
    from antdrive.sim.written import rebuilt

    if words.endswith(SUFFIX):
        raise InputError(f"{words}: is a suite; name one of its tests: {words}::SCENARIO")
    words = str(log_at(Path(words)))
    try:
        return rebuilt(read_record(words), planner)
    except InputError as error:
        raise error if str(error).startswith(words) else input_error(words, str(error)) from None


def _lines(shrunk: "Shrunk", files: dict[str, str], repeats: bool) -> Iterator[str]:
    yield f"{shrunk.original.task.world.name}: {shrunk.failure.sentence}"
    smaller = "smaller" if shrunk.smaller else "no smaller"
    yield f"{smaller} after {shrunk.runs} runs: {shrunk.summary}"
    if not shrunk.complete:
        yield "time limit reached: repeat the command to continue, or raise --seconds"
    if not repeats:
        yield "the reproducer did not fail in the same way in another process: the scenario is not deterministic"
    yield from file_lines(files)
