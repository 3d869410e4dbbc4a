"""`antdrive warm`."""

from typing import Annotated

import typer

from antdrive.base.errors import InputError
from antdrive.cli.console import bar, print_line
from antdrive.cli.exits import SUCCEEDED


def warm(
    jobs: Annotated[
        int | None, typer.Option(min=1, max=256, metavar="NUMBER", help="Number of processes.  [default: one a core]")
    ] = None,
) -> int:
    """Compile every planner into the cache.

    Needed once for an installation; otherwise the first command that plans or drives does it.
    """
    from antdrive.base.kernel_cache import cache_folder
    from antdrive.cli.warm import is_warm
    from antdrive.cli.warm import warm as compile_all

    if cache_folder() is None:
        raise InputError("warm: no folder for compiled code can be written; name one in NUMBA_CACHE_DIR")
    if is_warm():
        print_line("every planner is compiled already")
        return SUCCEEDED
    with bar("compiling the planners") as progress:
        compile_all(-1 if jobs is None else jobs, progress=progress)
    print_line("every planner is compiled")
    return SUCCEEDED
