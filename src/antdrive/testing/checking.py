"""Tests of drives from words: suites, folders, Python files and single tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from antdrive.base.errors import FieldError, InputError
from antdrive.base.version import require_physics
from antdrive.runs.pool import cores
from antdrive.runs.suites import scenario_of, select
from antdrive.runs.suites.suite import SUFFIX
from antdrive.sim.scenario import Scenario
from antdrive.testing.evaluation import CheckResult, Update, evaluate_cases
from antdrive.testing.python_tests import drive_python_tests, is_module
from antdrive.testing.unused import unused_beside
from antdrive.views.artefacts import Results


def evaluate_tests(
    words: Sequence[str],
    *,
    only: str | None,
    jobs: int | None,
    update: Update,
    results: Results,
    choose: Callable[[Scenario], Scenario],
    report: Callable[[CheckResult], None],
    progress: Callable[[float], None],
) -> tuple[list[CheckResult], list[str]]:
    """Drive and evaluate tests; return the results and the unused baselines.

    Args:
        words: suites, Python files, folders, SUITE::SCENARIO and FILE.py::TEST
        only: a pattern with * and ? for the tests' names
        jobs: number of processes; None: one per core
        update: baselines to write
        results: destination of logs, pages and figures
        choose: chooses the margin `auto`, before processes start
        report: called with each result
        progress: called with the completed fraction of the suites' tests

    Raises:
        InputError: there is no such test, or a suite is invalid.
    """
    if any(map(is_module, words)):
        require_physics()
    modules = [word for word in words if is_module(word) or Path(word).is_dir()]
    outcomes, unused = drive_python_tests(modules, only, update, results)
    for result in outcomes:
        report(result)
    suites = [word for word in words if not is_module(word)]
    if outcomes:
        suites = [word for word in suites if not Path(word).is_dir() or any(Path(word).rglob(f"*{SUFFIX}"))]
    if not suites:
        return outcomes, unused
    cases = select(suites, only)
    drives = [case for case in cases if case.entry.log is None]
    if drives:
        require_physics()  # before any work
    for case in drives:
        if case.written.settings.get("margin") == "auto":
            with suppress(InputError, FieldError):  # reported as the test's failure
                scenario_of(case, choose)
    processes = min(jobs or cores(), len(cases))
    for done, result in enumerate(evaluate_cases(cases, jobs=processes, update=update, results=results), 1):
        outcomes.append(result)
        report(result)
        progress(done / len(cases))
    return outcomes, [*unused, *unused_beside(suites)]
