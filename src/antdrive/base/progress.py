"""Progress bars of functions called from Python: shown in notebooks, elsewhere on request."""

from __future__ import annotations

import html
import importlib
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

WIDTH = 24  # characters of a bar
PAUSE = 0.1  # between two updates of a bar [s]


def in_notebook() -> bool:
    """Return whether the process is a notebook's kernel."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


@contextmanager
def progress_bar(wanted: Callable[..., None] | bool | None, label: str) -> Iterator[Callable[..., None]]:
    """Yield a callback that takes a fraction, or finished and all runs, and shows them on stderr.

    Args:
        wanted: a callback to use instead; True: show a bar; False: show nothing; None: show a bar in a notebook
        label: the text before the bar
    """
    if callable(wanted):
        yield wanted
        return
    if not (in_notebook() if wanted is None else wanted):
        yield lambda *done: None
        return
    show, until = _place(), 0.0

    def update(done: float, size: float | None = None) -> None:
        nonlocal until
        fraction = done / (size or 1)
        if fraction >= 1 or time.monotonic() >= until:
            counted = "" if size is None else f", {done} of {size} runs"
            show(f"{label} [{'#' * round(WIDTH * fraction):{WIDTH}}] {fraction:4.0%}{counted}")
            until = time.monotonic() + PAUSE

    try:
        update(0.0, None)
        yield update
    finally:
        show("")


def _place() -> Callable[[str], None]:
    """Return a function that shows a text instead of its last one: in a notebook's cell, which keeps none, or on stderr."""
    if in_notebook():
        output = importlib.import_module("IPython.display")
        cell = output.display(output.HTML(""), display_id=True)
        return lambda text: cell.update(output.HTML(f"<pre>{html.escape(text)}</pre>" if text else ""))
    width = 0

    def show(text: str) -> None:
        nonlocal width
        sys.stderr.write(f"\r{text:{width}}" if text else f"\r{'':{width}}\r")
        sys.stderr.flush()
        width = len(text)

    return show
