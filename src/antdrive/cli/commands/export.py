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
    out: Annotated[Path, option("PATH", "The .mcap file, or a new folder for rosbag2 and csv.")],
    to: Annotated[str, option("KIND", "mcap, rosbag2 or csv.", "--to")] = "mcap",
    force: Annotated[bool, flag("Replace an .mcap file and a layout that exist.", "--force")] = False,
    scans: Annotated[
        bool,
        flag(
            "Whether a bag has what the robot's lidar would have measured, where the log holds no scans.",
            "--scans/--no-scans",
        ),
    ] = True,
    json: options.Json = False,
) -> None:
    """Export a drive for Foxglove, RViz and spreadsheets.

    mcap and rosbag2 hold ROS 2 messages, without ROS; they need antdrive[ros].
    """
    from antdrive.views.export.exporting import EXPORTS, export

    if force and to in EXPORTS and to != "mcap":
        raise InputError(f"--force: is for --to mcap; {to} makes a new folder and replaces none")
    try:
        files = export(log_at(rollout), to, out, replace=force, scans=scans)
    except FieldError as error:
        raise InputError(f"--{error.key}: {error.problem}") from None
    written = {("layout" if file.name.endswith(".foxglove.json") else to): str(file) for file in files}
    show(json, {"files": written}, file_lines(written))
