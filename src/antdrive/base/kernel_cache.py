"""Location and validity of the kernels' machine-code cache, without loading the compiler."""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import os
import re
import stat
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

_ROOT = Path(__file__).parent.parent  # the package antdrive
_IMPORT = re.compile(rb"^[ \t]*(?:from|import)\b[^\n(]*(?:\([^)]*\))?", re.MULTILINE)
_NAME = re.compile(rb"\b_kernels\w*")
PACKAGES = ("base", "worlds", "planners", "robots", "sim", "views", "gym")


def ignore(name: str) -> None:
    """Ignore that a kernel compiles."""


#: What a command prints when its first kernel compiles.
COMPILING = "compiling planner and drive, once per installation: up to 1 min"
on_compile: Callable[[str], None] = ignore  # called with each kernel's name before it compiles
blocks = 0  # open blocks of `compiled`
interpreted = 0  # calls of kernels that Python ran in this process


@contextlib.contextmanager
def compiled() -> Iterator[None]:
    """Compile kernels at their first call in this block; elsewhere Python runs those that take little time."""
    global blocks
    blocks += 1
    try:
        yield
    finally:
        blocks -= 1


class _Account(threading.local):
    """The seconds that this thread has spent in blocks that load or compile kernels, which may nest."""

    depth, since, seconds = 0, 0.0, 0.0

    def __enter__(self) -> None:
        if not self.depth:
            self.since = time.perf_counter()
        self.depth += 1

    def __exit__(self, *_: object) -> None:
        self.depth -= 1
        if not self.depth:
            self.seconds += time.perf_counter() - self.since


account = _Account()


def clock() -> Callable[[], float]:
    """Return a clock of the seconds from now on, except those in which this thread compiles and loads kernels."""
    began = time.perf_counter() - account.seconds
    return lambda: time.perf_counter() - account.seconds - began


@contextlib.contextmanager
def uncollected() -> Iterator[None]:
    """Pause the garbage collector: a parser or compiler makes many objects that live until it ends."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def sources_stamp(file: Path | None = None) -> str:
    """Return the SHA-256 of the texts of a kernel file and those it imports, as imported by this process.

    For None and files elsewhere, it is that of all kernel files.

    Modules are imported lazily, so a file edited while the process runs mixes two versions in it. Code compiled then belongs to
    neither version: its stamp covers both texts.
    """
    first, imported = _first_state()
    paths = sorted(_closure(file, imported)) if file in imported else list(first)
    texts, now = [first[path] for path in paths], [path.read_bytes() if path.exists() else b"" for path in paths]
    return hashlib.sha256(b"".join(texts if now == texts else texts + now)).hexdigest()


def text_of(file: Path) -> bytes:
    """Return the text of a kernel file as this process imported it; of another file, as it is now."""
    return _first_state()[0].get(file) or file.read_bytes()


@functools.cache
def _first_state() -> tuple[dict[Path, bytes], dict[Path, set[Path]]]:
    """Return the texts and the imported kernel files of all kernel files at the first call."""
    paths = [path for package in PACKAGES for path in sorted((_ROOT / package).rglob("_kernels*.py"))]
    texts = {path: path.read_bytes() for path in paths}
    named: dict[bytes, set[Path]] = {}
    for path in paths:
        named.setdefault(path.stem.encode(), set()).add(path)
    # By name alone: of two files of one name, both count.
    imported = {
        path: set().union(*(named.get(name, ()) for line in _IMPORT.findall(text) for name in _NAME.findall(line)))
        for path, text in texts.items()
    }
    return texts, imported


def _closure(file: Path, imported: dict[Path, set[Path]]) -> set[Path]:
    """Return a file and all files that it imports, directly or not."""
    found, new = {file}, [file]
    while new:
        more = imported[new.pop()] - found
        found |= more
        new += more
    return found


def cache_folder() -> Path | None:
    """Return the folder for machine code; None without a writable folder.

    The first writable one of: `NUMBA_CACHE_DIR`, the package's `__pycache__`, the user's cache folder, and a private folder
    among the temporary files. Git ignores a new one.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    for folder in (*([Path(given)] if given else []), *default_folders()):
        new = not os.path.exists(folder)
        if writable(folder):
            if new:
                with contextlib.suppress(OSError):
                    (folder / ".gitignore").write_text("*\n")
            return folder
    return _private_folder()


def default_folders() -> tuple[Path, Path]:
    """Return the folders that numba itself tries for antdrive's kernels."""
    return _ROOT / "base" / "__pycache__", user_cache() / "numba"


def user_cache() -> Path:
    """Return the user's cache folder."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path(os.path.expanduser("~")) / ".cache")


def writable(folder: Path) -> bool:
    """Return whether files can be written into a folder, made if it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _private_folder() -> Path | None:
    """Return a folder writable only by this user, the same one in every process if possible.

    Cached code is executed, so another user's folder is never used.
    """
    user = os.getuid() if hasattr(os, "getuid") else None
    try:
        folder = Path(tempfile.gettempdir()) / f"antdrive-cache-{'user' if user is None else user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        private = user is None or (found.st_uid == user and not found.st_mode & 0o077)
        if stat.S_ISDIR(found.st_mode) and private and writable(folder):
            return folder
        return Path(tempfile.mkdtemp(prefix="antdrive-cache-"))
    except OSError:  # includes a missing folder for temporary files
        return None
