"""Console output: progress bars and errors on stderr; text, tables and JSON on stdout."""

from __future__ import annotations

import math
import shlex
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import typer

from antdrive.base.errors import visible
from antdrive.base.files import as_json

LAYOUT = "\n\t"  # control characters that lines may hold


@contextmanager
def _progress(
    label: str, *columns: Any, total: float | None = None, **settings: Any
) -> Iterator[Callable[..., None] | None]:
    """Show a transient progress bar on stderr with a label and further columns.

    Yields a function that updates `completed`, `total` or a column's field; None if stderr is not a terminal.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich import progress
    from rich.console import Console

    made = [
        getattr(progress, column)() if column.endswith("Column") else progress.TextColumn(column) for column in columns
    ]
    shown = (progress.TextColumn("{task.description}"), progress.BarColumn(), *made)
    with progress.Progress(*shown, console=Console(stderr=True), transient=True, **settings) as rows:
        task = rows.add_task(label, total=total, note="")
        yield lambda **changes: rows.update(task, **changes)


@contextmanager
def bar(label: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar. Yields a function that takes the completed fraction."""
    on_top = sys.stdout.isatty()  # print above the bar on a terminal; leave a redirected stdout alone
    columns = ("{task.percentage:>3.0f} %", "TimeRemainingColumn")
    with _progress(label, *columns, total=1.0, redirect_stdout=on_top) as show:
        yield lambda fraction: show(completed=fraction) if show else None


@contextmanager
def working(label: str) -> Iterator[Callable[[str, int], None]]:
    """Show a bar for work of unknown length. Yields a function that takes the current stage and the number of runs."""
    with _progress(label, "{task.fields[note]}", "TimeElapsedColumn") as show:
        yield lambda stage, done: show(note=f"{stage}, {done} runs") if show else None


@contextmanager
def campaign_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar for many runs, with rate and time left. Yields a function that takes completed and total runs.

    The rate excludes runs completed before the first call.
    """
    columns = ("MofNCompleteColumn", "{task.fields[note]}", "TimeElapsedColumn")
    with _progress(label, *columns, refresh_per_second=4) as show:
        first: list[float] = []

        def update(done: int, size: int) -> None:
            now = time.monotonic()
            first[:] = first or [done, now]
            made, seconds = done - first[0], now - first[1]
            pace = f"{made / seconds:.1f} runs/s, {duration((size - done) * seconds / made)} left" if made > 0 else ""
            if show:
                show(completed=done, total=size, note=pace)

        yield update


@contextmanager
def planning(label: str) -> Iterator[None]:
    """Show a bar over planners' iterations, with the best length so far."""
    with _progress(label, "{task.fields[note]}") as show:
        if show is None:
            yield
            return
        from antdrive.planners import on_progress

        def update(state: Any) -> None:
            best = f"best {state.best:.2f} m" if math.isfinite(state.best) else "no path yet"
            show(completed=state.done, total=state.total, note=best)

        with on_progress(update):
            yield


def duration(seconds: float) -> str:
    """Format a duration: 45 s, 12 min, 3 h 20 min, 2 d 4 h."""
    minutes = round(seconds / 60)
    if seconds < 90:
        return f"{seconds:.0f} s"
    if minutes < 90:
        return f"{minutes} min"
    hours = minutes // 60
    return f"{hours} h {minutes % 60} min" if hours < 48 else f"{hours // 24} d {hours % 24} h"


def print_error(message: str) -> None:
    """Print one line on stderr; a stderr that cannot take it costs no results."""
    with suppress(OSError):
        typer.echo(f"antdrive: {visible(message, LAYOUT)}", err=True)


def print_line(text: str = "") -> None:
    """Print one line on stdout; an error names it."""
    try:
        typer.echo(visible(text, LAYOUT))
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, "stdout") from None


def print_json(value: Any) -> None:
    """Print one JSON object on stdout."""
    print_line(as_json(value))


def show(json: bool, facts: Any, lines: Iterable[str]) -> None:
    """Print facts as one JSON object, or lines of text, on stdout."""
    if json:
        print_json(facts)
    else:
        for line in lines:
            print_line(line)


def table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield lines of aligned columns, truncated at the terminal's width, complete elsewhere."""
    lines = [tuple(headers), *(tuple(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(headers) - 1)]
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in lines:
        aligned = [cell.ljust(width) for cell, width in zip(line, widths, strict=False)]
        text = "  ".join([*aligned, line[-1]]).rstrip()
        yield text if columns is None or len(text) <= columns else text[: columns - 1] + "…"


def file_lines(files: Mapping[str, object]) -> Iterator[str]:
    """Return one line per written file: name and path."""
    width = max([8, *map(len, files)])
    return (f"  {name:{width}} {path}" for name, path in files.items())


def this_command() -> str:
    """Return the running command as typed in a shell."""
    return shlex.join(["antdrive", *sys.argv[1:]])
