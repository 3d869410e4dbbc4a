"""`antdrive check` and `antdrive accept`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from antdrive.base.progress import bar
from antdrive.base.tables import marked
from antdrive.cli import options
from antdrive.cli.console import print_error, print_line, show
from antdrive.cli.exits import FAILED, INTERNAL_ERROR, INVALID_INPUT, SUCCEEDED
from antdrive.cli.options import argument, flag, option
from antdrive.cli.scenario_options import with_calibrated_margin

if TYPE_CHECKING:
    from antdrive.testing.evaluation import CheckResult, Update

Suites = Annotated[
    list[str], argument("SUITE", "Suite (*.drive.yaml), test_*.py, folder, SUITE::scenario[seed] or FILE.py::test.")
]
Only = Annotated[str | None, option("PATTERN", "Run only matching scenarios, such as 'aisle-*'.")]
ResultsFolder = Annotated[Path | None, option("FOLDER", "Folder for logs, pages, figures.  [default: user cache]")]
Keep = Annotated[bool, flag("Write results of passed tests, too.", "--keep")]


def check(
    tests: Suites,
    only: Only = None,
    jobs: options.Jobs = None,
    results: ResultsFolder = None,
    keep: Keep = False,
    junit: Annotated[Path | None, option("FILE", "Write the results as JUnit XML for CI services.")] = None,
    strict: Annotated[bool, flag("Fail on unused baselines.", "--strict")] = False,
    json: options.Json = False,
) -> int:
    """Run suites or Python tests, and compare drives with baselines.

    Exit code 0: every drive meets its suite's expectations and is no worse than its baseline.
    """
    from antdrive.testing.session_summary import add_to_page, drives_in, properties, save_junit

    outcomes, unused = _drive(tests, only, jobs, "", results, keep, json=json)
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
    keep: Keep = False,
    json: options.Json = False,
) -> int:
    """Run suites or Python tests, and save the drives as baselines.

    A drive that misses its test's expectations is rejected, with log, page and figure. Exit code 0: every drive was accepted.
    """
    outcomes, unused = _drive(tests, only, jobs, "new" if new else "all", results, keep, json=json)
    return _summarise(outcomes, json, unused)


def _drive(
    words: list[str],
    only: str | None,
    jobs: int | None,
    update: "Update",
    folder: Path | None,
    keep: bool,
    *,
    json: bool,
) -> "tuple[list[CheckResult], list[str]]":
    """Drive and evaluate all named tests, and print each result; return the results and the unused baselines."""
    from antdrive.testing.checking import evaluate_tests
    from antdrive.views.artefacts import Results, cached_results
    from antdrive.views.run_folder import check_folder

    if folder is not None:
        check_folder(folder)
    noted: set[str] = set()

    def report(result: "CheckResult") -> None:
        first, *rest = result.lines(noted)
        print_line(marked(result.passed, first))
        for line in rest:
            print_line(f"  {line}")

    results = Results(folder or cached_results(Path.cwd()), keep)
    with bar("driving") as progress:
        return evaluate_tests(
            words, only=only, jobs=jobs, update=update, results=results, choose=with_calibrated_margin,
            report=(lambda _: None) if json else report, progress=progress,
        )  # fmt: skip


def _summarise(results: "list[CheckResult]", json: bool, unused: Sequence[str], *, strict: bool = False) -> int:
    """Print the number of passed tests and the unused baselines. Return the exit code of the worst test."""
    from antdrive.testing.evaluation import INTERNAL_ERROR as INTERNAL
    from antdrive.testing.evaluation import INVALID_INPUT as WRONG
    from antdrive.testing.session_summary import summary_lines

    worst = {WRONG: INVALID_INPUT, INTERNAL: INTERNAL_ERROR}
    codes = [worst.get(result.outcome, FAILED) for result in results if not result.passed]
    code = max([*codes, FAILED if strict and unused else SUCCEEDED])
    tests = [result.as_dict() for result in results]
    facts = {"passed": code == SUCCEEDED, "tests": tests, "unused": list(unused)}
    show(json, facts, summary_lines(results, unused, strict))
    return code
