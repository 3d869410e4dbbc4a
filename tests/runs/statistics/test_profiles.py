"""Performance profiles and distributions, by hand and by counting."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from antdrive.base import FieldError
from antdrive.runs.statistics.profiles import distributions, performance_profiles

NAN = float("nan")
COSTS = arrays(
    float, st.tuples(st.integers(1, 8), st.integers(1, 4)), elements=st.sampled_from([NAN, 0.0, 1.0, 2.0, 3.5])
)


def test_a_profile_by_hand() -> None:
    first, second = performance_profiles(np.array([[1.0, 2.0], [6.0, 2.0], [1.0, NAN], [NAN, NAN]]))
    assert first.x.tolist() == [1, 3]
    assert first.share.tolist() == [0.5, 0.75]
    assert (second.x.tolist(), second.share.tolist()) == ([1, 2], [0.25, 0.5])
    assert [first.at(x) for x in (0.9, 1, 2.9, 3, 99)] == [0, 0.5, 0.5, 0.75, 0.75]


@given(COSTS, st.floats(1, 5))
def test_a_profile_counts_instances(cost: np.ndarray, x: float) -> None:
    for k, curve in enumerate(performance_profiles(cost)):
        fits = 0
        for row in cost:
            known = row[~np.isnan(row)]
            fits += bool(len(known)) and not np.isnan(row[k]) and (row[k] == known.min() or row[k] <= x * known.min())
        assert curve.at(x) == pytest.approx(fits / len(cost))


@given(COSTS)
def test_somebody_is_best_wherever_anybody_succeeds(cost: np.ndarray) -> None:
    solved = (~np.isnan(cost)).any(axis=1).mean()
    assert sum(curve.at(1.0) for curve in performance_profiles(cost)) >= solved - 1e-12


@given(COSTS)
def test_distributions_rise_to_the_share_of_successes(values: np.ndarray) -> None:
    for column, curve in zip(values.T, distributions(values), strict=True):
        assert curve.at(np.inf) == pytest.approx((~np.isnan(column)).mean())
        assert (np.diff(curve.share) > 0).all()


def test_no_instances_and_negative_costs_are_refused() -> None:
    with pytest.raises(FieldError, match="at least one"):
        distributions(np.zeros((0, 2)))
    with pytest.raises(FieldError, match="negative"):
        performance_profiles(np.array([[-1.0, 1.0]]))
