"""`antdrive compare`."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from antdrive.sim.cli import options
from antdrive.sim.cli.compiling import compile_once
from antdrive.sim.cli.console import planning, print_error, print_files, print_json, print_table
from antdrive.sim.cli.exits import FAILED, SUCCEEDED
from antdrive.sim.cli.output import comparison_cells
from antdrive.sim.cli.scenario import make_scenario
from antdrive.sim.cli.write import check_film, check_folder, write_comparison_film, write_result, write_run
from antdrive.worlds.errors import InputError

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario


def compare(
    world: options.World,
    planner: Annotated[
        list[str], typer.Option("--planner", "-p", metavar="NAME", help="Planner; repeat it for two to six of them.")
    ],
    robot: options.Robot = "turtlebot",
    seed: options.Seed = 0,
    margin: options.Margin = 0.03,
    cell: options.CellSize = None,
    smoothing: options.Smoothing = "clearance",
    noise: options.Noise = 0.0,
    out: options.Out = None,
    figures: options.Figures = True,
    video: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Film the drives side by side: .mp4, .gif or .webp.")
    ] = None,
    speed: options.Speed = 1.0,
    json: options.Json = False,
) -> int:
    """Drive one world with several planners.

    Exit code 0: every run succeeded.
    """
    from antdrive.sim.pipeline import run as drive

    scenarios = {
        name: make_scenario(
            world, name, None, robot, seed=seed, margin=margin, cell=cell, smoothing=smoothing, noise=noise
        )
        for name in planner
    }
    folder = out or Path("out") / f"compare-{scenarios[planner[0]].task.world.name}"
    if len(scenarios) < len(planner) or not 2 <= len(planner) <= 6:
        raise InputError(f"--planner {' '.join(planner)}: name two to six different planners")
    if video is not None:
        check_film(video)
    compile_once()
    results = {}
    for name, scenario in scenarios.items():
        check_folder(folder / name)
        with planning(f"planning and driving with {name}"):
            results[name] = drive(scenario)
        written = write_run(results[name], folder / name, figures=figures)
        write_result(results[name], written, _command(scenario, world, robot))
    logs = {name: result.rollout for name, result in results.items() if result.rollout is not None}
    files = {name: str(folder / name) for name in results}
    if len(logs) > 1 and figures:
        from antdrive.sim.view.figures.run_figures import comparison_figure

        files["figure"] = str(comparison_figure(logs, folder / "comparison.png"))
    if len(logs) > 1 and video is not None:
        files["film"] = write_comparison_film(list(logs.values()), video, speed=speed)["file"]
    _print(results, files, json)
    if len(logs) < 2:
        found = "only one planner" if logs else "no planner"
        print_error(f"{found} found a path: there is nothing to compare in a figure or film")
    return SUCCEEDED if all(result.succeeded for result in results.values()) else FAILED


def _print(results: "dict[str, Run]", files: dict[str, str], json: bool) -> None:
    if json:
        print_json({"runs": {name: result.as_dict() for name, result in results.items()}, "files": files})
        return
    print_table(
        ("planner", "planned m", "driven m", "s", "least clearance m", "outcome"),
        ((name, *comparison_cells(result), result.outcome.value) for name, result in results.items()),
    )
    print_files(files)


def _command(scenario: "Scenario", world: str, robot: str) -> str:
    """The `antdrive run` that repeats one of the compared runs."""
    given = {
        "--planner": scenario.planner_name,
        "--robot": robot,
        "--seed": scenario.seed,
        "--margin": "auto" if scenario.chosen else scenario.margin,
        "--smoothing": scenario.smoothing,
        "--noise": scenario.noise,
    }
    words = [str(word) for option in given.items() for word in option]
    cell = [] if scenario.cell is None else ["--cell", str(scenario.cell)]
    return shlex.join(["antdrive", "run", world, *words, *cell])
