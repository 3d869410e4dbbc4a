"""Tests, intervals, bootstraps and profiles, against exhaustive counts, published figures and other libraries."""

import itertools
import math

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis.extra.numpy import arrays

from antdrive.runs.statistics import intervals, significance
from antdrive.runs.statistics.intervals import means_by_world, medians_by_world, paired_difference, resampled, wilson
from antdrive.runs.statistics.significance import (
    differences,
    flips_by_world,
    holm,
    mcnemar,
    rank_biserial,
    signed_ranks,
    sums_by_world,
    wilcoxon,
)
from antdrive.runs.statistics.success import distributions, performance_profiles


def exhaustive(scores):
    """The share of all sign flips whose sum is as far from 0 as the sum found."""
    signs = np.array(list(itertools.product((1, -1), repeat=len(scores))))
    return float(np.mean(np.abs(signs @ np.array(scores)) >= abs(sum(scores)) - 1e-9))


@pytest.mark.parametrize(("first", "second"), [(0, 0), (1, 0), (3, 3), (9, 1), (2, 14), (60, 35)])
def test_mcnemar_is_the_binomial_sum(first, second):
    n, least = first + second, min(first, second)
    tail = sum(math.comb(n, k) for k in range(least + 1)) / 2**n
    assert mcnemar(first, second) == pytest.approx(min(1.0, 2 * tail))


@settings(max_examples=40)  # scipy permutes where values are equal
@given(st.lists(st.integers(-6, 6), min_size=1, max_size=10))
def test_wilcoxon_is_the_permutation_of_signed_ranks(values):
    others = [value for value in values if value]
    places = sorted(abs(value) for value in others)
    ranks = [
        math.copysign(np.mean([k + 1 for k, size in enumerate(places) if size == abs(value)]), value)
        for value in others
    ]
    assert wilcoxon(np.array(values, dtype=float)) == pytest.approx(exhaustive(ranks) if ranks else 1.0)


def test_wilcoxons_textbook_example():
    # Heights of cross- and self-fertilised maize (Darwin 1876), in eighths of an inch; W- = 24, two-sided p = 0.041.
    maize = np.array([49, -67, 8, 16, 6, 23, 28, 41, 14, 29, 56, 24, 75, 60, -48], dtype=float)
    assert signed_ranks(maize)[maize < 0].sum() == -24
    assert wilcoxon(maize) == pytest.approx(0.0413, abs=5e-5)
    assert rank_biserial(maize) == pytest.approx((96 - 24) / 120)


@given(st.lists(st.floats(-5, 5), max_size=12))
def test_effects_lie_between_minus_1_and_1_and_are_mirrored(values):
    array = np.array(values)
    assert -1 <= rank_biserial(array) <= 1
    assert rank_biserial(-array) == -rank_biserial(array)


def test_all_in_favour_is_an_effect_of_1_and_none_is_0():
    assert rank_biserial(np.array([0.1, 3.0, 0.0])) == 1
    assert rank_biserial(np.zeros(3)) == 0
    assert wilcoxon(np.zeros(3)) == 1


def test_rounding_is_a_tie():
    found = differences(np.array([0.1 + 0.2, 1.0, 0.4, 1.1]), np.array([0.3, 1.0, 0.3, 1.0]))
    assert found[:2].tolist() == [0.0, 0.0]
    assert found[2] != found[3], "as numbers they differ in the last digit"
    assert signed_ranks(found).tolist() == [0, 0, 1.5, 1.5]
    assert differences(np.zeros(2), np.zeros(2)).tolist() == [0.0, 0.0]
    assert differences(np.zeros(0), np.zeros(0)).tolist() == []


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(-3, 3)), min_size=1, max_size=12))
def test_few_worlds_are_flipped_in_every_way(pairs):
    world, values = np.array([w for w, _ in pairs]), np.array([v for _, v in pairs], dtype=float)
    sums = sums_by_world(values, world, 4)
    by_hand = [sum(v for w, v in pairs if w == k) for k in range(4)]
    assert sums.tolist() == by_hand
    assert flips_by_world(np.stack([sums, -sums], axis=1)) == pytest.approx([exhaustive(by_hand)] * 2)


def test_random_flips_agree_with_scipys_permutation_test(monkeypatch):
    from scipy.stats import permutation_test

    rng = np.random.default_rng(3)
    scores = rng.normal(0.4, 1, 12)
    exact = permutation_test((scores,), np.sum, permutation_type="samples", n_resamples=5000, vectorized=False).pvalue
    monkeypatch.setattr(significance, "EXACT_WORLDS", 0)
    assert flips_by_world(scores[:, None])[0] == pytest.approx(exact, abs=0.005)
    assert flips_by_world(scores[:, None])[0] == flips_by_world(scores[:, None])[0]


