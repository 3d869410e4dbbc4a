"""scipy and statsmodels, which come with the extra `antdrive[campaigns]`."""

from __future__ import annotations

import importlib
from typing import Any

from antdrive.worlds.errors import InputError


def library(name: str) -> Any:
    """A module of scipy or statsmodels, imported when it is first needed.

    Args:
        name: the module's full name, such as "scipy.stats"

    Raises:
        InputError: it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise InputError(f"{package} is not installed; pip install 'antdrive[campaigns]'") from None
