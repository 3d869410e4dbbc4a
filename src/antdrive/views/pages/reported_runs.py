"""Runs of a report that are no campaign's: rows of its table, and sections of its page.

A run is what its log says; without a log, what result.json claims.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from antdrive.base.errors import InputError, input_error
from antdrive.runs.statistics.run_table import RunTable
from antdrive.sim.facts import FACTS, SENSED, LoggedRun, facts_of
from antdrive.sim.log.margin import has_default
from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import Sighting, passed
from antdrive.sim.pipeline import Run
from antdrive.sim.recorded import command_of
from antdrive.sim.verifying import false_claims, read_result
from antdrive.views.pages.rendering import number, shown, with_unit

LONGEST_COMMAND = 4000  # characters
LISTED_SIGHTS = 40  # number of listed cylinders, those with the closest approaches
UNDRIVEN = (Outcome.NO_PATH.key, Outcome.STOPPED.key)  # outcomes of runs without a log
RED = (Outcome.COLLIDED.key, Outcome.INVALID_PLAN.key)  # outcomes with a red badge
REQUIRED = ("world", "planner", "robot", "seed", "outcome")  # keys of result.json
WRITTEN = tuple(name for name, fact in FACTS.items() if fact.proof == "written")
#: Columns of settings, as in a campaign's table, by their keys in result.json.
COLUMNS = {"margin_m": "margin", "cell_m": "cell"} | {
    name: name for name in ("smoothing", "noise", "physics_hz", "control_hz")
}


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
class ReportedRun:
    """Row of a run and the texts of its section."""

    folder: Path | None  # folder of the run's files; None for a run from Python
    row: dict[str, Any]  # values by column
    options: Mapping[str, float | str]  # the planner's options
    sentence: str  # the outcome
    certificate: str  # the certificate
    problems: list[str]  # of the certificate, and contradictions between result.json and the log, a sentence each
    faults: list[str]  # failures of the run's test, as claimed by result.json, a sentence each
    details: list[tuple[str, list[tuple[str, str]]]]  # names and values under headings
    figures: list[Attachment] = field(default_factory=list)  # figures, embedded; of the Markdown report beside it
    films: list[Attachment] = field(default_factory=list)  # films, embedded or linked
    links: list[Attachment] = field(default_factory=list)  # files beside the page

    @property
    def badge(self) -> str:
        """The CSS class of the outcome's badge."""
        return "good" if self.row["succeeded"] else "hit" if self.row["outcome"] in RED else ""


