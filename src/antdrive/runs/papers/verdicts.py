"""Whether a claim holds: its test on the trials of its experiments, with an interval."""

from __future__ import annotations

import enum
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.runs.papers.kinds import (
    Arm,
    Arrive,
    Cases,
    Claim,
    Less,
    LessGain,
    MayFail,
    Mean,
    NoWorse,
    Oftener,
    Test,
    Wider,
    Within,
)
from antdrive.runs.papers.trials import Trial
from antdrive.runs.statistics.bootstrap import means_by_world, medians_by_world, resampled
from antdrive.runs.statistics.proportions import Interval, wilson
from antdrive.runs.statistics.significance import wilcoxon

Floats = npt.NDArray[np.float64]
Found = Mapping[Arm, Sequence[Trial]]
NO_PATH = 1e9  # takes the place of infinity in differences, so that "no path" minus "no path" is 0
FEWEST = 6  # with fewer trials no interval says anything
MANY = 1000  # times as many maps and seeds: a factor above this is not written
ENDLESS_TEXT = "∞"
TIMED = "cpu_ms"  # the quantity that is measured by the clock


class Decision(enum.Enum):
    """What became of a claim. The value is the sentence shown to people."""

    HOLDS = "holds"
    REFUTED = "does not hold"
    OPEN = "cannot be told"


@dataclass(frozen=True)
class Verdict:
    """What became of a claim.

    Attributes:
        claim: the claim
        decision: whether it holds
        ours: our figure with its interval, in words
        why: what decided
        value: our figure
        low: the lower end of its interval
        high: its upper end
    """

    claim: Claim
    decision: Decision
    ours: str
    why: str
    value: float
    low: float
    high: float


class Judged(NamedTuple):
    """A test's answer.

    Attributes:
        decision: whether the claim holds
        value: our figure
        interval: its interval
        ours: both in words
        why: what decided
    """

    decision: Decision
    value: float
    interval: Interval
    ours: str
    why: str


def judge(claim: Claim, found: Found) -> Verdict:
    """Test a claim."""
    decision, value, interval, ours, why = _judged(claim.test, found)
    why = "; ".join(filter(None, (why, claim.remark)))
    return Verdict(claim, decision, ours, why, value, interval.low, interval.high)


def trials_needed(test: Test) -> int:
    """How many trials a test needs at least to bear a claim out."""
    if isinstance(test, MayFail) or (isinstance(test, Cases) and test.quantity != TIMED):
        return 1
    if isinstance(test, Arrive):
        return next(n for n in range(1, MANY) if _all_or_none(test, n))
    return FEWEST


def _all_or_none(test: Arrive, trials: int) -> bool:
    """Whether so many trials that all arrive, or none, as the claim wants, have an interval within its bounds."""
    interval = wilson(trials if test.least else 0, trials)
    return test.least <= interval.low and interval.high <= test.most


def trials_at_hand(test: Test, sizes: Mapping[Arm, int]) -> int:
    """How many trials, or pairs of them, a test counts."""
    if isinstance(test, Mean):
        return sizes[test.arm]
    if isinstance(test, (Arrive, MayFail, Within)):
        return sum(sizes[arm] for arm in test.arms)
    counts = [min(sizes[one], sizes[other]) for one, other in test.pairs]
    return min(counts) if isinstance(test, (LessGain, Cases)) else sum(counts)


@functools.singledispatch
def _judged(test: Any, found: Found) -> Judged:
    raise TypeError(f"no judge for a test of type {type(test).__name__}")


@_judged.register
def _less(test: Less, found: Found) -> Judged:
    first, second, world = _paired(test.pairs, test.quantity, found, test.against)
    difference = np.round(first - second, 9)  # what is only rounding becomes 0
    value, interval = _median(difference, world)
    below = interval.high < test.margin if test.strict else interval.high <= test.margin
    above = interval.low >= test.margin if test.strict else interval.low > test.margin
    decision, reason = _decided(below, above, len(difference), value, interval, test.margin)
    if min(first.min(), second.min()) >= NO_PATH:
        decision, reason = Decision.OPEN, "neither ever gets there"
    why = f"{_counts(difference)}; Wilcoxon's p {wilcoxon(difference):.2g}"
    if test.quantity == "work":
        why += f"; processor time {_slower(test.pairs, found):+.0f} %"
    ours = f"median difference {_with_interval(value, interval, test.quantity, endless=ENDLESS_TEXT)}"
    return Judged(decision, value, interval, ours, _joined(reason, why))


