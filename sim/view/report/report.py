"""One page about many runs: a table to sort and filter; for each run its film, figures, numbers and command.

The page works without a network. Figures are embedded up to a total size, the overview of every run first; the other
figures and the films are linked.
"""

from __future__ import annotations

import base64
import io
import os
import re
import warnings
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from urllib.parse import quote

from antdrive.sim.view.report.runs import COLUMN_NOTES, COLUMNS, Attachment, ReportedRun, find_runs, shown
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

EMBEDDED_BYTES = 4_500_000  # of all embedded figures together, as base64
MAX_PIXELS = 100_000_000  # of a figure
FIGURE_WIDTH = 1200  # of an embedded figure, at most [px]
FILM_TYPES = {".mp4": "video/mp4", ".gif": "image/gif", ".webp": "image/webp"}
FIGURE_CAPTIONS: Mapping[str, str] = {
    "then-and-now.png": "The baseline's drive and this one: where they part, their clearances, and the distance between them",
    "overview.png": "Map with the driven path; clearance, speed, and the rule that limited the speed",
    "certificate.png": "Driven path against route, and the certificate",
    "plan.png": "Plan with the planner's field, and path lengths by iteration",
    "field-contours.png": "The planner's field as contours",
    "field-bars.png": "The planner's field as bars",
    "history.png": "Best path length by iteration",
    "tour.png": "Planned path",
}


def write_report(folder: Path, out: Path, *, title: str | None = None, embed_films: bool = False) -> int:
    """Write a report about every run in a folder and below.

    Args:
        folder: where `antdrive run --out` wrote the runs
        out: the file to write: a page (.html), or text for a pull request (.md)
        title: of the report; the folder's name by default
        embed_films: put films into the page instead of linking them

    Returns:
        The number of runs.

    Raises:
        InputError: no runs there, a broken `result.json`, or an unknown suffix.
    """
    import jinja2

    kind = out.suffix.lower()
    if kind not in (".html", ".md"):
        raise InputError(f"{out}: unknown suffix {out.suffix!r}; choose .html or .md")
    runs = list(find_runs(folder))
    if not runs:
        raise InputError(f"{folder}: no runs; `antdrive run --out` writes them, each with a result.json")
    for run in runs:
        _attach_files(run, out.parent, embed_films and kind == ".html")
    if kind == ".html":
        _attach_figures(runs, out.parent)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(["html.j2"]),
    )
    environment.filters |= {"md": markdown_text, "fence": fence_for}
    text = environment.get_template(f"report{kind}.j2").render(
        title=shown(title or folder.resolve().name),
        version=metadata.version("antdrive"),
        runs=runs,
        columns=COLUMNS,
        notes=COLUMN_NOTES,
        summary=_summary(runs),
        outcomes=sorted({run.outcome for run in runs}),
    )
    with written_whole(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return len(runs)


def _attach_files(run: ReportedRun, base: Path, embed_films: bool) -> None:
    """Attach the films and files of a run's folder. A film that is older than the log shows another drive.

    Where there is no log, nothing shows that an older film is of this run either.
    """
    log = run.folder / "rollout.npz"
    driven = (log if log.exists() else run.folder / "result.json").stat().st_mtime
    other = "older than the log" if log.exists() else "older than result.json"
    for path in sorted(run.folder.iterdir()):
        kind = FILM_TYPES.get(path.suffix.lower())
        if kind is None or not _lies_in(path, run.folder):
            continue
        if path.stat().st_mtime < driven:
            run.links.append(Attachment(f"{path.name} ({other})", _link(path, base)))
            continue
        source = _data_uri(kind, path.read_bytes()) if embed_films else _link(path, base)
        run.films.append(Attachment(path.name, source, is_video=kind.startswith("video/")))
    for names, found in (
        (("rollout.npz", "result.json"), run.links),
        (("overview.png", "plan.png"), run.pictures),
    ):
        found += [
            Attachment(name, _link(run.folder / name, base))
            for name in names
            if _lies_in(run.folder / name, run.folder)
        ]


def _lies_in(path: Path, folder: Path) -> bool:
    """Whether a path is a regular file in a folder, also where links lead."""
    return path.is_file() and path.resolve().is_relative_to(folder.resolve())


def _attach_figures(runs: list[ReportedRun], base: Path) -> None:
    """Embed figures, one kind after the other, until `EMBEDDED_BYTES` are used up; link the others."""
    used = 0
    for name, caption in FIGURE_CAPTIONS.items():
        for run in runs:
            path = run.folder / name
            if not _lies_in(path, run.folder):
                continue
            figure = _embedded(path, caption)
            if used + len(figure.source) <= EMBEDDED_BYTES:
                used += len(figure.source)
                run.figures.append(figure)
            else:
                run.links.append(Attachment(name, _link(path, base)))


def _embedded(path: Path, caption: str) -> Attachment:
    """A figure as a data URI, at most `FIGURE_WIDTH` pixels wide."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path) as picture:
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


def _link(path: Path, base: Path) -> str:
    """The path of a file relative to the page's folder, quoted for a URL."""
    return quote(Path(os.path.relpath(path.resolve(), base.resolve())).as_posix())


def _summary(runs: list[ReportedRun]) -> list[tuple[str, str]]:
    """The report's headline numbers, each with its meaning."""
    certified = sum(run.succeeded for run in runs)
    bounds = [run.log.certificate.bound for run in runs if run.log and run.succeeded]
    driven = sum(float(value) for run in runs if run.log and (value := run.cells[1][0]))
    worlds, planners = len({run.world for run in runs}), len({run.planner for run in runs})
    return [
        (f"{certified} / {len(runs)}", "reached the goal, certified collision-free"),
        (f"{min(bounds):.3f} m" if bounds else "–", "smallest clearance proved"),
        (f"{driven:.1f} m", "driven in total"),
        (str(worlds), "world" if worlds == 1 else "worlds"),
        (str(planners), "planner" if planners == 1 else "planners"),
    ]


def markdown_text(value: object) -> str:
    """A text that Markdown shows as it is, in tables and in HTML blocks, too."""
    return re.sub(r"[&<>|`*_~\[\]\\@#]", lambda found: f"&#{ord(found[0])};", str(value))


def fence_for(code: str) -> str:
    """A code fence longer than any run of backticks in the code."""
    return "`" * max(3, 1 + max(map(len, re.findall("`+", code)), default=0))