def test_where_no_world_differs_nothing_is_shown():
    assert flips_by_world(np.zeros((0, 2))).tolist() == [1, 1]


def test_random_flips_never_give_0():
    assert flips_by_world(np.ones((60, 1)))[0] == pytest.approx(1 / (significance.FLIPS + 1))


def test_holm_by_hand():
    assert holm(np.array([0.01, 0.04, 0.03, 0.005])) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert np.isnan(holm(np.array([np.nan, 0.04]))[0])
    assert holm(np.array([np.nan, 0.04]))[1] == pytest.approx(0.04)


def drawn(world, resamples=200):
    return np.concatenate(list(resampled(world, resamples)))


def test_worlds_are_drawn_and_then_runs_within():
    world = np.array([0, 0, 0, 1, 1, 2])
    weights = drawn(world, 2000)
    by_world = np.stack([weights[:, world == w].sum(axis=1) for w in range(3)], axis=1)
    times = by_world / [3, 2, 1]
    assert (times == np.round(times)).all(), "a world is drawn whole: with as many runs as it has"
    assert (times.sum(axis=1) == 3).all()
    assert times.mean(axis=0) == pytest.approx([1, 1, 1], abs=0.06)
    assert times.var(axis=0) == pytest.approx([2 / 3] * 3, abs=0.06), "binomial: 3 draws, chance 1/3"
    assert (weights[:, 0] != weights[:, 1]).any(), "runs within a world are drawn, too"


def test_blocks_do_not_change_what_one_block_would_be(monkeypatch):
    world = np.array([0, 0, 1, 1, 1])
    assert (drawn(world) == drawn(world)).all()
    monkeypatch.setattr(intervals, "BLOCK", 50)
    assert len(drawn(world)) == 200


@settings(max_examples=30)
@given(st.lists(st.one_of(st.none(), st.integers(-9, 9)), min_size=1, max_size=9), st.integers(1, 3))
def test_medians_of_resamples_are_numpys(values, worlds):
    column = np.array([np.nan if value is None else value for value in values])
    world = np.arange(len(column)) % worlds
    by_hand = []
    for weights in drawn(world, 60):
        sample = np.repeat(column, weights)
        if (~np.isnan(sample)).any():
            by_hand.append(np.nanmedian(sample))
    found = medians_by_world(column[:, None], world, 60)[0]
    if by_hand:
        assert found == pytest.approx(np.quantile(by_hand, [0.025, 0.975]))
    else:
        assert np.isnan(found).all()


def test_means_of_resamples_are_numpys():
    column, world = np.array([1.0, 0.0, np.nan, 1.0, 0.5]), np.array([0, 0, 1, 1, 2])
    by_hand = [np.nanmean(np.repeat(column, w)) for w in drawn(world, 60) if not np.isnan(np.repeat(column, w)).all()]
    assert means_by_world(column[:, None], world, 60)[0] == pytest.approx(np.quantile(by_hand, [0.025, 0.975]))


def simulated(by_world, trials=150):
    """How often the interval holds the median 0 of a quantity whose worlds differ more than their runs."""
    rng, held = np.random.default_rng(5), 0
    world = np.repeat(np.arange(30), 8)
    for _ in range(trials):
        values = rng.normal(0, 1, 30)[world] + rng.normal(0, 0.3, len(world))
        low, high = medians_by_world(values[:, None], world if by_world else np.arange(len(world)), 400)[0]
        held += low <= 0 <= high
    return held / trials


@pytest.mark.slow
def test_intervals_over_worlds_cover_the_truth_and_over_single_runs_do_not():
    assert simulated(by_world=True) > 0.88
    assert simulated(by_world=False) < 0.7


Z = 1.959963984540054  # the normal distribution's 97.5 % quantile


@pytest.mark.parametrize(
    ("successes", "total", "low", "high"),
    [(500, 500, 0.9924, 1.0), (10_000, 10_000, 0.9996, 1.0), (81, 263, 0.2553, 0.3662), (0, 20, 0.0, 0.1611)],
)
def test_wilson_gives_published_values(successes, total, low, high):
    # 81 of 263 and 0 of 20: Newcombe 1998, table I, method 3.
    assert wilson(successes, total) == pytest.approx((low, high), abs=5e-5)


