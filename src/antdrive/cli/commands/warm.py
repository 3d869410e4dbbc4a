"""`antdrive warm`."""

from antdrive.base.progress import bar
from antdrive.cli import options
from antdrive.cli.console import print_line


def warm(jobs: options.Jobs = None) -> None:
    """Compile all planners ahead of time.

    Optional: otherwise each command compiles what it runs often, at its first use.
    """
    from antdrive.cli.warming import is_warm
    from antdrive.cli.warming import warm as compile_all

    done = is_warm()
    if not done:
        with bar("compiling the planners") as progress:
            compile_all(jobs, progress=progress)
    print_line(f"all planners are {'already ' if done else ''}compiled")
