"""The papers' claims, each a row of `claims.csv`, and whether they hold: a claim's test on the runs of its experiments.

A claim is one sentence that an experiment can refute, and the test that decides it.
"""

from __future__ import annotations

import csv
import enum
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.runs.papers.paper_runs import PaperRun
from antdrive.runs.statistics.intervals import Interval, means_by_world, medians_by_world, resampled, wilson
from antdrive.runs.statistics.significance import wilcoxon

#: The margin of "no longer than" [points]: A = 0.56, where a small effect begins (Vargha & Delaney 2000), is 56 : 44.
SMALL_EFFECT = 12.0


class Arm(NamedTuple):
    """One experiment of a paper: a map's name, and the planner's with its setting."""

    map: str
    name: str


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of a paper, and the test that decides it: `statistic` `relation` `bound`.

    The statistics of `antdrive.runs.papers.claims` are of three kinds. One bounds a single planner, one compares two planners
    seed by seed, and one counts the maps on which the first planner is below the second. Some take more than one quantity.
    """

    paper: str
    source: str  # section, table or figure
    sentence: str
    reading: str = "ours"  # how the planner is read where that is not our default
    printed: str  # the paper's figures
    statistic: str  # a key of `STATISTICS`
    quantity: tuple[str, ...] = ("gap",)  # properties of `PaperRun`; a second one is that of the second planner
    relation: str  # a key of `RELATIONS`
    bound: float
    cases: tuple[tuple[Arm, ...], ...]  # on each map the planners that are measured together
    remark: str = ""  # what the figures do not say, and which margins and thresholds are ours, as the paper prints none

    @property
    def arms(self) -> frozenset[Arm]:
        """The experiments that the test needs."""
        return frozenset(arm for case in self.cases for arm in case)


def _claim(row: dict[str, str]) -> Claim:
    maps, planners = _listed(row.pop("maps")), _listed(row.pop("planners"))
    quantity, bound = _listed(row.pop("quantity")), float(row.pop("bound"))
    cases = tuple(tuple(Arm(name, planner) for planner in planners) for name in maps)
    return Claim(**row, quantity=quantity, bound=bound, cases=cases)


def _listed(cell: str) -> tuple[str, ...]:
    return tuple(cell.split(" | "))


def _claims() -> tuple[Claim, ...]:
    with Path(__file__).with_suffix(".csv").open(newline="", encoding="utf-8") as file:
        return tuple(_claim(row) for row in csv.DictReader(file))


#: All claims, in the order of the papers.
CLAIMS = _claims()


Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
RunsByArm = Mapping[Arm, Sequence[PaperRun]]
NO_PATH = 1e9  # replaces infinity in differences, so that "no path" minus "no path" is 0
FEWEST = 6  # with fewer runs no interval says anything
MANY = 1000  # times as many maps and seeds: a factor above this is not written
EQUAL = 1e-6  # a value is at most a bound that it exceeds by less
ABOUT = 0.05  # the share of a printed mean by which ours may differ
ENDLESS_TEXT = "∞"
TIMED = "cpu_ms"  # the quantity that is measured by the clock
NEVER = "neither ever gets there"


class Decision(enum.Enum):
    """What became of a claim. The value is the sentence shown to people."""

    HOLDS = "holds"
    REFUTED = "does not hold"
    OPEN = "cannot be told"


@dataclass(frozen=True)
class Verdict:
    """What became of a claim."""

    claim: Claim
    decision: Decision
    ours: str  # our figure with its interval, in words
    why: str
    value: float
    low: float  # the ends of the value's interval
    high: float


@dataclass(frozen=True)
class Measured:
    """What a statistic gives on a claim's runs."""

    value: float
    interval: Interval
    runs: int  # runs, or pairs of them, that count
    ours: str  # the value with its interval, in words
    why: str = ""  # further figures, in words
    unknown: str = ""  # why no decision is possible whatever the interval
    few: str = ""  # what is said of fewer runs than the test needs, where it is not that no interval says anything
    exact: bool = False  # the interval is right for any number of runs, so that even few can refute


