"""`antdrive check` and `antdrive accept`."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast, get_args

from antdrive.base.errors import FieldError, InputError
from antdrive.cli import options
from antdrive.cli.console import bar, marked, print_error, print_line, show
from antdrive.cli.exits import FAILED, INTERNAL_ERROR, INVALID_INPUT, SUCCEEDED
from antdrive.cli.options import argument, flag, option
from antdrive.cli.scenario_options import with_chosen_margin

if TYPE_CHECKING:
    from antdrive.testing.evaluation import CheckResult, Update
    from antdrive.views.artefacts import Films, Results

Suites = Annotated[
    list[str], argument("SUITE", "Suite (*.drive.yaml), test_*.py, folder, SUITE::scenario[seed] or FILE.py::test.")
]
Only = Annotated[str | None, option("PATTERN", "Run only matching scenarios, such as 'aisle-*'.")]
ResultsFolder = Annotated[Path | None, option("FOLDER", "Folder for logs, figures, films.  [default: user cache]")]
Film = Annotated[str, option("WHEN", "Film tests: never, failed or always.")]


def check(
    tests: Suites,
    only: Only = None,
    jobs: options.Jobs = None,
    results: ResultsFolder = None,
    film: Film = "failed",
    junit: Annotated[Path | None, option("FILE", "Write the results as JUnit XML for CI services.")] = None,
    strict: Annotated[bool, flag("Fail on unused baselines.", "--strict")] = False,
    json: options.Json = False,
) -> int:
    """Run suites or Python tests, and compare the drives with their baselines.

    Exit code 0: every drive meets its suite's expectations and is no worse than its baseline.
    """
    from antdrive.testing.session_summary import add_to_page, drives_in, properties, save_junit

    outcomes, unused = drive_tests(tests, only, jobs, "", results, film, json=json)
    if junit is not None:
        save_junit(outcomes, junit)
    add_to_page((drive for result in outcomes for drive in drives_in(properties(result))), unused, print_error)
    return _summarise(outcomes, json, unused, strict=strict)


def accept(
    tests: Suites,
    only: Only = None,
    new: Annotated[bool, flag("Write only missing baselines.", "--new")] = False,
    jobs: options.Jobs = None,
    results: ResultsFolder = None,
    film: Film = "failed",
    json: options.Json = False,
) -> int:
    """Run suites or Python tests, and save the drives as baselines.

    A drive that misses its test's expectations is rejected, with log, figures and film. Exit code 0: every drive was accepted.
    """
    outcomes, unused = drive_tests(tests, only, jobs, "new" if new else "all", results, film, json=json)
    return _summarise(outcomes, json, unused)


def drive_tests(
    words: list[str],
    only: str | None,
    jobs: int | None,
    update: "Update",
    folder: Path | None,
    film: str,
    *,
    json: bool,
) -> "tuple[list[CheckResult], list[str]]":
    """Drive and evaluate all named tests, and print each result; return the results and the unused baselines."""
    from antdrive.runs.suites.suite import SUFFIX
    from antdrive.testing.python_tests import drive_python_tests, is_module
    from antdrive.testing.unused import unused_beside
    from antdrive.views.artefacts import Films, Results, default_folder
    from antdrive.views.run_folder import check_folder

    if film not in get_args(Films):
        raise InputError(f"--film {film}: unknown; choose from {', '.join(get_args(Films))}")
    if folder is not None:
        check_folder(folder)
    results = Results(folder or default_folder(Path.cwd()), cast("Films", film))
    outcomes, unused = drive_python_tests([w for w in words if is_module(w) or Path(w).is_dir()], only, update, results)
    for result in () if json else outcomes:
        _print(result, set())
    suites = [word for word in words if not is_module(word)]
    if outcomes:
        suites = [word for word in suites if not Path(word).is_dir() or any(Path(word).rglob(f"*{SUFFIX}"))]
    if suites:
        outcomes += drive_suites(suites, only, jobs, update, results, json=json)
        unused += unused_beside(suites)
    return outcomes, unused


def drive_suites(
    suites: list[str], only: str | None, jobs: int | None, update: "Update", results: "Results", *, json: bool
) -> "list[CheckResult]":
    """Drive and evaluate the tests of suites with a progress bar, and print each result."""
    from antdrive.runs.pool import cores
    from antdrive.runs.suites import scenario_of, select
    from antdrive.testing import check_cases

    cases = select(suites, only)
    for case in cases:
        if case.written.settings.get("margin") == "auto":  # calibrate once, with a bar, before processes start
            with suppress(InputError, FieldError):  # reported as the test's failure
                scenario_of(case, with_chosen_margin)
    processes = min(jobs or cores(), len(cases))
    outcomes, noted = [], set[str]()
    with bar("driving") as progress:
        for result in check_cases(cases, jobs=processes, update=update, results=results):
            outcomes.append(result)
            if not json:
                _print(result, noted)
            progress(len(outcomes) / len(cases))
    return outcomes


def _print(result: "CheckResult", noted: set[str]) -> None:
    """Print the result of one test, without notes that were `noted` beside a test before."""
    words = (result.accepted or "passed") if result.passed else "FAILED"
    print_line(marked(result.passed, f"{result.address}: {words}"))
    notes = [note for note in result.notes if note not in noted]
    noted.update(notes)
    for line in (*result.gains, *notes) if result.passed else result.message.splitlines():
        print_line(f"  {line}")


def _summarise(results: "list[CheckResult]", json: bool, unused: Sequence[str], *, strict: bool = False) -> int:
    """Print the number of passed tests and the unused baselines. Return the exit code of the worst test."""
    from antdrive.testing.evaluation import INTERNAL_ERROR as INTERNAL
    from antdrive.testing.evaluation import INVALID_INPUT as WRONG
    from antdrive.testing.session_summary import films_omitted, unused_lines

    failed = [result for result in results if not result.passed]
    worst = {WRONG: INVALID_INPUT, INTERNAL: INTERNAL_ERROR}
    code = max((worst.get(result.outcome, FAILED) for result in failed), default=SUCCEEDED)
    if strict and unused:
        code = max(code, FAILED)
    better = sum(bool(result.gains) and result.passed for result in results)
    gained = f"; {better} better than the baseline: renew it with antdrive accept" if better else ""
    unfilmed = sum(result.unfilmed for result in results)
    lines = [*unused_lines(unused, strict), f"{len(results) - len(failed)} of {len(results)} passed{gained}"]
    lines += [films_omitted(unfilmed, "--film always")] if unfilmed else []
    tests = [result.as_dict() for result in results]
    show(json, {"passed": code == SUCCEEDED, "tests": tests, "unused": list(unused)}, lines)
    return code
