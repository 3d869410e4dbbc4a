"""Sentences that state a comparison of planners, to quote."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from antdrive.base.errors import amount
from antdrive.runs.statistics.comparison import ALPHA, SUCCESS, PairedComparison
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.views.pages.rendering import Quantity, percent, percents, probability


def quotes(paired: PairedRuns, rows: Sequence[PairedComparison]) -> Iterator[str]:
    """Yield a sentence about each pair with the reference planner; of all pairs, about the one with the smallest p."""
    tested = _tested(rows)
    if not tested:
        return
    shared = set.intersection(*({row.first, row.second} for row in tested))
    for row in tested if shared else [min(tested, key=lambda one: one.decisive_p)]:
        yield _sentence(paired, row, len(tested))


def disagreements(tables: Mapping[str, Sequence[PairedComparison]]) -> Iterator[str]:
    """Yield a sentence for every cause of an interval and a p that disagree, with the pairs and measures."""
    where: dict[str, dict[str, list[str]]] = {}
    for measure, rows in tables.items():
        tested = _tested(rows)
        for one in tested:
            if why := _disagreement(one, len(tested)):
                pair = f"{one.first} and {one.second}"
                where.setdefault(why, {}).setdefault(pair, []).append(Quantity.of(measure).title)
    for why, pairs in where.items():
        places = "; ".join(f"{pair}: {', '.join(titles)}" for pair, titles in pairs.items())
        yield f"{why} ({places})."


def _tested(rows: Sequence[PairedComparison]) -> list[PairedComparison]:
    return [row for row in rows if not math.isnan(row.decisive_p)]


def _sentence(paired: PairedRuns, row: PairedComparison, tested: int) -> str:
    """Return the size of the difference with its interval, tests and correction."""
    tests = [
        "exact McNemar test" if row.measure == SUCCESS else "Wilcoxon's signed rank test",
        "permutation test over worlds",
    ]
    found = [
        f"{test} p {_equals(p)}"
        for test, p in zip(tests, (row.p_holm, row.p_worlds_holm), strict=True)
        if not math.isnan(p)
    ]
    over = f"n = {amount(row.pairs, 'pair')} in {amount(row.worlds, 'world')}"
    return f"{_effect(paired, row, over)}; {', '.join(found)} (Holm, {amount(tested, 'pair')})."


def _effect(paired: PairedRuns, row: PairedComparison, over: str) -> str:
    """Return the size of the difference with its interval."""
    i, j = paired.planners.index(row.first), paired.planners.index(row.second)
    mask = paired.counted(i, j)
    if row.measure == SUCCESS:
        shares = [percent(float(paired.success[mask, k].mean())) for k in (i, j)]
        several = paired.several_in_worlds(mask)
        method = "Newcombe, widened by a bootstrap over worlds" if several else "Newcombe"
        return (
            f"{row.first} succeeded in {shares[0]} % and {row.second} in {shares[1]} % of {over}: difference "
            f"{percent(row.difference)} points, 95 % interval {percents(row.interval)} ({method})"
        )
    quantity = Quantity.of(row.measure)
    median = f"{quantity.text(row.difference)} {quantity.unit}".rstrip()
    low, high = map(quantity.text, row.interval)
    return (
        f"{quantity.title}, {row.first} minus {row.second}: median {median} over {over} that both "
        f"solved, 95 % interval {low} to {high} (bootstrap over worlds)"
    )


def _disagreement(row: PairedComparison, tested: int) -> str:
    """Return why interval and p disagree; empty if they agree."""
    excludes, decided = row.interval.low > 0 or row.interval.high < 0, row.decisive_p < ALPHA
    if math.isnan(row.interval.low) or excludes == decided:
        return ""
    success = row.measure == SUCCESS
    other = "it is widened to hold over worlds" if success else "it is of the median, the tests are of ranks"
    if decided:
        return f"The interval contains 0 although p is below {ALPHA:g}, since {other}: the direction is shown, not the size"
    if max(p for p in (row.p, row.p_worlds) if not math.isnan(p)) < ALPHA:
        other = f"it holds for one pair, p for {tested} pairs together (Holm)"
    elif row.p < ALPHA:
        return f"{row.worlds} worlds are too few: the interval excludes 0, the test over worlds does not; undecided"
    return f"The interval excludes 0 although p is not below {ALPHA:g}, since {other}: no difference is shown"


def _equals(p: float) -> str:
    text = probability(p)
    return text if text.startswith("<") else f"= {text}"
