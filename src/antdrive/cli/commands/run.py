"""`antdrive run`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.atomic import claimed
from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, planning, print_json, this_command
from antdrive.cli.exits import FAILED, SUCCEEDED
from antdrive.cli.output import film_drives, print_run
from antdrive.cli.scenario import chosen_task, make_scenario
from antdrive.sim.settings import SETTINGS
from antdrive.views.folder import (
    check_film,
    check_folder,
    default_folder,
    write_result,
    write_run,
)

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario

Film = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Film the drive: .mp4, .gif or .webp.", rich_help_panel="Output")
]
Gui = Annotated[
    bool,
    typer.Option("--gui", help="Replay the drive in a window afterwards; needs a screen.", rich_help_panel="Output"),
]


@options.with_settings(name for name, one in SETTINGS.items() if one.flag)
def run(
    world: options.World,
    planner: options.Planner = "ants",
    settings: options.Settings = None,
    robot: options.Robot = "turtlebot",
    task: options.TaskName = None,
    start: options.Start = None,
    goal: options.Goal = None,
    frame: options.Frame = "world",
    out: options.Out = None,
    film: Film = None,
    prelude: options.Prelude = 0.0,
    vector: options.Vector = False,
    figures: options.Figures = True,
    gui: Gui = False,
    json: options.Json = False,
    **given: Any,
) -> int:
    """Plan a path, drive it in physics and certify the drive.

    Exit code 0: the robot stopped at the goal, and its log proves that it touched nothing.
    """
    scenario = make_scenario(chosen_task(world, task, start, goal, frame), planner, settings, robot, given)
    folder = out or default_folder(scenario)
    _check_views(scenario, film, prelude, gui)
    check_folder(folder)
    compile_once()
    with claimed(folder):
        result = _drive(scenario)
        files = write_run(result, folder, vector=vector, figures=figures)
        report = _write_views(result, files, film, prelude)
    if json:
        print_json(report)
    else:
        print_run(result, files)
    if gui:
        _show(result)
    return SUCCEEDED if result.succeeded else FAILED


def _show(result: "Run") -> None:
    """Replay the drive in a window, if there was one."""
    from antdrive.views.window import show

    if result.rollout is not None:
        show(result.rollout)


def _write_views(result: "Run", files: dict[str, str], film: Path | None, prelude: float) -> dict[str, Any]:
    """Write the result and, if asked for, the film, and the result again with it; what was written."""
    report = write_result(result, files, this_command())
    if film is None or result.rollout is None:
        return report
    files["film"] = film_drives([result.rollout], film, prelude=prelude)["file"]
    return write_result(result, files, this_command())


def _check_views(scenario: "Scenario", film: Path | None, prelude: float, gui: bool) -> None:
    """Refuse, before any work, a film or a window that could not be made afterwards."""
    if gui:
        from antdrive.views.window import check_display

        check_display()
    if prelude > 0:
        from antdrive.planners import capabilities_of

        if film is None:
            raise InputError("--prelude: belongs to a film; give --film, too")
        if not capabilities_of(scenario.planner).iterative:
            raise InputError(
                f"--prelude: {scenario.planner_name} does not plan in iterations; there is no field to show"
            )
    if film is not None:
        check_film(film)


def _drive(scenario: "Scenario") -> "Run":
    """Plan and drive with progress bars; Ctrl-C while planning keeps the best path so far."""
    from antdrive.planners import keep_best
    from antdrive.sim.pipeline import plan
    from antdrive.sim.pipeline import run as drive

    with planning(f"planning with {scenario.planner_name}"), keep_best():
        planned = plan(scenario)
    with bar("driving") as progress:
        return drive(scenario, planned=planned, progress=progress)
