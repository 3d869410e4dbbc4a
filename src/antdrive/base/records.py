"""Record declarations: ranges in annotations, descriptions in the docstring's `Attributes`.

`antdrive.base.checks` uses both to validate files and to build JSON Schemas. This module does not import pydantic.
"""

from __future__ import annotations

import functools
import inspect
import math
import re
from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast, get_args, get_origin, get_type_hints

from annotated_types import Interval

from antdrive.base.errors import FieldError

if TYPE_CHECKING:
    from pydantic import ConfigDict

R = TypeVar("R")
ANGLE_ROUNDING = 1e-3  # people round pi to 3.142 and 2 pi to 6.284 [rad]

#: Rules of records and files, nested ones included: no type coercion, no unknown keys, no NaN or infinity.
STRICT: ConfigDict = {"strict": True, "extra": "forbid", "allow_inf_nan": False, "frozen": True}


def attributes_of(docstring: str | None) -> dict[str, str]:
    """Return the one-line description of each field from a docstring's `Attributes` section."""
    section = inspect.cleandoc(docstring or "").partition("Attributes:\n")[2].split("\n\n")[0]
    entries = re.split(r"^    (\w+): ", section, flags=re.MULTILINE)[1:]
    return {name: " ".join(text.split()) for name, text in zip(entries[::2], entries[1::2], strict=True)}


def meanings_of(kind: type) -> dict[str, str]:
    """Return the description of each field from the docstrings of a class and its bases; the class itself wins."""
    return {
        name: text for base in reversed(kind.__mro__) for name, text in attributes_of(vars(base).get("__doc__")).items()
    }


@functools.cache
def ranges_of(kind: Hashable) -> Mapping[str, tuple[float, float]]:
    """Return the range of each field of a record whose annotation has both limits."""
    ranges = {}
    for name, hint in get_type_hints(cast(Any, kind), include_extras=True).items():
        for limits in getattr(hint, "__metadata__", ()):
            if isinstance(limits, Interval):
                low, high = cast("tuple[Any, Any]", (limits.ge, limits.le))
                ranges[name] = (float(low), float(high))
    return ranges


def unchecked_copy(record: R, **changes: Any) -> R:
    """Return a copy of a dataclass with other fields or cached values, unchecked: they are made of checked ones."""
    made = object.__new__(type(record))
    vars(made).update({name: getattr(record, name) for name in cast(Any, record).__dataclass_fields__} | changes)
    return made


def clamp_angle(record: Any, key: str, most: float) -> None:
    """Set an angle that was rounded beyond its largest magnitude `most`, such as 3.142 for pi, to that limit [rad]."""
    value = getattr(record, key)
    if most < abs(value) <= most + ANGLE_ROUNDING:
        object.__setattr__(record, key, math.copysign(most, value))


@functools.cache
def _choices_of(kind: Hashable) -> Mapping[str, tuple[Any, ...]]:
    """Return the choices of each field of a record whose type is a Literal."""
    hints = get_type_hints(cast(Any, kind))
    return {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Literal}


def require_choices(record: Any) -> None:
    """Raise FieldError for the first field that is none of the choices of its type."""
    for key, choices in _choices_of(cast(Hashable, type(record))).items():
        value, words = getattr(record, key), [repr(choice) for choice in choices]
        if value not in choices:
            raise FieldError(key, f"must be {', '.join(words[:-1])} or {words[-1]}, got {value!r}")


def require_ranges(record: Any) -> None:
    """Raise FieldError for the first field outside its range."""
    for key, (low, high) in ranges_of(cast(Hashable, type(record))).items():
        value = getattr(record, key)
        if not low <= value <= high:
            raise FieldError(key, f"must be between {low:g} and {high:g}, got {value:g}")
