"""Films, figures and files of the runs in a report.

Figures are embedded up to a total size, overviews first; other figures and films are linked.
"""

from __future__ import annotations

import base64
import io
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

from antdrive.base.errors import InputError
from antdrive.base.files import MAX_BYTES, open_regular, read_bytes
from antdrive.sim.pipeline import Run
from antdrive.views.pages.rendering import link_to
from antdrive.views.pages.reported_runs import Attachment, ReportedRun

EMBEDDED_BYTES = 4_500_000  # of all embedded figures, as base64
MAX_PIXELS = 100_000_000  # per figure
FIGURE_WIDTH = 1200  # of an embedded figure, at most [px]
FILM_SIZE = (960, 540)  # of films of runs made in Python [px]
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


def drawn_figures(run: Run) -> list[Attachment]:
    """Draw the overview of a run from Python, or its plan without a drive."""
    from antdrive.views.figures.run_figures import draw_run

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "overview.png"
        draw_run(run, path)
        return [embedded(path, FIGURE_CAPTIONS["overview.png"])]


def filmed(run: Run) -> list[Attachment]:
    """Film a run from Python; empty without a drive."""
    from antdrive.views.film.video import film

    if run.rollout is None:
        return []
    with tempfile.TemporaryDirectory() as folder:
        path = film(run.rollout, Path(folder) / "film.mp4", size=FILM_SIZE).path
        return [Attachment(path.name, _data_uri("video/mp4", read_bytes(path, MAX_BYTES, "a film")), is_video=True)]


def attach_files(runs: Sequence[ReportedRun], base: Path, *, page: bool, figures: bool, embed_films: bool) -> None:
    """Attach films, files and figures of the runs' folders; those of an earlier drive are only linked.

    A page embeds figures, kind by kind, up to `EMBEDDED_BYTES`, and links the others; Markdown shows overviews and plans.
    """
    folders = [(run, run.folder) for run in runs if run.folder is not None]
    for run, folder in folders:
        for path in sorted(path for path in folder.iterdir() if _lies_in(path, folder)):
            if kind := FILM_TYPES.get(path.suffix.lower()):
                age, embed = _older(path, folder), embed_films and page
                source = (
                    _data_uri(kind, read_bytes(path, MAX_BYTES, "a film")) if embed and not age else link_to(path, base)
                )
                (run.links if age else run.films).append(Attachment(path.name + age, source, kind.startswith("video/")))
            elif path.name in ("rollout.npz", "result.json"):
                run.links.append(Attachment(path.name, link_to(path, base)))
    used = sum(len(figure.source) for run in runs for figure in run.figures)
    for name in (FIGURE_CAPTIONS if figures else ()) if page else ("overview.png", "plan.png"):
        for run, folder in folders:
            path = folder / name
            if not _lies_in(path, folder):
                continue
            age = _older(path, folder)
            figure = Attachment(name + age, link_to(path, base))
            if (
                page
                and not age
                and used + len((small := embedded(path, FIGURE_CAPTIONS[name])).source) <= EMBEDDED_BYTES
            ):
                used, figure = used + len(small.source), small
            (run.links if age or (page and not figure.caption) else run.figures).append(figure)


def _older(path: Path, folder: Path) -> str:
    """Return " (older than the log)" if a film or picture was written before a run's log, or its result.json without one."""
    log = folder / "rollout.npz"
    source, name = (log, "the log") if log.exists() else (folder / "result.json", "result.json")
    return f" (older than {name})" if path.stat().st_mtime < source.stat().st_mtime else ""


def _lies_in(path: Path, folder: Path) -> bool:
    """Return whether a path, with links resolved, is a regular file in a folder."""
    return path.is_file() and path.resolve().is_relative_to(folder.resolve())


def embedded(path: Path, caption: str) -> Attachment:
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
