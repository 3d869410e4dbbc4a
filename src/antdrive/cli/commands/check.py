"""`antdrive check`."""

import os
from pathlib import Path
from typing import Annotated

import typer

from antdrive.cli import options, suites
from antdrive.cli.console import print_error
from antdrive.cli.suites import drive_suites, print_result, print_summary, results_in, unused_baselines

Junit = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write the results as JUnit XML, which CI services read.")
]
Strict = Annotated[bool, typer.Option("--strict", help="Fail if there are baselines that belong to no test.")]


def check(
    tests: suites.Suites,
    only: suites.Only = None,
    jobs: suites.Jobs = None,
    results: suites.ResultsFolder = None,
    film: suites.Film = "failed",
    junit: Junit = None,
    strict: Strict = False,
    json: options.Json = False,
) -> int:
    """Drive suites and compare with their baselines.

    Exit code 0: every drive is as its suite expects, and none is worse than its baseline.
    """
    from antdrive.cli.testing.summary import add_to_page, drives_in, properties, save_junit

    found = drive_suites(
        tests,
        only,
        jobs,
        update="",
        results=results_in(results, film),
        show=lambda result: None if json else print_result(result, "passed"),
    )
    unused = unused_baselines(tests)
    if junit is not None:
        save_junit(found, junit)
    page = os.environ.get("GITHUB_STEP_SUMMARY")
    if page:
        drives = [drive for result in found for drive in drives_in(properties(result))]
        problem = add_to_page(page, drives, unused)
        if problem:
            print_error(problem)
    return print_summary(found, json, unused, strict=strict)
