"""Exceptions for invalid input, and the common checks that raise them."""

from __future__ import annotations

import math
from collections.abc import Iterable


class InputError(ValueError):
    """Invalid user input. The message is one line: where, what, and how to fix it.

    Attributes:
        key: what a person wrote wrongly, such as "planner.ants"; empty if the message says where
        problem: the message without key and place
        within: the key in a file, if the message has file and key
    """

    def __init__(self, message: str, key: str = "", problem: str = "", within: str = "") -> None:
        super().__init__(message)
        self.key, self.within = key, within
        self.problem = problem or message


class Terminated(SystemExit):
    """SIGTERM received while third-party code ran; not that code's error."""


class FieldError(ValueError):
    """An invalid value of a record's field or a function's argument. `str()` gives "key: problem".

    Attributes:
        key: the field, such as "radius" or "movers[0].walk.start"; empty for the whole value
        problem: the error and the fix
    """

    def __init__(self, key: str, problem: str) -> None:
        super().__init__(key, problem)
        self.key = key
        self.problem = problem

    def __str__(self) -> str:
        return f"{self.key}: {self.problem}" if self.key else self.problem

    def under(self, parent: str) -> FieldError:
        """Return the error with the key prefixed by that of its `parent`: "radius" under "robot" is "robot.radius"."""
        dot = "." if parent and self.key and not self.key.startswith("[") else ""
        return FieldError(f"{parent}{dot}{self.key}", self.problem)

    def as_input(self) -> InputError:
        """Return the error as one of a user's input, with the same key and message."""
        return InputError(visible(str(self)), self.key, visible(self.problem))


def input_error(*parts: str) -> InputError:
    """Return an InputError whose message is one line of printable characters."""
    return InputError(visible(": ".join(parts)))


def visible(text: str, kept: str = "") -> str:
    """Return a text in which escape codes show instead of acting: other characters than printable ones are spelled out.

    Args:
        text: the text, from anyone
        kept: characters to keep, such as line breaks
    """
    return "".join(c if c.isprintable() or c in kept else repr(c)[1:-1] for c in text)


def few(items: Iterable[object], most: int = 4, between: str = ", ") -> str:
    """Return the first of some items without repetitions, and how many more there are."""
    every = list(dict.fromkeys(map(str, items)))
    return between.join(every[:most]) + (f" and {len(every) - most} more" if len(every) > most else "")


def amount(count: float, thing: str) -> str:
    """Return a whole count with its noun, such as 1 run or 2 runs."""
    return f"{count:.0f} {thing}{'' if count == 1 else 's'}"


def require(
    key: str,
    value: float,
    *,
    at_least: float = -math.inf,
    above: float = -math.inf,
    at_most: float = math.inf,
    below: float = math.inf,
) -> None:
    """Raise FieldError for a number outside its range, or not finite."""
    bounds = [
        f"{word} {bound:.12g}"
        for word, bound in (("at least", at_least), ("greater than", above), ("at most", at_most), ("less than", below))
        if math.isfinite(bound)
    ]
    if not (at_least <= value <= at_most and above < value < below):
        raise FieldError(key, f"must be {' and '.join(bounds) or 'a finite number'}, got {value:g}")
