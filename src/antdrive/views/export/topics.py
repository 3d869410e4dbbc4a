"""What a drive says on each topic of ROS, as serialised messages with their times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Payloads = Sequence[bytes | memoryview]


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one topic.

    Attributes:
        name: the topic, such as /odom
        kind: the messages' type, such as nav_msgs/msg/Odometry
        stamps: when each message was sent (N,) [ns]
        payloads: the serialised messages
        latched: whether a late subscriber still gets the last message (durability transient local)
    """

    name: str
    kind: str
    stamps: Stamps
    payloads: Payloads
    latched: bool = False


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
