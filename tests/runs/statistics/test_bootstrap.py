"""The bootstrap over worlds: what is drawn, medians of resamples, and that its intervals cover the truth."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from antdrive.runs.statistics import bootstrap
from antdrive.runs.statistics.bootstrap import means_by_world, medians_by_world, resampled


def drawn(world: np.ndarray, resamples: int = 200) -> np.ndarray:
    return np.concatenate(list(resampled(world, resamples)))


def test_worlds_are_drawn_and_then_runs_within() -> None:
    world = np.array([0, 0, 0, 1, 1, 2])
    weights = drawn(world, 2000)
    by_world = np.stack([weights[:, world == w].sum(axis=1) for w in range(3)], axis=1)
    times = by_world / [3, 2, 1]
    assert (times == np.round(times)).all(), "a world is drawn whole: with as many runs as it has"
    assert (times.sum(axis=1) == 3).all()
    assert times.mean(axis=0) == pytest.approx([1, 1, 1], abs=0.06)
    assert times.var(axis=0) == pytest.approx([2 / 3] * 3, abs=0.06), "binomial: 3 draws, chance 1/3"
    assert (weights[:, 0] != weights[:, 1]).any(), "runs within a world are drawn, too"


def test_blocks_do_not_change_what_one_block_would_be(monkeypatch: pytest.MonkeyPatch) -> None:
    world = np.array([0, 0, 1, 1, 1])
    assert (drawn(world) == drawn(world)).all()
    monkeypatch.setattr(bootstrap, "BLOCK", 50)
    assert len(drawn(world)) == 200


@settings(max_examples=30)
@given(st.lists(st.one_of(st.none(), st.integers(-9, 9)), min_size=1, max_size=9), st.integers(1, 3))
def test_medians_of_resamples_are_numpys(values: list[int | None], worlds: int) -> None:
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


def test_means_of_resamples_are_numpys() -> None:
    column, world = np.array([1.0, 0.0, np.nan, 1.0, 0.5]), np.array([0, 0, 1, 1, 2])
    by_hand = [np.nanmean(np.repeat(column, w)) for w in drawn(world, 60) if not np.isnan(np.repeat(column, w)).all()]
    assert means_by_world(column[:, None], world, 60)[0] == pytest.approx(np.quantile(by_hand, [0.025, 0.975]))


def simulated(by_world: bool, trials: int = 150) -> float:
    """How often the interval holds the median 0 of a quantity whose worlds differ more than their runs."""
    rng, held = np.random.default_rng(5), 0
    world = np.repeat(np.arange(30), 8)
    for _ in range(trials):
        values = rng.normal(0, 1, 30)[world] + rng.normal(0, 0.3, len(world))
        low, high = medians_by_world(values[:, None], world if by_world else np.arange(len(world)), 400)[0]
        held += low <= 0 <= high
    return held / trials


@pytest.mark.slow
def test_intervals_over_worlds_cover_the_truth_and_over_single_runs_do_not() -> None:
    assert simulated(by_world=True) > 0.88
    assert simulated(by_world=False) < 0.7
