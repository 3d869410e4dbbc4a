"""Report of runs: a sortable, filterable table, and each run's film, figures, numbers and command.

The page works offline. Figures are embedded up to a total size, overviews first; other figures and films are linked. The
Markdown for pull requests lists failures first and stays below 60 kB.
"""

from __future__ import annotations

import base64
import io
import os
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from antdrive.base.atomic import write_text
from antdrive.base.errors import InputError
from antdrive.base.files import MAX_BYTES, file_name, known_suffix, open_regular, read_bytes
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run
from antdrive.views.pages.rendering import json_column, link_to, page_data, rendered, shown
from antdrive.views.pages.reported_runs import (
    COLUMN_NOTES,
    MEASURED,
    SETTINGS,
    WORDS,
    Attachment,
    ReportedRun,
    find_runs,
    note_differences,
    reported_run,
    run_columns,
    run_table,
)

EMBEDDED_BYTES = 4_500_000  # of all embedded figures, as base64
MAX_PIXELS = 100_000_000  # per figure
FIGURE_WIDTH = 1200  # of an embedded figure, at most [px]
FILM_SIZE = (960, 540)  # of films of runs made in Python [px]
MARKDOWN_BYTES = 60_000  # of a Markdown report; GitHub refuses comments of more than 65,536 characters
MOST_ROWS, MOST_DETAILS, ENOUGH_DETAILS, MOST_OUTCOMES = 256, 64, 8, 12  # of a Markdown report
FILM_TYPES = {".mp4": "video/mp4", ".gif": "image/gif", ".webp": "image/webp"}
FIGURE_CAPTIONS: Mapping[str, str] = {
    "then-and-now.png": "Baseline and this drive: divergence, clearances and distance",
    "overview.png": "Map with driven path; clearance, speed and speed-limiting rule over time",
    "certificate.png": "Driven path, route and certificate",
    "sight.png": "Occupancy map, explored area and first detections of obstacles",
    "plan.png": "Plan, planner's field and path length by iteration",
    "field-contours.png": "The planner's field as contours",
    "field-bars.png": "The planner's field as bars",
    "history.png": "Best path length by iteration",
    "tour.png": "Planned path",
}


