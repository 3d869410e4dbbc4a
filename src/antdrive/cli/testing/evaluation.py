"""Drive a test's scenario, evaluate it, and say what came out: the core of the pytest plugin and of `antdrive check`."""

from __future__ import annotations

import dataclasses
import functools
import math
import os
import shlex
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

from antdrive.base.errors import FieldError, InputError
from antdrive.planners import PlannerError
from antdrive.runs.pool import Pool, WorkerDied
from antdrive.runs.suites.baseline import Baseline
from antdrive.runs.suites.demands import Demands
from antdrive.runs.suites.evaluation import RAISED, Evaluation, evaluate, explain, unmet_demands
from antdrive.runs.suites.scenarios import run_command, scenario_of
from antdrive.runs.suites.suite import ScenarioEntry, SuiteCase, load_suite, shown_path
from antdrive.sim.pipeline import Run
from antdrive.sim.pipeline import run as drive
from antdrive.views.artefacts import MOST_FILMS, Results, remove_artefacts, write_artefacts, write_traceback

#: Which baselines are written: none, only those that are missing, or all.
Update: TypeAlias = Literal["", "new", "all"]
#: The outcomes of a test that could not be judged: what people wrote is wrong, or antdrive is.
INVALID_INPUT, INTERNAL_ERROR = "wrong_input", "internal_error"


@dataclass(frozen=True, kw_only=True)
class CheckResult:
    """What came out of a test.

    Attributes:
        address: the test, as commands name it
        passed: whether nothing is wrong
        case: the test's name in its baseline; empty if it has none
        outcome: how the run ended, such as succeeded
        certified: whether the drive is certified collision-free
        faults: why the test fails, a sentence each
        gains: what is better than in the baseline, a sentence each
        details: what explains the faults, a sentence each
        accepted: what was done to the baseline: written, renewed, unchanged, or nothing
        commands: how to repeat the test
        files: what was written about it, by name
        unfilmed: whether it failed and has no film, because the run has made `MOST_FILMS` already
        metrics: the drive's metrics, as far as it has them; empty if the robot did not drive
        digest: `Rollout.drive_digest`; empty if the robot did not drive
        wall_s: how long the test took [s]
    """

    address: str
    passed: bool
    outcome: str
    certified: bool
    case: str = ""
    faults: tuple[str, ...] = ()
    gains: tuple[str, ...] = ()
    details: tuple[str, ...] = ()
    accepted: str = ""
    commands: tuple[str, ...] = ()
    files: dict[str, str] = field(default_factory=dict)
    unfilmed: bool = False
    metrics: dict[str, float] = field(default_factory=dict)
    digest: str = ""
    wall_s: float = 0.0

    @property
    def message(self) -> str:
        """Everything about a failed test, in lines."""
        lines = [*self.faults, *self.details]
        lines += [f"{'repeat:' if k == 0 else '       '} {command}" for k, command in enumerate(self.commands)]
        lines += [f"{name}: {path}" for name, path in self.files.items()]
        if self.unfilmed:
            lines.append(f"film: none, because this run has made {MOST_FILMS}; {self.commands[0]} makes it")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """The result as plain values, for JSON."""
        return dataclasses.asdict(self)


@dataclass(frozen=True, kw_only=True)
class Check:
    """What a drive is judged by, and where its results go."""

    address: str  # the test, as commands name it
    name: str  # the test's name in its baseline
    demands: Demands  # what the test demands
    baseline: Path | None  # the file of its baseline; None: it has none
    commands: tuple[str, ...]  # how to repeat the test
    accept: str  # the command that accepts the drive
    update: Update = ""  # which baselines to write
    folder: Path | None = None  # where logs, pictures and films of the test are written; None: nowhere
    results: Results | None = None  # which of them are written; None: none

    def evaluate(self, run: Run) -> CheckResult:
        """Judge a run."""
        started, path, accepted = time.perf_counter(), self.baseline, ""
        baseline = None if path is None or self.update == "all" else Baseline.own(path, self.name)
        if path is not None and baseline is None:
            evaluation, accepted = self._without_baseline(run, path)
        else:
            evaluation = evaluate(run, self.demands, baseline)
        details = [] if evaluation.passed else [*explain(run, baseline)]
        files, unfilmed = dict[str, str](), False
        try:
            files, unfilmed = self._written(run, evaluation, baseline)
        except Exception as error:  # a picture of a planner's odd answer may fail in many ways
            if evaluation.passed:
                raise
            said = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
            details.append(f"results: {said}")  # which must not hide the faults
        rollout, wall = run.rollout, run.plan.wall_s
        return CheckResult(
            address=self.address,
            passed=evaluation.passed,
            outcome=run.outcome.key,
            certified=run.certificate is not None and run.certificate.certified,
            case="" if path is None else self.name,
            faults=evaluation.faults,
            gains=evaluation.gains,
            details=tuple(details),
            accepted=accepted,
            commands=self.commands,
            files=files,
            unfilmed=unfilmed,
            metrics={} if rollout is None else {name: x for name, x in run.metrics.items() if not math.isnan(x)},
            digest="" if rollout is None else rollout.drive_digest,
            wall_s=wall + (rollout.record.times.drive_wall_s if rollout else 0.0) + time.perf_counter() - started,
        )

    def failed_early(self, outcome: str, fault: str, error: BaseException) -> CheckResult:
        """The result of a test that an error ended; its results are where the error arose, unless the input was wrong."""
        files: dict[str, str] = {}
        details: tuple[str, ...] = ()
        if self.folder is not None:
            try:
                if outcome == INVALID_INPUT:
                    remove_artefacts(self.folder)
                else:
                    files = write_traceback(self.folder, error, self.commands)
            except (InputError, OSError) as problem:
                details = (f"results: {problem}",)
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
        """Judge a run by its demands alone, and write its baseline if asked to and if it fulfils them; what was written."""
        faults, accepted = list(unmet_demands(run, self.demands)), ""
        if not self.update:
            remedy = "" if faults else f"; accept this drive with {self.accept}"
            faults.append(f"baseline: {shown_path(path)} is missing{remedy}")
        elif faults:
            faults.append("baseline: not accepted, because the drive is not what the test expects")
        else:
            accepted = Baseline.of(run, self.name).renew(path)
        return Evaluation(tuple(faults)), accepted

    def _written(self, run: Run, evaluation: Evaluation, baseline: Baseline | None) -> tuple[dict[str, str], bool]:
        """What was written about a test, by name, and whether it failed and only its film is missing."""
        if self.folder is None or self.results is None:
            return {}, False
        remove_artefacts(self.folder)
        failed, drove, films = not evaluation.passed, run.rollout is not None, self.results.films
        filmed = drove and self.results.should_film(failed=failed)
        if not (failed or films == "always"):
            return {}, False
        files = write_artefacts(
            run, self.folder, baseline, film=filmed, faults=evaluation.faults, commands=self.commands
        )
        return files, drove and films == "failed" and not filmed


