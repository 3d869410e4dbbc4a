"""Failures of runs, and their equality."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from antdrive.base.checks import suggest
from antdrive.base.components import ComponentError
from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.runs.suites.baseline import Baseline
from antdrive.runs.suites.demands import CYLINDER, UNSEEN, WALL, Bound
from antdrive.runs.suites.evaluation import evaluate, limits, unmet_demands
from antdrive.runs.suites.nearest import NOTHING, cause_of_contact, first_contact_kind
from antdrive.runs.suites.scenarios import scenario_of, select
from antdrive.runs.suites.suite import SUFFIX, SuiteCase
from antdrive.sim.log.metrics import METRICS, WALL_CLOCK
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout, log_at, read_record
from antdrive.sim.pipeline import Run, run
from antdrive.sim.recorded import rebuilt
from antdrive.sim.scenario import Scenario

_BOUND = re.compile(r"\s*(\w+)\s*(<=|>=|<|>|==)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


def parse_bound(text: str) -> Bound:
    """Parse a bound such as "min_clearance_m < 0.02".

    Args:
        text: metric, relation and number

    Raises:
        FieldError: the form is invalid, or the metric unknown.
    """
    match = _BOUND.fullmatch(text)
    if match is None or not math.isfinite(float(match[3])):
        raise FieldError("--while", f"write METRIC < NUMBER, with <, <=, >, >= or ==; got {text!r:.60}")
    if match[1] not in METRICS:
        raise FieldError("--while", f"unknown metric {match[1]!r:.60}; {suggest(match[1], METRICS)}")
    if match[1] in WALL_CLOCK:
        raise FieldError("--while", f"{match[1]} depends on the machine and its load; choose a metric that repeats")
    return Bound(match[1], match[2], float(match[3]))


@dataclass(frozen=True)
class Failure:
    """How a run failed. Two runs fail in the same way if their failures are equal.

    Attributes:
        outcome: key of the run's outcome, such as collided; succeeded for a drive that reaches the goal but is not
            certified or crosses a bound; planner_error or controller_error if that raised an error
        touched: thing of the first contact: cylinder, unseen cylinder, mover, wall, or nothing
        cause: for contacts with walls and known cylinders, the largest contribution to the lost margin until then (a
            key of `antdrive.sim.log.margin.CAUSES`); for a refused certificate the failed check; for a bound the bound;
            else the run's reason without its numbers
        reason: the cause with its numbers, where it has any; ignored in comparisons
    """

    outcome: str
    touched: str
    cause: str
    reason: str = field(default="", compare=False)

    @property
    def sentence(self) -> str:
        """The failure in words."""
        parts = [self.outcome]
        if self.touched != NOTHING:
            parts.append(f"with a {self.touched}" if self.touched != UNSEEN else f"with an {self.touched}")
        cause = self.reason or self.cause
        return " ".join(parts) + (f" ({cause})" if cause else "")


def failure_of(done: Run, bound: Bound | None = None) -> Failure | None:
    """Return how a run failed; None if it did not.

    Args:
        done: the run
        bound: the condition that counts as failure; None: anything but a certified success
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
        return _with_reason(done.outcome.key, touched, f"certificate: {done.certificate.problems[0]}")
    if rollout is not None and touched in (CYLINDER, WALL):
        return Failure(done.outcome.key, touched, cause_of_contact(rollout))
    return _with_reason(done.outcome.key, touched, "" if touched != NOTHING else done.reason)


def bound_broken_in(case: SuiteCase, done: Run) -> Bound | None:
    """Return the bound to shrink for, if a test's drive ends as expected but breaks a bound of the test or its baseline.

    None if it breaks none: then the run itself is the failure, or there is none.
    """
    rollout, demands = done.rollout, case.demands
    if rollout is None or done.outcome is not demands.outcome:
        return None
    if (broken := _first_broken(demands.bounds, rollout)) is not None:
        return broken
    if not case.entry.baseline or any(unmet_demands(done, demands)):
        return None
    baseline = Baseline.own(case.baseline_path, case.id)
    faults = () if baseline is None else evaluate(done, demands, baseline).faults
    if baseline is None or not faults:
        return None
    same = baseline.outcome is done.outcome and baseline.line
    broken = _first_broken(limits(demands, baseline), rollout) if same else None
    if broken is None and done.succeeded:
        raise input_error(case.address, f"{faults[0]}; another world cannot repeat that, so shrinking is impossible")
    return broken


