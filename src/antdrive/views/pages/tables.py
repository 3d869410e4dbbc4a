"""Tables of a campaign as text, LaTeX and CSV."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from antdrive.base.atomic import atomic_write, write_text
from antdrive.base.errors import FieldError, amount
from antdrive.runs.statistics.comparison import SUCCESS, PairedComparison
from antdrive.runs.statistics.success import PlannerSuccess
from antdrive.sim.log.metrics import METRICS
from antdrive.views.pages.campaign_summary import CampaignSummary
from antdrive.views.pages.rendering import NONE, Quantity, TextTable, percent, percents, probability

#: Headings of text columns.
WORDS = ("planner", "first", "second", "better", "lower", "against", "measure", "not worse")
LATEX_PAGE = 40  # table rows per page


def success_cells(summary: CampaignSummary) -> TextTable:
    """Return each planner's success rate and its medians over the instances solved by all planners."""
    medians = summary.medians.values()
    quantities = [Quantity.of(name) for name in summary.medians]
    elsewhere = any(row.elsewhere for row in summary.success)
    over = any(not math.isnan(row.over_worlds.low) for row in summary.success)
    headings = (
        *("planner", "share [%]", "95 % interval"),
        *(["over worlds"] if over else []),
        *("succeeded", "counted", "runs", *(["elsewhere"] if elsewhere else [])),
        *(f"median {quantity.heading}" for quantity in quantities),
    )
    rows = []
    for k, row in enumerate(summary.success):
        rows.append(
            (
                row.planner,
                percent(row.fraction),
                percents(row.interval),
                *([percents(row.across_worlds)] if over else []),
                *(str(row.successes), str(row.counted), str(row.runs)),
                *([str(row.elsewhere)] if elsewhere else []),
                *(
                    f"{quantity.text(median)} ({quantity.text(low)} to {quantity.text(high)})"
                    for quantity, (median, (low, high)) in zip(quantities, (rows[k] for rows in medians), strict=True)
                ),
            )
        )
    smoothings = list(dict.fromkeys(summary.table.texts("smoothing")))
    note = f"Wilson's intervals; medians over the {summary.common} instances that every planner solved."
    return TextTable(f"Success by planner (smoothing {', '.join(smoothings)})", headings, rows, note)


def pair_cells(measure: str, comparisons: Sequence[PairedComparison]) -> TextTable:
    """Return the comparison of each pair of planners by one measure."""
    over = any(not math.isnan(row.p_worlds) for row in comparisons)
    unpaired = any(row.unpaired for row in comparisons)
    success = measure == SUCCESS
    directed = not any(row.direction == "neither" for row in comparisons)
    headings = (
        *("first", "second", "better" if directed else "lower"),
        *("difference" + (" [%]" if success else ""), "95 % interval", "p (Holm)"),
        *(["p worlds (Holm)"] if over else []),
        *("effect", "pairs", *(("wins", "losses") if directed else ("less", "more")), "ties"),
        *([] if success else ["dropped"]),
        *(["unpaired"] if unpaired else []),
    )
    quantity = Quantity.of(measure)
    title, shown = ("Success of pairs", percent) if success else (quantity.heading, quantity.text)
    return TextTable(
        title, headings, [_pair_row(row, shown, over, unpaired) for row in comparisons], _tests(measure, over)
    )


def _tests(measure: str, over: bool) -> str:
    """Return the tests and the direction of a table of pairs in words."""
    better = "higher" if measure == SUCCESS else METRICS[measure].better
    test = "Exact McNemar test" if measure == SUCCESS else "Wilcoxon's signed rank test where both succeeded"
    worlds = "; p worlds: sign flips of whole worlds" if over else ""
    direction = "no direction is better" if better == "neither" else f"{better} is better"
    size = "of shares" if measure == SUCCESS else "median of pairs"
    return f"{direction[0].upper()}{direction[1:]}. Difference: first minus second, {size}. {test}{worlds}; Holm's correction."


