"""`antdrive sweep`."""

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.campaign_options import campaign_from, resumable
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import campaign_bar, print_error, show, table
from antdrive.cli.options import argument, flag, option
from antdrive.sim.settings import SETTINGS

if TYPE_CHECKING:
    from antdrive.runs.campaigns.expanding import Expansion
    from antdrive.runs.campaigns.results import SweepResults
    from antdrive.runs.campaigns.running import Keep


@options.with_settings((name for name, one in SETTINGS.items() if one.flag and one.is_word), many=True)
def sweep(
    campaign: Annotated[
        Path | None, argument("CAMPAIGN", "Campaign file; may be left out where the options name all.")
    ] = None,
    out: Annotated[Path | None, option("FOLDER", "Folder for the results; a campaign there goes on.")] = None,
    world: Annotated[
        list[str] | None, option("NAME", "World of the catalogue, file, or pattern. May be repeated.")
    ] = None,
    generate: Annotated[
        list[str] | None, option("KIND:SEEDS", "Random worlds, such as forest:20 or barn:0-9. May be repeated.")
    ] = None,
    planner: Annotated[
        list[str] | None,
        option(
            "NAME",
            "Planner, or FILE.py:CLASS, with options such as aco-han:ants=10,50 or aco-han:ants=10..50..20. May be repeated.",
        ),
    ] = None,
    robot: Annotated[list[str] | None, option("NAME", "Robot of the catalogue, or file. May be repeated.")] = None,
    seeds: Annotated[str | None, option("SEEDS", "How many seeds, such as 10, or which, such as 0-9 or 3,7.")] = None,
    tasks: Annotated[
        str | None,
        option(
            "NUMBER[:METRES]|named",
            "Random starts and goals in each world, at least so many metres apart; or named: those that its file lists.  "
            "[default: its own]",
        ),
    ] = None,
    jobs: options.Jobs = None,
    dask: Annotated[
        str | None,
        option(
            "ADDRESS",
            "Make the runs on a cluster: tcp://HOST:PORT of a dask scheduler, or local:N. Whoever reaches a scheduler can "
            "run code on its machines: use it in trusted networks only.",
        ),
    ] = None,
    keep: Annotated[
        str | None, option("WHICH", "Logs to keep: none, failed or all.  [default: as the campaign says]", "--keep")
    ] = None,
    run_limit: Annotated[
        float | None,
        option("SECONDS", "Wall-clock time of a run, after which its process is ended [s].", "--run-limit"),
    ] = None,
    retry_crashed: Annotated[bool, flag("Make runs again that crashed.", "--retry-crashed")] = False,
    again: Annotated[
        list[str] | None,
        option("NAME", "Make runs again of a planner, or with an outcome: planner_fault. May be repeated."),
    ] = None,
    dry_run: Annotated[
        bool, flag("Say how many runs there are and how many are missing; run nothing.", "--dry-run")
    ] = False,
    report: Annotated[
        Path | None,
        option("FILE", "Write the campaign's statistics too, as `antdrive report` does: .html, .md, .tex or .csv."),
    ] = None,
    json: options.Json = False,
    **given: Any,
) -> None:
    """Drive every combination of a campaign.

    The folder holds a row for each run as Parquet. The same command goes on after an interruption, and runs what is new after
    a change. Options that name worlds, planners and so on take the place of what the file says. Exit code 0: all runs are
    done, whatever came out of them.
    """
    from antdrive.runs.campaigns.expanding import expand
    from antdrive.runs.campaigns.sweeping import missing_runs
    from antdrive.runs.campaigns.sweeping import sweep as make_runs

    if out is None and not dry_run:
        raise InputError("--out: missing; name the folder for the results")
    _check(keep, dask, jobs, report, dry_run)
    asked = campaign_from(
        campaign, given, worlds=world, generate=generate, planners=planner, robots=robot, seeds=seeds, tasks=tasks,
        run_limit=run_limit,
    )  # fmt: skip
    expansion = expand(asked)
    rest: dict[str, Any] = {"retry_crashed": retry_crashed, "again": again or ()}
    if dry_run or out is None:
        size = len(expansion.jobs)
        missing = size if out is None else len(missing_runs(expansion.jobs, out, **rest).jobs)
        counts = {"duplicates": expansion.duplicates, "counts": expansion.counts}
        show(json, {"runs": size, "missing": missing, **counts}, _size_lines(expansion, missing))
        return
    compile_once()
    with resumable(out), campaign_bar("driving") as progress:
        rest |= {"jobs": jobs, "dask": dask, "keep": cast("Keep | None", keep)}
        results = make_runs(asked, out, expansion=expansion, progress=progress, **rest)
    for note in results.notes:
        print_error(note)
    files: list[str] = []
    if report is not None:
        from antdrive.views.pages.campaign_report import report_campaign

        files = [str(path) for path in report_campaign(out, report)]
    facts = {
        "folder": str(results.folder),
        "table": str(results.path),
        "runs": results.size,
        "made": results.made,
        "succeeded": results.succeeded,
        "outcomes": results.outcomes,
        **({"report": files[0]} if files else {}),
    }
    show(json, facts, _lines(results, files))


def _check(keep: str | None, dask: str | None, jobs: int | None, report: Path | None, dry_run: bool) -> None:
    """Refuse options that mean nothing."""
    if report is not None:
        from antdrive.views.pages.campaign_report import check_suffix

        check_suffix(report)
        if dry_run:
            raise InputError("--report: has no effect with --dry-run, which runs nothing")
    from antdrive.runs.campaigns.running import Keep as Kinds

    if keep is not None and keep not in get_args(Kinds):
        raise InputError(f"--keep {keep}: unknown; choose from {', '.join(get_args(Kinds))}")
    if dask is not None and jobs is not None:
        raise InputError("--jobs: has no effect with --dask; write --dask local:N for N processes, or leave it out")


def _size_lines(expansion: "Expansion", missing: int) -> Iterator[str]:
    """How large a campaign is, in words."""

    def counted(name: str, count: int) -> str:
        plural = count != 1 or " " in name or name == "settings"
        return f"{count} {name if plural else name.removesuffix('s')}"

    yield " x ".join(counted(name, count) for name, count in expansion.counts.items())
    left_out = f"; {expansion.duplicates} combinations that mean the same as others are left out"
    yield f"{len(expansion.jobs)} runs, {missing} of them missing{left_out if expansion.duplicates else ''}"


def _lines(results: "SweepResults", reports: Sequence[str]) -> Iterator[str]:
    """How the runs of a campaign ended, what was measured in those that succeeded, and where more is said."""
    from antdrive.runs.campaigns.results import MEDIANS

    yield f"{results.size} runs, {results.made} of them made now; {results.succeeded} succeeded, certified"
    yield from table(("outcome", "runs"), ((name, str(count)) for name, count in results.outcomes.items()))
    yield ""
    yield "medians of the runs that succeeded (least to most)"
    yield from table(("planner", "runs", *MEDIANS.values()), results.medians())
    yield f"  table    {results.path}"
    yield from (f"  report   {file}" for file in reports)
    if not reports:
        report = shlex.join(["antdrive", "report", str(results.folder), "-o", str(results.folder / "report.html")])
        yield f"  charts, intervals and all runs: {report}"