def failing(
    words: str, planner: str | None, controller: str | None, choose: Callable[[Scenario], Scenario]
) -> tuple[Scenario, SuiteCase | None]:
    """Return the scenario of a log, or of a test of a suite with the test.

    Args:
        words: a log, a run's folder, or SUITE::SCENARIO
        planner: class of the log's planner as FILE.py:CLASS, if it is not registered
        controller: the same of its controller
        choose: chooses the margin `auto`

    Raises:
        InputError: there is no such log or test, several tests match, or the scenario cannot be built.
    """
    if "::" in words:
        cases = select([words])
        if len(cases) > 1:
            raise InputError(f"{words}: name one of {', '.join(case.address for case in cases[:5])}")
        return scenario_of(cases[0], choose), cases[0]
    if words.endswith(SUFFIX):
        raise InputError(f"{words}: is a suite; name one of its tests: {words}::SCENARIO")
    words = str(log_at(Path(words)))
    try:
        return rebuilt(read_record(words), planner, controller), None
    except InputError as error:
        raise error if str(error).startswith(words) else input_error(words, str(error)) from None


def broken_bound(case: SuiteCase | None, scenario: Scenario) -> Bound | None:
    """Return the bound of a test or its baseline that the drive breaks although it ends as expected; drives if there is any."""
    if case is None or not (case.demands.bounds or case.entry.baseline):
        return None
    done = Attempt.of(scenario).run
    return None if done is None else bound_broken_in(case, done)


def _first_broken(bounds: Iterable[Bound], rollout: Rollout) -> Bound | None:
    broken = (bound.broken(METRICS[bound.metric](rollout)) for bound in bounds)
    return next((bound for bound in broken if bound is not None), None)


@dataclass(frozen=True, eq=False)
class Attempt:
    """The result of running a scenario.

    Attributes:
        scenario: the scenario
        run: its run; None if the planner or the controller raised an error
        error: their error, if any
    """

    scenario: Scenario
    run: Run | None
    error: ComponentError | None = None

    @classmethod
    def of(cls, scenario: Scenario) -> Attempt:
        """Run a scenario."""
        try:
            return cls(scenario, run(scenario))
        except ComponentError as error:
            return cls(scenario, None, error)

    @property
    def rollout(self) -> Rollout | None:
        """The log of the drive; None if the robot did not drive."""
        return None if self.run is None else self.run.rollout

    @property
    def fingerprint(self) -> str:
        """Text that is equal for bitwise equal runs, or for equal errors."""
        if self.run is None:
            return without_numbers(str(self.error))
        return f"{self.run.outcome.key}: {self.run.reason}" if self.run.rollout is None else self.run.rollout.digest

    def failure(self, bound: Bound | None = None) -> Failure | None:
        """Return how it failed, by `failure_of`; an error is a failure for any bound."""
        if self.run is not None:
            return failure_of(self.run, bound)
        assert self.error is not None
        return failure_of_error(self.error)


def failure_of_error(error: ComponentError) -> Failure:
    """Return the failure of a run that ended in an error of the planner or the controller."""
    return _with_reason(f"{error.kind}_error", NOTHING, str(error))


def _with_reason(outcome: str, touched: str, reason: str) -> Failure:
    return Failure(outcome, touched, without_numbers(reason), reason)


def without_numbers(text: str) -> str:
    """Remove the world-specific parts of a reason: numbers, and the names of single obstacles."""
    masked = re.sub(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", "#", text)
    masked = re.sub(r"the (?:left|lower|right|upper) wall|(?:obstacles|movers|unseen)\[#\]", "#", masked)
    return re.sub(r" at \(#, #\)(?: with radius #)?", "", masked)
