"""Paired comparison of planners: success and any metric, and non-inferiority to a reference."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.optional import statistics_library
from antdrive.base.types import Flags, Floats
from antdrive.runs.statistics.intervals import (
    CONFIDENCE,
    NOWHERE,
    RESAMPLES,
    Interval,
    means_by_world,
    medians_by_world,
    paired_difference,
)
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.runs.statistics.significance import (
    differences,
    flips_by_world,
    holm,
    mcnemar,
    rank_biserial,
    signed_ranks,
    sums_by_world,
    wilcoxon,
)

Pairs: TypeAlias = Sequence[tuple[int, int]]
Direction: TypeAlias = Literal["lower", "higher", "neither"]

SUCCESS = "success"
ALPHA = 0.05


@dataclass(frozen=True)
class PairedComparison:
    """Two planners on the runs that they share."""

    measure: str  # "success" or the name of a metric
    first: str  # label of the first planner
    second: str  # label of the second planner
    direction: Direction  # whether lower or higher values are better, or neither
    pairs: int  # number of pairs
    worlds: int  # number of worlds of these pairs
    dropped: int  # pairs omitted because not both succeeded; 0 for success
    unpaired: int  # runs of either planner without a partner
    # pairs in which the first planner's value is better; with direction "neither", lower
    first_wins: int
    second_wins: int  # pairs in which the second planner's value is better, or lower
    ties: int  # pairs with equal values
    difference: float  # first minus second: of success rates, or the median of the paired differences
    interval: Interval  # 95 % interval of the difference
    # matched-pairs rank biserial correlation, -1 to 1; positive if the first planner wins, or is lower if no direction is
    # better
    effect: float
    p: float  # exact McNemar or Wilcoxon signed rank, over pairs; nan without pairs
    p_worlds: float  # sign flips by world; nan if no world has two pairs, or there is one world
    p_holm: float = math.nan  # `p` with Holm's correction over all comparisons of this measure
    p_worlds_holm: float = math.nan  # `p_worlds` with Holm's correction

    @property
    def decisive_p(self) -> float:
        """The larger of the two corrected p-values; nan without pairs."""
        return max((p for p in (self.p_holm, self.p_worlds_holm) if not math.isnan(p)), default=math.nan)

    @property
    def decided(self) -> str:
        """The planner favoured by `effect`, if both corrected p-values are below 0.05; else empty."""
        if not self.decisive_p < ALPHA or self.effect == 0:
            return ""
        return self.first if self.effect > 0 else self.second

    @property
    def better(self) -> str:
        """The better planner, if that is decided and one direction is better; else empty."""
        return "" if self.direction == "neither" else self.decided

    @property
    def lower(self) -> str:
        """The planner with the lower value, if that is decided and no direction is better; else empty."""
        return self.decided if self.direction == "neither" else ""

    def as_dict(self) -> dict[str, Any]:
        """Return all fields as plain values, and the planner that is better or lower."""
        fields = {**dataclasses.asdict(self), "interval": list(self.interval)}
        return {**fields, "better": self.better, "lower": self.lower}


def pairs_of(paired: PairedRuns, against: str | None = None) -> list[tuple[int, int]]:
    """Return the pairs of planners to compare, as indices."""
    labels = paired.planners
    if len(labels) < 2:
        raise FieldError("planners", f"only {labels[0]}; a comparison needs two, antdrive report takes one")
    if against is not None and against not in labels:
        raise FieldError("against", f"unknown planner {against!r}; choose from {', '.join(labels)}")
    chosen = [
        (i, j)
        for i, j in itertools.combinations(range(len(labels)), 2)
        if against is None or against in (labels[i], labels[j])
    ]
    if not any((paired.present[:, i] & paired.present[:, j]).any() for i, j in chosen):
        raise FieldError("planners", "no two share a run: same world, task, settings and seed")
    return chosen


def compare_success(paired: PairedRuns, pairs: Pairs) -> list[PairedComparison]:
    """Compare success: exact McNemar, Newcombe's interval, and both again over whole worlds."""
    masks = [paired.counted(i, j) for i, j in pairs]
    raw = [paired.success[:, i].astype(float) - paired.success[:, j] for i, j in pairs]
    gaps = np.stack([np.where(mask, gap, np.nan) for mask, gap in zip(masks, raw, strict=True)], axis=1)
    by_world = means_by_world(gaps, paired.world, counted=np.stack(masks, axis=1))
    rows = []
    for k, (i, j) in enumerate(pairs):
        mask, gap = masks[k], gaps[masks[k], k]
        first, second = int((gap > 0).sum()), int((gap < 0).sum())
        n = int(mask.sum())
        interval = success_interval(paired, mask, i, j, by_world[k]) if n else NOWHERE
        difference = (first - second) / n if n else math.nan
        effect = (first - second) / (first + second) if first + second else 0.0
        p = mcnemar(first, second) if n else math.nan
        rows.append(_row(paired, SUCCESS, "higher", (i, j), mask, 0, (first, second), difference, interval, effect, p))
    return _corrected(paired, rows, masks, gaps)


