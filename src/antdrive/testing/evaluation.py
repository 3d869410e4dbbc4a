"""Evaluation of drives against tests and baselines, for the pytest plugin and `antdrive check`."""

from __future__ import annotations

import dataclasses
import functools
import math
import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

from antdrive.base.components import ComponentError
from antdrive.base.errors import FieldError, InputError
from antdrive.runs.pool import Pool, WorkerDied, in_new_process
from antdrive.runs.suites.baseline import Baseline, fixed_hashes
from antdrive.runs.suites.demands import Demands
from antdrive.runs.suites.evaluation import Evaluation, changes, evaluate, explain, unmet_demands
from antdrive.runs.suites.scenarios import run_command, scenario_of
from antdrive.runs.suites.suite import LogCase, SuiteCase, shown_path
from antdrive.sim.pipeline import Run
from antdrive.sim.pipeline import run as drive
from antdrive.sim.rerun import UNSTEADY, fingerprint, fingerprint_of, is_unsteady
from antdrive.sim.scenario import Scenario
from antdrive.views.artefacts import Results, remove_artefacts, write_artefacts, write_traceback

#: Baselines to write: none, only missing ones, or all.
Update: TypeAlias = Literal["", "new", "all"]
#: Outcomes of a test that could not be evaluated: invalid input or internal error.
INVALID_INPUT, INTERNAL_ERROR = "wrong_input", "internal_error"
_REPEATED: dict[
    tuple[type, type], bool
] = {}  # whether a new process repeats runs, by classes of planner and controller


