"""One page about many runs: a table to sort and filter, and for each run its film, figures, numbers and command.

The page holds everything but films, works without a network, and stays small: figures are embedded while there is room, the
overview of every run first; what does not fit is linked.
"""

from __future__ import annotations

import base64
import io
import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import quote

from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import read_record
from antdrive.sim.view.style import hexed, planner_style
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

ROOM = 4_500_000  # bytes of embedded figures, as base64
WIDTH = 1200  # pixels of an embedded figure at most
FILMS = {".mp4": "video/mp4", ".gif": "image/gif", ".webp": "image/webp"}
FIGURES: Mapping[str, str] = {
    "overview.png": "Map and driven way; clearance, speed and the rule that held it",
    "certificate.png": "Route against driven way, and the certificate",
    "plan.png": "Plan, with the planner's field and lengths by iteration",
    "field-contours.png": "The planner's field as contours",
    "field-bars.png": "The planner's field as bars",
    "history.png": "Best length by iteration",
    "tour.png": "Best tour",
}
COLUMNS = (
    ("world", "t"), ("planner", "t"), ("outcome", "t"), ("robot", "t"), ("seed", "n"),
    ("plan m", "n"), ("driven m", "n"), ("gap %", "n"), ("time s", "n"), ("clearance m", "n"), ("proved m", "n"), ("plan s", "n"),
)  # fmt: skip


@dataclass(frozen=True)
class Linked:
    """Something on the page: embedded, or beside it."""

    name: str
    source: str
    moving: bool = False
    caption: str = ""
    width: int = 0  # [px]
    height: int = 0


@dataclass
class Entry:
    """A run as the page tells it."""

    folder: Path
    facts_file: Mapping[str, Any]
    record: DriveRecord | None  # None where the run did not drive
    number: int
    figures: list[Linked] = field(default_factory=list)
    films: list[Linked] = field(default_factory=list)
    links: list[Linked] = field(default_factory=list)
    pictures: list[Linked] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        if name in ("world", "planner", "robot", "seed", "sentence", "reason", "command"):
            return self.facts_file.get(name, "")
        raise AttributeError(name)

    @property
    def anchor(self) -> str:
        """The section's id."""
        return f"run-{self.number}"

    @property
    def label(self) -> str:
        """What the first column is sorted by."""
        return f"{self.world} {self.planner} {self.robot} {self.seed}"

    @property
    def outcome(self) -> str:
        """In plain words."""
        return str(self.facts_file["outcome"]).replace("_", " ")

    @property
    def succeeded(self) -> bool:
        """Whether it reached the goal, certified."""
        return self.facts_file.get("succeeded") is True

    @property
    def badge(self) -> str:
        """The badge's class: what only looks like success has another colour."""
        name = str(self.facts_file["outcome"])
        return "doubt" if name == "succeeded" and not self.succeeded else name

    @property
    def colour(self) -> str:
        """The planner's."""
        return hexed(planner_style(str(self.planner))[0])

    @property
    def problems(self) -> list[str]:
        """Why it is not certified."""
        return list((self.facts_file.get("certificate") or {}).get("problems") or [])

    @property
    def verdict(self) -> str:
        """What the certificate says."""
        c = self.facts_file.get("certificate")
        if not c:
            return "It did not drive."
        if not c.get("certified"):
            return "Not certified collision-free."
        return f"Certified collision-free: at least {c['bound_m']:.4f} m of clearance, between logged poses too."

    @property
    def cells(self) -> list[tuple[str, str]]:
        """The numeric columns: what is sorted by, and what is shown."""
        m, c = self.facts_file.get("metrics") or {}, self.facts_file.get("certificate") or {}
        gap = m.get("gap_to_euclidean_optimum")
        values = (
            (m.get("path_length_m"), 2), (m.get("driven_length_m"), 2), (None if gap is None else 100 * gap, 1),
            (m.get("duration_s"), 1), (m.get("min_clearance_m"), 3), (c.get("bound_m"), 3), (m.get("plan_s"), 3),
        )  # fmt: skip
        return [
            (repr(float(v)), f"{round(v, digits) + 0.0:.{digits}f}")
            if isinstance(v, int | float) and math.isfinite(v)
            else ("", "–")
            for v, digits in values
        ]

    @property
    def facts(self) -> list[tuple[str, list[tuple[str, str]]]]:
        """Headed lists of names and values."""
        record = self.record.as_dict() if self.record else {}
        settings = {
            key: record[key]
            for key in ("margin", "inflate", "cell", "physics_hz", "control_hz", "time_limit")
            if key in record
        }
        return [
            ("Metrics", _pairs(self.facts_file.get("metrics"))),
            (
                "Certificate",
                _pairs({k: v for k, v in (self.facts_file.get("certificate") or {}).items() if k != "problems"}),
            ),
            ("Planner", _pairs(_part(record, "planner", "settings"))),
            ("Controller", _pairs(_part(record, "controller", "settings"))),
            ("Run", _pairs({**settings, "digest": self.facts_file.get("digest")})),
            ("Versions", _pairs(record.get("versions"))),
        ]


