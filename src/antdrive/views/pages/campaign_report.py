"""Campaign reports: an offline page, Markdown for pull requests, LaTeX for papers, and CSV."""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from antdrive.base.atomic import write_text
from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.files import known_suffix
from antdrive.planners.user_code import record_name
from antdrive.runs.campaigns.results import common_folder, read_runs
from antdrive.runs.statistics.run_table import HASHES, RunTable
from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.outcome import Outcome
from antdrive.views.pages.campaign_summary import CampaignSummary, headline, measure_title, summarise
from antdrive.views.pages.rendering import json_column, json_texts, link_to, page_data, rendered
from antdrive.views.pages.tables import (
    WORDS,
    all_cells,
    allowance_cells,
    chosen_tables,
    pair_cells,
    success_cells,
    success_note,
    write_csv,
    write_latex,
)

if TYPE_CHECKING:
    from antdrive.views.colours import LabelStyle

MARKDOWN_ROWS = 60  # per table
MARKDOWN_FAILURES = 25  # listed failures
#: Columns of a campaign's page, if present; differing tasks and settings come between them.
SHOWN = ("world", "planner", "outcome", "seed")
MEASURED = ("plan_length_m", "driven_length_m", "duration_s", "min_clearance_m", "plan_s")
SENTENCES = {
    **{outcome.key: outcome.value for outcome in Outcome},
    "crashed": "the process of the run died",
    "planner_fault": "the planner raised an error",
    "too_slow": "the run took longer than the campaign allows",
}


def summarise_campaign(
    folder: str | Path | Sequence[str | Path],
    *,
    title: str | None = None,
    metrics: Sequence[str] | None = None,
    against: str | None = None,
    planners: Sequence[str] = (),
    allow: Mapping[str, float] = MappingProxyType({}),
    where: Mapping[str, str] = MappingProxyType({}),
    strict: bool = False,
) -> CampaignSummary:
    """Summarise a campaign's completed runs: success of each planner and paired comparisons.

    Args:
        folder: the campaign's folder, or several; the folder's name distinguishes equal configurations of several folders, as
            in "astar @today"
        title: the report's title; default: the folders' names
        metrics: metrics to compare besides success; default: driven length, duration and planning time
        against: label of the planner to compare with all others; default: every pair
        planners: labels of the planners to include; default: all
        allow: largest loss against `against` that counts as not worse, such as {"success": 0.02}
        where: values of the runs to include, by column, such as {"noise": "1"}, "0,1" or, for numbers, "10..20"
        strict: whether to raise, instead of adding a note, if no two planners can be compared

    Raises:
        InputError: the folder holds no campaign, no finished run, or no such planner or metric.
    """
    folders = _folders(folder)
    try:
        table, size = read_runs(folders, where, planners)
        named = title or ", ".join(one.resolve().name for one in folders)
        asked: dict[str, Any] = {"against": against, "planners": planners, "allow": allow, "strict": strict}
        return summarise(table, title=named, size=size, metrics=metrics, **asked)
    except FieldError as error:
        raise input_error(" ".join(map(str, folders)), str(error)) from None


def _folders(folder: str | Path | Sequence[str | Path]) -> list[Path]:
    return [Path(one) for one in ([folder] if isinstance(folder, str | Path) else folder)]


def report_campaign(
    folder: str | Path | Sequence[str | Path],
    out: str | Path | None,
    *,
    title: str | None = None,
    metrics: Sequence[str] | None = None,
    against: str | None = None,
    planners: Sequence[str] = (),
    allow: Mapping[str, float] = MappingProxyType({}),
    where: Mapping[str, str] = MappingProxyType({}),
    columns: Sequence[str] = (),
    figures: str | Path | None = None,
) -> list[Path]:
    """Write a campaign's report, a page or its tables, or its charts.

    Args:
        folder: the campaign's folder, or several; the folder's name distinguishes equal configurations of several folders, as
            in "astar @today"
        out: the file to write: .html, .md, .tex or .csv; None: charts alone
        title: the report's title; default: the folders' names
        metrics: metrics to compare besides success; default: driven length, duration and planning time
        against: label of the planner to compare with all others; default: every pair
        planners: labels of the planners to include; default: all
        allow: largest loss against `against` that counts as not worse, such as {"success": 0.02}
        where: values of the runs to include, by column, such as {"noise": "1"}, "0,1" or, for numbers, "10..20"
        columns: headings of the tables to write, in order; tables without all of them are left out; not for .html
        figures: folder for the charts as PDF and SVG; None: none

    Returns:
        The written files; for .csv the second holds the pairs.

    Raises:
        InputError: the folder holds no campaign, no finished run, or no such planner, metric or column; another suffix.
    """
    target = None if out is None else Path(out)
    if target is not None:
        suffix = check_suffix(target)
    if columns and (target is None or suffix == ".html"):
        raise InputError("--columns: applies to .md, .tex and .csv")
    summary = summarise_campaign(
        folder, title=title, metrics=metrics, against=against, planners=planners, allow=allow, where=where
    )
    files = [] if target is None else write_campaign_report(summary, common_folder(_folders(folder)), target, columns)
    if figures is not None:
        from antdrive.views.pages.charts import campaign_charts, write_charts

        charts = campaign_charts(summary, _styles(summary))
        files += write_charts(charts, summary.paired.planners, Path(figures))
    return files


