"""Bounded file reads, portable file names and strict JSON."""

from __future__ import annotations

import contextlib
import json
import math
import os
import stat
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any, BinaryIO

from antdrive.base.atomic import write_text
from antdrive.base.errors import FieldError, InputError, input_error

MAX_BYTES = 500_000_000  # of any file that is read; most readers have lower limits
LFS = b"version https://git-lfs.github.com/"  # the first bytes of a pointer
MAX_JSON_BYTES = 20_000_000  # of manifests and other JSON files that antdrive writes for itself


def file_name(name: str, keep: str = "-_.", *, ascii_only: bool = False) -> str:
    """Replace all characters of a name except letters, digits and those in `keep` by underscores."""
    return "".join(c if (c.isalnum() and (c.isascii() or not ascii_only)) or c in keep else "_" for c in name)


def summary_of(path: Path) -> str:
    """Return the summary of a catalogue's file: the comment in its first line."""
    with path.open(encoding="utf-8") as file:
        return file.readline().removeprefix("#").strip()


def as_json(value: Any) -> str:
    """Format a value as indented strict JSON: infinities and nan become null."""
    return json.dumps(json_value(value), indent=2, allow_nan=False)


def parse_json(text: str | bytes, **options: Any) -> Any:
    """Parse JSON, with options of `json.loads`, in which no object has a key twice: readers differ in which value they use.

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


def relative(path: Path, folder: Path) -> str:
    """Return a path relative to a folder, with slashes on every system; Windows has none to another drive: the whole path."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return path.as_posix()


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


def json_value(value: Any) -> Any:
    """Return a plain value for JSON: tuples as lists, null for numbers that are not finite."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    if hasattr(value, "item"):
        return json_value(value.item())
    return value


def open_regular(path: str | os.PathLike[str], max_bytes: int = MAX_BYTES, kind: str = "a file") -> BinaryIO:
    """Open a regular file for reading; raise InputError for anything else.

    A file larger than `max_bytes` and a pointer of Git LFS, which stands for a file, are refused, too.
    """
    try:
        found = os.stat(path)
        if not stat.S_ISREG(found.st_mode):
            problem = f"is {_SPECIAL.get(stat.S_IFMT(found.st_mode), 'a device')}; give {kind}"
            raise input_error(os.fspath(path), problem)
        if found.st_size > max_bytes:
            raise _too_large(path, max_bytes)
        with contextlib.ExitStack() as opened:
            stream = opened.enter_context(open(path, "rb", opener=without_waiting))
            if stream.peek(len(LFS)).startswith(LFS):
                problem = "is a pointer of Git LFS, not the file; in its repository: git lfs pull"
                raise input_error(os.fspath(path), problem)
            opened.pop_all()
            return stream
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from None


def read_bytes(path: str | os.PathLike[str], max_bytes: int, kind: str = "a file") -> bytes:
    """Return a regular file's content; raise InputError if it is unreadable or larger than `max_bytes`."""
    with open_regular(path, max_bytes, kind) as stream:
        try:
            content = stream.read(max_bytes + 1)
        except OSError as error:
            raise unreadable(path, error) from None
    if len(content) > max_bytes:  # files below /proc have no size
        raise _too_large(path, max_bytes)
    return content


def _too_large(path: str | os.PathLike[str], max_bytes: int) -> InputError:
    return input_error(os.fspath(path), f"is too large; the limit is {format_size(max_bytes)}")


def format_size(size: int) -> str:
    """Format a number of bytes as a person writes it: 20 kB, 1.35 MB."""
    units = ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"))
    unit, name = next(((u, n) for u, n in units if size >= 0.9995 * u), (1.0, "bytes"))
    return f"{size / unit:.3g} {name}"


def unreadable(path: str | os.PathLike[str], error: OSError | ValueError) -> InputError:
    """Return the error for a file that cannot be opened or read. ValueError: a null character in the path."""
    if isinstance(error, FileNotFoundError):
        return input_error(os.fspath(path), "no such file")
    return input_error(os.fspath(path), f"cannot be read: {getattr(error, 'strerror', None) or error}")


_SPECIAL = {stat.S_IFDIR: "a directory", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


def without_waiting(path: str, flags: int) -> int:
    """Open a file without waiting for the other end of a pipe; an opener for `open`."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def require_new(files: Iterable[Path], *, replace: bool) -> None:
    """Raise InputError if one of the files exists, unless it is to be replaced."""
    taken = None if replace else next((file for file in files if file.exists()), None)
    if taken is not None:
        raise input_error(str(taken), "exists; choose another file, or replace it with --force")
