"""Progress on stderr: of commands, and of functions called from Python, shown in notebooks and elsewhere on request."""

from __future__ import annotations

import html
import importlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

WIDTH = 24  # characters of a bar in a notebook
PAUSE = 0.1  # between two updates of a notebook's cell [s]
_bars: list[Any] = []  # shown on the terminal
NOTED = 60.0  # between two lines where stderr is no terminal [s]


def in_notebook() -> bool:
    """Return whether the process is a notebook's kernel."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


@contextmanager
def progress_bar(wanted: Callable[..., None] | bool | None, label: str) -> Iterator[Callable[..., None]]:
    """Yield a callback that takes a fraction, or finished and all runs, and shows them as `bar` does.

    Args:
        wanted: a callback to use instead; True: show a bar; False: show nothing; None: show a bar in a notebook
        label: the text before the bar
    """
    if callable(wanted):
        yield wanted
    elif in_notebook() if wanted is None else wanted:
        with bar(label) as update:
            yield update
    else:
        yield lambda *done: None


@contextmanager
def bar(label: str) -> Iterator[Callable[..., None]]:
    """Show progress with pace and time left. Yields a function that takes the completed fraction, or finished and all runs.

    The pace excludes what was completed before the first call.
    """
    with shown_progress(label) as show:
        first: list[float] = []

        def update(done: float, size: int | None = None) -> None:
            now = time.monotonic()
            first[:] = first or [done, now]
            made, seconds = done - first[0], now - first[1]
            notes = [f"{done:4.0%}" if size is None else f"{done} of {size} runs"]
            if made > 0:
                notes += [] if size is None else [f"{made / max(seconds, 1e-9):.1f} runs/s"]
                notes.append(f"{duration(((size or 1) - done) * seconds / made)} left")
            show(", ".join(notes), done, 1 if size is None else size)

        yield update


@contextmanager
def shown_progress(label: str) -> Iterator[Callable[..., None]]:
    """Show progress: a bar on a terminal, text in a notebook's cell, elsewhere a line each minute.

    Yields a function that takes a note, the completed and the total work; the default is unknown.
    """
    display = _in_cell if in_notebook() else _on_terminal if sys.stderr.isatty() else _in_lines
    with display(label) as show:
        yield show


@contextmanager
def _in_cell(label: str) -> Iterator[Callable[..., None]]:
    output = importlib.import_module("IPython.display")
    cell, until = output.display(output.HTML(""), display_id=True), 0.0

    def show(note: str = "", completed: float = 0, total: float | None = None) -> None:
        nonlocal until
        fraction = completed / total if total else 0.0
        if fraction >= 1 or time.monotonic() >= until:
            text = f"{label} [{'#' * round(WIDTH * fraction):{WIDTH}}] {note}"
            cell.update(output.HTML(f"<pre>{html.escape(text)}</pre>"))
            until = time.monotonic() + PAUSE

    try:
        show()
        yield show
    finally:
        cell.update(output.HTML(""))


@contextmanager
def _on_terminal(label: str) -> Iterator[Callable[..., None]]:
    """Show a transient bar, and the number of kernels compiled meanwhile."""
    from rich import progress
    from rich.console import Console

    from antdrive.base import kernel_cache

    columns: tuple[Any, ...] = (progress.TextColumn("{task.description}"), progress.BarColumn())
    columns += (progress.TextColumn("{task.fields[note]}"), progress.TimeElapsedColumn())
    on_top = sys.stdout.isatty()  # print above the bar on a terminal; leave a redirected stdout alone
    settings: dict[str, Any] = {"transient": True, "refresh_per_second": 4, "redirect_stdout": on_top}
    with progress.Progress(*columns, console=Console(stderr=True), **settings) as rows:
        task, kernels = rows.add_task(label, total=None, note=""), 0

        def compiles(name: str) -> None:
            nonlocal kernels
            kernels += 1
            before(name)
            rows.update(task, description=f"{label} (kernels compiled once: {kernels})")

        def show(note: str = "", completed: float = 0, total: float | None = None) -> None:
            rows.update(task, note=note, completed=completed, total=total)

        before, kernel_cache.on_compile = kernel_cache.on_compile, compiles
        _bars.append(rows)
        try:
            yield show
        finally:
            _bars.remove(rows)
            kernel_cache.on_compile = before


def hide_bars() -> None:
    """Erase the bars and end the threads that draw them: neither outlives this process, nor gets into its child."""
    before = set(threading.enumerate())
    for rows in _bars:
        rows.stop()
    for thread in before if _bars else ():
        if type(thread).__name__ == "_RefreshThread":  # rich's, which ends soon after `stop`
            thread.join(1.0)


def show_bars() -> None:
    """Show the bars again that `hide_bars` erased."""
    for rows in _bars:
        rows.start()


@contextmanager
def _in_lines(label: str) -> Iterator[Callable[..., None]]:
    noted = time.monotonic()

    def show(note: str = "", completed: float = 0, total: float | None = None) -> None:
        nonlocal noted
        if (now := time.monotonic()) - noted >= NOTED and (total is None or completed < total):
            noted = now
            with suppress(OSError):
                sys.stderr.write(f"antdrive: {label}: {note}\n")
                sys.stderr.flush()

    yield show


def duration(seconds: float) -> str:
    """Format a duration: 45 s, 12 min, 3 h 20 min, 2 d 4 h."""
    minutes = round(seconds / 60)
    if seconds < 90:
        return f"{seconds:.0f} s"
    if minutes < 90:
        return f"{minutes} min"
    hours = minutes // 60
    return f"{hours} h {minutes % 60} min" if hours < 48 else f"{hours // 24} d {hours % 24} h"
