"""`antdrive shrink`."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.atomic import claimed
from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import print_files, print_json, print_line, working
from antdrive.cli.exits import FAILED, SUCCEEDED
from antdrive.cli.write import (
    check_folder,
    fingerprint,
    free_folder,
    this_command,
    write_film,
    write_marker,
    write_result,
    write_run,
)

if TYPE_CHECKING:
    from antdrive.runs.failures.handover import Handover
    from antdrive.runs.failures.shrink import Shrunk
    from antdrive.runs.suites.demands import Bound
    from antdrive.runs.suites.suite import SuiteCase
    from antdrive.sim.scenario import Scenario

MARKER = "shrink.json"  # which failure a folder is of
While = Annotated[
    str | None,
    typer.Option(
        "--while",
        metavar="BOUND",
        help='What counts as failing, such as "min_clearance_m < 0.02".  [default: anything but a certified success]',
    ),
]
Seconds = Annotated[
    float,
    typer.Option(min=1.0, max=1e6, metavar="SECONDS", help="Time for the search [s]; a later call goes on from there."),
]
OwnPlanner = Annotated[
    str | None,
    typer.Option(
        "--planner",
        "-p",
        metavar="FILE.py:CLASS",
        help="Where the class of a log's planner is, if it is not registered.",
    ),
]
Film = Annotated[bool, typer.Option("--film/--no-film", help="Film the small failure.")]
Jobs = Annotated[int, typer.Option(min=1, max=64, metavar="NUMBER", help="Processes; the result is the same.")]


def shrink(
    failure: Annotated[
        str,
        typer.Argument(
            metavar="ROLLOUT|SUITE::SCENARIO", help="Log of a failed drive or its folder, or a test of a suite."
        ),
    ],
    bound: While = None,
    planner: OwnPlanner = None,
    seconds: Seconds = 60.0,
    out: options.Out = None,
    film: Film = True,
    figures: options.Figures = True,
    jobs: Jobs = 1,
    json: options.Json = False,
) -> int:
    """Find the smallest world that still fails.

    It fails in the same way: same outcome, same kind of thing touched, same cause; a test that ends as expected but breaks a
    bound of its `expect`, or is worse than its baseline allows, does that in the same way. Leaves out obstacles and movers, noise
    and digits, and moves start, goal and walls nearer. Writes the world, a suite with the scenario and how it fails, the log
    and a film. Exit code 0: the result fails in the same way, in another process too.
    """
    from antdrive.cli.testing.checking import RAISED
    from antdrive.runs.failures.failure import parse_bound
    from antdrive.runs.failures.handover import Handover, scenario_name
    from antdrive.runs.failures.shrink import shrink as make_small
    from antdrive.sim.pipeline import run

    if planner is not None and "::" in failure:
        raise InputError(f"--planner: is for logs; the suite says which planner {failure} has")
    scenario, case = _of_a_test(failure) if "::" in failure else (_of_a_log(failure, planner), None)
    crossed = parse_bound(bound) if bound is not None else _bound_not_kept(case, scenario)
    name = f"{scenario_name(scenario.task.world.name)}-small"
    mark = fingerprint(scenario, str(crossed))
    folder = out or free_folder(Path("out") / name, MARKER, mark)
    check_folder(folder)
    compile_once()
    with claimed(folder):
        write_marker(folder / MARKER, {"fingerprint": mark, "command": this_command()})
        with working("shrinking") as progress:
            journal = folder / "journal.json"
            shrunk = make_small(scenario, bound=crossed, seconds=seconds, journal=journal, jobs=jobs, progress=progress)
        note = f"shrunk from {scenario.task.world.name}: {shrunk.summary}"
        least = named(shrunk.scenario, name, note)
        small = least if shrunk.failure.outcome == RAISED else run(least)
        handover = Handover(
            name, small, crossed, shrunk.failure.sentence, _planner_beside(case, planner, scenario, folder)
        )
        report, repeats = _write(shrunk, handover, folder, film, figures)
    if json:
        print_json(report)
    else:
        _print(shrunk, report, repeats)
    return SUCCEEDED if repeats else FAILED


def _of_a_test(words: str) -> "tuple[Scenario, SuiteCase]":
    """A suite's test and its scenario."""
    from antdrive.cli.calibrating import with_chosen_margin
    from antdrive.runs.suites.scenarios import scenario_of
    from antdrive.runs.suites.selecting import select

    cases = select([words])
    if len(cases) > 1:
        raise InputError(f"{words}: name one of {', '.join(case.address for case in cases[:5])}")
    return scenario_of(cases[0], with_chosen_margin), cases[0]


