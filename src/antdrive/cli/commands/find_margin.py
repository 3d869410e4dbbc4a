"""`antdrive find-margin`."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import planning, print_json, print_line, print_table
from antdrive.cli.exits import FAILED, SUCCEEDED
from antdrive.cli.scenario import chosen_task, ends_words, make_scenario

if TYPE_CHECKING:
    from antdrive.sim.log.margin import MarginTrial
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Task


def find_margin(
    world: Annotated[
        str | None, typer.Argument(metavar="WORLD", help="Name of a world in the catalogue, or a world file.")
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option("--generate", metavar="KIND", help="Instead of WORLD: a random forest or barn for each seed."),
    ] = None,
    task: options.TaskName = None,
    start: options.Start = None,
    goal: options.Goal = None,
    frame: options.Frame = "world",
    planner: options.Planner = "astar",
    settings: options.Settings = None,
    robot: options.Robot = "turtlebot",
    seed: options.Seed = 0,
    seeds: Annotated[
        int, typer.Option(min=1, max=10_000, metavar="NUMBER", help="Number of drives, with seeds from --seed on.")
    ] = 10,
    cell: options.CellSize = None,
    smoothing: options.Smoothing = "clearance",
    noise: options.Noise = 0.0,
    max_speed: Annotated[
        float | None,
        typer.Option(min=0.05, metavar="SPEED", help="Speed limit [m/s].  [default: the robot's own]"),
    ] = None,
    reserve: Annotated[
        float,
        typer.Option(
            min=0.0, max=1.0, metavar="METRES", help="Part of the margin that every drive must leave unused [m]."
        ),
    ] = 0.005,
    json: options.Json = False,
) -> int:
    """Find the least margin with which all drives are safe.

    `--margin auto` of the other commands predicts one for any world. Exit code 0: there is a safe margin of at most 0.2 m.
    """
    from antdrive.sim.log.margin import find_margin as search
    from antdrive.sim.pipeline import run as drive

    chosen = _chosen(world, kind, task, start, goal, frame)
    base = make_scenario(chosen, planner, settings, robot, cell=cell, smoothing=smoothing, noise=noise)
    base = base if max_speed is None else _slowed(base, max_speed)
    tasks = {n: base.task if kind is None else _generated(kind, n) for n in range(seed, seed + seeds)}

    def drive_with(margin: float, n: int) -> "Run":
        return drive(dataclasses.replace(base, task=tasks[n], margin=margin, seed=n))

    compile_once()
    with planning("looking for the smallest safe margin"):
        trials = list(search(drive_with, list(tasks), reserve=reserve))
    smallest = min((trial.margin for trial in trials if trial.safe), default=None)
    if json:
        asked = {"reserve_m": reserve, "world": world or kind, "planner": planner, "seeds": [seed, seed + seeds - 1]}
        print_json({"margin_m": smallest, **asked, **_facts(base, trials)})
    else:
        _print(base, trials, smallest)
    return FAILED if smallest is None else SUCCEEDED


def _chosen(
    world: str | None, kind: str | None, task: str | None, start: str | None, goal: str | None, frame: str
) -> "str | Task":
    """The world of every drive; for random worlds a stand-in."""
    if (world is None) == (kind is None):
        raise InputError("find-margin: name a world, or a kind of random worlds with --generate forest|barn")
    if world is not None:
        return chosen_task(world, task, start, goal, frame)
    if ends_words(task, start, goal, frame):
        raise InputError(
            "--task, --start, --goal: random worlds have their own starts and goals; name a world for others"
        )
    return "empty"


def _slowed(scenario: "Scenario", speed: float) -> "Scenario":
    robot = scenario.robot
    return dataclasses.replace(scenario, robot=dataclasses.replace(robot, max_speed=min(speed, robot.max_speed)))


def _generated(kind: str, seed: int) -> "Task":
    import numpy as np

    from antdrive.worlds import GENERATORS, generate

    if kind not in GENERATORS:
        raise InputError(f"--generate {kind}: unknown kind; choose from {', '.join(GENERATORS)}")
    return generate(kind, np.random.default_rng(seed), {}, name=f"{kind}-{seed}", note=f"seed {seed}")


def _facts(base: "Scenario", trials: "Sequence[MarginTrial]") -> dict[str, Any]:
    return {
        "robot": base.robot.name,
        "max_speed": base.robot.max_speed,
        "noise": base.noise,
        "smoothing": base.smoothing,
        "trials": [dataclasses.asdict(trial) for trial in trials],
    }


def _print(base: "Scenario", trials: "Sequence[MarginTrial]", smallest: float | None) -> None:
    print_table(
        ("margin m", "driven", "no path", "least room left m", "failed"),
        (
            (
                f"{trial.margin:.3f}",
                str(trial.drives),
                str(trial.impassable),
                f"{trial.left:.4f}" if trial.drives else "-",
                "" if trial.failed is None else f"seed {trial.failed}",
            )
            for trial in sorted(trials, key=lambda trial: trial.margin)
        ),
    )
    found = "none up to 0.2 m" if smallest is None else f"{smallest:.3f} m"
    rests = [trial for trial in trials if trial.margin == smallest]
    for trial in rests[:1]:
        closed = f"; the margin closes {trial.impassable} more worlds, which are left out" if trial.impassable else ""
        found += f", from {trial.drives} drive{'' if trial.drives == 1 else 's'}{closed}"
    print_line(f"smallest safe margin for {base.robot.name} at up to {base.robot.max_speed:g} m/s: {found}")
