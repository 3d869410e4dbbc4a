"""`antdrive plan`."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

from antdrive.base.atomic import folder_lock
from antdrive.base.tables import file_lines
from antdrive.cli import options
from antdrive.cli.console import planning, show
from antdrive.cli.options import option
from antdrive.cli.scenario_options import Ends, Setup
from antdrive.views.run_folder import formats_of


@options.with_settings(("margin", "footprint", "cell", "seed"))
def plan(
    *,
    world: options.World,
    setup: Setup,
    ends: Ends,
    out: Annotated[Path | None, option("FOLDER", "Folder for the plan's figures.")] = None,
    figures: options.Figures = "png",
    json: options.Json = False,
    **given: Any,
) -> bool:
    """Plan a path without driving it.

    Exit code 0: a path exists. For a wrong plan (--planner FILE) it prints the first wrong place, and by how much.
    """
    from antdrive.planners import keep_best
    from antdrive.sim.pipeline import plan as make_plan
    from antdrive.sim.summary import plan_lines

    formats = formats_of(figures) or ()
    scenario = setup.scenario(ends.of(world), given)
    with planning(f"planning with {scenario.planner_name}"), keep_best():
        grid, answer = make_plan(scenario)
    files: dict[str, str] = {}
    if out is not None:
        from antdrive.views.figures.canvas import written
        from antdrive.views.figures.plan_figures import plan_figure

        with folder_lock(out):
            files = written(
                "plan", out / "plan", formats, partial(plan_figure, scenario.task, grid, answer, scenario.robot)
            )
    facts = {
        "world": scenario.task.world.name,
        "planner": scenario.planner_name,
        "robot": scenario.robot.name,
        "seed": scenario.seed,
        "margin_m": scenario.planned_margin,
        **answer.as_dict(),
        "grid": {"rows": grid.shape[0], "cols": grid.shape[1], "cell": grid.cell, "inflate": grid.inflate},
        "files": files,
    }
    show(json, facts, [*plan_lines(scenario, grid, answer), *file_lines(files)])
    return answer.solved
