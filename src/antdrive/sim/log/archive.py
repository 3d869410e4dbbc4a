"""Open a log that anybody may have written: sizes are checked before anything is read, and every failure is one line."""

from __future__ import annotations

import math
import os
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError, InputError, input_error

Archive: TypeAlias = zipfile.ZipFile

MAX_BYTES = 1 << 29  # of all members together, and of one array, when unpacked; an hour of a drive takes 0.1 GB
MAX_MEMBERS = 64
LONGEST_PROBLEM = 300  # characters of a message


@contextmanager
def guarded_log(path: str | Path) -> Iterator[Archive]:
    """The archive of a log; whatever goes wrong inside becomes one line that names the file.

    Raises:
        InputError: there is no such file, it is no regular file, it is not a rollout, or reading it fails.
    """
    try:
        with open(path, "rb", opener=_without_waiting) as raw:
            kind = os.fstat(raw.fileno())
            if not stat.S_ISREG(kind.st_mode):
                raise input_error(str(path), "not a rollout (no regular file)")
            if kind.st_size > MAX_BYTES:
                raise input_error(str(path), f"not a rollout (larger than {MAX_BYTES >> 20} MB)")
            with zipfile.ZipFile(raw) as archive:
                _check_members(archive)
                yield archive
    except FileNotFoundError:
        raise input_error(str(path), "no such file") from None
    except InputError as error:
        text = str(error)
        raise (error if text.startswith(f"{path}: ") else _problem(path, text)) from None
    except FieldError as error:
        raise _problem(path, str(error)) from None
    except KeyError as error:
        raise _problem(path, f"not a rollout: {error.args[0]}") from None
    except MemoryError:
        raise _problem(path, "not a rollout (needs more memory than there is)") from None
    except RecursionError:
        raise _problem(path, "not a rollout (nested too deeply)") from None
    except Exception as error:
        # Archives and headers of strangers fail in many ways: zlib and LZMA errors, unknown versions, syntax errors.
        lines = (getattr(error, "strerror", None) or str(error)).splitlines()
        raise _problem(path, f"not a rollout ({lines[0] if lines else type(error).__name__})") from None


def read_array(archive: Archive, name: str) -> npt.NDArray[Any]:
    """An array of a log, without pickles and only as large as its member.

    Raises:
        KeyError: there is no such array.
        FieldError: the member is no array, or not as large as its header says.
        Exception: whatever else numpy and zipfile find; `guarded_log` turns it into one line.
    """
    if f"{name}.npy" not in archive.namelist():
        raise KeyError(f"{name} is not a file in the archive")
    info = archive.getinfo(f"{name}.npy")
    with archive.open(info) as member:
        major, _ = np.lib.format.read_magic(member)
        header = np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = header(member)
        if dtype.hasobject or any(n < 0 for n in shape):
            raise FieldError(name, f"must hold numbers, found {dtype}")
        wanted = math.prod(shape) * dtype.itemsize
        content = member.read(min(wanted, MAX_BYTES) + 1)
        if len(content) != wanted:
            raise FieldError(name, f"its header promises {wanted} bytes, the file has {_more(len(content), wanted)}")
    flat = np.frombuffer(content, dtype=dtype) if wanted else np.empty(0, dtype=dtype)
    return flat.reshape(shape, order="F" if fortran else "C")


def _without_waiting(path: str, flags: int) -> int:
    """Open a file; a pipe without a writer would wait for ever."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _check_members(archive: Archive) -> None:
    members = archive.infolist()
    if len(members) > MAX_MEMBERS:
        raise ValueError(f"more than {MAX_MEMBERS} members")
    if len({info.filename for info in members}) < len(members):
        raise ValueError("two members have the same name")
    if sum(info.file_size for info in members) > MAX_BYTES:
        raise ValueError(f"larger than {MAX_BYTES >> 20} MB when unpacked")
    for info in members:
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{info.filename}: compressed in another way than numpy's")
        if info.flag_bits & 1:
            raise ValueError(f"{info.filename}: encrypted")


def _more(found: int, wanted: int) -> str:
    return "more" if found > wanted else str(found)


def _problem(path: str | Path, text: str) -> InputError:
    """An error on one line that is not too long."""
    return input_error(str(path), text if len(text) <= LONGEST_PROBLEM else f"{text[:LONGEST_PROBLEM]}...")
