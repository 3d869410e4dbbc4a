"""What differs between operating systems, in both of its forms."""

import errno
import os
import signal
import subprocess
import sys
import time
import types

import pytest

from antdrive.base import system
from antdrive.base.atomic import folder_lock
from antdrive.base.errors import InputError


def test_a_process_is_alive_until_it_ends():
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    alive = [system.is_alive(process.pid)]
    process.communicate(b"\n")
    assert [*alive, system.is_alive(process.pid), system.is_alive(2**40)] == [True, False, True]


@pytest.fixture
def windows(monkeypatch):
    """Windows' modules: locks of one byte, which are those of the process that asks, and errors with its numbers."""
    held = set()

    def locking(handle, mode, size):
        place = (os.fstat(handle).st_ino, os.lseek(handle, 0, os.SEEK_CUR), size)
        if mode and place in held:
            raise PermissionError(errno.EACCES, "Permission denied")
        held.add(place) if mode else held.remove(place)

    def open_process(_rights, _inherit, process):
        if process == 1:
            raise type("WindowsError", (PermissionError,), {"winerror": 5})
        if process == 2:
            raise type("WindowsError", (OSError,), {"winerror": 87})
        return process

    ended = types.SimpleNamespace(
        OpenProcess=open_process, CloseHandle=lambda _: None, WaitForSingleObject=lambda *_: 0
    )
    monkeypatch.setattr(system, "_fcntl", None)
    monkeypatch.setattr(system, "_msvcrt", types.SimpleNamespace(locking=locking, LK_NBLCK=1, LK_UNLCK=0))
    monkeypatch.setattr(system, "_winapi", ended)


def test_windows_tells_an_ended_process_from_another_users(windows):
    assert [system.is_alive(process) for process in (1, 2, 3)] == [True, False, False]


def test_windows_locks_bytes_and_folders(windows, tmp_path):
    with (tmp_path / "file").open("wb") as file:
        taken = [system.lock(file.fileno(), 7), system.lock(file.fileno(), 7), system.lock(file.fileno(), 8)]
        system.unlock(file.fileno(), 7)
        assert [*taken, system.lock(file.fileno(), 7)] == [True, False, True, True]
    with folder_lock(tmp_path), pytest.raises(InputError, match=f"another run .process {os.getpid()}. is writing"):
        folder_lock(tmp_path).__enter__()


def test_a_lock_goes_although_windows_removes_no_open_file(monkeypatch, tmp_path):
    refusals = [PermissionError()]
    unlink = type(tmp_path).unlink

    def refusing(path, missing_ok=False):
        if refusals:
            raise refusals.pop()
        unlink(path, missing_ok)

    monkeypatch.setattr(type(tmp_path), "unlink", refusing)
    with folder_lock(tmp_path):
        pass
    assert not [*tmp_path.iterdir()]


def test_an_alarm_without_timer_rings_until_it_is_stopped(monkeypatch):
    rung = []
    monkeypatch.delattr(signal, "setitimer")
    monkeypatch.setattr(system, "ALARM", signal.SIGUSR1)
    monkeypatch.setattr(system, "AGAIN", 0.01)
    before = signal.getsignal(signal.SIGUSR1)
    alarm = system.Alarm(0.01, lambda: rung.append(1))
    while len(rung) < 2:
        time.sleep(0.01)
    alarm.stop()
    assert signal.getsignal(signal.SIGUSR1) == before


def test_a_break_before_the_alarm_is_the_callers(monkeypatch):
    monkeypatch.delattr(signal, "setitimer")
    monkeypatch.setattr(system, "ALARM", signal.SIGUSR1)
    broken, rung = [], []
    before = signal.signal(signal.SIGUSR1, lambda *_: broken.append(1))
    alarm = system.Alarm(60.0, lambda: rung.append(1))
    signal.raise_signal(signal.SIGUSR1)
    alarm.stop()
    signal.signal(signal.SIGUSR1, before)
    assert (broken, rung) == ([1], [])
