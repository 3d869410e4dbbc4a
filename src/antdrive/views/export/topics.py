"""ROS topics and frames of an exported drive, and MCAP files that hold them, alone or in a rosbag2 folder.

Frames follow REP 105. `map` is the frame of the source map. `odom` → `base_footprint` is odometry, continuous; `map` →
`odom` corrects it, so that `map` → `base_footprint` is the localisation's estimate. `base_footprint` and `base_link` coincide,
on the floor below the axle's centre, x forward. `ground_truth` is the robot's true pose in `map`, `mover_i` that of mover i.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from antdrive.base.optional import optional
from antdrive.base.types import Ints

Payloads = Sequence[bytes | memoryview]

MAP, ODOM, TRUTH = "map", "odom", "ground_truth"
#: Stamp of a log's time 0 in the export under way [ns].
START: ContextVar[int] = ContextVar("START", default=0)


def mover_frame(index: int) -> str:
    """Return the frame of a mover."""
    return f"mover_{index}"


@dataclass(frozen=True, eq=False)
class Topic:
    """Messages of one topic."""

    name: str  # topic, such as /odom
    kind: str  # message type, such as nav_msgs/msg/Odometry
    stamps: Ints  # times of the messages (N,) [ns]
    payloads: Payloads  # serialised messages
    latched: bool = False  # durability transient local: late subscribers receive the last message


def nanoseconds(t: npt.ArrayLike) -> Ints:
    """Convert times of a log [s] to ROS stamps [ns]."""
    return np.rint(np.atleast_1d(np.asarray(t, dtype=np.float64)) * 1e9).astype(np.int64) + START.get()


def library(name: str) -> Any:
    """Import a module of rosbags or mcap."""
    return optional(name, "ros", "bags need it, tables (--to csv) do not")


@functools.cache
def message_types() -> Any:
    """Return rosbags' message types of ROS 2 Jazzy."""
    types = library("rosbags.typesys")
    return types.get_typestore(types.Stores.ROS2_JAZZY)


VERSION = 9  # of rosbag2's metadata
FOREVER = {"sec": 9223372036, "nsec": 854775807}  # ROS's "no limit"


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
        rows = ((at, i, k) for i, topic in enumerate(topics) for k, at in enumerate(topic.stamps.tolist()))
        for at, of, number in sorted(rows):
            writer.add_message(channels[of], at, topics[of].payloads[number], at, number)
        for name, (media_type, content) in attachments.items():
            writer.add_attachment(0, 0, name, media_type, content)
        writer.add_metadata("antdrive", dict(notes))
        writer.finish()


def metadata(file: str, topics: Sequence[Topic], notes: Mapping[str, str]) -> str:
    """Return the text of a rosbag2 folder's metadata.yaml."""
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
    """YAML without anchors and aliases, which readers of bags do not support."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _qos(latched: bool) -> dict[str, Any]:
    """Return a topic's offered quality of service."""
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
