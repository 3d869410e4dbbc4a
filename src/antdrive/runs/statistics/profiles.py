"""Curves over all instances: performance profiles and empirical distributions. Failures count in the denominator."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.types import Floats


class StepCurve(NamedTuple):
    """A curve that rises in steps."""

    x: Floats  # where it rises, ascending, (M,)
    share: Floats  # its value from there on, 0 to 1, (M,)

    def at(self, x: float) -> float:
        """The curve's value."""
        place = int(np.searchsorted(self.x, x, side="right"))
        return float(self.share[place - 1]) if place else 0.0


def performance_profiles(cost: Floats) -> list[StepCurve]:
    """For each planner the share of instances that it solves at no more than x times the best cost.

    Performance profiles after Dolan and Moré (2002). An instance that nobody solves counts as unsolved by all.

    Raises:
        FieldError: no instances, or a negative cost.
    """
    _check(cost)
    if np.nanmin(cost, initial=0.0) < 0:
        raise FieldError("cost", "must not be negative; a ratio to the best is not defined")
    best = np.where(np.isnan(cost), np.inf, cost).min(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(cost == best, 1.0, cost / best)
    ratio[np.isnan(cost)] = np.nan
    return distributions(ratio)


def distributions(values: Floats) -> list[StepCurve]:
    """For each planner the share of instances that it solves with a value of at most x.

    Raises:
        FieldError: no instances.
    """
    _check(values)
    curves = []
    for column in values.T:
        x, counts = np.unique(column[np.isfinite(column)], return_counts=True)
        curves.append(StepCurve(x, np.cumsum(counts) / len(column)))
    return curves


def _check(values: Floats) -> None:
    if values.ndim != 2 or not values.size:
        raise FieldError("values", f"must be instances by planners, at least one of each; got shape {values.shape}")
