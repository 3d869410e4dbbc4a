"""ROS 2 messages in an MCAP file, and in a rosbag2 folder around one. No ROS is needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from antdrive.views.export.libraries import library, message_types
from antdrive.views.export.topics import Topic, in_order

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
            about = {
                "offered_qos_profiles": yaml.dump(
                    [_qos(topic.latched)], Dumper=_WithoutAliases, sort_keys=False
                ).strip(),
                "topic_type_hash": types.hash_rihs01(topic.kind),
            }
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
