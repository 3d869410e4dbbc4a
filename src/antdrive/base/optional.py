"""Optional packages: those of extras, imported on first use, and those that add planners and controllers."""

from __future__ import annotations

import importlib
from typing import Any

from antdrive.base.errors import InputError

#: The entry-point group for planners of other packages: an object with a method `plan`, or its class.
PLANNER_GROUP = "antdrive.planners"
#: The entry-point group for controllers of other packages: an object with methods `start` and `step`, or its class.
CONTROLLER_GROUP = "antdrive.controllers"


def optional(module: str, extra: str, purpose: str) -> Any:
    """Import a module of an optional package; raise InputError with the install command if it is missing."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        package = (error.name or module).partition(".")[0]
        raise InputError(f"{package}: not installed; {purpose}: pip install 'antdrive[{extra}]'") from None


def parquet_library() -> Any:
    """Import `pyarrow` with `pyarrow.parquet`."""
    purpose = "campaign tables are Parquet files"
    optional("pyarrow.parquet", "campaigns", purpose)
    return optional("pyarrow", "campaigns", purpose)


def statistics_library(name: str) -> Any:
    """Import a module of scipy or statsmodels."""
    return optional(name, "campaigns", "campaign statistics need it")
