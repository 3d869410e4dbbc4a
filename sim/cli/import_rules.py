"""Which format a file to import has, and which options that format takes."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.worlds.errors import InputError


class RefusedOption(ValueError):
    """An option that the file's format does not take.

    Attributes:
        key: the option, as a keyword of `import_file`
        problem: why it is refused
    """

    def __init__(self, key: str, problem: str) -> None:
        super().__init__(f"{key}: {problem}")
        self.key, self.problem = key, problem


@dataclass(frozen=True)
class _Format:
    name: str
    options: tuple[str, ...]
    read: Callable[..., Any]


def import_file(path: str | os.PathLike[str], **options: Any) -> list[Any]:
    """The tasks in a file of another program; its suffix says which format it has.

    Args:
        options: start, goal, bounds, cell, barn, skip_unsupported, unknown, overhang, resolution, problem; None counts
            as not given.

    Raises:
        InputError: the file cannot be imported.
        RefusedOption: an option that the format does not take.
    """
    file = Path(path)
    given = {key: value for key, value in options.items() if value is not None}
    kind = _format(file, bool(given.get("barn")))
    for key in given:
        if key not in kind.options:
            raise RefusedOption(key, f"{kind.name} {_refusal(key, kind.options)}")
    given.pop("barn", None)
    if "unknown" in kind.options:
        word = given.pop("unknown", "blocked")
        if word not in ("blocked", "free"):
            raise RefusedOption("unknown", f"must be blocked or free, got {word!r}")
        given["unknown_is_free"] = word == "free"
    found = kind.read(file, **given)
    return list(found) if isinstance(found, tuple | list) else [found]


def _refusal(key: str, options: tuple[str, ...]) -> str:
    if key in ("start", "goal", "bounds"):
        return "brings its own"
    return f"takes {', '.join('--' + option.replace('_', '-') for option in options)} only"


def _format(file: Path, barn: bool) -> _Format:
    from antdrive.worlds import import_barn, import_dynabarn, import_map_server, import_movingai_task, import_sdf

    suffix = file.suffix.lower()
    if suffix in (".sdf", ".world"):
        if barn:
            return _Format("--barn", ("barn", "cell"), import_barn)
        return _Format("an SDF world", ("start", "goal", "bounds", "cell", "skip_unsupported"), import_sdf)
    if suffix in (".yaml", ".yml"):
        return _Format("a map_server map", ("start", "goal", "cell", "unknown", "overhang"), import_map_server)
    if suffix == ".map":
        known = ("start", "goal", "cell", "overhang", "resolution", "problem")
        return _Format("a MovingAI map", known, import_movingai_task)
    if suffix == ".json":
        return _Format("DynaBARN", ("cell",), import_dynabarn)
    if suffix in (".pgm", ".png", ".bmp"):
        raise InputError(f"{file}: is an image; give the map's .yaml file, which says how to read the image")
    raise InputError(
        f"{file}: cannot be imported; .sdf, .world, .yaml (map_server), .map (MovingAI) and .json (DynaBARN) can"
    )
