"""Baselines: results of earlier drives, in small text files for version control."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import PlainValidator, TypeAdapter, ValidationError

from antdrive.base.atomic import write_text
from antdrive.base.errors import FieldError, input_error
from antdrive.base.files import parse_json, read_bytes
from antdrive.base.plane import wrap_angle
from antdrive.base.records import STRICT
from antdrive.base.types import Floats
from antdrive.base.user_code import module_hash
from antdrive.base.version import versions
from antdrive.planners import is_built_in
from antdrive.runs.suites.nearest import ClosestApproach, nearest_of
from antdrive.runs.suites.suite import shown_path
from antdrive.sim.facts import facts_of
from antdrive.sim.log.metrics import METRICS, WALL_CLOCK
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import canonical_hash, hashes_of_configuration
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.timeline import Timeline
from antdrive.sim.pipeline import ENDED_BY, Run
from antdrive.sim.recording import configuration_of
from antdrive.sim.scenario import Scenario

SCHEMA = 1
MAX_BYTES = 20_000  # of a baseline
LINE_HZ = 10.0  # rate of the driven line, halved until the file is small enough [Hz]
LEAST_HZ = 1e-3
PLANNER_FILE, CONTROLLER_FILE = "planner file", "controller file"  # hashes of the files of custom ones


def _to_outcome(value: Any) -> Outcome:
    return Outcome.from_key(str(value))


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """The result of an earlier drive.

    Attributes:
        schema: version of the format, 1
        case: the test it belongs to, such as aisle[0]
        outcome: outcome of the run
        reason: details of the outcome, in words; may be empty
        certified: whether the drive was certified collision-free
        margin_m: the margin chosen for `margin: auto` [m]; None: it was given
        bound_m: the clearance proved by the certificate [m]; None without one
        metrics: every metric except wall-clock times; empty if the robot did not drive
        nearest: the closest approach; None if the robot did not drive
        hashes: of the world, the unseen obstacles, the robot, the settings and the file of a custom planner
        versions: of antdrive, Python and the packages that computed the drive
        drive_digest: `Rollout.drive_digest`; empty if the robot did not drive
        limiters: names of the rules that can limit the robot's speed
        line_hz: rate of the line [Hz]
        line: x [m], y [m], yaw [rad] and the index of the limiting rule, for each sample; the last is the drive's end
    """

    __pydantic_config__ = STRICT

    schema: int = SCHEMA
    case: str
    outcome: Annotated[Outcome, PlainValidator(_to_outcome)]
    reason: str
    certified: bool
    bound_m: float | None
    metrics: Mapping[str, float | None]
    nearest: ClosestApproach | None
    hashes: Mapping[str, str]
    versions: Mapping[str, str]
    drive_digest: str
    limiters: tuple[str, ...]
    line_hz: float
    line: tuple[tuple[float, float, float, int], ...]
    margin_m: float | None = None

    @property
    def times(self) -> Floats:
        """The time of each sample of the line (N,) [s]."""
        times = np.arange(len(self.line)) / self.line_hz
        if len(times):
            times[-1] = self.metric("duration_s")
        return times

    @property
    def xy(self) -> Floats:
        """The positions of the line (N, 2) [m]."""
        return np.array([sample[:2] for sample in self.line], dtype=np.float64).reshape(-1, 2)

    def metric(self, name: str) -> float:
        """Return a metric of the earlier drive; NaN if missing.

        Args:
            name: a name of `METRICS`
        """
        value = self.metrics.get(name)
        return math.nan if value is None else value

    @classmethod
    def of(cls, run: Run, case: str) -> Baseline:
        """Return the baseline of a run.

        Args:
            run: the run
            case: the test's name
        """
        rollout, names = run.rollout, [name for name in METRICS if name not in WALL_CLOCK]
        facts = facts_of(run, ("certified", "bound_m", "drive_digest", *names))
        baseline = cls(
            case=case,
            outcome=run.outcome,
            reason=run.reason,
            certified=bool(facts["certified"]),
            bound_m=_rounded(facts["bound_m"]),
            metrics={name: _rounded(facts[name]) for name in names if name in facts},
            nearest=nearest_of(rollout) if rollout else None,
            hashes=configuration_hashes(run),
            versions=versions(),
            drive_digest=facts["drive_digest"] or "",
            limiters=rollout.record.limiters if rollout else (),
            line_hz=LINE_HZ,
            line=_line(rollout, LINE_HZ) if rollout else (),
            margin_m=run.scenario.margin if run.scenario.chosen is not None else None,
        )
        while rollout and len(baseline.to_text()) > MAX_BYTES and baseline.line_hz > LEAST_HZ:
            hz = baseline.line_hz / 2
            baseline = dataclasses.replace(baseline, line_hz=hz, line=_line(rollout, hz))
        return baseline

    def to_text(self) -> str:
        """Return the baseline as JSON, one value or one sample of the line per line."""
        values = _ADAPTER.dump_python(self, mode="python")
        if self.margin_m is None:
            del values["margin_m"]
        line = [json.dumps(sample) for sample in values.pop("line")]
        values["outcome"] = self.outcome.key
        values["nearest"] = None if self.nearest is None else dataclasses.asdict(self.nearest)
        head = json.dumps(values, indent=1, allow_nan=False, ensure_ascii=False)
        body = ",\n".join(line)
        return head.removesuffix("\n}") + f',\n "line": [\n{body}\n ]\n}}\n'.replace("[\n\n ]", "[]")

    def save(self, path: Path) -> None:
        """Write the baseline atomically.

        Raises:
            InputError: the file cannot be written.
        """
        write_text(path, self.to_text())

    def renew(self, path: Path) -> str:
        """Write the baseline unless the file holds the same drive; return "written", "renewed" or "unchanged".

        Raises:
            InputError: the file cannot be written.
        """
        existed = path.exists()
        if existed and read_bytes(path, 10 * MAX_BYTES, "a baseline") == self.to_text().encode():
            return "unchanged"
        self.save(path)
        return "renewed" if existed else "written"

    @classmethod
    def load(cls, path: Path) -> Baseline | None:
        """Load a baseline; None if the file is missing.

        Raises:
            InputError: the file is not a baseline.
        """
        if not path.exists():
            return None
        again = "accept the drive again with antdrive accept"
        try:
            text = read_bytes(path, 10 * MAX_BYTES, "a baseline").decode("utf-8")
            data = parse_json(text)
        except FieldError as error:
            raise input_error(str(path), f"{error}, or {again}") from None
        except (UnicodeDecodeError, ValueError, RecursionError) as error:
            if type(error).__name__ == "InputError":
                raise
            raise input_error(str(path), f"not a baseline: not JSON; restore it, or {again}") from None
        if not isinstance(data, dict) or data.get("schema") != SCHEMA:
            raise input_error(str(path), f"schema: must be {SCHEMA}; {again}")
        try:
            baseline = _ADAPTER.validate_json(text)
        except ValidationError as error:
            fault = error.errors(include_url=False)[0]
            key = ".".join(map(str, fault["loc"]))
            problem = f"{fault['msg'][0].lower()}{fault['msg'][1:]}"
            raise input_error(str(path), *filter(None, [key]), f"{problem}; restore it, or {again}") from None
        for key, problem in baseline.gaps():
            raise input_error(str(path), key, f"{problem}; restore it, or {again}")
        return baseline

    @classmethod
    def own(cls, path: Path, case: str) -> Baseline | None:
        """Load the baseline of a test; None if the file is missing.

        Args:
            path: the file
            case: the name of the test

        Raises:
            InputError: the file is not a baseline, or belongs to another test.
        """
        baseline = cls.load(path)
        if baseline is not None and baseline.case != case:
            problem = f"belongs to {baseline.case}, not to {case}; delete the file and accept {case} again"
            raise input_error(shown_path(path), "case", problem)
        return baseline

    def gaps(self) -> Iterator[tuple[str, str]]:
        """Yield missing and surplus parts, as key and problem; a comparison needs complete baselines."""
        parts = {name: getattr(self, name) for name in ("metrics", "nearest", "drive_digest", "line", "hashes")}
        if self.outcome in ENDED_BY.values() and not any(part for name, part in parts.items() if name != "hashes"):
            return
        known = [name for name in METRICS if name not in WALL_CLOCK]
        for name in self.metrics:
            if name not in known:
                yield f"metrics.{name}", "unknown metric"
        for name, part in parts.items():
            if not part:
                yield name, "missing, though the robot drove"
        if not (math.isfinite(self.line_hz) and self.line_hz > 0):
            yield "line_hz", "must be greater than 0"
        if not math.isfinite(self.metric("duration_s")):
            yield "metrics.duration_s", "must be a number"


_ADAPTER = TypeAdapter(Baseline)


def configuration_hashes(run: Run) -> dict[str, str]:
    """Return the hashes of a run's configuration: world, robot, settings, unseen obstacles.

    The time limit counts only if it was given: the default follows from the robot and the route.
    """
    s, plan = run.scenario, run.plan
    planner: Any = s.planner
    if not (plan.solved or plan.options) and dataclasses.is_dataclass(planner):  # it was never asked
        options = {field.name: getattr(planner, field.name) for field in dataclasses.fields(planner)}
        plan = dataclasses.replace(plan, options=options)
    fields = {
        **configuration_of(s, run.grid, plan),
        "time_limit": s.time_limit or s.task.time_limit or 1.0,
        "smoothing": s.smoothing,
    }
    return hashes_of_configuration(fields) | fixed_hashes(s)


def fixed_hashes(s: Scenario) -> dict[str, str]:
    """Return the hashes of a scenario's parts that are known without a plan: world, robot, unseen obstacles, planner's file."""
    unseen = json.dumps([dataclasses.asdict(disc) for disc in s.unseen], sort_keys=True)
    return {
        "world": canonical_hash(s.task),
        "robot": canonical_hash(s.robot),
        "unseen obstacles": hashlib.sha256(unseen.encode()).hexdigest(),
        **{name: module_hash(module) for name, module in custom_modules(s).items()},
        **s.sources,
    }


def custom_modules(s: Scenario) -> dict[str, str]:
    """Return the modules of a scenario's custom planner and controller, by the names of their hashes."""
    parts = {PLANNER_FILE: s.planner, CONTROLLER_FILE: s.controller}
    return {name: type(part).__module__ for name, part in parts.items() if not is_built_in(part)}


def _rounded(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, 6)


def _line(rollout: Rollout, hz: float) -> tuple[tuple[float, float, float, int], ...]:
    """Sample the driven line at a rate, with the drive's end as the last sample."""
    end = float(rollout.t[-1])
    moments = np.append(np.arange(0.0, max(end - 0.5 / hz, 0.0), 1 / hz), end) if end > 0 else np.zeros(1)
    timeline = Timeline(rollout)  # it interpolates, because the physics rate need not be a multiple of the line's
    x, y, yaw = timeline.poses(moments).T
    samples = np.column_stack([x, y, wrap_angle(yaw)]).tolist()
    return tuple(
        (round(x, 3) + 0.0, round(y, 3) + 0.0, round(a, 3) + 0.0, int(rule))
        for (x, y, a), rule in zip(samples, rollout.limiter[timeline.nearest(moments)].tolist(), strict=True)
    )
