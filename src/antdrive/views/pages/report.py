"""Reports: an offline page, Markdown for pull requests, LaTeX for papers, and CSV.

One page shows a run, several runs, the tests of a suite, or a campaign: headline numbers and a sortable table of runs, which
links the files of each. A campaign also has the comparison of its planners. The Markdown lists failures first and stays below
60 kB.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import os
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from antdrive.base.atomic import write_text
from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.files import file_name, known_suffix
from antdrive.base.user_code import record_name
from antdrive.runs.campaigns.results import common_folder, read_runs
from antdrive.runs.campaigns.store import MANIFEST
from antdrive.runs.statistics.run_table import HASHES, RunTable
from antdrive.sim.facts import LoggedRun
from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run
from antdrive.views.pages.campaign_summary import CampaignSummary, headline, summarise
from antdrive.views.pages.rendering import (
    NONE,
    Quantity,
    TextTable,
    json_column,
    json_texts,
    link_to,
    measure_title,
    rendered,
    script_json,
    shown,
)
from antdrive.views.pages.reported_runs import ReportedRun, find_runs, reported_run, run_table
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

#: Suffixes of a campaign's report, and of one of runs.
SUFFIXES, RUN_SUFFIXES = (".html", ".md", ".tex", ".csv"), (".html", ".md")
MARKDOWN_BYTES = 60_000  # of a Markdown report; GitHub refuses comments of more than 65,536 characters
MARKDOWN_ROWS = 60  # per table of a campaign
MARKDOWN_FAILURES = 25  # listed failures
MOST_VIEWS = 20  # pages of a campaign's failed drives
MOST_ROWS, MOST_OUTCOMES = 256, 12  # of runs
#: Columns of runs with their meaning, if it is not obvious; settings that differ come after the planner.
MEASURED: Mapping[str, str] = MappingProxyType(
    {
        "path_length_m": "length of the planned path, before smoothing",
        "driven_length_m": "",
        "gap_to_euclidean_optimum": "excess of the smoothed route over the shortest path around the no-go area",
        "duration_s": "",
        "min_clearance_m": "smallest distance to an obstacle at any logged pose",
        "bound_m": "clearance guaranteed by the certificate, including between logged poses",
        "plan_s": "wall time of planning, without compiling and loading kernels",
        "explored_m2": "area scanned by a mapless robot's lidar at any range; its occupancy map covers less",
    }
)
SENTENCES = {
    **{outcome.key: outcome.value for outcome in Outcome},
    "crashed": "the process of the run died",
    "planner_fault": "the planner raised an error",
    "controller_fault": "the controller raised an error",
    "too_slow": "the run took longer than the campaign allows",
}


@dataclass(frozen=True, eq=False)
class Report:
    """Content of a report."""

    title: str
    table: RunTable  # the runs, a row each
    base: Path  # folder of the campaign, to which its logs are relative
    summary: CampaignSummary | None = None  # comparison of a campaign's planners
    runs: Sequence[ReportedRun] = ()  # one per row; empty for a campaign

    @classmethod
    def of(cls, summary: CampaignSummary, folder: Path) -> Report:
        """Return the report of a campaign in a folder."""
        return cls(summary.title, summary.table, folder, summary)

    @functools.cached_property
    def planners(self) -> tuple[str, ...]:
        """The planners' labels."""
        return self.summary.paired.planners if self.summary else tuple(sorted(set(self.table.texts("planner"))))

    @functools.cached_property
    def styles(self) -> list[LabelStyle]:
        """The styles of the planners."""
        from antdrive.views.colours import label_styles

        names = dict(zip(self.table.texts("planner"), self.table.texts("planner_name"), strict=True))
        return label_styles(self.planners, [record_name(names[label]) or label for label in self.planners])

    @functools.cached_property
    def differing(self) -> list[str]:
        """Columns of settings and options that differ between runs."""
        axes = [name for name in ("folder", "task", *self.table.settings) if name not in HASHES]
        options = [name for name in self.table.columns if name.startswith("option.")]
        return [name for name in axes if len(set(self.table.columns.get(name, [None]))) > 1] + options

    @functools.cached_property
    def shown(self) -> list[str]:
        """Columns that the table of runs shows."""
        names = ("world", "planner", *self.differing, "outcome", "seed", *MEASURED)
        return [name for name in names if any(value is not None for value in self.table.columns.get(name, ()))]

    @functools.cached_property
    def quantities(self) -> dict[str, Quantity]:
        """How the columns are shown."""
        return {name: Quantity.of(name) for name in self.table.columns}

    def write(self, out: Path, columns: Sequence[str] = ()) -> list[Path]:
        """Write the report in the format of the file's suffix, a campaign's tables with these columns; return the files.

        Raises:
            InputError: an unknown suffix or column.
        """
        kind = known_suffix(out, SUFFIXES if self.summary else RUN_SUFFIXES)
        try:
            if self.summary is not None and kind in (".tex", ".csv"):
                return (write_latex if kind == ".tex" else write_csv)(self.summary, out, columns)
            return [
                write_text(out, _page(self, out.parent) if kind == ".html" else _markdown(self, out.parent, columns))
            ]
        except FieldError as error:
            raise InputError(f"--{error}") from None


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
    folders = [Path(one) for one in ([folder] if isinstance(folder, str | Path) else folder)]
    try:
        table, size = read_runs(folders, where, planners)
        named = title or ", ".join(one.resolve().name for one in folders)
        asked: dict[str, Any] = {"against": against, "planners": planners, "allow": allow, "strict": strict}
        return summarise(table, title=named, size=size, metrics=metrics, **asked)
    except FieldError as error:
        raise input_error(" ".join(map(str, folders)), str(error)) from None


