"""Results folder: a manifest identifies its contents, one process writes at a time, the same command resumes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from antdrive.base.atomic import LOCK, folder_lock
from antdrive.base.errors import input_error
from antdrive.base.files import MAX_JSON_BYTES, parse_json, read_bytes, write_json


def mark_of(*facts: object) -> str:
    """Return eight hexadecimal digits that identify the contents of a folder."""
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:8]


def free_folder(folder: Path, manifest: str, own: str) -> Path:
    """Return the folder, or one named with our fingerprint if the folder's manifest has another."""
    if not (folder / manifest).exists():
        return folder
    try:
        data = parse_json(read_bytes(folder / manifest, MAX_JSON_BYTES))
    except (ValueError, RecursionError):
        data = None
    same = isinstance(data, dict) and data.get("fingerprint") == own
    return folder if same else folder.with_name(f"{folder.name}-{own}")


@contextmanager
def opened(folder: Path, manifest: str, facts: Mapping[str, Any] | None = None, *, kind: str = "") -> Iterator[Path]:
    """Open a results folder for this process alone.

    Args:
        folder: the folder; created if missing
        manifest: name of its manifest
        facts: the manifest's data; None: written later
        kind: contents of the folder; a folder of other files is refused
    """
    if (
        kind
        and folder.is_dir()
        and not (folder / manifest).exists()
        and any(p.name[0] != "." for p in folder.iterdir())
    ):
        raise input_error(str(folder), f"contains other files but no {manifest}; use a new folder or one of {kind}")
    with folder_lock(folder):
        new = not (folder / manifest).exists()
        if facts is not None:
            write_json(folder / manifest, facts)
        try:
            yield folder
        except BaseException:
            if new and {path.name for path in folder.iterdir()} == {manifest, LOCK}:  # nothing was done
                (folder / manifest).unlink()
            raise
