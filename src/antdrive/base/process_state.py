"""Process state that user code may change: streams, folder, signals, limits, environment."""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # without the slow enumerations of `signal`
import contextlib
import gc
import locale
import os
import sys
import time
import warnings
from typing import Any

from antdrive.base import system

SIGNALS = system.signals("SIGINT", "SIGTERM", "SIGBREAK", "SIGHUP", "SIGALRM", "SIGPIPE", "SIGCHLD")
STREAMS = ("stdin", "stdout", "stderr")
TIMER_TOLERANCE = 0.05  # [s]
_ENVIRONMENT = vars(os.environ)["_data"]  # mostly encoded; decoding all takes longer than everything else here


class _Unclosable:
    """A standard stream that user code cannot close."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def __iter__(self) -> Any:
        return iter(self._stream)

    def __next__(self) -> Any:
        return next(self._stream)

    def __enter__(self) -> _Unclosable:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Flush the stream."""
        with contextlib.suppress(OSError, ValueError):
            self._stream.flush()


class ProcessState:
    """The state of this process at the beginning of user code.

    Variables and folders of the import path that user code adds remain, as do a higher recursion limit and filters of
    warnings other than errors: importing a planner may set them for its plans.
    """

    def __init__(self) -> None:
        self._depth = sys.getrecursionlimit()
        self._streams = [(name, number, getattr(sys, name), _copy(number)) for number, name in enumerate(STREAMS)]
        for name, _, stream, _ in self._streams:
            if stream is not None:
                setattr(sys, name, _Unclosable(stream))
        self._folder = _folder()
        self._mask = os.umask(0o077)
        os.umask(self._mask)
        self._handlers = [_signal.getsignal(number) for number in SIGNALS]
        self._timer, self._since = system.timer(), time.perf_counter()
        self._blocked = system.signal_mask()
        self._environment = dict(_ENVIRONMENT)
        self._path = list(sys.path)
        self._filters = list(warnings.filters)
        self._collects = gc.isenabled()
        self._locale = locale.setlocale(locale.LC_ALL)
        numpy = sys.modules.get("numpy")
        self._errors = None if numpy is None else numpy.geterr()

    def restore_depth(self) -> None:
        """Undo a lower recursion limit, which the calls of `restore` may exceed."""
        if sys.getrecursionlimit() < self._depth:
            sys.setrecursionlimit(self._depth)

    def restore(self) -> None:
        """Undo the other changes of user code."""
        for name, number, stream, copy in self._streams:
            if copy is not None:
                os.dup2(copy, number)
                os.close(copy)
            setattr(sys, name, _open_again(name, number, stream))
        if self._folder is not None and _folder() != self._folder:
            with contextlib.suppress(OSError):  # user code has removed it
                os.chdir(self._folder)
        os.umask(self._mask)
        for number, handler in zip(SIGNALS, self._handlers, strict=True):
            if handler is not None and _signal.getsignal(number) is not handler:
                _signal.signal(number, handler)
        left = self._timer[0] and max(self._timer[0] - time.perf_counter() + self._since, 1e-3)
        if abs(system.timer()[0] - left) > TIMER_TOLERANCE:
            system.set_timer(left, self._timer[1])
        system.set_signal_mask(self._blocked)
        if self._environment != _ENVIRONMENT:
            for key, value in self._environment.items():
                if _ENVIRONMENT.get(key) != value:
                    os.environ[os.fsdecode(key)] = os.fsdecode(value)
        if any(entry not in sys.path for entry in self._path):
            sys.path[:] = [*self._path, *(entry for entry in sys.path if entry not in self._path)]
        if warnings.filters != self._filters:
            _drop_errors(self._filters)
        if gc.isenabled() != self._collects:
            gc.enable() if self._collects else gc.disable()
        if locale.setlocale(locale.LC_ALL) != self._locale:
            locale.setlocale(locale.LC_ALL, self._locale)
        if self._errors is not None:
            sys.modules["numpy"].seterr(**self._errors)


def _copy(number: int) -> int | None:
    """Return a copy of an open file's number; None if it is closed."""
    try:
        return os.dup(number)
    except OSError:
        return None


def _folder() -> str | None:
    """Return the working directory; None if it was removed."""
    try:
        return os.getcwd()
    except OSError:
        return None


def _open_again(name: str, number: int, stream: Any) -> Any:
    """Return a standard stream, a new one if it was closed or detached."""
    with contextlib.suppress(ValueError):
        if stream is None or not getattr(stream, "closed", False):
            return stream
    again = os.fdopen(number, "r" if name == "stdin" else "w", closefd=False)
    if getattr(sys, f"__{name}__") is stream:
        setattr(sys, f"__{name}__", again)
    return again


def _drop_errors(before: list[Any]) -> None:
    """Remove the filters that make errors of warnings, except those from before, and restore missing ones."""
    added = [each for each in warnings.filters if each not in before and each[0] != "error"]
    warnings.resetwarnings()  # clears what Python remembers of them
    warnings.filters[:] = [*added, *before]  # type: ignore[index]
