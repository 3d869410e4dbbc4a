"""Whether planners are not worse than a reference by more than a stated difference, and how many worlds it takes to show it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.optional import statistics_library
from antdrive.base.types import Floats
from antdrive.runs.statistics.bootstrap import RESAMPLES, means_by_world, medians_by_world
from antdrive.runs.statistics.comparison import ALPHA, SUCCESS, Direction, pairs_of, success_interval
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.runs.statistics.proportions import Interval
from antdrive.runs.statistics.significance import differences

POWER = 0.8  # the chance with which the needed worlds show it, if the two are equally good
TAIL_RESAMPLES = 20  # resamples beyond each end of an interval, at least
FEWEST_WORLDS = 6


@dataclass(frozen=True)
class NonInferiority:
    """A planner against the reference."""

    measure: str  # "success" or the name of a metric
    planner: str  # its label
    reference: str  # label of the planner that it is compared with
    allowed: float  # by how much the planner may be worse: a share of successes, or in the metric's unit
    # by how much it is better: difference of shares, or median of the paired differences; below 0 if worse
    advantage: float
    interval: Interval  # of the advantage, such that all intervals of the table hold at once with 95 %
    worlds: int  # number of worlds that the pairs are in
    # worlds that show it with a chance of 80 % if the two are equally good, from the spread between these
    # worlds
    needed: int

    @property
    def not_worse(self) -> bool:
        """Whether the whole interval lies above the allowed difference."""
        return self.interval.low > -self.allowed

    def as_dict(self) -> dict[str, Any]:
        """All fields as plain values, and whether the planner is not worse."""
        return {**dataclasses.asdict(self), "interval": list(self.interval), "not_worse": self.not_worse}


def not_worse(
    paired: PairedRuns, reference: str, measure: str, allowed: float, better: Direction
) -> list[NonInferiority]:
    """A row for each planner but the reference.

    Raises:
        FieldError: no difference, a measure without a better direction, or nothing to compare.
    """
    if not (math.isfinite(allowed) and allowed > 0):
        raise FieldError("allowed", f"must be above 0; got {allowed:g}")
    if better == "neither":
        raise FieldError("allowed", f"{measure} has no better direction")
    pairs = pairs_of(paired, reference)
    one = paired.planners.index(reference)
    others = [j if i == one else i for i, j in pairs]
    success = measure == SUCCESS
    values = paired.success.astype(float) if success else paired.values(measure)
    sign = -1 if better == "lower" else 1
    counted = np.stack([paired.counted(k, one) for k in others], axis=1)
    gaps = np.stack([sign * differences(values[:, k], values[:, one]) for k in others], axis=1)
    gaps[~counted] = np.nan
    confidence = 1 - ALPHA / len(others)
    resamples = max(RESAMPLES, math.ceil(TAIL_RESAMPLES / ((1 - confidence) / 2)))
    over = means_by_world if success else medians_by_world
    intervals = over(gaps, paired.world, resamples, counted=counted, confidence=confidence)
    rows = []
    for k, planner in enumerate(others):
        mask = ~np.isnan(gaps[:, k])
        gap = gaps[mask, k]
        interval = intervals[k]
        if success and len(gap):
            interval = success_interval(paired, mask, planner, one, intervals[k], confidence)
        rows.append(
            NonInferiority(
                measure=measure,
                planner=paired.planners[planner],
                reference=reference,
                allowed=allowed,
                advantage=float((np.mean if success else np.median)(gap)) if len(gap) else math.nan,
                interval=interval,
                worlds=paired.worlds_in(mask),
                needed=_needed(_world_means(gap, paired.world[mask]), allowed, 1 - confidence, success),
            )
        )
    return rows


def _world_means(gap: Floats, world: npt.NDArray[np.int64]) -> Floats:
    return np.array([gap[world == one].mean() for one in np.unique(world)])


def _needed(means: Sequence[float] | Floats, allowed: float, alpha: float, success: bool) -> int:
    """Worlds after which the interval's lower end is above `-allowed`; at least as many as a run without disagreement takes."""
    z = statistics_library("scipy.stats").norm.ppf([1 - alpha / 2, POWER])
    spread = float(np.std(means, ddof=1)) if len(means) > 1 else math.nan
    normal = 0 if math.isnan(spread) else math.ceil((z.sum() * spread / allowed) ** 2)
    # Where nothing fails, Wilson's interval over n worlds is as wide as z² / (n + z²).
    alike = math.ceil(z[0] ** 2 * (1 - allowed) / allowed) if success and allowed < 1 else 0
    return max(normal, alike, FEWEST_WORLDS)
