"""Where the machine code of kernels is kept between runs, and for which sources it is valid. Loads no compiler."""

from __future__ import annotations

import functools
import hashlib
import os
import stat
import tempfile
from collections.abc import Iterable
from pathlib import Path

_ROOT = Path(__file__).parent.parent  # the package antdrive
PACKAGES = ("base", "worlds", "planners", "robots", "sim", "views")


def sources_stamp() -> str:
    """A SHA-256 of the text of every kernel file of antdrive, as this process has imported them.

    Modules are imported when they are needed, so files that are edited meanwhile are of two versions in one process. What is
    compiled then must not be taken for either version's, by this or any later process: the stamp is that of both texts.
    """
    first, then, stamp = _first_state()
    if _state(first) == then:
        return stamp
    texts = {path: path.read_bytes() if path.exists() else b"" for path in first}
    return stamp if texts == first else _sha([*first.values(), *texts.values()])


@functools.cache
def _first_state() -> tuple[dict[Path, bytes], list[tuple[int, int]], str]:
    """The texts of all kernel files when this is first called, what `_state` says of them, and their stamp."""
    paths = [path for package in PACKAGES for path in sorted((_ROOT / package).rglob("_kernels*.py"))]
    state = _state(paths)  # before they are read, so that an edit in between shows
    texts = {path: path.read_bytes() for path in paths}
    return texts, state, _sha(texts.values())


def _state(paths: Iterable[Path]) -> list[tuple[int, int]]:
    """When files were last written, and their sizes; zeros for those that are gone."""
    found = []
    for path in paths:
        try:
            status = os.stat(path)
            found.append((status.st_mtime_ns, status.st_size))
        except OSError:
            found.append((0, 0))
    return found


def _sha(texts: Iterable[bytes]) -> str:
    sha = hashlib.sha256()
    for text in texts:
        sha.update(text)
    return sha.hexdigest()


def cache_folder() -> Path | None:
    """The folder for machine code; None where no folder at all can be written.

    The first that can be written of: what `NUMBA_CACHE_DIR` names, the package's own `__pycache__`, the user's cache folder,
    and a private folder among the temporary files.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    for folder in (*([Path(given)] if given else []), *default_folders()):
        if _writable(folder):
            return folder
    return _private_folder()


def default_folders() -> tuple[Path, Path]:
    """The folders that numba tries by itself, as far as antdrive's kernels are concerned."""
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path(os.path.expanduser("~")) / ".cache")
    return _ROOT / "base" / "__pycache__", user / "numba"


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _private_folder() -> Path | None:
    """A folder that nobody else can write, the same one in every process of this user if possible.

    Cached code is executed, so a folder that somebody else has made is never used.
    """
    user = os.getuid() if hasattr(os, "getuid") else None
    try:
        folder = Path(tempfile.gettempdir()) / f"antdrive-cache-{'user' if user is None else user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        private = user is None or (found.st_uid == user and not found.st_mode & 0o077)
        if stat.S_ISDIR(found.st_mode) and private and _writable(folder):
            return folder
        return Path(tempfile.mkdtemp(prefix="antdrive-cache-"))
    except OSError:  # also where no folder for temporary files exists
        return None