def success_interval(
    paired: PairedRuns, mask: Flags, i: int, j: int, resampled: Interval, confidence: float = CONFIDENCE
) -> Interval:
    """Return an interval for the difference of two planners' success, valid over runs and over worlds."""
    first, second = paired.success[mask, i], paired.success[mask, j]
    both, one, other = (int(mask.sum()) for mask in (first & second, first & ~second, ~first & second))
    interval = paired_difference(both, one, other, len(first) - both - one - other, confidence)
    if not paired.several_in_worlds(mask):
        return interval
    if len(np.unique(first.astype(int) - second)) == 1:  # resamples do not vary: a world counts as one pair
        worlds = paired.worlds_in(mask)
        both, one, other = (round(worlds * count / len(first)) for count in (both, one, other))
        resampled = paired_difference(both, one, other, worlds - both - one - other, confidence)
    return Interval(min(interval.low, resampled.low), max(interval.high, resampled.high))


def compare_metric(paired: PairedRuns, pairs: Pairs, metric: str, better: Direction) -> list[PairedComparison]:
    """Compare a metric on the pairs in which both succeeded: Wilcoxon, median difference, rank biserial."""
    values = paired.values(metric)
    if not np.isfinite(values).any():
        raise FieldError("metric", f"{metric}: no successful run has a value")
    masks, gaps, ranks, shared = [], [], [], []
    for i, j in pairs:
        shared.append(paired.counted(i, j))
        masks.append(shared[-1] & np.isfinite(values[:, i]) & np.isfinite(values[:, j]))
        gap, rank = np.full(len(values), np.nan), np.full(len(values), np.nan)
        gap[masks[-1]] = differences(values[masks[-1], i], values[masks[-1], j])
        rank[masks[-1]] = signed_ranks(gap[masks[-1]])
        gaps.append(gap)
        ranks.append(rank)
    intervals = medians_by_world(np.stack(gaps, axis=1), paired.world, counted=np.stack(shared, axis=1))
    sign = 1 if better == "higher" else -1
    rows = []
    for k, (i, j) in enumerate(pairs):
        gap = gaps[k][masks[k]]
        lower, higher = int((gap < 0).sum()), int((gap > 0).sum())
        wins = (higher, lower) if sign > 0 else (lower, higher)
        dropped, effect = int((shared[k] & ~masks[k]).sum()), sign * rank_biserial(gap)
        difference, p = (float(np.median(gap)), wilcoxon(gap)) if len(gap) else (math.nan, math.nan)
        rows.append(_row(paired, metric, better, (i, j), masks[k], dropped, wins, difference, intervals[k], effect, p))
    return _corrected(paired, rows, masks, np.stack(ranks, axis=1))


