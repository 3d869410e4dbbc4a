"""A drive as tables of comma-separated values, with the units in the heads. Numbers are exact."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.base.plane import in_map
from antdrive.sim.log.rollout import Rollout
from antdrive.views.export.frames import IDENTITY


def write_tables(rollout: Rollout, folder: Path) -> None:
    """Write drive.csv with a line for each row of the log, plan.csv with the routes, and contacts.csv."""
    _write(folder / "drive.csv", *_drive(rollout))
    _write(folder / "plan.csv", ("route", "from_s", "x_m", "y_m"), _plan(rollout))
    contacts = ((rollout.t[int(row)], int(thing), *rest) for row, thing, *rest in rollout.contacts.tolist())
    _write(folder / "contacts.csv", ("t_s", "obstacle", "distance_m", "force_N"), contacts)


def _drive(rollout: Rollout) -> tuple[list[str], Iterable[Sequence[Any]]]:
    frame = rollout.record.task.frame
    heads = [
        "t_s",
        "x_m",
        "y_m",
        "yaw_rad",
        "speed_m_s",
        "yaw_rate_rad_s",
        "command_speed_m_s",
        "command_yaw_rate_rad_s",
    ]
    heads += ["clearance_m", "limiter"]
    columns = [rollout.t, *in_map(frame, rollout.pose).T, *rollout.twist.T, *rollout.command.T, rollout.clearance]
    columns.append(np.array(rollout.record.limiters, dtype=object)[rollout.limiter])
    if len(rollout.estimate):
        heads += ["estimate_x_m", "estimate_y_m", "estimate_yaw_rad"]
        columns += [*in_map(frame, rollout.estimate).T]
    if len(rollout.actuated):
        heads += ["actuated_speed_m_s", "actuated_yaw_rate_rad_s"]
        columns += [*rollout.actuated.T]
    for i in range(rollout.movers.shape[1]):
        heads += [f"mover_{i}_x_m", f"mover_{i}_y_m"]
        columns += [*in_map(frame, rollout.movers[:, i]).T]
    return heads, zip(*(column.tolist() for column in columns), strict=True)


def _plan(rollout: Rollout) -> Iterable[Sequence[Any]]:
    lies = IDENTITY if rollout.record.exploring else rollout.record.task.frame  # without a map: in the robot's own
    for number, (rows, route) in enumerate(rollout.legs()):
        begin = float(rollout.t[min(rows.start or 0, len(rollout.t) - 1)])
        for x, y in in_map(lies, route).tolist():
            yield number, begin, x, y


def _write(path: Path, heads: Sequence[str], lines: Iterable[Sequence[Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        writer.writerows(lines)