class ReportFiles(NamedTuple):
    """Extent of a written report."""

    runs: int  # number of runs
    files: list[Path]  # the report, a campaign's pairs for .csv, and the charts


def write_report(
    sources: Run | str | os.PathLike[str] | Iterable[Run | str | os.PathLike[str]],
    out: str | os.PathLike[str] | None,
    *,
    title: str | None = None,
    columns: Sequence[str] = (),
    charts: str | os.PathLike[str] | None = None,
    width: float | None = None,
    **compared: Any,
) -> ReportFiles:
    """Write a report of runs from Python and of all runs below folders, or of campaigns.

    >>> write_report([run(scenario), "out/slalom"], "report.html").runs
    2

    Args:
        sources: runs and folders with runs of `antdrive run --out`, one or more; or campaign folders
        out: the file to write: a page (.html) or Markdown for a pull request (.md), of a campaign also .tex or .csv; None:
            charts alone
        title: the report's title; default: the folders' names
        columns: headings of a campaign's tables to write, in order; tables without all of them are left out; not for .html
        charts: folder for all charts as PDF and SVG, with their captions in `figures.tex`; None: none
        width: of a campaign's charts [inches], such as 3.4 for a column; None: 4.7
        compared: metrics, against, planners, allow and where, as in `summarise_campaign`

    Raises:
        InputError: no runs, an invalid `result.json`, an unknown suffix, or no such planner, metric or column.
    """
    given: list[Any] = [sources] if isinstance(sources, Run | str | os.PathLike) else list(sources)
    folders = [Path(one) for one in given if not isinstance(one, Run)]
    campaigns = (
        bool(folders) and all((folder / MANIFEST).is_file() for folder in folders) and len(folders) == len(given)
    )
    target = None if out is None else Path(out)
    if target is not None:
        known_suffix(target, SUFFIXES if campaigns else RUN_SUFFIXES)
    if columns and (target is None or target.suffix == ".html"):
        raise InputError("--columns: applies to .md, .tex and .csv")
    if not campaigns:
        if target is not None:
            report = _of_runs(given, target, title)
        drawn = [] if charts is None else write_run_figures(folders, Path(charts))
        return ReportFiles(len(report.table), report.write(target) + drawn) if target else ReportFiles(0, drawn)
    summary = summarise_campaign(folders, title=title, **compared)
    report = Report.of(summary, common_folder(folders))
    files = [] if target is None else report.write(target, columns)
    if charts is not None:
        from antdrive.views.pages.charts import WIDTH, campaign_charts, write_charts

        pictures = campaign_charts(summary, report.styles)
        files += write_charts(pictures, report.planners, Path(charts), width or WIDTH)
    return ReportFiles(len(report.table), files)