def _pair_row(row: PairedComparison, shown: Callable[[float], str], over: bool, unpaired: bool) -> tuple[str, ...]:
    return (
        row.first,
        row.second,
        row.decided or NONE,
        shown(row.difference),
        NONE if math.isnan(row.interval.low) else f"{shown(row.interval.low)} to {shown(row.interval.high)}",
        probability(row.p_holm),
        *([probability(row.p_worlds_holm)] if over else []),
        NONE if not row.pairs else f"{row.effect + 0.0:.2f}",
        *(str(row.pairs), str(row.first_wins), str(row.second_wins), str(row.ties)),
        *([] if row.measure == SUCCESS else [str(row.dropped)]),
        *([str(row.unpaired)] if unpaired else []),
    )


def outcome_cells(summary: CampaignSummary) -> TextTable:
    """Return the outcomes of each planner's runs, the most frequent first."""
    total = Counter[str]()
    for row in summary.success:
        total.update(row.outcomes)
    names = [name for name, _ in sorted(total.items(), key=lambda item: (-item[1], item[0]))]
    rows = [
        (row.planner, *(str(row.outcomes.get(name, 0)) for name in names), str(row.runs)) for row in summary.success
    ]
    return TextTable("Outcomes", ("planner", *(name.replace("_", " ") for name in names), "runs"), rows)


def all_cells(summary: CampaignSummary) -> list[TextTable]:
    """Return all tables of a campaign."""
    pairs = (pair_cells(name, rows) for name, rows in summary.comparisons.items())
    allowed = [allowance_cells(summary)] if summary.allowances else []
    return [success_cells(summary), outcome_cells(summary), *pairs, *allowed]


def chosen_tables(tables: Sequence[TextTable], columns: Sequence[str]) -> list[TextTable]:
    """Return the tables that have all of these columns, with these alone, in this order; all tables without columns.

    Columns may leave out units and brackets: `share` stands for `share [%]`.

    Raises:
        FieldError: no table has all of the columns.
    """
    if not columns:
        return list(tables)
    found: list[TextTable] = []
    for table in tables:
        places = {_plain(heading): k for k, heading in enumerate(table.headings)}
        picked = [places.get(_plain(column), -1) for column in columns]
        if -1 not in picked:
            rows = [tuple(row[k] for k in picked) for row in table.rows]
            found.append(TextTable(table.title, tuple(table.headings[k] for k in picked), rows, table.note))
    if not found:
        have = "; ".join(dict.fromkeys(", ".join(map(_plain, table.headings)) for table in tables))
        raise FieldError("columns", f"no table has {', '.join(columns)}; choose from {have}")
    return found


def _plain(heading: str) -> str:
    """Return a heading without its unit."""
    return re.sub(r"\s*[\[(][^\])]*[\])]", "", heading).strip().lower()


def allowance_cells(summary: CampaignSummary) -> TextTable:
    """Return the planners' non-inferiority tests."""
    headings = ("planner", "against", "measure", "not worse", "allowed", "advantage", "95 % of all", "worlds", "needed")
    rows: list[tuple[str, ...]] = []
    for row in summary.allowances:
        quantity = Quantity.of(row.measure)
        title, shown = ("success [%]", percent) if row.measure == SUCCESS else (quantity.heading, quantity.text)
        passed = "yes" if row.not_worse else NONE
        ends = f"{shown(row.interval.low)} to {shown(row.interval.high)}"
        counts = (str(row.worlds), str(row.needed))
        rows.append(
            (row.planner, row.reference, title, passed, shown(row.allowed), shown(row.advantage), ends, *counts)
        )
    return TextTable("Not worse by more than allowed", headings, rows)


def success_note(row: PlannerSuccess) -> str:
    """Return the outcomes of a planner's runs in words, the most frequent first."""
    outcomes = sorted(row.outcomes.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in outcomes)


