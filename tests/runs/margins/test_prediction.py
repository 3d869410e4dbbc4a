"""The statistic of losses against distributions whose quantiles are known, and the search against losses that are known."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base.errors import FieldError
from antdrive.runs.margins.prediction import CLOSE, PROBABILITY, RESERVE, Calibration, least_margin, predicted_loss
from antdrive.runs.margins.trial import Loss

DRAWS = {
    "exponential": lambda rng: rng.exponential(1.0, 80),
    "normal": lambda rng: rng.normal(0.0, 1.0, 80),
    "uniform": lambda rng: rng.uniform(0.0, 1.0, 80),
    "gumbel": lambda rng: rng.gumbel(0.0, 1.0, 80),
}
#: What one of a thousand draws exceeds.
QUANTILES = {"exponential": 6.908, "normal": 3.090, "uniform": 0.999, "gumbel": 6.907}


@pytest.mark.parametrize("kind", DRAWS)
def test_the_prediction_is_near_the_quantile_of_known_distributions(kind: str) -> None:
    """On average within 15 %, from 80 draws; the largest draw alone is exceeded twelve times as often."""
    rng = np.random.default_rng(1)
    found = [predicted_loss(DRAWS[kind](rng), 1e-3) for _ in range(400)]
    assert np.mean(found) == pytest.approx(QUANTILES[kind], rel=0.15)


@given(st.lists(st.floats(-1, 1), min_size=20, max_size=60), st.floats(0.01, 10), st.floats(-5, 5))
def test_no_loss_exceeds_the_prediction_and_units_do_not_matter(
    losses: list[float], scale: float, shift: float
) -> None:
    found = predicted_loss(losses)
    assert found >= max(losses)
    assert predicted_loss(losses[::-1]) == found
    moved = predicted_loss([scale * loss + shift for loss in losses])
    assert moved == pytest.approx(scale * found + shift, rel=1e-4, abs=1e-4)


def test_rarer_losses_are_larger() -> None:
    losses = np.random.default_rng(0).normal(size=100)
    found = [predicted_loss(losses, probability) for probability in (0.1, 1e-2, 1e-3, 1e-4)]
    assert found == sorted(found)
    assert found[0] < found[-1]


def test_a_failed_drive_makes_any_loss_possible_and_few_drives_say_nothing() -> None:
    assert predicted_loss([0.01] * 79 + [math.inf]) == math.inf
    with pytest.raises(FieldError, match=r"losses: must be at least \d+, got 10"):
        predicted_loss([0.01] * 10)


def spread(loss: float) -> list[Loss]:
    """Losses whose prediction is exactly `loss`."""
    return [Loss(loss, loss)] * 80


def test_a_footprint_whose_losses_spread_is_bounded_by_its_disc() -> None:
    rng = np.random.default_rng(0)
    losses = [Loss(0.03 - each, 0.03) for each in rng.exponential(0.05, 80)]
    assert predicted_loss([each.footprint for each in losses]) > 0.03
    assert least_margin(lambda margin: losses, "k", 0.2).loss == 0.03


@given(st.floats(-0.2, 0.2), st.floats(0.0, 0.7), st.floats(0.0, 0.08))
def test_the_least_margin_is_found_where_the_loss_grows_with_it(base: float, growth: float, fails_below: float) -> None:
    tried: list[float] = []

    def losses_with(margin: float) -> Sequence[Loss]:
        tried.append(margin)
        return spread(math.inf if margin < fails_below else base + growth * margin)

    exact = max(0.0, fails_below, (base + RESERVE) / (1 - growth))
    if exact > 0.45:
        return
    found = least_margin(losses_with, "k", 0.2)
    assert found.margin in tried
    assert found.margin >= exact - 1e-9
    slack = CLOSE / (1 - growth) + 0.0021
    assert found.margin <= exact + slack
    assert found.margin == pytest.approx(round(found.margin, 3), abs=1e-12)
    assert (found.key, found.drives, found.probability) == ("k", 80, PROBABILITY)
    assert found.loss + found.reserve <= found.margin + 1e-12


def test_where_no_margin_is_enough_the_error_says_so() -> None:
    with pytest.raises(
        FieldError, match=r"margin: auto: none of the 12 margins tried, up to 0.25 m, leaves 0.01 m; lower"
    ):
        least_margin(lambda margin: spread(margin), "k", 0.2)
    with pytest.raises(FieldError, match=r"no margin up to 4 m"):
        least_margin(lambda margin: spread(math.inf), "k", 2.0)


def test_the_error_names_no_margin_that_was_not_tried() -> None:
    """Each try lacks a millimetre only, so that the next is little more, and the rounds are over long before 0.5 m."""
    tried: list[float] = []

    def losses_with(margin: float) -> Sequence[Loss]:
        tried.append(margin)
        return [Loss(margin - RESERVE + 0.001, margin - RESERVE + 0.001)] * 80

    with pytest.raises(FieldError, match=r"none of the 12 margins tried, up to 0\.\d+ m, leaves 0.01 m") as found:
        least_margin(losses_with, "k", 0.2)
    assert f"up to {max(tried):g} m" in str(found.value)
    assert max(tried) < 0.2


def test_a_larger_robot_may_get_a_larger_margin() -> None:
    found: Calibration = least_margin(lambda margin: spread(2.0), "k", 2.0)
    assert 2.0 + RESERVE <= found.margin <= 2.0 + RESERVE + CLOSE
