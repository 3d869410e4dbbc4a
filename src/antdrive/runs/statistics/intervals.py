"""Confidence intervals for proportions and their paired differences, and over worlds by bootstrap.

The bootstrap resamples worlds, then the runs within each world. Runs in one world are similar, so resampling single runs
gives too narrow intervals for statements about other worlds (Field and Welsh 2007). Only counted runs are resampled:
repetitions are no evidence and do not change an interval.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
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


def _by_world(
    prepare: Callable[[Floats], Callable[[Ints], Floats]],
    values: Floats,
    world: Ints,
    resamples: int = RESAMPLES,
    *,
    counted: Flags | None = None,
    confidence: float = CONFIDENCE,
) -> list[Interval]:
    """Return percentile intervals for a statistic of each column of values (N, K), ignoring nan.

    Args:
        prepare: takes values (n, k); returns a function of the draws (b, n) of a block of resamples to the statistics (b, k)
        values: the values (N, K)
        world: index of each run's world, (N,)
        resamples: number of resamples
        counted: the counted runs of each column (N, K); None: all
        confidence: coverage of the intervals
    """
    found = np.full((resamples, values.shape[1]), np.nan)
    for rows, columns in _columns_alike(values, counted):
        statistic, first = prepare(values[rows][:, columns]), 0
        for weights in resampled(world[rows], resamples):
            found[first : first + len(weights), columns] = statistic(weights)
            first += len(weights)
    return [_percentiles(column, confidence) for column in found.T]


def _means(values: Floats) -> Callable[[Ints], Floats]:
    known = ~np.isnan(values)
    filled = np.where(known, values, 0.0)

    def means(weights: Ints) -> Floats:
        totals = weights @ known.astype(float)
        with np.errstate(invalid="ignore"):
            return np.asarray((weights @ filled) / np.where(totals > 0, totals, np.nan))

    return means


def _medians(values: Floats) -> Callable[[Ints], Floats]:
    """Return a function of draws to medians: of each resample a position in a cumulative sum of sorted draws."""
    orders = [np.argsort(column, kind="stable")[: np.count_nonzero(~np.isnan(column))] for column in values.T]

    def median(weights: Ints, column: Floats, order: Ints) -> Floats:
        if not len(order):
            return np.full(len(weights), np.nan)
        running = np.cumsum(weights[:, order], axis=1)
        total = running[:, -1:]
        lower, upper = (2 * running >= total).argmax(axis=1), (2 * running > total).argmax(axis=1)
        return np.where(total[:, 0] > 0, (column[order[lower]] + column[order[upper]]) / 2, np.nan)

    return lambda weights: np.stack([median(weights, *one) for one in zip(values.T, orders, strict=True)], axis=1)


#: Percentile intervals for the mean and for the median of each column of values, see `_by_world`.
means_by_world, medians_by_world = functools.partial(_by_world, _means), functools.partial(_by_world, _medians)


def _columns_alike(values: Floats, counted: Flags | None) -> Iterator[tuple[Ints, Ints]]:
    """Yield counted rows and the columns that share them, so that these get the same resamples."""
    if counted is None:
        yield np.arange(len(values)), np.arange(values.shape[1])
        return
    masks, inverse = np.unique(counted, axis=1, return_inverse=True)
    for k, mask in enumerate(masks.T):
        if mask.any():
            yield np.flatnonzero(mask), np.flatnonzero(inverse.ravel() == k)


def _percentiles(statistics: Floats, confidence: float) -> Interval:
    known = statistics[~np.isnan(statistics)]
    if not len(known):
        return Interval(np.nan, np.nan)
    tail = (1 - confidence) / 2
    low, high = np.quantile(known, [tail, 1 - tail])
    return Interval(float(low), float(high))
