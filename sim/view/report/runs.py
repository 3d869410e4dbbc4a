"""The runs of a report, read from folders that `antdrive run --out` wrote, as text and numbers for the page."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import read_record
from antdrive.sim.view.style import hexed, planner_style
from antdrive.worlds.errors import InputError

REQUIRED = ("world", "planner", "robot", "seed", "outcome")  # keys of result.json


class Column(NamedTuple):
    """A column of the table.

    Attributes:
        title: its heading, with the unit
        kind: `t` for text, `n` for numbers
    """

    title: str
    kind: str


COLUMNS = (
    Column("world", "t"),
    Column("planner", "t"),
    Column("outcome", "t"),
    Column("robot", "t"),
    Column("seed", "n"),
    Column("path [m]", "n"),
    Column("driven [m]", "n"),
    Column("gap [%]", "n"),
    Column("time [s]", "n"),
    Column("min clearance [m]", "n"),
    Column("proved [m]", "n"),
    Column("planning [s]", "n"),
)

#: What the less obvious columns mean.
COLUMN_NOTES = (
    ("path", "length of the planned path, before smoothing"),
    ("gap", "how much longer the smoothed route is than the shortest path among the inflated obstacles"),
    ("min clearance", "smallest distance to an obstacle at any logged pose"),
    ("proved", "distance that the certificate guarantees between logged poses, too"),
)


@dataclass(frozen=True)
class Attachment:
    """A film, figure or file of a run.

    Attributes:
        name: the file's name
        source: a path relative to the page, or a data URI with the content
        is_video: it needs a video element; other films are animated images
        caption: what the figure shows
        width: of an embedded figure [px]
        height: of an embedded figure [px]
    """

    name: str
    source: str
    is_video: bool = False
    caption: str = ""
    width: int = 0
    height: int = 0


@dataclass
class ReportedRun:
    """A run as the report's templates show it.

    Attributes:
        folder: where the run's files are
        result: the content of result.json
        record: the record of the log; None if the robot did not drive
        number: its place among the runs of the report
        figures: embedded figures
        films: films, embedded or linked
        links: files beside the page
        pictures: figures beside the page, for the Markdown report
    """

    folder: Path
    result: Mapping[str, Any]
    record: DriveRecord | None
    number: int
    figures: list[Attachment] = field(default_factory=list)
    films: list[Attachment] = field(default_factory=list)
    links: list[Attachment] = field(default_factory=list)
    pictures: list[Attachment] = field(default_factory=list)

    @property
    def world(self) -> Any:
        """The world's name."""
        return self.result["world"]

    @property
    def planner(self) -> Any:
        """The planner's name."""
        return self.result["planner"]

    @property
    def robot(self) -> Any:
        """The robot's name."""
        return self.result["robot"]

    @property
    def seed(self) -> Any:
        """The random seed."""
        return self.result["seed"]

    @property
    def reason(self) -> Any:
        """Why there is no path, if the planner gave a reason."""
        return self.result.get("reason", "")

    @property
    def command(self) -> Any:
        """The command that repeats the run."""
        return self.result.get("command", "")

    @property
    def anchor(self) -> str:
        """The id of the run's section."""
        return f"run-{self.number}"

    @property
    def label(self) -> str:
        """The text by which the first column is sorted."""
        return f"{self.world} {self.planner} {self.robot} {self.seed}"

    @property
    def outcome(self) -> str:
        """The outcome's name in words."""
        return str(self.result["outcome"]).replace("_", " ")

    @property
    def sentence(self) -> str:
        """The outcome as a sentence."""
        text = str(self.result.get("sentence", ""))
        return text[:1].upper() + text[1:]

    @property
    def succeeded(self) -> bool:
        """Whether the robot reached the goal and the drive is certified."""
        return self.result.get("succeeded") is True

    @property
    def badge(self) -> str:
        """The CSS class of the outcome's badge; a success that is not certified has its own."""
        name = str(self.result["outcome"])
        return "doubt" if name == "succeeded" and not self.succeeded else name

    @property
    def colour(self) -> str:
        """The planner's colour as #rrggbb."""
        return hexed(planner_style(str(self.planner))[0])

    @property
    def problems(self) -> list[str]:
        """Why the drive is not certified, a sentence each."""
        return list((self.result.get("certificate") or {}).get("problems") or [])

    @property
    def verdict(self) -> str:
        """The certificate as a sentence."""
        c = self.result.get("certificate")
        if not c:
            return "The robot did not drive."
        if not c.get("certified"):
            return "Not certified collision-free."
        return f"Certified collision-free: at least {c['bound_m']:.4f} m of clearance, between logged poses, too."

    @property
    def cells(self) -> list[tuple[str, str]]:
        """The values of the numeric columns after the seed: each as a sort key and as shown."""
        metrics, certificate = self.result.get("metrics") or {}, self.result.get("certificate") or {}
        gap = metrics.get("gap_to_euclidean_optimum")
        values = (
            (metrics.get("path_length_m"), 2),
            (metrics.get("driven_length_m"), 2),
            (None if gap is None else 100 * gap, 1),
            (metrics.get("duration_s"), 1),
            (metrics.get("min_clearance_m"), 3),
            (certificate.get("bound_m"), 3),
            (metrics.get("plan_s"), 3),
        )
        return [
            (repr(float(v)), f"{round(v, digits) + 0.0:.{digits}f}")
            if isinstance(v, int | float) and math.isfinite(v)
            else ("", "–")
            for v, digits in values
        ]

    @property
    def details(self) -> list[tuple[str, list[tuple[str, str]]]]:
        """Lists of names and values, each with its heading."""
        record = self.record.as_dict() if self.record else {}
        settings = {
            key: record[key]
            for key in ("margin", "inflate", "cell", "physics_hz", "control_hz", "time_limit")
            if key in record
        }
        certificate = {k: v for k, v in (self.result.get("certificate") or {}).items() if k != "problems"}
        return [
            ("Metrics", _pairs(self.result.get("metrics"))),
            ("Certificate", _pairs(certificate)),
            ("Planner", _pairs(_part(record, "planner", "settings"))),
            ("Controller", _pairs(_part(record, "controller", "settings"))),
            ("Run", _pairs({**settings, "digest": self.result.get("digest")})),
            ("Versions", _pairs(record.get("versions"))),
        ]


def find_runs(folder: Path) -> Iterator[ReportedRun]:
    """The runs in a folder and below, in the order of their paths.

    Raises:
        InputError: no such folder, or a broken `result.json` or log.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    for number, path in enumerate(sorted(folder.rglob("result.json"))):
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read ({error})") from None
        result = content if isinstance(content, dict) else {}
        missing = [key for key in REQUIRED if key not in result]
        if missing:
            raise InputError(f"{path}: {missing[0]}: missing; `antdrive run` writes it")
        yield ReportedRun(path.parent, result, _record(path.parent / "rollout.npz"), number)


def _record(path: Path) -> DriveRecord | None:
    """The record of a log; None if there is no log, because the robot did not drive."""
    return read_record(path) if path.exists() else None


def _part(values: Mapping[str, Any], *keys: str) -> Any:
    """The value at a path of keys, None if there is none."""
    found: Any = values
    for key in keys:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found


def _pairs(values: Any) -> list[tuple[str, str]]:
    return [(str(key), _shown(value)) for key, value in values.items()] if isinstance(values, Mapping) else []


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    return re.sub(r"\s+", " ", str(value))
