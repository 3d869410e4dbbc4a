"""Runs of a report, from Python or from folders, as text and numbers for the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from antdrive.base.errors import InputError, input_error
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.margin import has_default
from antdrive.sim.log.metrics import measure
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import Sighting, passed
from antdrive.sim.pipeline import Run
from antdrive.sim.verifying import false_claims, logged_settings, read_result
from antdrive.sim.written import command_of
from antdrive.views.pages.rendering import NONE, TextTable, number, shown

LONGEST_COMMAND = 4000  # characters
UNDRIVEN = (Outcome.NO_PATH.key, Outcome.STOPPED.key)  # outcomes of runs without a log
CONTACT = (Outcome.COLLIDED.key, Outcome.INVALID_PLAN.key)  # outcomes with a red badge
CLAIMED = (
    *("smoothing", "noise", "margin_m", "margin_auto", "cell_m", "physics_hz", "control_hz", "time_limit_s"),
    "settings",
)
REQUIRED = ("world", "planner", "robot", "seed", "outcome")  # keys of result.json

#: Measured columns: heading and decimal places.
MEASURED: Mapping[str, tuple[str, int]] = MappingProxyType(
    {
        "path_length_m": ("path [m]", 2),
        "driven_length_m": ("driven [m]", 2),
        "gap_percent": ("gap [%]", 1),
        "duration_s": ("time [s]", 1),
        "min_clearance_m": ("min clearance [m]", 3),
        "proved_m": ("proved [m]", 3),
        "planning_ms": ("planning [ms]", 2),
    }
)
#: Headings of settings that get a column if they differ between runs, by their keys in result.json.
SETTINGS: Mapping[str, str] = MappingProxyType(
    {
        "options": "options",
        "smoothing": "route",
        "noise": "noise",
        "margin_m": "margin [m]",
        "cell_m": "cell [m]",
        "control_hz": "control [Hz]",
        "physics_hz": "physics [Hz]",
        "map": "map",
        "localisation": "pose by",
        "explored_m2": "explored [m²]",
    }
)
WORDS = ("world", "planner", "outcome", "robot", "options", "route", "map", "pose by")  # headings of text columns
EXPLORED = "explored_m2"
SENSED = {"map": "given", "localisation": "fixes"}  # defaults
LISTED_SIGHTS = 40  # number of listed cylinders, those with the closest approaches

#: Meaning of the less obvious columns.
COLUMN_NOTES = tuple(
    {
        "path": "length of the planned path, before smoothing",
        "gap": "excess length of the smoothed route over the shortest path around the no-go area; only with a map",
        "min clearance": "smallest distance to an obstacle at any logged pose",
        "planning": "wall time of planning, with loaded kernels",
        "explored": "area scanned by a mapless robot's lidar at any range; its occupancy map covers less",
        "proved": "clearance guaranteed by the certificate, including between logged poses",
    }.items()
)


@dataclass(frozen=True)
class Attachment:
    """Film, figure or file of a run."""

    name: str  # file name
    source: str  # path relative to the page, or data URI
    is_video: bool = False  # whether it needs a video element; other films are animated images
    caption: str = ""  # of a figure
    width: int = 0  # of an embedded figure [px]
    height: int = 0  # of an embedded figure [px]


@dataclass(frozen=True)
class LogFacts:
    """Facts of a run's log."""

    record: DriveRecord  # the log's record
    certificate: Certificate  # computed for the report
    metrics: Mapping[str, float]  # by name
    sights: tuple[Sighting, ...]  # cylinders and movers passed by a robot with a lidar
    scans: int  # number of scans
    digest: str  # of the log's content
    settings: Mapping[str, Any]  # by the keys of result.json
    contradictions: tuple[str, ...]  # contradictions between result.json and the log, a sentence each
    command: str  # command that repeats the run; empty if there is none


