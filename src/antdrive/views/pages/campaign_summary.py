"""Campaign summary for pages, tables and the terminal."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from antdrive.base.errors import FieldError, amount
from antdrive.base.tables import rounded_down
from antdrive.runs.comparing import FAULTS
from antdrive.runs.statistics.comparison import (
    ALPHA,
    SUCCESS,
    NonInferiority,
    PairedComparison,
    compare_metric,
    compare_success,
    not_worse,
    pairs_of,
)
from antdrive.runs.statistics.intervals import Interval
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.runs.statistics.price import prices
from antdrive.runs.statistics.run_table import HASHES, RunTable
from antdrive.runs.statistics.significance import FLIPS
from antdrive.runs.statistics.success import PlannerSuccess, common_medians, success_table
from antdrive.sim.log.metrics import METRICS
from antdrive.views.pages.quotes import disagreements, quotes
from antdrive.views.pages.rendering import Quantity, percent, percents

DEFAULT_METRICS = ("driven_length_m", "duration_s", "plan_s")


@dataclass(frozen=True, eq=False)
class CampaignSummary:
    """Summary of a campaign: its runs, success and comparisons."""

    title: str  # of the page
    paired: PairedRuns  # runs by instance and planner
    size: int  # number of the campaign's runs of these planners, including missing ones
    success: Sequence[PlannerSuccess]  # one per planner
    # one per pair of planners, by measure, "success" first; empty with one planner
    comparisons: Mapping[str, Sequence[PairedComparison]]
    common: int  # number of instances in which every planner succeeded
    # each planner's median over those instances with its interval, by metric
    medians: Mapping[str, Sequence[tuple[float, Interval]]]
    refusal: str = ""  # why planners are not compared; empty if they are
    # non-inferiority tests against the reference planner; empty unless requested
    allowances: Sequence[NonInferiority] = ()

    @property
    def table(self) -> RunTable:
        """Table of the runs."""
        return self.paired.table

    @property
    def verdict(self) -> str:
        """The result in one sentence: the shown differences, or how many worlds show one; empty without a comparison."""
        tested = {name: [row for row in rows if row.pairs] for name, rows in self.comparisons.items()}
        worlds = amount(max((row.worlds for rows in tested.values() for row in rows), default=0), "world")
        found = [_difference(name, rows) for name, rows in tested.items() if any(row.decided for row in rows)]
        if found:
            return f"{'; '.join(found)} ({worlds})."
        need = max(_worlds_needed(self.comparisons).values(), default=0)
        more = f"; it takes at least {need}" if need else ""
        return f"No difference between planners is shown in {worlds}{more}." if any(tested.values()) else ""

    @property
    def sentences(self) -> list[str]:
        """A sentence to quote for each measure, then one for each cause of intervals and p that disagree."""
        stated = [sentence for rows in self.comparisons.values() for sentence in quotes(self.paired, rows)]
        return [*stated, *disagreements(self.comparisons)]

    @property
    def notes(self) -> list[str]:
        """Caveats of the tables, a sentence each."""
        notes: list[str] = []
        if len(self.table) < self.size:
            notes.append(f"{self.size - len(self.table)} of {self.size} runs are not done yet.")
        notes += [*_shares(self), *_mixed(self), *_repeated(self.success)]
        if len(self.paired.worlds) == 1:
            notes.append("There is one world: the intervals and tests do not extend to other worlds.")
        else:
            notes += _too_few_worlds(self.comparisons)
        if self.refusal:
            notes.append(f"Planners are not compared: {self.refusal}.")
        return notes + [price.sentence for price in prices(self.table) if price.unpaired < price.drives]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "runs": len(self.table),
            "size": self.size,
            "planners": [row.as_dict() for row in self.success],
            "comparisons": {name: [row.as_dict() for row in rows] for name, rows in self.comparisons.items()},
            "not_worse": [row.as_dict() for row in self.allowances],
            "common": self.common,
            "medians": {
                name: [
                    {"planner": planner, "median": median, "interval": list(interval)}
                    for planner, (median, interval) in zip(self.paired.planners, rows, strict=True)
                ]
                for name, rows in self.medians.items()
            },
            "sentences": self.sentences,
            "notes": self.notes,
        }


def summarise(
    table: RunTable,
    *,
    title: str,
    size: int | None = None,
    metrics: Sequence[str] | None = None,
    against: str | None = None,
    planners: Sequence[str] = (),
    allow: Mapping[str, float] = MappingProxyType({}),
    strict: bool = False,
) -> CampaignSummary:
    """Compute a campaign's summary."""
    paired = PairedRuns.of(table, planners)
    table = paired.table
    chosen = list(metrics) if metrics is not None else known_metrics(paired, DEFAULT_METRICS)
    for name in chosen:
        if name not in METRICS:
            raise FieldError("metric", f"unknown {name!r}; choose from {', '.join(METRICS)}")
    comparisons: dict[str, Sequence[PairedComparison]] = {}
    refusal = ""
    try:
        pairs = pairs_of(paired, against)
    except FieldError as error:
        if strict or against is not None:
            raise
        refusal = error.problem
    else:
        comparisons[SUCCESS] = compare_success(paired, pairs)
        for name in chosen:
            comparisons[name] = compare_metric(paired, pairs, name, METRICS[name].better)
    common, medians = common_medians(paired, chosen)
    rows = success_table(paired)
    allowances = _allowances(paired, against, allow)
    return CampaignSummary(title, paired, size or len(table), rows, comparisons, common, medians, refusal, allowances)