#: By relation, whether an interval bears it out, and whether it refutes it.
RELATIONS: Mapping[str, Callable[[Interval, float], tuple[bool, bool]]] = MappingProxyType(
    {
        "<": lambda interval, bound: (interval.high < bound, interval.low >= bound),
        "<=": lambda interval, bound: (interval.high <= bound + EQUAL, interval.low > bound + EQUAL),
        ">": lambda interval, bound: (interval.low > bound, interval.high <= bound),
        ">=": lambda interval, bound: (interval.low >= bound, interval.high < bound),
        "about": lambda interval, bound: (
            bound * (1 - ABOUT) <= interval.low and interval.high <= bound * (1 + ABOUT),
            interval.high < bound * (1 - ABOUT) or interval.low > bound * (1 + ABOUT),
        ),
    }
)


def evaluate(claim: Claim, runs: RunsByArm) -> Verdict:
    """Test a claim."""
    measured = STATISTICS[claim.statistic](claim, runs)
    holds, fails = RELATIONS[claim.relation](measured.interval, claim.bound)
    decision, reason = Decision.OPEN, ""
    if measured.unknown:
        reason = measured.unknown
    elif measured.runs < runs_needed(claim) and not (measured.exact and fails):
        reason = measured.few or f"{measured.runs} runs, and with fewer than {FEWEST} no interval says anything"
    elif holds or fails:
        decision = Decision.HOLDS if holds else Decision.REFUTED
    else:
        reason = _undecided(measured, claim)
    why = "; ".join(filter(None, (reason, measured.why, claim.remark)))
    return Verdict(claim, decision, measured.ours, why, measured.value, *measured.interval)


def runs_needed(claim: Claim) -> int:
    """How many runs a claim's test needs at least to bear it out."""
    if claim.statistic in ("arrived", "failed"):
        above = claim.relation in (">", ">=")
        return next(
            n for n in range(1, MANY) if RELATIONS[claim.relation](wilson(n if above else 0, n), claim.bound)[0]
        )
    return 1 if "wins" in claim.statistic and TIMED not in claim.quantity else FEWEST


def runs_available(claim: Claim, sizes: Mapping[Arm, int]) -> int:
    """How many runs, or pairs of them, a claim's test counts."""
    counts = [min(sizes[arm] for arm in case) for case in claim.cases]
    return min(counts) if "wins" in claim.statistic else sum(counts)


def _difference(claim: Claim, runs: RunsByArm) -> Measured:
    """The median of the differences, pair by pair."""
    first, second, world = _paired(claim, runs)
    difference = np.round(first - second, 9)  # rounding errors become 0
    value, interval = _median(difference, world)
    why = f"{_counts(difference)}; Wilcoxon's p {wilcoxon(difference):.2g}"
    if claim.quantity == ("work",):
        why += f"; processor time {_slower(claim, runs):+.0f} %"
    ours = f"median difference {_with_interval(value, interval, claim, endless=ENDLESS_TEXT)}"
    return Measured(value, interval, len(difference), ours, why, _never(first, second))


def _gain(claim: Claim, runs: RunsByArm) -> Measured:
    """The median of the differences of two gains: from the first planner to the second, and from the third to the fourth."""
    (case,) = claim.cases
    before, after, world = _paired(claim, runs, [case[:2]])
    earlier, later, _ = _paired(claim, runs, [case[2:]])
    value, interval = _median(np.round((before - after) - (earlier - later), 9), world)
    gains = f"median gains {np.median(before - after):.2f} and {np.median(earlier - later):.2f}"
    ours = f"median difference of the gains {_with_interval(value, interval, claim, endless=ENDLESS_TEXT)}"
    return Measured(value, interval, len(before), ours, gains)


def _balance(claim: Claim, runs: RunsByArm) -> Measured:
    """The share of the pairs in which the first value is above the second, less the share in which it is below [points].

    For values of which many are equal, as lengths on small maps: their median difference is 0 whatever the others are. Two
    planners that are alike have a balance of 0, of which an interval never says that it is 0 or less; so "no worse" lets a
    small effect pass.
    """
    first, second, world = _paired(claim, runs)
    difference = np.round(first - second, 9)
    signs = np.sign(difference)
    value, interval = 100 * float(signs.mean()), means_by_world(100 * signs[:, None], _alone(world))[0]
    less, more = int((signs < 0).sum()), int((signs > 0).sum())
    points = f"{value:+.0f} points [{_written(interval.low, 0)}, {_written(interval.high, 0)}]"
    ours = f"below in {less} of {len(signs)} pairs, above in {more}: {points}"
    median = f"median difference {_with_interval(*_median(difference, world), claim, endless=ENDLESS_TEXT)}"
    return Measured(value, interval, len(signs), ours, median, _never(first, second))


