"""What people see in a terminal: progress on stderr, one-line errors, tables and JSON on stdout."""

from __future__ import annotations

import json
import math
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import typer


@contextmanager
def bar(label: str) -> Iterator[Callable[[float], None]]:
    """A progress bar on stderr, told the fraction done; silent where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield lambda fraction: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(label, total=1.0)
        yield lambda fraction: progress.update(task, completed=fraction)


@contextmanager
def planning(label: str) -> Iterator[None]:
    """A bar over a planner's iterations, with the best length so far."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    from antdrive.planners import watch

    with Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[best]}"),
        console=Console(stderr=True), transient=True,
    ) as progress:  # fmt: skip
        task = progress.add_task(label, total=None, best="")

        def see(state: Any) -> None:
            best = f"best {state.best:.2f} m" if math.isfinite(state.best) else "no path yet"
            progress.update(task, completed=state.done, total=state.total, best=best)

        with watch(see):
            yield


def complain(message: str) -> None:
    """One line on stderr."""
    typer.echo(f"antdrive: {message}", err=True)


def say(text: str = "") -> None:
    """A line on stdout."""
    typer.echo(text)


def say_json(value: Any) -> None:
    """One JSON object on stdout; numbers that JSON does not know become null."""
    typer.echo(as_json(value))


def as_json(value: Any) -> str:
    """Indented JSON, strictly: numbers that JSON does not know become null."""
    return json.dumps(_strict(value), indent=2, allow_nan=False)


def table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Aligned columns on stdout; on a terminal a line ends where it does, elsewhere the last column is as long as it is."""
    lines = [tuple(headers), *(tuple(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(headers) - 1)]
    room = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in lines:
        text = "  ".join([*(cell.ljust(width) for cell, width in zip(line, widths, strict=False)), line[-1]]).rstrip()
        say(text if room is None or len(text) <= room else text[: room - 1] + "…")


def _strict(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _strict(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(item) for item in value]
    if hasattr(value, "item"):
        return _strict(value.item())
    return value
