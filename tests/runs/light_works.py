"""What workers do in tests without an import that takes time."""

import os
import threading

from antdrive.base import kernel_cache


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
