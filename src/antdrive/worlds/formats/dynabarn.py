"""Import of the DynaBARN set (A. Nair et al., *DynaBARN*, SSRR 2022), with trajectories as keyframes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from antdrive.base.checks import show
from antdrive.base.document import Document, Location, read_json
from antdrive.worlds.files.world_file import task_from_dict
from antdrive.worlds.world import Task

DYNABARN_TIME_LIMIT = 100.0  # of the challenge [s]
DYNABARN_CELL = 0.25  # [m]


def import_dynabarn(path: str | os.PathLike[str], *, cell: float = DYNABARN_CELL) -> list[Task]:
    """Import the worlds of a DynaBARN set, one task each, with grids of cells of `cell` [m].

    The file is JSON: a list of mappings with name, bounds, start, goal, goal_tolerance and movers. Each mover has radius,
    length, period, loop and keyframes_t_x_y. The tasks have the challenge's time limit of 100 s.

    Raises:
        InputError: the file is unreadable or not a DynaBARN set.
    """
    document = read_json(path)
    if not isinstance(document.data, list) or not document.data:
        raise document.error((), f"must be a list of worlds, got {show(document.data)}")
    return [_task(document, i, world, cell) for i, world in enumerate(document.data)]


def _task(document: Document, index: int, world: Any, cell: float) -> Task:
    if not isinstance(world, dict) or not isinstance(world.get("movers"), list):
        problem = f"must be a mapping with name, bounds, start, goal and movers, got {show(world)}"
        raise document.error((index,), problem)
    name = str(world.get("name", f"world {index}"))
    kept = {key: world[key] for key in ("name", "bounds", "start", "goal", "goal_tolerance") if key in world}
    task = {
        "schema": 1,
        **kept,
        "source": f"DynaBARN, imported from {Path(document.source).name}; keyframes played back in straight lines",
        "cell": cell,
        "time_limit": DYNABARN_TIME_LIMIT,
        "movers": [_mover(document, (index, "movers", i), mover) for i, mover in enumerate(world["movers"])],
    }
    return task_from_dict(task, f"{document.source}: {name}")


def _mover(document: Document, at: Location, mover: Any) -> dict[str, Any]:
    """Return a mover with the keys of a world file; `task_from_dict` validates the values."""
    if not isinstance(mover, dict):
        raise document.error(at, f"must be a mapping with radius, length, loop and keyframes_t_x_y, got {show(mover)}")
    frames = mover.get("keyframes_t_x_y")
    if not isinstance(frames, list):
        raise document.error((*at, "keyframes_t_x_y"), "missing; write a list of [t, x, y]")
    _check_period(document, at, frames, mover.get("period"))
    return {
        "radius": mover.get("radius"),
        "height": mover.get("length", 1.0),
        "loop": mover.get("loop"),
        "keyframes": frames,
    }


def _check_period(document: Document, at: Location, frames: list[Any], period: Any) -> None:
    """Raise InputError unless the period is the keyframes' duration: world files have no period."""
    try:
        duration = float(frames[-1][0]) - float(frames[0][0])
    except (TypeError, ValueError, LookupError):
        return  # the validation of the keyframes reports it
    if period is not None and not (isinstance(period, int | float) and abs(period - duration) <= 0.01):
        problem = f"must be {duration:g}, the time from the first keyframe to the last, got {show(period)}"
        raise document.error((*at, "period"), problem)
