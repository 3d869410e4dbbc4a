"""Compiling the kernels, once for an installation, where people can see it."""

from __future__ import annotations

import sys

from antdrive.sim.cli.console import bar


def compile_once() -> None:
    """Compile every kernel with a progress bar if this installation has not done so yet.

    Nothing is done where stderr is no terminal, because nobody would see the bar, and where no cache can be kept. Each
    kernel is then compiled when it is first called, which for a single command is quicker than compiling all of them.
    """
    if not sys.stderr.isatty():
        return
    from antdrive.sim.warm import is_warm, warm
    from antdrive.worlds.kernel_cache import cache_folder

    if is_warm() or cache_folder() is None:
        return
    with bar("compiling the planners, once") as progress:
        warm(progress=progress)
