"""Claims of the papers, one row of `rows/PAPER.csv` each, and their verdicts from the runs of the experiments.

A claim is one sentence that an experiment can refute, and the test that decides it. A check is such a sentence of ours about
an arm, for instance that a colony learns at all.
"""

from __future__ import annotations

import csv
import enum
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.runs.papers.experiments import PAPERS
from antdrive.runs.papers.paper_runs import PaperRun
from antdrive.runs.statistics.intervals import Interval, means_by_world, medians_by_world, resampled, wilson
from antdrive.runs.statistics.significance import wilcoxon
from antdrive.sim.log.record import finite_or_none


class Arm(NamedTuple):
    """One experiment of a paper: the names of the map and of the planner with its setting."""

    map: str
    name: str


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of a paper, and the test that decides it: `statistic` `relation` `bound`.

    There are three kinds of statistics: bounds on one planner, comparisons of two planners seed by seed, and counts of maps on
    which the first planner is below the second. Some take several quantities.
    """

    paper: str
    id: str  # shared by the rows of one sentence on several maps or in several readings
    kind: str  # "claim" of the paper, or "check" of an arm
    source: str  # section, table or figure
    sentence: str
    reading: str = "ours"  # interpretation of the planner, if not our default
    printed: str  # the paper's values
    statistic: str  # a key of `STATISTICS`
    quantity: tuple[str, ...] = ("gap",)  # properties of `PaperRun`; a second one is that of the second planner
    relation: str  # a key of `RELATIONS`
    bound: float
    cases: tuple[tuple[Arm, ...], ...]  # for each map, the planners measured together
    remark: str = ""  # limits of the values, and margins and thresholds that are ours because the paper prints none

    @property
    def arms(self) -> frozenset[Arm]:
        """The experiments that the test needs."""
        return frozenset(arm for case in self.cases for arm in case)


def read_table(folder: str, paper: str) -> Iterator[dict[str, str]]:
    """Yield the rows of a paper's table in `folder`, by heading: `rows` of claims, or `paragraphs` that claim something.

    A paragraph has its lines in the paper's plain text, its place and quote, the rows that test it, and why none does.
    """
    with (Path(__file__).parent / folder / f"{paper}.csv").open(newline="", encoding="utf-8") as file:
        yield from csv.DictReader(file)


def _claim(paper: str, row: dict[str, str]) -> Claim:
    maps, planners = _listed(row.pop("maps")), _listed(row.pop("planners"))
    quantity, bound = _listed(row.pop("quantity")), float(row.pop("bound"))
    cases = tuple(tuple(map(Arm, itertools.cycle(name.split(" / ")), planners)) for name in maps)
    return Claim(paper=paper, **row, quantity=quantity, bound=bound, cases=cases)


def _listed(cell: str) -> tuple[str, ...]:
    return tuple(cell.split(" | "))


#: All claims, in the order of the papers.
CLAIMS = tuple(_claim(paper, row) for paper in PAPERS for row in read_table("rows", paper))


Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
RunsByArm = Mapping[Arm, Sequence[PaperRun]]
NO_PATH = 1e9  # replaces infinity in differences, so that "no path" minus "no path" is 0
FEWEST = 6  # with fewer runs intervals are meaningless
MANY = 1000  # most runs that a claim can need
REPEATABLE = 10  # larger factors of maps and seeds are not reported
EQUAL = 1e-6  # tolerance of bounds
ABOUT = 0.05  # allowed relative deviation from a printed mean
ENDLESS_TEXT = "∞"
TIMED = "cpu_ms"  # quantity measured by the clock
NEVER = "neither ever reaches it"


class Decision(enum.Enum):
    """The verdict on a claim; the value is shown to users."""

    HOLDS = "holds"
    REFUTED = "does not hold"
    OPEN = "cannot be told"


@dataclass(frozen=True)
class Verdict:
    """The verdict on a claim, with its evidence."""

    claim: Claim
    decision: Decision
    ours: str  # our value with its interval, in words
    why: str
    value: float
    low: float  # ends of the value's interval
    high: float


@dataclass(frozen=True)
class Measured:
    """The result of a statistic on a claim's runs."""

    value: float
    interval: Interval
    runs: int  # counted runs, or pairs of them
    ours: str  # the value with its interval, in words
    why: str = ""  # further values, in words
    unknown: str = ""  # reason why no decision is possible, regardless of the interval
    few: str = ""  # message for too few runs, if not the default
    exact: bool = False  # the interval is valid for any number of runs, so that even few can refute