@given(st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilsons_ends_solve_the_score_equation(trial):
    successes, total = trial
    share, interval = successes / total, wilson(successes, total)
    assert 0 <= interval.low <= share <= interval.high <= 1
    for end in interval:
        assert abs(share - end) == pytest.approx(Z * np.sqrt(end * (1 - end) / total), abs=1e-8)


@given(st.tuples(*[st.integers(0, 60)] * 4).filter(lambda cells: sum(cells) > 0))
def test_the_paired_interval_holds_the_difference_and_is_mirrored(cells):
    both, first, second, neither = cells
    found = paired_difference(both, first, second, neither)
    difference = (first - second) / sum(cells)
    assert -1 - 1e-9 <= found.low <= difference + 1e-9
    assert difference - 1e-9 <= found.high <= 1 + 1e-9
    mirrored = paired_difference(both, second, first, neither)
    assert mirrored == pytest.approx((-found.high, -found.low), abs=1e-9)


@given(st.integers(0, 8), st.integers(0, 8), st.integers(0, 8), st.integers(0, 8))
def test_without_correlation_the_paired_interval_is_that_of_independent_proportions(a, b, c, d):
    from statsmodels.stats.proportion import confint_proportions_2indep

    both, first, second, neither = a * c, a * d, b * c, b * d  # a product of margins: no correlation
    n = both + first + second + neither
    assume(n > 0)
    independent = confint_proportions_2indep(both + first, n, both + second, n, method="newcomb", compare="diff")
    assert paired_difference(both, first, second, neither) == pytest.approx(independent, abs=1e-9)


def test_the_paired_interval_by_hand():
    # 40 both, 10 and 4 alone, 46 neither: shares 0.50 and 0.44; Wilson 0.40383 to 0.59617 and 0.34670 to 0.53769;
    # phi = (40 * 46 - 10 * 4 - 50) / sqrt(50 * 50 * 44 * 56) = 0.705104.
    below = 0.09617**2 - 2 * 0.705104 * 0.09617 * 0.09769 + 0.09769**2
    above = 0.09617**2 - 2 * 0.705104 * 0.09617 * 0.09330 + 0.09330**2
    found = paired_difference(40, 10, 4, 46)
    assert found == pytest.approx((0.06 - below**0.5, 0.06 + above**0.5), abs=2e-5)
    # A negative correlation, 10 * 10 - 40 * 40, is not corrected for continuity and widens the interval.
    wide = paired_difference(10, 40, 40, 10)
    end = wilson(50, 100).high - 0.5
    assert wide == pytest.approx((-end * 3.2**0.5, end * 3.2**0.5), abs=1e-9)


def coverage(cells, n):
    """The probability, summed over all tables of n pairs, that the interval holds the true difference."""
    from scipy.stats import multinomial

    total, truth = 0.0, cells[1] - cells[2]
    for both, first, second in itertools.product(range(n + 1), repeat=3):
        if both + first + second <= n:
            counts = (both, first, second, n - both - first - second)
            interval = paired_difference(*counts)
            if interval.low <= truth <= interval.high:
                total += multinomial.pmf(counts, n, cells)
    return total


@pytest.mark.slow
@pytest.mark.parametrize("cells", [(0.6, 0.2, 0.1, 0.1), (0.8, 0.1, 0.05, 0.05), (0.3, 0.3, 0.1, 0.3)])
def test_the_paired_interval_covers_the_truth(cells):
    assert 0.93 <= coverage(cells, 20) <= 0.995


NAN = float("nan")
COSTS = arrays(
    float, st.tuples(st.integers(1, 8), st.integers(1, 4)), elements=st.sampled_from([NAN, 0.0, 1.0, 2.0, 3.5])
)


def value_at(curve, x):
    return curve.fraction[curve.x <= x].max(initial=0.0)


def test_a_profile_by_hand():
    first, second = performance_profiles(np.array([[1.0, 2.0], [6.0, 2.0], [1.0, NAN], [NAN, NAN]]))
    assert first.x.tolist() == [1, 3]
    assert first.fraction.tolist() == [0.5, 0.75]
    assert (second.x.tolist(), second.fraction.tolist()) == ([1, 2], [0.25, 0.5])
    assert [value_at(first, x) for x in (0.9, 1, 2.9, 3, 99)] == [0, 0.5, 0.5, 0.75, 0.75]


@given(COSTS, st.floats(1, 5))
def test_a_profile_counts_instances(cost, x):
    for k, curve in enumerate(performance_profiles(cost)):
        fits = 0
        for row in cost:
            known = row[~np.isnan(row)]
            fits += bool(len(known)) and not np.isnan(row[k]) and (row[k] == known.min() or row[k] <= x * known.min())
        assert value_at(curve, x) == pytest.approx(fits / len(cost))


@given(COSTS)
def test_distributions_rise_to_the_share_of_successes(values):
    for column, curve in zip(values.T, distributions(values), strict=True):
        assert value_at(curve, np.inf) == pytest.approx((~np.isnan(column)).mean())
        assert (np.diff(curve.fraction) > 0).all()
