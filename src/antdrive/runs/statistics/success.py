"""How often each planner succeeds, and its medians: both on instances that all of the planners share.

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
    """How often a planner succeeds, on the instances that every planner ran."""

    planner: str  # its label
    runs: int  # number of all its runs
    elsewhere: int  # how many of them are left out, because some other planner lacks a run of their instance
    # number of different runs among the rest: where the seed changes no drive, one run stands for all seeds
    counted: int
    successes: int  # how many of the counted runs succeeded
    interval: Interval  # Wilson's 95 % interval for the share
    # 95 % interval over worlds: by bootstrap, or Wilson's for whole worlds if all runs ended alike; nan where
    # no world has two counted runs, or there is one world
    over_worlds: Interval
    outcomes: Mapping[str, int]  # number of all runs by outcome

    @property
    def fraction(self) -> float:
        """The fraction of counted runs that succeeded."""
        return self.successes / self.counted

    @property
    def across_worlds(self) -> Interval:
        """The interval over worlds, or the one over runs where each world has one."""
        return self.interval if math.isnan(self.over_worlds.low) else self.over_worlds

    def as_dict(self) -> dict[str, Any]:
        """All fields as plain values, and the share."""
        fields = dataclasses.asdict(self)
        return {
            **fields,
            "share": self.fraction,
            "interval": list(self.interval),
            "over_worlds": list(self.over_worlds),
        }


def success_table(paired: PairedRuns) -> list[PlannerSuccess]:
    """A row for each planner, in the order of the runs.

    Shares are over the instances that every planner ran; where there is none, over each planner's own.
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
    """The interval of a share over worlds. Where all runs ended alike, no resample differs; whole worlds are counted then."""
    if not paired.several_in_worlds(mask):
        return NOWHERE
    if successes in (0, int(mask.sum())):
        worlds = paired.worlds_in(mask)
        return wilson(worlds if successes else 0, worlds)
    return resampled


def common_medians(paired: PairedRuns, metrics: Sequence[str]) -> tuple[int, dict[str, list[tuple[float, Interval]]]]:
    """The median of each metric and planner over the instances in which every planner succeeded.

    Returns:
        The number of those instances, and for each metric the medians of the planners with 95 % bootstrap intervals.
    """
    common = paired.success.all(axis=1) & paired.counted(*range(len(paired.planners)))
    found = {}
    for metric in metrics:
        values = paired.values(metric)[common]
        if len(values) and np.isfinite(values).all():
            intervals = medians_by_world(values, paired.world[common])
            found[metric] = list(zip(np.median(values, axis=0).tolist(), intervals, strict=True))
    return int(common.sum()), found


class StepCurve(NamedTuple):
    """A curve that rises in steps."""

    x: Floats  # where it rises, ascending, (M,)
    fraction: Floats  # its value from there on, 0 to 1, (M,)

    def at(self, x: float) -> float:
        """The curve's value."""
        place = int(np.searchsorted(self.x, x, side="right"))
        return float(self.fraction[place - 1]) if place else 0.0


def performance_profiles(cost: Floats) -> list[StepCurve]:
    """For each planner the share of instances that it solves at no more than x times the best cost.

    Performance profiles after Dolan and Moré (2002). An instance that nobody solves counts as unsolved by all.
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
    """For each planner the share of instances that it solves with a value of at most x."""
    _check(values)
    curves = []
    for column in values.T:
        x, counts = np.unique(column[np.isfinite(column)], return_counts=True)
        curves.append(StepCurve(x, np.cumsum(counts) / len(column)))
    return curves


def _check(values: Floats) -> None:
    if values.ndim != 2 or not values.size:
        raise FieldError("values", f"must be instances by planners, at least one of each; got shape {values.shape}")
