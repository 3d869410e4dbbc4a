"""State of the process after user code: each change that would disturb what follows is undone."""

import gc
import locale
import os
import signal
import sys
import warnings

import numpy as np
import pytest

from antdrive.base.guarded import UserCode


def state():
    streams = sys.stdin, sys.stdout, sys.stderr
    files = [(os.fstat(number).st_dev, os.fstat(number).st_ino) for number in range(3)]
    handlers = [signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)]
    numbers = os.umask(0), round(signal.getitimer(signal.ITIMER_REAL)[0], -2), sys.getrecursionlimit()
    os.umask(numbers[0])
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    settings = gc.isenabled(), locale.setlocale(locale.LC_ALL), np.geterr(), os.environ.get("HOME")
    filters = [one for one in warnings.filters if one[0] == "error"]
    return (*streams, files, handlers, numbers, mask, settings, filters, os.getcwd(), [*sys.path])


def _close_all():
    os.closerange(0, 3)


def _replace_streams():
    sys.stdin = sys.stdout = sys.stderr = None


CHANGES = {
    "closed streams": lambda: (sys.stdin.close(), sys.stdout.close(), sys.stderr.close()),
    "replaced streams": _replace_streams,
    "closed files": _close_all,
    "redirected files": lambda: os.dup2(os.open(os.devnull, os.O_WRONLY), 1),
    "folder": lambda: os.chdir("/"),
    "umask": lambda: os.umask(0o777),
    "recursion limit": lambda: sys.setrecursionlimit(200),
    "handlers": lambda: [signal.signal(one, signal.SIG_IGN) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)],
    "timer": lambda: signal.setitimer(signal.ITIMER_REAL, 60.0),
    "blocked signals": lambda: signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM}),
    "variables": lambda: (os.environ.clear(), os.environ.update(HOME="/nowhere")),
    "import path": lambda: sys.path.clear(),
    "warnings": lambda: warnings.simplefilter("error"),
    "floating point": lambda: np.seterr(all="raise"),
    "garbage": lambda: gc.disable(),
    "locale": lambda: locale.setlocale(locale.LC_ALL, "C"),
}


@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("raises", [False, True])
def test_a_change_of_user_code_ends_with_it(signals, name, raises, monkeypatch, capfd):
    before = state()

    def change():
        with UserCode("mine", lambda error: RuntimeError(f"{error}")):
            CHANGES[name]()
            assert not raises, "raised"

    if raises:
        with pytest.raises(RuntimeError, match="raised"):
            change()
    else:
        change()
    assert state() == before
    os.write(1, b"written")
    assert capfd.readouterr().out == "written"


def test_what_a_planner_needs_later_remains(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setenv("MINE", "")
    monkeypatch.delenv("MINE")
    before = sys.getrecursionlimit()
    try:
        with warnings.catch_warnings(), UserCode("mine", RuntimeError):
            sys.path.insert(0, str(tmp_path))
            os.environ["MINE"] = "1"
            sys.setrecursionlimit(before + 1)
        assert (sys.path[0], os.environ["MINE"], sys.getrecursionlimit()) == (str(tmp_path), "1", before + 1)
    finally:
        sys.setrecursionlimit(before)


def test_a_stream_needs_no_more_than_to_write(monkeypatch):
    class Tee:
        def write(self, text):
            return len(text)

        def flush(self):
            pass

    tee = Tee()
    monkeypatch.setattr(sys, "stdout", tee)
    with UserCode("mine", RuntimeError), sys.stdout as stream:
        stream.write("said")
    assert sys.stdout is tee


def test_a_closed_stream_is_opened_again(monkeypatch, tmp_path):
    """Where user code closes it by its buffer."""
    number = os.dup(1)
    try:
        with open(tmp_path / "out", "w+") as file:
            os.dup2(file.fileno(), 1)
            stream = os.fdopen(1, "w")
            monkeypatch.setattr(sys, "stdout", stream)
            monkeypatch.setattr(sys, "__stdout__", stream)
            with UserCode("mine", RuntimeError):
                sys.stdout.buffer.close()
            sys.stdout.write("again")
            sys.stdout.flush()
            assert sys.stdout is sys.__stdout__
        assert (tmp_path / "out").read_text() == "again"
    finally:
        os.dup2(number, 1)
        os.close(number)


def test_a_process_that_user_code_forks_ends_with_the_block():
    reading, writing = os.pipe()
    with UserCode("planner", RuntimeError):
        child = os.fork()
    if child == 0:  # never, or the child would run the rest of the tests
        os.write(writing, b"goes on")
        os._exit(1)
    assert os.waitpid(child, 0) == (child, 0)
    os.close(writing)
    assert os.read(reading, 10) == b""
    os.close(reading)
