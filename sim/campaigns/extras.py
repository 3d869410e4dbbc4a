"""The packages that campaigns need and that a plain installation does not have."""

from __future__ import annotations

import importlib
from typing import Any

from antdrive.worlds.errors import InputError


def parquet_library() -> Any:
    """The module `pyarrow`, with `pyarrow.parquet` loaded.

    Raises:
        InputError: it is not installed.
    """
    _load("pyarrow.parquet", "campaigns", "a campaign's table is kept as Parquet")
    return importlib.import_module("pyarrow")


def cluster_library() -> Any:
    """The module `distributed`.

    Raises:
        InputError: it is not installed.
    """
    return _load("distributed", "cluster", "--dask spreads runs over machines with it")


def _load(module: str, extra: str, purpose: str) -> Any:
    """A module of an optional package; `extra` names the extra that installs it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        package = module.partition(".")[0]
        raise InputError(f"{package}: not installed; {purpose}: pip install 'antdrive[{extra}]'") from None