@_judged.register
def _less_gain(test: LessGain, found: Found) -> Judged:
    before, after, _ = _paired((test.first,), test.quantity, found)
    earlier, later, world = _paired((test.second,), test.quantity, found)
    difference = np.round((before - after) - (earlier - later), 9)
    value, interval = _median(difference, world)
    decision, reason = _decided(interval.high < 0, interval.low >= 0, len(difference), value, interval, 0.0)
    gains = f"median gains {np.median(before - after):.2f} and {np.median(earlier - later):.2f}"
    ours = f"median difference of the gains {_with_interval(value, interval, test.quantity, endless=ENDLESS_TEXT)}"
    return Judged(decision, value, interval, ours, _joined(reason, gains))


@_judged.register
def _oftener(test: Oftener, found: Found) -> Judged:
    share = _share(test.pairs, test.quantity, found)
    low, high = share.interval
    decision, reason = _decided(high < 0, low >= 0, share.pairs, share.value, share.interval, 0.0)
    if not share.known:
        decision, reason = Decision.OPEN, "neither ever gets there"
    why = _joined(reason, share.median)
    return Judged(decision, share.value, share.interval, share.ours, why)


@_judged.register
def _no_worse(test: NoWorse, found: Found) -> Judged:
    share = _share(test.pairs, test.quantity, found)
    low, high = share.interval
    decision, reason = _decided(
        high <= test.margin, low > test.margin, share.pairs, share.value, share.interval, test.margin
    )
    if not share.known:
        decision, reason = Decision.OPEN, "neither ever gets there"
    why = _joined(reason, share.median)
    return Judged(decision, share.value, share.interval, share.ours, why)


@_judged.register
def _within(test: Within, found: Found) -> Judged:
    values, world = _together(test.arms, test.quantity, found)
    value, interval = _median(values, world)
    ours = f"median {_with_interval(value, interval, test.quantity)}"
    arrived, bound = int((values < NO_PATH).sum()), test.most + 1e-6
    why = f"{arrived} of {len(values)} found a path, {int((values <= bound).sum())} are within the bound"
    decision, reason = _decided(interval.high <= bound, interval.low > bound, len(values), value, interval, test.most)
    return Judged(decision, value, interval, ours, _joined(reason, why))


@_judged.register
def _mean(test: Mean, found: Found) -> Judged:
    values, _ = _together((test.arm,), test.quantity, found)
    known = values < NO_PATH
    if not known.any():
        return Judged(Decision.OPEN, math.nan, Interval(math.nan, math.nan), "–", "no path was found")
    value = float(values[known].mean())
    # Trials are of one map, so each counts on its own.
    interval = means_by_world(values[known][:, None], np.arange(int(known.sum())))[0]
    low, high = test.value * (1 - test.margin), test.value * (1 + test.margin)
    inside, outside = low <= interval.low and interval.high <= high, interval.high < low or interval.low > high
    nearest = min(low, high, key=lambda bound: abs(value - bound))
    decision, reason = _decided(inside, outside, int(known.sum()), value, interval, nearest)
    why = f"{100 * (value / test.value - 1):+.1f} % from the printed mean"
    if not known.all():
        why += f"; {int((~known).sum())} of {len(values)} had no path"
    ours = f"mean {_with_interval(value, interval, test.quantity)}"
    return Judged(decision, value, interval, ours, _joined(reason, why))


@_judged.register
def _arrive(test: Arrive, found: Found) -> Judged:
    trials = [trial for arm in test.arms for trial in found[arm]]
    arrived = sum(trial.result.solved for trial in trials)
    value, interval = arrived / len(trials), wilson(arrived, len(trials))
    holds = test.least <= interval.low and interval.high <= test.most
    fails = interval.high < test.least or interval.low > test.most
    limit = test.least or test.most
    needed = trials_needed(test)
    decision = Decision.HOLDS if holds else Decision.REFUTED if fails else Decision.OPEN
    reason = "" if holds or fails else _undecided(value, interval, limit)
    if not (holds or fails) and len(trials) < needed:
        reason = f"{len(trials)} runs, and the interval of fewer than {needed} is too wide whatever they give"
    bound = f"at least {limit:.0%}" if test.least else f"at most {limit:.0%}"
    ours = f"{arrived}/{len(trials)} arrived [{interval.low:.0%}, {interval.high:.0%}]"
    return Judged(decision, value, interval, ours, _joined(reason, f"{bound} asked; Wilson's interval"))


@_judged.register
def _may_fail(test: MayFail, found: Found) -> Judged:
    trials = [trial for arm in test.arms for trial in found[arm]]
    failed = sum(not trial.result.solved for trial in trials)
    value, interval = failed / len(trials), wilson(failed, len(trials))
    decision = Decision.HOLDS if failed else Decision.OPEN
    why = "one run that fails bears it out" if failed else "no run failed, which does not say that none may"
    ours = f"{failed}/{len(trials)} found no path [{interval.low:.0%}, {interval.high:.0%}]"
    return Judged(decision, value, interval, ours, why)


