"""Pipeline from a scenario to a certified rollout."""

from __future__ import annotations

import functools
import time
from dataclasses import dataclass
from typing import Any

from antdrive.base.errors import FieldError
from antdrive.base.progress import progress_bar
from antdrive.base.version import require_physics
from antdrive.planners import PlanResult, PlanStatus
from antdrive.sim.compose import compose
from antdrive.sim.driving.drive import Driver, Progress, drive, ignore_progress
from antdrive.sim.driving.plants import Bullet
from antdrive.sim.facts import LoggedRun, result_of
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.physics.engine import Engine
from antdrive.sim.recording import rollout_of
from antdrive.sim.scenario import Scenario, picture_of, usual_time_limit
from antdrive.worlds import Grid
from antdrive.worlds.svg import card

ENDED_BY = {
    PlanStatus.NO_PATH: Outcome.NO_PATH,
    PlanStatus.STOPPED: Outcome.STOPPED,
    PlanStatus.INVALID: Outcome.INVALID_PLAN,
}


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
        return ENDED_BY[self.plan.status]

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
        s, more = self.scenario, {"reason": self.reason} if self.reason else {}
        if self.rollout is not None:
            return self.rollout.card(certified="yes" if self.certified else "no", **more)
        facts = {"planner": s.planner_label, "robot": s.robot.name, **more}
        return card(picture_of(s), f"{s.task.world.name}: {self.outcome.value}", facts)


def plan(s: Scenario) -> tuple[Grid, PlanResult]:
    """Plan a scenario's first route; return the grid and the planner's checked answer.

    Movers are not on the grid; space-time planners get their motions. An invalid plan is returned without its path,
    with status `INVALID` and the error as reason. If the start is too narrow to follow the path, the answer is
    `NO_PATH` with the reason. Without a map, the plan uses the first scan.

    Raises:
        PlannerError: the planner raised an exception, or its answer is not a `PlanResult`.
    """
    return compose(s).guide.first()


def run(
    s: Scenario,
    *,
    planned: tuple[Grid, PlanResult] | None = None,
    progress: Progress | bool | None = None,
) -> Run:
    """Plan and drive one scenario.

    Args:
        s: the scenario
        planned: the result of `plan` for the scenario, or your own plan on its grid, which is checked; None: plan first
        progress: called with the completed fraction of the route; True: show a bar on stderr; False: show nothing; None:
            show a bar in a notebook

    Raises:
        PlannerError: the planner raised an exception, or its answer is not a `PlanResult`.
        ControllerError: the controller raised an exception, or its command is not a finite `Twist`.
    """
    with progress_bar(progress, f"{s.planner_label} in {s.task.world.name}") as update:
        grid, answer, rollout = driven(s, planned, update)
    return Run(s, grid, answer, rollout, None if rollout is None else certify(rollout))


def driven(
    s: Scenario, planned: tuple[Grid, PlanResult] | None = None, progress: Progress = ignore_progress
) -> tuple[Grid, PlanResult, Rollout | None]:
    """Plan and drive as `run` does; return the grid, the plan, and the log if there is a path."""
    require_physics()
    parts = compose(s)
    grid, answer = parts.guide.first() if planned is None else parts.guide.accept(*planned)
    if not answer.solved:
        return grid, answer, None
    route, path = parts.guide.route(grid, answer)
    limit = s.time_limit or s.task.time_limit or usual_time_limit(route.length, s.robot, s.noise)
    started = time.perf_counter()
    driver = Driver(parts.guide, parts.rules, path, s.task, s.robot, s.control_hz)
    with Engine(s.driven_world, s.robot, physics_hz=s.physics_hz, trajectories=s.trajectories) as engine:
        plant = Bullet(engine, s.task.start, s.control_hz)
        ending = drive(plant, driver, parts.localiser, parts.scan, hz=s.control_hz, limit=limit, progress=progress)
        log = plant.finish(ending)
    return grid, answer, rollout_of(s, parts, grid, answer, route, log, limit, time.perf_counter() - started)
