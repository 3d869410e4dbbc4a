"""Runs of a report that are no campaign's: rows of its table and their details.

A run is what its log says; without a log, what result.json claims.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.base.errors import InputError, input_error
from antdrive.runs.statistics.run_table import RunTable
from antdrive.sim.facts import FACTS, SENSED, LoggedRun, facts_of
from antdrive.sim.log.certificate import at_least
from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run
from antdrive.sim.recorded import command_of
from antdrive.sim.verifying import false_claims, read_result
from antdrive.views.pages.rendering import link_to, number, shown

LONGEST_COMMAND = 4000  # characters
VIEW = "drive.html"  # page of a run
UNDRIVEN = (Outcome.NO_PATH.key, Outcome.STOPPED.key)  # outcomes of runs without a log
REQUIRED = ("world", "planner", "robot", "seed", "outcome")  # keys of result.json
WRITTEN = tuple(name for name, fact in FACTS.items() if fact.proof == "written")
#: Columns of settings, as in a campaign's table, by their keys in result.json.
COLUMNS = {"margin_m": "margin", "cell_m": "cell"} | {
    name: name for name in ("smoothing", "noise", "physics_hz", "control_hz")
}


@dataclass(frozen=True)
class ReportedRun:
    """Row of a run and the texts of its details."""

    folder: Path | None  # folder of the run's files; None for a run from Python
    row: dict[str, Any]  # values by column
    options: Mapping[str, float | str]  # the planner's options
    sentence: str  # the outcome
    certificate: str  # the certificate
    problems: list[str]  # of the certificate, and contradictions between result.json and the log, a sentence each
    faults: list[str]  # failures of the run's test, as claimed by result.json, a sentence each

    @property
    def why(self) -> list[str]:
        """Why the run is no success, a sentence each."""
        return [*self.problems, *(f"test failed: {fault}" for fault in self.faults)]

    def link(self, base: Path) -> str:
        """Return the path of the run's page, or of its folder, relative to the report's; empty for a run from Python."""
        if self.folder is None:
            return ""
        view = self.folder / VIEW
        inside = view.is_file() and view.resolve().is_relative_to(self.folder.resolve())
        return link_to(view if inside else self.folder, base)


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
        facts = {**facts_of(log, WRITTEN), "metrics": log.metrics}
    except ValueError as error:
        raise input_error(name, str(error)) from None
    certificate, record = log.certificate, rollout.record
    outcome = record.outcome
    proved = f"at least {at_least(certificate.bound)} of clearance, including between logged poses."
    faults = _faults(result)
    row = _row({**facts, "outcome": outcome.key, "reason": record.reason}, faults) | {
        "succeeded": log.succeeded and not faults,
        "certified": certificate.certified,
        "bound_m": number(certificate.bound),
        "digest": rollout.digest,
        "command": _test_command(result) or shown(command_of(rollout.record) or "", LONGEST_COMMAND) or None,
    }
    return ReportedRun(
        folder,
        row,
        _options(facts),
        _capital(outcome.value) + (f" ({shown(record.reason)})." if record.reason else "."),
        f"{_capital(certificate.statement)}: {proved}" if certificate.certified else "Not certified collision-free.",
        [*certificate.problems, *map(shown, false_claims(result, log))],
        faults,
    )


def claimed_run(result: Mapping[str, Any], folder: Path | None = None) -> ReportedRun:
    """Return a run without a log: what result.json claims. Nothing of a claimed drive is believed to be a success."""
    claimed, faults = result["outcome"] not in UNDRIVEN, _faults(result)
    metrics = result.get("metrics")
    metrics = metrics if isinstance(metrics, Mapping) else {}
    facts = {**result, "metrics": metrics if claimed else {name: metrics[name] for name in metrics if name == "plan_s"}}
    row = _row(facts, faults) | {"succeeded": False, "certified": None, "bound_m": None, "command": None}
    row["outcome"] += ", claimed" if claimed else ""
    return ReportedRun(
        folder,
        row,
        _options(result),
        _capital(shown(result.get("sentence") or "")) + "." * bool(result.get("sentence")),
        "Claimed by result.json, without a log." if claimed else "The robot did not drive.",
        [],
        faults,
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
        "outcome": shown(facts["outcome"]) + (", test failed" if faults else ""),
        "test": "failed" if faults else None,
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


def _test_command(result: Mapping[str, Any]) -> str | None:
    """Return a test's command if result.json names one and nothing else: records of tests in Python name no files."""
    try:
        words = shlex.split(claimed := str(result.get("command")))
    except ValueError:
        return None
    runs_a_test = words[:-1] in (["antdrive", "check"], ["pytest"]) and not words[-1].startswith("-")
    return claimed if runs_a_test and shlex.join(words) == claimed and claimed.isprintable() else None


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
