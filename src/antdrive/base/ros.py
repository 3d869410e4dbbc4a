"""Folders of ROS packages, by the environment variables that ROS sets."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path


def folders_in(*variables: str) -> Iterator[Path]:
    """Yield the folders that environment variables list."""
    for variable in variables:
        yield from map(Path, filter(None, os.environ.get(variable, "").split(os.pathsep)))


def ros_package(name: str) -> Path | None:
    """Return the folder of an installed or sourced ROS package; None if there is none of that name."""
    shares = (folder / "share" / name for folder in folders_in("AMENT_PREFIX_PATH"))
    sources = (folder if folder.name == name else folder / name for folder in folders_in("ROS_PACKAGE_PATH"))
    return next((folder for folder in (*shares, *sources) if name and folder.is_dir()), None)