@dataclass
class ReportedRun:
    """Run in the report's templates, from its log alone or, without a log, from the claims of result.json."""

    folder: Path | None  # folder of the run's files; None for a run from Python
    result: Mapping[str, Any]  # content of result.json
    log: LogFacts | None  # facts of the log, if any
    number: int  # index in the report
    figures: list[Attachment] = field(default_factory=list)  # embedded figures
    films: list[Attachment] = field(default_factory=list)  # films, embedded or linked
    links: list[Attachment] = field(default_factory=list)  # files beside the page
    pictures: list[Attachment] = field(default_factory=list)  # figures beside the page, for the Markdown report
    # text of the settings that differ between runs, by the keys of `SETTINGS`
    differing: dict[str, str] = field(default_factory=dict)
    world: str = field(init=False)  # the world's name
    planner: str = field(init=False)  # the planner's name
    robot: str = field(init=False)  # the robot's name
    seed: str = field(init=False)  # the random seed
    reason: str = field(init=False)  # of the outcome
    command: str = field(init=False)  # command that repeats the run, from the log's record; empty without a log

    def __post_init__(self) -> None:
        names = {key: self.result.get(key) for key in ("world", "planner", "robot", "seed", "reason")}
        if self.log is not None:
            r = self.log.record
            logged = (r.task.world.name, r.planner.name, r.robot.name, r.seed, r.reason)
            names = dict(zip(names, logged, strict=True))
        self.world, self.planner, self.robot, self.seed = (shown(names[key]) for key in list(names)[:4])
        self.reason = shown(names["reason"] or "")
        self.command = self.log.command if self.log else ""

    @property
    def claimed(self) -> bool:
        """Whether result.json claims a drive without a log."""
        return self.log is None and self.result["outcome"] not in UNDRIVEN

    @property
    def ended(self) -> str:
        """The outcome's key."""
        key = self.log.record.outcome.key if self.log else shown(self.result["outcome"])
        return f"{key}, claimed" if self.claimed else key

    @property
    def outcome(self) -> str:
        """The outcome in words."""
        return self.ended.replace("_", " ")

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
        """The CSS class of the outcome's badge."""
        return "good" if self.succeeded else "hit" if self.log and self.ended in CONTACT else ""

    @property
    def problems(self) -> list[str]:
        """Problems of the certificate and contradictions between result.json and the log, a sentence each."""
        return [*self.log.certificate.problems, *self.log.contradictions] if self.log else []

    @property
    def settings(self) -> Mapping[str, Any]:
        """Settings of the log, or those claimed by result.json, by its keys."""
        return self.log.settings if self.log else self.result

    @property
    def faults(self) -> list[str]:
        """Failures of the run's test, as claimed by result.json, a sentence each; empty without a test."""
        claimed = self.result.get("faults")
        return [shown(text, LONGEST_COMMAND) for text in claimed] if isinstance(claimed, list) else []

    @property
    def certificate_sentence(self) -> str:
        """The certificate as a sentence."""
        if self.log is None:
            return "Claimed by result.json, without a log." if self.claimed else "The robot did not drive."
        certificate = self.log.certificate
        if not certificate.certified:
            return "Not certified collision-free."
        statement = certificate.statement[:1].upper() + certificate.statement[1:]
        return f"{statement}: at least {certificate.bound:.4f} m of clearance, including between logged poses."

    @property
    def heading(self) -> dict[str, str]:
        """Settings that distinguish the run from others, by the keys of `SETTINGS`, without results."""
        return {key: value for key, value in self.differing.items() if value and key != EXPLORED}

    @property
    def metrics(self) -> Mapping[str, Any]:
        """Metrics of the log, or those claimed by result.json."""
        if self.log is not None:
            return self.log.metrics
        claimed = self.result.get("metrics")
        if not isinstance(claimed, Mapping):
            return {}
        return claimed if self.claimed else {key: value for key, value in claimed.items() if key == "plan_s"}

    @property
    def measured(self) -> dict[str, float | None]:
        """Values of the columns `MEASURED`."""
        values = {key: number(self.metrics.get(key)) for key in MEASURED}
        gap, planning = number(self.metrics.get("gap_to_euclidean_optimum")), number(self.metrics.get("plan_s"))
        values["gap_percent"] = None if gap is None else 100 * gap
        values["proved_m"] = number(self.log.certificate.bound) if self.log else None
        values["planning_ms"] = None if planning is None else 1000 * planning
        return values

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
        if has_default(self.log.record):
            settings["margin"] = f"{settings['margin']:g}, the default for this noise and route"
        lidar = self.log.record.robot.lidar
        if self.log.scans and lidar is not None:
            settings["scans"] = f"{self.log.scans} of {lidar.beams} beams"
        certificate = {k: v for k, v in self.log.certificate.as_dict().items() if k != "problems"}
        return [
            ("Metrics", _pairs(self.metrics)),
            ("First detections and closest approaches", _sight_pairs(self.log.sights)),
            ("Certificate", _pairs(certificate)),
            ("Planner", _pairs(record["planner"]["settings"])),
            ("Controller", _pairs(record["controller"]["settings"])),
            ("Run", _pairs({**settings, "digest": self.log.digest})),
            ("Versions", _pairs(record["versions"])),
        ]


