"""rosbags and mcap, which come with the extra `antdrive[ros]`."""

from __future__ import annotations

import functools
import importlib
from typing import Any

from antdrive.worlds.errors import InputError


def library(name: str) -> Any:
    """A module of rosbags or mcap, imported when it is first needed.

    Args:
        name: the module's full name, such as "mcap.writer"

    Raises:
        InputError: it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        package = name.partition(".")[0]
        raise InputError(
            f"{package}: not installed; bags are written with it: pip install 'antdrive[ros]'; --to csv works without"
        ) from None


@functools.cache
def message_types() -> Any:
    """The message types of ROS 2 Jazzy, as rosbags has them.

    Raises:
        InputError: rosbags is not installed.
    """
    types = library("rosbags.typesys")
    return types.get_typestore(types.Stores.ROS2_JAZZY)
