"""The packages that campaigns need and that a plain installation does not have."""

from __future__ import annotations

from typing import Any

from antdrive.base.optional import optional


def parquet_library() -> Any:
    """The module `pyarrow`, with `pyarrow.parquet` loaded.

    Raises:
        InputError: it is not installed.
    """
    purpose = "a campaign's table is kept as Parquet"
    optional("pyarrow.parquet", "campaigns", purpose)
    return optional("pyarrow", "campaigns", purpose)


def cluster_library() -> Any:
    """The module `distributed`.

    Raises:
        InputError: it is not installed.
    """
    return optional("distributed", "cluster", "--dask spreads runs over machines with it")