def find_runs(folder: Path) -> Iterator[ReportedRun]:
    """Yield the runs below a folder, sorted by path."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    for place, path in enumerate(sorted(folder.rglob("result.json"))):
        result = read_result(path)
        missing = [key for key in REQUIRED if key not in result]
        if missing:
            raise InputError(f"{path}: {missing[0]}: missing; `antdrive run` writes it")
        log = path.parent / "rollout.npz"
        facts = log_facts(Rollout.load(log), result, str(log)) if log.exists() else None
        yield ReportedRun(path.parent, result, facts, place)


def log_facts(rollout: Rollout, result: Mapping[str, Any], name: str) -> LogFacts:
    """Compute the facts of a log, and its contradictions with the result beside it."""
    try:
        certificate, metrics, digest = certify(rollout), measure(rollout), rollout.digest
        sights = tuple(passed(rollout))
    except ValueError as error:
        raise input_error(name, str(error)) from None
    claims = tuple(shown(claim) for claim in false_claims(result, rollout, certificate, metrics, digest))
    command, settings = shown(command_of(rollout.record) or "", LONGEST_COMMAND), logged_settings(rollout)
    return LogFacts(rollout.record, certificate, metrics, sights, len(rollout.scans), digest, settings, claims, command)


def reported_run(run: Run) -> ReportedRun:
    """Return a run from Python for a report; its log is certified again."""
    result, name = run.as_dict(), run.scenario.task.world.name
    return ReportedRun(None, result, None if run.rollout is None else log_facts(run.rollout, result, name), 0)


def note_differences(runs: Sequence[ReportedRun]) -> None:
    """Fill `differing` of every run. Options are compared between runs of the same planner."""
    for key in SETTINGS:
        texts = _option_texts(runs) if key == "options" else [_setting_text(run, key) for run in runs]
        if len(set(texts)) > 1 or (key == EXPLORED and texts[0]):
            for run, text in zip(runs, texts, strict=True):
                run.differing[key] = text


def run_columns(runs: Sequence[ReportedRun]) -> dict[str, list[Any]]:
    """Return the values of the page's columns by name."""
    columns: dict[str, list[Any]] = {
        "world": [run.world for run in runs],
        "planner": [run.planner for run in runs],
        "outcome": [run.ended for run in runs],
        "test": ["test failed" if run.faults else None for run in runs],
        "robot": [run.robot for run in runs],
        "seed": _numeric([run.seed for run in runs]),
        "reason": [run.reason or None for run in runs],
    }
    columns |= {key: _numeric([run.differing[key] for run in runs]) for key in runs[0].differing}
    return columns | {key: [run.measured[key] for run in runs] for key in MEASURED}


def _numeric(texts: list[str]) -> list[Any]:
    """Convert texts to numbers, and empty ones to None, if all are numeric; otherwise return them unchanged."""
    try:
        return [None if text == "" else float(text) for text in texts]
    except ValueError:
        return list(texts)


def run_table(runs: Sequence[ReportedRun]) -> TextTable:
    """Return the runs as a table of text."""
    headings = ["world", "planner", "outcome", "robot", "seed"]
    headings += [SETTINGS[key] for key in (runs[0].differing if runs else ())]
    rows = []
    for run in runs:
        ended = f"{'✅' if run.succeeded else '❌'} {run.outcome}{', test failed' if run.faults else ''}"
        values = [NONE if v is None else f"{round(v, d) + 0.0:.{d}f}"
                  for v, (_, d) in zip(run.measured.values(), MEASURED.values(), strict=True)]  # fmt: skip
        rows.append((run.world, run.planner, ended, run.robot, run.seed, *run.differing.values(), *values))
    return TextTable("Runs", (*headings, *(title for title, _ in MEASURED.values())), rows)


def _setting_text(run: ReportedRun, key: str) -> str:
    if key == EXPLORED:
        area = number(run.metrics.get(key))
        return "" if area is None else f"{area:.1f}"
    if key in SENSED:
        settings = run.result.get("settings")
        claimed = settings.get(key) if isinstance(settings, Mapping) else None
        value = claimed or SENSED[key] if run.log is None else getattr(run.log.record.sensing, key, SENSED[key])
    else:
        value = run.settings.get(key)
    return "" if value is None else shown(value, 40)


def _option_texts(runs: Sequence[ReportedRun]) -> list[str]:
    """Return each run's options that differ between runs of its planner, such as "ants 50"."""
    values: dict[str, dict[str, set[str]]] = {}
    chosen = []
    for run in runs:
        claimed = run.settings.get("options")
        options = {shown(k, 40): shown(v, 40) for k, v in claimed.items()} if isinstance(claimed, Mapping) else {}
        chosen.append(options)
        for key, value in options.items():
            values.setdefault(run.planner, {}).setdefault(key, set()).add(value)
    return [
        ", ".join(f"{key} {value}" for key, value in sorted(options.items()) if len(values[run.planner][key]) > 1)
        for run, options in zip(runs, chosen, strict=True)
    ]


def _sight_pairs(sights: Sequence[Sighting]) -> list[tuple[str, str]]:
    """Return first detection and closest approach of the nearest objects, sorted by time."""
    nearest = sorted(sights, key=lambda sight: (not sight.touched, sight.nearest))[:LISTED_SIGHTS]
    pairs = []
    for sight in sorted(nearest, key=lambda sight: sight.nearest_at):
        seen = (
            f"detected {sight.seen_at:.2f} s, {sight.seen_from:.2f} m" if math.isfinite(sight.seen_at) else "undetected"
        )
        tracked = f"tracked {sight.tracked_at:.2f} s; " if math.isfinite(sight.tracked_at) else ""
        came = f"{'contact' if sight.touched else 'closest'} {sight.nearest_at:.2f} s, {sight.nearest:.2f} m"
        pairs.append((sight.name, f"{seen}; {tracked}{came}"))
    return pairs


def _pairs(values: Any) -> list[tuple[str, str]]:
    return [(shown(key), shown(value)) for key, value in values.items()] if isinstance(values, Mapping) else []