NOTHING = Measured(math.nan, Interval(math.nan, math.nan), 0, "–", unknown="no path was found")

#: By relation, whether an interval confirms it, and whether it refutes it. An interval that touches the bound does not refute.
RELATIONS: Mapping[str, Callable[[Interval, float], tuple[bool, bool]]] = MappingProxyType(
    {
        "<": lambda interval, bound: (interval.high < bound, interval.low > bound),
        "<=": lambda interval, bound: (interval.high <= bound + EQUAL, interval.low > bound + EQUAL),
        ">": lambda interval, bound: (interval.low > bound, interval.high < bound),
        ">=": lambda interval, bound: (interval.low >= bound, interval.high < bound),
        "about": lambda interval, bound: (
            bound * (1 - ABOUT) <= interval.low and interval.high <= bound * (1 + ABOUT),
            interval.high < bound * (1 - ABOUT) or interval.low > bound * (1 + ABOUT),
        ),
    }
)


def evaluate(claim: Claim, runs: RunsByArm) -> Verdict:
    """Evaluate a claim."""
    measured = STATISTICS[claim.statistic](claim, runs)
    holds, fails = RELATIONS[claim.relation](measured.interval, claim.bound)
    decision, reason = Decision.OPEN, ""
    if measured.unknown:
        reason = measured.unknown
    elif measured.runs < runs_needed(claim) and not (measured.exact and fails):
        reason = measured.few or f"{measured.runs} runs, but an interval needs at least {FEWEST}"
    elif holds or fails:
        decision = Decision.HOLDS if holds else Decision.REFUTED
    else:
        reason = _undecided(measured, claim)
    why = "; ".join(filter(None, (reason, measured.why, claim.remark)))
    return Verdict(claim, decision, measured.ours, why, measured.value, *measured.interval)


def runs_needed(claim: Claim) -> int:
    """Return the least number of runs that can confirm a claim."""
    if claim.statistic in ("arrived", "failed"):
        above = claim.relation in (">", ">=")
        return next(
            n for n in range(1, MANY) if RELATIONS[claim.relation](wilson(n if above else 0, n), claim.bound)[0]
        )
    return 1 if claim.statistic == "wins" else FEWEST


def runs_available(claim: Claim, sizes: Mapping[Arm, int]) -> int:
    """Return the number of runs, or pairs of them, that a claim's test counts."""
    counts = [min(sizes[arm] for arm in case) for case in claim.cases]
    return min(counts) if "wins" in claim.statistic else sum(counts)