def write_csv(summary: CampaignSummary, out: Path, columns: Sequence[str] = ()) -> list[Path]:
    """Write plain numbers as CSV: fractions from 0 to 1, empty cells for missing values."""
    names = list(summary.medians)
    medians = [f"{name}{end}" for name in names for end in ("_median", "_low", "_high")]
    outcomes = sorted({name for row in summary.success for name in row.outcomes})
    counts = ["planner", "runs", "elsewhere", "counted", "succeeded"]
    shares = ["share", "low", "high", "worlds_low", "worlds_high"]
    lines: list[list[Any]] = [[*counts, *shares, *medians, *(f"outcome.{name}" for name in outcomes)]]
    for k, row in enumerate(summary.success):
        centres = [value for name in names for value in (summary.medians[name][k][0], *summary.medians[name][k][1])]
        counted = [row.planner, row.runs, row.elsewhere, row.counted, row.successes]
        ended = [row.outcomes.get(name, 0) for name in outcomes]
        lines.append([*counted, row.fraction, *row.interval, *row.over_worlds, *centres, *ended])
    if columns:
        (table,) = chosen_tables([TextTable("", tuple(lines[0]), [tuple(line) for line in lines[1:]])], columns)
        _write_lines(out, [table.headings, *table.rows])
        return [out]
    _write_lines(out, lines)
    pairs = [row for comparisons in summary.comparisons.values() for row in comparisons]
    if not pairs:
        return [out]
    flat = [{**row.as_dict(), "low": row.interval.low, "high": row.interval.high} for row in pairs]
    keys = [key for key in flat[0] if key != "interval"]
    other = out.with_name(f"{out.stem}-pairs{out.suffix}")
    _write_lines(other, [keys, *([one[key] for key in keys] for one in flat)])
    return [out, other]


def _write_lines(path: Path, lines: Sequence[Sequence[Any]]) -> None:
    """Write comma-separated values, with empty cells for NaN."""
    with atomic_write(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows(["" if value != value else value for value in line] for line in lines)


def write_latex(summary: CampaignSummary, out: Path, columns: Sequence[str] = ()) -> list[Path]:
    """Write the tables as LaTeX, each with a caption and a label."""
    lines = ["% antdrive report; needs \\usepackage{booktabs} and, for long tables, \\usepackage{longtable}"]
    for table in chosen_tables(all_cells(summary), columns):
        lines += ["", f"% {latex_text(table.title)}", *_latex_table(table, summary)]
    lines += ["", *(f"{latex_text(sentence)}\n" for sentence in summary.sentences)]
    lines += [f"% {latex_text(note)}" for note in summary.notes]
    return [write_text(out, "\n".join(lines).rstrip() + "\n")]


def _latex_table(table: TextTable, summary: CampaignSummary) -> list[str]:
    def line(cells: Sequence[str]) -> str:
        return " & ".join(latex_text(cell) for cell in cells) + r" \\"

    align = "".join("l" if heading in WORDS else "r" for heading in table.headings)
    counts = f"{amount(len(summary.table), 'run')} in {amount(len(summary.paired.worlds), 'world')}"
    caption = f"\\caption{{{latex_text(f'{table.title} ({summary.title}: {counts}). {table.note}'.strip())}}}"
    label = f"\\label{{tab:{re.sub('[^a-z0-9]+', '-', f'{summary.title} {table.title}'.lower()).strip('-')}}}"
    head, body = [r"\toprule", line(table.headings), r"\midrule"], [*map(line, table.rows), r"\bottomrule"]
    if len(table.rows) > LATEX_PAGE:
        named = f"{caption}{label} \\\\"
        return [f"\\begin{{longtable}}{{{align}}}", named, *head, r"\endhead", *body, r"\end{longtable}"]
    inner = [f"\\begin{{tabular}}{{{align}}}", *head, *body, r"\end{tabular}"]
    return [r"\begin{table}", r"\centering", caption, label, *inner, r"\end{table}"]


def latex_text(text: str) -> str:
    """Escape a text for LaTeX."""
    special = {
        "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--", "<": r"$<$",
        ">": r"$>$", "²": r"\textsuperscript{2}", "³": r"\textsuperscript{3}", "∞": r"$\infty$", "·": r"$\cdot$",
    }  # fmt: skip
    text = re.sub(r"[\\~^–<>²³∞·&%$#_{}]", lambda found: special.get(found[0], "\\" + found[0]), text)
    return re.sub(r"(?<![\w.])-(?=\d)", "$-$", text)
