"""Export of logs to ROS 2 bags with a Foxglove layout, or to CSV tables."""

from __future__ import annotations

import csv
import dataclasses
import json
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from antdrive.base.atomic import atomic_folder, atomic_write
from antdrive.base.errors import FieldError, input_error
from antdrive.base.files import MAX_BYTES, read_bytes, require_new
from antdrive.base.plane import world_to_map
from antdrive.robots.spec import RobotSpec
from antdrive.sim.driving.odometry import odometry_of
from antdrive.sim.log.certificate import certify
from antdrive.sim.log.rollout import Rollout
from antdrive.views.export.robot_frames import RobotFrames, frames_of_spec
from antdrive.views.export.samples import DriveScans, samples
from antdrive.views.export.scenery import routes_of, scenery
from antdrive.views.export.topics import START, Topic, metadata, write_mcap
from antdrive.worlds.files.world_file import save_task

FOREIGN = ("/tf_static", "/tf", "/clearance", "/map", "/obstacles", "/movers", "/robot_description")  # of foreign logs
LAYOUT = ".foxglove.json"
SCENE = "3D!drive"
MARGIN = 1.1  # shown extent relative to the world's
ASPECT = 0.75  # minimum width over height of the scene's panel: a window of 1400 x 900 with an open side bar


def export(
    log: str | Path,
    to: str,
    path: str | Path,
    *,
    replace: bool = False,
    scans: bool = True,
    frames: Callable[[RobotSpec], RobotFrames] = frames_of_spec,
    start: int = 0,
    namespace: str = "",
) -> list[Path]:
    """Export a log atomically and return the written files or the folder.

    `start` is the stamp of the first message [ns], `namespace` the prefix of topics and frames, such as /robot1.
    """
    if to not in EXPORTS:
        raise FieldError("to", f"unknown {to!r}; choose from {', '.join(EXPORTS)}")
    source, target = Path(log), Path(path)
    if target.suffix != ".mcap" and to == "mcap":
        raise input_error(str(target), "wrong suffix; name a file that ends in .mcap")
    if target.suffix in (".mcap", ".csv") and to != "mcap":
        kind = "; for one .mcap file use --to mcap" if target.suffix == ".mcap" else ""
        raise input_error(str(target), f"name a folder: {to} writes several files{kind}")
    require_new((target, target.with_suffix(LAYOUT)), replace=replace or to != "mcap")
    rollout = Rollout.load(source)
    token = START.set(start)
    try:
        return EXPORTS[to](rollout, source, target, scans, frames(rollout.record.robot).under(namespace))
    finally:
        START.reset(token)


def topics_of(rollout: Rollout, scans: DriveScans, body: RobotFrames) -> list[Topic]:
    """Return all topics of a drive. Static transforms come first, on /tf_static and on /tf."""
    static, few = scenery(rollout, body)
    many = samples(rollout, scans, body)
    moving = many[0]
    stamps = np.concatenate([static.stamps, moving.stamps])
    tf = Topic(moving.name, moving.kind, stamps, [*static.payloads, *moving.payloads])
    topics = [static, tf, *many[1:], *few]
    if rollout.measured is not None:
        topics = [one for one in topics if one.name in FOREIGN]
    return [dataclasses.replace(one, name=body.namespace + one.name) for one in topics]


def export_foreign(rollout: Rollout, path: Path) -> dict[str, str]:
    """Export a foreign log with obstacles, clearance and certificate to an MCAP file, and return the files by kind."""
    if path.suffix != ".mcap":
        raise input_error(str(path), "wrong suffix; name a file that ends in .mcap")
    require_new((path, path.with_suffix(LAYOUT)), replace=False)
    files = _to_mcap(rollout, None, path, False, frames_of_spec(rollout.record.robot))
    return dict(zip(("mcap", "layout"), map(str, files), strict=True))


def attachments_of(rollout: Rollout, log: Path | None) -> dict[str, tuple[str, bytes]]:
    """Return a bag's attachments: media type and content by name; of a foreign log, which has no task, only its certificate."""
    certificate = json.dumps(certify(rollout).as_dict(), indent=2, default=str)
    proof = {"certificate.json": ("application/json", certificate.encode())}
    if log is None:
        return proof
    with tempfile.TemporaryDirectory() as folder:
        save_task(rollout.record.task, Path(folder) / "world.yaml")
        world = read_bytes(Path(folder) / "world.yaml", MAX_BYTES)
    return {
        "world.yaml": ("application/yaml", world),
        **proof,
        "digest.txt": ("text/plain", f"{rollout.record.digest}\n".encode()),
        "rollout.npz": ("application/octet-stream", read_bytes(log, MAX_BYTES)),
    }


def _to_mcap(rollout: Rollout, log: Path | None, target: Path, again: bool, body: RobotFrames) -> list[Path]:
    layout = target.with_suffix(LAYOUT)
    with atomic_write(layout) as beside, atomic_write(target) as part:  # both files or neither
        _write_bag(rollout, log, part, beside, again, body)
    return [target, layout]


