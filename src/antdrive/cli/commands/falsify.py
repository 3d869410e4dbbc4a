"""`antdrive falsify`."""

import contextlib
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.files import file_name
from antdrive.base.tables import table
from antdrive.cli import options
from antdrive.cli.console import bar, show
from antdrive.cli.options import flag, option
from antdrive.cli.output import film_drives, results_folder
from antdrive.cli.scenario_options import Setup
from antdrive.runs.results_folder import mark_of
from antdrive.views.run_folder import RUN_FILES, write_result, write_run

if TYPE_CHECKING:
    from antdrive.runs.failures.hunt import Hunt
    from antdrive.runs.failures.reproducers import Reproducer

MARKER = "falsify.json"  # identifies the search in its folder


@options.with_settings(("smoothing", "noise", "margin", "cell", "seed"))
def falsify(
    *,
    budget: Annotated[int, option("NUMBER", "Maximum number of runs.", min=1, max=1_000_000)] = 100,
    method: Annotated[
        str, option("NAME", "World selection: guided (by rehearsals without physics) or random.")
    ] = "guided",
    obstacles: Annotated[int, option("NUMBER", "Cylinders per world.", min=1, max=50)] = 10,
    setup: Setup,
    out: options.Out = None,
    seconds: Annotated[
        float,
        option("SECONDS", "Time limit for shrinking each failure [s]; 0 disables it.", "--shrink", min=0.0, max=1e6),
    ] = 20.0,
    film: Annotated[bool, flag("Film and draw each failure.", "--film/--no-film")] = True,
    json: options.Json = False,
    **given: Any,
) -> bool:
    """Search for worlds in which a configuration fails.

    Every world has a path. Failures are repeated in another process, shrunk, and written as a suite with films.
    Ctrl-C ends the search and keeps the failures found so far. Exit code 0: no failure. Exit code 1: at least one failure.
    """
    from antdrive.runs.failures.hunt import check_method, find_failures
    from antdrive.sim.written import Written

    check_method(method)
    seed = given.pop("seed")
    scenario = setup.scenario(Written(world="empty"), given)
    mark = mark_of(scenario.key, budget, seed, method, obstacles, seconds)
    usual = Path("out") / file_name(f"falsify-{setup.planner}-{scenario.robot.name}-{seed}")
    search: dict[str, Any] = {"budget": budget, "seed": seed, "method": method}
    with results_folder(out, usual, MARKER, mark) as (folder, _):
        with bar("searching for failures") as progress:
            hunt = find_failures(
                scenario, obstacles=obstacles, progress=lambda runs, failures: progress(runs / budget), **search
            )
        reported = _report(hunt, folder, seconds, film)
    facts = {
        "planner": scenario.planner_label,
        "robot": scenario.robot.name,
        **search,
        "runs": hunt.runs,
        "driven": hunt.driven,
        "interrupted": hunt.interrupted,
        "failures": len(hunt.findings),
        "distinct": len(hunt.distinct),
        "folder": str(folder) if reported else None,
        "reported": [one.as_dict() for one in reported],
    }
    show(json, facts, _lines(hunt, reported, folder, film))
    return not hunt.findings


def _report(hunt: "Hunt", folder: Path, seconds: float, film: bool) -> "list[Reproducer]":
    """Shrink, repeat and write each distinct failure, replacing those of an earlier search."""
    from antdrive.runs.failures.reproducers import SUITE, write_reproducers

    reported = []
    if hunt.findings:
        with bar("shrinking") as progress:
            reported = write_reproducers(hunt, folder, seconds=seconds, progress=progress)
    else:
        (folder / SUITE).unlink(missing_ok=True)
    for place in folder.glob("failure-*/"):
        for name in (*RUN_FILES, "film.mp4"):
            (place / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # it holds other files
            place.rmdir()
    for one in reported:
        small = one.small.run
        if small is None:  # planning raised an error; the suite has the world
            continue
        command = shlex.join(["antdrive", "check", f"{folder / SUITE}::{one.name}"])
        report = write_run(small, folder / one.name, command, figures=film)
        if film and small.rollout is not None:
            filmed = film_drives([small.rollout], folder / one.name / "film.mp4")["file"]
            write_result(small, {**report["files"], "film": filmed}, command)
    return reported


def _lines(hunt: "Hunt", reported: "list[Reproducer]", folder: Path, filmed: bool) -> Iterator[str]:
    from antdrive.runs.failures.reproducers import SUITE

    ended = "interrupted after" if hunt.interrupted else "after"
    runs = f"{hunt.runs} runs (the robot drove in {hunt.driven})"
    yield f"{ended} {runs}: {len(hunt.findings)} failures, {len(hunt.distinct)} distinct"
    if reported:
        rows = (
            (
                one.name,
                str(one.finding.number),
                "yes" if one.repeats else "NO",
                f"{len(one.finding.scenario.task.world.obstacles)} -> {len(one.small.scenario.task.world.obstacles)}",
                one.finding.failure.sentence,
            )
            for one in reported
        )
        yield from table(("name", "run", "repeats", "obstacles", "failure"), rows)
        yield f"suite of the failures, {'with worlds, logs and films' if filmed else 'with worlds and logs'}: {folder}"
        yield f"repeat: {shlex.join(['antdrive', 'check', str(folder / SUITE)])}"
        yield f"report: {shlex.join(['antdrive', 'report', str(folder), '-o', str(folder / 'report.html')])}"
