"""`antdrive export`."""

from pathlib import Path
from typing import Annotated

from antdrive.base.errors import FieldError, InputError
from antdrive.cli import options
from antdrive.cli.console import file_lines, show
from antdrive.cli.options import flag, option
from antdrive.cli.parse import log_at


def export_drive(
    rollout: options.Log,
    out: Annotated[Path, option("PATH", "Output: .mcap file or new folder.")],
    to: Annotated[str, option("KIND", "Format: mcap, rosbag2 or csv.", "--to")] = "mcap",
    force: Annotated[bool, flag("Replace an existing .mcap file and layout.", "--force")] = False,
    scans: Annotated[
        bool,
        flag(
            "Simulate scans that the log lacks.",
            "--scans/--no-scans",
        ),
    ] = True,
    json: options.Json = False,
) -> None:
    """Export a drive to Foxglove, RViz or CSV.

    mcap and rosbag2 hold ROS 2 messages. They need antdrive[ros], but no ROS installation.
    """
    from antdrive.views.export.exporting import EXPORTS, export

    if force and to in EXPORTS and to != "mcap":
        raise InputError(f"--force: applies to --to mcap only; {to} writes a new folder")
    try:
        files = export(log_at(rollout), to, out, replace=force, scans=scans)
    except FieldError as error:
        raise InputError(f"--{error.key}: {error.problem}") from None
    written = {("layout" if file.name.endswith(".foxglove.json") else to): str(file) for file in files}
    show(json, {"files": written}, file_lines(written))
