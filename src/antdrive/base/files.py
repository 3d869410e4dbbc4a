"""Names of files that every system takes, and JSON that every reader accepts."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from antdrive.base.atomic import written_whole


def file_name(name: str, keep: str = "-_.", *, ascii_only: bool = False) -> str:
    """A name with letters, digits and the characters of `keep`; an underscore stands for each other one."""
    return "".join(c if (c.isalnum() and (c.isascii() or not ascii_only)) or c in keep else "_" for c in name)


def as_json(value: Any) -> str:
    """Indented JSON that every reader accepts: infinities and nan become null."""
    return json.dumps(_json_value(value), indent=2, allow_nan=False)


def write_json(path: Path, value: Any) -> None:
    """Write a value as JSON, whole or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    with written_whole(path) as temporary:
        temporary.write_text(as_json(value) + "\n", encoding="utf-8")


def _json_value(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item) for item in value]
    if hasattr(value, "item"):
        return _json_value(value.item())
    return value
