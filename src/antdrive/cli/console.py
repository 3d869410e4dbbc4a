"""How the command line prints: progress bars and errors on stderr, text, tables and JSON on stdout."""

from __future__ import annotations

import json
import math
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import typer


@contextmanager
def bar(label: str) -> Iterator[Callable[[float], None]]:
    """A progress bar on stderr, which shows nothing where stderr is no terminal.

    Yields a function that the block calls with the fraction that is done.
    """
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
    on_top = sys.stdout.isatty()  # else what is printed meanwhile would not reach the file that stdout is
    with Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=on_top) as progress:
        task = progress.add_task(label, total=1.0)
        yield lambda fraction: progress.update(task, completed=fraction)


@contextmanager
def working(label: str) -> Iterator[Callable[[str, int], None]]:
    """A bar on stderr for work of unknown length, which shows nothing where stderr is no terminal.

    Yields a function that the block calls with what it is doing and how many steps it has done.
    """
    if not sys.stderr.isatty():
        yield lambda stage, done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[at]}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(label, total=None, at="")
        yield lambda stage, done: progress.update(task, at=f"{stage}, {done} runs")


@contextmanager
def campaign_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on stderr for many runs, with their rate and the time left; where stderr is no terminal it shows nothing.

    Yields a function that the block calls with the numbers of runs that are done and of all. What is done at the first call
    does not count for the rate.
    """
    if not sys.stderr.isatty():
        yield lambda done, size: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[pace]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True, refresh_per_second=4) as progress:
        task = progress.add_task(label, total=None, pace="")
        first: list[float] = []

        def update(done: int, size: int) -> None:
            now = time.monotonic()
            first[:] = first or [done, now]
            made, seconds = done - first[0], now - first[1]
            pace = f"{made / seconds:.1f} runs/s, {duration((size - done) * seconds / made)} left" if made > 0 else ""
            progress.update(task, completed=done, total=size, pace=pace)

        yield update


def duration(seconds: float) -> str:
    """A time in words of a length that suits it: 45 s, 12 min, 3 h 20 min, 2 d 4 h."""
    minutes = round(seconds / 60)
    if seconds < 90:
        return f"{seconds:.0f} s"
    if minutes < 90:
        return f"{minutes} min"
    hours = minutes // 60
    return f"{hours} h {minutes % 60} min" if hours < 48 else f"{hours // 24} d {hours % 24} h"


@contextmanager
def planning(label: str) -> Iterator[None]:
    """A progress bar over the iterations of planners that run in the block, with the best length so far."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    from antdrive.planners import watch

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[best]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(label, total=None, best="")

        def update(state: Any) -> None:
            best = f"best {state.best:.2f} m" if math.isfinite(state.best) else "no path yet"
            progress.update(task, completed=state.done, total=state.total, best=best)

        with watch(update):
            yield


def print_error(message: str) -> None:
    """Print one line on stderr."""
    typer.echo(f"antdrive: {message}", err=True)


def print_line(text: str = "") -> None:
    """Print one line on stdout."""
    typer.echo(text)


def print_json(value: Any) -> None:
    """Print one JSON object on stdout."""
    typer.echo(as_json(value))


def as_json(value: Any) -> str:
    """Indented JSON that every reader accepts: infinities and nan become null."""
    return json.dumps(_json_value(value), indent=2, allow_nan=False)


def print_table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print aligned columns on stdout. On a terminal, lines are cut at its width; elsewhere they are complete."""
    lines = [tuple(headers), *(tuple(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(headers) - 1)]
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in lines:
        aligned = [cell.ljust(width) for cell, width in zip(line, widths, strict=False)]
        text = "  ".join([*aligned, line[-1]]).rstrip()
        print_line(text if columns is None or len(text) <= columns else text[: columns - 1] + "…")


def print_files(files: dict[str, str]) -> None:
    """Print the written files, one line each: what a file is, and its path."""
    width = max([8, *map(len, files)])
    for name, path in files.items():
        print_line(f"  {name:{width}} {path}")


def _json_value(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item) for item in value]
    if hasattr(value, "item"):
        return _json_value(value.item())
    return value
