"""Calls of user code, which may raise anything."""

from __future__ import annotations

import os
import signal
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from antdrive.base import supervision, system
from antdrive.base.errors import InputError, Terminated, input_error, visible
from antdrive.base.process_state import ProcessState

LIMIT = "ANTDRIVE_PLAN_LIMIT"  # variable of the environment with the limit on planning time, seconds or "off"
USUAL_LIMIT = "600"  # of the command line
LONGEST_LIMIT = 1e6  # [s]

PACKAGE, STANDARD = str(Path(__file__).parents[1]), str(Path(traceback.__file__).parent)  # folders of code
LONGEST = 200  # characters of a text made by user code


def error_text(error: BaseException) -> str:
    """Return an exception's class and message, shortened; without the message if the exception cannot format it."""
    if issubclass(type(error), OverLimit):
        return f"took longer than the limit of {plan_limit():g} s"
    message = _text(lambda: str(error), "")
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def value_text(value: object, longest: int = 40) -> str:
    """Return a value's `repr` in one line, shortened; if that raises, its type."""
    return _text(lambda: visible(repr(value)), f"a {type(value).__name__}", longest)


def place(error: BaseException, home: str | None) -> str:
    """Return the last place of an error in a file, as "planner.py:12"; else the last outside antdrive; or empty."""
    places = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    own = (at for at in reversed(places) if at[0] == home)
    others = (at for at in reversed(places) if not at[0].startswith((PACKAGE, STANDARD, "<")))
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


class OverLimit(BaseException):
    """User code took longer than the limit on planning time."""


def plan_limit(name: str = LIMIT) -> float | None:
    """Return the limit on planning time of this process and those that it starts [s]; None for no limit.

    Args:
        name: where the limit was written, for messages

    Raises:
        InputError: the variable of the environment is neither a positive number nor "off".
    """
    text = os.environ.get(LIMIT, "off")
    if text == "off":
        return None
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0 < seconds <= LONGEST_LIMIT:
        raise input_error(name, f"must be seconds, at most {LONGEST_LIMIT:.0e}, or off; got {text!r:.40}")
    return seconds


class UserCode:
    """A block that runs user code. Every exception that it raises becomes one of the caller's choice.

    `InputError`, errors of the caller's choice, Ctrl-C and SIGTERM pass unchanged. A `KeyboardInterrupt` that user
    code raises without Ctrl-C is an error like any other, and so is `OverLimit`, which an alarm raises after the limit on
    planning time. The block restores the `ProcessState`. A process that the code forks ends with the block. Blocks within a
    block of the main thread belong to it.

    Args:
        who: the code's name in messages about the end of the process
        error_of: returns the exception to raise instead
        passing: classes of exceptions that pass unchanged
        own: whether the code is antdrive's own, which needs no supervision and raises no `KeyboardInterrupt` itself
    """

    _outermost: UserCode | None = None

    def __init__(
        self,
        who: str,
        error_of: Callable[[BaseException], Exception],
        passing: tuple[type[BaseException], ...] = (),
        own: bool = False,
    ) -> None:
        self._who, self._error_of, self._own = who, error_of, own
        self._passing: tuple[type[BaseException], ...] = (InputError, Terminated, *passing)
        self._interrupted = False
        self._before: Any = None  # the handler of Ctrl-C

    def __enter__(self) -> None:
        # Only the main thread receives signals.
        if UserCode._outermost is not None or threading.current_thread() is not threading.main_thread():
            return
        self.limit = plan_limit()
        if not self._own:
            supervision.begin(self._who, self.limit)
            self._state, self._process = ProcessState(), os.getpid()
            self._before = signal.getsignal(signal.SIGINT)
        UserCode._outermost = self
        if callable(self._before):
            signal.signal(signal.SIGINT, self._interrupt)
        if self.limit is not None:
            self._alarm = system.Alarm(self.limit, self._ring)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        outermost = UserCode._outermost is self
        if outermost:
            if not self._own:
                if os.getpid() != self._process:
                    os._exit(0)
                self._state.restore_depth()
            self._leave()
        if error is None or issubclass(type(error), self._passing):
            return
        if issubclass(type(error), OverLimit) and UserCode._outermost is not None:
            return
        if (self._interrupted or self._own) and issubclass(type(error), KeyboardInterrupt):
            return
        raise self._error_of(error) from error

    def _leave(self) -> None:
        """Restore the handlers of signals and the state of the process."""
        UserCode._outermost = None
        if self.limit is not None:
            self._alarm.stop()
        if callable(self._before) and signal.getsignal(signal.SIGINT) == self._interrupt:
            signal.signal(signal.SIGINT, self._before)
        if not self._own:
            try:
                self._state.restore()
            finally:
                supervision.end()

    def _interrupt(self, *signalled: Any) -> None:
        self._interrupted = True
        self._before(*signalled)

    def _ring(self, *_: object) -> None:
        if UserCode._outermost is self:
            raise OverLimit
