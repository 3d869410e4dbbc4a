"""The runs of a page as JSON: by column, with texts that repeat written once."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

SIGNIFICANT = 6  # digits of numbers in the page


def page_data(
    columns: Sequence[Mapping[str, Any]],
    shown: Sequence[str],
    titles: Mapping[str, str],
    good: Sequence[bool],
    planners: Sequence[str],
    **more: Any,
) -> str:
    """Return the runs of a page as JSON that may stand in a script element."""
    data = {
        "rows": len(good),
        "planners": list(planners),
        "columns": columns,
        "shown": shown,
        "titles": titles,
        "good": [int(value) for value in good],
        **more,
    }
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def json_column(name: str, values: Sequence[Any]) -> dict[str, Any] | None:
    """Return a column by its kind: numbers, or texts; None if it is empty."""
    if all(value is None for value in values):
        return None
    if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
        return {"name": name, "numbers": [_number(value) for value in values]}
    return {"name": name, **json_texts([None if value is None else str(value) for value in values])}


def json_texts(values: Sequence[str | None]) -> dict[str, Any]:
    """Return texts, or the different ones and the place of each row's text among them."""
    different = {value: k for k, value in enumerate(dict.fromkeys(value for value in values if value is not None))}
    if len(different) == len(values):
        return {"texts": list(values)}
    return {"texts": list(different), "places": [-1 if value is None else different[value] for value in values]}


def _number(value: Any) -> float | int | None:
    if value is None or not math.isfinite(value):
        return None
    if isinstance(value, int):
        return value
    rounded = float(f"{value:.{SIGNIFICANT}g}")
    return int(rounded) if rounded.is_integer() and abs(rounded) < 1e15 else rounded
