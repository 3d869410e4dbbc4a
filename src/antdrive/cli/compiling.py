"""Compile the kernels, once for an installation, where people can see it."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from antdrive.cli.console import bar, print_error

LOCK = "antdrive-compiling.lock"
NOTE = "compiling the planners, once for this installation; this takes a minute or two"


def compile_once(say: Callable[[str], None] | None = None) -> None:
    """Compile every kernel if this installation has not done so yet; processes that come at the same time wait for one of them.

    A bar shows it on a terminal, a line elsewhere; `say` prints the line in any case. Nothing is done where no cache can be
    kept. Each kernel is then compiled when it is first called, which for a single command is quicker than compiling all.
    """
    from antdrive.base.kernel_cache import cache_folder
    from antdrive.cli.warm import is_warm, warm

    folder = cache_folder()
    if is_warm() or folder is None:
        return
    with _turn(folder):
        if is_warm():
            return
        if say is not None:
            say(NOTE)
            warm()
            return
        if not sys.stderr.isatty():
            print_error(NOTE)
        with bar("compiling the planners, once") as progress:
            warm(progress=progress)


@contextlib.contextmanager
def _turn(folder: Path) -> Iterator[None]:
    """A context that one process is in at a time; any number of them where the system or the folder has no locks."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            file = stack.enter_context((folder / LOCK).open("a"))
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
