"""`antdrive falsify`."""

import contextlib
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.atomic import claimed
from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, print_json, print_line, print_table
from antdrive.cli.exits import FAILED, SUCCEEDED
from antdrive.cli.scenario import make_scenario
from antdrive.cli.write import (
    RUN_FILES,
    check_folder,
    file_name,
    fingerprint,
    free_folder,
    this_command,
    write_film,
    write_marker,
    write_result,
    write_run,
)

if TYPE_CHECKING:
    from antdrive.runs.failures.hunt import Hunt
    from antdrive.runs.failures.report import Reported
    from antdrive.sim.scenario import Scenario

MARKER = "falsify.json"  # which search a folder is of
Budget = Annotated[int, typer.Option(min=1, max=1_000_000, metavar="NUMBER", help="Runs that the search may make.")]
Method = Annotated[
    str, typer.Option(metavar="NAME", help="How worlds are chosen: guided (by rehearsals without physics) or random.")
]
Obstacles = Annotated[int, typer.Option(min=1, max=50, metavar="NUMBER", help="Cylinders in each world.")]
Seconds = Annotated[
    float,
    typer.Option("--shrink", min=0.0, max=1e6, metavar="SECONDS", help="Time to shrink each failure [s]; 0: none."),
]
Film = Annotated[bool, typer.Option("--film/--no-film", help="Film and draw each failure.")]
Seed = Annotated[
    int,
    typer.Option(
        "--seed", min=0, max=2**63 - 1, metavar="NUMBER", help="Seed of the search; each run's is its number."
    ),
]


def falsify(
    budget: Budget = 100,
    seed: Seed = 0,
    method: Method = "guided",
    obstacles: Obstacles = 10,
    planner: options.Planner = "ants",
    settings: options.Settings = None,
    robot: options.Robot = "turtlebot",
    margin: options.Margin = 0.03,
    cell: options.CellSize = None,
    smoothing: options.Smoothing = "clearance",
    noise: options.Noise = 0.0,
    out: options.Out = None,
    seconds: Seconds = 20.0,
    film: Film = True,
    json: options.Json = False,
) -> int:
    """Look for worlds where a set-up fails.

    A path exists in each of them. Failures are run again in another process, shrunk, and written as a suite with a film
    each. Ctrl-C keeps what was found. Exit code 0: nothing was found. Exit code 1: the set-up fails in some world.
    """
    from antdrive.planners.own_code import is_own
    from antdrive.runs.failures.hunt import find_failures

    if is_own(planner):
        problem = "failures are run again in other processes, which know registered planners only"
        raise InputError(f"--planner {planner}: {problem}; register the class under the entry point antdrive.planners")
    setup = make_scenario("empty", planner, settings, robot, margin=margin, cell=cell, smoothing=smoothing, noise=noise)
    mark = fingerprint(setup, budget, seed, method, obstacles, seconds)
    usual = Path("out") / file_name(f"falsify-{planner}-{setup.robot.name}-{seed}")
    folder = out or free_folder(usual, MARKER, mark)
    check_folder(folder)
    compile_once()
    with claimed(folder):
        write_marker(folder / MARKER, {"fingerprint": mark, "command": this_command()})
        with bar("looking for failures") as progress:
            hunt = find_failures(
                setup,
                budget=budget,
                seed=seed,
                method=method,
                obstacles=obstacles,
                progress=lambda runs, found: progress(runs / budget),
            )
        reported = _report(hunt, folder, seconds, film)
    if json:
        print_json(_facts(setup, hunt, reported, {"budget": budget, "seed": seed, "method": method}, folder))
    else:
        _print(hunt, reported, folder, film)
    return FAILED if hunt.findings else SUCCEEDED


def _report(hunt: "Hunt", folder: Path, seconds: float, film: bool) -> "list[Reported]":
    """Shrink, repeat and write every failure that differs from the others."""
    from antdrive.runs.failures.report import SUITE, report
    from antdrive.sim.pipeline import Run

    if not hunt.findings:
        _forget(folder)
        (folder / SUITE).unlink(missing_ok=True)
        return []
    with bar("shrinking") as progress:
        reported = report(hunt, folder, seconds=seconds, progress=progress)
    _forget(folder)
    for one in reported:
        if not isinstance(one.run, Run):  # nothing was planned; the suite has the world
            continue
        files = write_run(one.run, folder / one.name, figures=film)
        if film and one.run.rollout is not None:
            files["film"] = write_film(one.run.rollout, folder / one.name / "film.mp4")["file"]
        write_result(one.run, files, shlex.join(["antdrive", "check", f"{folder / SUITE}::{one.name}"]))
    return reported


def _forget(folder: Path) -> None:
    """Remove what an earlier search left in a folder, which would contradict this one."""
    for place in folder.glob("failure-*/"):
        for name in (*RUN_FILES, "film.mp4"):
            (place / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # it holds something else
            place.rmdir()


def _facts(
    setup: "Scenario", hunt: "Hunt", reported: "list[Reported]", asked: dict[str, Any], folder: Path
) -> dict[str, Any]:
    return {
        "planner": setup.planner_label,
        "robot": setup.robot.name,
        **asked,
        "runs": hunt.runs,
        "driven": hunt.driven,
        "interrupted": hunt.interrupted,
        "failures": len(hunt.findings),
        "distinct": len(hunt.distinct),
        "folder": str(folder) if reported else None,
        "reported": [one.as_dict() for one in reported],
    }


def _print(hunt: "Hunt", reported: "list[Reported]", folder: Path, filmed: bool) -> None:
    from antdrive.runs.failures.report import SUITE

    ended = "interrupted after" if hunt.interrupted else "after"
    runs = f"{hunt.runs} runs, {hunt.driven} of them with a path on the grid"
    print_line(f"{ended} {runs}: {len(hunt.findings)} failures, {len(hunt.distinct)} of them different")
    if reported:
        print_table(
            ("name", "run", "repeats", "obstacles", "failure"),
            (
                (
                    one.name,
                    str(one.finding.number),
                    "yes" if one.repeats else "NO",
                    f"{len(one.finding.scenario.task.world.obstacles)} -> {len(one.scenario.task.world.obstacles)}",
                    one.finding.failure.sentence,
                )
                for one in reported
            ),
        )
        words = "with worlds, logs and films" if filmed else "with worlds and logs"
        print_line(f"the failures as a suite, {words}: {folder}")
        print_line(f"repeat: {shlex.join(['antdrive', 'check', str(folder / SUITE)])}")
        print_line(f"a page: {shlex.join(['antdrive', 'report', str(folder), '-o', str(folder / 'report.html')])}")
