"""Atomic file writes and per-process folder locks."""

from __future__ import annotations

import errno
import os
import platform
import re
import shutil
import stat
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from antdrive.base import system
from antdrive.base.errors import InputError

LOCK = ".antdrive.lock"
LONGEST_STEM = 100  # characters of the target's name in a temporary file's name


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Create a folder and its parents; at the end, remove those that it created and that are empty."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        with suppress(OSError):  # not empty
            for parent in missing:
                parent.rmdir()


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` on success and is removed on failure.

    An error of writing without a file's name, as on a full disk, is raised with `path`. Temporary files left behind by
    killed processes for the same target are removed.
    """
    target = Path(path)

    def make() -> Path:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        _sweep(target)
        prefix = f"{_prefix(target)}{os.getpid()}-"
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=prefix, suffix=target.suffix)
        os.close(handle)
        return Path(name)

    with _replacing(target, make, 0o666) as temporary:
        yield temporary


def write_text(path: str | Path, text: str) -> Path:
    """Write a UTF-8 text file atomically, with the same line ends on every system, and return its path."""
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


@contextmanager
def atomic_folder(path: str | Path) -> Iterator[Path]:
    """Yield a temporary folder that becomes `path` on success and is removed on failure."""
    target = Path(path)

    def make() -> Path:
        if target.is_file() or (target.is_dir() and any(target.iterdir())):
            raise InputError(f"{target}: exists; name a new folder")
        return Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name[:LONGEST_STEM]}-"))

    with _replacing(target, make, 0o777) as temporary:
        yield temporary


@contextmanager
def _replacing(target: Path, make: Callable[[], Path], mode: int) -> Iterator[Path]:
    """Yield the temporary path that `make` creates beside a target; it replaces the target on success."""
    with ExitStack() as made:
        try:
            made.enter_context(made_folder(target.parent))
            temporary = make()
        except OSError as error:
            raise InputError(f"{target}: cannot be written ({error.strerror})") from None
        try:
            yield temporary
            temporary.chmod(mode & ~_umask())
            if temporary.is_dir() and target.is_dir():
                target.rmdir()  # it is empty; Windows replaces no folder
            temporary.replace(target)
        except OSError as error:
            raise _not_written(target, temporary, error) from None
        finally:
            if temporary.is_dir():
                shutil.rmtree(temporary, ignore_errors=True)
            else:
                temporary.unlink(missing_ok=True)


def _not_written(target: Path, temporary: Path, error: OSError) -> Exception:
    """Return the error of writing a target; one about another file stays what it is."""
    named = error.filename
    if named is not None and temporary not in (file := Path(os.fsdecode(named)), *file.parents):
        return error
    return InputError(f"{target}: cannot be written ({error.strerror or error})")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@contextmanager
def folder_lock(folder: str | Path) -> Iterator[None]:
    """Lock a folder for this process. The lock ends with the process, even if it is killed."""
    path = Path(folder) / LOCK
    with ExitStack() as made:
        try:
            made.enter_context(made_folder(path.parent))
            while True:
                handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NONBLOCK", 0), 0o666)
                if not stat.S_ISREG(os.fstat(handle).st_mode):
                    os.close(handle)
                    raise InputError(f"{path}: is not a file; remove it")
                if not system.lock(handle):
                    holder = os.read(handle, 20).decode(errors="replace").strip() or "unknown"
                    os.close(handle)
                    said = f"another run (process {holder}) is writing to this folder"
                    raise InputError(f"{folder}: {said}; wait for it or choose another folder") from None
                if _is_still(path, handle):
                    break
                os.close(handle)  # the previous owner removed the file before we locked it
        except OSError as error:
            raise InputError(f"{folder}: cannot be written ({error.strerror})") from None
        try:
            with suppress(OSError):  # of a full disk; the lock holds without our number
                os.ftruncate(handle, 0)
                os.write(handle, f"{os.getpid()}\n".encode())
            yield
        finally:
            _remove(path, handle)


def _remove(path: Path, handle: int) -> None:
    """Remove an open file and close it."""
    try:
        path.unlink(missing_ok=True)
        os.close(handle)
    except PermissionError:  # Windows removes no open file: neither ours nor one that the next owner has opened
        os.close(handle)
        with suppress(OSError):
            path.unlink()


def _is_still(path: Path, handle: int) -> bool:
    """Return whether a path still names the open file."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(handle))
    except FileNotFoundError:
        return False


def _prefix(target: Path) -> str:
    """Return the prefix of a target's temporary files on this machine; the process id follows."""
    return f".{target.stem[:LONGEST_STEM]}-{zlib.crc32(platform.node().encode()):08x}-"


def _sweep(target: Path) -> None:
    """Remove a target's temporary files whose processes on this machine have ended."""
    name = re.compile(re.escape(_prefix(target)) + r"(\d{1,10})-\w+" + re.escape(target.suffix))
    for path in target.parent.iterdir():
        match = name.fullmatch(path.name)
        if match and not system.is_alive(int(match[1])):
            path.unlink(missing_ok=True)