def _to_rosbag2(rollout: Rollout, log: Path, target: Path, again: bool, body: RobotFrames) -> list[Path]:
    with atomic_folder(target) as folder:
        bag, beside = f"{target.name}.mcap", folder / f"{target.name}{LAYOUT}"
        topics, notes = _write_bag(rollout, log, folder / bag, beside, again, body)
        (folder / "metadata.yaml").write_text(metadata(bag, topics, notes), encoding="utf-8")
    return [target]


def _write_bag(
    rollout: Rollout, log: Path | None, bag: Path, layout: Path, again: bool, body: RobotFrames
) -> tuple[list[Topic], dict[str, str]]:
    """Write a bag and its layout and return its topics and notes."""
    scans = DriveScans.of(rollout, again=again)
    topics, notes = topics_of(rollout, scans, body), {"scans": scans.source}
    write_mcap(bag, topics, attachments_of(rollout, log), notes)
    shown = json.dumps(foxglove_layout(rollout), indent=2).replace('"/', f'"{body.namespace}/')
    layout.write_text(shown + "\n", encoding="utf-8")
    return topics, notes


def _to_csv(rollout: Rollout, log: Path, target: Path, again: bool, body: RobotFrames) -> list[Path]:
    with atomic_folder(target) as folder:
        write_tables(rollout, folder)
    return [target]


def foxglove_layout(rollout: Rollout) -> dict[str, Any]:
    """Return a layout for Foxglove and Lichtblick: the scene in top view, with plots beside it.

    Topics have explicit settings where the defaults fail: scans without intensities would have no colour.
    """
    layout: dict[str, Any] = json.loads(Path(__file__).with_name("layout.json").read_text(encoding="utf-8"))
    x0, y0, x1, y1 = rollout.record.world.bounds
    corners = world_to_map(rollout.record.task.frame, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    wide, tall = (high - low).tolist()
    camera = layout["configById"][SCENE]["cameraState"]
    camera["distance"] = MARGIN * max(wide / ASPECT, tall)  # shown height [m]
    camera["targetOffset"] = [*((low + high) / 2).tolist(), 0]
    return layout


def write_tables(rollout: Rollout, folder: Path) -> None:
    """Write drive.csv with a line per row of the log, plan.csv with the routes, and contacts.csv."""
    _write_table(folder / "drive.csv", *_drive(rollout))
    plan = ((number, at, x, y) for number, (at, points) in enumerate(routes_of(rollout)) for x, y in points.tolist())
    _write_table(folder / "plan.csv", ("route", "from_s", "x_m", "y_m"), plan)
    contacts = ((rollout.t[int(row)], int(thing), *rest) for row, thing, *rest in rollout.contacts.tolist())
    _write_table(folder / "contacts.csv", ("t_s", "obstacle", "distance_m", "force_N"), contacts)


def _drive(rollout: Rollout) -> tuple[list[str], Iterable[Sequence[Any]]]:
    frame = rollout.record.task.frame
    heads = ["t_s", "x_m", "y_m", "yaw_rad", "speed_m_s", "yaw_rate_rad_s"]
    heads += ["command_speed_m_s", "command_yaw_rate_rad_s", "clearance_m", "limiter"]
    columns = [rollout.t, *world_to_map(frame, rollout.pose).T, *rollout.twist.T, *rollout.command.T, rollout.clearance]
    columns.append(np.array(rollout.record.limiters, dtype=object)[rollout.limiter])
    measured = odometry_of(rollout)  # in the frame odom, as /odom
    heads += ["odom_x_m", "odom_y_m", "odom_yaw_rad", "odom_speed_m_s", "odom_yaw_rate_rad_s"]
    columns += [*measured.pose.T, *measured.twist.T]
    if len(rollout.estimate):
        heads += ["estimate_x_m", "estimate_y_m", "estimate_yaw_rad"]
        columns += [*world_to_map(frame, rollout.estimate).T]
    if len(rollout.actuated):
        heads += ["actuated_speed_m_s", "actuated_yaw_rate_rad_s"]
        columns += [*rollout.actuated.T]
    for i in range(rollout.movers.shape[1]):
        heads += [f"mover_{i}_x_m", f"mover_{i}_y_m"]
        columns += [*world_to_map(frame, rollout.movers[:, i]).T]
    return heads, zip(*(column.tolist() for column in columns), strict=True)


def _write_table(path: Path, heads: Sequence[str], lines: Iterable[Sequence[Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        writer.writerows(lines)


#: Exporters by format.
EXPORTS: Mapping[str, Callable[[Rollout, Path, Path, bool, RobotFrames], list[Path]]] = MappingProxyType(
    {"mcap": _to_mcap, "rosbag2": _to_rosbag2, "csv": _to_csv}
)
