"""Files of other programs: which format a file has, which options belong to it, and the tasks in it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from antdrive.base.errors import FieldError, input_error
from antdrive.worlds.formats.barn import import_barn
from antdrive.worlds.formats.dynabarn import import_dynabarn
from antdrive.worlds.formats.map_server import import_map_server
from antdrive.worlds.formats.movingai import import_movingai_task
from antdrive.worlds.formats.sdf import import_sdf
from antdrive.worlds.world import Task

#: Values that every task has; a format that does not take them as options provides them itself.
_OF_EVERY_TASK = ("start", "goal", "bounds")


@dataclass(frozen=True)
class Format:
    """A file format of another program that can be imported.

    Attributes:
        name: what messages call a file of this format
        suffixes: the suffixes of its files, in lower case
        options: the options that `read` takes besides the path
        read: the function that reads the tasks in a file
        is_map: whether a file holds a map of cells, which the import covers with cylinders
    """

    name: str
    suffixes: tuple[str, ...]
    options: tuple[str, ...]
    read: Callable[..., list[Task]]
    is_map: bool = False


def _read_map_server(path: Path, unknown: str = "blocked", **options: Any) -> list[Task]:
    if unknown not in ("blocked", "free"):
        raise FieldError("unknown", f"must be blocked or free, got {unknown!r}")
    return [import_map_server(path, unknown_is_free=unknown == "free", **options)]


#: The formats that can be imported, by name; the first of several that fit a suffix is the default.
IMPORTS: Mapping[str, Format] = MappingProxyType(
    {
        "sdf": Format(
            "an SDF world",
            (".sdf", ".world"),
            ("start", "goal", "bounds", "cell", "skip_unsupported"),
            lambda path, **options: [import_sdf(path, **options)],
        ),
        "barn": Format(
            "a BARN world", (".sdf", ".world"), ("cell",), lambda path, **options: [import_barn(path, **options)]
        ),
        "map_server": Format(
            "a map_server map",
            (".yaml", ".yml"),
            ("start", "goal", "cell", "unknown", "overhang"),
            _read_map_server,
            is_map=True,
        ),
        "movingai": Format(
            "a MovingAI map",
            (".map",),
            ("start", "goal", "cell", "overhang", "resolution", "problem"),
            lambda path, **options: [import_movingai_task(path, **options)],
            is_map=True,
        ),
        "dynabarn": Format("a DynaBARN set", (".json",), ("cell",), import_dynabarn),
    }
)


def import_format(path: str | os.PathLike[str], *, barn: bool = False) -> Format:
    """The format of a file, by its suffix.

    Args:
        path: the file, which need not exist
        barn: whether an SDF world is one of the BARN set

    Raises:
        InputError: files with this suffix cannot be imported.
        FieldError: `barn` was given for a file that is not an SDF world.
    """
    suffix = Path(path).suffix.lower()
    if suffix in (".pgm", ".png", ".bmp"):
        raise input_error(os.fspath(path), "is an image; give the map's .yaml file, which describes it")
    found = next((known for known in IMPORTS.values() if suffix in known.suffixes), None)
    if found is None:
        known = ".sdf, .world, .yaml (map_server), .map (MovingAI) and .json (DynaBARN)"
        raise input_error(os.fspath(path), f"cannot be imported; files that can be end in {known}")
    if not barn:
        return found
    if found is not IMPORTS["sdf"]:
        raise FieldError("barn", f"{found.name} takes {_listed(found.options)} only")
    return IMPORTS["barn"]


def import_file(path: str | os.PathLike[str], *, barn: bool = False, **options: Any) -> list[Task]:
    """The tasks in a file of another program: one, or for a DynaBARN set one for each of its worlds.

    The file's suffix says which format it has; see `IMPORTS` for the options of each format.

    Args:
        path: the file
        barn: whether an SDF world is one of the BARN set, with the challenge's start, goal and bounds
        options: as for `import_sdf`, `import_barn`, `import_map_server`, `import_movingai_task` and `import_dynabarn`,
            but a map_server map takes `unknown`, "blocked" or "free", for its unknown cells; None counts as not given

    Raises:
        InputError: the file cannot be imported, is wrong, or contradicts an option that was given.
        FieldError: an option that does not belong to the format, or has a value that it cannot have.
    """
    file_format = import_format(path, barn=barn)
    given = {key: value for key, value in options.items() if value is not None}
    for key in given:
        if key not in file_format.options:
            brings = "brings its own" if key in _OF_EVERY_TASK else f"takes {_listed(file_format.options)} only"
            raise FieldError(key, f"{file_format.name} {brings}")
    return file_format.read(Path(path), **given)


def _listed(options: tuple[str, ...]) -> str:
    return ", ".join(options)
