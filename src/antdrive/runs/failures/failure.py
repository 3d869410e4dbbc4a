"""What a failure is, and when two runs fail in the same way."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from antdrive.base.checks import suggest
from antdrive.base.errors import FieldError, input_error
from antdrive.planners import PlannerError
from antdrive.runs.suites.baseline import Baseline
from antdrive.runs.suites.demands import CYLINDER, UNSEEN, WALL, Bound
from antdrive.runs.suites.evaluation import RAISED, evaluate, limits, unmet_demands
from antdrive.runs.suites.nearest import NOTHING, cause_of_contact, first_contact_kind
from antdrive.runs.suites.suite import SuiteCase
from antdrive.sim.log.metrics import METRICS, WALL_CLOCK
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run, run
from antdrive.sim.scenario import Scenario

_BOUND = re.compile(r"\s*(\w+)\s*(<=|>=|<|>|==)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


def parse_bound(text: str) -> Bound:
    """The bound in a text such as "min_clearance_m < 0.02".

    Args:
        text: metric, relation and number

    Raises:
        FieldError: it is not of that form, or there is no such metric.
    """
    found = _BOUND.fullmatch(text)
    if found is None or not math.isfinite(float(found[3])):
        raise FieldError("--while", f"write METRIC < NUMBER, with <, <=, >, >= or ==; got {text!r:.60}")
    if found[1] not in METRICS:
        raise FieldError("--while", f"unknown metric {found[1]!r:.60}; {suggest(found[1], METRICS)}")
    if found[1] in WALL_CLOCK:
        raise FieldError("--while", f"{found[1]} depends on the machine and its load; a bound on it does not repeat")
    return Bound(found[1], found[2], float(found[3]))


@dataclass(frozen=True)
class Failure:
    """How a run failed. Two runs fail in the same way if their failures are equal.

    Attributes:
        outcome: the key of the run's outcome, such as collided; succeeded for a drive that ends at the goal but is
            not certified or crosses a bound; planner_error where the planner raised something
        touched: what was touched first: cylinder, unseen cylinder, mover, wall, or nothing
        cause: for contacts with cylinders that the planner knew of and with walls, the cause that took most of the
            margin until then (a key of `antdrive.sim.log.margin.CAUSES`); else what the run's reason says, without its
            numbers; for a refused certificate the check that refused it; for a bound, the bound
    """

    outcome: str
    touched: str
    cause: str

    @property
    def sentence(self) -> str:
        """The failure in words."""
        parts = [self.outcome]
        if self.touched != NOTHING:
            parts.append(f"with a {self.touched}" if self.touched != UNSEEN else f"with an {self.touched}")
        return " ".join(parts) + (f" ({self.cause})" if self.cause else "")


def failure_of(done: Run, bound: Bound | None = None) -> Failure | None:
    """How a run failed; None if it did not.

    Args:
        done: the run
        bound: what counts as failure; None: everything but a certified success
    """
    rollout = done.rollout
    touched = NOTHING if rollout is None else first_contact_kind(rollout)
    if bound is not None:
        if rollout is None or not bound.holds(METRICS[bound.metric](rollout)):
            return None
        return Failure(done.outcome.key, touched, str(bound))
    if done.succeeded:
        return None
    if done.outcome is Outcome.SUCCEEDED:
        assert done.certificate is not None
        return Failure(done.outcome.key, touched, "certificate: " + without_numbers(done.certificate.problems[0]))
    if rollout is not None and touched in (CYLINDER, WALL):
        return Failure(done.outcome.key, touched, cause_of_contact(rollout))
    return Failure(done.outcome.key, touched, "" if touched != NOTHING else without_numbers(done.reason))


def bound_broken_in(case: SuiteCase, done: Run) -> Bound | None:
    """What counts as failing where a test's drive ends as expected but breaks a bound of the test or of its baseline.

    None where it breaks none: then the run itself is the failure, or there is none.
    """
    rollout, demands = done.rollout, case.demands
    if rollout is None or done.outcome is not demands.outcome:
        return None
    if (found := _first_broken(demands.bounds, rollout)) is not None:
        return found
    if not case.entry.baseline or any(unmet_demands(done, demands)):
        return None
    baseline = Baseline.own(case.baseline_path, case.id)
    faults = () if baseline is None else evaluate(done, demands, baseline).faults
    if baseline is None or not faults:
        return None
    same = baseline.outcome is done.outcome and baseline.line
    found = _first_broken(limits(demands, baseline), rollout) if same else None
    if found is None and done.succeeded:
        raise input_error(case.address, f"{faults[0]}; no other world repeats that, so there is nothing to shrink")
    return found


def _first_broken(bounds: Iterable[Bound], rollout: Rollout) -> Bound | None:
    broken = (bound.broken(METRICS[bound.metric](rollout)) for bound in bounds)
    return next((bound for bound in broken if bound is not None), None)


@dataclass(frozen=True, eq=False)
class Attempt:
    """What came of an attempt to run a scenario.

    Attributes:
        scenario: the scenario
        run: its run; None where the planner raised something
        error: what it raised; None where it did not
    """

    scenario: Scenario
    run: Run | None
    error: PlannerError | None = None

    @classmethod
    def of(cls, scenario: Scenario) -> Attempt:
        """Run a scenario."""
        try:
            return cls(scenario, run(scenario))
        except PlannerError as error:
            return cls(scenario, None, error)

    @property
    def rollout(self) -> Rollout | None:
        """The log of the drive; None if the robot did not drive."""
        return None if self.run is None else self.run.rollout

    @property
    def fingerprint(self) -> str:
        """The attempt in one text: the same wherever the run is the same bit for bit, or the planner raises the same."""
        if self.run is None:
            return without_numbers(str(self.error))
        return f"{self.run.outcome.key}: {self.run.reason}" if self.run.rollout is None else self.run.rollout.digest

    def failure(self, bound: Bound | None = None) -> Failure | None:
        """How it failed, as `failure_of` says; what a planner raises is a failure, whatever the bound."""
        return failure_of_planner(self.error) if self.run is None else failure_of(self.run, bound)


def failure_of_planner(error: PlannerError | None) -> Failure:
    """The failure of a run that ended because the planner raised something."""
    return Failure(RAISED, NOTHING, without_numbers(str(error)))


def without_numbers(text: str) -> str:
    """A reason without what differs from world to world: its numbers, and the names of single obstacles."""
    masked = re.sub(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", "#", text)
    masked = re.sub(r"the (?:left|lower|right|upper) wall|(?:obstacles|movers|unseen)\[#\]", "#", masked)
    return re.sub(r" at \(#, #\)(?: with radius #)?", "", masked)
