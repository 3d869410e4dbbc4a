"""What a campaign's report says first: its headline numbers, and what a reader of its tables must know."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from antdrive.runs.statistics.columns import HASHES
from antdrive.runs.statistics.comparison import ALPHA, PairedComparison
from antdrive.runs.statistics.price import prices
from antdrive.runs.statistics.proportions import Interval
from antdrive.runs.statistics.significance import FLIPS
from antdrive.views.campaign.numbers import percent, percents

if TYPE_CHECKING:
    from antdrive.runs.statistics.pairing import PairedRuns
    from antdrive.runs.statistics.success import PlannerSuccess
    from antdrive.views.campaign.summary import CampaignSummary

NAMED = 3  # planners that a card names
VALUES = 5  # of a setting that a note names


def headline(summary: CampaignSummary) -> list[tuple[str, str]]:
    """The headline numbers, each with its meaning."""
    table, paired, rows = summary.table, summary.paired, summary.success
    runs, good = sum(row.runs for row in rows), int(paired.success.sum())
    done = ("run" if runs == 1 else "runs") if runs >= summary.size else f"of {summary.size:,} runs done"
    died = sum(row.outcomes.get("crashed", 0) + row.outcomes.get("planner_fault", 0) for row in rows)
    return [
        (f"{runs:,}", done),
        (f"{good:,}", "runs succeeded, of all planners" if len(rows) > 1 else "runs succeeded"),
        *(_counted(len(paired.planners), "planner"), _counted(len(paired.worlds), "world")),
        _counted(len(set(table.texts("seed"))), "seed"),
        *([_best(rows, paired)] if paired.shared.any() else []),
        *([(str(died), "ended by a crash or a planner's error")] if died else []),
    ]


def _counted(count: int, what: str) -> tuple[str, str]:
    return f"{count:,}", what if count == 1 else f"{what}s"


def _best(rows: Sequence[PlannerSuccess], paired: PairedRuns) -> tuple[str, str]:
    """The highest share of successes, and all planners that have it."""
    share = max(row.share for row in rows)
    best = [row for row in rows if row.share == share]
    if len(best) == len(rows) > 1:
        names = "every planner"
    else:
        names = ", ".join(row.planner for row in best[:NAMED])
        names += f" and {len(best) - NAMED} more" if len(best) > NAMED else ""
    intervals = [row.across_worlds for row in best]
    wide = Interval(min(one.low for one in intervals), max(one.high for one in intervals))
    over = "over worlds" if len(paired.worlds) > 1 else "in this world"
    most = ", the highest share" if len(best) < len(rows) else ""
    return f"{percent(share)} %", f"succeeded with {names}{most} (95 % {over}: {percents(wide)})"


def notes_on(summary: CampaignSummary) -> list[str]:
    """What a reader of the tables must know about this campaign, a sentence each."""
    found: list[str] = []
    if len(summary.table) < summary.size:
        found.append(f"{summary.size - len(summary.table)} of {summary.size} runs are not done yet.")
    found += [*_shares(summary), *_mixed(summary), *_repeated(summary.success)]
    if len(summary.paired.worlds) == 1:
        found.append("There is one world: the intervals and tests say nothing about other worlds.")
    else:
        found += _too_few_worlds(summary.comparisons)
    if summary.refusal:
        found.append(f"Planners are not compared: {summary.refusal}.")
    found += [price.sentence for price in prices(summary.table) if price.unpaired < price.drives]
    return found


def _shares(summary: CampaignSummary) -> list[str]:
    """Over which instances shares are taken, where planners ran different ones."""
    paired = summary.paired
    shared = int(paired.shared.sum())
    if shared == len(paired.row):
        return []
    if not shared:
        return [
            "No instance was run by every planner: each share is over its planner's own, and shares are not comparable."
        ]
    more = ", ".join(f"{row.planner} {row.elsewhere}" for row in summary.success if row.elsewhere)
    return [f"Shares are over the {shared} instances that every planner ran. Runs elsewhere, left out of them: {more}."]


def _mixed(summary: CampaignSummary) -> list[str]:
    """Settings over several values of which shares and medians are taken."""
    table, found = summary.table, []
    worlds = table.texts("world")
    for name in table.settings:
        texts = table.texts(name)
        if name in HASHES or len(set(zip(worlds, texts, strict=True))) == len(set(worlds)):
            continue  # the same everywhere, or different from world to world only
        values = [_plain(text) for text in dict.fromkeys(texts)]
        some = ", ".join(value or "none" for value in values[:VALUES]) + (", …" if len(values) > VALUES else "")
        one = next(value for value in values if value)
        found.append(f"Shares and medians are over several values of {name} ({some}); --where {name}={one} takes one.")
    return found


def _plain(text: str) -> str:
    try:
        return f"{float(text):g}"
    except ValueError:
        return text


def _repeated(rows: Sequence[PlannerSuccess]) -> list[str]:
    still = [row.planner for row in rows if row.counted < row.runs - row.elsewhere]
    if not still:
        return []
    return [
        f"Drives of {', '.join(still)} repeat with other seeds. Repetitions count once, except in pairs with a planner whose "
        "drives the seed changes; planning times are medians over them."
    ]


def _too_few_worlds(comparisons: Mapping[str, Sequence[PairedComparison]]) -> list[str]:
    """Where the worlds are too few for any pair of planners to be told apart, whatever the runs give."""
    least: dict[tuple[int, int], list[str]] = {}
    for measure, rows in comparisons.items():
        if any(row.pairs for row in rows) and not any(_decidable(row, rows) for row in rows):
            place = max(row.worlds for row in rows), sum(row.pairs > 0 for row in rows)
            least.setdefault(place, []).append(measure)
    found = []
    for (worlds, pairs), measures in least.items():
        of = "" if len(measures) == len(comparisons) else f" by {', '.join(measures)}"
        told = "a pair" if pairs == 1 else f"{pairs} pairs"
        corrected = "" if pairs == 1 else " after Holm's correction"
        need = math.floor(1 + math.log2(pairs / ALPHA)) + 1
        fewer = "" if pairs == 1 else ", or fewer pairs (--against, --planner)"
        found.append(
            f"{worlds} {'world is' if worlds == 1 else 'worlds are'} too few to tell {told} of planners apart{of}: no p-value "
            f"over worlds can be below {ALPHA:g}{corrected}. "
            f"It takes {need} worlds{fewer}."
        )
    return found


def _decidable(row: PairedComparison, rows: Sequence[PairedComparison]) -> bool:
    """Whether a pair's p-values could be below 0.05 if all of its runs agreed, corrected for all pairs of its table."""

    def reached(units: int, tests: int) -> bool:
        return bool(units) and tests * max(2.0 ** (1 - units), 1 / (FLIPS + 1)) < ALPHA

    over = [other for other in rows if not math.isnan(other.p_worlds)]
    single = reached(row.pairs, sum(other.pairs > 0 for other in rows))
    return single and (math.isnan(row.p_worlds) or reached(row.worlds, len(over)))
