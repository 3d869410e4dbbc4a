"""What every export checks."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from antdrive.base.errors import input_error
from antdrive.worlds.world import Task


def require_no_movers(task: Task, path: str | Path) -> None:
    """Refuse a task with movers, which no format but our own can hold.

    Raises:
        InputError: the world has movers.
    """
    if task.world.movers:
        problem = f"cannot hold {task.world.name}'s movers; export a world in which nothing moves"
        raise input_error(str(path), problem)


def require_new(files: Iterable[Path], *, replace: bool) -> None:
    """Refuse to write over files that exist.

    Raises:
        InputError: one of them exists.
    """
    taken = None if replace else next((file for file in files if file.exists()), None)
    if taken is not None:
        raise input_error(str(taken), "exists; name another file, or replace it with --force")
