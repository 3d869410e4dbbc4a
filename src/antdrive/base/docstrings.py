"""Meanings of attributes, as docstrings give them."""

from __future__ import annotations

import inspect
import re


def meanings_of(kind: type) -> dict[str, str]:
    """Return the meaning of each attribute from the docstrings of a class and its bases; the class itself wins."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        section = inspect.cleandoc(vars(base).get("__doc__") or "").partition("\nAttributes:\n")[2]
        entries = re.split(r"^    (\w+): ", re.split(r"^\S", section, flags=re.MULTILINE)[0], flags=re.MULTILINE)[1:]
        found |= {name: " ".join(text.split()) for name, text in zip(entries[::2], entries[1::2], strict=True)}
    return found
