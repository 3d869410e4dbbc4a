"""Signals, alarms, locks and processes of this operating system. Other modules do not ask which one it is.

Windows has no `fcntl`, alarms, signal masks, `poll` or fork. Only Linux ends a child with its killed parent.
"""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # without the slow enumerations of `signal`
import _thread
import contextlib
import errno
import importlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

AGAIN = 1.0  # an alarm repeats, in case the code that it interrupts catches the exception [s]
QUERY, RUNNING = 0x101000, 0x102  # Windows: the right to ask whether a process runs, and the answer
NONE = 87  # Windows: the error of a number that no process has
WHOLE = 2**30  # Windows: the byte that stands for a locked file, whose text stays readable
TAKEN = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)


def _module(name: str) -> Any:
    """Import a module of the standard library; None if this system lacks it."""
    with contextlib.suppress(ImportError):
        return importlib.import_module(name)
    return None


_fcntl, _msvcrt, _winapi = map(_module, ("fcntl", "msvcrt", "_winapi"))

#: Whether user code can run in a supervised child, which never outlives its parent.
FORKS = sys.platform == "linux" and hasattr(os, "fork")
MOST_WORKERS = 256 if _winapi is None else 60  # that a process can wait for


def signals(*names: str) -> tuple[signal.Signals, ...]:
    """Return those of the named signals that this system has."""
    return tuple(getattr(signal, name) for name in names if hasattr(signal, name))


(KILL, *_) = signals("SIGKILL", "SIGTERM")  # Windows: `os.kill` ends a process at once, whatever the signal
(ALARM, *_) = signals("SIGALRM", "SIGBREAK")


def kill(process: int) -> None:
    """End a process at once."""
    os.kill(process, KILL)


def is_alive(process: int) -> bool:
    """Return whether a process exists, be it another user's."""
    try:
        if _winapi is None:
            os.kill(process, 0)
            return True
        handle = _winapi.OpenProcess(QUERY, False, process)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError) as error:
        return getattr(error, "winerror", None) != NONE
    try:
        return bool(_winapi.WaitForSingleObject(handle, 0) == RUNNING)
    finally:
        _winapi.CloseHandle(handle)


def lock(handle: int, place: int | None = None) -> bool:
    """Lock an open file for this handle, or one byte of it for this process; return whether it was free.

    The lock ends with the process. The byte need not exist.
    """
    try:
        if _fcntl is None:
            os.lseek(handle, WHOLE if place is None else place, os.SEEK_SET)
            try:
                _msvcrt.locking(handle, _msvcrt.LK_NBLCK, 1)
            finally:
                os.lseek(handle, 0, os.SEEK_SET)
        elif place is None:
            _fcntl.flock(handle, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
        else:
            _fcntl.lockf(handle, _fcntl.LOCK_EX | _fcntl.LOCK_NB, 1, place)
    except OSError as error:
        if error.errno not in TAKEN:
            raise
        return False
    return True


def unlock(handle: int, place: int) -> None:
    """Unlock a byte of a file."""
    if _fcntl is None:
        os.lseek(handle, place, os.SEEK_SET)
        _msvcrt.locking(handle, _msvcrt.LK_UNLCK, 1)
    else:
        _fcntl.lockf(handle, _fcntl.LOCK_UN, 1, place)


class Alarm:
    """A call in the main thread after some seconds [s], and again every `AGAIN` seconds until it is stopped.

    Blocking calls are interrupted except on Windows. A timer of the caller's goes on afterwards.
    """

    def __init__(self, seconds: float, ring: Callable[..., None]) -> None:
        self._ring, self._due, self._stopped = ring, False, threading.Event()
        self._since = time.perf_counter()
        self._before = signal.signal(ALARM, ring if hasattr(signal, "setitimer") else self._interrupt)
        if hasattr(signal, "setitimer"):
            self._timer = signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
        else:
            threading.Thread(target=self._wait, args=(seconds,), daemon=True).start()

    def stop(self) -> None:
        """Restore the caller's alarm."""
        self._stopped.set()
        set_timer(0.0, 0.0)
        signal.signal(ALARM, self._before)
        if hasattr(signal, "setitimer"):
            left, interval = self._timer
            set_timer(left and max(left - time.perf_counter() + self._since, 1e-3), interval)

    def _wait(self, seconds: float) -> None:
        while not self._stopped.wait(seconds):
            self._due, seconds = True, AGAIN
            _thread.interrupt_main(ALARM)

    def _interrupt(self, *_: object) -> None:
        if self._due:
            self._ring()
        else:  # Ctrl-Break
            signal.signal(ALARM, self._before)
            signal.raise_signal(ALARM)


def timer() -> tuple[float, float]:
    """Return the time left of this process's timer and its interval [s]; zeros without one."""
    return _signal.getitimer(_signal.ITIMER_REAL) if hasattr(_signal, "getitimer") else (0.0, 0.0)


def set_timer(left: float, interval: float) -> None:
    """Set this process's timer; 0 stops it. Systems without one need none."""
    if hasattr(_signal, "setitimer"):
        _signal.setitimer(_signal.ITIMER_REAL, left, interval)


def signal_mask() -> set[int]:
    """Return the blocked signals of this thread."""
    return set(_signal.pthread_sigmask(_signal.SIG_BLOCK, ())) if hasattr(_signal, "pthread_sigmask") else set()


def set_signal_mask(mask: set[int]) -> None:
    """Block these signals in this thread and no others. Systems without masks block none."""
    if hasattr(_signal, "pthread_sigmask"):
        _signal.pthread_sigmask(_signal.SIG_SETMASK, mask)


@contextlib.contextmanager
def blocked(*numbers: int) -> Iterator[None]:
    """Block signals in this thread, which receives them later."""
    before = signal_mask()
    set_signal_mask(before | {*numbers})
    try:
        yield
    finally:
        set_signal_mask(before)


def is_closed(pipe: int) -> bool:
    """Return whether a file is a pipe whose reading end is closed; False on Windows, which has another error for it."""
    import select

    if not hasattr(select, "poll"):
        return False
    poll = select.poll()
    poll.register(pipe, 0)  # errors are always reported
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))
