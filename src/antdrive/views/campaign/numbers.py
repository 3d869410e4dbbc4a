"""Numbers as reports show them: shares in percent, values with three digits, p-values."""

from __future__ import annotations

import math

from antdrive.runs.statistics.proportions import Interval

NONE = "–"


def percent(share: float) -> str:
    """A share in percent, with one digit; 100.0 and 0.0 only where they are exact."""
    if math.isnan(share):
        return NONE
    shown = f"{100 * share + 0.0:.1f}"
    if shown == "100.0" and share < 1:
        return f"{math.floor(10_000 * share) / 100:.2f}"
    return "0.0" if shown == "-0.0" else shown


def percents(interval: Interval) -> str:
    """An interval of shares in percent."""
    return NONE if math.isnan(interval.low) else f"{percent(interval.low)} to {percent(interval.high)}"


def short(value: float) -> str:
    """A number with three significant digits."""
    if not math.isfinite(value):
        return NONE if math.isnan(value) else "∞"
    if value == 0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    text = f"{value:.{min(digits, 6)}f}"
    return "0" if float(text) == 0 else text


def with_interval(value: float, interval: Interval) -> str:
    """A number with its interval in brackets."""
    return f"{short(value)} ({short(interval.low)} to {short(interval.high)})"


def probability(p: float) -> str:
    """A p-value."""
    if math.isnan(p):
        return NONE
    return "< 0.001" if p < 0.001 else f"{p:.3f}"
