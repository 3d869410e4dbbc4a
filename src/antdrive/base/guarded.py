"""Calls of user code, which may raise anything."""

from __future__ import annotations

import signal
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from antdrive.base.errors import InputError, Terminated, input_error

PACKAGE, STANDARD = str(Path(__file__).parents[1]), str(Path(traceback.__file__).parent)  # folders of code
LONGEST = 200  # characters of a text made by user code


def error_text(error: BaseException) -> str:
    """Return an exception's class and message, shortened; without the message if the exception cannot format it."""
    message = _text(lambda: str(error), "")
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def value_text(value: object, longest: int = 40) -> str:
    """Return a value's `repr`, shortened; if that raises, its type."""
    return _text(lambda: repr(value), f"a {type(value).__name__}", longest)


def place(error: BaseException, home: str | None) -> str:
    """Return the last place of an error in a file, as "planner.py:12"; else the last outside antdrive; or empty."""
    places = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    own = (one for one in reversed(places) if one[0] == home)
    others = (one for one in reversed(places) if not one[0].startswith((PACKAGE, STANDARD, "<")))
    file, line = next(iter((*own, *others)), ("", 0))
    return f"{Path(file).name}:{line}" if file else ""


def one_line(text: str) -> str:
    """Return a text of user code as one line of printable characters, shortened."""
    return str(input_error(_shortened(text, LONGEST)))


def _text(make: Callable[[], str], otherwise: str, longest: int = LONGEST) -> str:
    try:
        text = str.__str__(make()).strip()
    except Terminated:
        raise
    except BaseException:  # user code may raise anything
        return otherwise
    return _shortened(text, longest)


def _shortened(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


class UserCode:
    """A block that runs user code. Every exception that it raises becomes one of the caller's choice.

    `InputError`, errors of the caller's choice, Ctrl-C and SIGTERM pass unchanged. A `KeyboardInterrupt` that the code
    raises without Ctrl-C is an error like any other.

    Args:
        error_of: returns the exception to raise instead
        passing: classes of exceptions that pass unchanged
    """

    def __init__(
        self, error_of: Callable[[BaseException], Exception], passing: tuple[type[BaseException], ...] = ()
    ) -> None:
        self._error_of = error_of
        self._passing: tuple[type[BaseException], ...] = (InputError, Terminated, *passing)
        self._interrupted = False
        self._handler: Any = None

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread():  # only this thread receives signals
            self._handler = signal.getsignal(signal.SIGINT)
            if callable(self._handler):
                signal.signal(signal.SIGINT, self._interrupt)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if callable(self._handler) and signal.getsignal(signal.SIGINT) == self._interrupt:
            signal.signal(signal.SIGINT, self._handler)
        if error is None or issubclass(type(error), self._passing):
            return
        if self._interrupted and issubclass(type(error), KeyboardInterrupt):
            return
        raise self._error_of(error) from error

    def _interrupt(self, *signalled: Any) -> None:
        self._interrupted = True
        self._handler(*signalled)
