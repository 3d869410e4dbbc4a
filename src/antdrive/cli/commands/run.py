"""`antdrive run`."""

from pathlib import Path
from typing import Annotated, Any

from antdrive.base.atomic import folder_lock
from antdrive.base.progress import bar, shown_progress
from antdrive.base.tables import file_lines, marked
from antdrive.cli import options
from antdrive.cli.console import planning, print_error, show, this_command
from antdrive.cli.options import option
from antdrive.cli.output import film_drives, print_idle_settings
from antdrive.cli.scenario_options import Ends, Setup
from antdrive.sim.settings import SETTINGS
from antdrive.views.run_folder import (
    check_folder,
    default_folder,
    formats_of,
    naming_saved,
    write_result,
    write_run,
)


@options.with_settings(name for name, one in SETTINGS.items() if one.flag)
def run(
    *,
    world: options.World,
    setup: Setup,
    ends: Ends,
    out: options.Out = None,
    film: Annotated[Path | None, option("FILE", "Film: .mp4, .gif or .webp.", panel="Output")] = None,
    filming: options.Filming,
    figures: options.Figures = None,
    no_figures: options.NoFigures = False,
    no_view: options.NoView = False,
    json: options.Json = False,
    **given: Any,
) -> bool:
    """Plan a path, drive it in physics and certify the drive.

    Exit code 0: the robot stopped at the goal and its log proves the drive collision-free.
    """
    from antdrive.planners import keep_best
    from antdrive.sim.pipeline import plan
    from antdrive.sim.pipeline import run as drive
    from antdrive.sim.summary import run_lines

    with shown_progress("reading the scenario"):
        scenario = setup.scenario(ends.of(world), given)
    folder = out or default_folder(scenario)
    drawn = formats_of(figures, no_figures)
    film_options = filming.checked(film, [scenario])
    check_folder(folder)
    print_idle_settings([scenario])
    with folder_lock(folder):
        with planning(f"planning with {scenario.planner_name}"), keep_best():  # Ctrl-C keeps the best path so far
            planned = plan(scenario)
        with bar("driving") as progress:
            result = drive(scenario, planned=planned, progress=progress)
        with shown_progress("writing log and figures"):
            report = write_run(result, folder, this_command(), drawn, view=not no_view)
        if film is not None and result.rollout is not None:
            with naming_saved(report["files"].values()):
                filmed = film_drives(result.rollout, film, **film_options)["file"]
                report = write_result(result, {**report["files"], "film": filmed}, this_command())
        elif film is not None:
            print_error(f"--film {film}: not written, since the robot did not drive")
    first, *rest = run_lines(result)
    lines = [marked(result.succeeded, first), *rest, *file_lines(report["files"])]
    show(json, report, lines)
    return result.succeeded
