"""Reports about a campaign: a page that works offline, Markdown for pull requests, LaTeX for papers, CSV."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

from antdrive.base.atomic import written_whole
from antdrive.base.errors import InputError
from antdrive.sim.log.metrics import METRICS
from antdrive.views.campaign.cells import (
    WORDS,
    TextTable,
    all_cells,
    allowance_cells,
    pair_cells,
    success_cells,
    success_note,
)
from antdrive.views.campaign.headline import headline
from antdrive.views.campaign.summary import CampaignSummary, measure_title

MARKDOWN_ROWS = 60  # of a table
MARKDOWN_FAILURES = 25  # that are listed
LATEX_PAGE = 40  # rows of a table that fit on a page


def write_campaign_report(summary: CampaignSummary, folder: Path, out: Path) -> list[Path]:
    """Write a report about a campaign in the format of the file's suffix.

    Returns:
        The files written: for .csv two, the second with the pairs.

    Raises:
        InputError: another suffix, or the file cannot be written.
    """
    check_suffix(out)
    return WRITERS[out.suffix.lower()](summary, folder, out)


def check_suffix(out: Path) -> None:
    """Refuse a file of a kind that is not written, before any work.

    Raises:
        InputError: an unknown suffix.
    """
    if out.suffix.lower() not in WRITERS:
        raise InputError(f"{out}: unknown suffix {out.suffix!r}; choose one of {', '.join(WRITERS)}")


def _written(out: Path, text: str) -> list[Path]:
    with written_whole(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return [out]


def _write_csv(summary: CampaignSummary, folder: Path, out: Path) -> list[Path]:
    """Plain numbers, for programs: shares between 0 and 1, an empty cell where there is none."""
    names = list(summary.medians)
    with written_whole(out) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        medians = [f"{name}{end}" for name in names for end in ("_median", "_low", "_high")]
        outcomes = sorted({name for row in summary.success for name in row.outcomes})
        counts = ["planner", "runs", "elsewhere", "counted", "succeeded"]
        shares = ["share", "low", "high", "worlds_low", "worlds_high"]
        writer.writerow([*counts, *shares, *medians, *(f"outcome.{name}" for name in outcomes)])
        for k, row in enumerate(summary.success):
            found = [value for name in names for value in (summary.medians[name][k][0], *summary.medians[name][k][1])]
            counted = [row.planner, row.runs, row.elsewhere, row.counted, row.successes]
            ended = [row.outcomes.get(name, 0) for name in outcomes]
            writer.writerow(_plain([*counted, row.share, *row.interval, *row.over_worlds, *found, *ended]))
    rows = [row for comparisons in summary.comparisons.values() for row in comparisons]
    if not rows:
        return [out]
    other = out.with_name(f"{out.stem}-pairs{out.suffix}")
    with written_whole(other) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        flat = [{**row.as_dict(), "low": row.interval.low, "high": row.interval.high} for row in rows]
        keys = [key for key in flat[0] if key != "interval"]
        writer.writerow(keys)
        for one in flat:
            writer.writerow(_plain([one[key] for key in keys]))
    return [out, other]


def _plain(values: Sequence[Any]) -> list[Any]:
    return ["" if value != value else value for value in values]


def _write_latex(summary: CampaignSummary, folder: Path, out: Path) -> list[Path]:
    lines = ["% antdrive report; needs \\usepackage{booktabs} and, for long tables, \\usepackage{longtable}"]
    for table in all_cells(summary):
        lines += ["", f"% {latex_text(table.title)}", *_latex_table(table)]
    lines += ["", *(f"% {latex_text(note)}" for note in summary.notes)]
    return _written(out, "\n".join(lines).rstrip() + "\n")


def _latex_table(table: TextTable) -> list[str]:
    def line(cells: Sequence[str]) -> str:
        return " & ".join(latex_text(cell) for cell in cells) + r" \\"

    align = "".join("l" if heading in WORDS else "r" for heading in table.headings)
    environment = "longtable" if len(table.rows) > LATEX_PAGE else "tabular"
    head = [f"\\begin{{{environment}}}{{{align}}}", r"\toprule", line(table.headings), r"\midrule"]
    if environment == "longtable":
        head.append(r"\endhead")
    return [*head, *(line(row) for row in table.rows), r"\bottomrule", f"\\end{{{environment}}}"]


def latex_text(text: str) -> str:
    """A text as LaTeX shows it."""
    special = {
        "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--", "<": r"$<$",
        ">": r"$>$", "²": r"\textsuperscript{2}", "∞": r"$\infty$", "·": r"$\cdot$",
    }  # fmt: skip
    text = re.sub(r"[\\~^–<>²∞·&%$#_{}]", lambda found: special.get(found[0], "\\" + found[0]), text)
    return re.sub(r"(?<![\w.])-(?=\d)", "$-$", text)


def _write_markdown(summary: CampaignSummary, folder: Path, out: Path) -> list[Path]:
    environment = _environment()
    failures = [k for k, good in enumerate(summary.table.success) if not good]
    table = summary.table
    listed = [
        {name: table.texts(name)[k] for name in ("world", "planner", "seed", "outcome", "reason", "command")}
        for k in failures[:MARKDOWN_FAILURES]
    ]
    text = environment.get_template("campaign.md.j2").render(
        **_common(summary),
        tables=all_cells(summary),
        words=WORDS,
        most=MARKDOWN_ROWS,
        failures=listed,
        failed=len(failures),
    )
    return _written(out, text)


def _write_page(summary: CampaignSummary, folder: Path, out: Path) -> list[Path]:
    from antdrive.views.campaign.charts import campaign_charts
    from antdrive.views.campaign.colours import label_styles
    from antdrive.views.campaign.payload import page_data

    names = dict(zip(summary.table.texts("planner"), summary.table.texts("planner_name"), strict=True))
    planners = summary.paired.planners
    styles = label_styles(planners, [names[label] or label for label in planners])
    base = quote(Path(os.path.relpath(folder.resolve(), out.resolve().parent)).as_posix()) + "/"
    text = (
        _environment()
        .get_template("campaign.html.j2")
        .render(
            **_common(summary),
            styles=styles,
            planners=planners,
            number={label: k for k, label in enumerate(planners)},
            success=list(zip(summary.success, success_cells(summary).rows, strict=True)),
            success_headings=success_cells(summary).headings,
            success_note=success_note,
            pairs=[(name, pair_cells(name, found)) for name, found in summary.comparisons.items()],
            allowances=allowance_cells(summary) if summary.allowances else None,
            measure_title=measure_title,
            words=WORDS,
            charts=campaign_charts(summary, styles),
            data=page_data(summary.table, planners, base),
        )
    )
    return _written(out, text)


def _common(summary: CampaignSummary) -> dict[str, Any]:
    return {
        "title": summary.title,
        "version": metadata.version("antdrive"),
        "summary": summary,
        "cards": headline(summary),
        "notes": summary.notes,
        "definitions": {name: METRICS[name].definition for name in summary.comparisons if name in METRICS},
    }


def _environment() -> Any:
    import jinja2

    from antdrive.views.report.report import fence_for, markdown_text

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(["html.j2"]),
    )
    environment.filters |= {"md": markdown_text, "fence": fence_for}
    return environment


Writer = Callable[[CampaignSummary, Path, Path], list[Path]]
WRITERS: Mapping[str, Writer] = MappingProxyType(
    {".html": _write_page, ".md": _write_markdown, ".tex": _write_latex, ".csv": _write_csv}
)
