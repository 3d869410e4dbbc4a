"""Tests of paired differences: McNemar, Wilcoxon, signs flipped by world; Holm's correction for many of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.runs.statistics.libraries import library

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]

EXACT_WORLDS = 16  # up to so many worlds, all 2^W flips are tried
FLIPS = 99_999  # random flips above
SEED = 20_060_301  # of the random flips; the same table gives the same p-values
BLOCK = 4_000_000  # numbers held at once
TIE = 1e-9  # differences that are smaller than this, relative to the values, are rounding


def mcnemar(first: int, second: int) -> float:
    """The exact p-value of McNemar's test (McNemar 1947): a two-sided binomial test of the pairs that disagree."""
    if first + second == 0:
        return 1.0
    tables = library("statsmodels.stats.contingency_tables")
    return float(min(1.0, tables.mcnemar([[0, first], [second, 0]], exact=True).pvalue))


def differences(first: Floats, second: Floats) -> Floats:
    """First minus second, (N,); what is only rounding becomes 0, so that ties are seen as ties."""
    raw = first - second
    return np.where(np.abs(raw) <= TIE * np.maximum(np.abs(first), np.abs(second)), 0.0, raw)


def signed_ranks(difference: Floats) -> Floats:
    """The rank of each difference's size among those that are not 0, with its sign, (N,); 0 stays 0."""
    ranks = np.zeros(len(difference))
    other = difference != 0
    ranks[other] = library("scipy.stats").rankdata(_levelled(np.abs(difference[other])))
    return np.asarray(np.sign(difference) * ranks)


def _levelled(sizes: Floats) -> Floats:
    """Sizes, such that those which differ by rounding alone share a rank."""
    largest = float(sizes.max(initial=0.0))
    return np.maximum(np.round(sizes / largest / TIE), 1.0) if largest > 0 else sizes


def wilcoxon(difference: Floats) -> float:
    """The two-sided p-value of Wilcoxon's signed rank test (Wilcoxon 1945); zeros are left out.

    It is exact for up to 50 differences without ties and up to 13 with; beyond, the normal approximation.
    """
    other = difference[difference != 0]
    if not len(other):
        return 1.0
    levelled = np.sign(other) * _levelled(np.abs(other))
    return float(min(1.0, library("scipy.stats").wilcoxon(levelled).pvalue))


def rank_biserial(difference: Floats) -> float:
    """The matched-pairs rank biserial correlation (Kerby 2014), -1 to 1.

    It is the share of rank sum in favour of positive differences minus the share in favour of negative ones.
    """
    ranks = signed_ranks(difference)
    total = float(np.abs(ranks).sum())
    return float(ranks.sum()) / total if total else 0.0


def flips_by_world(sums: Floats) -> Floats:
    """Two-sided p-values (K,) of tests that flip the signs of all of a world's differences together.

    If two planners are alike, exchanging their names in a world changes nothing, however much the runs in that world
    depend on each other. With signed ranks this is the test of Rosner, Glynn and Lee (2006).
    """
    worlds, comparisons = sums.shape
    exact = worlds <= EXACT_WORLDS
    observed = np.abs(sums.sum(axis=0))
    slack = 1e-9 * np.maximum(np.abs(sums).sum(axis=0), 1.0)
    reached, tried = np.zeros(comparisons), 0
    for signs in _all_signs(worlds) if exact else _random_signs(worlds):
        reached += (np.abs(signs @ sums) >= observed - slack).sum(axis=0)
        tried += len(signs)
    return reached / tried if exact else (reached + 1) / (tried + 1)


def _all_signs(worlds: int) -> Iterator[Floats]:
    codes = np.arange(2**worlds)
    yield np.asarray(1.0 - 2.0 * ((codes[:, None] >> np.arange(worlds)) & 1))


def _random_signs(worlds: int) -> Iterator[Floats]:
    rng = np.random.default_rng(SEED)
    size = max(1, BLOCK // worlds)
    for start in range(0, FLIPS, size):
        coins = rng.integers(0, 2, (min(size, FLIPS - start), worlds), dtype=np.int8)
        yield np.asarray(1.0 - 2.0 * coins)


def sums_by_world(values: Floats, world: Ints, worlds: int) -> Floats:
    """The sum of the values (N,) of each world, (W,)."""
    return np.bincount(world, weights=values, minlength=worlds).astype(float)


def holm(p_values: Floats) -> Floats:
    """Holm's adjusted p-values (Holm 1979), (K,); nan stays nan and does not count.

    The k-th smallest of m is multiplied by m + 1 - k, and none is below a smaller one's.
    """
    adjusted = np.full(len(p_values), np.nan)
    known = np.flatnonzero(~np.isnan(p_values))
    order = known[np.argsort(p_values[known], kind="stable")]
    larger = np.arange(len(order), 0, -1) * p_values[order]
    adjusted[order] = np.minimum(np.maximum.accumulate(larger), 1.0) if len(order) else larger
    return adjusted
