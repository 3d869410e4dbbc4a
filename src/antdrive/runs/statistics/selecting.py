"""Choose runs by the values in a column, as `--where COLUMN=VALUE` says it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

from antdrive.base.errors import FieldError

LISTED = 20  # values that an error names
NONE = "none"  # stands for a run without a value


def column_named(names: Iterable[str], column: str) -> str:
    """The full name of a column.

    Raises:
        FieldError: there is none.
    """
    known = list(names)
    for name in (column, f"option.{column}"):
        if name in known:
            return name
    raise FieldError(column, f"no such column; choose from {', '.join(known)}")


def places_of(column: str, values: Sequence[Any], wanted: str) -> list[int]:
    """The rows whose value is wanted, at least one.

    Raises:
        FieldError: no row has such a value.
    """
    found = matching(values, wanted)
    if not found:
        raise FieldError(column, f"no run with {wanted!r}; the campaign has {described(values)}")
    return found


def matching(values: Sequence[Any], wanted: str) -> list[int]:
    """The rows whose value is wanted."""
    whole = [k for k, value in enumerate(values) if _text(value) == wanted]
    if whole:  # a name may hold a comma
        return whole
    tests = [_range(part) or part for part in wanted.split(",")]
    return [k for k, value in enumerate(values) if any(_fits(value, test) for test in tests)]


def described(values: Sequence[Any]) -> str:
    """The values of a column in a few words."""
    different = list(dict.fromkeys(values))
    numbers = [value for value in different if isinstance(value, int | float) and not isinstance(value, bool)]
    if len(numbers) > LISTED:
        return f"{min(numbers):g} to {max(numbers):g}"
    texts = [f"{value:g}" if isinstance(value, float) else _text(value) or NONE for value in different]
    return ", ".join(texts[:LISTED]) + (f" and {len(texts) - LISTED} more" if len(texts) > LISTED else "")


def _text(value: Any) -> str:
    return "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _range(text: str) -> tuple[float, float] | None:
    """The ends of a range such as "10..20"."""
    found = re.fullmatch(r"(.*?)\.\.(.*)", text)
    if found is None or not (found[1] or found[2]):
        return None
    try:
        return float(found[1] or -math.inf), float(found[2] or math.inf)
    except ValueError:
        return None


def _fits(value: Any, test: str | tuple[float, float]) -> bool:
    if isinstance(test, tuple):
        return isinstance(value, int | float) and not isinstance(value, bool) and test[0] <= value <= test[1]
    text = _text(value)
    if text == test or (isinstance(value, bool) and text == test.lower()) or (test == NONE and not text):
        return True
    try:
        return not isinstance(value, bool) and float(text) == float(test)
    except ValueError:
        return False
