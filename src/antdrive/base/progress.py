"""Progress bars of functions called from Python: shown in notebooks, elsewhere on request."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

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
    shown: dict[str, Any] = {"text": "", "until": 0.0}

    def show(text: str) -> None:
        sys.stderr.write(f"\r{text:{len(shown['text'])}}")
        sys.stderr.flush()
        shown.update(text=text, until=time.monotonic() + PAUSE)

    def update(done: float, size: float | None = None) -> None:
        fraction = done / (size or 1)
        if fraction >= 1 or time.monotonic() >= shown["until"]:
            counted = "" if size is None else f", {done} of {size} runs"
            show(f"{label} [{'#' * round(WIDTH * fraction):{WIDTH}}] {fraction:4.0%}{counted}")

    try:
        update(0.0, None)
        yield update
    finally:
        show("")
        sys.stderr.write("\r")