def _difference(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the median of the paired differences."""
    first, second, world = _paired(claim, runs)
    difference = np.round(first - second, 9)  # removes rounding errors
    value, interval = _median(difference, world)
    less, equal, more = (int(np.sum(sign)) for sign in (difference < 0, difference == 0, difference > 0))
    why = f"{less} less, {equal} equal, {more} more; Wilcoxon's p {wilcoxon(difference):.2g}"
    ours = f"median difference {_with_interval(value, interval, claim, endless=ENDLESS_TEXT)}"
    return Measured(value, interval, len(difference), ours, why, _never(first, second))


def _gain(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the median difference of two gains: from the first planner to the second, from the third to the fourth."""
    (case,) = claim.cases
    common = set.intersection(*({run.seed for run in runs[arm]} for arm in case))
    kept = {arm: [run for run in runs[arm] if run.seed in common] for arm in case}
    before, after, world = _paired(claim, kept, [case[:2]])
    earlier, later, _ = _paired(claim, kept, [case[2:]])
    value, interval = _median(np.round((before - after) - (earlier - later), 9), world)
    gains = f"median gains {np.median(before - after):.2f} and {np.median(earlier - later):.2f}"
    ours = f"median difference of the gains {_with_interval(value, interval, claim, endless=ENDLESS_TEXT)}"
    return Measured(value, interval, len(before), ours, gains)


def _balance(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the fraction of pairs with the first value above the second, minus that below [points].

    It suits values with many ties, such as lengths on small maps, whose median difference is always 0. Equivalent planners
    have a balance of 0, whose interval never lies at or below 0; so "no worse" tolerates a small effect.
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


def _ratio(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the median of the paired ratios of the first value to the second."""
    first, second, world = _paired(claim, runs)
    value, interval = _median(first / second, world)
    ours = f"median ratio {value:.2f} [{_written(interval.low, 2)}, {_written(interval.high, 2)}]"
    medians = f"medians {np.median(first):.0f} and {np.median(second):.0f}"
    return Measured(value, interval, len(first), ours, medians, _never(first, second))


def _scatter(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the difference of the interquartile ranges; its interval resamples maps, then runs.

    A quartile without a path is infinite, and so is the range.
    """
    first, second, world = _paired(claim, runs)

    def wider(counts: Numbers) -> float:
        return _quartile_range(first, counts) - _quartile_range(second, counts)

    rows = np.vstack(list(resampled(_alone(world))))
    ends = np.quantile([wider(row) for row in rows], [0.025, 0.975])
    # Differences of equal ranges are not exactly 0.
    value, low, high = (round(float(one), 9) for one in (wider(np.ones(len(first), dtype=np.int64)), *ends))
    interval = Interval(low, high)
    ours = f"ranges differ by {_with_interval(value, interval, claim, endless=ENDLESS_TEXT)}"
    return Measured(value, interval, len(first), ours, "ranges between quartiles, bootstrapped")


def _median_of_one(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the median of all values."""
    values, world = _together(claim, runs)
    value, interval = _median(values, world)
    arrived, within = int((values < NO_PATH).sum()), int((values <= claim.bound + EQUAL).sum())
    why = f"{arrived} of {len(values)} found a path, {within} are within the bound"
    return Measured(value, interval, len(values), f"median {_with_interval(value, interval, claim)}", why)


def _mean_of_one(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the mean of all finite values, beside the printed one."""
    values, _ = _together(claim, runs)
    known = values[values < NO_PATH]
    if not len(known):
        return NOTHING
    value = float(known.mean())
    # All runs are on one map, so each counts on its own.
    interval = means_by_world(known[:, None], np.arange(len(known)))[0]
    why = f"{100 * (value / claim.bound - 1):+.1f} % from the printed mean"
    if len(known) < len(values):
        why += f"; {len(values) - len(known)} of {len(values)} lacked a value"
    return Measured(value, interval, len(known), f"mean {_with_interval(value, interval, claim)}", why)


def _means_of_several(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the means of several planners as fractions of the printed ones; the one farthest off decides."""
    (case,) = claim.cases
    values = [
        np.array([value for run in runs[arm] if (value := _value(run, *claim.quantity)) < NO_PATH]) for arm in case
    ]
    lost = sum(len(runs[arm]) for arm in case) - sum(map(len, values))
    if not all(map(len, values)):
        return NOTHING
    fractions = [known / float(printed) for known, printed in zip(values, claim.printed.split(", "), strict=True)]
    intervals = [means_by_world(known[:, None], np.arange(len(known)))[0] for known in fractions]

    def far(k: int) -> tuple[bool, float]:
        return RELATIONS["about"](intervals[k], 1.0)[1], max(abs(end - 1) for end in intervals[k])

    k = max(range(len(case)), key=far)
    ours = f"means {', '.join(f'{known.mean():.2f}' for known in values)}"
    off = (
        f"{100 * known.mean() - 100:+.1f} [{100 * low - 100:+.1f}, {100 * high - 100:+.1f}] %"
        for known, (low, high) in zip(fractions, intervals, strict=True)
    )
    why = f"from the printed means: {', '.join(off)}" + (f"; {lost} runs lacked a value" if lost else "")
    refuted = RELATIONS["about"](intervals[k], 1.0)[1]
    unknown = "" if refuted or not lost else "runs without a value cannot be averaged"
    return Measured(float(fractions[k].mean()), intervals[k], min(map(len, values)), ours, why, unknown)


def _arrived(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the fraction of runs in which a planner finds a path."""
    count, arrived, needed = *_solved(claim, runs), runs_needed(claim)
    interval = wilson(arrived, count)
    return Measured(
        value=arrived / count,
        interval=interval,
        runs=count,
        ours=f"{arrived}/{count} arrived [{interval.low:.0%}, {interval.high:.0%}]",
        why=f"{'at least' if claim.relation == '>=' else 'at most'} {claim.bound:.0%} required; Wilson's interval",
        few=f"{count} runs, but the interval needs at least {needed}",
        exact=True,
    )


def _failed(claim: Claim, runs: RunsByArm) -> Measured:
    """Return the fraction of runs without a path. One such run confirms the claim; none does not refute it."""
    count, arrived = _solved(claim, runs)
    failed, interval = count - arrived, wilson(count - arrived, count)
    return Measured(
        value=failed / count,
        interval=interval,
        runs=count,
        ours=f"{failed}/{count} found no path [{interval.low:.0%}, {interval.high:.0%}]",
        why="one failed run confirms it" if failed else "",
        unknown="" if failed else "no run failed, but others may",
    )


def _wins(claim: Claim, runs: RunsByArm) -> Measured:
    """Count the cases in which the first planner's median is below the second's."""
    pairs = [
        [float(np.median([_value(t, claim.quantity[0]) for t in runs[arm]])) for arm in case] for case in claim.cases
    ]
    less = sum(a < b - 1e-9 for a, b in pairs)
    why = ", ".join(f"{a:.0f} : {b:.0f}" for a, b in pairs)
    count = min(len(runs[one]) for one, _ in claim.cases)
    return Measured(float(less), Interval(less, less), count, f"less in {less} of {len(pairs)}", why)


def _ratio_wins(claim: Claim, runs: RunsByArm) -> Measured:
    """Count the cases whose median paired ratio of first to second is below 1, by its interval.

    The interval of the count ends where every undecided case is below 1, too: those whose interval contains or touches 1. An
    interval of exactly 1 is equal. A ratio with no path is infinite or 0, without both paths 1. Times must be those of one
    group of experiments.
    """
    ratios, counts = [], []
    for case in claim.cases:
        first, second, world = _paired(claim, runs, [case])
        ratio = np.round(np.maximum(first, 1e-9) / np.maximum(second, 1e-9), 9)
        ratios.append(_median(ratio, world))
        counts.append(len(ratio))
    below, above = (sum(test) for test in zip(*((i.high < 1.0, i.low > 1.0) for _, i in ratios), strict=True))
    equal = sum(i.low == i.high == 1.0 for _, i in ratios)
    undecided = len(ratios) - below - above - equal
    interval = Interval(below, below + undecided)

    def number(value: float) -> str:
        return ENDLESS_TEXT if value > MANY else f"{value:.2f}"

    return Measured(
        value=float(below),
        interval=interval,
        runs=min(counts),
        ours=f"less in {below} of {len(ratios)}, equal in {equal}, more in {above}",
        why="median ratios " + ", ".join(f"{number(v)} [{number(i.low)}, {number(i.high)}]" for v, i in ratios),
        unknown=""
        if any(RELATIONS[claim.relation](interval, claim.bound))
        else f"{undecided} undecided, which could tip it",
    )


#: Statistics of a claim's runs, by name in the table of claims.
STATISTICS: Mapping[str, Callable[[Claim, RunsByArm], Measured]] = MappingProxyType(
    {
        # A single planner, all runs together.
        "median": _median_of_one,
        "mean": _mean_of_one,
        "means": _means_of_several,
        "arrived": _arrived,
        "failed": _failed,
        # Two planners, paired by map and seed; `gain` compares two pairs.
        "difference": _difference,
        "balance": _balance,
        "ratio": _ratio,
        "scatter": _scatter,
        "gain": _gain,
        # Two planners, map by map.
        "wins": _wins,
        "wins of ratios": _ratio_wins,
    }
)


def _undecided(measured: Measured, claim: Claim) -> str:
    """Explain an undecided interval, and estimate the runs needed: intervals shrink with the square root."""
    value, bound = measured.value, claim.bound
    if claim.relation == "about":
        bound = min(bound * (1 - ABOUT), bound * (1 + ABOUT), key=lambda end: abs(value - end))
    low, high = measured.interval
    words = f"the interval {'touches' if bound in (low, high) else 'contains'} {bound:g}"
    towards = measured.interval.high - value if bound > value else value - measured.interval.low
    if abs(bound - value) < 1e-9 or not abs(towards) < NO_PATH / 10:
        return words
    times = (towards / abs(bound - value)) ** 2
    if times <= 1.1:
        return words
    more = f"about {times:.1f} times as many maps and seeds would decide"
    return f"{words}; {more if times < REPEATABLE else 'the difference is small beside the spread of the runs'}"


def _never(first: Floats, second: Floats) -> str:
    return NEVER if min(first.min(), second.min()) >= NO_PATH else ""


def _value(run: PaperRun, quantity: str) -> float:
    value = float(getattr(run, quantity))
    return NO_PATH if math.isnan(value) else min(value, NO_PATH)


def _solved(claim: Claim, runs: RunsByArm) -> tuple[int, int]:
    """Return the number of all runs, and of those that found a path."""
    solved = [run.result.solved for (arm,) in claim.cases for run in runs[arm]]
    return len(solved), sum(solved)


def _together(claim: Claim, runs: RunsByArm) -> tuple[Floats, Numbers]:
    """Return the values of all runs, (N,), and the index of each one's map, (N,)."""
    (quantity,) = claim.quantity
    rows = [(_value(run, quantity), (arm.map, run.world)) for (arm,) in claim.cases for run in runs[arm]]
    return np.array([value for value, _ in rows]), _numbered([place for _, place in rows])


def _paired(
    claim: Claim,
    runs: RunsByArm,
    cases: Sequence[tuple[Arm, ...]] | None = None,
) -> tuple[Floats, Floats, Numbers]:
    """Return the paired values of both planners with the same map and seed, (N,) each, and the index of the map, (N,)."""
    rows = []
    for one, other in claim.cases if cases is None else cases:
        second = {run.seed: run for run in runs[other]}
        rows += [(run, second[run.seed], (one.map, run.world)) for run in runs[one] if run.seed in second]
    values = np.array([[_value(a, claim.quantity[0]), _value(b, claim.quantity[-1])] for a, b, _ in rows]).reshape(
        -1, 2
    )
    return values[:, 0], values[:, 1], _numbered([place for *_, place in rows])


def _numbered(places: Sequence[tuple[str, int]]) -> Numbers:
    names = {place: number for number, place in enumerate(dict.fromkeys(places))}
    return np.array([names[place] for place in places], dtype=np.int64)


def _median(values: Floats, world: Numbers) -> tuple[float, Interval]:
    """Return the median and its interval; on a single map each run counts on its own."""
    return float(np.median(values)), medians_by_world(values[:, None], _alone(world))[0]


def _alone(world: Numbers) -> Numbers:
    """Return the units of resampling: maps, or runs if there is only one map."""
    return np.arange(len(world)) if len(set(world.tolist())) == 1 else world


def _quartile_range(values: Floats, counts: Numbers) -> float:
    low, high = np.quantile(np.repeat(values, counts), [0.25, 0.75])
    return float(high - low)


#: Digits and unit of a quantity.
UNITS: Mapping[str, tuple[int, str]] = {
    "gap": (1, " %"),
    "missing": (0, ""),
    "even_gap": (1, " %"),
    "length": (2, ""),
    "last": (2, ""),
    "unrest": (2, ""),
    "early_unrest": (2, ""),
    "concentration": (4, ""),
    "share": (2, " %"),
    "cpu_ms": (0, " ms"),
    "work": (0, " steps"),
    "rated": (0, " chromosomes"),
    "settled": (0, " iterations"),
    "near": (0, " iterations"),
    "reached": (0, " iterations"),
    "effort": (0, " steps"),
    "steps": (0, " steps"),
    "total": (1, ""),
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
    """Format a number, without a sign if it rounds to 0."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


#: Headings of the table of claims; the verdict is first, as a terminal may cut the lines.
VERDICT_HEADS = ("verdict", "paper", "row", "claim", "reading", "printed", "ours", "arms", "why", "source")


def verdict_facts(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict as plain data, for files and `--json`, first what stands under `VERDICT_HEADS`."""
    claim = verdict.claim
    return {
        "verdict": verdict.decision.value,
        "paper": claim.paper,
        "row": claim.id,
        "claim": claim.sentence,
        "reading": claim.reading,
        "printed": claim.printed,
        "ours": verdict.ours,
        "arms": " : ".join(dict.fromkeys(arm.name for case in claim.cases for arm in case)),
        "why": verdict.why,
        "source": claim.source,
        "kind": claim.kind,
        **{name: finite_or_none(getattr(verdict, name)) for name in ("value", "low", "high")},
    }
