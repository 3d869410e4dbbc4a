"""`antdrive worlds show`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.sim.cli import options
from antdrive.sim.cli.console import print_files, print_json, print_line
from antdrive.sim.cli.exits import SUCCEEDED
from antdrive.sim.cli.output import task_facts

UNITS = {"bounds": " m", "start": " m, m, rad", "goal": " m", "goal_tolerance": " m", "cell": " m"}


def show_world(
    world: options.World,
    robot: options.Robot = "turtlebot",
    margin: options.Margin = 0.03,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="Draw the world: .png, .svg or .pdf.")
    ] = None,
    json: options.Json = False,
) -> int:
    """Describe a world, and whether a robot can cross it."""
    from antdrive.planners import Query, load_planner, reachable
    from antdrive.robots import list_robots, load_robot, overlap_at
    from antdrive.worlds import load_task, rasterise, task_to_dict

    task, spec = load_task(world), load_robot(robot)
    grid = rasterise(task.world, task.cell, spec.radius + margin)
    query = Query.between(grid, task)
    known = {name: load_robot(name) for name in list_robots()}
    starts = {each.name: overlap_at(task.world, each, task.start) for each in (*known.values(), spec)}
    passable = not starts[spec.name] and query.blocked_end is None and reachable(query)
    if out is not None:
        import numpy as np

        from antdrive.sim.view.figures.plan_figures import plan_figure

        plan_figure(task, grid, load_planner("astar").plan(query, np.random.default_rng(0)), spec, out)
    if json:
        print_json({**task_to_dict(task), "passable": passable, "robot": spec.name, "margin": margin, "starts": starts})
        return SUCCEEDED
    for key, value in task_facts(task).items():
        print_line(f"{key + UNITS.get(key, ''):18} {value}")
    print_line(f"{'passable':18} {'yes' if passable else 'no'}, for {spec.name} with a margin of {margin:g} m")
    for name, overlap in starts.items():
        print_line(f"{'start for ' + name:18} {overlap or 'free'}")
    print_files({} if out is None else {"figure": str(out)})
    return SUCCEEDED
