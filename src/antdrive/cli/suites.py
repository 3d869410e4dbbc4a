"""What `antdrive check` and `antdrive accept` share: their arguments, the progress bar, and how results are printed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args

import typer

from antdrive.base.errors import FieldError, InputError
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, print_json, print_line
from antdrive.cli.exits import FAILED, FAULT, SUCCEEDED, WRONG_INPUT

if TYPE_CHECKING:
    from antdrive.cli.testing.checking import CheckResult, Update
    from antdrive.views.artefacts import Films, Results

Suites = Annotated[
    list[str],
    typer.Argument(
        metavar="SUITE", help="Suites (*.drive.yaml), folders with suites, SUITE::scenario or SUITE::scenario[seed]."
    ),
]
Only = Annotated[
    str | None, typer.Option(metavar="PATTERN", help="Only scenarios whose name matches, such as 'aisle-*'.")
]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", "-j", min=1, max=256, metavar="NUMBER", help="Processes.  [default: one per core]"),
]


ResultsFolder = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER", help="Folder for logs, pictures and films of tests.  [default: in the user's cache]"
    ),
]
Film = Annotated[str, typer.Option(metavar="WHEN", help="Of which tests a film is made: never, failed or always.")]


def results_in(folder: Path | None, film: str) -> Results:
    """Where results are written, checked before any work.

    Raises:
        InputError: the folder cannot be written to, or an unknown word for `--film`.
    """
    from antdrive.cli.write import check_folder
    from antdrive.views.artefacts import Films, Results, default_folder

    if film not in get_args(Films):
        raise InputError(f"--film {film}: unknown; choose from {', '.join(get_args(Films))}")
    if folder is not None:
        check_folder(folder)
    return Results(folder or default_folder(Path.cwd()), cast("Films", film))


def drive_suites(
    suites: list[str],
    only: str | None,
    jobs: int | None,
    *,
    update: Update,
    results: Results,
    show: Callable[[CheckResult], None] = lambda result: None,
) -> list[CheckResult]:
    """Drive and judge all tests that the words name, with a progress bar.

    Raises:
        InputError: there is no such suite or test, or something in a suite is wrong.
    """
    import joblib

    from antdrive.cli.calibrating import with_chosen_margin
    from antdrive.cli.testing import check_cases
    from antdrive.runs.suites import scenario_of, select

    cases = select(suites, only)
    compile_once()
    for case in cases:
        if case.entry.margin == "auto":  # chosen once and with a bar, not by each process
            with suppress(InputError, FieldError):  # is told as the fault of the test
                scenario_of(case, with_chosen_margin)
    processes = min(jobs or int(joblib.cpu_count()), len(cases))  # of a container, not of its host
    found = []
    with bar("driving") as progress:
        for result in check_cases(cases, jobs=processes, update=update, results=results):
            found.append(result)
            show(result)
            progress(len(found) / len(cases))
    return found


def print_result(result: CheckResult, words: str) -> None:
    """Print what came out of one test."""
    if result.passed:
        print_line(f"{result.address}: {result.accepted or words}")
        _print_lines(result.gains)
    else:
        print_line(f"{result.address}: FAILED")
        _print_lines(result.message.splitlines())


def unused_baselines(suites: list[str]) -> list[str]:
    """The baselines beside the suites that words name which belong to no test."""
    from antdrive.cli.testing.unused import unused_of_suite
    from antdrive.runs.suites import load_suite, select
    from antdrive.runs.suites.suite import shown_path

    files = dict.fromkeys(case.suite for case in select(suites))
    return sorted({shown_path(path) for suite in files for path in unused_of_suite(suite, load_suite(suite))})


def print_summary(results: list[CheckResult], json: bool, unused: Sequence[str] = (), *, strict: bool = False) -> int:
    """Print how many tests passed, and unused baselines; the exit code, which is that of the worst test."""
    from antdrive.cli.testing.checking import FAULT as INTERNAL
    from antdrive.cli.testing.checking import WRONG_INPUT as WRONG
    from antdrive.cli.testing.summary import films_left_out

    failed = [result for result in results if not result.passed]
    worst = {WRONG: WRONG_INPUT, INTERNAL: FAULT}
    code = max((worst.get(result.outcome, FAILED) for result in failed), default=SUCCEEDED)
    if strict and unused:
        code = max(code, FAILED)
    if json:
        facts: dict[str, Any] = {"passed": code == SUCCEEDED, "tests": [result.as_dict() for result in results]}
        print_json({**facts, "unused": list(unused)})
        return code
    better = sum(bool(result.gains) and result.passed for result in results)
    summary = [f"{len(results) - len(failed)} of {len(results)} passed"]
    if better:
        summary.append(f"{better} better than the baseline; antdrive accept renews it")
    for path in unused:
        print_line(f"{'FAILED: ' if strict else ''}unused baseline: {path}; remove it")
    print_line("; ".join(summary))
    unfilmed = sum(result.unfilmed for result in results)
    if unfilmed:
        print_line(films_left_out(unfilmed, "--film always"))
    return code


def _print_lines(lines: Any) -> None:
    for line in lines:
        print_line(f"  {line}")
