"""Console output: progress and errors on stderr; text, tables and JSON on stdout.

Lists start fast: what they do without is imported on use.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from antdrive.base.errors import amount, visible
from antdrive.base.progress import bar as bar
from antdrive.base.progress import shown_progress
from antdrive.base.tables import BAD, GOOD
from antdrive.cli.commands import DEBUG

LAYOUT = "\n\t"  # control characters that lines may hold
COLOURS = {GOOD: "\033[32m{}\033[0m", BAD: "\033[31m{}\033[0m"}  # green and red
PLAIN = {GOOD: "+", BAD: "x"}  # for streams that cannot encode the signs


def report_compiling() -> None:
    """Print a line when the first kernel compiles; progress bars count the kernels."""
    from antdrive.base import kernel_cache

    lines = iter([kernel_cache.COMPILING])

    def compiles(_: str) -> None:
        for line in lines:
            print_error(line)

    kernel_cache.on_compile = compiles


@contextmanager
def working(label: str) -> Iterator[Callable[[str, int], None]]:
    """Show a bar for work of unknown length. Yields a function that takes the current stage and the number of runs."""
    with shown_progress(label) as show:
        yield lambda stage, done: show(f"{stage}, {amount(done, 'run')}")


@contextmanager
def planning(label: str) -> Iterator[None]:
    """Show a bar over planners' iterations, with the best length so far."""
    if not sys.stderr.isatty():
        yield
        return
    from antdrive.planners import on_progress

    with shown_progress(label) as show:

        def update(state: Any) -> None:
            best = f"best {state.best:.2f} m" if math.isfinite(state.best) else "no path yet"
            show(best, state.done, state.total)

        with on_progress(update):
            yield


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