@dataclass(frozen=True, kw_only=True)
class CheckResult:
    """Result of a test.

    Attributes:
        address: the test's name in commands
        passed: whether the test passed
        case: the test's name in its baseline; empty without a baseline
        outcome: the run's outcome, such as succeeded
        certified: whether the drive is certified collision-free
        faults: reasons for failing, one sentence each
        gains: improvements over the baseline, one sentence each
        notes: what could not be compared, one sentence each
        details: explanations of the faults, one sentence each
        accepted: change to the baseline: written, renewed, unchanged, or empty
        commands: commands that repeat the test
        files: written files by name
        metrics: the drive's finite metrics; empty if the robot did not drive
        digest: `Rollout.drive_digest`; empty if the robot did not drive
        wall_s: duration of the test [s]
    """

    address: str
    passed: bool
    outcome: str
    certified: bool
    case: str = ""
    faults: tuple[str, ...] = ()
    gains: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    details: tuple[str, ...] = ()
    accepted: str = ""
    commands: tuple[str, ...] = ()
    files: dict[str, str] = field(default_factory=dict)
    metrics: dict[str, float] = field(default_factory=dict)
    digest: str = ""
    wall_s: float = 0.0

    @property
    def message(self) -> str:
        """Faults, details, commands and files of a failed test, one per line."""
        lines = [*self.faults, *self.notes, *self.details]
        lines += [f"{'repeat:' if k == 0 else '       '} {command}" for k, command in enumerate(self.commands)]
        lines += [f"{name}: {path}" for name, path in self.files.items()]
        return "\n".join(lines)

    def lines(self, noted: set[str]) -> list[str]:
        """Return the result as lines, the second and later ones details.

        Args:
            noted: notes of earlier tests, which are left out; those of this test are added
        """
        notes = [note for note in self.notes if note not in noted]
        noted.update(notes)
        details = [*self.gains, *notes] if self.passed else self.message.splitlines()
        return [f"{self.address}: {(self.accepted or 'passed') if self.passed else 'FAILED'}", *details]

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain values for JSON."""
        return dataclasses.asdict(self)


@dataclass(frozen=True, kw_only=True)
class Criteria:
    """Criteria for a drive, and the destination of its results."""

    address: str  # the test's name in commands
    name: str  # the test's name in its baseline
    demands: Demands
    baseline: Path | None  # file of the baseline; None: compare with none
    commands: tuple[str, ...]  # commands that repeat the test
    accept: str  # command that accepts the drive
    update: Update = ""  # baselines to write
    folder: Path | None = None  # for the test's log, page and figure; None: write nothing
    results: Results | None = None  # selection of what to write; None: nothing
    again: Callable[[], str] | None = None  # returns `fingerprint` of the test's scenario in any process

    def evaluate(self, run: Run) -> CheckResult:
        """Evaluate a run."""
        started, path, accepted = time.perf_counter(), self.baseline, ""
        baseline = None if path is None or self.update == "all" else Baseline.own(path, self.name)
        if path is not None and baseline is None:
            evaluation, accepted = self._without_baseline(run, path)
        else:
            evaluation = evaluate(run, self.demands, baseline)
        if accepted in ("written", "renewed") and self._is_unsteady(run):
            evaluation = dataclasses.replace(evaluation, notes=(*evaluation.notes, UNSTEADY))
        details = [] if evaluation.passed else [*explain(run, baseline, self._elsewhere)]
        files = dict[str, str]()
        try:
            files = self._written(run, evaluation, baseline)
        except Exception as error:  # drawing an invalid plan can raise any exception
            if evaluation.passed:
                raise
            message = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
            details.append(f"results: {message}")  # must not hide the faults
        rollout, wall = run.rollout, run.plan.wall_s
        return CheckResult(
            address=self.address,
            passed=evaluation.passed,
            outcome=run.outcome.key,
            certified=run.certified,
            case="" if path is None else self.name,
            faults=evaluation.faults,
            gains=evaluation.gains,
            notes=evaluation.notes,
            details=tuple(details),
            accepted=accepted,
            commands=self.commands,
            files=files,
            metrics={} if rollout is None else {name: x for name, x in run.metrics.items() if not math.isnan(x)},
            digest="" if rollout is None else rollout.drive_digest,
            wall_s=wall + (rollout.record.times.drive_wall_s if rollout else 0.0) + time.perf_counter() - started,
        )

    def _elsewhere(self) -> str | None:
        """Return the scenario's fingerprint of a new process; None if that is unknown."""
        return None if self.again is None else in_new_process(self.again)

    def _is_unsteady(self, run: Run) -> bool:
        """Return whether the planner or the controller of an accepted drive does not repeat its run."""
        s, first = run.scenario, fingerprint_of(run.scenario, run.plan, run.rollout)
        kind = type(s.planner), type(s.controller)

        def elsewhere() -> str:
            if kind not in _REPEATED:  # a new process takes seconds: one for each
                _REPEATED[kind] = self._elsewhere() in (None, first)
            return first if _REPEATED[kind] else ""

        return is_unsteady(s, first, elsewhere)

    def raised(self, s: Scenario, error: ComponentError) -> CheckResult:
        """Return the result of a test whose planner or controller raised an error, with what has changed since the baseline."""
        details: tuple[str, ...] = ()
        with suppress(InputError):
            if self.baseline is not None and (earlier := Baseline.own(self.baseline, self.name)) is not None:
                details = tuple(changes(s, fixed_hashes(s), earlier))
        return self.failed_early(f"{error.kind}_error", str(error), error, details)

    def failed_early(
        self, outcome: str, fault: str, error: BaseException, details: tuple[str, ...] = ()
    ) -> CheckResult:
        """Return the result of a test ended by an error, with a traceback file unless the input was invalid."""
        files: dict[str, str] = {}
        if self.folder is not None:
            try:
                if outcome == INVALID_INPUT:
                    remove_artefacts(self.folder)
                else:
                    files = write_traceback(self.folder, error, self.commands)
            except (InputError, OSError) as problem:
                details = (*details, f"results: {problem}")
        return CheckResult(
            address=self.address,
            passed=False,
            outcome=outcome,
            certified=False,
            faults=(fault,),
            details=details,
            commands=self.commands,
            files=files,
        )

    def _without_baseline(self, run: Run, path: Path) -> tuple[Evaluation, str]:
        """Evaluate a run without a baseline. Write one if requested and the demands are met; return what was written."""
        faults, accepted = list(unmet_demands(run, self.demands)), ""
        if not self.update:
            remedy = "" if faults else f"; accept this drive with {self.accept}"
            faults.append(f"baseline: {shown_path(path)} is missing{remedy}")
        elif faults:
            faults.append("baseline: not accepted, because the drive misses the test's expectations")
        else:
            accepted = Baseline.of(run, self.name).renew(path)
        return Evaluation(tuple(faults)), accepted

    def _written(self, run: Run, evaluation: Evaluation, baseline: Baseline | None) -> dict[str, str]:
        """Write a test's files and return them by name."""
        if self.folder is None or self.results is None:
            return {}
        remove_artefacts(self.folder)
        if evaluation.passed and not self.results.keep:
            return {}
        return write_artefacts(run, self.folder, baseline, faults=evaluation.faults, commands=self.commands)


