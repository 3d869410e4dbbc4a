"""`antdrive shrink`."""

from pathlib import Path
from typing import Annotated, Any

from antdrive.base.errors import InputError
from antdrive.base.tables import file_lines
from antdrive.cli import options
from antdrive.cli.console import show, this_command, working
from antdrive.cli.options import argument, option
from antdrive.cli.output import results_folder
from antdrive.cli.scenario_options import with_calibrated_margin
from antdrive.runs.results_folder import mark_of
from antdrive.views.run_folder import write_result, write_run

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
    planner: options.LogPlanner = None,
    controller: options.LogController = None,
    seconds: Annotated[
        float, option("SECONDS", "Search time [s]; repeating the command continues.", min=1.0, max=1e6)
    ] = 60.0,
    out: options.Out = None,
    no_figures: options.NoFigures = False,
    jobs: Annotated[int, option("NUMBER", "Processes.", min=1, max=64)] = 1,
    json: options.Json = False,
) -> bool:
    """Reduce a failure to a minimal reproducer.

    Removes obstacles, movers, noise and digits, and moves start, goal and walls closer, while the failure stays the same:
    outcome, kind of contact and cause, or the broken bound or baseline of a test. Writes the world, a suite with the
    scenario, the log and its page. Exit code 0: the result fails in the same way in another process.
    """
    from antdrive.runs.failures.failure import broken_bound, failing, parse_bound
    from antdrive.runs.failures.handover import scenario_name
    from antdrive.runs.failures.reproducers import write_reproducer
    from antdrive.runs.failures.shrinker import shrink as make_small

    for kind, given in (("planner", planner), ("controller", controller)):
        if given is not None and "::" in failure:
            raise InputError(f"--{kind}: applies to logs only; the suite names the {kind} of {failure}")
    scenario, case = failing(failure, planner, controller, with_calibrated_margin)
    crossed = parse_bound(bound) if bound is not None else broken_bound(case, scenario)
    name = f"{scenario_name(scenario.task.world.name)}-small"
    mark = mark_of(scenario.key, str(crossed))
    with results_folder(out, Path("out") / name, MARKER, mark) as (folder, _):
        with working("shrinking") as progress:
            journal = folder / "journal.json"
            shrunk = make_small(scenario, bound=crossed, seconds=seconds, journal=journal, jobs=jobs, progress=progress)
        small, suite, repeats = write_reproducer(shrunk, name, folder, bound=crossed)
        files = {"suite": str(suite), "world": str(folder / "worlds" / f"{name}.yaml")}
        report: dict[str, Any] = {"files": files}
        if small.run is not None:  # else the planner or the controller raises an error
            drawn = None if no_figures else ()
            files = {**write_run(small.run, folder, this_command(), drawn, view=True)["files"], **files}
            report = write_result(small.run, files, this_command())
    report |= {**shrunk.as_dict(), "repeats": repeats}
    show(json, report, [*shrunk.lines(repeats), *file_lines(files)])
    return repeats
