"""Finished runs and their facts, each declared once; `result.json`, tables, baselines, reports and `verify` read `FACTS`.

To add a fact, add a line to `_TABLE`, or a metric to `antdrive.sim.log.metrics`, and explain it on the page of the
files that hold it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from antdrive.base.errors import FieldError
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.metrics import METRICS, measure, succeeded
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import DriveRecord, plain_value, settings_of
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.settings import SETTINGS

if TYPE_CHECKING:
    from antdrive.planners import PlanResult
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Grid


ENDED_BY = {
    "NO_PATH": Outcome.NO_PATH,
    "STOPPED": Outcome.STOPPED,
    "INVALID": Outcome.INVALID_PLAN,
}
#: Map, localisation and odometry of a log whose record leaves them out, as at their defaults.
SENSED: Mapping[str, Any] = {name: SETTINGS[name].default for name in ("map", "localisation", "odometry")}
#: The defaults of settings without a key of their own in the record.
OTHERS: Mapping[str, Any] = {name: one.default for name, one in SETTINGS.items() if not DriveRecord.held(name)}


@dataclass(frozen=True, eq=False)
class LoggedRun:
    """Run known by its log alone."""

    rollout: Rollout
    certificate: Certificate

    @classmethod
    def of(cls, rollout: Rollout) -> LoggedRun:
        """Return a log with its certificate."""
        return cls(rollout, certify(rollout))

    @property
    def record(self) -> DriveRecord:
        """The log's record."""
        return self.rollout.record

    @functools.cached_property
    def metrics(self) -> dict[str, float]:
        """All metrics by name."""
        return measure(self.rollout)

    @property
    def succeeded(self) -> bool:
        """Whether the robot stopped at the goal in time, certified free of contact."""
        return succeeded(self.rollout) and self.certificate.certified


