"""Worlds in the files of other programs, with what each format has no place for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.base.plane import world_to_map
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
    """Write a world's files; facts about them, and what they have no place for."""
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


def file_beside(out: Path) -> Path | None:
    """The file that comes with the one that people name; None for a format of one file."""
    if out.suffix.lower() in SDF:
        return None
    return out.with_name(f"{out.name}.scen") if out.suffix.lower() == ".map" else out.with_suffix(".pgm")


def _corner(task: Task) -> list[float]:
    """Where a world's lower left corner, and with it that of its cells, lies in the map that it was made from."""
    return [float(v) for v in world_to_map(task.frame, [(*task.world.bounds[:2], 0.0)])[0]]


def _export_movingai(task: Task, out: Path, resolution: float | None) -> dict[str, str]:
    """Write the map and, if there is a path on its cells, the problem; the problem's file."""
    cells = export_movingai_map(task, out, resolution=resolution)
    start, goal = cells.cell_at(*task.start[:2]), cells.cell_at(*task.goal)
    beside = file_beside(out)
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
