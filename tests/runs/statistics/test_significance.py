"""Tests of paired differences, against exhaustive permutation and textbook values."""

import itertools
import math

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from antdrive.runs.statistics import significance
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


def exhaustive(scores: list[float]) -> float:
    """The share of all sign flips whose sum is as far from 0 as the sum found."""
    signs = np.array(list(itertools.product((1, -1), repeat=len(scores))))
    return float(np.mean(np.abs(signs @ np.array(scores)) >= abs(sum(scores)) - 1e-9))


@pytest.mark.parametrize(("first", "second"), [(0, 0), (1, 0), (3, 3), (9, 1), (2, 14), (60, 35)])
def test_mcnemar_is_the_binomial_sum(first: int, second: int) -> None:
    n, least = first + second, min(first, second)
    tail = sum(math.comb(n, k) for k in range(least + 1)) / 2**n
    assert mcnemar(first, second) == pytest.approx(min(1.0, 2 * tail))


@given(st.integers(0, 5), st.integers(0, 5))
def test_mcnemar_is_the_permutation_test_of_single_pairs(first: int, second: int) -> None:
    assert mcnemar(first, second) == pytest.approx(exhaustive([1.0] * first + [-1.0] * second))


@settings(max_examples=40)  # scipy permutes where values are equal
@given(st.lists(st.integers(-6, 6), min_size=1, max_size=10))
def test_wilcoxon_is_the_permutation_of_signed_ranks(values: list[int]) -> None:
    others = [value for value in values if value]
    places = sorted(abs(value) for value in others)
    ranks = [
        math.copysign(np.mean([k + 1 for k, size in enumerate(places) if size == abs(value)]), value)
        for value in others
    ]
    assert wilcoxon(np.array(values, dtype=float)) == pytest.approx(exhaustive(ranks) if ranks else 1.0)


def test_wilcoxons_textbook_example() -> None:
    # Heights of cross- and self-fertilised maize (Darwin 1876), in eighths of an inch; W- = 24, two-sided p = 0.041.
    maize = np.array([49, -67, 8, 16, 6, 23, 28, 41, 14, 29, 56, 24, 75, 60, -48], dtype=float)
    assert signed_ranks(maize)[maize < 0].sum() == -24
    assert wilcoxon(maize) == pytest.approx(0.0413, abs=5e-5)
    assert rank_biserial(maize) == pytest.approx((96 - 24) / 120)


@given(st.lists(st.floats(-5, 5), max_size=12))
def test_effects_lie_between_minus_1_and_1_and_are_mirrored(values: list[float]) -> None:
    array = np.array(values)
    assert -1 <= rank_biserial(array) <= 1
    assert rank_biserial(-array) == -rank_biserial(array)


def test_all_in_favour_is_an_effect_of_1_and_none_is_0() -> None:
    assert rank_biserial(np.array([0.1, 3.0, 0.0])) == 1
    assert rank_biserial(np.zeros(3)) == 0
    assert wilcoxon(np.zeros(3)) == 1


def test_rounding_is_a_tie() -> None:
    found = differences(np.array([0.1 + 0.2, 1.0, 0.4, 1.1]), np.array([0.3, 1.0, 0.3, 1.0]))
    assert found[:2].tolist() == [0.0, 0.0]
    assert found[2] != found[3], "as numbers they differ in the last digit"
    assert signed_ranks(found).tolist() == [0, 0, 1.5, 1.5]
    assert differences(np.zeros(2), np.zeros(2)).tolist() == [0.0, 0.0]
    assert differences(np.zeros(0), np.zeros(0)).tolist() == []


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(-3, 3)), min_size=1, max_size=12))
def test_few_worlds_are_flipped_in_every_way(pairs: list[tuple[int, int]]) -> None:
    world, values = np.array([w for w, _ in pairs]), np.array([v for _, v in pairs], dtype=float)
    sums = sums_by_world(values, world, 4)
    by_hand = [sum(v for w, v in pairs if w == k) for k in range(4)]
    assert sums.tolist() == by_hand
    assert flips_by_world(np.stack([sums, -sums], axis=1)) == pytest.approx([exhaustive(by_hand)] * 2)


def test_random_flips_agree_with_scipys_permutation_test(monkeypatch: pytest.MonkeyPatch) -> None:
    from scipy.stats import permutation_test

    rng = np.random.default_rng(3)
    scores = rng.normal(0.4, 1, 12)
    exact = permutation_test((scores,), np.sum, permutation_type="samples", n_resamples=5000, vectorized=False).pvalue
    monkeypatch.setattr(significance, "EXACT_WORLDS", 0)
    assert flips_by_world(scores[:, None])[0] == pytest.approx(exact, abs=0.005)
    assert flips_by_world(scores[:, None])[0] == flips_by_world(scores[:, None])[0]


def test_where_no_world_differs_nothing_is_shown() -> None:
    assert flips_by_world(np.zeros((0, 2))).tolist() == [1, 1]


def test_random_flips_never_give_0() -> None:
    assert flips_by_world(np.ones((60, 1)))[0] == pytest.approx(1 / (significance.FLIPS + 1))


def test_holm_by_hand() -> None:
    assert holm(np.array([0.01, 0.04, 0.03, 0.005])) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert np.isnan(holm(np.array([np.nan, 0.04]))[0])
    assert holm(np.array([np.nan, 0.04]))[1] == pytest.approx(0.04)


def test_holm_is_that_of_statsmodels() -> None:
    from statsmodels.stats.multitest import multipletests  # collects garbage at every call, so that it is called once

    p_values = np.random.default_rng(8).random(40).round(1) ** 4  # with ties, zeros and ones
    assert holm(p_values) == pytest.approx(multipletests(p_values, method="holm")[1])


@given(st.lists(st.floats(0, 1), max_size=10))
def test_holm_keeps_the_order_and_never_lowers(values: list[float]) -> None:
    given_p, adjusted = np.array(values), holm(np.array(values))
    assert (adjusted >= given_p).all()
    assert (adjusted <= 1).all()
    assert (np.diff(adjusted[np.argsort(given_p, kind="stable")]) >= 0).all()