def _row(
    paired: PairedRuns,
    measure: str,
    direction: Direction,
    planners: tuple[int, int],
    mask: Flags,
    dropped: int,
    wins: tuple[int, int],
    difference: float,
    interval: Interval,
    effect: float,
    p: float,
) -> PairedComparison:
    """Return a comparison on the instances of a mask, without the test over worlds."""
    i, j = planners
    pairs = int(mask.sum())
    return PairedComparison(
        measure=measure,
        first=paired.planners[i],
        second=paired.planners[j],
        direction=direction,
        pairs=pairs,
        worlds=paired.worlds_in(mask),
        dropped=dropped,
        unpaired=int((paired.present[:, i] != paired.present[:, j]).sum()),
        first_wins=wins[0],
        second_wins=wins[1],
        ties=pairs - sum(wins),
        difference=difference,
        interval=interval,
        effect=effect,
        p=p,
        p_worlds=math.nan,
    )


def _corrected(
    paired: PairedRuns, rows: list[PairedComparison], masks: Sequence[Flags], scores: Floats
) -> list[PairedComparison]:
    """Return the rows with the test over worlds and Holm's correction; scores (N, K) are nan outside the masks."""
    sums = np.stack(
        [sums_by_world(np.nan_to_num(column), paired.world, len(paired.worlds)) for column in scores.T], axis=1
    )
    flipped = flips_by_world(sums[(sums != 0).any(axis=1)])  # other worlds add nothing
    over = np.array([p if paired.several_in_worlds(mask) else math.nan for p, mask in zip(flipped, masks, strict=True)])
    single, worlds = holm(np.array([row.p for row in rows])), holm(over)
    return [
        dataclasses.replace(row, p_worlds=float(over[k]), p_holm=float(single[k]), p_worlds_holm=float(worlds[k]))
        for k, row in enumerate(rows)
    ]


POWER = 0.8  # power of the non-inferiority test with `needed` worlds, if planner and reference are equally good
TAIL_RESAMPLES = 20  # least number of resamples beyond each end of an interval
FEWEST_WORLDS = 6


@dataclass(frozen=True)
class NonInferiority:
    """A planner compared with the reference."""

    measure: str  # "success" or the name of a metric
    planner: str  # its label
    reference: str  # label of the reference planner
    allowed: float  # how much worse the planner may be: difference of success rates, or in the metric's unit
    # how much better it is: difference of success rates, or median of the paired differences; negative if worse
    advantage: float
    interval: Interval  # of the advantage; all intervals of the table hold jointly with 95 %
    worlds: int  # number of worlds of the pairs
    # worlds needed to show that the planner is not worse, with a power of 80 % if both are equally good;
    # estimated from the spread between these worlds
    needed: int

    @property
    def not_worse(self) -> bool:
        """Whether the whole interval lies above `-allowed`."""
        return self.interval.low > -self.allowed

    def as_dict(self) -> dict[str, Any]:
        """Return all fields as plain values, and whether the planner is not worse."""
        return {**dataclasses.asdict(self), "interval": list(self.interval), "not_worse": self.not_worse}


def not_worse(
    paired: PairedRuns, reference: str, measure: str, allowed: float, better: Direction
) -> list[NonInferiority]:
    """Return a row for each planner except the reference."""
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
    """Return the number of worlds that puts the interval above `-allowed`; at least the number needed if all runs agree."""
    z = statistics_library("scipy.stats").norm.ppf([1 - alpha / 2, POWER])
    spread = float(np.std(means, ddof=1)) if len(means) > 1 else math.nan
    normal = 0 if math.isnan(spread) else math.ceil((z.sum() * spread / allowed) ** 2)
    # Without failures, Wilson's interval over n worlds has a width of z² / (n + z²).
    alike = math.ceil(z[0] ** 2 * (1 - allowed) / allowed) if success and allowed < 1 else 0
    return max(normal, alike, FEWEST_WORLDS)
