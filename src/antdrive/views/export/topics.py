"""ROS topics and frames of an exported drive, and the bags that hold them: an MCAP file, alone or in a rosbag2 folder.

`map` is the frame of the map that the world came from, `odom` that of the world, in which the robot drives, and `base_link`
the robot's: on the floor, under the axle's centre, x forward. `map` and `odom` are the same, unless the world file says how
the world lies in its map. A mover i has the frame `mover_i`. The map that a robot makes itself has the frame `robot_map`, which
lies in `odom` so that the robot is where it believes to be: with errors of its odometry, it moves.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from antdrive.base.optional import optional
from antdrive.base.types import Ints

Payloads = Sequence[bytes | memoryview]

MAP, ODOM, BASE, ESTIMATE, LIDAR, ROBOT_MAP = "map", "odom", "base_link", "estimate", "base_scan", "robot_map"


def mover_frame(index: int) -> str:
    """The frame of a mover."""
    return f"mover_{index}"


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one topic."""

    name: str  # the topic, such as /odom
    kind: str  # the messages' type, such as nav_msgs/msg/Odometry
    stamps: Ints  # when each message was sent (N,) [ns]
    payloads: Payloads  # the serialised messages
    latched: bool = False  # whether a late subscriber still gets the last message (durability transient local)


def nanoseconds(t: npt.ArrayLike) -> Ints:
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


VERSION = 9  # of rosbag2's metadata
FOREVER = {"sec": 9223372036, "nsec": 854775807}  # how ROS writes "no limit"


def write_mcap(
    path: Path, topics: Sequence[Topic], attachments: Mapping[str, tuple[str, bytes]], notes: Mapping[str, str]
) -> None:
    """Write an MCAP file."""
    mcap, types = library("mcap.writer"), message_types()
    with path.open("wb") as file:
        writer = mcap.Writer(file)
        writer.start(profile="ros2", library="antdrive")
        schemas: dict[str, int] = {}
        channels = []
        for topic in topics:
            if topic.kind not in schemas:
                text, _ = types.generate_msgdef(topic.kind, ros_version=2)
                schemas[topic.kind] = writer.register_schema(topic.kind, "ros2msg", text.encode())
            qos = yaml.dump([_qos(topic.latched)], Dumper=_WithoutAliases, sort_keys=False).strip()
            about = {"offered_qos_profiles": qos, "topic_type_hash": types.hash_rihs01(topic.kind)}
            channels.append(writer.register_channel(topic.name, "cdr", schemas[topic.kind], about))
        for of, number in in_order(topics):
            at = int(topics[of].stamps[number])
            writer.add_message(channels[of], at, topics[of].payloads[number], at, number)
        for name, (media_type, content) in attachments.items():
            writer.add_attachment(0, 0, name, media_type, content)
        writer.add_metadata("antdrive", dict(notes))
        writer.finish()


def metadata(file: str, topics: Sequence[Topic], notes: Mapping[str, str]) -> str:
    """The text of a rosbag2 folder's metadata.yaml."""
    begin = min(int(topic.stamps[0]) for topic in topics)
    end = max(int(topic.stamps[-1]) for topic in topics)
    span: dict[str, Any] = {
        "starting_time": {"nanoseconds_since_epoch": begin},
        "duration": {"nanoseconds": end - begin},
        "message_count": sum(len(topic.stamps) for topic in topics),
    }
    content = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": [file],
        **span,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.kind,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [_qos(topic.latched)],
                    "type_description_hash": message_types().hash_rihs01(topic.kind),
                },
                "message_count": len(topic.stamps),
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": file, **span}],
        "custom_data": {f"antdrive_{about}": words for about, words in notes.items()},
        "ros_distro": "jazzy",
    }
    return yaml.dump({"rosbag2_bagfile_information": content}, Dumper=_WithoutAliases, sort_keys=False)


class _WithoutAliases(yaml.SafeDumper):
    """YAML as readers of bags know it, without references to what was written before."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _qos(latched: bool) -> dict[str, Any]:
    """The quality of service that a topic was offered with."""
    return {
        "history": "keep_last",
        "depth": 1 if latched else 10,
        "reliability": "reliable",
        "durability": "transient_local" if latched else "volatile",
        "deadline": dict(FOREVER),
        "lifespan": dict(FOREVER),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(FOREVER),
        "avoid_ros_namespace_conventions": False,
    }
