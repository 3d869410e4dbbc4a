"""Which world, robot and settings a log is about: canonical hashes, and what differs from given ones.

Names and sources do not count, and neither does the form of a file: what is compared is what the file means.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

from antdrive.robots.spec import RobotSpec
from antdrive.sim.log.record import DriveRecord, plain_value
from antdrive.worlds.world import Task

#: The keys of a record that say how the drive was planned and driven.
SETTINGS = (
    "seed",
    "planner",
    "controller",
    "perception",
    "avoidance",
    "replanning",
    "noise",
    "margin",
    "cell",
    "physics_hz",
    "control_hz",
    "time_limit",
)
LABELS = ("name", "source")


def hashes_of(record: DriveRecord) -> dict[str, str]:
    """The SHA-256 of the world with start and goal, of the robot, and of the settings that a record holds.

    Each is that of JSON with sorted keys and Python's default separators; `docs/explanation/certificate.md` describes them.
    """
    values = record.as_dict()
    parts = {
        "world": _meaning(record.task),
        "robot": _meaning(record.robot),
        "settings": {**{key: values[key] for key in SETTINGS}, "smoothing": record.smoothing.asked},
    }
    return {name: _sha256(part) for name, part in parts.items()}


def canonical_hash(value: Task | RobotSpec) -> str:
    """The SHA-256 of a world with start and goal, or of a robot: the one that `hashes_of` finds in the log of its drives."""
    return _sha256(_meaning(value))


def differences(record: DriveRecord, *, task: Task | None = None, robot: RobotSpec | None = None) -> Iterator[str]:
    """What in a record is not as in the given world and robot, a sentence each."""
    for name, found, wanted in (("world", record.task, task), ("robot", record.robot, robot)):
        if wanted is None:
            continue
        logged, given = _meaning(found), _meaning(wanted)
        keys = [key for key in sorted({*logged, *given}) if logged.get(key) != given.get(key)]
        if keys:
            yield f"{name}: the log is about another one; its {', '.join(keys)} {'differ' if keys[1:] else 'differs'}"


def _sha256(value: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _meaning(value: Task | RobotSpec) -> Mapping[str, Any]:
    return {key: inner for key, inner in plain_value(value).items() if key not in LABELS}
