"""Intervals for proportions, against published figures and the equations that define them."""

import itertools

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import assume, given

from antdrive.base import FieldError
from antdrive.runs.statistics.proportions import paired_difference, wilson

Z = 1.959963984540054  # the normal distribution's 97.5 % quantile


@pytest.mark.parametrize(
    ("successes", "total", "low", "high"),
    [(500, 500, 0.9924, 1.0), (10_000, 10_000, 0.9996, 1.0), (81, 263, 0.2553, 0.3662), (0, 20, 0.0, 0.1611)],
)
def test_wilson_gives_published_values(successes: int, total: int, low: float, high: float) -> None:
    # 81 of 263 and 0 of 20: Newcombe 1998, table I, method 3.
    assert wilson(successes, total) == pytest.approx((low, high), abs=5e-5)


@given(st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilsons_ends_solve_the_score_equation(trial: tuple[int, int]) -> None:
    successes, total = trial
    share, interval = successes / total, wilson(successes, total)
    assert 0 <= interval.low <= share <= interval.high <= 1
    for end in interval:
        assert abs(share - end) == pytest.approx(Z * np.sqrt(end * (1 - end) / total), abs=1e-8)


def test_no_trials_and_too_many_successes_are_refused() -> None:
    for successes, total in ((0, 0), (3, 2), (-1, 2)):
        with pytest.raises(FieldError, match="successes"):
            wilson(successes, total)


@given(st.tuples(*[st.integers(0, 60)] * 4).filter(lambda cells: sum(cells) > 0))
def test_the_paired_interval_holds_the_difference_and_is_mirrored(cells: tuple[int, int, int, int]) -> None:
    both, first, second, neither = cells
    found = paired_difference(both, first, second, neither)
    difference = (first - second) / sum(cells)
    assert -1 - 1e-9 <= found.low <= difference + 1e-9
    assert difference - 1e-9 <= found.high <= 1 + 1e-9
    mirrored = paired_difference(both, second, first, neither)
    assert mirrored == pytest.approx((-found.high, -found.low), abs=1e-9)


@given(st.integers(0, 8), st.integers(0, 8), st.integers(0, 8), st.integers(0, 8))
def test_without_correlation_the_paired_interval_is_that_of_independent_proportions(
    a: int, b: int, c: int, d: int
) -> None:
    from statsmodels.stats.proportion import confint_proportions_2indep

    both, first, second, neither = a * c, a * d, b * c, b * d  # a product of margins: no correlation
    n = both + first + second + neither
    assume(n > 0)
    independent = confint_proportions_2indep(both + first, n, both + second, n, method="newcomb", compare="diff")
    assert paired_difference(both, first, second, neither) == pytest.approx(independent, abs=1e-9)


def test_the_paired_interval_by_hand() -> None:
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


def coverage(cells: tuple[float, float, float, float], n: int) -> float:
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
def test_the_paired_interval_covers_the_truth(cells: tuple[float, float, float, float]) -> None:
    assert 0.93 <= coverage(cells, 20) <= 0.995
