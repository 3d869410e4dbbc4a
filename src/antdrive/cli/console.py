"""Console output: progress bars and errors on stderr; text, tables and JSON on stdout.

Lists start fast: what they do without is imported on use.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from antdrive.base.errors import amount, visible
from antdrive.base.tables import BAD, GOOD
from antdrive.cli.commands import DEBUG

LAYOUT = "\n\t"  # control characters that lines may hold
COLOURS = {GOOD: "\033[32m{}\033[0m", BAD: "\033[31m{}\033[0m"}  # green and red
PLAIN = {GOOD: "+", BAD: "x"}  # for streams that cannot encode the signs
NOTED = 60.0  # between two lines about a campaign where stderr is no terminal [s]


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

    from antdrive.base import kernel_cache

    made = [
        getattr(progress, column)() if column.endswith("Column") else progress.TextColumn(column) for column in columns
    ]
    shown = (progress.TextColumn("{task.description}"), progress.BarColumn(), *made)
    with progress.Progress(*shown, console=Console(stderr=True), transient=True, **settings) as rows:
        task = rows.add_task(label, total=total, note="")
        kernels = 0

        def compiles(name: str) -> None:
            nonlocal kernels
            kernels += 1
            before(name)
            rows.update(task, description=f"{label} (kernels compiled once: {kernels})")

        before, kernel_cache.on_compile = kernel_cache.on_compile, compiles
        try:
            yield lambda **changes: rows.update(task, **changes)
        finally:
            kernel_cache.on_compile = before


def report_compiling() -> None:
    """Print a line when the first kernel compiles; progress bars count the kernels."""
    from antdrive.base import kernel_cache

    lines = iter([kernel_cache.COMPILING])

    def compiles(_: str) -> None:
        for line in lines:
            print_error(line)

    kernel_cache.on_compile = compiles


@contextmanager
def bar(label: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar. Yields a function that takes the completed fraction."""
    on_top = sys.stdout.isatty()  # print above the bar on a terminal; leave a redirected stdout alone
    columns = ("{task.percentage:>3.0f} %", "TimeRemainingColumn")
    with _progress(label, *columns, total=1.0, redirect_stdout=on_top) as show:
        yield lambda fraction: show(completed=fraction) if show else None


@contextmanager
def stage(label: str) -> Iterator[None]:
    """Show what a command does while that has no measurable progress."""
    with _progress(label, "TimeElapsedColumn"):
        yield


@contextmanager
def working(label: str) -> Iterator[Callable[[str, int], None]]:
    """Show a bar for work of unknown length. Yields a function that takes the current stage and the number of runs."""
    with _progress(label, "{task.fields[note]}", "TimeElapsedColumn") as show:
        yield lambda stage, done: show(note=f"{stage}, {amount(done, 'run')}") if show else None


@contextmanager
def campaign_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar for many runs, with rate and time left. Yields a function that takes completed and total runs.

    Where stderr is no terminal, a line each minute says the same. The rate excludes runs completed before the first call.
    """
    columns = ("MofNCompleteColumn", "{task.fields[note]}", "TimeElapsedColumn")
    with _progress(label, *columns, refresh_per_second=4) as show:
        first: list[float] = []
        noted = time.monotonic()

        def update(done: int, size: int) -> None:
            nonlocal noted
            now = time.monotonic()
            first[:] = first or [done, now]
            made, seconds = done - first[0], now - first[1]
            pace = f"{made / seconds:.1f} runs/s, {duration((size - done) * seconds / made)} left" if made > 0 else ""
            if show:
                show(completed=done, total=size, note=pace)
            elif now - noted >= NOTED and done < size:
                noted = now
                print_error(f"{label}: {done} of {size} runs{pace and ', '}{pace}")

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
        _write(sys.stderr, f"antdrive: {visible(message, LAYOUT)}")


def print_traceback(error: Exception) -> bool:
    """Print an error's traceback on stderr if `--debug` is given; return whether it is."""
    if debug := DEBUG in sys.argv[1:]:
        import traceback

        traceback.print_exception(error)
    return debug


def print_line(text: str = "") -> None:
    """Print one line on stdout; an error names it."""
    _print(_signed(visible(text, LAYOUT)))


def _print(text: str) -> None:
    try:
        _write(sys.stdout, text)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, "stdout") from None


def _write(stream: TextIO, text: str) -> None:
    stream.write(f"{text}\n")
    stream.flush()


def _signed(text: str) -> str:
    """Colour the signs of success and failure on a terminal, unless `NO_COLOR` is set; spell them if stdout cannot."""
    coloured = sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    for one, colour in COLOURS.items():
        if one in text:
            word = one if _encodes(one) else PLAIN[one]
            text = text.replace(one, colour.format(word) if coloured else word)
    return text


def _encodes(text: str) -> bool:
    """Return whether stdout can write a text."""
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def print_json(value: Any) -> None:
    """Print one JSON object on stdout."""
    from antdrive.base.files import as_json

    _print(visible(as_json(value), LAYOUT))


def show(json: bool, facts: Any, lines: Iterable[str]) -> None:
    """Print facts as one JSON object, or lines of text, on stdout."""
    if json:
        print_json(facts)
    else:
        for line in lines:
            print_line(line)


def this_command() -> str:
    """Return the running command as typed in a shell."""
    import shlex

    return shlex.join(["antdrive", *sys.argv[1:]])
