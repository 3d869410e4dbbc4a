"""`antdrive export`."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from antdrive.base.errors import InputError
from antdrive.base.tables import file_lines
from antdrive.cli import options, parse
from antdrive.cli.console import show
from antdrive.cli.options import flag, option


def export(
    rollout: options.Log,
    out: Annotated[Path, option("PATH", "Output: .mcap file or new folder.")],
    to: Annotated[str, option("KIND", "Format: mcap, rosbag2 or csv.", "--to")] = "mcap",
    force: Annotated[bool, flag("Replace an existing .mcap file and layout.", "--force")] = False,
    scans: Annotated[bool, flag("Simulate scans that the log lacks.", "--scans/--no-scans")] = True,
    urdf: Annotated[
        Path | None,
        option("FILE", "The robot's .urdf or .xacro, for description, frames and joints.  [default: generated]"),
    ] = None,
    left: Annotated[str | None, option("NAME", "Joint or link of its left driven wheel.")] = None,
    right: Annotated[str | None, option("NAME", "Joint or link of its right driven wheel.")] = None,
    arguments: options.XacroArguments = None,
    packages: options.RosPackages = None,
    start_time: Annotated[int, option("SECONDS", "First stamp, in UNIX time [s].", min=0, max=2**31 - 1)] = 0,
    namespace: Annotated[str | None, option("NAME", "Prefix of topics and of all frames but map.")] = None,
    json: options.Json = False,
) -> None:
    """Export a drive to Foxglove, RViz or CSV.

    mcap and rosbag2 hold ROS 2 messages. They need antdrive[ros], but no ROS installation.
    """
    from antdrive.robots import RobotSpec
    from antdrive.sim.log.rollout import log_at
    from antdrive.views.export.exporting import EXPORTS
    from antdrive.views.export.exporting import export as write
    from antdrive.views.export.robot_frames import RobotFrames, frames_of_spec, frames_of_urdf

    if force and to in EXPORTS and to != "mcap":
        raise InputError(f"--force: applies to --to mcap only; {to} writes a new folder")
    details = {"left": left, "right": right, "arg": arguments, "package": packages}
    if urdf is None and (key := next((key for key, value in details.items() if value), None)):
        raise InputError(f"--{key}: needs --urdf FILE")
    of_bags = {"urdf": urdf, "start-time": start_time, "namespace": namespace}
    if to == "csv" and (key := next((key for key, value in of_bags.items() if value), None)):
        raise InputError(f"--{key}: tables hold no messages; use --to mcap or --to rosbag2")
    frames: Callable[[RobotSpec], RobotFrames] = frames_of_spec
    if urdf is not None:
        frames = functools.partial(
            frames_of_urdf, path=urdf, left=left, right=right, **parse.xacro(arguments, packages)
        )
    named: dict[str, Any] = {"namespace": "" if namespace is None else parse.namespace(namespace)}
    files = write(
        log_at(rollout), to, out, replace=force, scans=scans, frames=frames, start=start_time * 10**9, **named
    )
    written = {("layout" if file.name.endswith(".foxglove.json") else to): str(file) for file in files}
    show(json, {"files": written}, file_lines(written))
