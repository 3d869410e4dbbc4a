"""Ranges in a log: what was not measured stays apart from every range."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from antdrive.sim.log.scans import millimetres, ranges_of


@given(st.lists(st.floats(0.002, 65.0), max_size=20))
def test_ranges_come_back_within_half_a_millimetre(ranges: list[float]) -> None:
    given_ranges = np.array([*ranges, np.inf, -np.inf])
    back = ranges_of(millimetres(given_ranges))
    assert np.array_equal(back[-2:], [np.inf, -np.inf])
    assert np.abs(back[:-2] - given_ranges[:-2]).max(initial=0.0) <= 0.0005 + 1e-12
