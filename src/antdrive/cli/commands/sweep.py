"""`antdrive sweep`."""

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args

import typer

from antdrive.base.errors import InputError
from antdrive.cli import knowing
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import campaign_bar, print_error, print_json, print_line
from antdrive.cli.exits import SUCCEEDED

if TYPE_CHECKING:
    from antdrive.runs.campaigns.campaign import Campaign
    from antdrive.runs.campaigns.expanding import Expansion
    from antdrive.runs.campaigns.results import SweepResults
    from antdrive.runs.campaigns.running import Keep

File = Annotated[
    Path | None, typer.Argument(metavar="CAMPAIGN", help="Campaign file; may be left out where the options name all.")
]
Folder = Annotated[
    Path | None, typer.Option("--out", "-o", metavar="FOLDER", help="Folder for the results; a campaign there goes on.")
]
Worlds = Annotated[
    list[str] | None,
    typer.Option("--world", "-w", metavar="NAME", help="World of the catalogue, file, or pattern. May be repeated."),
]
Generate = Annotated[
    list[str] | None,
    typer.Option(metavar="KIND:SEEDS", help="Random worlds, such as forest:20 or barn:0-9. May be repeated."),
]
Planners = Annotated[
    list[str] | None,
    typer.Option(
        "--planner",
        "-p",
        metavar="NAME",
        help="Planner, or FILE.py:CLASS, with options such as aco-han:ants=10,50 or aco-han:ants=10..50..20. May be repeated.",
    ),
]
Robots = Annotated[
    list[str] | None,
    typer.Option("--robot", "-r", metavar="NAME", help="Robot of the catalogue, or file. May be repeated."),
]
Seeds = Annotated[
    str | None, typer.Option(metavar="SEEDS", help="How many seeds, such as 10, or which, such as 0-9 or 3,7.")
]
Routes = Annotated[
    list[str] | None, typer.Option("--smoothing", metavar="KIND", help="none, taut or clearance. May be repeated.")
]
Noise = Annotated[
    list[float] | None,
    typer.Option("--noise", min=0.0, metavar="FACTOR", help="Factor on the robot's noise. May be repeated."),
]
Margins = Annotated[
    list[str] | None, typer.Option("--margin", metavar="METRES|auto", help="Margin [m]. May be repeated.")
]
Tasks = Annotated[
    str | None,
    typer.Option(
        metavar="NUMBER[:METRES]|named",
        help="Random starts and goals in each world, at least so many metres apart; or named: those that its file lists.  "
        "[default: its own]",
    ),
]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", "-j", min=1, max=256, metavar="NUMBER", help="Processes.  [default: one per core]"),
]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Make the runs on a cluster: tcp://HOST:PORT of a dask scheduler, or local:N. Whoever reaches a scheduler can "
        "run code on its machines: use it in trusted networks only.",
    ),
]
Rollouts = Annotated[
    str | None,
    typer.Option("--keep", metavar="WHICH", help="Logs to keep: none, failed or all.  [default: as the campaign says]"),
]
Limit = Annotated[
    float | None,
    typer.Option(
        "--run-limit", metavar="SECONDS", help="Wall-clock time of a run, after which its process is ended [s]."
    ),
]
Retry = Annotated[bool, typer.Option("--retry-crashed", help="Make runs again that crashed.")]
Again = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME", help="Make runs again of a planner, or with an outcome: planner_fault. May be repeated."
    ),
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Say how many runs there are and how many are missing; run nothing.")
]
Report = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Write the campaign's statistics too, as `antdrive report` does: .html, .md, .tex or .csv."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]