def _scatter(claim: Claim, runs: RunsByArm) -> Measured:
    """The difference of the two ranges between quartiles; maps, and runs within each, are resampled for its interval.

    A quartile that no path reaches is infinite, and so is the range.
    """
    first, second, world = _paired(claim, runs)

    def wider(counts: Numbers) -> float:
        return _quartile_range(first, counts) - _quartile_range(second, counts)

    rows = np.vstack(list(resampled(_alone(world))))
    ends = np.quantile([wider(row) for row in rows], [0.025, 0.975])
    # Differences of equal ranges are not quite 0.
    value, low, high = (round(float(one), 9) for one in (wider(np.ones(len(first), dtype=np.int64)), *ends))
    interval = Interval(low, high)
    ours = f"ranges differ by {_with_interval(value, interval, claim, endless=ENDLESS_TEXT)}"
    return Measured(value, interval, len(first), ours, "ranges between quartiles, bootstrapped")


def _median_of_one(claim: Claim, runs: RunsByArm) -> Measured:
    """The median of all values."""
    values, world = _together(claim, runs)
    value, interval = _median(values, world)
    arrived, within = int((values < NO_PATH).sum()), int((values <= claim.bound + EQUAL).sum())
    why = f"{arrived} of {len(values)} found a path, {within} are within the bound"
    return Measured(value, interval, len(values), f"median {_with_interval(value, interval, claim)}", why)


def _mean_of_one(claim: Claim, runs: RunsByArm) -> Measured:
    """The mean of all finite values, beside the printed one."""
    values, _ = _together(claim, runs)
    known = values[values < NO_PATH]
    if not len(known):
        return Measured(math.nan, Interval(math.nan, math.nan), 0, "–", unknown="no path was found")
    value = float(known.mean())
    # Runs are of one map, so each counts on its own.
    interval = means_by_world(known[:, None], np.arange(len(known)))[0]
    why = f"{100 * (value / claim.bound - 1):+.1f} % from the printed mean"
    if len(known) < len(values):
        why += f"; {len(values) - len(known)} of {len(values)} had no path"
    return Measured(value, interval, len(known), f"mean {_with_interval(value, interval, claim)}", why)


def _arrived(claim: Claim, runs: RunsByArm) -> Measured:
    """The share of the runs in which a planner finds a path."""
    count, arrived, needed = *_solved(claim, runs), runs_needed(claim)
    interval = wilson(arrived, count)
    return Measured(
        value=arrived / count,
        interval=interval,
        runs=count,
        ours=f"{arrived}/{count} arrived [{interval.low:.0%}, {interval.high:.0%}]",
        why=f"{'at least' if claim.relation == '>=' else 'at most'} {claim.bound:.0%} asked; Wilson's interval",
        few=f"{count} runs, and the interval of fewer than {needed} is too wide whatever they give",
        exact=True,
    )


def _failed(claim: Claim, runs: RunsByArm) -> Measured:
    """The share of the runs in which a planner finds no path. One such run shows that there are any; none refutes it."""
    count, arrived = _solved(claim, runs)
    failed, interval = count - arrived, wilson(count - arrived, count)
    return Measured(
        value=failed / count,
        interval=interval,
        runs=count,
        ours=f"{failed}/{count} found no path [{interval.low:.0%}, {interval.high:.0%}]",
        why="one run that fails bears it out" if failed else "",
        unknown="" if failed else "no run failed, which does not say that none may",
    )


def _wins(claim: Claim, runs: RunsByArm) -> Measured:
    """In how many cases the first planner's median, or its best run as for times of equal work, is below the second's."""
    stands = np.min if claim.statistic == "wins of best runs" else np.median
    pairs = [[float(stands([_value(t, claim.quantity[0]) for t in runs[arm]])) for arm in case] for case in claim.cases]
    less = sum(a < b - 1e-9 for a, b in pairs)
    digits = 2 if TIMED in claim.quantity else 0
    why = ", ".join(f"{a:.{digits}f} : {b:.{digits}f}" for a, b in pairs)
    count = min(len(runs[one]) for one, _ in claim.cases)
    few = f"{count} runs tell no time, {FEWEST} do"
    return Measured(float(less), Interval(less, less), count, f"less in {less} of {len(pairs)}", why, few=few)


