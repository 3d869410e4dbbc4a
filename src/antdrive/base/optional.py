"""Packages that a plain installation does not have: they come with an extra, and are imported when they are first needed."""

from __future__ import annotations

import importlib
from typing import Any

from antdrive.base.errors import InputError


def optional(module: str, extra: str, purpose: str) -> Any:
    """A module of an optional package.

    Raises:
        InputError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        package = (error.name or module).partition(".")[0]
        raise InputError(f"{package}: not installed; {purpose}: pip install 'antdrive[{extra}]'") from None