def _of_runs(given: Sequence[Any], target: Path, title: str | None) -> Report:
    """Return the report of runs and of folders with runs."""
    reported = list[ReportedRun]()
    for source in given:
        found = [reported_run(source)] if isinstance(source, Run) else list(find_runs(Path(source)))
        if not found:
            raise InputError(f"{source}: no runs (no result.json); write them with `antdrive run --out`")
        reported += found
    if not reported:
        raise InputError(f"{target}: no runs to report")
    name = title or (Path(given[0]).resolve().name if len(given) == 1 and not isinstance(given[0], Run) else "runs")
    return Report(shown(name), run_table(reported), target.parent, runs=reported)


def write_run_figures(folders: Iterable[Path], out: Path) -> list[Path]:
    """Write the overview of every drive below folders, and a comparison of each world's, as PDF and SVG."""
    from antdrive.views.colours import label_styles
    from antdrive.views.figures.canvas import PRINTED
    from antdrive.views.figures.run_figures import comparison_figure, overview

    files, planners = list[Path](), dict[str, str]()
    cases: dict[tuple[str, int], dict[str, Rollout]] = {}
    for log in [path for folder in folders for path in sorted(folder.rglob("rollout.npz"))]:
        rollout = Rollout.load(log)
        name, task = log.parent.name, rollout.record.task
        stem = file_name("-".join(log.parent.parts[-2:]))
        for path in [out / f"{stem}-overview{suffix}" for suffix in PRINTED]:
            overview(rollout, path)
            files.append(path)
        cases.setdefault((task.world.name, rollout.record.seed), {})[name] = rollout
        planners[name] = rollout.record.planner.name
    styles = dict(zip(planners, label_styles(list(planners), list(planners.values())), strict=True))
    for (world, seed), drives in cases.items():
        for path in [out / file_name(f"{world}-{seed}-comparison{end}") for end in PRINTED if len(drives) > 1]:
            comparison_figure(drives, path, styles=styles)
            files.append(path)
    if not files:
        raise InputError(f"{', '.join(map(str, folders))}: no logs (no rollout.npz) to draw")
    return files


def _markdown(report: Report, folder: Path, columns: Sequence[str]) -> str:
    """Return the Markdown for a folder; rows and failures of runs beyond the size limit are only counted."""
    success, outcomes = report.table.success, report.table.texts("outcome")
    ordered = sorted(range(len(success)), key=lambda k: bool(success[k]))
    failures = [k for k in ordered if not success[k]]
    tables = chosen_tables(all_cells(report.summary), columns) if report.summary else []
    rows, most = min(len(report.runs), MOST_ROWS), MARKDOWN_FAILURES
    while True:
        text = rendered(
            "page.md.j2",
            **_common(report),
            tables=[*tables, *([_text_table(report, ordered[:rows])] if rows else [])],
            words=(*WORDS, *(report.quantities[name].heading for name in report.shown if report.table.worded(name))),
            most=max(rows, MARKDOWN_ROWS),
            uncounted=outcome_counts([outcomes[k] for k in ordered[rows:]]) if report.runs else "",
            failed=len(failures),
            failures=_failures(report, folder, failures[:most]),
        )
        if len(text.encode()) <= MARKDOWN_BYTES or not rows:
            return re.sub(r"\n{3,}", "\n\n", text.strip()) + "\n"
        rows, most = rows // 2, most // 2


def _failures(report: Report, folder: Path, rows: list[int]) -> list[dict[str, Any]]:
    """Return the facts of failed runs."""
    listed, runs = report.table.take(rows), [report.runs[k] for k in rows] if report.runs else []
    facts: dict[str, Sequence[Any]] = {
        **{name: listed.texts(name) for name in ("world", "planner", "seed", "outcome", "reason")},
        "command": [run.row["command"] for run in runs] or _own_commands(listed),
        "why": [[run.certificate, *run.why] for run in runs] or [()] * len(rows),
        "link": [run.link(folder) for run in runs] or [""] * len(rows),
    }
    return [dict(zip(facts, values, strict=True)) for values in zip(*facts.values(), strict=True)]


