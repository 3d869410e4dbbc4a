"""Tests of paired differences: McNemar, Wilcoxon, sign flips by world, and Holm's correction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from antdrive.base.optional import statistics_library
from antdrive.base.types import Floats, Ints

EXACT_WORLDS = 16  # up to this number of worlds, all 2^W flips are enumerated
FLIPS = 99_999  # random flips above that
SEED = 20_060_301  # of the random flips; a table always gives the same p-values
BLOCK = 4_000_000  # numbers held at once
TIE = 1e-9  # smaller differences, relative to the values, are rounding errors


def mcnemar(first: int, second: int) -> float:
    """Return the exact p-value of McNemar's test (McNemar 1947): a two-sided binomial test of the discordant pairs."""
    if first + second == 0:
        return 1.0
    tables = statistics_library("statsmodels.stats.contingency_tables")
    return float(min(1.0, tables.mcnemar([[0, first], [second, 0]], exact=True).pvalue))


def differences(first: Floats, second: Floats) -> Floats:
    """Return first minus second, (N,), with rounding errors set to 0 so that ties are ties."""
    raw = first - second
    return np.where(np.abs(raw) <= TIE * np.maximum(np.abs(first), np.abs(second)), 0.0, raw)


def signed_ranks(difference: Floats) -> Floats:
    """Return the signed rank of each difference's size among the nonzero ones, (N,); 0 stays 0."""
    ranks = np.zeros(len(difference))
    other = difference != 0
    ranks[other] = statistics_library("scipy.stats").rankdata(_levelled(np.abs(difference[other])))
    return np.asarray(np.sign(difference) * ranks)


def _levelled(sizes: Floats) -> Floats:
    """Level sizes that differ only by rounding, so that they share a rank."""
    largest = float(sizes.max(initial=0.0))
    return np.maximum(np.round(sizes / largest / TIE), 1.0) if largest > 0 else sizes


def wilcoxon(difference: Floats) -> float:
    """Return the two-sided p-value of Wilcoxon's signed rank test (Wilcoxon 1945), ignoring zeros.

    It is exact for up to 50 differences without ties and up to 13 with ties; beyond, the normal approximation.
    """
    other = difference[difference != 0]
    if not len(other):
        return 1.0
    levelled = np.sign(other) * _levelled(np.abs(other))
    return float(min(1.0, statistics_library("scipy.stats").wilcoxon(levelled).pvalue))


def rank_biserial(difference: Floats) -> float:
    """Return the matched-pairs rank biserial correlation (Kerby 2014), -1 to 1.

    It is the fraction of the rank sum from positive differences minus the fraction from negative ones.
    """
    ranks = signed_ranks(difference)
    total = float(np.abs(ranks).sum())
    return float(ranks.sum()) / total if total else 0.0


def flips_by_world(sums: Floats) -> Floats:
    """Return two-sided p-values (K,) of tests that flip the signs of all differences in a world together.

    If two planners are equivalent, swapping their names in a world changes nothing, however correlated its runs are. With
    signed ranks this is the test of Rosner, Glynn and Lee (2006).
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
    """Return the sum of the values (N,) in each world, (W,)."""
    return np.bincount(world, weights=values, minlength=worlds).astype(float)


def holm(p_values: Floats) -> Floats:
    """Return Holm's adjusted p-values (Holm 1979), (K,); nan stays nan and does not count."""
    adjusted, known = np.full(len(p_values), np.nan), ~np.isnan(p_values)
    if known.any():
        tests = statistics_library("statsmodels.stats.multitest")
        adjusted[known] = tests.multipletests(p_values[known], method="holm")[1]
    return adjusted
