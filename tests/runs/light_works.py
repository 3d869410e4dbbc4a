"""What workers do in tests without an import that takes time."""

import os
import signal
import threading
from pathlib import Path

from antdrive.base import kernel_cache
from antdrive.base.errors import InputError


def process(item):
    """The process that an item is in."""
    return os.getpid()


def fails(item):
    """Raise something that cannot be sent to another process for the item 3."""
    if item == 3:
        raise type("Mine", (Exception,), {"lock": threading.Lock()})("oh")
    return item


def compiling(number):
    """Report a kernel as compiled."""
    kernel_cache.on_compile(f"kernel {number}")
    return number


def dies_once(mark, item):
    """Kill its process for the item 2, unless a file says that it has done so."""
    if item == 2 and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def refuses(item):
    """Find for the item 3 that nothing can be written."""
    if item == 3:
        raise InputError("rollouts/ab.npz: cannot be written (No space left on device)")
    return item


class Unloadable:
    """Work that ends the process that unpickles it."""

    def __reduce__(self):
        return os._exit, (7,)

    def __call__(self, job):
        raise AssertionError