def _text_table(report: Report, rows: Sequence[int]) -> TextTable:
    """Return the table of runs as text."""
    columns, success = report.table.columns, report.table.success

    def cell(name: str, row: int) -> str:
        value = columns[name][row]
        if name == "outcome":
            return f"{'✅' if success[row] else '❌'} {value.replace('_', ' ')}"
        if isinstance(value, float):
            return report.quantities[name].text(value)
        return NONE if value is None else str(value)

    return TextTable(
        "Runs",
        tuple(report.quantities[name].heading for name in report.shown),
        [tuple(cell(name, row) for name in report.shown) for row in rows],
    )


def outcome_counts(outcomes: Sequence[str]) -> str:
    """Return the counts of outcomes, such as "12 succeeded; 3 collided"; empty without runs."""
    numbers = Counter(outcome.replace("_", " ") for outcome in outcomes)
    most, rest = numbers.most_common(MOST_OUTCOMES), sum(numbers.values())
    rest -= sum(count for _, count in most)
    return "; ".join([*(f"{count:,} {outcome}" for outcome, count in most), *([f"{rest:,} others"] * bool(rest))])


def _page(report: Report, folder: Path) -> str:
    """Return the page for a folder."""
    planners, styles, summary = report.planners, report.styles, report.summary
    content: dict[str, Any] = {}
    if summary is not None:
        from antdrive.views.pages.charts import campaign_charts

        cells = success_cells(summary)
        content = {
            "success": list(zip(summary.success, cells.rows, strict=True)),
            "success_headings": cells.headings,
            "success_note": success_note,
            "pairs": [(name, pair_cells(name, found)) for name, found in summary.comparisons.items()],
            "allowances": allowance_cells(summary) if summary.allowances else None,
            "charts": campaign_charts(summary, styles),
        }
    return rendered(
        "page.html.j2",
        **_common(report),
        **content,
        styles=styles,
        planners=planners,
        number={label: k for k, label in enumerate(planners)},
        measure_title=measure_title,
        words=WORDS,
        rows=len(report.table),
        data=report_data(report, folder),
    )


def report_data(report: Report, folder: Path) -> str:
    """Return the runs as JSON for a script element of a page in a folder."""
    table = report.table
    columns = [json_column(name, table.columns[name]) for name in table.columns if name != "command"]
    commands = _commands(table) if report.summary else json_texts([run.row["command"] for run in report.runs])
    kept = [column for column in (*columns, {"name": "command", **commands}) if column is not None]
    return script_json(
        {
            "rows": len(table),
            "planners": list(report.planners),
            "columns": kept,
            "shown": report.shown,
            "titles": {name: quantity.heading for name, quantity in report.quantities.items()},
            "good": [int(value) for value in table.success],
            "sentences": SENTENCES,
            "base": link_to(report.base, folder) + "/",
            "views": _failed_views(report, folder)
            if report.summary
            else {k: link for k, run in enumerate(report.runs) if (link := run.link(folder))},
            "details": [{"told": f"{run.sentence} {run.certificate}".strip(), "why": run.why} for run in report.runs],
        }
    )


def _failed_views(report: Report, folder: Path) -> dict[int, str]:
    """Write the pages of a campaign's first failed drives beside their logs, and return links to them by row."""
    from antdrive.views.viewer.drive_page import write_page

    found: dict[int, str] = {}
    for row, (name, good) in enumerate(zip(report.table.texts("rollout"), report.table.success, strict=True)):
        log = report.base / name
        if (
            good
            or len(found) == MOST_VIEWS
            or not (log.is_file() and log.resolve().is_relative_to(report.base.resolve()))
        ):
            continue
        view = log.with_suffix(".html")
        with contextlib.suppress(InputError):  # a damaged log, or a folder that cannot be written
            if not view.exists() or view.stat().st_mtime < log.stat().st_mtime:
                write_page([LoggedRun.of(Rollout.load(log))], view)
            found[row] = link_to(view, folder)
    return found


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


def _common(report: Report) -> dict[str, Any]:
    summary = report.summary
    compared = summary.comparisons if summary else ()
    return {
        "title": report.title,
        "summary": summary,
        "verdict": summary.verdict if summary else "",
        "cards": headline(report.table, summary),
        "notes": [*summary.sentences, *summary.notes] if summary else [],
        "definitions": {name: METRICS[name].definition for name in compared if name in METRICS},
        "column_notes": [
            (report.quantities[name].title, note) for name, note in MEASURED.items() if note and name in report.shown
        ],
    }
