"""Planners that are not worse than another by more than was allowed, and the worlds that it takes to show it."""

import math

import numpy as np
import pytest

from antdrive.runs.statistics.comparison import compare_metric, compare_success
from antdrive.runs.statistics.noninferiority import _needed, not_worse
from antdrive.runs.statistics.pairing import PairedRuns
from tests.runs.made_up_campaign import Skill, made_up_runs


@pytest.fixture(scope="module")
def paired():
    return PairedRuns.of(made_up_runs({"a": Skill(0.9, 1.0), "b": Skill(0.9, 1.0), "c": Skill(0.5, 1.3)}, 40, 4))


def test_the_verdict_turns_at_the_end_of_the_interval(paired):
    for measure, better in (("success", "higher"), ("duration_s", "lower")):
        rows = not_worse(paired, "a", measure, 0.1, better)
        assert [(row.planner, row.reference) for row in rows] == [("b", "a"), ("c", "a")]
        end = -rows[0].interval.low
        assert [not_worse(paired, "a", measure, end * by, better)[0].not_worse for by in (0.999, 1.001)] == [
            False,
            True,
        ]
        assert rows[1].advantage < 0, "c is worse, whatever direction is better"
        assert not rows[1].not_worse


def test_one_planner_alone_has_the_interval_of_the_comparison(paired):
    two = PairedRuns.of(paired.table, ["b", "a"])
    assert not_worse(two, "a", "success", 0.1, "higher")[0].interval == compare_success(two, [(0, 1)])[0].interval
    plain = compare_metric(two, [(0, 1)], "duration_s", "lower")[0]
    assert not_worse(two, "a", "duration_s", 1, "higher")[0].interval == plain.interval
    three = not_worse(paired, "a", "success", 0.1, "higher")[0].interval
    assert three.low < plain.interval.low or three.low < compare_success(two, [(0, 1)])[0].interval.low, "two tests"


def test_needed_worlds_are_those_of_statsmodels_and_of_wilson():
    from statsmodels.stats.power import normal_sample_size_one_tail

    means = np.random.default_rng(1).normal(0, 0.2, 50)
    known = normal_sample_size_one_tail(0.05, 0.8, 0.025 / 3, std_null=float(np.std(means, ddof=1)))
    assert _needed(means, 0.05, 0.05 / 3, success=False) == math.ceil(known)
    n = _needed(np.zeros(9), 0.02, 0.05, success=True)
    z2 = 1.959963984540054**2
    assert z2 / (n + z2) <= 0.02 < z2 / (n - 1 + z2)