def _allowances(paired: PairedRuns, against: str | None, allow: Mapping[str, float]) -> list[NonInferiority]:
    if allow and against is None:
        raise FieldError("allow", "needs a reference planner; set against")
    tests = []
    for name, allowed in allow.items():
        if name != SUCCESS and name not in METRICS:
            raise FieldError("allow", f"unknown {name!r}; choose from {', '.join([SUCCESS, *METRICS])}")
        better = "higher" if name == SUCCESS else METRICS[name].better
        tests += not_worse(paired, against or "", name, allowed, better)
    return tests


def known_metrics(paired: PairedRuns, names: Sequence[str]) -> list[str]:
    """Return the metrics that at least one successful run has."""
    return [name for name in names if np.isfinite(paired.values(name)).any()]


NAMED = 3  # planners named in a card
VALUES = 5  # values of a setting named in a note


def headline(table: RunTable, summary: CampaignSummary | None = None) -> list[tuple[str, str]]:
    """Return the headline numbers, each with its meaning; `summary` compares planners."""
    runs, good, outcomes = len(table), table.success, table.texts("outcome")
    size = summary.size if summary is not None else runs
    bounds, driven = table.numbers("bound_m"), table.numbers("driven_length_m")
    least = np.min(bounds[good], initial=math.inf, where=np.isfinite(bounds[good]))
    certified = np.array([value is not None for value in table.columns.get("certified", [None] * runs)])
    tested = ", as their tests demand" if any(table.texts("test")) else ""
    died = sum(map(outcomes.count, ("crashed", *FAULTS)))
    counted = [(len(set(table.texts(name))), name) for name in ("planner", "world", "seed")]
    return [
        (f"{int(good.sum()):,} / {runs:,}", f"reached the goal, certified collision-free{tested}"),
        *([(f"{runs:,}", f"of {size:,} runs done")] if runs < size else []),
        *((f"{count:,}", name if count == 1 else f"{name}s") for count, name in counted),
        *([_best(summary.success, summary.paired)] if summary is not None and summary.paired.shared.any() else []),
        *([(f"{rounded_down(least, 3):.3f} m", "smallest certified clearance")] if math.isfinite(least) else []),
        *([(f"{np.nansum(driven[certified]):,.1f} m", "driven in total")] if certified.any() else []),
        *([(str(died), "crashes and planner errors")] if died else []),
    ]


def _best(rows: Sequence[PlannerSuccess], paired: PairedRuns) -> tuple[str, str]:
    """Return the highest success rate and its planners."""
    rate = max(row.fraction for row in rows)
    best = [row for row in rows if row.fraction == rate]
    if len(best) == len(rows) > 1:
        names = "every planner"
    else:
        names = ", ".join(row.planner for row in best[:NAMED])
        names += f" and {len(best) - NAMED} more" if len(best) > NAMED else ""
    intervals = [row.across_worlds for row in best]
    wide = Interval(min(one.low for one in intervals), max(one.high for one in intervals))
    over = "over worlds" if len(paired.worlds) > 1 else "in this world"
    most = ", the highest rate" if len(best) < len(rows) else ""
    return f"{percent(rate)} %", f"succeeded with {names}{most} (95 % {over}: {percents(wide)})"


