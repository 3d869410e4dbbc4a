"""Success rates and medians of planners, on instances that all of them ran.

Performance profiles and empirical distributions are over all instances; failures count in the denominator.
"""

from __future__ import annotations

import collections
import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.types import Flags, Floats
from antdrive.runs.statistics.intervals import NOWHERE, Interval, means_by_world, medians_by_world, wilson
from antdrive.runs.statistics.pairing import PairedRuns


@dataclass(frozen=True)
class PlannerSuccess:
    """Success of a planner on the instances that every planner ran."""

    planner: str  # its label
    runs: int  # number of all its runs
    elsewhere: int  # runs omitted because another planner lacks their instance
    # distinct runs among the remaining ones: if the seed changes no drive, one run represents all seeds
    counted: int
    successes: int  # number of counted runs that succeeded
    interval: Interval  # Wilson's 95 % interval of the fraction
    # 95 % interval over worlds: by bootstrap, or Wilson's for whole worlds if all runs ended alike; nan if no world
    # has two counted runs, or there is one world
    over_worlds: Interval
    outcomes: Mapping[str, int]  # number of all runs by outcome

    @property
    def fraction(self) -> float:
        """The fraction of counted runs that succeeded."""
        return self.successes / self.counted

    @property
    def across_worlds(self) -> Interval:
        """The interval over worlds, or over runs if each world has one."""
        return self.interval if math.isnan(self.over_worlds.low) else self.over_worlds

    def as_dict(self) -> dict[str, Any]:
        """Return all fields and the fraction (`share`) as plain values."""
        fields = dataclasses.asdict(self)
        return {
            **fields,
            "share": self.fraction,
            "interval": list(self.interval),
            "over_worlds": list(self.over_worlds),
        }


def success_table(paired: PairedRuns) -> list[PlannerSuccess]:
    """Return a row for each planner, in the order of the runs.

    Fractions are over the instances that every planner ran; if there are none, over each planner's own instances.
    """
    outcomes = paired.table.texts("outcome")
    shared = paired.shared if paired.shared.any() else np.ones(len(paired.row), dtype=np.bool_)
    masks = [paired.counted(k, within=shared) for k in range(len(paired.planners))]
    over = means_by_world(paired.success.astype(float), paired.world, counted=np.stack(masks, axis=1))
    rows = []
    for k, (planner, mask) in enumerate(zip(paired.planners, masks, strict=True)):
        here = paired.row[paired.present[:, k], k]
        counted, successes = int(mask.sum()), int(paired.success[mask, k].sum())
        rows.append(
            PlannerSuccess(
                planner=planner,
                runs=len(here),
                elsewhere=int((paired.present[:, k] & ~shared).sum()),
                counted=counted,
                successes=successes,
                interval=wilson(successes, counted),
                over_worlds=_over_worlds(paired, mask, successes, over[k]),
                outcomes=dict(sorted(collections.Counter(outcomes[row] for row in here).items())),
            )
        )
    return rows


def _over_worlds(paired: PairedRuns, mask: Flags, successes: int, resampled: Interval) -> Interval:
    """Return the interval of a fraction over worlds. If all runs ended alike, resamples do not vary: count whole worlds."""
    if not paired.several_in_worlds(mask):
        return NOWHERE
    if successes in (0, int(mask.sum())):
        worlds = paired.worlds_in(mask)
        return wilson(worlds if successes else 0, worlds)
    return resampled


def common_medians(paired: PairedRuns, metrics: Sequence[str]) -> tuple[int, dict[str, list[tuple[float, Interval]]]]:
    """Return the median of each metric and planner over the instances in which every planner succeeded.

    Returns:
        The number of those instances, and for each metric the planners' medians with 95 % bootstrap intervals.
    """
    common = paired.success.all(axis=1) & paired.counted(*range(len(paired.planners)))
    medians = {}
    for metric in metrics:
        values = paired.values(metric)[common]
        if len(values) and np.isfinite(values).all():
            intervals = medians_by_world(values, paired.world[common])
            medians[metric] = list(zip(np.median(values, axis=0).tolist(), intervals, strict=True))
    return int(common.sum()), medians


class StepCurve(NamedTuple):
    """A rising step function."""

    x: Floats  # positions of the steps, ascending, (M,)
    fraction: Floats  # value from there on, 0 to 1, (M,)


def performance_profiles(cost: Floats) -> list[StepCurve]:
    """Return for each planner the fraction of instances solved at no more than x times the best cost.

    Performance profiles after Dolan and Moré (2002). An instance that no planner solves counts as unsolved by all.
    """
    _validate(cost)
    if np.nanmin(cost, initial=0.0) < 0:
        raise FieldError("cost", "must not be negative: ratios to the best would be undefined")
    best = np.where(np.isnan(cost), np.inf, cost).min(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(cost == best, 1.0, cost / best)
    ratio[np.isnan(cost)] = np.nan
    return distributions(ratio)


def distributions(values: Floats) -> list[StepCurve]:
    """Return for each planner the fraction of instances solved with a value of at most x."""
    _validate(values)
    curves = []
    for column in values.T:
        x, counts = np.unique(column[np.isfinite(column)], return_counts=True)
        curves.append(StepCurve(x, np.cumsum(counts) / len(column)))
    return curves


def _validate(values: Floats) -> None:
    if values.ndim != 2 or not values.size:
        raise FieldError("values", f"must be instances by planners, at least one of each; got shape {values.shape}")
