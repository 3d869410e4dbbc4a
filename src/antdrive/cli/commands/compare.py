"""`antdrive compare`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.atomic import claimed
from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.campaign_tables import Against, Allow, Metrics, Where, campaigns_of_words, compare_campaigns
from antdrive.cli.comparing import (
    COMPARED,
    Compared,
    Entrant,
    check_worlds,
    difference_cells,
    differences,
    entrants_of,
    mark_of,
    repeating,
    same_drives,
)
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import planning, print_error, print_files, print_json, print_line, print_table
from antdrive.cli.exits import FAILED, SUCCEEDED
from antdrive.cli.scenario import chosen_task, ends_words, make_scenario
from antdrive.cli.write import (
    check_film,
    check_folder,
    file_name,
    free_folder,
    this_command,
    write_comparison_film,
    write_marker,
    write_result,
    write_run,
)

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Task

MARKER = "comparison.json"
Worlds = Annotated[
    list[str],
    typer.Argument(metavar="WORLD...", help="Names of worlds in the catalogue, or world files; or campaigns' folders."),
]
Planners = Annotated[
    list[str] | None,
    typer.Option(
        "--planner",
        "-p",
        metavar="NAME",
        help="Planner; repeat it for two to six of them. LABEL=NAME gives it a label, so that one planner can be "
        "compared with other options of its own.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        "-s",
        metavar="GROUP.KEY=VALUE",
        help="Set an option: of one planner by its name or label, such as aco-han.ants=50; of all with planner.ants=50; "
        "or of the controller, such as controller.lookahead_time=0.5. May be repeated.",
    ),
]
Seeds = Annotated[
    int, typer.Option(min=1, max=10_000, metavar="NUMBER", help="Number of seeds for each world, from --seed on.")
]


def compare(
    context: typer.Context,
    worlds: Worlds,
    planner: Planners = None,
    settings: Settings = None,
    robot: options.Robot = "turtlebot",
    seed: options.Seed = 0,
    seeds: Seeds = 1,
    margin: options.Margin = 0.03,
    cell: options.CellSize = None,
    task: options.TaskName = None,
    start: options.Start = None,
    goal: options.Goal = None,
    frame: options.Frame = "world",
    smoothing: options.Smoothing = "clearance",
    noise: options.Noise = 0.0,
    out: options.Out = None,
    figures: options.Figures = True,
    video: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Film the first world's drives side by side: .mp4, .gif or .webp."),
    ] = None,
    speed: options.Speed = 1.0,
    metric: Metrics = None,
    against: Against = None,
    allow: Allow = None,
    where: Where = None,
    json: options.Json = False,
) -> int:
    """Compare planners: drive worlds with each, or read a campaign.

    The planners are paired by world and seed. Figures and film show the first of them. Exit code 0: every run succeeded.
    Folders of campaigns, made by `antdrive sweep`: success with intervals, outcomes, and tests of every pair.
    """
    if campaigns := campaigns_of_words(worlds, context):
        return compare_campaigns(campaigns, planner or (), metric, against, allow, where, json)
    check_worlds(worlds)
    entrants = entrants_of(planner, settings)
    rest = {"margin": margin, "cell": cell, "smoothing": smoothing, "noise": noise}
    tasks = {world: chosen_task(world, task, start, goal, frame) for world in worlds}
    scenarios = _scenarios(worlds, tasks, entrants, robot, seed, rest)
    cases = [(world, number) for world in worlds for number in range(seed, seed + seeds)]
    default, mark = _default_folder(scenarios, cases)
    folder = out or default
    _make_ready(folder, video)
    with claimed(folder):
        facts = {"fingerprint": mark, "command": this_command()}
        runs, logs = _drive(scenarios, cases, folder, robot, figures, facts, ends_words(task, start, goal, frame))
        files = {run.label: run.facts["folder"] for run in runs} if len(cases) == 1 else {"folder": str(folder)}
        files |= _views(logs, folder, video, speed, figures)
        told = {"differences": differences(runs), "same": same_drives(runs, smoothing)}
        told["drives"] = [{"label": run.label, **run.facts} for run in runs]
        write_marker(folder / MARKER, {**facts, **told})
    if json:
        print_json({"runs": {run.label: run.facts for run in runs[: len(entrants)]}, **told, "files": files})
    else:
        _print(runs, len(cases), told, files)
    _warn_of_few(len(logs))
    return SUCCEEDED if all(run.facts["succeeded"] for run in runs) else FAILED


def _make_ready(folder: Path, video: Path | None) -> None:
    """Refuse places where nothing can be written, before anything is driven, and compile the kernels."""
    if video is not None:
        check_film(video)
    check_folder(folder)
    compile_once()


def _warn_of_few(drives: int) -> None:
    """Say why there is no figure and no film, if fewer than two planners drove."""
    if drives < 2:
        found = "only one planner" if drives else "no planner"
        print_error(f"{found} found a path: there is nothing to compare in a figure or film")


def _scenarios(
    worlds: Sequence[str],
    tasks: "Mapping[str, str | Task]",
    entrants: Sequence[Entrant],
    robot: str,
    seed: int,
    rest: dict[str, Any],
) -> "dict[tuple[str, Entrant], Scenario]":
    """The scenario of every world, as given, and planner, with the first seed."""
    scenarios = {
        (world, entrant): make_scenario(tasks[world], entrant.name, list(entrant.settings), robot, seed=seed, **rest)
        for world in worlds
        for entrant in entrants
    }
    if len({scenario.task.world.name for scenario in scenarios.values()}) < len(worlds):
        raise InputError(f"{' '.join(worlds)}: name worlds with different names, each once")
    return scenarios


def _default_folder(
    scenarios: "dict[tuple[str, Entrant], Scenario]", cases: Sequence[tuple[str, int]]
) -> tuple[Path, str]:
    """The folder of a comparison for which none is given, and the fingerprint of the comparison."""
    names = {world: scenario.task.world.name for (world, _), scenario in scenarios.items()}
    marks = {f"{entrant.label} {world}": scenario for (world, entrant), scenario in scenarios.items()}
    mark = mark_of(marks, [(names[world], number) for world, number in cases])
    name = file_name(f"compare-{'-'.join(names.values())}"[:100])
    return free_folder(Path("out") / name, MARKER, mark), mark


def _drive(
    scenarios: "dict[tuple[str, Entrant], Scenario]",
    cases: Sequence[tuple[str, int]],
    folder: Path,
    robot: str,
    figures: bool,
    facts: dict[str, str],
    ends: Sequence[str],
) -> "tuple[list[Compared], dict[str, Rollout]]":
    """Drive every case with every planner, each into its folder; the runs, and the logs of the first case by label."""
    import dataclasses

    from antdrive.sim.pipeline import run as drive

    runs: list[Compared] = []
    logs: dict[str, Rollout] = {}
    for place, (world, seed) in enumerate(cases):
        for (of, entrant), base in scenarios.items():
            if of != world:
                continue
            scenario = dataclasses.replace(base, seed=seed)
            part = folder if len(cases) == 1 else folder / file_name(f"{base.task.world.name}-{seed}")
            check_folder(part / entrant.label)
            with planning(f"{base.task.world.name}, seed {seed}: {entrant.label}"):
                result = drive(scenario)
            if not runs:  # an interrupted comparison leaves the results that it has, marked as its own
                write_marker(folder / MARKER, facts)
            written = write_run(result, part / entrant.label, figures=figures and place == 0)
            write_result(result, written, repeating(scenario, entrant, world, robot, ends))
            kept = Compared.of(entrant.label, result)
            runs.append(dataclasses.replace(kept, facts={**kept.facts, "folder": str(part / entrant.label)}))
            if place == 0 and result.rollout is not None:
                logs[entrant.label] = result.rollout
    return runs, logs


def _views(logs: "dict[str, Rollout]", folder: Path, video: Path | None, speed: float, figures: bool) -> dict[str, str]:
    """The figure and the film of the first world and seed."""
    files: dict[str, str] = {}
    if len(logs) > 1 and figures:
        from antdrive.views.figures.run_figures import comparison_figure

        comparison_figure(logs, folder / "comparison.png")
        files["figure"] = str(folder / "comparison.png")
    if len(logs) > 1 and video is not None:
        files["film"] = write_comparison_film(list(logs.values()), video, speed=speed, titles=list(logs))["file"]
    return files


def _print(runs: list[Compared], cases: int, told: dict[str, Any], files: dict[str, str]) -> None:
    many = cases > 1
    print_table(
        (*(("world", "seed") if many else ()), "planner", *COMPARED.values(), "outcome"),
        (
            (*((run.world, str(run.seed)) if many else ()), run.label, *run.cells, str(run.facts["sentence"]))
            for run in runs
        ),
    )
    if many:
        print_line(f"differences from {runs[0].label}, of the pairs in which both succeeded: median (least to most)")
        print_table(("planner", "succeeded", "pairs", *COMPARED.values()), map(difference_cells, told["differences"]))
    for sentence in told["same"]:
        print_line(sentence)
    print_files(files)
