"""Folders of ROS packages: above or beside a file, and by the environment variables that ROS sets."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Iterator
from pathlib import Path

from antdrive.base.errors import InputError
from antdrive.base.files import read_bytes

MAX_BYTES = 1_000_000  # of a package.xml
MAX_NESTED = 6  # folders between a workspace and a package
PREFIXES = ("AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH", "CMAKE_PREFIX_PATH")


def folders_in(*variables: str) -> Iterator[Path]:
    """Yield the folders that environment variables list."""
    for variable in variables:
        yield from map(Path, filter(None, os.environ.get(variable, "").split(os.pathsep)))


def ros_package(name: str, source: Path) -> Path | None:
    """Return the folder of a package that a file names; None if missing.

    One above or beside the file comes first, then those of ROS' own variables.
    """
    above = Path(os.path.realpath(source)).parents
    own = (folder for folder in above if _is_package(folder, name))
    beside = (parent / name for parent in above)
    shared = (prefix / "share" / name for prefix in folders_in(*PREFIXES))
    folders = itertools.chain(own, beside, shared, _in_workspaces(name))
    return next((folder for folder in folders if name and os.path.isdir(folder)), None)


def _is_package(folder: Path, name: str) -> bool:
    file = folder / "package.xml"
    with contextlib.suppress(InputError):
        return file.is_file() and f"<name>{name}</name>".encode() in read_bytes(file, MAX_BYTES, "a package's manifest")
    return False


def _in_workspaces(name: str) -> Iterator[Path]:
    """Yield the folders of a package at or below those of ROS_PACKAGE_PATH."""
    for workspace in folders_in("ROS_PACKAGE_PATH"):
        for folder, inside, files in os.walk(workspace):
            if os.path.basename(folder) == name or _is_package(Path(folder), name):
                yield Path(folder)
            if "package.xml" in files or folder.count(os.sep) - str(workspace).count(os.sep) >= MAX_NESTED:
                inside.clear()
