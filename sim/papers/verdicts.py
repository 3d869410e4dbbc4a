"""Whether a claim holds: its test on the trials of its experiments, with an interval."""

from __future__ import annotations

import enum
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.sim.papers.claims import Arm, Arrive, Cases, Claim, Less, Mean, Oftener, Wider, Within
from antdrive.sim.papers.trials import Trial
from antdrive.sim.statistics.bootstrap import means_by_world, medians_by_world, resampled
from antdrive.sim.statistics.proportions import Interval, wilson
from antdrive.sim.statistics.significance import wilcoxon

Floats = npt.NDArray[np.float64]
Found = Mapping[Arm, Sequence[Trial]]
NO_PATH = 1e9  # takes the place of infinity in differences, so that "no path" minus "no path" is 0
FEWEST = 6  # with fewer trials no interval says anything


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


def judge(claim: Claim, found: Found) -> Verdict:
    """Test a claim.

    Args:
        claim: the claim
        found: the trials of the experiments of its paper
    """
    decision, value, interval, ours, why = _judged(claim.test, found)
    why = "; ".join(filter(None, (why, claim.remark)))
    return Verdict(claim, decision, ours, why, value, interval.low, interval.high)


Judged = tuple[Decision, float, Interval, str, str]


@functools.singledispatch
def _judged(test: Any, found: Found) -> Judged:
    raise TypeError(f"no judge for a test of type {type(test).__name__}")


@_judged.register
def _less(test: Less, found: Found) -> Judged:
    first, second, world = _paired(test.pairs, test.quantity, found)
    difference = np.round(first - second, 9)  # what is only rounding becomes 0
    value, interval = _median(difference, world)
    below = interval.high < test.margin if test.strict else interval.high <= test.margin
    above = interval.low >= test.margin if test.strict else interval.low > test.margin
    counts = (
        f"{int((difference < 0).sum())} less, {int((difference == 0).sum())} equal, {int((difference > 0).sum())} more"
    )
    why = f"{counts}; Wilcoxon's p {wilcoxon(difference):.2g}"
    ours = f"median difference {_with_interval(value, interval, test.quantity, endless='∞')}"
    return _decided(below, above, len(difference)), value, interval, ours, why


@_judged.register
def _oftener(test: Oftener, found: Found) -> Judged:
    first, second, world = _paired(test.pairs, test.quantity, found)
    signs = np.sign(np.round(first - second, 9))
    alone = np.arange(len(signs)) if len(set(world.tolist())) == 1 else world
    value, interval = 100 * float(signs.mean()), means_by_world(100 * signs[:, None], alone)[0]
    less, more = int((signs < 0).sum()), int((signs > 0).sum())
    points = f"{value:+.0f} points [{interval.low:.0f}, {interval.high:.0f}]"
    ours = f"below in {less} of {len(signs)} pairs, above in {more}: {points}"
    decision = _decided(interval.high < 0, interval.low >= 0, len(signs))
    return decision, value, interval, ours, "share of pairs above less share below, bootstrapped"


@_judged.register
def _within(test: Within, found: Found) -> Judged:
    values, world = _together(test.arms, test.quantity, found)
    value, interval = _median(values, world)
    ours = f"median {_with_interval(value, interval, test.quantity)}"
    arrived = int((values < NO_PATH).sum())
    why = f"{arrived} of {len(values)} found a path, {int((values <= test.most + 1e-6).sum())} are within the bound"
    below, above = interval.high <= test.most + 1e-6, interval.low > test.most + 1e-6
    return _decided(below, above, len(values)), value, interval, ours, why


@_judged.register
def _mean(test: Mean, found: Found) -> Judged:
    values, _ = _together((test.arm,), test.quantity, found)
    known = values < NO_PATH
    if not known.any():
        return Decision.OPEN, math.nan, Interval(math.nan, math.nan), "–", "no path was found"
    value = float(values[known].mean())
    # Trials are of one map, so each counts on its own.
    interval = means_by_world(values[known][:, None], np.arange(int(known.sum())))[0]
    low, high = test.value * (1 - test.margin), test.value * (1 + test.margin)
    inside, outside = low <= interval.low and interval.high <= high, interval.high < low or interval.low > high
    why = f"{100 * (value / test.value - 1):+.1f} % from the printed mean; the margin is {100 * test.margin:.0f} %"
    if not known.all():
        why += f"; {int((~known).sum())} of {len(values)} had no path"
    ours = f"mean {_with_interval(value, interval, test.quantity)}"
    return _decided(inside, outside, int(known.sum())), value, interval, ours, why


