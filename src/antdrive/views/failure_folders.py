"""Folders of the runs of minimal reproducers, beside their suite."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from antdrive.runs.failures.reproducers import SUITE, Reproducer
from antdrive.sim.log.rollout import Rollout
from antdrive.views.run_folder import RUN_FILES, write_result, write_run


def write_failures(
    reported: Iterable[Reproducer],
    folder: Path,
    film: Callable[[Sequence[Rollout], Path], dict[str, Any]] | None,
) -> None:
    """Write the run of each reproducer into a folder of its name, in place of those of an earlier search.

    Args:
        reported: the reproducers
        folder: of their suite
        film: films a drive, as `write_film` does; None: no films and no figures
    """
    for place in folder.glob("failure-*/"):
        for name in (*RUN_FILES, "film.mp4"):
            (place / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # it holds other files
            place.rmdir()
    for one in reported:
        small = one.small.run
        if small is None:  # planning raised an error; the suite has the world
            continue
        command = shlex.join(["antdrive", "check", f"{folder / SUITE}::{one.name}"])
        report = write_run(small, folder / one.name, command, figures=film is not None)
        if film is not None and small.rollout is not None:
            filmed = film([small.rollout], folder / one.name / "film.mp4")["file"]
            write_result(small, {**report["files"], "film": filmed}, command)
