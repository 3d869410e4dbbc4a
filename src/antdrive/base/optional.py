"""Packages that a plain installation does not have: they come with an extra, and are imported when they are first needed."""

from __future__ import annotations

import importlib
from typing import Any

from antdrive.base.errors import InputError


def optional(module: str, extra: str, purpose: str) -> Any:
    """A module of an optional package."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        package = (error.name or module).partition(".")[0]
        raise InputError(f"{package}: not installed; {purpose}: pip install 'antdrive[{extra}]'") from None


def parquet_library() -> Any:
    """The module `pyarrow`, with `pyarrow.parquet` loaded."""
    purpose = "a campaign's table is kept as Parquet"
    optional("pyarrow.parquet", "campaigns", purpose)
    return optional("pyarrow", "campaigns", purpose)


def statistics_library(name: str) -> Any:
    """A module of scipy or statsmodels."""
    return optional(name, "campaigns", "statistics of campaigns are computed with it")
