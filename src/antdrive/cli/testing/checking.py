"""Drive a test's scenario, judge it, and say what came out: the core of the pytest plugin and of `antdrive check`."""

from __future__ import annotations

import dataclasses
import math
import os
import shlex
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.processes import delayed
from antdrive.planners import PlannerError
from antdrive.runs.suites.baseline import Baseline
from antdrive.runs.suites.demands import Demands
from antdrive.runs.suites.explaining import explain
from antdrive.runs.suites.judging import Judgement, judge, unfulfilled
from antdrive.runs.suites.scenarios import run_command, scenario_of
from antdrive.runs.suites.suite import ScenarioEntry, SuiteCase, load_suite, shown_path
from antdrive.sim.pipeline import Run
from antdrive.sim.pipeline import run as drive
from antdrive.views.artefacts import (
    MOST_FILMS,
    Results,
    remove_artefacts,
    write_artefacts,
    write_traceback,
)

#: Which baselines are written: none, only those that are missing, or all.
Update: TypeAlias = Literal["", "new", "all"]
#: The outcome of a test whose planner raised an error.
RAISED = "planner_error"
#: The outcomes of a test that could not be judged: what people wrote is wrong, or antdrive is.
WRONG_INPUT, FAULT = "wrong_input", "internal_error"


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


def check_case(case: SuiteCase, *, update: Update = "", results: Results | None = None) -> CheckResult:
    """Drive a suite's test and judge it.

    Args:
        case: the test
        update: which baselines to write
        results: where logs, pictures and films are written; None: nowhere

    Raises:
        InputError: the suite, a file that it names, or the baseline is wrong.
    """
    scenario = scenario_of(case)
    # The commands must work in the folder where pytest was started, and in its rootdir, to which its own names of tests relate.
    anywhere = results is not None and results.root.resolve() != Path.cwd().resolve()
    address = f"{case.suite}::{case.id}" if anywhere else case.address
    run_alone = run_command(case, anywhere=anywhere)
    commands = tuple(filter(None, (shlex.join(["antdrive", "check", address]), run_alone)))
    try:
        run = drive(scenario)
    except PlannerError as error:
        return _unjudged(case, RAISED, str(error), error, results, commands)
    path = case.baseline_path if case.entry.baseline else None
    folder = results.of(case.suite, case.id) if results else None
    return check_run(
        run,
        case.demands,
        path,
        address=case.address,
        name=case.id,
        update=update,
        commands=commands,
        accept=shlex.join(["antdrive", "accept", address]),
        folder=folder,
        results=results,
    )


def _unjudged(
    case: SuiteCase,
    outcome: str,
    fault: str,
    error: BaseException,
    results: Results | None,
    commands: tuple[str, ...] = (),
) -> CheckResult:
    """The result of a test that an error ended; its results are where the error arose, unless the input was wrong."""
    files: dict[str, str] = {}
    details: tuple[str, ...] = ()
    commands = commands or (shlex.join(["antdrive", "check", case.address]),)
    if results is not None:
        try:
            folder = results.of(case.suite, case.id)
            if outcome == WRONG_INPUT:
                remove_artefacts(folder)
            else:
                files = write_traceback(folder, error, commands)
        except (InputError, OSError) as problem:
            details = (f"results: {problem}",)
    return CheckResult(
        address=case.address,
        passed=False,
        outcome=outcome,
        certified=False,
        faults=(fault,),
        details=details,
        commands=commands,
        files=files,
    )


def _check_whatever_comes(case: SuiteCase, update: Update, results: Results | None) -> CheckResult:
    """The result of a test; it fails where it cannot be judged, so that one broken test hides no other."""
    try:
        return check_case(case, update=update, results=results)
    except FieldError as error:
        problem = str(case.error(error.key, error.problem))
        return _unjudged(case, WRONG_INPUT, problem, error, results)
    except InputError as error:
        key, mark, problem = str(error).partition(": ")
        of_the_suite = mark and key in ScenarioEntry.model_fields  # found only in the run, such as too small a cell
        said = str(case.error(key, problem)) if of_the_suite else str(error)
        return _unjudged(case, WRONG_INPUT, said, error, results)
    except Exception as error:  # people's planners and robots are code too
        return _unjudged(case, FAULT, f"internal error: {type(error).__name__}: {error}", error, results)


