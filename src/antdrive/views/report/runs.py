"""The runs of a report, read from folders that `antdrive run --out` wrote, as text and numbers for the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from antdrive.base.errors import InputError, input_error
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.claims import false_claims, logged_settings, read_result
from antdrive.sim.log.metrics import measure
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import Sighting, passed
from antdrive.sim.pipeline import Run
from antdrive.views.style import hexed, planner_style

LONGEST, LONGEST_COMMAND = 200, 4000  # characters of a text, of a command
UNDRIVEN = (Outcome.NO_PATH.key, Outcome.STOPPED.key)  # outcomes of runs that have no log
CLAIMED = (
    "smoothing",
    "noise",
    "margin_m",
    "margin_auto",
    "cell_m",
    "physics_hz",
    "control_hz",
    "time_limit_s",
    "settings",
)
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
    Column("planning [ms]", "n"),
)

FACTS = 5  # columns before those of settings that differ

#: What the less obvious columns mean.
COLUMN_NOTES = (
    ("path", "length of the planned path, before smoothing"),
    (
        "gap",
        "how much longer the smoothed route is than the shortest path among the inflated obstacles; only with the map",
    ),
    ("min clearance", "smallest distance to an obstacle at any logged pose"),
    ("planning", "wall time of the plan, with the kernels loaded"),
    (
        "explored",
        "ground that the lidar of a robot without a map saw, near or far; on the robot's own map there is less",
    ),
    ("proved", "distance that the certificate guarantees between logged poses, too"),
)


#: Settings that get a column where they differ between the runs, by their keys in result.json.
SETTING_COLUMNS: Mapping[str, Column] = MappingProxyType(
    {
        "options": Column("options", "t"),
        "smoothing": Column("route", "t"),
        "noise": Column("noise", "n"),
        "margin_m": Column("margin [m]", "n"),
        "cell_m": Column("cell [m]", "n"),
        "control_hz": Column("control [Hz]", "n"),
        "physics_hz": Column("physics [Hz]", "n"),
        "map": Column("map", "t"),
        "localisation": Column("pose by", "t"),
        "explored_m2": Column("explored [m²]", "n"),
    }
)


EXPLORED = "explored_m2"
SENSED = {"map": "given", "localisation": "fixes"}  # what robots know unless the log says otherwise
LISTED_SIGHTS = 40  # of the cylinders that a robot passed those that it came nearest to


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


@dataclass(frozen=True)
class LogFacts:
    """What the log of a run says.

    Attributes:
        record: the log's record
        certificate: the log's, computed for the report
        metrics: the log's metrics by name
        sights: the cylinders and movers that a robot which used its lidar passed, as the log's scans met them
        scans: how many scans the log holds
        digest: of the log's content
        settings: the log's settings by the keys of result.json
        contradictions: what result.json says otherwise, a sentence each
    """

    record: DriveRecord
    certificate: Certificate
    metrics: Mapping[str, float]
    sights: tuple[Sighting, ...]
    scans: int
    digest: str
    settings: Mapping[str, Any]
    contradictions: tuple[str, ...]


@dataclass
class ReportedRun:
    """A run as the report's templates show it: from its log alone, and as a claim of result.json where there is none.

    Attributes:
        folder: where the run's files are; None for a run made in Python
        result: the content of result.json
        log: what the log says; None if there is none
        number: its place among the runs of the report
        figures: embedded figures
        films: films, embedded or linked
        links: files beside the page
        pictures: figures beside the page, for the Markdown report
        differing: settings that differ between the runs, as shown, by the keys of `SETTING_COLUMNS`
    """

    folder: Path | None
    result: Mapping[str, Any]
    log: LogFacts | None
    number: int
    figures: list[Attachment] = field(default_factory=list)
    films: list[Attachment] = field(default_factory=list)
    links: list[Attachment] = field(default_factory=list)
    pictures: list[Attachment] = field(default_factory=list)
    differing: dict[str, str] = field(default_factory=dict)

    @property
    def world(self) -> str:
        """The world's name."""
        return shown(self.log.record.task.world.name if self.log else self.result["world"])

    @property
    def planner(self) -> str:
        """The planner's name."""
        return shown(self.log.record.planner.name if self.log else self.result["planner"])

    @property
    def robot(self) -> str:
        """The robot's name."""
        return shown(self.log.record.robot.name if self.log else self.result["robot"])

    @property
    def seed(self) -> str:
        """The random seed."""
        return shown(self.log.record.seed if self.log else self.result["seed"])

    @property
    def reason(self) -> str:
        """What the outcome leaves open."""
        return shown((self.log.record.reason if self.log else self.result.get("reason")) or "")

    @property
    def command(self) -> str:
        """The command that repeats the run, as result.json claims it."""
        return shown(self.result.get("command") or "", LONGEST_COMMAND)

    @property
    def anchor(self) -> str:
        """The id of the run's section."""
        return f"run-{self.number}"

    @property
    def label(self) -> str:
        """The text by which the first column is sorted."""
        return f"{self.world} {self.planner} {self.robot} {self.seed}"

    @property
    def claimed(self) -> bool:
        """Whether only result.json says that the robot drove."""
        return self.log is None and self.result["outcome"] not in UNDRIVEN

    @property
    def outcome(self) -> str:
        """The outcome's name in words."""
        name = self.log.record.outcome.key if self.log else shown(self.result["outcome"])
        return name.replace("_", " ") + (", claimed" if self.claimed else "")

    @property
    def sentence(self) -> str:
        """The outcome as a sentence."""
        text = self.log.record.outcome.value if self.log else shown(self.result.get("sentence") or "")
        return text[:1].upper() + text[1:]

    @property
    def succeeded(self) -> bool:
        """Whether the robot reached the goal and its log certifies the drive."""
        return self.log is not None and self.log.record.outcome is Outcome.SUCCEEDED and self.log.certificate.certified

    @property
    def badge(self) -> str:
        """The CSS class of the outcome's badge; a success that is not certified has its own."""
        if self.log is None:
            return "doubt"
        name = self.log.record.outcome.key
        return "doubt" if name == Outcome.SUCCEEDED.key and not self.succeeded else name

    @property
    def colour(self) -> str:
        """The planner's colour as #rrggbb."""
        return hexed(planner_style(self.planner)[0])

    @property
    def problems(self) -> list[str]:
        """Why the drive is not certified, and where result.json contradicts the log, a sentence each."""
        return [*self.log.certificate.problems, *self.log.contradictions] if self.log else []

    @property
    def settings(self) -> Mapping[str, Any]:
        """The log's settings by the keys of result.json, or those that result.json claims."""
        return self.log.settings if self.log else self.result

    @property
    def faults(self) -> list[str]:
        """Why the test failed that drove the run, as result.json claims it, a sentence each; empty where no test did."""
        claimed = self.result.get("faults")
        return [shown(text, LONGEST_COMMAND) for text in claimed] if isinstance(claimed, list) else []

    @property
    def verdict(self) -> str:
        """The certificate as a sentence."""
        if self.log is None:
            return "Claimed by result.json: there is no log." if self.claimed else "The robot did not drive."
        certificate = self.log.certificate
        if not certificate.certified:
            return "Not certified collision-free."
        verdict = certificate.verdict[:1].upper() + certificate.verdict[1:]
        return f"{verdict}: at least {certificate.bound:.4f} m of clearance, between logged poses, too."

    @property
    def heading(self) -> dict[str, str]:
        """What tells the run from the others, by the keys of `SETTING_COLUMNS`: settings, not what came of them."""
        return {key: value for key, value in self.differing.items() if value and key != EXPLORED}

    @property
    def metrics(self) -> Mapping[str, Any]:
        """The log's metrics, or those that result.json claims."""
        if self.log is not None:
            return self.log.metrics
        claimed = self.result.get("metrics")
        return claimed if isinstance(claimed, Mapping) else {}

    @property
    def cells(self) -> list[tuple[str, str]]:
        """The values of the numeric columns after the seed: each as a sort key and as shown."""
        metrics, gap = self.metrics, number(self.metrics.get("gap_to_euclidean_optimum"))
        planning = number(metrics.get("plan_s"))
        values = (
            (number(metrics.get("path_length_m")), 2),
            (number(metrics.get("driven_length_m")), 2),
            (None if gap is None else 100 * gap, 1),
            (number(metrics.get("duration_s")), 1),
            (number(metrics.get("min_clearance_m")), 3),
            (number(self.log.certificate.bound) if self.log else None, 3),
            (None if planning is None else 1000 * planning, 2),
        )
        return [("", "–") if v is None else (repr(v), f"{round(v, digits) + 0.0:.{digits}f}") for v, digits in values]

    @property
    def details(self) -> list[tuple[str, list[tuple[str, str]]]]:
        """Lists of names and values, each with its heading."""
        if self.log is None:
            claimed = {key: self.result.get(key) for key in CLAIMED if key in self.result}
            return [
                ("Claimed metrics", _pairs(self.metrics)),
                ("Claimed planner", _pairs(self.result.get("options"))),
                ("Claimed run", _pairs({**claimed, "digest": self.result.get("digest")})),
            ]
        record = self.log.record.as_dict()
        keys = ("noise", "margin", "inflate", "cell", "physics_hz", "control_hz", "time_limit")
        settings = {"route": record["smoothing"]["made"], **{key: record[key] for key in keys}}
        lidar = self.log.record.robot.lidar
        if self.log.scans and lidar is not None:
            settings["scans"] = f"{self.log.scans} of {lidar.beams} beams"
        certificate = {k: v for k, v in self.log.certificate.as_dict().items() if k != "problems"}
        return [
            ("Metrics", _pairs(self.metrics)),
            ("First sight of what was passed", _sight_pairs(self.log.sights)),
            ("Certificate", _pairs(certificate)),
            ("Planner", _pairs(record["planner"]["settings"])),
            ("Controller", _pairs(record["controller"]["settings"])),
            ("Run", _pairs({**settings, "digest": self.log.digest})),
            ("Versions", _pairs(record["versions"])),
        ]


