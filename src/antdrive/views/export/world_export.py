"""Export of worlds to SDF, map_server and MovingAI files, with a list of lost content."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.base.plane import format_point, world_to_map
from antdrive.planners import Query, load_planner
from antdrive.worlds import (
    Grid,
    MapProblem,
    Task,
    export_map_server,
    export_movingai_map,
    export_movingai_problems,
    export_sdf,
)

SDF = (".sdf", ".world")
SUFFIXES = (*SDF, ".yaml", ".yml", ".map")


def write_world(
    task: Task, tasks: Mapping[str, Task], out: Path, resolution: float | None
) -> tuple[dict[str, Any], list[str]]:
    """Write a world's files and return facts about them and the content that the format cannot hold."""
    suffix, facts, lost = out.suffix.lower(), dict[str, Any](), list[str]()
    if suffix in SDF:
        export_sdf(task, out)
        facts["files"] = {"sdf": str(out)}
    elif suffix == ".map":
        facts["files"] = {"map": str(out), **_export_movingai(task, out, resolution)}
        corner = world_to_map(task.frame, [(*task.world.bounds[:2], 0.0)])[
            0
        ]  # the world's lower left one in its source map
        facts["cell"], facts["corner_in_map"] = resolution or task.cell, corner.tolist()
        if corner.any():
            x, y, yaw = corner.tolist()
            turned = f", turned by {yaw:.6g} rad" if yaw else ""
            lost.append(
                f"its pose: .map has no coordinates; its lower left corner is at {format_point((x, y))}{turned}"
            )
    else:
        image = export_map_server(task, out, resolution=resolution, tasks=tasks, replace=True)  # checked by the caller
        return {"files": {"map": str(out), "image": str(image)}}, lost
    if tasks:
        facts["without_tasks"] = list(tasks)
        lost.append(f"the tasks {', '.join(tasks)}: {suffix} cannot hold tasks; use .yaml")
    return facts, lost


def file_beside(out: Path) -> Path | None:
    """Return the second file of a format; None for formats with one file."""
    if out.suffix.lower() in SDF:
        return None
    return out.with_name(f"{out.name}.scen") if out.suffix.lower() == ".map" else out.with_suffix(".pgm")


def _export_movingai(task: Task, out: Path, resolution: float | None) -> dict[str, str]:
    """Write the map and, if its cells have a path, the problem; return the problem's file."""
    cells = export_movingai_map(task, out, resolution=resolution)
    start, goal = cells.cell_at(*task.start[:2]), cells.cell_at(*task.goal)
    beside = file_beside(out)
    assert beside is not None
    beside.unlink(missing_ok=True)  # an existing one would belong to another map
    if start is None or goal is None or not (cells.free[start] and cells.free[goal]):
        return {}
    answer = load_planner("dijkstra").plan(Query(Grid.from_free(cells.free), start, goal), np.random.default_rng(0))
    if not answer.solved:
        return {}
    problem = MapProblem(start, goal, answer.cost, f"{answer.cost:.8f}", out.name, int(answer.cost // 4))
    export_movingai_problems([problem], cells.free.shape, beside)
    return {"problem": str(beside)}