def check_cases(
    cases: Sequence[SuiteCase], *, jobs: int = 1, update: Update = "", results: Results | None = None
) -> Iterator[CheckResult]:
    """Drive and judge many tests; the results come as they are made, in the order of the tests, and do not depend on `jobs`.

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
            yield _check_whatever_comes(case, update, results)
        return
    import joblib

    calls = (delayed(_check_by_name)(str(case.suite), case.id, str(Path.cwd()), update, results) for case in cases)
    made = joblib.Parallel(n_jobs=jobs, return_as="generator")(calls)
    for case, result in zip(cases, made, strict=True):
        # The suite has changed since it was read.
        yield _unjudged(case, WRONG_INPUT, result, InputError(result), results) if isinstance(result, str) else result


def _check_by_name(suite: str, name: str, folder: str, update: Update, results: Results | None) -> CheckResult | str:
    """The result of a test that another process names; a text says why there is no such test any more."""
    os.chdir(folder)
    try:
        found = next((case for case in load_suite(suite) if case.id == name), None)
    except InputError as error:
        return str(error)
    if found is None:
        return f"{suite}: has no test {name} any more"
    return _check_whatever_comes(found, update, results)


def check_run(
    run: Run,
    demands: Demands,
    path: Path | None,
    *,
    address: str,
    name: str,
    update: Update = "",
    commands: tuple[str, ...] = (),
    accept: str = "",
    folder: Path | None = None,
    results: Results | None = None,
) -> CheckResult:
    """Judge a run.

    Raises:
        InputError: the baseline is wrong, or it or the folder cannot be written.
    """
    started = time.perf_counter()
    baseline = None if path is None or update == "all" else own_baseline(path, name)
    accepted = ""
    if path is not None and baseline is None:
        accept = accept or shlex.join(["antdrive", "accept", address])
        judgement, accepted = _without_baseline(run, demands, path, name, accept, update)
    else:
        judgement = judge(run, demands, baseline)
    details = () if judgement.passed else tuple(explain(run, dataclasses.replace(judgement, faults=()), baseline))
    files, unfilmed, problem = _written_or_why(run, judgement, baseline, folder, results, commands)
    details = (*details, *filter(None, [problem]))
    return CheckResult(
        address=address,
        passed=judgement.passed,
        outcome=run.outcome.key,
        certified=run.certificate is not None and run.certificate.certified,
        case="" if path is None else name,
        faults=judgement.faults,
        gains=judgement.gains,
        details=details,
        accepted=accepted,
        commands=commands,
        files=files,
        unfilmed=unfilmed,
        metrics={name: x for name, x in run.metrics.items() if not math.isnan(x)} if run.rollout is not None else {},
        digest=run.rollout.drive_digest if run.rollout is not None else "",
        wall_s=_wall(run) + time.perf_counter() - started,
    )


def _written_or_why(
    run: Run,
    judgement: Judgement,
    baseline: Baseline | None,
    folder: Path | None,
    results: Results | None,
    commands: Sequence[str],
) -> tuple[dict[str, str], bool, str]:
    """What `_written` says, and why nothing could be written about a failed test, which must not hide its faults."""
    try:
        return *_written(run, judgement, baseline, folder, results, commands), ""
    except Exception as error:  # a picture of a planner's odd answer may fail in many ways
        if judgement.passed:
            raise
        said = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        return {}, False, f"results: {said}"


def _written(
    run: Run,
    judgement: Judgement,
    baseline: Baseline | None,
    folder: Path | None,
    results: Results | None,
    commands: Sequence[str],
) -> tuple[dict[str, str], bool]:
    """What was written about a test, by name, and whether it failed and only its film is missing."""
    if folder is None or results is None:
        return {}, False
    remove_artefacts(folder)
    failed, drove = not judgement.passed, run.rollout is not None
    filmed = drove and results.takes_film(failed=failed)
    if not (failed or results.films == "always"):
        return {}, False
    files = write_artefacts(run, folder, baseline, film=filmed, faults=judgement.faults, commands=commands)
    return files, drove and results.films == "failed" and not filmed


def own_baseline(path: Path, name: str) -> Baseline | None:
    """The baseline in a file, which must be that of the test; None if there is no such file.

    Raises:
        InputError: the file is no baseline, or that of another test.
    """
    baseline = Baseline.load(path)
    if baseline is not None and baseline.case != name:
        problem = f"belongs to {baseline.case}, not to {name}; remove the file, and accept {name} anew"
        raise input_error(shown_path(path), "case", problem)
    return baseline


def _without_baseline(
    run: Run, demands: Demands, path: Path, name: str, accept: str, update: Update
) -> tuple[Judgement, str]:
    """Judge a run by its demands alone, and write its baseline if asked to and if it fulfils them; what was written."""
    faults, accepted = list(unfulfilled(run, demands)), ""
    if not update:
        remedy = "" if faults else f"; accept this drive with {accept}"
        faults.append(f"baseline: {shown_path(path)} is missing{remedy}")
    elif faults:
        faults.append("baseline: not accepted, because the drive is not what the test expects")
    else:
        accepted = write_baseline(Baseline.of(run, name), path)
    return Judgement(tuple(faults)), accepted


def write_baseline(baseline: Baseline, path: Path) -> str:
    """Write a baseline unless the file holds the same drive already; what was done.

    Raises:
        InputError: the file cannot be written.
    """
    if path.exists() and path.read_bytes() == baseline.to_text().encode():
        return "unchanged"
    existed = path.exists()
    baseline.save(path)
    return "renewed" if existed else "written"


def _wall(run: Run) -> float:
    """How long planning and driving took [s]."""
    return run.rollout.record.times.drive_wall_s + run.plan.wall_s if run.rollout else run.plan.wall_s