def _shares(summary: CampaignSummary) -> list[str]:
    """Return a note if the planners' success rates are over different instances."""
    paired = summary.paired
    shared = int(paired.shared.sum())
    if shared == len(paired.row):
        return []
    if not shared:
        return [
            "No instance was run by every planner: each share is over its planner's own instances; shares are not comparable."
        ]
    more = ", ".join(f"{row.planner} {row.elsewhere}" for row in summary.success if row.elsewhere)
    return [f"Shares are over the {shared} instances that every planner ran. Omitted runs of other instances: {more}."]


def _mixed(summary: CampaignSummary) -> list[str]:
    """Return a note for each setting whose values are pooled in the success rates and medians."""
    table, notes = summary.table, []
    worlds = table.texts("world")
    for name in table.settings:
        texts = table.texts(name)
        if name in HASHES or len(set(zip(worlds, texts, strict=True))) == len(set(worlds)):
            continue  # constant, or varying with the world only
        values = [_plain(text) for text in dict.fromkeys(texts)]
        some = ", ".join(value or "none" for value in values[:VALUES]) + (", …" if len(values) > VALUES else "")
        one = next(value for value in values if value)
        notes.append(
            f"Shares and medians are over several values of {name} ({some}); --where {name}={one} selects one."
        )
    return notes


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
        f"Drives of {', '.join(still)} do not depend on the seed. Repetitions count once, except in pairs with a planner whose "
        "drives do; planning times are medians over repetitions."
    ]


def _difference(measure: str, rows: Sequence[PairedComparison]) -> str:
    """Return the differences that a measure shows, in words."""
    decided = [row for row in rows if row.decided]
    title = "success" if measure == SUCCESS else Quantity.of(measure).title
    if len(rows) > 1:
        best = [name for name, count in Counter(row.decided for row in decided).most_common(1) if count > 1]
        led = f", {best[0]} leads most" if best and decided[0].direction != "neither" else ""
        return f"{len(decided)} of {len(rows)} pairs differ in {title}{led}"
    (row,) = decided
    other = row.second if row.decided == row.first else row.first
    if measure == SUCCESS:
        return f"{row.decided} succeeds more often than {other}"
    higher = (row.difference > 0) == (row.decided == row.first)
    return f"{row.decided} has the {'higher' if higher else 'lower'} {title}, {other} the {'lower' if higher else 'higher'}"


def _worlds_needed(comparisons: Mapping[str, Sequence[PairedComparison]]) -> dict[str, int]:
    """Return the least number of worlds that can distinguish any pair, for each measure whose worlds cannot."""
    return {
        measure: math.floor(1 + math.log2(sum(row.pairs > 0 for row in rows) / ALPHA)) + 1
        for measure, rows in comparisons.items()
        if any(row.pairs for row in rows) and not any(_decidable(row, rows) for row in rows)
    }


def _too_few_worlds(comparisons: Mapping[str, Sequence[PairedComparison]]) -> list[str]:
    """Return a note for measures with too few worlds to distinguish any pair of planners, whatever the results."""
    least: dict[tuple[int, int], list[str]] = {}
    for measure, need in _worlds_needed(comparisons).items():
        least.setdefault((max(row.worlds for row in comparisons[measure]), need), []).append(measure)
    notes = []
    for (worlds, need), measures in least.items():
        pairs = max(sum(row.pairs > 0 for row in comparisons[measure]) for measure in measures)
        of = "" if len(measures) == len(comparisons) else f" by {', '.join(measures)}"
        fewer = "" if pairs == 1 else ", or fewer pairs (--against, --planner)"
        notes.append(
            f"{worlds} {'world is' if worlds == 1 else 'worlds are'} too few to distinguish "
            f"{'a pair' if pairs == 1 else f'{pairs} pairs'} of planners{of}: it takes {need} worlds{fewer}."
        )
    return notes


def _decidable(row: PairedComparison, rows: Sequence[PairedComparison]) -> bool:
    """Return whether a pair's corrected p-values could be below 0.05 if all of its runs agreed."""

    def reached(units: int, tests: int) -> bool:
        return bool(units) and tests * max(2.0 ** (1 - units), 1 / (FLIPS + 1)) < ALPHA

    over = [other for other in rows if not math.isnan(other.p_worlds)]
    single = reached(row.pairs, sum(other.pairs > 0 for other in rows))
    return single and (math.isnan(row.p_worlds) or reached(row.worlds, len(over)))