@_judged.register
def _wider(test: Wider, found: Found) -> Judged:
    """The difference of the two ranges between quartiles; maps, and runs within each, are resampled for its interval."""
    first, second, world = _paired((test.pair,), test.quantity, found)
    each = np.ones(len(first), dtype=np.int64)
    value = _quartile_range(first, each) - _quartile_range(second, each)
    rows = np.vstack(list(resampled(_alone(world))))
    low, high = np.quantile(
        [_quartile_range(first, row) - _quartile_range(second, row) for row in rows], [0.025, 0.975]
    )
    value, low, high = (
        round(float(one), 9) for one in (value, low, high)
    )  # differences of equal ranges are not quite 0
    interval = Interval(low, high)
    ours = f"ranges differ by {_with_interval(value, interval, test.quantity, endless=ENDLESS_TEXT)}"
    decision, reason = _decided(low > 0, high <= 0, len(first), value, interval, 0.0)
    return Judged(decision, value, interval, ours, _joined(reason, "ranges between quartiles, bootstrapped"))


@_judged.register
def _cases(test: Cases, found: Found) -> Judged:
    stands = np.min if test.best_run else np.median
    first = [float(stands([_value(trial, test.quantity) for trial in found[one]])) for one, _ in test.pairs]
    second = [float(stands([_value(trial, test.quantity) for trial in found[other]])) for _, other in test.pairs]
    less = sum(a < b - 1e-9 for a, b in zip(first, second, strict=True))
    decision = Decision.HOLDS if less >= test.least else Decision.REFUTED
    digits = 2 if test.quantity == TIMED else 0
    why = ", ".join(f"{a:.{digits}f} : {b:.{digits}f}" for a, b in zip(first, second, strict=True))
    runs = min(len(found[one]) for one, _ in test.pairs)
    if runs < trials_needed(test):
        decision, why = Decision.OPEN, f"{runs} runs tell no time, {FEWEST} do; {why}"
    return Judged(decision, float(less), Interval(less, less), f"less in {less} of {len(first)}", why)


def _decided(
    holds: bool, fails: bool, trials: int, value: float, interval: Interval, bound: float
) -> tuple[Decision, str]:
    """The decision and, where there is none, why."""
    if trials < FEWEST:
        return Decision.OPEN, f"{trials} trials, and with fewer than {FEWEST} no interval says anything"
    if holds or fails:
        return (Decision.HOLDS if holds else Decision.REFUTED), ""
    return Decision.OPEN, _undecided(value, interval, bound)


def _undecided(value: float, interval: Interval, bound: float) -> str:
    """Why an interval decides nothing, and how much more it would take if the value stayed: intervals shrink with the root."""
    words = f"the interval does not lie on one side of {bound:g}"
    towards = interval.high - value if bound > value else value - interval.low
    if abs(bound - value) < 1e-9 or not abs(towards) < NO_PATH / 10:
        return words
    times = (towards / abs(bound - value)) ** 2
    return (
        f"{words}; some {times:{'.0f' if times > 10 else '.1f'}} times as many maps and seeds would tell"
        if 1.1 < times < MANY
        else words
    )


def _joined(*words: str) -> str:
    return "; ".join(filter(None, words))


def _counts(difference: Floats) -> str:
    less, equal, more = (int(np.sum(sign)) for sign in (difference < 0, difference == 0, difference > 0))
    return f"{less} less, {equal} equal, {more} more"


def _slower(pairs: Sequence[tuple[Arm, Arm]], found: Found) -> float:
    """By how much the first arm's median processor time is above the second's [%]; below 0 if it is faster."""
    first, second, _ = _paired(pairs, TIMED, found)
    return 100 * (float(np.median(first)) / max(float(np.median(second)), 1e-9) - 1)


class Share(NamedTuple):
    """In how many pairs the first value is above the second, less in how many it is below.

    Attributes:
        value: the difference of the two shares [points]
        interval: its interval
        pairs: how many pairs there are
        known: whether any value of any pair is finite
        ours: the figures in words
        median: the median difference in words
    """

    value: float
    interval: Interval
    pairs: int
    known: bool
    ours: str
    median: str