def _criteria_of(case: SuiteCase, update: Update, results: Results | None) -> Criteria:
    """Return the criteria of a suite's test, with the command that runs only this test."""
    # Commands must work in the working directory; pytest's test names are relative to its rootdir.
    anywhere = results is not None and results.root.resolve() != Path.cwd().resolve()
    address = f"{case.suite}::{case.id}" if anywhere else case.address
    return Criteria(
        address=case.address,
        name=case.id,
        demands=case.demands,
        baseline=case.baseline_path if case.entry.baseline else None,
        commands=(shlex.join(["antdrive", "check", address]),),
        accept=shlex.join(["antdrive", "accept", address]),
        update=update,
        folder=results.of(case.suite, case.id) if results else None,
        results=results,
        again=functools.partial(_fingerprint_of, case),
    )


def evaluate_case(case: SuiteCase, *, update: Update = "", results: Results | None = None) -> CheckResult:
    """Drive a suite's test, or read its log, and evaluate it.

    Args:
        case: the test
        update: baselines to write
        results: destination of logs, pages and figures; None: write nothing

    Raises:
        InputError: the suite, a file that it names, or the baseline is wrong.
    """
    if isinstance(case, LogCase):
        return _criteria_of(case, update, results).evaluate(case.run())
    scenario, criteria = scenario_of(case), _criteria_of(case, update, results)
    run_alone = run_command(case, anywhere=criteria.commands != (shlex.join(["antdrive", "check", case.address]),))
    criteria = dataclasses.replace(criteria, commands=tuple(filter(None, (*criteria.commands, run_alone))))
    try:
        return criteria.evaluate(drive(scenario))
    except ComponentError as error:
        return criteria.raised(scenario, error)


def _evaluate_or_fail(case: SuiteCase, update: Update, results: Results | None) -> CheckResult:
    """Return the result of a test; errors of its drive become failures, so that they do not stop the others."""
    raised: Exception
    try:
        return evaluate_case(case, update=update, results=results)
    except FieldError as error:
        outcome, fault, raised = INVALID_INPUT, str(case.error(error.key, error.problem)), error
    except InputError as error:
        fault = str(case.error(error.key, error.problem) if error.key else error)  # such as a cell that is too small
        outcome, raised = INVALID_INPUT, error
    except Exception as error:  # user planners may raise anything
        outcome, fault, raised = INTERNAL_ERROR, f"internal error: {type(error).__name__}: {error}", error
    return _criteria_of(case, update, results).failed_early(outcome, fault, raised)


def evaluate_cases(
    cases: Sequence[SuiteCase], *, jobs: int = 1, update: Update = "", results: Results | None = None
) -> Iterator[CheckResult]:
    """Drive and evaluate many tests. Yield the results in the order of the tests; they do not depend on `jobs`.

    A test with an invalid suite, file or baseline fails with that error as its fault.

    Args:
        cases: the tests
        jobs: number of processes
        update: baselines to write
        results: destination of logs, pages and figures; None: write nothing
    """
    if jobs == 1 or len(cases) == 1:
        for case in cases:
            yield _evaluate_or_fail(case, update, results)
        return
    work = functools.partial(_evaluate_or_fail, update=update, results=results)
    with Pool(jobs) as pool:
        for case, done in zip(cases, pool.in_order(work, cases), strict=True):
            if done.fault:
                outcome = f"{done.died.partition(' ')[0]}_error"
                yield _criteria_of(case, update, results).failed_early(outcome, done.died, WorkerDied(done.died))
            elif done.died:
                fault = f"internal error: {done.died}"
                yield _criteria_of(case, update, results).failed_early(INTERNAL_ERROR, fault, WorkerDied(done.died))
            else:
                yield done.value


def _fingerprint_of(case: SuiteCase) -> str:
    """Return the fingerprint of a test's scenario."""
    return fingerprint(scenario_of(case))
