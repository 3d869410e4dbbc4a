"""Compiling the kernels before the first drive of a run of tests, in one of its processes."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

LOCK = "antdrive-compiling.lock"


def compile_in_turn(say: Callable[[str], None]) -> None:
    """Compile every kernel if this installation has not done so yet; processes that come at the same time wait for one of them.

    Nothing is done where no cache can be kept: then each process compiles what it calls.
    """
    from antdrive.base.kernel_cache import cache_folder
    from antdrive.cli.warm import is_warm, warm

    folder = cache_folder()
    if folder is None or is_warm():
        return
    with _turn(folder):
        if not is_warm():
            say("compiling the planners, once for this installation; this takes a minute or two")
            warm()


@contextlib.contextmanager
def _turn(folder: Path) -> Iterator[None]:
    """A context that one process is in at a time; any number of them where the system or the folder has no locks."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            file = stack.enter_context((folder / LOCK).open("a"))
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
