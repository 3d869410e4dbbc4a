"""`antdrive check`."""

from antdrive.sim.cli import options, suites
from antdrive.sim.cli.suites import drive_suites, print_results, results_in


def check(
    tests: suites.Suites,
    only: suites.Only = None,
    jobs: suites.Jobs = None,
    results: suites.ResultsFolder = None,
    film: suites.Film = "failed",
    json: options.Json = False,
) -> int:
    """Drive suites and compare with their baselines.

    Exit code 0: every drive is as its suite expects, and none is worse than its baseline.
    """
    return print_results(drive_suites(tests, only, jobs, update="", results=results_in(results, film)), json, "passed")