def _share(pairs: Sequence[tuple[Arm, Arm]], quantity: str, found: Found) -> Share:
    first, second, world = _paired(pairs, quantity, found)
    difference = np.round(first - second, 9)
    signs = np.sign(difference)
    value, interval = 100 * float(signs.mean()), means_by_world(100 * signs[:, None], _alone(world))[0]
    less, more = int((signs < 0).sum()), int((signs > 0).sum())
    points = f"{value:+.0f} points [{_written(interval.low, 0)}, {_written(interval.high, 0)}]"
    middle = _with_interval(*_median(difference, world), quantity, endless=ENDLESS_TEXT)
    return Share(
        value,
        interval,
        len(signs),
        bool(min(first.min(), second.min()) < NO_PATH),
        f"below in {less} of {len(signs)} pairs, above in {more}: {points}",
        f"median difference {middle}",
    )


def _value(trial: Trial, quantity: str) -> float:
    value = float(getattr(trial, quantity))
    return NO_PATH if math.isnan(value) else min(value, NO_PATH)


def _together(arms: Sequence[Arm], quantity: str, found: Found) -> tuple[Floats, npt.NDArray[np.int64]]:
    """The values of all trials of some arms, (N,), and the number of each one's map, (N,)."""
    rows = [(_value(trial, quantity), (arm.map, trial.world)) for arm in arms for trial in found[arm]]
    return np.array([value for value, _ in rows]), _numbered([place for _, place in rows])


def _paired(
    pairs: Sequence[tuple[Arm, Arm]], quantity: str, found: Found, against: str = ""
) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """The values of first and second arms with the same map and seed, (N,) each, and the number of their map, (N,).

    `against` is the second arm's quantity where it is another one.
    """
    rows = []
    for one, other in pairs:
        second = {trial.seed: trial for trial in found[other]}
        rows += [(trial, second[trial.seed], (one.map, trial.world)) for trial in found[one] if trial.seed in second]
    values = np.array([[_value(a, quantity), _value(b, against or quantity)] for a, b, _ in rows]).reshape(-1, 2)
    return values[:, 0], values[:, 1], _numbered([place for *_, place in rows])


def _numbered(places: Sequence[tuple[str, int]]) -> npt.NDArray[np.int64]:
    names = {place: number for number, place in enumerate(dict.fromkeys(places))}
    return np.array([names[place] for place in places], dtype=np.int64)


def _median(values: Floats, world: npt.NDArray[np.int64]) -> tuple[float, Interval]:
    """The median and its interval; where all trials are of one map, each counts on its own."""
    return float(np.median(values)), medians_by_world(values[:, None], _alone(world))[0]


def _alone(world: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """What is resampled: maps or, where there is only one, single trials."""
    return np.arange(len(world)) if len(set(world.tolist())) == 1 else world


def _quartile_range(values: Floats, counts: npt.NDArray[np.int64]) -> float:
    drawn = np.repeat(values, counts)
    low, high = np.quantile(drawn, [0.25, 0.75])
    return float(high - low)


#: How a quantity is written: digits and unit.
UNITS: Mapping[str, tuple[int, str]] = {
    "gap": (1, " %"),
    "length": (2, ""),
    "last": (2, ""),
    "unrest": (2, ""),
    "early_unrest": (2, ""),
    "concentration": (3, ""),
    "work": (0, " steps"),
    "settled": (0, " iterations"),
    "near": (0, " iterations"),
    "effort": (0, " steps"),
}


def _with_interval(value: float, interval: Interval, quantity: str, endless: str = "no path") -> str:
    digits, unit = UNITS[quantity]

    def number(one: float) -> str:
        if math.isnan(one):
            return "–"
        return _written(one, digits) if abs(one) < NO_PATH / 10 else (endless if one > 0 else f"−{endless}")

    unit = unit if abs(value) < NO_PATH / 10 else ""
    return f"{number(value)}{unit} [{number(interval.low)}, {number(interval.high)}]"


def _written(value: float, digits: int) -> str:
    """A number without a sign where it is rounded to 0."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


#: The headings of the table of claims; the verdict comes first, as a terminal may cut the lines.
VERDICT_HEADS = ("verdict", "paper", "claim", "reading", "printed", "ours", "why", "source")


def verdict_cells(verdict: Verdict) -> list[str]:
    """A row of the table as text, under `VERDICT_HEADS`."""
    claim = verdict.claim
    return [
        verdict.decision.value,
        claim.paper,
        claim.sentence,
        claim.reading,
        claim.printed,
        verdict.ours,
        verdict.why,
        claim.source,
    ]


def verdict_facts(verdict: Verdict) -> dict[str, Any]:
    """A verdict as plain data, for files and `--json`."""
    cells = dict(zip(VERDICT_HEADS, verdict_cells(verdict), strict=True))
    numbers = {"value": verdict.value, "low": verdict.low, "high": verdict.high}
    known: Callable[[float], float | None] = lambda number: number if math.isfinite(number) else None  # noqa: E731
    return {**cells, **{key: known(number) for key, number in numbers.items()}}
