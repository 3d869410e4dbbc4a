"""`antdrive run`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.atomic import claimed
from antdrive.base.errors import InputError
from antdrive.cli import knowing, options
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, planning, print_json
from antdrive.cli.exits import FAILED, SUCCEEDED
from antdrive.cli.output import print_run
from antdrive.cli.parse import disc
from antdrive.cli.scenario import among_movers, chosen_task, make_scenario
from antdrive.cli.write import (
    check_film,
    check_folder,
    default_folder,
    this_command,
    write_film,
    write_result,
    write_run,
)

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario

Unseen = Annotated[
    list[str] | None,
    typer.Option(
        metavar="X,Y,RADIUS",
        help="Add a cylinder that neither planner nor controller knows about [m]. May be repeated.",
    ),
]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        min=1e-3,
        max=1e6,
        metavar="SECONDS",
        help="Simulated time allowed [s].  [default: the world's own, or 30 s plus ten times the route at full speed]",
    ),
]
Avoid = Annotated[bool, typer.Option("--avoid/--no-avoid", help="Avoid movers: slow down, stop, back off or go round.")]
Replan = Annotated[
    bool,
    typer.Option(
        "--replan/--no-replan",
        help="In worlds with movers: replan around them; otherwise only after straying from the route.",
    ),
]
Sees = Annotated[
    str | None,
    typer.Option(
        metavar="KIND[:METRES]",
        help="What the robot perceives of movers: positions, velocities, motions (their whole future), or lidar: nothing but "
        "what its lidar shows; with METRES, only of movers within that range [m].  "
        "[default: velocities; with --map none lidar]",
    ),
]
Video = Annotated[Path | None, typer.Option(metavar="FILE", help="Film the drive: .mp4, .gif or .webp.")]
Gui = Annotated[bool, typer.Option("--gui", help="Replay the drive in a window afterwards; needs a screen.")]


def run(
    world: options.World,
    planner: options.Planner = "ants",
    settings: options.Settings = None,
    robot: options.Robot = "turtlebot",
    seed: options.Seed = 0,
    margin: options.Margin = 0.03,
    cell: options.CellSize = None,
    task: options.TaskName = None,
    start: options.Start = None,
    goal: options.Goal = None,
    frame: options.Frame = "world",
    smoothing: options.Smoothing = "clearance",
    noise: options.Noise = 0.0,
    unseen: Unseen = None,
    time_limit: TimeLimit = None,
    avoid: Avoid = True,
    replan: Replan = True,
    sees: Sees = None,
    map: knowing.Map = "given",
    localisation: knowing.Localisation = "fixes",
    odometry: knowing.Odometry = 1.0,
    out: options.Out = None,
    video: Video = None,
    prelude: options.Prelude = 0.0,
    vector: options.Vector = False,
    figures: options.Figures = True,
    gui: Gui = False,
    json: options.Json = False,
) -> int:
    """Plan a path, drive it in physics and certify the drive.

    Exit code 0: the robot stopped at the goal, and its log proves that it touched nothing.
    """
    knows: dict[str, Any] = {"map": map, "localisation": localisation, "odometry": odometry}
    hidden = tuple(disc(text) for text in unseen or ())
    scenario = make_scenario(
        chosen_task(world, task, start, goal, frame), planner, settings, robot,
        seed=seed, margin=margin, cell=cell, smoothing=smoothing, noise=noise, unseen=hidden, time_limit=time_limit,
        **knows, **among_movers(avoid, replan, sees),
    )  # fmt: skip
    folder = out or default_folder(scenario)
    _check_views(scenario, video, prelude, gui)
    check_folder(folder)
    compile_once()
    with claimed(folder):
        result = _drive(scenario)
        files = write_run(result, folder, vector=vector, figures=figures)
        report = _write_views(result, files, video, prelude)
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


def _write_views(result: "Run", files: dict[str, str], video: Path | None, prelude: float) -> dict[str, Any]:
    """Write the result and, if asked for, the film, and the result again with it; what was written."""
    report = write_result(result, files, this_command())
    if video is None or result.rollout is None:
        return report
    files["film"] = write_film(result.rollout, video, prelude=prelude)["file"]
    return write_result(result, files, this_command())


def _check_views(scenario: "Scenario", video: Path | None, prelude: float, gui: bool) -> None:
    """Refuse, before any work, a film or a window that could not be made afterwards."""
    if gui:
        from antdrive.views.window import check_display

        check_display()
    if prelude > 0:
        from antdrive.planners import capabilities_of

        if video is None:
            raise InputError("--prelude: belongs to a film; give --video, too")
        if not capabilities_of(scenario.planner).iterative:
            raise InputError(
                f"--prelude: {scenario.planner_name} does not plan in iterations; there is no field to show"
            )
    if video is not None:
        check_film(video)


def _drive(scenario: "Scenario") -> "Run":
    """Plan and drive with progress bars; Ctrl-C while planning keeps the best path so far."""
    from antdrive.planners import keep_best
    from antdrive.sim.pipeline import plan
    from antdrive.sim.pipeline import run as drive

    with planning(f"planning with {scenario.planner_name}"), keep_best():
        planned = plan(scenario)
    with bar("driving") as progress:
        return drive(scenario, planned=planned, progress=progress)
