"""`antdrive plan`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.atomic import claimed
from antdrive.cli import options
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import planning, print_files, print_json, print_line
from antdrive.cli.exits import FAILED, SUCCEEDED
from antdrive.cli.output import chosen_margin, in_brackets, plain
from antdrive.cli.scenario import chosen_task, make_scenario
from antdrive.cli.write import suffixes

if TYPE_CHECKING:
    from antdrive.planners import PlanResult
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Grid


def plan(
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
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FOLDER", help="Draw the plan's figures into this folder.")
    ] = None,
    vector: options.Vector = False,
    json: options.Json = False,
) -> int:
    """Plan a path without driving it.

    Exit code 0: there is a path.
    """
    from antdrive.planners import keep_best
    from antdrive.sim.pipeline import plan as make_plan

    scenario = make_scenario(
        chosen_task(world, task, start, goal, frame), planner, settings, robot, seed=seed, margin=margin, cell=cell
    )
    compile_once()
    with planning(f"planning with {planner}"), keep_best():
        grid, answer = make_plan(scenario)
    files = {}
    if out is not None:
        from antdrive.views.figures.plan_figures import plan_figures

        with claimed(out):
            made = plan_figures(
                scenario.task, grid, answer, scenario.robot, out, name=planner, suffixes=suffixes(vector)
            )
        files = {name: str(path) for name, path in made.items()}
    if json:
        print_json({**_facts(scenario, grid, answer), "files": files})
    else:
        print_line(f"{scenario.task.world.name}: {planner} {answer.status.value}" + in_brackets(answer.reason))
        if len(answer.cells):
            length, count = answer.line_length, len(answer.cells)
            print_line(f"  length {length:.3f} m over {count} cells, {answer.work} {answer.work_unit}")
        if scenario.chosen is not None:
            print_line(f"  {chosen_margin(scenario.chosen)}")
        rows, columns = grid.shape
        print_line(f"  planned in {answer.wall_s * 1000:.1f} ms on {rows} x {columns} cells of {grid.cell:g} m")
        print_files(files)
    return SUCCEEDED if answer.solved else FAILED


def _facts(scenario: "Scenario", grid: "Grid", answer: "PlanResult") -> dict[str, Any]:
    return {
        "world": scenario.task.world.name,
        "planner": scenario.planner_name,
        "robot": scenario.robot.name,
        "seed": scenario.seed,
        "status": answer.status.name.lower(),
        "sentence": answer.status.value,
        "reason": answer.reason,
        "margin_m": scenario.margin,
        "cost_m": answer.cost,
        "length_m": answer.line_length,
        "work": answer.work,
        "work_unit": answer.work_unit,
        "plan_s": answer.wall_s,
        "grid": {"rows": grid.shape[0], "cols": grid.shape[1], "cell": grid.cell, "inflate": grid.inflate},
        "options": {key: plain(value) for key, value in answer.options.items()},
        "cells": answer.cells.tolist(),
    }