def _bound_not_kept(case: "SuiteCase | None", scenario: "Scenario") -> "Bound | None":
    """What counts as failing where a test's drive ends as expected and breaks a bound of the test or of its baseline."""
    from antdrive.planners import PlannerError
    from antdrive.runs.failures.failure import bound_broken_in
    from antdrive.sim.pipeline import run

    if case is None or not (case.demands.bounds or case.entry.baseline):
        return None
    compile_once()
    try:
        return bound_broken_in(case, run(scenario))
    except PlannerError:  # the failure itself
        return None


def _of_a_log(words: str, planner: str | None) -> "Scenario":
    """The scenario of a log, rebuilt from its record."""
    from antdrive.base.errors import input_error
    from antdrive.runs.failures.rebuild import rebuilt
    from antdrive.runs.suites.suite import SUFFIX
    from antdrive.sim.log.rollout import read_record

    if words.endswith(SUFFIX):
        raise InputError(f"{words}: is a suite; name one of its tests, as {words}::SCENARIO")
    if (log := Path(words) / "rollout.npz").is_file():
        words = str(log)
    try:
        return rebuilt(read_record(words), planner)
    except InputError as error:
        raise error if str(error).startswith(words) else input_error(words, str(error)) from None


def _planner_beside(
    case: "SuiteCase | None", own: str | None, scenario: "Scenario", folder: Path
) -> "str | dict[str, Any] | None":
    """A planner that is not registered, in the words of a suite in another folder; None for all others."""
    from antdrive.runs.failures.handover import planner_moved, planner_words

    if case is not None:
        return planner_moved(case.entry.planner, case.suite.parent, folder)
    return None if own is None else planner_moved(planner_words(scenario, own), Path.cwd(), folder.absolute())


def _write(
    shrunk: "Shrunk", handover: "Handover", folder: Path, film: bool, figures: bool
) -> tuple[dict[str, Any], bool]:
    """Write everything about a small failure; the report, and whether the written suite gives the same run elsewhere."""
    from antdrive.runs.failures.failure import failure_of, without_numbers
    from antdrive.runs.failures.handover import fingerprint_of, suite_elsewhere, write_suite
    from antdrive.sim.pipeline import Run

    name, result = handover.name, handover.run
    suite = write_suite(folder / f"{name}.drive.yaml", [handover])
    files = {"suite": str(suite), "world": str(folder / "worlds" / f"{name}.yaml")}
    elsewhere = suite_elsewhere(suite)
    if not isinstance(result, Run):  # the planner raises something
        repeats = [without_numbers(text) for text in elsewhere] == [shrunk.failure.cause]
        return {"files": files, **_facts(shrunk, repeats)}, repeats
    repeats = failure_of(result, handover.bound) == shrunk.failure and elsewhere == [fingerprint_of(result)]
    files = {**write_run(result, folder, figures=figures), **files}
    if film and result.rollout is not None:
        files["film"] = write_film(result.rollout, folder / f"{name}.mp4")["file"]
    return {**write_result(result, files, this_command()), **_facts(shrunk, repeats)}, repeats


def _facts(shrunk: "Shrunk", repeats: bool) -> dict[str, Any]:
    return {
        "failure": dataclasses.asdict(shrunk.failure),
        "summary": shrunk.summary,
        "complete": shrunk.complete,
        "repeats": repeats,
        "trials": shrunk.trials,
        "recalled": shrunk.recalled,
    }


def named(scenario: "Scenario", name: str, note: str) -> "Scenario":
    """The scenario with another name of its world, and a note where the world comes from."""
    task = scenario.task
    source = "; ".join(part for part in (task.world.source, note) if part)
    world = dataclasses.replace(task.world, name=name, source=source)
    return dataclasses.replace(scenario, task=dataclasses.replace(task, world=world))


def _print(shrunk: "Shrunk", report: dict[str, Any], repeats: bool) -> None:
    print_line(f"{shrunk.original.task.world.name}: {shrunk.failure.sentence}")
    smaller = "smaller" if shrunk.smaller else "no smaller"
    print_line(f"{smaller} after {shrunk.trials} runs: {shrunk.summary}")
    if not shrunk.complete:
        print_line("the time was over: the same command goes on from here, --seconds gives it longer")
    if not repeats:
        print_line("the small scenario did not repeat in another process; what it uses is not deterministic")
    print_files(report["files"])