#: By its name in the table of claims, what a statistic measures of a claim's runs.
STATISTICS: Mapping[str, Callable[[Claim, RunsByArm], Measured]] = MappingProxyType(
    {
        # A single planner's runs, all together.
        "median": _median_of_one,
        "mean": _mean_of_one,
        "arrived": _arrived,
        "failed": _failed,
        # Two planners, pair by pair of the same map and seed; `gain` compares two pairs.
        "difference": _difference,
        "balance": _balance,
        "scatter": _scatter,
        "gain": _gain,
        # Two planners, map by map.
        "wins": _wins,
        "wins of best runs": _wins,
    }
)


def _undecided(measured: Measured, claim: Claim) -> str:
    """Why an interval decides nothing, and how much more it would take if the value stayed: intervals shrink with the root."""
    value, bound = measured.value, claim.bound
    if claim.relation == "about":
        bound = min(bound * (1 - ABOUT), bound * (1 + ABOUT), key=lambda end: abs(value - end))
    words = f"the interval does not lie on one side of {bound:g}"
    towards = measured.interval.high - value if bound > value else value - measured.interval.low
    if abs(bound - value) < 1e-9 or not abs(towards) < NO_PATH / 10:
        return words
    times = (towards / abs(bound - value)) ** 2
    more = f"some {times:{'.0f' if times > 10 else '.1f'}} times as many maps and seeds would tell"
    return f"{words}; {more}" if 1.1 < times < MANY else words


def _counts(difference: Floats) -> str:
    less, equal, more = (int(np.sum(sign)) for sign in (difference < 0, difference == 0, difference > 0))
    return f"{less} less, {equal} equal, {more} more"


def _never(first: Floats, second: Floats) -> str:
    return NEVER if min(first.min(), second.min()) >= NO_PATH else ""


def _slower(claim: Claim, runs: RunsByArm) -> float:
    """By how much the first planner's median processor time is above the second's [%]; below 0 if it is faster."""
    first, second, _ = _paired(claim, runs, quantity=(TIMED,))
    return 100 * (float(np.median(first)) / max(float(np.median(second)), 1e-9) - 1)


def _value(run: PaperRun, quantity: str) -> float:
    value = float(getattr(run, quantity))
    return NO_PATH if math.isnan(value) else min(value, NO_PATH)


def _solved(claim: Claim, runs: RunsByArm) -> tuple[int, int]:
    """The number of all runs, and of those that found a path."""
    solved = [run.result.solved for (arm,) in claim.cases for run in runs[arm]]
    return len(solved), sum(solved)


def _together(claim: Claim, runs: RunsByArm) -> tuple[Floats, Numbers]:
    """The values of all runs, (N,), and the number of each one's map, (N,)."""
    (quantity,) = claim.quantity
    rows = [(_value(run, quantity), (arm.map, run.world)) for (arm,) in claim.cases for run in runs[arm]]
    return np.array([value for value, _ in rows]), _numbered([place for _, place in rows])


def _paired(
    claim: Claim,
    runs: RunsByArm,
    cases: Sequence[tuple[Arm, ...]] | None = None,
    quantity: tuple[str, ...] | None = None,
) -> tuple[Floats, Floats, Numbers]:
    """The values of first and second planners with the same map and seed, (N,) each, and the number of their map, (N,)."""
    quantity = quantity or claim.quantity
    rows = []
    for one, other in claim.cases if cases is None else cases:
        second = {run.seed: run for run in runs[other]}
        rows += [(run, second[run.seed], (one.map, run.world)) for run in runs[one] if run.seed in second]
    values = np.array([[_value(a, quantity[0]), _value(b, quantity[-1])] for a, b, _ in rows]).reshape(-1, 2)
    return values[:, 0], values[:, 1], _numbered([place for *_, place in rows])


def _numbered(places: Sequence[tuple[str, int]]) -> Numbers:
    names = {place: number for number, place in enumerate(dict.fromkeys(places))}
    return np.array([names[place] for place in places], dtype=np.int64)


def _median(values: Floats, world: Numbers) -> tuple[float, Interval]:
    """The median and its interval; where all runs are of one map, each counts on its own."""
    return float(np.median(values)), medians_by_world(values[:, None], _alone(world))[0]


def _alone(world: Numbers) -> Numbers:
    """What is resampled: maps or, where there is only one, single runs."""
    return np.arange(len(world)) if len(set(world.tolist())) == 1 else world


def _quartile_range(values: Floats, counts: Numbers) -> float:
    low, high = np.quantile(np.repeat(values, counts), [0.25, 0.75])
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


def _with_interval(value: float, interval: Interval, claim: Claim, endless: str = "no path") -> str:
    digits, unit = UNITS[claim.quantity[0]]

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