def find_runs(folder: Path) -> Iterator[ReportedRun]:
    """The runs in a folder and below, in the order of their paths.

    Raises:
        InputError: no such folder, or a broken `result.json` or log.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    for place, path in enumerate(sorted(folder.rglob("result.json"))):
        result = read_result(path)
        missing = [key for key in REQUIRED if key not in result]
        if missing:
            raise InputError(f"{path}: {missing[0]}: missing; `antdrive run` writes it")
        log = path.parent / "rollout.npz"
        facts = facts_of(Rollout.load(log), result, str(log)) if log.exists() else None
        yield ReportedRun(path.parent, result, facts, place)


def facts_of(rollout: Rollout, result: Mapping[str, Any], name: str) -> LogFacts:
    """What a log says, computed from the log alone, and what the result beside it says otherwise.

    Raises:
        InputError: the record is of no drive.
    """
    try:
        certificate, metrics, digest = certify(rollout), measure(rollout), rollout.digest
        sights = tuple(passed(rollout))
    except ValueError as error:
        raise input_error(name, str(error)) from None
    claims = tuple(shown(claim) for claim in false_claims(result, rollout, digest))
    scans = len(rollout.scans)
    return LogFacts(rollout.record, certificate, metrics, sights, scans, digest, logged_settings(rollout), claims)


def made_run(run: Run) -> ReportedRun:
    """A run made in Python, as reports show it. Its log is certified again."""
    result, name = run.as_dict(), run.scenario.task.world.name
    return ReportedRun(None, result, None if run.rollout is None else facts_of(run.rollout, result, name), 0)


def note_differences(runs: Sequence[ReportedRun]) -> list[Column]:
    """Fill `differing` of every run; the columns that are needed for it.

    Options are compared between the runs of one planner: those of different planners differ anyway.
    """
    columns = []
    for key, column in SETTING_COLUMNS.items():
        texts = _option_texts(runs) if key == "options" else [_setting_text(run, key) for run in runs]
        if len(set(texts)) > 1 or (key == EXPLORED and texts[0]):
            columns.append(column)
            for run, text in zip(runs, texts, strict=True):
                run.differing[key] = text
    return columns


def _setting_text(run: ReportedRun, key: str) -> str:
    if key == EXPLORED:
        found = number(run.metrics.get(key))
        return "" if found is None else f"{found:.1f}"
    if key in SENSED:
        settings = run.result.get("settings")
        claimed = settings.get(key) if isinstance(settings, Mapping) else None
        value = claimed or SENSED[key] if run.log is None else getattr(run.log.record.sensing, key, SENSED[key])
    else:
        value = run.settings.get(key)
    return "" if value is None else shown(value, 40)


def _option_texts(runs: Sequence[ReportedRun]) -> list[str]:
    """For each run its options that differ between the runs of its planner, such as "ants 50"."""
    seen: dict[str, dict[str, set[str]]] = {}
    found = []
    for run in runs:
        claimed = run.settings.get("options")
        options = {shown(k, 40): shown(v, 40) for k, v in claimed.items()} if isinstance(claimed, Mapping) else {}
        found.append(options)
        for key, value in options.items():
            seen.setdefault(run.planner, {}).setdefault(key, set()).add(value)
    return [
        ", ".join(f"{key} {value}" for key, value in sorted(options.items()) if len(seen[run.planner][key]) > 1)
        for run, options in zip(runs, found, strict=True)
    ]


def number(value: Any) -> float | None:
    """A finite number; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        found = float(value)
    except OverflowError:
        return None
    return found if math.isfinite(found) else None


