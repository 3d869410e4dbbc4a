"""`antdrive worlds export`."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import print_files, print_json, print_line
from antdrive.cli.exits import SUCCEEDED

if TYPE_CHECKING:
    from antdrive.worlds import Task

SDF = (".sdf", ".world")
SUFFIXES = (*SDF, ".yaml", ".yml", ".map")


def export_world(
    world: options.World,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="Gazebo: .sdf or .world; map_server: .yaml (and .pgm); MovingAI: .map (and .scen).",
        ),
    ],
    resolution: Annotated[
        float | None,
        typer.Option(
            min=1e-6,
            max=1e6,
            metavar="METRES",
            help="Maps: side of a cell [m].  [default: the world's own cell size]",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist, also those beside FILE.")] = False,
    json: options.Json = False,
) -> int:
    """Write a world for another program.

    FILE's suffix decides the format. SDF keeps the world, its start and its goal. In a map, every cell that a cylinder
    reaches into is blocked; importing the map again gives a similar world, not the same. A .yaml keeps the world's
    other tasks, too. A .map gets a .scen file beside it with the path from start to goal, if there is one on its cells.
    A world that was made from a map is written where it lies in that map, but for a .map, which has no coordinates.
    """
    from antdrive.worlds import load_task, load_tasks
    from antdrive.worlds.formats.checks import require_new

    suffix = out.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"--out {out}: worlds are written as .sdf, .world, .yaml (map_server) or .map (MovingAI)")
    task, tasks = load_task(world), load_tasks(world)
    if out.exists() and Path(world).exists() and out.samefile(world):
        raise InputError(f"--out {out}: is the world itself; choose another name")
    if suffix in SDF and resolution is not None:
        raise InputError("--resolution: an SDF world has no cells")
    beside = _beside(out)
    require_new((out, *([] if beside is None else [beside])), replace=force)
    facts, lost = _write(task, tasks, out, resolution)
    if json:
        print_json({"world": task.world.name, **facts})
        return SUCCEEDED
    print_files(facts["files"])
    for what in lost:
        print_line(f"  without {what}")
    return SUCCEEDED


def _write(
    task: "Task", tasks: "Mapping[str, Task]", out: Path, resolution: float | None
) -> tuple[dict[str, Any], list[str]]:
    """Write a world's files; facts about them, and what they have no place for."""
    from antdrive.worlds import export_map_server, export_sdf

    suffix, facts, lost = out.suffix.lower(), dict[str, Any](), list[str]()
    if suffix in SDF:
        export_sdf(task, out)
        facts["files"] = {"sdf": str(out)}
    elif suffix == ".map":
        facts["files"] = {"map": str(out), **_export_movingai(task, out, resolution)}
        facts["cell"], facts["corner_in_map"] = resolution or task.cell, _corner(task)
        if any(facts["corner_in_map"]):
            x, y, yaw = facts["corner_in_map"]
            turned = f", turned by {yaw:.6g} rad" if yaw else ""
            lost.append(
                f"its place: .map has no coordinates, and its lower left corner is at ({x:.6g}, {y:.6g}){turned}"
            )
    else:
        image = export_map_server(task, out, resolution=resolution, tasks=tasks, replace=True)  # as was checked
        return {"files": {"map": str(out), "image": str(image)}}, lost
    if tasks:
        facts["without_tasks"] = list(tasks)
        lost.append(f"the tasks {', '.join(tasks)}: {suffix} has no place for them, .yaml has")
    return facts, lost


def _beside(out: Path) -> Path | None:
    """The file that comes with the one that people name; None for a format of one file."""
    if out.suffix.lower() in SDF:
        return None
    return out.with_name(f"{out.name}.scen") if out.suffix.lower() == ".map" else out.with_suffix(".pgm")


def _corner(task: "Task") -> list[float]:
    """Where a world's lower left corner, and with it that of its cells, lies in the map that it was made from."""
    from antdrive.base.plane import in_map

    return [float(v) for v in in_map(task.frame, [(*task.world.bounds[:2], 0.0)])[0]]


def _export_movingai(task: "Task", out: Path, resolution: float | None) -> dict[str, str]:
    """Write the map and, if there is a path on its cells, the problem; the problem's file."""
    import numpy as np

    from antdrive.planners import Query, load_planner
    from antdrive.worlds import Grid, MapProblem, export_movingai_map, export_movingai_problems

    cells = export_movingai_map(task, out, resolution=resolution)
    start, goal = cells.cell_at(*task.start[:2]), cells.cell_at(*task.goal)
    beside = _beside(out)
    assert beside is not None
    beside.unlink(missing_ok=True)  # one that exists may be replaced, and would belong to another map
    if start is None or goal is None or not (cells.free[start] and cells.free[goal]):
        return {}
    answer = load_planner("dijkstra").plan(Query(Grid.from_free(cells.free), start, goal), np.random.default_rng(0))
    if not answer.solved:
        return {}
    found = MapProblem(start, goal, answer.cost, f"{answer.cost:.8f}", out.name, int(answer.cost // 4))
    export_movingai_problems([found], cells.free.shape, beside)
    return {"problem": str(beside)}
