"""`antdrive export`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.base.errors import FieldError, InputError
from antdrive.cli import options
from antdrive.cli.console import print_files, print_json
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.parse import log_at


def export_drive(
    rollout: Annotated[Path, typer.Argument(metavar="ROLLOUT", help="Log of a drive, or the folder of a run.")],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="PATH", help="The .mcap file, or a new folder for rosbag2 and csv."),
    ],
    to: Annotated[str, typer.Option("--to", metavar="KIND", help="mcap, rosbag2 or csv.")] = "mcap",
    force: Annotated[bool, typer.Option("--force", help="Replace an .mcap file and a layout that exist.")] = False,
    scans: Annotated[
        bool,
        typer.Option(
            "--scans/--no-scans",
            help="Whether a bag has what the robot's lidar would have measured, where the log holds no scans.",
        ),
    ] = True,
    json: options.Json = False,
) -> int:
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
    if json:
        print_json({"files": written})
    else:
        print_files(written)
    return SUCCEEDED
