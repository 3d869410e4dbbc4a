"""Poses in text: TUM trajectories, and CSV tables with a header, such as roqsim's sim_poses.csv."""

from __future__ import annotations

import contextlib
import json
import math
import re
from pathlib import Path

import numpy as np

from antdrive.base.columns import read_columns
from antdrive.base.errors import few, input_error
from antdrive.base.types import Floats
from antdrive.foreign.frames import ROBOTS, Edge, Recording

MAX_BYTES = 400_000_000
MAX_TIME = 9e9  # of a stamp [s]
TUM = ["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"]
ROQSIM = {"timestamp", "wall_time", "frame", "position.x", "orientation.w"}
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "m": 1.0, "mm": 1e-3, "rad": 1.0, "deg": math.pi / 180}
#: Names of columns; a unit may follow, as in t_ns.
NAMES = {
    "t": "t|time|stamp|timestamp",
    **{axis: rf"(?:.*position[./_]|t|pos_)?{axis}" for axis in "xyz"},
    "yaw": "yaw|theta|heading",
    **{f"q{axis}": rf"(?:.*orientation[./_]|q_?){axis}" for axis in "xyzw"},
    "frame": "frame",
}


def read_table(path: Path, robot_frame: str | None) -> Recording:
    """Return the poses in a table; of one robot if it has several. A last row that is cut off is left out."""
    heads, rows = read_columns(path, MAX_BYTES)
    heads = heads or TUM * (len(rows) > 0 and len(rows[0][1]) == len(TUM))
    columns = _columns(path, heads)
    if rows and len(rows[-1][1]) < len(heads):
        rows.pop()
    for line, row in rows:
        if len(row) != len(heads):
            raise input_error(f"{path}:{line}", f"has {len(row)} values; the header has {len(heads)}")
    if "frame" in columns:
        own = columns["frame"][0]
        names = sorted({row[own] for _, row in rows})
        robot_frame = robot_frame or next((name for name in (*ROBOTS, *names[: len(names) == 1]) if name in names), "")
        if robot_frame not in names:
            raise input_error(str(path), f"has rows of {few(names, 20)}; name one: --robot-frame")
        rows = [(line, row) for line, row in rows if row[own] == robot_frame]

    def numbers(key: str) -> Floats:
        if key not in columns:
            return np.zeros(len(rows))
        k, unit = columns[key]
        values = np.array([_number(row[k], f"{path}:{line}: {heads[k]}") for line, row in rows]) * unit
        return np.where(np.isfinite(values), values, np.nan)

    t, half = numbers("t"), numbers("yaw") / 2
    known = np.isfinite(t)
    if (latest := np.abs(t[known]).max(initial=0)) > MAX_TIME:
        raise input_error(str(path), f"a time of {latest:g} is none in seconds; write its unit, as in t_ns")
    notes = [] if known.all() else [f"{np.count_nonzero(~known)} rows without a time; left out"]
    if ROQSIM.issubset(heads):
        late = _step_of_roqsim(path)
        t -= late
        notes.append(
            f"roqsim labels rows one physics step late, {f'{late:g} s: corrected' if late else 'of unknown length'}"
        )
    turn = [numbers(f"q{axis}") for axis in "xyzw"]
    if "yaw" in columns:
        turn[2:] = np.sin(half), np.cos(half)
    used = ", ".join(heads[k] for k, _ in columns.values())
    rows7, stamps = np.column_stack([*(numbers(axis) for axis in "xyz"), *turn]), np.rint(t[known] * 1e9)
    edge = Edge(stamps.astype(np.int64), np.zeros(0, dtype=np.int64), rows7[known])
    return Recording([("", edge, False)], {"poses": used, "map_frame": "map", "robot_frame": robot_frame or ""}, notes)


def _step_of_roqsim(path: Path) -> float:
    """Return the physics step [s] that roqsim's recording beside a table states; 0 if there is none."""
    for file in sorted(path.parent.glob("*.npz")):
        with contextlib.suppress(Exception), np.load(file, allow_pickle=False) as recording:
            return float(json.loads(str(recording["meta"]))["timestep"])
    return 0.0


def _columns(path: Path, heads: list[str]) -> dict[str, tuple[int, float]]:
    """Return the number and the unit of each column that holds times or poses."""
    columns: dict[str, tuple[int, float]] = {}
    for key, name in NAMES.items():
        for k, head in enumerate(heads):
            if match := re.fullmatch(rf"(?:{name})(?:_({'|'.join(UNITS)}))?", head.lower()):
                if key in columns:
                    raise input_error(
                        str(path), f"several columns for {key}: {heads[columns[key][0]]}, {head}; keep one"
                    )
                columns[key] = k, UNITS.get(match[1], 1.0)
    wanted = {"t": {"t"}, "x": {"x"}, "y": {"y"}, "yaw (or qz and qw)": {"yaw", "qw"}}
    if missing := [key for key, names in wanted.items() if not names & set(columns)]:
        names = few(heads, 20) or "no header; name its columns in the first line, such as t,x,y,yaw"
        raise input_error(str(path), f"no column {', '.join(missing)}; it has {names}")
    return columns


def _number(text: str, where: str) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        raise input_error(where, f"must be a number, got {text[:40]!r}") from None