def write_report(folder: Path, out: Path, *, title: str | None = None, embed_films: bool = False) -> int:
    """Write a page (.html) or a text for a pull request (.md) about every run below a folder; returns how many.

    Raises:
        InputError: no runs there, a broken `result.json`, or an unknown suffix.
    """
    import jinja2

    kind = out.suffix.lower()
    if kind not in (".html", ".md"):
        raise InputError(f"{out}: unknown suffix {out.suffix!r}; choose .html or .md")
    runs = list(_runs(folder))
    if not runs:
        raise InputError(f"{folder}: no runs; `antdrive run --out` writes them, each with a result.json")
    for run in runs:
        _attach(run, out.parent, embed_films and kind == ".html")
    if kind == ".html":
        _embed_figures(runs, out.parent)
    loader = jinja2.FileSystemLoader(Path(__file__).with_name("templates"))
    made = jinja2.Environment(
        loader=loader, undefined=jinja2.StrictUndefined, autoescape=jinja2.select_autoescape(["html.j2"])
    )
    text = made.get_template(f"report{kind}.j2").render(
        title=title or folder.resolve().name, version=metadata.version("antdrive"), runs=runs, columns=COLUMNS,
        summary=_summary(runs), outcomes=sorted({run.outcome for run in runs}),
    )  # fmt: skip
    with written_whole(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return len(runs)


def _runs(folder: Path) -> Iterator[Entry]:
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    for number, path in enumerate(sorted(folder.rglob("result.json"))):
        try:
            facts = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read ({error})") from None
        known = facts if isinstance(facts, dict) else {}
        missing = [key for key in ("world", "planner", "robot", "seed", "outcome") if key not in known]
        if missing:
            raise InputError(f"{path}: {missing[0]}: missing; `antdrive run` writes it")
        yield Entry(path.parent, facts, _record_of(path.parent / "rollout.npz"), number)


def _record_of(path: Path) -> DriveRecord | None:
    """The record of a log; None where the run did not drive."""
    return read_record(path) if path.exists() else None


def _attach(run: Entry, base: Path, embed_films: bool) -> None:
    """Films and files of a run's folder, and a film that was written elsewhere."""
    films = {path for path in run.folder.iterdir() if path.suffix.lower() in FILMS}
    named = (run.facts_file.get("files") or {}).get("film")
    if named and Path(named).is_file():
        films.add(Path(named))
    seen: set[Path] = set()
    for path in sorted(films):
        if path.resolve() in seen:
            continue
        seen.add(path.resolve())
        kind = FILMS[path.suffix.lower()]
        source = _data(kind, path.read_bytes()) if embed_films else _beside(path, base)
        run.films.append(Linked(path.name, source, moving=kind.startswith("video/")))
    for name in ("rollout.npz", "result.json"):
        if (run.folder / name).exists():
            run.links.append(Linked(name, _beside(run.folder / name, base)))
    for name in ("overview.png", "plan.png"):
        if (run.folder / name).exists():
            run.pictures.append(Linked(name, _beside(run.folder / name, base)))


def _embed_figures(runs: list[Entry], base: Path) -> None:
    """Put figures into the page while there is room, kind by kind; link the rest."""
    used = 0
    for name, caption in FIGURES.items():
        for run in runs:
            path = run.folder / name
            if not path.exists():
                continue
            figure = _shrunk(path, caption)
            if used + len(figure.source) <= ROOM:
                used += len(figure.source)
                run.figures.append(figure)
            else:
                run.links.append(Linked(name, _beside(path, base)))


def _shrunk(path: Path, caption: str) -> Linked:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            small = picture.convert("RGB")
    except (OSError, UnidentifiedImageError):
        raise InputError(f"{path}: not a picture") from None
    small.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    room = io.BytesIO()
    small.save(room, format="WEBP", quality=82, method=4)
    return Linked(
        path.name, _data("image/webp", room.getvalue()), caption=caption, width=small.width, height=small.height
    )


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _beside(path: Path, base: Path) -> str:
    return quote(Path(os.path.relpath(path.resolve(), base.resolve())).as_posix())


def _summary(runs: list[Entry]) -> list[tuple[str, str]]:
    certified = sum(run.succeeded for run in runs)
    bounds = [float(run.facts_file["certificate"]["bound_m"]) for run in runs if run.succeeded]
    driven = sum(float(shown) for run in runs if (shown := run.cells[1][0]))
    return [
        (f"{certified} / {len(runs)}", "reached the goal, certified"),
        (f"{min(bounds):.3f} m" if bounds else "–", "least clearance proved"),
        (f"{driven:.1f} m", "driven"),
        (str(len({run.world for run in runs})), "worlds"),
        (str(len({run.planner for run in runs})), "planners"),
    ]


def _part(values: Mapping[str, Any], *keys: str) -> Any:
    found: Any = values
    for key in keys:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found


def _pairs(values: Any) -> list[tuple[str, str]]:
    return [(str(key), _told(value)) for key, value in values.items()] if isinstance(values, Mapping) else []


def _told(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    return re.sub(r"\s+", " ", str(value))
