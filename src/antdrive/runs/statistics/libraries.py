"""scipy and statsmodels, which come with the extra `antdrive[campaigns]`."""

from __future__ import annotations

from typing import Any

from antdrive.base.optional import optional


def library(name: str) -> Any:
    """A module of scipy or statsmodels, imported when it is first needed.

    Raises:
        InputError: it is not installed.
    """
    return optional(name, "campaigns", "statistics of campaigns are computed with it")