def _check_of(case: SuiteCase, update: Update, results: Results | None) -> Check:
    """How a suite's test is judged, with the command that names it alone."""
    # The commands must work in the folder where pytest was started, and in its rootdir, to which its own names of tests relate.
    anywhere = results is not None and results.root.resolve() != Path.cwd().resolve()
    address = f"{case.suite}::{case.id}" if anywhere else case.address
    return Check(
        address=case.address,
        name=case.id,
        demands=case.demands,
        baseline=case.baseline_path if case.entry.baseline else None,
        commands=(shlex.join(["antdrive", "check", address]),),
        accept=shlex.join(["antdrive", "accept", address]),
        update=update,
        folder=results.of(case.suite, case.id) if results else None,
        results=results,
    )


def check_case(case: SuiteCase, *, update: Update = "", results: Results | None = None) -> CheckResult:
    """Drive a suite's test and evaluate it.

    Args:
        case: the test
        update: which baselines to write
        results: where logs, pictures and films are written; None: nowhere

    Raises:
        InputError: the suite, a file that it names, or the baseline is wrong.
    """
    scenario, check = scenario_of(case), _check_of(case, update, results)
    run_alone = run_command(case, anywhere=check.commands != (shlex.join(["antdrive", "check", case.address]),))
    check = dataclasses.replace(check, commands=tuple(filter(None, (*check.commands, run_alone))))
    try:
        return check.evaluate(drive(scenario))
    except PlannerError as error:
        return check.failed_early(RAISED, str(error), error)


def _check_or_fail(case: SuiteCase, update: Update, results: Results | None) -> CheckResult:
    """The result of a test; it fails where it cannot be judged, so that one broken test hides no other."""
    raised: Exception
    try:
        return check_case(case, update=update, results=results)
    except FieldError as error:
        outcome, fault, raised = INVALID_INPUT, str(case.error(error.key, error.problem)), error
    except InputError as error:
        key, mark, problem = str(error).partition(": ")
        of_the_suite = mark and key in ScenarioEntry.model_fields  # found only in the run, such as too small a cell
        outcome, fault, raised = INVALID_INPUT, str(case.error(key, problem)) if of_the_suite else str(error), error
    except Exception as error:  # people's planners and robots are code too
        outcome, fault, raised = INTERNAL_ERROR, f"internal error: {type(error).__name__}: {error}", error
    return _check_of(case, update, results).failed_early(outcome, fault, raised)


def check_cases(
    cases: Sequence[SuiteCase], *, jobs: int = 1, update: Update = "", results: Results | None = None
) -> Iterator[CheckResult]:
    """Drive and evaluate many tests; the results come as they are made, in the order of the tests, and do not depend on `jobs`.

    A test that cannot be judged, because its suite, a file or its baseline is wrong, fails with that as its fault.

    Args:
        cases: the tests
        jobs: number of processes
        update: which baselines to write
        results: where logs, pictures and films are written; None: nowhere
    """
    with tempfile.TemporaryDirectory(prefix="antdrive-films-") as places:
        limited = results and dataclasses.replace(results, places=Path(places))
        yield from _check_in_turn(cases, jobs, update, limited)


def _check_in_turn(
    cases: Sequence[SuiteCase], jobs: int, update: Update, results: Results | None
) -> Iterator[CheckResult]:
    if jobs == 1 or len(cases) == 1:
        for case in cases:
            yield _check_or_fail(case, update, results)
        return
    work = functools.partial(_check_by_name, str(Path.cwd()), update, results)
    with Pool(jobs) as pool:
        made = pool.in_order(work, [(str(case.suite), case.id) for case in cases])
        for case, done in zip(cases, made, strict=True):
            if done.died:
                fault = f"internal error: {done.died}"
                yield _check_of(case, update, results).failed_early(INTERNAL_ERROR, fault, WorkerDied(done.died))
            elif isinstance(done.value, str):  # the suite has changed since it was read
                yield _check_of(case, update, results).failed_early(INVALID_INPUT, done.value, InputError(done.value))
            else:
                yield done.value


def _check_by_name(folder: str, update: Update, results: Results | None, name: tuple[str, str]) -> CheckResult | str:
    """The result of a test that another process names; a text says why there is no such test any more."""
    os.chdir(folder)
    suite, test = name
    try:
        found = next((case for case in load_suite(suite) if case.id == test), None)
    except InputError as error:
        return str(error)
    if found is None:
        return f"{suite}: has no test {test} any more"
    return _check_or_fail(found, update, results)
