"""`antdrive worlds show`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.cli import options
from antdrive.cli.console import print_files, print_json, print_line
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.output import task_facts
from antdrive.cli.scenario import chosen_task

UNITS = {
    "frame": " m, m, rad",
    "bounds": " m",
    "start": " m, m, rad",
    "goal": " m",
    "goal_tolerance": " m",
    "cell": " m",
}


def show_world(
    world: options.World,
    robot: options.Robot = "turtlebot",
    margin: options.Margin = 0.03,
    task: options.TaskName = None,
    start: options.Start = None,
    goal: options.Goal = None,
    frame: options.Frame = "world",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="Draw the world: .png, .svg or .pdf.")
    ] = None,
    json: options.Json = False,
) -> int:
    """Describe a world, and whether a robot can cross it."""
    from antdrive.base.plane import in_map
    from antdrive.planners import Query, load_planner, reachable
    from antdrive.robots import list_robots, load_robot, overlap_at
    from antdrive.worlds import load_task, load_tasks, rasterise, task_to_dict

    given, spec = chosen_task(world, task, start, goal, frame), load_robot(robot)
    shown = load_task(given) if isinstance(given, str) else given
    grid = rasterise(shown.world, shown.cell, spec.radius + margin)
    query, named = Query.between(grid, shown), list(load_tasks(world))
    known = {name: load_robot(name) for name in list_robots()}
    starts = {each.name: overlap_at(shown.world, each, shown.start) for each in (*known.values(), spec)}
    passable = not starts[spec.name] and query.blocked_end is None and reachable(query)
    if out is not None:
        import numpy as np

        from antdrive.views.figures.plan_figures import plan_figure

        plan_figure(shown, grid, load_planner("astar").plan(query, np.random.default_rng(0)), spec, out)
    if json:
        facts = {"passable": passable, "robot": spec.name, "margin": margin, "starts": starts, "tasks": named}
        print_json({**task_to_dict(shown), **facts})
        return SUCCEEDED
    for key, value in task_facts(shown).items():
        print_line(f"{key + UNITS.get(key, ''):18} {'-' if value is None else value}")
    if any(shown.frame):
        for key, pose in {"start": shown.start, "goal": shown.goal}.items():
            there = in_map(shown.frame, [pose])[0].round(4).tolist()
            print_line(f"{key + ' in its map':18} {there}")
    print_line(f"{'passable':18} {'yes' if passable else 'no'}, for {spec.name} with a margin of {margin:g} m")
    print_line(f"{'start is free for':18} {', '.join(name for name, overlap in starts.items() if not overlap) or '-'}")
    for name, overlap in starts.items():
        if overlap:
            print_line(f"start for {name} {overlap}")
    if named:
        print_line(f"{'tasks':18} {', '.join(named)}")
    print_files({} if out is None else {"figure": str(out)})
    return SUCCEEDED
