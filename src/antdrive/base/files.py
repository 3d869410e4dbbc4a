"""Bounded file reads, portable file names and strict JSON."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from antdrive.base.atomic import write_text
from antdrive.base.errors import FieldError, InputError, input_error


def file_name(name: str, keep: str = "-_.", *, ascii_only: bool = False) -> str:
    """Replace all characters of a name except letters, digits and those in `keep` by underscores."""
    return "".join(c if (c.isalnum() and (c.isascii() or not ascii_only)) or c in keep else "_" for c in name)


def as_json(value: Any) -> str:
    """Format a value as indented strict JSON: infinities and nan become null."""
    return json.dumps(_json_value(value), indent=2, allow_nan=False)


def parse_json(text: str | bytes, **options: Any) -> Any:
    """Parse JSON in which no object has a key twice: readers differ in which of the values they use.

    Args:
        text: the JSON text
        **options: further arguments of `json.loads`

    Raises:
        FieldError: a key is given twice.
        ValueError: the text is not JSON.
    """
    return json.loads(text, object_pairs_hook=_object, **options)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the pairs as a mapping; refuse equal keys."""
    values = dict(pairs)
    if len(values) < len(pairs):
        keys = [key for key, _ in pairs]
        raise FieldError(next(key for key in keys if keys.count(key) > 1)[:40], "is given twice; keep one")
    return values


def write_json(path: Path, value: Any) -> None:
    """Write a value as JSON, atomically."""
    write_text(path, as_json(value) + "\n")


def known_suffix(path: Path, choices: Collection[str]) -> str:
    """Return a path's suffix in lower case; raise InputError unless it is one of the choices."""
    suffix = path.suffix.lower()
    if suffix not in choices:
        several = f"one of {', '.join(choices)}" if len(choices) > 2 else " or ".join(choices)
        raise InputError(f"{path}: unknown suffix {path.suffix!r}; choose {several}")
    return suffix


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


def read_bytes(path: str | os.PathLike[str], max_bytes: int, kind: str = "a file") -> bytes:
    """Return a file's content; raise InputError if it is unreadable or larger than `max_bytes`."""
    source = os.fspath(path)
    try:
        with Path(path).open("rb") as stream:
            content = stream.read(max_bytes + 1)
    except FileNotFoundError:
        raise input_error(source, "no such file") from None
    except IsADirectoryError:
        raise input_error(source, f"is a directory; give {kind}") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise input_error(source, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > max_bytes:
        raise input_error(source, f"is too large; the limit is {max_bytes // 1_000_000} MB")
    return content


def require_new(files: Iterable[Path], *, replace: bool) -> None:
    """Raise InputError if one of the files exists, unless it is to be replaced."""
    taken = None if replace else next((file for file in files if file.exists()), None)
    if taken is not None:
        raise input_error(str(taken), "exists; choose another file, or replace it with --force")
