"""Supervision of a process that runs user code: its end, and the limit on planning time.

At the first user code the process forks. The child continues; the parent waits for it. The parent kills a child whose user
code exceeds its limit although the alarm of `guarded` has fired, as in compiled code, and reports a child that ends early.
Elsewhere than on Linux a thread takes its place. It ends the process at the limit unless compiled code holds Python's lock,
and cannot report user code that ends the process.
"""

from __future__ import annotations

import mmap
import os
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable
from typing import NoReturn

from antdrive.base import progress, system

GRACE = 2.0  # time after the limit for the alarm to end the code [s]
POLL_INTERVAL = 0.2  # of the parent [s]
HEAD = struct.Struct(
    "dd?"
)  # start of the code and its limit [s], both 0 outside user code; whether the process ends as it should
LONGEST_NAME = 200  # bytes
KILLED_WITH_PARENT = 1  # PR_SET_PDEATHSIG
FORWARDED = system.signals("SIGINT", "SIGTERM", "SIGHUP")

_armed: Callable[[str], NoReturn] | None = None
_watch: threading.Timer | None = None  # in place of a supervisor
_page: mmap.mmap | None = None  # shared with the supervisor


def arm(report: Callable[[str], NoReturn]) -> None:
    """Supervise the user code of this process: fork at the first.

    Args:
        report: ends the supervisor after its child has died in user code, or this process; receives a sentence
    """
    global _armed
    _armed = report


def begin(who: str, limit: float | None) -> None:
    """Note that user code begins."""
    global _armed, _watch
    if _armed is not None and system.FORKS:
        report, _armed = _armed, None
        _fork(report)
    elif _armed is not None and limit is not None:
        _watch = threading.Timer(limit + GRACE, _armed, (f"{who} {_slow(limit)}",))
        _watch.daemon = True
        _watch.start()
    if _page is not None:
        name = who.encode(errors="replace")[:LONGEST_NAME]
        _page[HEAD.size : HEAD.size + len(name) + 1] = name + b"\0"
        HEAD.pack_into(_page, 0, time.monotonic(), limit or 0.0, False)


def end() -> None:
    """Note that user code has ended."""
    if _watch is not None:
        _watch.cancel()
    if _page is not None:
        HEAD.pack_into(_page, 0, 0.0, 0.0, False)


def finish() -> None:
    """Note that this process ends as it should."""
    if _page is not None:
        HEAD.pack_into(_page, 0, 0.0, 0.0, True)


def _slow(limit: float) -> str:
    return f"took longer than the limit of {limit:g} s"


def _fork(report: Callable[[str], NoReturn]) -> None:
    """Continue in a child process; this one supervises it and does not return."""
    global _page
    import ctypes  # slow to import, and before the fork

    page = mmap.mmap(-1, mmap.PAGESIZE)
    progress.hide_bars()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    parent = os.getpid()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {*FORWARDED, signal.SIGCHLD})
    child = os.fork()
    if child:
        _supervise(child, page, report)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    ctypes.CDLL(None).prctl(KILLED_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
    _page = page
    progress.show_bars()


def _supervise(child: int, page: mmap.mmap, report: Callable[[str], NoReturn]) -> NoReturn:
    """Wait for the child, forward signals, enforce the limit; exit as the child does."""
    slow = ""
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        started, limit, ended = HEAD.unpack_from(page)
        if done:
            break
        if limit and time.monotonic() - started > limit + GRACE:
            slow = _slow(limit)
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            break
        received = signal.sigtimedwait((*FORWARDED, signal.SIGCHLD), POLL_INTERVAL)
        # A terminal sends Ctrl-C to both processes; what `kill` sends has a code of at most 0.
        if received is not None and received.si_signo in FORWARDED and received.si_code <= 0:
            os.kill(child, received.si_signo)
    code = os.waitstatus_to_exitcode(status)
    who = bytes(page[HEAD.size : HEAD.size + LONGEST_NAME]).partition(b"\0")[0].decode(errors="replace")
    if slow:
        report(f"{who} {slow}")
    if started or (code >= 0 and not ended):
        how = f"with exit code {code}" if code >= 0 else f"by {signal.Signals(-code).name}"
        report(f"{who} ended the process {how}")
    if code < 0:
        signal.signal(-code, signal.SIG_DFL) if -code not in (signal.SIGKILL, signal.SIGSTOP) else None
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {-code})
        os.kill(os.getpid(), -code)
    os._exit(code)
