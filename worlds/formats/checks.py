"""What every export checks."""

from __future__ import annotations

from pathlib import Path

from antdrive.worlds.errors import input_error
from antdrive.worlds.world import Task


def require_no_movers(task: Task, path: str | Path) -> None:
    """Refuse a task with movers, which no format but our own can hold.

    Args:
        task: the task to export
        path: the file to write

    Raises:
        InputError: the world has movers.
    """
    if task.world.movers:
        problem = f"cannot hold {task.world.name}'s movers; export a world in which nothing moves"
        raise input_error(str(path), problem)
