"""Folders of the runs of minimal reproducers, beside their suite."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path

from antdrive.runs.failures.reproducers import SUITE, Reproducer
from antdrive.views.run_folder import RUN_FILES, write_run


def write_failures(reported: Iterable[Reproducer], folder: Path, formats: Sequence[str] | None = ()) -> None:
    """Write the run of each reproducer into a folder of its name, in place of those of an earlier search.

    Args:
        reported: the reproducers
        folder: of their suite
        formats: as in `write_run`
    """
    for place in folder.glob("failure-*/"):
        for name in RUN_FILES:
            (place / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # it holds other files
            place.rmdir()
    for one in reported:
        small = one.small.run
        if small is None:  # planning raised an error; the suite has the world
            continue
        command = shlex.join(["antdrive", "check", f"{folder / SUITE}::{one.name}"])
        write_run(small, folder / one.name, command, formats, view=True)
