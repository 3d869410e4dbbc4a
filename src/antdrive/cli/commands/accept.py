"""`antdrive accept`."""

from typing import Annotated

import typer

from antdrive.cli import options, suites
from antdrive.cli.suites import drive_suites, print_result, print_summary, results_in, unused_baselines


def accept(
    tests: suites.Suites,
    only: suites.Only = None,
    new: Annotated[bool, typer.Option("--new", help="Write missing baselines only.")] = False,
    jobs: suites.Jobs = None,
    results: suites.ResultsFolder = None,
    film: suites.Film = "failed",
    json: options.Json = False,
) -> int:
    """Drive suites and write their baselines.

    A drive that is not as its suite expects is not accepted; its log, pictures and film say why. Exit code 0: every drive was
    accepted.
    """
    found = drive_suites(
        tests,
        only,
        jobs,
        update="new" if new else "all",
        results=results_in(results, film),
        show=lambda result: None if json else print_result(result, "passed"),
    )
    return print_summary(found, json, unused_baselines(tests))
