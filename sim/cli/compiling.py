"""Compiling the kernels, once for an installation, where people can see it."""

from __future__ import annotations

import sys

from antdrive.sim.cli.console import bar


def compile_once() -> None:
    """Compile every kernel with a progress bar if this installation has not done so yet.

    Where stderr is no terminal nobody would see the bar, so nothing is done: each kernel is then compiled when it is
    first called, which is quicker for a single command than compiling all of them.
    """
    if not sys.stderr.isatty():
        return
    from antdrive.sim.warm import is_warm, warm

    if is_warm():
        return
    with bar("compiling the planners, once") as progress:
        warm(progress=progress)
