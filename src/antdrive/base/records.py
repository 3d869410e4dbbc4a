"""Records that are declared once: ranges stand in their annotations, meanings in the `Attributes` of their docstrings.

`antdrive.base.checks` reads both to check files, and for their JSON Schemas. This module is light: it needs no pydantic.
"""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any, cast, get_type_hints

from annotated_types import Interval

from antdrive.base.errors import FieldError

if TYPE_CHECKING:
    from pydantic import ConfigDict

#: The rules of records and files: no guessing of types, no unknown keys, no NaN and no infinity, also in nested records.
STRICT: ConfigDict = {"strict": True, "extra": "forbid", "allow_inf_nan": False, "frozen": True}


def attributes_of(docstring: str | None) -> dict[str, str]:
    """What the section `Attributes` of a docstring says of each field, on one line each."""
    section = inspect.cleandoc(docstring or "").partition("Attributes:\n")[2].split("\n\n")[0]
    entries = re.split(r"^    (\w+): ", section, flags=re.MULTILINE)[1:]
    return {name: " ".join(text.split()) for name, text in zip(entries[::2], entries[1::2], strict=True)}


@functools.cache
def ranges_of(kind: Hashable) -> Mapping[str, tuple[float, float]]:
    """The lowest and the highest value of each field of a record whose annotation has both."""
    found = {}
    for name, hint in get_type_hints(cast(Any, kind), include_extras=True).items():
        for limits in getattr(hint, "__metadata__", ()):
            if isinstance(limits, Interval):
                found[name] = (_number(limits.ge), _number(limits.le))
    return found


def _number(limit: Any) -> float:
    return float(limit)


def require_ranges(record: Any) -> None:
    """Refuse a record with a value outside the range of its field."""
    for key, (low, high) in ranges_of(cast(Hashable, type(record))).items():
        value = getattr(record, key)
        if not low <= value <= high:
            raise FieldError(key, f"must be between {low:g} and {high:g}, got {value:g}")