@_judged.register
def _arrive(test: Arrive, found: Found) -> Judged:
    trials = found[test.arm]
    arrived = sum(trial.result.solved for trial in trials)
    value, interval = arrived / len(trials), wilson(arrived, len(trials))
    holds = test.least <= interval.low and interval.high <= test.most
    fails = interval.high < test.least or interval.low > test.most
    bound = f"at least {test.least:.0%}" if test.least else f"at most {test.most:.0%}"
    ours = f"{arrived}/{len(trials)} arrived [{interval.low:.0%}, {interval.high:.0%}]"
    return _decided(holds, fails, len(trials)), value, interval, ours, f"{bound} asked; Wilson's interval"


@_judged.register
def _wider(test: Wider, found: Found) -> Judged:
    """The difference of the two ranges between quartiles, averaged over the pairs, under resampling of the maps."""
    spreads = []
    for pair in test.pairs:
        first, second, world = _paired((pair,), test.quantity, found)
        rows = next(resampled(world))
        spreads.append([_quartile_range(first, row) - _quartile_range(second, row) for row in rows])
    values = np.median(np.array(spreads), axis=0)
    value = float(np.median(values))
    low, high = np.quantile(values, [0.025, 0.975])
    ours = f"ranges differ by {_with_interval(value, Interval(float(low), float(high)), test.quantity)}"
    decision = _decided(low > 0, high <= 0, len(found[test.pairs[0][0]]))
    return decision, value, Interval(float(low), float(high)), ours, f"median over {len(test.pairs)} maps, bootstrapped"


@_judged.register
def _cases(test: Cases, found: Found) -> Judged:
    first = [_value(found[one][0], test.quantity) for one, _ in test.pairs]
    second = [_value(found[other][0], test.quantity) for _, other in test.pairs]
    less = sum(a < b - 1e-9 for a, b in zip(first, second, strict=True))
    decision = Decision.HOLDS if less >= test.least else Decision.REFUTED
    figures = ", ".join(f"{a:.0f} : {b:.0f}" for a, b in zip(first, second, strict=True))
    ours = f"less in {less} of {len(first)}"
    return decision, float(less), Interval(less, less), ours, f"{figures}; nothing is random"


def _decided(holds: bool, fails: bool, trials: int) -> Decision:
    if trials < FEWEST or not (holds or fails):
        return Decision.OPEN
    return Decision.HOLDS if holds else Decision.REFUTED


def _value(trial: Trial, quantity: str) -> float:
    return float(min(getattr(trial, quantity), NO_PATH))


def _together(arms: Sequence[Arm], quantity: str, found: Found) -> tuple[Floats, npt.NDArray[np.int64]]:
    """The values of all trials of some arms, (N,), and the number of each one's map, (N,)."""
    rows = [(_value(trial, quantity), (arm.map, trial.world)) for arm in arms for trial in found[arm]]
    return np.array([value for value, _ in rows]), _numbered([place for _, place in rows])


def _paired(
    pairs: Sequence[tuple[Arm, Arm]], quantity: str, found: Found
) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """The values of first and second arms with the same map and seed, (N,) each, and the number of their map, (N,)."""
    rows = []
    for one, other in pairs:
        second = {trial.seed: trial for trial in found[other]}
        rows += [(trial, second[trial.seed], (one.map, trial.world)) for trial in found[one] if trial.seed in second]
    values = np.array([[_value(a, quantity), _value(b, quantity)] for a, b, _ in rows]).reshape(-1, 2)
    return values[:, 0], values[:, 1], _numbered([place for *_, place in rows])


def _numbered(places: Sequence[tuple[str, int]]) -> npt.NDArray[np.int64]:
    names = {place: number for number, place in enumerate(dict.fromkeys(places))}
    return np.array([names[place] for place in places], dtype=np.int64)


def _median(values: Floats, world: npt.NDArray[np.int64]) -> tuple[float, Interval]:
    """The median and its interval; where all trials are of one map, each counts on its own."""
    alone = np.arange(len(values)) if len(set(world.tolist())) == 1 else world
    return float(np.median(values)), medians_by_world(values[:, None], alone)[0]


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
    "settled": (0, " iterations"),
    "near": (0, " iterations"),
    "effort": (0, " steps"),
}


def _with_interval(value: float, interval: Interval, quantity: str, endless: str = "no path") -> str:
    digits, unit = UNITS[quantity]

    def number(one: float) -> str:
        if math.isnan(one):
            return "–"
        return f"{one:.{digits}f}" if abs(one) < NO_PATH / 10 else (endless if one > 0 else f"−{endless}")

    return f"{number(value)}{unit} [{number(interval.low)}, {number(interval.high)}]"


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
