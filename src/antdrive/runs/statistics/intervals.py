"""Confidence intervals for proportions and their paired differences, and over worlds by bootstrap.

The bootstrap resamples worlds, then the runs within each world. Runs in one world are similar, so resampling single runs
gives too narrow intervals for statements about other worlds (Field and Welsh 2007). Only counted runs are resampled:
repetitions are no evidence and do not change an interval.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.optional import statistics_library
from antdrive.base.types import Flags, Floats, Ints

CONFIDENCE = 0.95


class Interval(NamedTuple):
    """A confidence interval."""

    low: float  # lower end
    high: float  # upper end


NOWHERE = Interval(math.nan, math.nan)


def wilson(successes: int, total: int, confidence: float = CONFIDENCE) -> Interval:
    """Return Wilson's score interval for a proportion (Wilson 1927)."""
    if not 0 <= successes <= total or total < 1:
        raise FieldError("successes", f"must be 0 to total, and total at least 1; got {successes} of {total}")
    proportion = statistics_library("statsmodels.stats.proportion")
    low, high = proportion.proportion_confint(successes, total, alpha=1 - confidence, method="wilson")
    # For 0 or `total` successes the interval ends exactly at 0 or 1; rounding may leave 1e-17.
    return Interval(0.0 if successes == 0 else float(low), 1.0 if successes == total else float(high))


def paired_difference(both: int, first: int, second: int, neither: int, confidence: float = CONFIDENCE) -> Interval:
    """Return an interval for the difference of two paired proportions (Newcombe 1998, method 10).

    It combines the Wilson intervals of both proportions and includes their correlation.
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


RESAMPLES = 2000
SEED = 19_790_101  # the same table gives the same intervals
BLOCK = 4_000_000  # numbers held at once


def resampled(world: Ints, resamples: int = RESAMPLES, seed: int = SEED) -> Iterator[Ints]:
    """Yield blocks (b, N) with the number of draws of each run, `resamples` rows in total."""
    rng = np.random.default_rng(seed)
    names, inverse, sizes = np.unique(world, return_inverse=True, return_counts=True)
    members = np.split(np.argsort(inverse, kind="stable"), np.cumsum(sizes)[:-1])
    rows = max(1, BLOCK // max(1, len(world)))
    for start in range(0, resamples, rows):
        count = min(rows, resamples - start)
        drawn = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), size=count)
        weights = np.zeros((count, len(world)), dtype=np.int64)
        for k, runs in enumerate(members):
            weights[:, runs] = rng.multinomial(drawn[:, k] * len(runs), np.full(len(runs), 1 / len(runs)))
        yield weights


def medians_by_world(
    values: Floats,
    world: Ints,
    resamples: int = RESAMPLES,
    *,
    counted: Flags | None = None,
    confidence: float = CONFIDENCE,
) -> list[Interval]:
    """Return percentile intervals for the median of each column of values (N, K), ignoring nan."""
    statistics = np.full((resamples, values.shape[1]), np.nan)
    for rows, columns in _columns_alike(values, counted):
        chosen = [_Sorted.of(values[rows, k]) for k in columns]
        first = 0
        for weights in resampled(world[rows], resamples):
            for k, column in zip(columns, chosen, strict=True):
                statistics[first : first + len(weights), k] = column.medians(weights)
            first += len(weights)
    return [_percentiles(statistics[:, k], confidence) for k in range(values.shape[1])]


def means_by_world(
    values: Floats,
    world: Ints,
    resamples: int = RESAMPLES,
    *,
    counted: Flags | None = None,
    confidence: float = CONFIDENCE,
) -> list[Interval]:
    """Return percentile intervals for the mean of each column of values (N, K), ignoring nan."""
    statistics = np.full((resamples, values.shape[1]), np.nan)
    for rows, columns in _columns_alike(values, counted):
        known = ~np.isnan(values[rows][:, columns])
        filled = np.where(known, values[rows][:, columns], 0.0)
        first = 0
        for weights in resampled(world[rows], resamples):
            totals = weights @ known.astype(float)
            with np.errstate(invalid="ignore"):
                statistics[first : first + len(weights), columns] = (weights @ filled) / np.where(
                    totals > 0, totals, np.nan
                )
            first += len(weights)
    return [_percentiles(statistics[:, k], confidence) for k in range(values.shape[1])]


def _columns_alike(values: Floats, counted: Flags | None) -> Iterator[tuple[Ints, Ints]]:
    """Yield counted rows and the columns that share them, so that these get the same resamples."""
    if counted is None:
        yield np.arange(len(values)), np.arange(values.shape[1])
        return
    masks, inverse = np.unique(counted, axis=1, return_inverse=True)
    for k, mask in enumerate(masks.T):
        if mask.any():
            yield np.flatnonzero(mask), np.flatnonzero(inverse.ravel() == k)


class _Sorted:
    """A column's sorted values: the median of every resample is a position in a cumulative sum of weights."""

    def __init__(self, values: Floats, order: Ints) -> None:
        self.values = values
        self.order = order

    @classmethod
    def of(cls, column: Floats) -> _Sorted:
        order = np.argsort(column, kind="stable")[: int((~np.isnan(column)).sum())]
        return cls(column[order], order)

    def medians(self, weights: Ints) -> Floats:
        """Return the median of each resample; nan without values."""
        if not len(self.values):
            return np.full(len(weights), np.nan)
        running = np.cumsum(weights[:, self.order], axis=1)
        total = running[:, -1:]
        lower, upper = (2 * running >= total).argmax(axis=1), (2 * running > total).argmax(axis=1)
        return np.where(total[:, 0] > 0, (self.values[lower] + self.values[upper]) / 2, np.nan)


def _percentiles(statistics: Floats, confidence: float) -> Interval:
    known = statistics[~np.isnan(statistics)]
    if not len(known):
        return Interval(np.nan, np.nan)
    tail = (1 - confidence) / 2
    low, high = np.quantile(known, [tail, 1 - tail])
    return Interval(float(low), float(high))
