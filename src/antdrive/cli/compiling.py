"""Compiling the kernels, once for an installation, where people can see it."""

from __future__ import annotations

import sys

from antdrive.cli.console import bar, print_error


def compile_once() -> None:
    """Compile every kernel if this installation has not done so yet: with a bar on a terminal, else with a line.

    Nothing is done where no cache can be kept. Each kernel is then compiled when it is first called, which for a
    single command is quicker than compiling all of them.
    """
    from antdrive.base.kernel_cache import cache_folder
    from antdrive.cli.warm import is_warm, warm

    if is_warm() or cache_folder() is None:
        return
    if not sys.stderr.isatty():
        print_error("compiling the planners, once for this installation; this takes a minute or two")
    with bar("compiling the planners, once") as progress:
        warm(progress=progress)
