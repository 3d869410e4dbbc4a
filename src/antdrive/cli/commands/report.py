"""`antdrive report`."""

from pathlib import Path
from typing import Annotated, Any

from antdrive.base.errors import InputError, amount
from antdrive.base.files import format_size
from antdrive.base.tables import file_lines
from antdrive.cli import options
from antdrive.cli.campaign_tables import CampaignQuery, is_campaign, refuse_campaign_options
from antdrive.cli.console import show
from antdrive.cli.options import argument, option


@options.with_settings()
def report(
    *,
    folders: Annotated[
        list[Path], argument("FOLDER", "Folders that contain runs of `antdrive run`, or campaign folders.")
    ],
    out: Annotated[Path | None, option("FILE", "Report: .html or .md; for campaigns also .tex or .csv.")] = None,
    figures: Annotated[Path | None, option("DIR", "Folder for all charts as PDF and SVG, with captions.")] = None,
    width: Annotated[
        float | None,
        option("INCHES", "Campaign: width of the charts, such as 3.4 for a column, 6.9 for a page.", min=2.0, max=20.0),
    ] = None,
    columns: Annotated[
        str | None,
        option(
            "NAME,...",
            "Campaign: columns of .md, .tex or .csv, such as planner,share. Tables without all are left out.",
        ),
    ] = None,
    title: Annotated[str | None, option("TEXT", "Title.  [default: the folders' names]")] = None,
    planner: Annotated[list[str] | None, option("LABEL", "Campaign: report on this planner only. Repeatable.")] = None,
    query: CampaignQuery,
    json: options.Json = False,
) -> None:
    """Write a report on many runs or on a campaign.

    Runs: a sortable table with links to their files and the commands that repeat them. Campaigns: paired comparisons of
    planners, charts, and all runs.
    """
    if width and figures is None:
        raise InputError("--width: needs --figures DIR")
    if out is None and figures is None:
        raise InputError("give -o FILE, --figures DIR, or both")
    named = [name.strip() for name in columns.split(",") if name.strip()] if columns else []
    campaigns = [folder for folder in folders if is_campaign(folder)]
    asked: dict[str, Any] = {}
    if len(campaigns) == len(folders):
        asked = {"planners": planner or (), "columns": named, **query.arguments}
    else:
        other = next(folder for folder in folders if folder not in campaigns)
        if campaigns:
            raise InputError(f"{other}: is not a campaign folder, but {campaigns[0]} is; write separate reports")
        given = [
            *(["planner"] if planner else []),
            *(["columns"] if named else []),
            *(["width"] if width else []),
            *query.given,
        ]
        refuse_campaign_options(given, other)
    from antdrive.views.pages.report import write_report

    written = write_report(folders, out, title=title, charts=figures, width=width, **asked)
    count, files, size = written.runs, written.files, sum(path.stat().st_size for path in written.files)
    tables = 2 if len(files) > 1 and files[1].suffix == ".csv" else 1
    names = {} if out is None else dict(zip(("report", "pairs"), files[:tables], strict=False))
    show(
        json,
        {"file": str(files[0]), "files": [str(path) for path in files], "runs": count, "bytes": size},
        [
            ", ".join([*([amount(count, "run")] if count else []), format_size(size)]),
            *file_lines({**names, **({} if figures is None else {"figures": figures})}),
        ],
    )
