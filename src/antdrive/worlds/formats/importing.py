"""Import formats by file suffix, with their options."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from antdrive.base.errors import FieldError, input_error
from antdrive.base.files import file_name
from antdrive.worlds.files.world_file import save_task
from antdrive.worlds.formats.barn import import_barn
from antdrive.worlds.formats.dynabarn import import_dynabarn
from antdrive.worlds.formats.map_server import import_map_server, kept_tasks
from antdrive.worlds.formats.movingai import import_movingai_task
from antdrive.worlds.formats.sdf import import_sdf
from antdrive.worlds.world import Task

#: Values that every task needs; formats without these options read them from the file.
_OF_EVERY_TASK = ("start", "goal", "bounds")


@dataclass(frozen=True)
class Format:
    """A file format that can be imported."""

    name: str  # for messages, such as "an SDF world"
    suffixes: tuple[str, ...]  # in lower case
    options: tuple[str, ...]  # the options of `read` besides the path
    read: Callable[..., list[Task]]  # reads the tasks in a file


def _read_map_server(path: Path, unknown: str | None = None, **options: Any) -> list[Task]:
    if unknown not in (None, "blocked", "free"):
        raise FieldError("unknown", f"must be blocked or free, got {unknown!r}")
    return [import_map_server(path, unknown_is_free=None if unknown is None else unknown == "free", **options)]


#: The import formats by name; of formats that share a suffix, the first is the default.
IMPORTS: Mapping[str, Format] = MappingProxyType(
    {
        "sdf": Format(
            "an SDF world",
            (".sdf", ".world"),
            ("start", "goal", "bounds", "cell", "band", "resolution", "overhang", "skip_unsupported", "on_skipped"),
            lambda path, **options: [import_sdf(path, **options)],
        ),
        "barn": Format(
            "a BARN world", (".sdf", ".world"), ("cell",), lambda path, **options: [import_barn(path, **options)]
        ),
        "map_server": Format(
            "a map_server map",
            (".yaml", ".yml"),
            ("start", "goal", "cell", "unknown", "overhang", "anywhere"),
            _read_map_server,
        ),
        "movingai": Format(
            "a MovingAI map",
            (".map",),
            ("start", "goal", "cell", "overhang", "resolution", "problem", "scen", "anywhere"),
            lambda path, **options: [import_movingai_task(path, **options)],
        ),
        "dynabarn": Format("a DynaBARN set", (".json",), ("cell",), import_dynabarn),
    }
)


def import_format(path: str | os.PathLike[str], *, barn: bool = False) -> Format:
    """Return a file's format, by its suffix; the file need not exist. `barn`: an SDF world belongs to the BARN set.

    Raises:
        InputError: the suffix has no import format.
        FieldError: `barn` is set for a file other than an SDF world.
    """
    suffix = Path(path).suffix.lower()
    if suffix in (".pgm", ".png", ".bmp"):
        raise input_error(os.fspath(path), "is an image; give the map's .yaml file")
    match = next((known for known in IMPORTS.values() if suffix in known.suffixes), None)
    if match is None:
        known = ".sdf, .world, .yaml (map_server), .map (MovingAI) and .json (DynaBARN)"
        raise input_error(os.fspath(path), f"cannot be imported; known suffixes: {known}")
    if not barn:
        return match
    if match is not IMPORTS["sdf"]:
        raise FieldError("barn", f"{match.name} takes only {_listed(match.options)}")
    return IMPORTS["barn"]


def import_file(path: str | os.PathLike[str], *, barn: bool = False, **options: Any) -> list[Task]:
    """Import the tasks in another program's file: one task, or one for each world of a DynaBARN set.

    The suffix determines the format; see `IMPORTS` for the options of each format.

    Args:
        path: the file
        barn: whether an SDF world belongs to the BARN set, with the challenge's start, goal and bounds
        options: as for `import_sdf`, `import_barn`, `import_map_server`, `import_movingai_task` and `import_dynabarn`,
            but a map_server map takes `unknown`, "blocked" or "free", for `unknown_is_free`; None counts as not given

    Raises:
        InputError: the file cannot be imported, is invalid, or contradicts an option.
        FieldError: an option has an invalid value or does not belong to the format.
    """
    file_format = import_format(path, barn=barn)
    given = {key: value for key, value in options.items() if value is not None}
    for key in given:
        if key not in file_format.options:
            brings = "has its own" if key in _OF_EVERY_TASK else f"takes only {_listed(file_format.options)}"
            raise FieldError(key, f"{file_format.name} {brings}")
    return file_format.read(Path(path), **given)


def save_imported(path: Path, tasks: Sequence[Task], target: Path) -> list[Path]:
    """Write imported tasks as world files and return the files.

    Args:
        path: the imported file; a map written by antdrive holds named tasks, which go into the world file
        tasks: its tasks
        target: the world file; of a set of worlds, the folder of their files

    Raises:
        InputError: two worlds of a set map to one file.
    """
    if import_format(path) is IMPORTS["dynabarn"]:
        files = [target / f"{file_name(task.world.name)}.yaml" for task in tasks]
        if twice := next((file for i, file in enumerate(files) if file in files[:i]), None):
            raise input_error(str(path), f"two worlds map to {twice}; give them different names")
    else:
        files = [target]
    for task, file in zip(tasks, files, strict=True):
        save_task(task, file, kept_tasks(path, task) if import_format(path) is IMPORTS["map_server"] else {})
    return files


def _listed(options: tuple[str, ...]) -> str:
    return ", ".join(name for name in options if name != "anywhere" and not name.startswith("on_"))
