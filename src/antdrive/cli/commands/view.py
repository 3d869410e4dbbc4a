"""`antdrive view`."""

import contextlib
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from antdrive.base.errors import InputError
from antdrive.base.tables import file_lines
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.options import argument, flag, option

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout


def view(
    drives: Annotated[
        list[Path], argument("DRIVE", "Logs, pages or folders of runs; two to four drive on one clock as ghosts.")
    ],
    out: Annotated[Path | None, option("FILE", "Page.  [default: drive.html beside the first log]")] = None,
    label: Annotated[
        list[str] | None, option("NAME", "Name of a drive, in their order. Repeatable.  [default: planner or folder]")
    ] = None,
    no_open: Annotated[bool, flag("Do not open the page in a browser.", "--no-open")] = False,
    json: options.Json = False,
) -> None:
    """Write a drive's page, drive.html, and open it on a screen.

    The page holds the log and the replay: `antdrive verify drive.html` certifies it. A page beside the log that shows this
    drive is kept.
    """
    from antdrive.sim.facts import LoggedRun
    from antdrive.sim.log.rollout import Rollout, log_at
    from antdrive.views.viewer.drive_page import write_page

    if label and len(label) != len(drives):
        raise InputError(f"--label: {len(label)} names for {len(drives)} drives; give one for each")
    logs = [log_at(path) for path in drives]
    beside = logs[0].with_name("drive.html" if len(logs) == 1 else "drives.html")
    loaded = [LoggedRun.of(Rollout.load(log)) for log in logs]
    if label is None and len({drive.record.planner.name for drive in loaded}) < len(loaded) > 1:
        label = [log.parent.name if log.name == "rollout.npz" else log.stem for log in logs]
    kept = out is None and label is None and len(logs) == 1 and _shows(beside, loaded[0].rollout)
    path = beside if kept else write_page(loaded, out or beside, label)
    if not no_open and not json and _has_screen():
        import webbrowser

        webbrowser.open(path.resolve().as_uri())
    show(json, {"file": str(path), "bytes": path.stat().st_size}, file_lines({"page": str(path)}))


def _shows(page: Path, rollout: "Rollout") -> bool:
    """Return whether a page exists that shows a drive first: then it may show more, such as pheromone or a baseline."""
    from antdrive.sim.log.rollout import stated_by

    with contextlib.suppress(InputError, ValueError):
        return page.exists() and stated_by(f"{page}#1").get("digest") == rollout.digest
    return False


def _has_screen() -> bool:
    """Return whether a person at a terminal with a screen would see a browser."""
    if not sys.stdout.isatty() or "CI" in os.environ:
        return False
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
