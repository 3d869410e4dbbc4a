"""Files read whole, up to a size that no sensible file exceeds."""

from __future__ import annotations

import os
from pathlib import Path

from antdrive.base.errors import input_error


def read_bytes(path: str | os.PathLike[str], max_bytes: int, kind: str = "a file") -> bytes:
    """The content of a file that people name.

    Raises:
        InputError: the file is missing, a folder, too large, or may not be read.
    """
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
