"""Bags of ROS messages: rosbag2 folders (SQLite, MCAP), single .mcap and .db3 files, and ROS 1 .bag files."""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from antdrive.base.errors import InputError, few, input_error
from antdrive.base.files import open_regular, unreadable
from antdrive.base.optional import optional

SUFFIXES = (".mcap", ".db3", ".bag")
PARTS = (*SUFFIXES, ".yaml", ".zstd")  # suffixes of the files in a rosbag2 folder
MAX_BYTES = 10**12  # of a file
MAX_CHUNK = 2**30  # of an unpacked chunk; writers use about 1 MB


class Bag:
    """An open bag; a context manager that closes it.

    Attributes:
        path: the folder or the file
        topics: message types by topic, such as nav_msgs/msg/Path

    Raises:
        InputError: the bag is invalid: found when it is opened or while messages are read.
    """

    def __init__(self, path: Path) -> None:
        self.path, file = path, _main_file(path)
        version = 1 if file.suffix == ".bag" else 2
        library = optional(f"rosbags.rosbag{version}", "ros", "bags need it")
        self._decode = f"deserialize_{'ros1' if version == 1 else 'cdr'}"
        with readable(path):
            self._reader = library.Reader(file)
            self._reader.open()
        self.topics: dict[str, str] = {each.topic: each.msgtype for each in self._reader.connections}

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()

    def topic_of(self, kind: str, named: str, remedy: str, usual: str = "") -> str:
        """Return the named topic of a type; without a name the usual, else the only one; InputError with a remedy if none."""
        names = sorted(name for name, own in self.topics.items() if own == kind)
        chosen = [name for name in names if name == (named or usual)] or names * (not named)
        if len(chosen) != 1:
            problem = f"{named} is no topic" if named else f"{len(names)} topics"
            raise input_error(str(self.path), f"{problem} of {kind}; {remedy} {few(names, 12) or 'none'}")
        return chosen[0]

    def messages(self, *topics: str) -> Iterator[tuple[str, int, Any]]:
        """Yield the topic, the time of receipt [ns] and the message of each message on these topics, by time of receipt."""
        if missing := [topic for topic in topics if topic not in self.topics]:
            raise input_error(str(self.path), f"no topic {missing[0]}; it has {few(sorted(self.topics), 12) or 'none'}")
        with readable(self.path):
            store = getattr(self._reader, "storage", None)
            chunks = [chunk for part in getattr(store, "storages", [store]) for chunk in getattr(part, "chunks", ())]
            if any(chunk.uncompressed_size > MAX_CHUNK for chunk in chunks):
                raise ValueError(f"a chunk of more than {MAX_CHUNK} bytes")
            connections = [each for each in self._reader.connections if each.topic in topics]
            for connection, received, raw in self._reader.messages(connections) if connections else ():
                kind, types = connection.msgtype, _types(connection.msgtype, *connection.msgdef)
                yield connection.topic, received, getattr(types, self._decode)(raw, kind)


@functools.lru_cache(maxsize=64)
def _types(kind: str, encoding: Any, definition: str) -> Any:
    """Return the types for messages of a kind: from the bag's own definition, else those of ROS 2 Jazzy."""
    library = optional("rosbags.typesys", "ros", "bags need it")
    own = encoding.name == "MSG"
    types = library.get_typestore(library.Stores.EMPTY if own else library.Stores.ROS2_JAZZY)
    if own:
        types.register(library.get_types_from_msg(definition, kind))
    return types


def _main_file(path: Path) -> Path:
    """Return the folder or file to open: of a folder without metadata its only bag. Refuse what is no regular file."""
    try:
        parts = [part for part in path.iterdir() if part.suffix in PARTS] if path.is_dir() else [path]
    except OSError as error:
        raise unreadable(path, error) from None
    for part in parts:
        open_regular(part, MAX_BYTES, "a bag").close()  # a pipe would block
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return path
    bags = [part for part in parts if part.suffix in SUFFIXES]
    if len(bags) != 1:
        raise input_error(str(path), f"no metadata.yaml and {len(bags)} bags; make one: ros2 bag reindex")
    return bags[0]


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Turn any error of a bag's library, or of messages that are not what their type says, into one line."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        problem = textwrap.shorten(f"{type(error).__name__}: {error}", 240, placeholder=" …")
        raise input_error(str(path), f"not a readable bag: {problem}") from None
