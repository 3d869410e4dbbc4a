"""`antdrive warm`."""

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import bar, print_line


def warm(jobs: options.Jobs = None) -> None:
    """Compile all planners ahead of time.

    Optional: otherwise each command compiles what it runs often, at its first use.
    """
    from antdrive.base.kernel_cache import cache_folder
    from antdrive.cli.compiling import is_warm
    from antdrive.cli.compiling import warm as compile_all

    if cache_folder() is None:
        raise InputError("warm: no writable cache folder; name one in NUMBA_CACHE_DIR")
    done = is_warm()
    if not done:
        with bar("compiling the planners") as progress:
            compile_all(jobs, progress=progress)
    print_line(f"all planners are {'already ' if done else ''}compiled")