def sweep(
    campaign: File = None,
    out: Folder = None,
    world: Worlds = None,
    generate: Generate = None,
    planner: Planners = None,
    robot: Robots = None,
    seeds: Seeds = None,
    smoothing: Routes = None,
    noise: Noise = None,
    margin: Margins = None,
    map: knowing.Maps = None,
    localisation: knowing.Localisations = None,
    odometry: knowing.Odometries = None,
    tasks: Tasks = None,
    jobs: Jobs = None,
    dask: Dask = None,
    keep: Rollouts = None,
    run_limit: Limit = None,
    retry_crashed: Retry = False,
    again: Again = None,
    dry_run: DryRun = False,
    report: Report = None,
    json: Json = False,
) -> int:
    """Drive every combination of a campaign.

    The folder holds a row for each run as Parquet. The same command goes on after an interruption, and runs what is new after
    a change. Options that name worlds, planners and so on take the place of what the file says. Exit code 0: all runs are
    done, whatever came out of them.
    """
    from antdrive.cli.campaigns import campaign_from, print_sweep
    from antdrive.runs.campaigns.expanding import expand

    if out is None and not dry_run:
        raise InputError("--out: missing; name the folder for the results")
    _check(keep, dask, jobs, report, dry_run)
    knows = {"map": map, "localisation": localisation, "odometry": odometry}
    asked = campaign_from(
        campaign, worlds=world, generate=generate, planners=planner, robots=robot, seeds=seeds, routes=smoothing,
        noise=noise, margin=margin, settings=knows, tasks=tasks, run_limit=run_limit,
    )  # fmt: skip
    expansion = expand(asked)
    if dry_run:
        return _say_size(expansion, out, json, retry_crashed=retry_crashed, again=again or ())
    assert out is not None
    options: dict[str, Any] = {"retry_crashed": retry_crashed, "again": again or ()}
    results = _run(asked, expansion, out, jobs=jobs, dask=dask, keep=cast("Keep | None", keep), **options)
    for note in results.notes:
        print_error(note)
    files = _reported(out, report)
    if json:
        print_json({**_facts(results), **({"report": files[0]} if files else {})})
    else:
        print_sweep(results, files)
    return SUCCEEDED


def _reported(folder: Path, report: Path | None) -> list[str]:
    """Write the campaign's report, if one is wanted; the files."""
    if report is None:
        return []
    from antdrive.views.campaign.reporting import report_campaign

    return [str(path) for path in report_campaign(folder, report)]


def _check(keep: str | None, dask: str | None, jobs: int | None, report: Path | None, dry_run: bool) -> None:
    """Refuse options that mean nothing."""
    if report is not None:
        from antdrive.views.campaign.page import check_suffix

        check_suffix(report)
        if dry_run:
            raise InputError("--report: has no effect with --dry-run, which runs nothing")
    from antdrive.runs.campaigns.running import Keep as Kinds

    if keep is not None and keep not in get_args(Kinds):
        raise InputError(f"--keep {keep}: unknown; choose from {', '.join(get_args(Kinds))}")
    if dask is not None and jobs is not None:
        raise InputError("--jobs: has no effect with --dask; write --dask local:N for N processes, or leave it out")


def _run(asked: "Campaign", expansion: "Expansion", out: Path, **options: Any) -> "SweepResults":
    """Make the runs, with a progress bar."""
    from antdrive.runs.campaigns.sweeping import run_expansion

    compile_once()
    with _resumable(out), campaign_bar("driving") as progress:
        return run_expansion(asked, expansion, out, progress=progress, **options)


@contextmanager
def _resumable(folder: Path) -> Iterator[None]:
    """A context that says, when it is interrupted, how the campaign goes on."""
    try:
        yield
    except KeyboardInterrupt:
        command = shlex.join(["antdrive", *_without_again(sys.argv[1:])])
        print_error(f"{folder}: what is done is kept; go on with: {command}")
        raise


def _without_again(words: list[str]) -> Iterator[str]:
    """The words of a command without --again: what it made again is not to be made a third time."""
    rest = iter(words)
    for word in rest:
        if word == "--again":
            next(rest, None)
        elif not word.startswith("--again="):
            yield word


def _say_size(expansion: "Expansion", out: Path | None, json: bool, **asked: Any) -> int:
    from antdrive.cli.campaigns import size_lines
    from antdrive.runs.campaigns.missing import missing_runs

    missing = len(expansion.jobs) if out is None else len(missing_runs(expansion.jobs, out, **asked).jobs)
    facts: dict[str, Any] = {
        "runs": len(expansion.jobs), "missing": missing, "duplicates": expansion.duplicates, "counts": expansion.counts
    }  # fmt: skip
    if json:
        print_json(facts)
        return SUCCEEDED
    for line in size_lines(expansion, missing):
        print_line(line)
    return SUCCEEDED


def _facts(results: "SweepResults") -> dict[str, Any]:
    return {
        "folder": str(results.folder),
        "table": str(results.path),
        "runs": results.size,
        "made": results.made,
        "succeeded": results.succeeded,
        "outcomes": results.outcomes,
    }
