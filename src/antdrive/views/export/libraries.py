"""rosbags and mcap, which come with the extra `antdrive[ros]`."""

from __future__ import annotations

import functools
from typing import Any

from antdrive.base.optional import optional


def library(name: str) -> Any:
    """A module of rosbags or mcap, imported when it is first needed.

    Raises:
        InputError: it is not installed.
    """
    return optional(name, "ros", "bags are written with it, tables (--to csv) without")


@functools.cache
def message_types() -> Any:
    """The message types of ROS 2 Jazzy, as rosbags has them.

    Raises:
        InputError: rosbags is not installed.
    """
    types = library("rosbags.typesys")
    return types.get_typestore(types.Stores.ROS2_JAZZY)
