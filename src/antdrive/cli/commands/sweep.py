"""`antdrive sweep`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args

from antdrive.base.errors import InputError
from antdrive.base.files import known_suffix
from antdrive.base.progress import bar
from antdrive.cli import options
from antdrive.cli.console import print_error, show
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.options import argument, flag, option
from antdrive.cli.output import print_faults
from antdrive.sim.settings import SETTINGS

if TYPE_CHECKING:
    from antdrive.runs.campaigns.running import Keep


@options.with_settings((name for name, one in SETTINGS.items() if one.flag and one.is_word), many=True)
def sweep(
    campaign: Annotated[
        Path | None, argument("CAMPAIGN", "Campaign file; optional if options name worlds and planners.")
    ] = None,
    out: Annotated[Path | None, option("FOLDER", "Output folder; resumes the campaign there.")] = None,
    world: Annotated[list[str] | None, option("NAME", "World name, file or pattern. Repeatable.")] = None,
    generate: Annotated[
        list[str] | None, option("KIND:SEEDS", "Random worlds: forest:20 or barn:0-9. Repeatable.")
    ] = None,
    planner: Annotated[
        list[str] | None, option("NAME", "Planner name, FILE.py:CLASS or a plan's file. Repeatable.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        option(
            "GROUP.KEY=VALUES",
            "Options of a planner (as.ants=10,50 or as.ants=10..50..20), of all (planner.ants=50) or of controllers "
            "(controller.reach=1,2). Repeatable.",
            "--set",
            "-s",
        ),
    ] = None,
    robot: Annotated[list[str] | None, option("NAME", "Robot name or file. Repeatable.")] = None,
    seeds: Annotated[str | None, option("SEEDS", "Number of seeds (10) or a list of seeds (0-9, or 3,7).")] = None,
    tasks: Annotated[
        str | None,
        option(
            "TASKS",
            "Tasks per world: NUMBER[:METRES] random ones, start and goal at least METRES apart, or named (the world file's).  "
            "[default: the main task]",
        ),
    ] = None,
    jobs: options.Jobs = None,
    dask: Annotated[
        str | None,
        option(
            "ADDRESS",
            "Run on a cluster: tcp://HOST:PORT of a Dask scheduler, or local:N. Use trusted networks only: a scheduler runs "
            "code for anyone who can reach it.",
        ),
    ] = None,
    keep: Annotated[
        str | None, option("WHICH", "Logs to keep: none, failed, all.  [default: campaign's]", "--keep")
    ] = None,
    run_limit: Annotated[float | None, option("SECONDS", "Wall-clock limit per run [s].", "--run-limit")] = None,
    retry_crashed: Annotated[bool, flag("Repeat crashed runs.", "--retry-crashed")] = False,
    again: Annotated[
        list[str] | None,
        option("NAME", "Repeat runs of a planner or with an outcome, such as planner_fault. Repeatable."),
    ] = None,
    dry_run: Annotated[bool, flag("Only print the number of runs and of missing runs.", "--dry-run")] = False,
    report: Annotated[Path | None, option("FILE", "Also write a report: .html, .md, .tex or .csv.")] = None,
    json: options.Json = False,
    **given: Any,
) -> int:
    """Run a campaign: every combination of its settings.

    The output folder holds one row per run as Parquet. Repeat the command to resume, or to add runs after a change. Options
    override the keys of the campaign file. Exit code 0: all runs are done, whatever their outcomes; 3:
    an error of a planner or of antdrive.
    """
    from antdrive.runs.campaigns.expanding import expand
    from antdrive.runs.campaigns.notation import campaign_from
    from antdrive.runs.campaigns.sweeping import differences, missing_runs
    from antdrive.runs.campaigns.sweeping import sweep as make_runs

    if out is None and not dry_run:
        raise InputError("--out: missing; name the output folder")
    _validate(keep, dask, jobs, report, dry_run)
    requested = campaign_from(
        campaign, given, worlds=world, generate=generate, planners=planner, options=settings, robots=robot, seeds=seeds,
        tasks=tasks, run_limit=run_limit,
    )  # fmt: skip
    expansion = expand(requested)
    rest: dict[str, Any] = {"retry_crashed": retry_crashed, "again": again or ()}
    if dry_run or out is None:
        notes = () if out is None else differences(requested, expansion.jobs, out)
        for note in (*notes, *expansion.remarks, *expansion.idle_notes()):
            print_error(note)
        size = len(expansion.jobs)
        missing = size if out is None else len(missing_runs(expansion.jobs, out, **rest).jobs)
        counts = {"duplicates": expansion.duplicates, "counts": expansion.counts}
        show(json, {"runs": size, "missing": missing, **counts}, expansion.lines(missing))
        return SUCCEEDED
    with bar("driving") as progress:
        rest |= {"jobs": jobs, "dask": dask, "keep": cast("Keep | None", keep)}
        results = make_runs(requested, out, expansion=expansion, progress=progress, notify=print_error, **rest)
    files: list[str] = []
    if report is not None:
        from antdrive.views.pages.report import write_report

        files = [str(path) for path in write_report(out, report).files]
    show(json, results.as_dict() | ({"report": files[0]} if files else {}), results.lines(files))
    return print_faults(results.faults)


def _validate(keep: str | None, dask: str | None, jobs: int | None, report: Path | None, dry_run: bool) -> None:
    """Raise an error about options without effect."""
    if report is not None:
        from antdrive.views.pages.report import SUFFIXES

        known_suffix(report, SUFFIXES)
        if dry_run:
            raise InputError("--report: has no effect with --dry-run; omit one")
    from antdrive.runs.campaigns.running import Keep as Kinds

    if keep is not None and keep not in get_args(Kinds):
        raise InputError(f"--keep {keep}: unknown; choose from {', '.join(get_args(Kinds))}")
    if dask is not None and jobs is not None:
        raise InputError("--jobs: has no effect with --dask; use --dask local:N for N processes")
