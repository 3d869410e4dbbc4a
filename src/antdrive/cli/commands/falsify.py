"""`antdrive falsify`."""

from pathlib import Path
from typing import Annotated, Any

from antdrive.base.files import file_name
from antdrive.base.progress import bar
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.options import option
from antdrive.cli.output import results_folder
from antdrive.cli.scenario_options import Setup
from antdrive.runs.results_folder import mark_of

MARKER = "falsify.json"  # identifies the search in its folder


@options.with_settings(("smoothing", "noise", "controller", "margin", "cell", "seed"))
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
    no_figures: options.NoFigures = False,
    json: options.Json = False,
    **given: Any,
) -> bool:
    """Search for worlds in which a configuration fails.

    Every world has a path. Failures are repeated in another process, shrunk, and written as a suite with pages of the drives.
    Ctrl-C ends the search and keeps the failures found so far. Exit code 0: no failure. Exit code 1: at least one failure.
    """
    from antdrive.runs.failures.hunt import find_failures, validate_method
    from antdrive.runs.failures.reproducers import failure_lines, write_reproducers
    from antdrive.sim.written import Written
    from antdrive.views.failure_folders import write_failures

    validate_method(method)
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
        with bar("shrinking") as shrinking:
            reported = write_reproducers(hunt, folder, seconds=seconds, progress=shrinking)
        write_failures(reported, folder, None if no_figures else ())
    facts = {
        "planner": scenario.planner_label,
        "robot": scenario.robot.name,
        **search,
        **hunt.as_dict(),
        "folder": str(folder) if reported else None,
        "reported": [one.as_dict() for one in reported],
    }
    show(json, facts, failure_lines(hunt, reported, folder))
    return not hunt.findings
