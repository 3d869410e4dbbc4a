"""The exceptions for wrong values, and the checks that raise them most often."""

from __future__ import annotations

import math


class InputError(ValueError):
    """Something that a person wrote is wrong; the message is one line that says where, and what would be right."""


class Terminated(SystemExit):
    """The process was told to end (SIGTERM) while other people's code ran in it; that code is not to blame."""


class FieldError(ValueError):
    """A record's field or a function's argument has a value that it cannot have.

    As text it is "key: problem".

    Attributes:
        key: the field, such as "radius" or "movers[0].walk.start"; empty where the whole value is wrong
        problem: what is wrong and what would be right
    """

    def __init__(self, key: str, problem: str) -> None:
        super().__init__(key, problem)
        self.key = key
        self.problem = problem

    def __str__(self) -> str:
        return f"{self.key}: {self.problem}" if self.key else self.problem

    def under(self, parent: str) -> FieldError:
        """The same problem, with the key as seen from outside: "radius" under "robot" is "robot.radius".

        Args:
            parent: the key of the record that holds this field
        """
        dot = "." if parent and self.key and not self.key.startswith("[") else ""
        return FieldError(f"{parent}{dot}{self.key}", self.problem)


def input_error(*parts: str) -> InputError:
    """An InputError on one line of printable characters."""
    return InputError("".join(c if c.isprintable() else repr(c)[1:-1] for c in ": ".join(parts)))


def require_positive(key: str, value: float) -> None:
    """Refuse a value that is not a finite number above 0."""
    if not 0 < value < math.inf:
        raise FieldError(key, f"must be greater than 0, got {value:g}")


def require_finite(key: str, value: float) -> None:
    """Refuse a value that is infinite or not a number."""
    if not math.isfinite(value):
        raise FieldError(key, f"must be a finite number, got {value}")


def require(
    key: str,
    value: float,
    *,
    at_least: float = -math.inf,
    above: float = -math.inf,
    at_most: float = math.inf,
    below: float = math.inf,
) -> None:
    """Refuse a number outside its range."""
    bounds = [
        f"{word} {bound:.12g}"
        for word, bound in (("at least", at_least), ("above", above), ("at most", at_most), ("below", below))
        if math.isfinite(bound)
    ]
    if not (at_least <= value <= at_most and above < value < below):
        raise FieldError(key, f"must be {' and '.join(bounds) or 'finite'}, got {value:g}")