@dataclass(frozen=True, eq=False)
class Run:
    """Result of a scenario: a plan and, if the planner found a path, a rollout with its certificate.

    Attributes:
        scenario: the scenario
        grid: the planning grid
        plan: the planner's answer
        rollout: the log of the drive; None if planning found no path
        certificate: the collision certificate of the log; None without a rollout
    """

    scenario: Scenario
    grid: Grid
    plan: PlanResult
    rollout: Rollout | None = None
    certificate: Certificate | None = None

    @property
    def outcome(self) -> Outcome:
        """How the run ended."""
        if self.rollout is not None:
            return self.rollout.outcome
        return ENDED_BY[self.plan.status.name]

    @property
    def reason(self) -> str:
        """Details beyond the outcome's sentence; may be empty."""
        return self.rollout.record.reason if self.rollout is not None else self.plan.reason

    @property
    def certified(self) -> bool:
        """Whether the drive is certified free of contact."""
        return self.certificate is not None and self.certificate.certified

    @property
    def succeeded(self) -> bool:
        """Whether the robot stopped at the goal in time, certified free of contact."""
        return self.outcome is Outcome.SUCCEEDED and self.certified

    @functools.cached_property
    def logged(self) -> LoggedRun | None:
        """The log with its certificate; None without a log."""
        return None if self.rollout is None else LoggedRun(self.rollout, self.certificate or certify(self.rollout))

    @property
    def metrics(self) -> dict[str, float]:
        """Metrics of the drive by name, as defined in `METRICS`.

        Raises:
            ValueError: the run has no rollout, because planning found no path.
        """
        return dict(self._driven().metrics)

    def metric(self, name: str) -> float:
        """Return one metric of the drive, such as `run.metric("spl")`.

        Raises:
            ValueError: the run has no rollout, because planning found no path; or the metric is unknown.
        """
        log = self._driven()
        if name not in METRICS:
            raise FieldError("metric", f"unknown {name!r}; choose from {', '.join(METRICS)}")
        return log.metrics[name]

    def _driven(self) -> LoggedRun:
        if self.logged is None:
            reason = f": {self.reason}" if self.reason else ""
            raise ValueError(f"no rollout: planning ended with {self.outcome.key}{reason}")
        return self.logged

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, for JSON; `docs/reference/rollout-format.md` lists the keys."""
        return result_of(self)

    def __repr__(self) -> str:
        s, log = self.scenario, self.rollout
        reason = f" ({self.reason:.200})" if self.reason else ""
        drive = f", {log.t[-1]:.1f} s" if log is not None else ""
        proof = f", {self.certificate.statement}" if self.certificate is not None else ""
        return f"<Run of {s.planner_label} in {s.task.world.name}: {self.outcome.value}{reason}{drive}{proof}>"

    def _repr_html_(self) -> str:
        from antdrive.sim.scenario import picture_of
        from antdrive.worlds.svg import card

        s, more = self.scenario, {"reason": self.reason} if self.reason else {}
        if self.rollout is not None:
            return self.rollout.card(certified="yes" if self.certified else "no", **more)
        facts = {"planner": s.planner_label, "robot": s.robot.name, **more}
        return card(picture_of(s), f"{s.task.world.name}: {self.outcome.value}", facts)


@dataclass(frozen=True)
class Fact:
    """Fact of a finished run."""

    name: str  # key in result.json, or column of a campaign's table
    # what shows it: the scenario as written, the log, its certificate, or a clock, which the log repeats
    proof: Literal["written", "log", "certificate", "clock"]
    of: Callable[[LoggedRun], Any]  # its value by a log with its certificate
    undriven: Callable[[Run], Any] = lambda run: None  # its value without a log
    unit: str = ""  # "1" for a ratio or a count; empty for words
    column: str = ""  # type of its column in a campaign's table; empty: none
    within: str | None = ""  # object of result.json that holds it; empty: the file itself; None: not in result.json
    optional: bool = False  # whether None is omitted


def _frame(log: LoggedRun) -> list[float] | None:
    frame = log.record.task.frame
    return list(frame) if any(frame) else None


def _ends(log: LoggedRun) -> dict[str, Any]:
    task = log.record.task
    ends: dict[str, Any] = plain_value(
        {"start": task.start, "goal": task.goal, "goal_tolerance_m": task.goal_tolerance}
    )
    return ends


def _changes(log: LoggedRun) -> dict[str, Any]:
    """Return the keys of `settings` that the log repeats, without the rules among movers that were asked for."""
    return {
        "controller": {"name": log.record.controller.name, **log.record.controller.settings},
        **(SENSED if log.record.sensing is None else settings_of(log.record.sensing)),
        "unseen": [[disc.x, disc.y, disc.radius] for disc in log.record.unseen],
        **OTHERS,
        **(log.record.settings or {}),
    }


def _sights(log: LoggedRun) -> list[dict[str, Any]] | None:
    if not len(log.rollout.scans):
        return None
    from antdrive.sim.log.sights import passed  # imported here, because it loads kernels

    return [sight.as_dict() for sight in passed(log.rollout)]


def _metric(name: str, log: LoggedRun) -> float:
    return log.metrics[name]


def _planned(run: Run) -> float | None:
    return run.plan.line_length if run.plan.solved else None


def _metrics() -> Iterator[Fact]:
    for name, metric in METRICS.items():
        of = functools.partial(_metric, name)
        more: dict[str, Any] = {"undriven": lambda run: run.plan.wall_s} if name == "plan_s" else {}
        yield Fact(name, metric.proof, of, unit=metric.unit, column="double", within="metrics", optional=True, **more)


_TABLE = (
    Fact("world", "written", lambda log: log.record.task.world.name),
    Fact("planner", "written", lambda log: log.record.planner.name),
    Fact("robot", "written", lambda log: log.record.robot.name),
    Fact("seed", "written", lambda log: log.record.seed),
    Fact("options", "written", lambda log: dict(log.record.planner.settings)),
    Fact("smoothing", "written", lambda log: log.record.smoothing.asked),
    Fact("noise", "written", lambda log: log.record.noise),
    Fact("margin_m", "written", lambda log: log.record.margin, unit="m"),
    Fact("margin_auto", "written", lambda log: log.record.margin_choice is not None),
    Fact("cell_m", "written", lambda log: log.record.cell, unit="m"),
    Fact("physics_hz", "written", lambda log: log.record.physics_hz, unit="Hz"),
    Fact("control_hz", "written", lambda log: log.record.control_hz, unit="Hz"),
    Fact("time_limit_s", "written", lambda log: None, unit="s", optional=True),  # the log has the limit that followed
    Fact("task", "written", _ends),
    Fact("frame", "written", _frame, optional=True),
    Fact("settings", "written", _changes),
    Fact("outcome", "log", lambda log: log.record.outcome.key, lambda run: run.outcome.key, column="string"),
    Fact("sentence", "log", lambda log: log.record.outcome.value, lambda run: run.outcome.value),
    Fact("succeeded", "certificate", lambda log: log.succeeded, lambda run: False, column="bool"),
    Fact("certified", "certificate", lambda log: log.certificate.certified, column="bool", within=None),
    Fact("reason", "log", lambda log: log.record.reason, lambda run: run.reason, column="string"),
    Fact("certificate", "certificate", lambda log: log.certificate.as_dict()),
    Fact("bound_m", "certificate", lambda log: log.certificate.bound, unit="m", within=None),
    Fact("digest", "log", lambda log: log.rollout.digest, column="string"),
    Fact("drive_digest", "log", lambda log: log.rollout.drive_digest, column="string", within=None),
    *_metrics(),
    Fact("plan_length_m", "log", lambda log: log.record.plan.length_m, _planned, "m", "double", None),
    Fact("grid_optimum_m", "log", lambda log: log.record.plan.grid_optimum_m, unit="m", column="double", within=None),
    Fact("sights", "log", _sights, optional=True),
)

#: Facts by name.
FACTS: Mapping[str, Fact] = MappingProxyType({fact.name: fact for fact in _TABLE})
#: Facts that result.json holds, and those that a campaign's table holds besides a run's configuration.
IN_RESULT = tuple(name for name, fact in FACTS.items() if fact.within is not None)
IN_TABLE = tuple(name for name, fact in FACTS.items() if fact.column)


def facts_of(run: Run | LoggedRun, names: Sequence[str] = IN_RESULT) -> dict[str, Any]:
    """Return facts of a finished run by name, as plain values; of a log alone, its settings are those that it repeats."""
    if isinstance(run, LoggedRun):
        return _known({name: FACTS[name].of(run) for name in names})
    facts = {name: value for name, value in _written(run).items() if name in names}
    log = run.logged
    others = (FACTS[name] for name in names if name not in facts)
    return facts | _known({fact.name: fact.undriven(run) if log is None else fact.of(log) for fact in others})


def _known(facts: dict[str, Any]) -> dict[str, Any]:
    """Return facts without the optional ones that do not exist."""
    return {name: value for name, value in facts.items() if value is not None or not FACTS[name].optional}


def _written(run: Run) -> dict[str, Any]:
    """Return what the scenario says, with the planner's effective options and the cells of its plan."""
    options = run.rollout.record.planner.settings if run.rollout is not None else settings_of(run.plan.options)
    written = run.scenario.as_dict()
    return {**written, "options": dict(options) or written["options"], "cell_m": run.grid.cell}


def result_of(run: Run | LoggedRun, names: Sequence[str] = IN_RESULT) -> dict[str, Any]:
    """Return facts, nested as in result.json."""
    result: dict[str, Any] = {}
    for name, value in facts_of(run, names).items():
        within = FACTS[name].within
        (result.setdefault(within, {}) if within else result)[name] = value
    return result
