"""Poses of robots as other programs recorded them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from antdrive.base.bags import SUFFIXES
from antdrive.base.errors import input_error
from antdrive.base.plane import polyline_length, wrap_angle
from antdrive.base.types import Flags, Floats
from antdrive.foreign.bags import read_bag
from antdrive.foreign.frames import Edge, frames_of, poses_of
from antdrive.foreign.health import SAME, Fault, corrections, faults_of_motion, gaps, sentences, steady, valid
from antdrive.foreign.tables import read_table


@dataclass(frozen=True, eq=False)
class ForeignLog:
    """Poses of a robot as another program recorded them.

    Attributes:
        t: times since the first row (T,), strictly increasing [s]
        pose: x, y and yaw in the map's frame (T, 3) [m, m, rad]
        start: stamp of the first row [s]
        findings: what is wrong or unusual, a sentence each
        unknown: the steps of which nothing can be said (T - 1,)
        source: what was used: file, poses, map_frame, robot_frame
    """

    t: Floats
    pose: Floats
    start: float
    findings: tuple[str, ...]
    unknown: Flags
    source: Mapping[str, str]


def read_log(
    path: str | Path,
    *,
    pose: str | None = None,
    map_frame: str | None = None,
    robot_frame: str | None = None,
    max_speed: float = math.inf,
) -> ForeignLog:
    """Read a robot's poses from a ROS bag, a TUM file or a CSV table.

    Args:
        path: a rosbag2 folder, or a .mcap, .db3 or .bag file; any other file is a table of text
        pose: a bag's topic of poses or transforms; by default its transforms, else its only topic of poses
        map_frame: the frame of the poses; by default map, else the highest frame
        robot_frame: the robot's frame, or its name in a table of several; by default base_footprint or base_link
        max_speed: the robot's top speed, above which steps are corrections [m/s]

    Raises:
        InputError: the file is invalid, or has no poses, or several of which none is named.
    """
    path = Path(path)
    bag = is_bag(path)
    if pose and not bag:
        raise input_error(str(path), f"--pose {pose}: only bags have topics; the columns of a table have names")
    recording = read_bag(path, pose, map_frame, robot_frame) if bag else read_table(path, robot_frame)
    found: list[Fault] = []
    moving: list[tuple[str, Edge, Flags]] = []
    for k, (name, edge, up) in enumerate(recording.edges):
        if edge.moves:
            edge, lost, faults = steady(edge, f"{name}: " if bag else "")
            recording.edges[k] = name, edge, up
            moving.append((name, edge, lost))
            found += faults
        elif not (valid(edge.rows).all() and np.ptp(frames_of(edge.rows), axis=0).max() <= SAME):
            raise input_error(str(path), f"the static transform {name} changes or is none")
    if min(len(edge.stamps) for _, edge, _ in moving) < 2:
        raise input_error(str(path), f"fewer than two valid poses in {recording.source['poses']}")
    rows = max(reversed(moving), key=lambda one: _travel(one[1]))[1]  # the others correct it
    times = rows.stamps
    for name, edge, _ in moving:
        times = times[(edge.stamps[0] <= times) & (times <= edge.stamps[-1])]  # no extrapolation
        if edge is not rows:
            found += [*gaps(edge.stamps, f"{name}: "), *corrections(edge, f"{name}: ")]
    if len(times) < 2:
        raise input_error(str(path), f"the transforms of {recording.source['poses']} share fewer than two stamps")
    start = int(times[0])
    if outside := len(rows.stamps) - len(times):
        found.append(("rows left out", start, f"{outside} before or after the transforms of other frames"))
    frames, unknown = np.eye(4), np.zeros(len(times) - 1, dtype=bool)
    for _, edge, up in recording.edges:
        step = edge.at(times)
        frames = frames @ (np.linalg.inv(step) if up else step)
    for _, edge, lost in moving:
        ended = np.append(0, np.cumsum(np.diff(edge.stamps) * lost))  # time of which nothing can be said
        unknown |= np.diff(np.interp(times - start, edge.stamps - start, ended)) > 0
    found += [*gaps(times), *faults_of_motion(times, frames, max_speed)]
    findings = (*recording.notes, *sentences(found, start))
    source = {"file": str(path), **recording.source}
    return ForeignLog((times - start) / 1e9, poses_of(frames), start / 1e9, findings, unknown, source)


def is_bag(path: Path) -> bool:
    """Return whether a path names a bag, not a table of text."""
    return path.is_dir() or path.suffix.lower() in SUFFIXES


def _travel(edge: Edge) -> float:
    """Return how far a frame moves and turns in its parent [m and rad]."""
    pose = poses_of(frames_of(edge.rows))
    return polyline_length(pose[:, :2]) + float(np.abs(wrap_angle(np.diff(pose[:, 2]))).sum())
