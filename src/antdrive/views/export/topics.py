"""ROS topics and frames of an exported drive.

`map` is the frame of the map that the world came from, `odom` that of the world, in which the robot drives, and `base_link`
the robot's: on the floor, under the axle's centre, x forward. `map` and `odom` are the same, unless the world file says how
the world lies in its map. A mover i has the frame `mover_i`. The map that a robot makes itself has the frame `robot_map`, which
lies in `odom` so that the robot is where it believes to be: with errors of its odometry, it moves.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.optional import optional

Floats = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Payloads = Sequence[bytes | memoryview]

MAP, ODOM, BASE, ESTIMATE, LIDAR, ROBOT_MAP = "map", "odom", "base_link", "estimate", "base_scan", "robot_map"

IDENTITY = (0.0, 0.0, 0.0)  # the pose of a frame in itself


def mover_frame(index: int) -> str:
    """The frame of a mover."""
    return f"mover_{index}"


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one topic."""

    name: str  # the topic, such as /odom
    kind: str  # the messages' type, such as nav_msgs/msg/Odometry
    stamps: Stamps  # when each message was sent (N,) [ns]
    payloads: Payloads  # the serialised messages
    latched: bool = False  # whether a late subscriber still gets the last message (durability transient local)


def nanoseconds(t: npt.ArrayLike) -> Stamps:
    """Times [s] as ROS counts them [ns]."""
    return np.rint(np.atleast_1d(np.asarray(t, dtype=np.float64)) * 1e9).astype(np.int64)


def in_order(topics: Sequence[Topic]) -> list[tuple[int, int]]:
    """All messages by time, as (topic, message); at the same time, topics keep their order."""
    stamps = np.concatenate([topic.stamps for topic in topics])
    of = np.concatenate([np.full(len(topic.stamps), i) for i, topic in enumerate(topics)])
    number = np.concatenate([np.arange(len(topic.stamps)) for topic in topics])
    order = np.lexsort((number, of, stamps))
    return list(zip(of[order].tolist(), number[order].tolist(), strict=True))


def library(name: str) -> Any:
    """A module of rosbags or mcap, imported when it is first needed."""
    return optional(name, "ros", "bags are written with it, tables (--to csv) without")


@functools.cache
def message_types() -> Any:
    """The message types of ROS 2 Jazzy, as rosbags has them."""
    types = library("rosbags.typesys")
    return types.get_typestore(types.Stores.ROS2_JAZZY)
