"""A folder of results: its manifest says what they are of, one process at a time writes, and the same command resumes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from antdrive.base.atomic import folder_lock
from antdrive.base.errors import input_error
from antdrive.base.files import write_json


def free_folder(folder: Path, manifest: str, own: str) -> Path:
    """The folder itself, unless its manifest shows results of something else; then one with the fingerprint in its name."""
    try:
        found = json.loads((folder / manifest).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return folder
    except (OSError, ValueError, RecursionError):
        found = None
    same = isinstance(found, dict) and found.get("fingerprint") == own
    return folder if same else folder.with_name(f"{folder.name}-{own}")


@contextmanager
def opened(folder: Path, manifest: str, facts: Mapping[str, Any] | None = None, *, kind: str = "") -> Iterator[Path]:
    """A context in which this process alone writes into a folder of results.

    Args:
        folder: the folder, which is made where it is missing
        manifest: the name of its manifest
        facts: what the manifest says; None: it is written later
        kind: what it is a folder of; a folder of other files is refused then
    """
    if (
        kind
        and folder.is_dir()
        and not (folder / manifest).exists()
        and any(p.name[0] != "." for p in folder.iterdir())
    ):
        raise input_error(str(folder), f"holds other files and no {manifest}; name a new folder, or that of {kind}")
    with folder_lock(folder):
        if facts is not None:
            write_json(folder / manifest, facts)
        yield folder