def find_runs(folder: Path) -> Iterator[ReportedRun]:
    """Yield the runs below a folder, sorted by path."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    for path in sorted(folder.rglob("result.json")):
        result = read_result(path)
        missing = [key for key in REQUIRED if key not in result]
        if missing:
            raise InputError(f"{path}: {missing[0]}: missing; `antdrive run` writes it")
        log = path.parent / "rollout.npz"
        if log.exists():
            yield logged_run(Rollout.load(log), result, str(log), path.parent)
        else:
            yield claimed_run(result, path.parent)


def reported_run(run: Run) -> ReportedRun:
    """Return a run from Python; its log is certified again."""
    result = run.as_dict()
    return claimed_run(result) if run.rollout is None else logged_run(run.rollout, result, result["world"])


def logged_run(rollout: Rollout, result: Mapping[str, Any], name: str, folder: Path | None = None) -> ReportedRun:
    """Return a run as its log says, and the contradictions of the result beside it."""
    try:
        log = LoggedRun.of(rollout)
        facts, sights = {**facts_of(log, WRITTEN), "metrics": log.metrics}, tuple(passed(rollout))
    except ValueError as error:
        raise input_error(name, str(error)) from None
    certificate, record = log.certificate, rollout.record
    outcome, plain = record.outcome, record.as_dict()
    settings = {"route": plain["smoothing"]["made"]}
    settings |= {
        "noise": plain["noise"],
        "margin": plain["margin"],
        "inflate": f"{plain['inflate']:g} m",
        "cell": plain["cell"],
    }
    settings |= {key: plain[key] for key in ("physics_hz", "control_hz", "time_limit")}
    if has_default(record):
        settings["margin"] = f"{settings['margin']:g} m, the default for this noise and route"
    if len(rollout.scans) and record.robot.lidar is not None:
        settings["scans"] = f"{len(rollout.scans)} of {record.robot.lidar.beams} beams"
    proved = f"at least {certificate.bound:.4f} m of clearance, including between logged poses."
    faults = _faults(result)
    row = _row({**facts, "outcome": outcome.key, "reason": record.reason}, faults) | {
        "succeeded": log.succeeded,
        "certified": certificate.certified,
        "bound_m": number(certificate.bound),
        "digest": rollout.digest,
        "command": shown(command_of(rollout.record) or "", LONGEST_COMMAND) or None,
    }
    return ReportedRun(
        folder,
        row,
        _options(facts),
        _capital(outcome.value),
        f"{_capital(certificate.statement)}: {proved}" if certificate.certified else "Not certified collision-free.",
        [*certificate.problems, *map(shown, false_claims(result, log))],
        faults,
        [
            ("Metrics", _pairs(log.metrics)),
            ("First detections and closest approaches", _sight_pairs(sights)),
            ("Certificate", _pairs({key: one for key, one in certificate.as_dict().items() if key != "problems"})),
            ("Planner", _pairs(plain["planner"]["settings"])),
            ("Controller", _pairs(plain["controller"]["settings"])),
            ("Run", _pairs({**settings, "digest": rollout.digest})),
            ("Versions", _pairs(plain["versions"])),
        ],
    )


def claimed_run(result: Mapping[str, Any], folder: Path | None = None) -> ReportedRun:
    """Return a run without a log: what result.json claims. Nothing of a claimed drive is believed to be a success."""
    claimed, faults = result["outcome"] not in UNDRIVEN, _faults(result)
    metrics = result.get("metrics")
    metrics = metrics if isinstance(metrics, Mapping) else {}
    facts = {**result, "metrics": metrics if claimed else {name: metrics[name] for name in metrics if name == "plan_s"}}
    row = _row(facts, faults) | {"succeeded": False, "certified": None, "bound_m": None, "command": None}
    row["outcome"] += ", claimed" if claimed else ""
    run = {key: result[key] for key in (*COLUMNS, "margin_auto", "time_limit_s", "settings") if key in result}
    return ReportedRun(
        folder,
        row,
        _options(result),
        _capital(shown(result.get("sentence") or "")),
        "Claimed by result.json, without a log." if claimed else "The robot did not drive.",
        [],
        faults,
        [
            ("Claimed metrics", _pairs(facts["metrics"])),
            ("Claimed planner", _pairs(result.get("options"))),
            ("Claimed run", _pairs({**run, "digest": result.get("digest")})),
        ],
    )


def run_table(runs: Sequence[ReportedRun]) -> RunTable:
    """Return the runs as a campaign's table: labels hold the options that differ between runs of a planner."""
    values: dict[str, dict[str, set[float | str]]] = {}
    for run in runs:
        for name, value in run.options.items():
            values.setdefault(run.row["planner_name"], {}).setdefault(name, set()).add(value)
    for run in runs:
        several = values.get(run.row["planner_name"], {})
        chosen = {name: value for name, value in sorted(run.options.items()) if len(several[name]) > 1}
        run.row["planner"] = " ".join([run.row["planner_name"], *(f"{name}={chosen[name]}" for name in chosen)])
        run.row.update({f"option.{name}": value for name, value in chosen.items()})
    names = dict.fromkeys(name for run in runs for name in run.row)
    return RunTable({name: [run.row.get(name) for run in runs] for name in names})


def _row(facts: Mapping[str, Any], faults: Sequence[str]) -> dict[str, Any]:
    """Return the columns that a log and a claim have."""
    settings, metrics = facts.get("settings"), facts["metrics"]
    sensed = settings if isinstance(settings, Mapping) else {}
    name = shown(facts.get("planner"))
    return {
        "world": shown(facts.get("world")),
        "planner": name,
        "planner_name": name,
        "robot": shown(facts.get("robot")),
        "seed": _plain(facts.get("seed")),
        "outcome": shown(facts["outcome"]),
        "test": "test failed" if faults else None,
        "reason": shown(facts.get("reason") or "") or None,
        **{column: _plain(facts.get(key)) for key, column in COLUMNS.items()},
        **{key: _plain(sensed.get(key, usual)) for key, usual in SENSED.items()},
        **{metric: number(metrics.get(metric)) for metric in METRICS},
    }


def _plain(value: Any) -> Any:
    """Return a number as it is, another value as a short text, None for nothing."""
    return value if value is None or number(value) is not None else shown(value, 40)


def _options(facts: Mapping[str, Any]) -> dict[str, float | str]:
    options = facts.get("options")
    known = options if isinstance(options, Mapping) else {}
    return {shown(key, 40): shown(None) if value is None else _plain(value) for key, value in known.items()}


def _faults(result: Mapping[str, Any]) -> list[str]:
    claimed = result.get("faults")
    return [shown(text, LONGEST_COMMAND) for text in claimed] if isinstance(claimed, list) else []


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


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
    return [with_unit(shown(key), value) for key, value in values.items()] if isinstance(values, Mapping) else []