def write_report(
    runs: Run | str | os.PathLike[str] | Iterable[Run | str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    title: str | None = None,
    embed_films: bool = False,
    figures: bool = True,
    films: bool = False,
) -> int:
    """Write a report of runs from Python and of all runs below folders.

    >>> write_report([run(scenario), "out/slalom"], "report.html")

    Args:
        runs: one or more runs, or folders with runs of `antdrive run --out`
        out: the file to write: a page (.html) or Markdown for a pull request (.md)
        title: the report's title; default: the folder's name
        embed_films: embed films of folders instead of linking them
        figures: embed each run's figures in the page
        films: film each run from Python and embed the film

    Returns:
        The number of runs.

    Raises:
        InputError: no runs, an invalid `result.json`, or an unknown suffix.
    """
    target = Path(out)
    page = known_suffix(target, (".html", ".md")) == ".html"
    given: list[Any] = [runs] if isinstance(runs, Run | str | os.PathLike) else list(runs)
    reported: list[ReportedRun] = []
    for source in given:
        if isinstance(source, Run):
            made = reported_run(source)
            if page:
                made.figures += _drawn(source) if figures else []
                made.films += _filmed(source) if films else []
            found = [made]
        else:
            found = list(find_runs(Path(source)))
            if not found:
                raise InputError(f"{source}: no runs (no result.json); write them with `antdrive run --out`")
            for run in found:
                _attach_files(run, target.parent, embed_films and page)
            if page and figures:
                used = sum(len(figure.source) for run in reported for figure in run.figures)
                _attach_figures(found, target.parent, used)
        reported += found
    for place, run in enumerate(reported):
        run.number = place
    if not reported:
        raise InputError(f"{target}: no runs to report")
    note_differences(reported)
    name = title or (Path(given[0]).resolve().name if len(given) == 1 and not isinstance(given[0], Run) else "runs")
    write_text(target, _page(reported, shown(name)) if page else _text(reported, shown(name)))
    return len(reported)


def write_run_figures(folders: Iterable[Path], out: Path) -> list[Path]:
    """Write the overview of every drive below folders, and a comparison of each world's, as PDF and SVG."""
    from antdrive.views.figures.canvas import PRINTED
    from antdrive.views.figures.run_figures import comparison_figure, overview

    files: list[Path] = []
    cases: dict[tuple[str, int], dict[str, Rollout]] = {}
    for log in [path for folder in folders for path in sorted(folder.rglob("rollout.npz"))]:
        rollout = Rollout.load(log)
        name, task = log.parent.name, rollout.record.task
        stem = file_name("-".join(log.parent.parts[-2:]))
        files += [out / f"{stem}-overview{suffix}" for suffix in PRINTED]
        for path in files[-2:]:
            overview(rollout, path)
        cases.setdefault((task.world.name, rollout.record.seed), {})[name] = rollout
    for (world, seed), drives in cases.items():
        files += [out / file_name(f"{world}-{seed}-comparison{suffix}") for suffix in PRINTED if len(drives) > 1]
        for path in files[-2:] if len(drives) > 1 else ():
            comparison_figure(drives, path)
    if not files:
        raise InputError(f"{', '.join(map(str, folders))}: no logs (no rollout.npz) to draw")
    return files


def _page(runs: list[ReportedRun], title: str) -> str:
    """Render the page."""
    from antdrive.views.colours import label_styles

    planners = sorted({run.planner for run in runs})
    columns = [column for name, values in run_columns(runs).items() if (column := json_column(name, values))]
    for column in columns:
        if column["name"] in MEASURED:
            column["digits"] = MEASURED[column["name"]][1]
    titles = {column["name"]: _title(column["name"]) for column in columns if column["name"] != "reason"}
    return rendered(
        "page.html.j2",
        title=title,
        cards=_cards(runs),
        planners=planners,
        styles=label_styles(planners, planners),
        number={name: k for k, name in enumerate(planners)},
        runs=runs,
        rows=len(runs),
        settings=SETTINGS,
        column_notes=COLUMN_NOTES,
        data=page_data(columns, list(titles), titles, [run.succeeded for run in runs], planners, sections=True),
    )


def _title(name: str) -> str:
    """Return the heading of a column."""
    return MEASURED[name][0] if name in MEASURED else SETTINGS.get(name, name)


def _text(runs: list[ReportedRun], title: str) -> str:
    """Render the Markdown, failures first; runs beyond the size limit are only counted."""
    ordered = sorted(runs, key=lambda run: run.succeeded)
    rows, details = min(len(runs), MOST_ROWS), min(len(runs), MOST_DETAILS)
    while True:
        text = rendered(
            "page.md.j2",
            title=title,
            cards=_cards(runs),
            tables=[run_table(ordered[:rows])] if rows else [],
            words=WORDS,
            most=rows,
            uncounted=outcome_counts(ordered[rows:]),
            detailed=ordered[:details],
            undetailed=len(runs) - details,
            settings=SETTINGS,
            column_notes=COLUMN_NOTES,
        )
        if len(text.encode()) <= MARKDOWN_BYTES or not rows:
            return text
        rows, details = (rows, details // 2) if details > ENOUGH_DETAILS else (rows // 2, details // 2)


def outcome_counts(runs: Sequence[ReportedRun]) -> str:
    """Return the counts of outcomes, such as "12 succeeded; 3 collided"; empty without runs."""
    numbers = Counter(run.outcome for run in runs)
    most, rest = numbers.most_common(MOST_OUTCOMES), sum(numbers.values())
    rest -= sum(count for _, count in most)
    return "; ".join([*(f"{count:,} {outcome}" for outcome, count in most), *([f"{rest:,} others"] * bool(rest))])


def _drawn(run: Run) -> list[Attachment]:
    """Draw the overview of a run from Python, or its plan without a drive."""
    from antdrive.views.figures.run_figures import draw_run

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "overview.png"
        draw_run(run, path)
        return [_embedded(path, FIGURE_CAPTIONS["overview.png"])]


def _filmed(run: Run) -> list[Attachment]:
    """Film a run from Python; empty without a drive."""
    from antdrive.views.film.video import film

    if run.rollout is None:
        return []
    with tempfile.TemporaryDirectory() as folder:
        path = film(run.rollout, Path(folder) / "film.mp4", size=FILM_SIZE).path
        return [Attachment(path.name, _data_uri("video/mp4", read_bytes(path, MAX_BYTES, "a film")), is_video=True)]


def _attach_files(run: ReportedRun, base: Path, embed_films: bool) -> None:
    """Attach the films and files of a run's folder. Films and pictures of an earlier drive are only linked."""
    assert run.folder is not None
    for path in sorted(run.folder.iterdir()):
        kind = FILM_TYPES.get(path.suffix.lower())
        if kind is None or not _lies_in(path, run.folder):
            continue
        if age := _older(path, run.folder):
            run.links.append(Attachment(path.name + age, link_to(path, base)))
            continue
        source = _data_uri(kind, read_bytes(path, MAX_BYTES, "a film")) if embed_films else link_to(path, base)
        run.films.append(Attachment(path.name, source, is_video=kind.startswith("video/")))
    for names, attached in ((("rollout.npz", "result.json"), run.links), (("overview.png", "plan.png"), run.pictures)):
        for path in (run.folder / name for name in names):
            if _lies_in(path, run.folder):
                age = _older(path, run.folder) if attached is run.pictures else ""
                (run.links if age else attached).append(Attachment(path.name + age, link_to(path, base)))


def _older(path: Path, folder: Path) -> str:
    """Return " (older than the log)" if a film or picture was written before a run's log, or its result.json without one."""
    log = folder / "rollout.npz"
    source, name = (log, "the log") if log.exists() else (folder / "result.json", "result.json")
    return f" (older than {name})" if path.stat().st_mtime < source.stat().st_mtime else ""


def _lies_in(path: Path, folder: Path) -> bool:
    """Return whether a path, with links resolved, is a regular file in a folder."""
    return path.is_file() and path.resolve().is_relative_to(folder.resolve())


def _attach_figures(runs: list[ReportedRun], base: Path, used: int) -> None:
    """Embed figures, kind by kind, up to `EMBEDDED_BYTES` of which `used` are taken; link the others."""
    for name, caption in FIGURE_CAPTIONS.items():
        for run in runs:
            assert run.folder is not None
            path = run.folder / name
            if not _lies_in(path, run.folder):
                continue
            if age := _older(path, run.folder):
                run.links.append(Attachment(name + age, link_to(path, base)))
                continue
            figure = _embedded(path, caption)
            if used + len(figure.source) <= EMBEDDED_BYTES:
                used += len(figure.source)
                run.figures.append(figure)
            else:
                run.links.append(Attachment(name, link_to(path, base)))


def _embedded(path: Path, caption: str) -> Attachment:
    """Return a figure as a data URI, at most `FIGURE_WIDTH` pixels wide."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with open_regular(path) as file, Image.open(file) as picture:
                if picture.width * picture.height > MAX_PIXELS:
                    raise InputError(f"{path}: more than {MAX_PIXELS:,} pixels")
                small = picture.convert("RGB")
    except (OSError, SyntaxError, EOFError, Image.DecompressionBombError):
        raise InputError(f"{path}: not a picture") from None
    small.thumbnail((FIGURE_WIDTH, FIGURE_WIDTH), Image.Resampling.LANCZOS)
    content = io.BytesIO()
    small.save(content, format="WEBP", quality=82, method=4)
    source = _data_uri("image/webp", content.getvalue())
    return Attachment(path.name, source, caption=caption, width=small.width, height=small.height)


def _data_uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _cards(runs: list[ReportedRun]) -> list[tuple[str, str]]:
    """Return the report's headline numbers, each with its meaning."""
    certified = sum(run.succeeded for run in runs)
    bounds = [run.log.certificate.bound for run in runs if run.log and run.succeeded]
    driven = sum(value for run in runs if run.log and (value := run.measured["driven_length_m"]))
    worlds, planners = len({run.world for run in runs}), len({run.planner for run in runs})
    return [
        (f"{certified} / {len(runs)}", "reached the goal, certified collision-free"),
        (f"{min(bounds):.3f} m" if bounds else "–", "smallest certified clearance"),
        (f"{driven:.1f} m", "driven in total"),
        (str(worlds), "world" if worlds == 1 else "worlds"),
        (str(planners), "planner" if planners == 1 else "planners"),
    ]