def shown(value: Any, longest: int = LONGEST) -> str:
    """A value as text on one line of printable characters, cut to a length."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    text = repr(value) if isinstance(value, list | dict) else str(value)
    text = "".join(c if c.isprintable() else " " for c in text[: 4 * longest])
    text = " ".join(text.split())
    return text if len(text) <= longest else f"{text[:longest]}…"


def _sight_pairs(sights: Sequence[Sighting]) -> list[tuple[str, str]]:
    """When each cylinder was first seen and how near the robot came, those that it came nearest to, in the order of time."""
    nearest = sorted(sights, key=lambda sight: (not sight.touched, sight.nearest))[:LISTED_SIGHTS]
    return [
        (
            sight.name,
            (
                f"seen {sight.seen_at:.2f} s, {sight.seen_from:.2f} m; "
                if math.isfinite(sight.seen_at)
                else "never seen; "
            )
            + (f"followed {sight.followed_at:.2f} s; " if math.isfinite(sight.followed_at) else "")
            + f"{'touched' if sight.touched else 'nearest'} {sight.nearest_at:.2f} s, {sight.nearest:.2f} m",
        )
        for sight in sorted(nearest, key=lambda sight: sight.nearest_at)
    ]


def _pairs(values: Any) -> list[tuple[str, str]]:
    return [(shown(key), shown(value)) for key, value in values.items()] if isinstance(values, Mapping) else []
