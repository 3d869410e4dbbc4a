"""`antdrive plan`."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.atomic import folder_lock
from antdrive.cli import options
from antdrive.cli.console import file_lines, planning, show
from antdrive.cli.options import option
from antdrive.cli.output import in_brackets, margin_lines, plain
from antdrive.cli.scenario_options import Ends, Setup
from antdrive.views.run_folder import suffixes

if TYPE_CHECKING:
    from antdrive.planners import PlanResult
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Grid


@options.with_settings(("margin", "footprint", "cell", "seed"))
def plan(
    *,
    world: options.World,
    setup: Setup,
    ends: Ends,
    out: Annotated[Path | None, option("FOLDER", "Folder for the plan's figures.")] = None,
    vector: options.Vector = False,
    json: options.Json = False,
    **given: Any,
) -> bool:
    """Plan a path without driving it.

    Exit code 0: a path exists.
    """
    from antdrive.planners import keep_best
    from antdrive.sim.pipeline import plan as make_plan

    scenario = setup.scenario(ends.of(world), given)
    with planning(f"planning with {scenario.planner_name}"), keep_best():
        grid, answer = make_plan(scenario)
    files: dict[str, str] = {}
    if out is not None:
        from antdrive.views.figures.plan_figures import plan_figures

        named: dict[str, Any] = {"name": scenario.planner_name, "suffixes": suffixes(vector)}
        with folder_lock(out):
            made = plan_figures(scenario.task, grid, answer, scenario.robot, out, **named)
        files = {name: str(path) for name, path in made.items()}
    facts = {
        "world": scenario.task.world.name,
        "planner": scenario.planner_name,
        "robot": scenario.robot.name,
        "seed": scenario.seed,
        "status": answer.status.name.lower(),
        "sentence": answer.status.value,
        "reason": answer.reason,
        "margin_m": scenario.planned_margin,
        "cost_m": answer.cost,
        "length_m": answer.line_length,
        "work": answer.work,
        "work_unit": answer.work_unit,
        "plan_s": answer.wall_s,
        "grid": {"rows": grid.shape[0], "cols": grid.shape[1], "cell": grid.cell, "inflate": grid.inflate},
        "options": {key: plain(value) for key, value in answer.options.items()},
        "cells": answer.cells.tolist(),
        "files": files,
    }
    show(json, facts, _lines(scenario, grid, answer, files))
    return answer.solved


def _lines(scenario: "Scenario", grid: "Grid", answer: "PlanResult", files: Mapping[str, str]) -> Iterator[str]:
    yield f"{scenario.task.world.name}: {scenario.planner_name} {answer.status.value}" + in_brackets(answer.reason)
    if len(answer.cells):
        length, count = answer.line_length, len(answer.cells)
        yield f"  length {length:.3f} m over {count} cells, {answer.work} {answer.work_unit}"
    yield from margin_lines(scenario)
    rows, columns = grid.shape
    yield f"  planned in {answer.wall_s * 1000:.1f} ms on {rows} x {columns} cells of {grid.cell:g} m"
    yield from file_lines(files)
