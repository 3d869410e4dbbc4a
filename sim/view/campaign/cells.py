"""The two tables of a campaign as headings and cells of text, for terminals, Markdown, LaTeX and CSV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from antdrive.sim.statistics.comparison import SUCCESS, PairedComparison
from antdrive.sim.statistics.proportions import Interval
from antdrive.sim.statistics.success import PlannerSuccess
from antdrive.sim.view.campaign.summary import CampaignSummary, measure_title

NONE = "–"


class TextTable(NamedTuple):
    """A table of text.

    Attributes:
        title: what it shows
        headings: of its columns
        rows: its cells
    """

    title: str
    headings: tuple[str, ...]
    rows: list[tuple[str, ...]]


def success_cells(summary: CampaignSummary) -> TextTable:
    """How often each planner succeeds, and its medians over the instances in which all do.

    Args:
        summary: of the campaign
    """
    names = list(summary.medians)
    over = any(not math.isnan(row.over_worlds.low) for row in summary.success)
    headings = (
        *("planner", "share [%]", "95 % interval"),
        *(["over worlds"] if over else []),
        *("succeeded", "counted", "runs"),
        *(f"median {measure_title(name)}" for name in names),
    )
    rows = []
    for k, row in enumerate(summary.success):
        rows.append(
            (
                row.planner,
                percent(row.share),
                percents(row.interval),
                *([percents(row.over_worlds)] if over else []),
                *(str(row.successes), str(row.counted), str(row.runs)),
                *(with_interval(*summary.medians[name][k]) for name in names),
            )
        )
    return TextTable("Success", headings, rows)


def pair_cells(measure: str, comparisons: Sequence[PairedComparison]) -> TextTable:
    """The comparison of each pair of planners by one measure.

    Args:
        measure: "success" or the name of a metric
        comparisons: of the pairs
    """
    over = any(not math.isnan(row.p_worlds) for row in comparisons)
    success = measure == SUCCESS
    headings = (
        *("first", "second", "better", "difference" + (" [%]" if success else ""), "95 % interval", "p (Holm)"),
        *(["p worlds (Holm)"] if over else []),
        *("effect", "pairs", "wins", "losses", "ties"),
        *([] if success else ["dropped"]),
    )
    title = "Success" if success else measure_title(measure)
    return TextTable(title, headings, [_pair_row(row, success, over) for row in comparisons])


def _pair_row(row: PairedComparison, success: bool, over: bool) -> tuple[str, ...]:
    def shown(value: float) -> str:
        return percent(value) if success else short(value)

    return (
        row.first,
        row.second,
        row.better or NONE,
        shown(row.difference),
        NONE if math.isnan(row.interval.low) else f"{shown(row.interval.low)} to {shown(row.interval.high)}",
        probability(row.p_holm),
        *([probability(row.p_worlds_holm)] if over else []),
        NONE if not row.pairs else f"{row.effect + 0.0:.2f}",
        *(str(row.pairs), str(row.first_wins), str(row.second_wins), str(row.ties)),
        *([] if success else [str(row.dropped)]),
    )


def success_note(row: PlannerSuccess) -> str:
    """The outcomes of a planner's runs, in words, the most frequent first.

    Args:
        row: of the planner
    """
    found = sorted(row.outcomes.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in found)


def percent(share: float) -> str:
    """A share in percent, with one digit; 100.0 and 0.0 only where they are exact.

    Args:
        share: from -1 to 1
    """
    if math.isnan(share):
        return NONE
    shown = f"{100 * share + 0.0:.1f}"
    if shown == "100.0" and share < 1:
        return f"{math.floor(10_000 * share) / 100:.2f}"
    return "0.0" if shown == "-0.0" else shown


def percents(interval: Interval) -> str:
    """An interval of shares in percent.

    Args:
        interval: of shares
    """
    return NONE if math.isnan(interval.low) else f"{percent(interval.low)} to {percent(interval.high)}"


def short(value: float) -> str:
    """A number with three significant digits.

    Args:
        value: the number
    """
    if not math.isfinite(value):
        return NONE if math.isnan(value) else "∞"
    if value == 0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    text = f"{value:.{min(digits, 6)}f}"
    return "0" if float(text) == 0 else text


def with_interval(value: float, interval: Interval) -> str:
    """A number with its interval in brackets.

    Args:
        value: the number
        interval: its interval
    """
    return f"{short(value)} ({short(interval.low)} to {short(interval.high)})"


def probability(p: float) -> str:
    """A p-value.

    Args:
        p: nan where there is no test
    """
    if math.isnan(p):
        return NONE
    return "< 0.001" if p < 0.001 else f"{p:.3f}"