def write_campaign_report(summary: CampaignSummary, folder: Path, out: Path, columns: Sequence[str] = ()) -> list[Path]:
    """Write a campaign's report in the format of the file's suffix, if given with these columns of its tables."""
    try:
        return WRITERS[check_suffix(out)](summary, folder, out, columns)
    except FieldError as error:
        raise InputError(f"--{error}") from None


def check_suffix(out: Path) -> str:
    """Return the suffix of a report; raise `InputError` if it is unknown."""
    return known_suffix(out, WRITERS)


def _write_markdown(summary: CampaignSummary, folder: Path, out: Path, columns: Sequence[str]) -> list[Path]:
    failures = [k for k, good in enumerate(summary.table.success) if not good]
    facts = {name: summary.table.texts(name) for name in ("world", "planner", "seed", "outcome", "reason")}
    facts["command"] = [command or "" for command in _own_commands(summary.table)]
    listed = [{name: texts[k] for name, texts in facts.items()} for k in failures[:MARKDOWN_FAILURES]]
    tables = {"tables": chosen_tables(all_cells(summary), columns), "words": WORDS, "most": MARKDOWN_ROWS}
    text = rendered("page.md.j2", **_common(summary), **tables, failures=listed, failed=len(failures))
    return [write_text(out, text)]


def _styles(summary: CampaignSummary) -> list[LabelStyle]:
    """Return the styles of a campaign's planners."""
    from antdrive.views.colours import label_styles

    names = dict(zip(summary.table.texts("planner"), summary.table.texts("planner_name"), strict=True))
    planners = summary.paired.planners
    return label_styles(planners, [record_name(names[label]) or label for label in planners])


def _write_page(summary: CampaignSummary, folder: Path, out: Path, columns: Sequence[str]) -> list[Path]:
    from antdrive.views.pages.charts import campaign_charts

    planners, styles = summary.paired.planners, _styles(summary)
    base = link_to(folder, out.parent) + "/"
    text = rendered(
        "page.html.j2",
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
        rows=len(summary.table),
        data=campaign_data(summary.table, planners, base),
    )
    return [write_text(out, text)]


def campaign_data(table: RunTable, planners: Sequence[str], base: str) -> str:
    """Return a campaign's runs as JSON for a script element."""
    columns = [json_column(name, table.columns[name]) for name in table.columns if name != "command"]
    kept = [column for column in (*columns, {"name": "command", **_commands(table)}) if column is not None]
    axes = [name for name in ("folder", "task", *table.settings) if name not in HASHES]
    different = [name for name in axes if len(set(table.columns.get(name, [None]))) > 1]
    options = [name for name in table.columns if name.startswith("option.")]
    names = {column["name"] for column in kept}
    return page_data(
        kept,
        [name for name in (*SHOWN[:2], *different, *options, *SHOWN[2:], *MEASURED) if name in names],
        {column["name"]: _title(column["name"]) for column in kept},
        [bool(value) for value in table.success],
        planners,
        sentences=SENTENCES,
        base=base,
    )


def _commands(table: RunTable) -> dict[str, Any]:
    """Return the commands; a common final seed is dropped, so that equal commands are stored once."""
    commands = _own_commands(table)
    tails = [f" --seed {seed}" for seed in table.texts("seed")]
    if all(command is None or command.endswith(tail) for command, tail in zip(commands, tails, strict=True)):
        short = [None if one is None else one.removesuffix(tail) for one, tail in zip(commands, tails, strict=True)]
        return {**json_texts(short), "seeded": True}
    return json_texts(commands)


def _own_commands(table: RunTable) -> list[str | None]:
    """Return the commands that antdrive wrote for these runs; None for any other text, since readers copy them to a shell."""
    given = zip(table.texts("command"), table.texts("planner_name"), table.texts("seed"), strict=True)
    return [text if _is_own(text, planner, seed) else None for text, planner, seed in given]


def _is_own(text: str, planner: str, seed: str) -> bool:
    """Return whether a text is an `antdrive run` command of a planner and a seed, after commands that generate its world."""
    try:
        commands = [shlex.split(command) for command in text.split(" && ")]
    except ValueError:  # a quotation without end
        return False
    *before, last = commands
    known = all(words[:3] == ["antdrive", "worlds", "generate"] for words in before) and last[:2] == ["antdrive", "run"]
    if (
        not known
        or not text.isprintable()
        or " && ".join(map(shlex.join, commands)) != text
        or last[-2:] != ["--seed", seed]
    ):
        return False
    named = [after for word, after in itertools.pairwise(last) if word == "--planner"]
    return [record_name(word) for word in named] == [record_name(planner)]


def _title(name: str) -> str:
    if name not in METRICS and name.endswith("_m"):
        return f"{name.removesuffix('_m').replace('_', ' ')} [m]"
    return measure_title(name) if name in METRICS else name.removeprefix("option.").replace("_", " ")


def _common(summary: CampaignSummary) -> dict[str, Any]:
    definitions = {name: METRICS[name].definition for name in summary.comparisons if name in METRICS}
    parts = {"cards": headline(summary), "notes": [*summary.sentences, *summary.notes], "definitions": definitions}
    return {"title": summary.title, "summary": summary, **parts}


WRITERS: Mapping[str, Callable[[CampaignSummary, Path, Path, Sequence[str]], list[Path]]] = MappingProxyType(
    {
        ".html": _write_page,
        ".md": _write_markdown,
        ".tex": lambda summary, _, out, columns: write_latex(summary, out, columns),
        ".csv": lambda summary, _, out, columns: write_csv(summary, out, columns),
    }
)
