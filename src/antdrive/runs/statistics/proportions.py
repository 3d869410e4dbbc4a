"""Intervals for proportions and for the difference of two paired proportions."""

from __future__ import annotations

import math
from typing import NamedTuple

from antdrive.base.errors import FieldError
from antdrive.base.optional import statistics_library

CONFIDENCE = 0.95


class Interval(NamedTuple):
    """A confidence interval."""

    low: float  # its lower end
    high: float  # its upper end


def wilson(successes: int, total: int, confidence: float = CONFIDENCE) -> Interval:
    """Wilson's score interval for a proportion (Wilson 1927).

    Raises:
        FieldError: no trials, or more successes than trials.
    """
    if not 0 <= successes <= total or total < 1:
        raise FieldError("successes", f"must be 0 to total, and total at least 1; got {successes} of {total}")
    proportion = statistics_library("statsmodels.stats.proportion")
    low, high = proportion.proportion_confint(successes, total, alpha=1 - confidence, method="wilson")
    # At 0 and at `total` the interval ends exactly there; rounding may leave it 1e-17 off.
    return Interval(0.0 if successes == 0 else float(low), 1.0 if successes == total else float(high))


def paired_difference(both: int, first: int, second: int, neither: int, confidence: float = CONFIDENCE) -> Interval:
    """An interval for the difference of two paired proportions (Newcombe 1998, method 10).

    It combines the Wilson intervals of the two proportions and takes their correlation into account.
    """
    n = both + first + second + neither
    p1, p2 = (both + first) / n, (both + second) / n
    one, two = wilson(both + first, n, confidence), wilson(both + second, n, confidence)
    margins = (both + first) * (second + neither) * (both + second) * (first + neither)
    cross = float(both * neither - first * second)
    if cross > 0:  # Newcombe's continuity correction of a positive correlation
        cross = max(0.0, cross - n / 2)
    phi = cross / math.sqrt(margins) if margins else 0.0
    below = _combined(p1 - one.low, two.high - p2, phi)
    above = _combined(one.high - p1, p2 - two.low, phi)
    return Interval(p1 - p2 - below, p1 - p2 + above)


def _combined(x: float, y: float, phi: float) -> float:
    return math.sqrt(max(0.0, x * x - 2 * phi * x * y + y * y))
