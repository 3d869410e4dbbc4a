"""Command lines as on another platform: `python pretended_platform.py PLATFORM LINE...`; each ends with its exit code on stdout.

What that platform lacks is removed before antdrive is imported. Windows' own modules are replaced by the least that works.
"""

import ctypes
import os
import select
import shlex
import signal
import sys
import types
from importlib import import_module

# Their modules would take the other platform's way, which this one lacks.
FIRST = (
    "asyncio", "fcntl", "joblib.externals.loky.backend.context", "matplotlib.figure", "multiprocessing.connection", "numba",
    "packaging.requirements", "PIL.Image", "platform", "rich.progress", "subprocess", "tempfile", "typer.main",
    "urllib.request", "uuid",
)  # fmt: skip
LACKING = {
    "darwin": {signal: ("sigtimedwait",)},
    "win32": {
        signal: ("SIGHUP", "SIGALRM", "SIGKILL", "SIGPIPE", "SIGCHLD", "setitimer", "getitimer", "pthread_sigmask"),
        os: ("fork", "getuid", "geteuid", "O_NONBLOCK", "O_CLOEXEC"),
        select: ("poll",),
    },
}


def become(platform):
    fcntl = [import_module(name) for name in FIRST][1]
    if platform == "win32":
        _become_windows(fcntl, os.kill, ctypes.CDLL)
    for module, names in LACKING[platform].items():
        for name in names:
            delattr(module, name)
            if module is signal:
                sys.modules["_signal"].__dict__.pop(name, None)
    sys.platform = platform


def _become_windows(fcntl, kill, library):
    def locking(handle, mode, size):
        fcntl.lockf(handle, mode, size, os.lseek(handle, 0, os.SEEK_CUR))

    def kill_only(process, number):
        assert number not in (0, 1), "that is Ctrl-C for a group of processes"
        kill(process, number)

    def named_library(name, *words):
        if name is None:
            raise TypeError
        return library(name, *words)

    def open_process(_rights, _inherit, process):
        if not os.path.exists(f"/proc/{process}"):
            raise type("WindowsError", (OSError,), {"winerror": 87})
        return process

    modes = {"LK_NBLCK": fcntl.LOCK_EX | fcntl.LOCK_NB, "LK_UNLCK": fcntl.LOCK_UN}
    sys.modules["fcntl"] = None
    sys.modules["msvcrt"] = types.SimpleNamespace(locking=locking, **modes)
    sys.modules["_winapi"] = types.SimpleNamespace(
        OpenProcess=open_process, WaitForSingleObject=lambda *_: 0x102, CloseHandle=lambda _: None
    )
    signal.SIGBREAK = signal.SIGUSR1
    os.kill, ctypes.CDLL = kill_only, named_library


if __name__ == "__main__":
    become(sys.argv[1])
    from antdrive.cli.app import main

    for line in sys.argv[2:]:
        sys.argv = ["antdrive", *shlex.split(line)]
        try:
            main()
        except SystemExit as ended:
            print(f"exit code {ended.code}", flush=True)
