"""`antdrive report`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.campaign_tables import Against, Allow, Metrics, Where, is_campaign, report_campaigns
from antdrive.cli.console import print_files, print_json, print_line
from antdrive.cli.exits import SUCCEEDED


def report(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="FOLDER...", help="Holds the folders that `antdrive run` wrote, or a campaign."),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="The page: .html, or .md for a pull request; of a campaign also .tex, .csv.",
        ),
    ],
    title: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Title of the page.  [default: the folders' names]")
    ] = None,
    embed_films: Annotated[
        bool, typer.Option("--embed-films", help="Put films into the page instead of linking to them.")
    ] = False,
    planner: Annotated[
        list[str] | None,
        typer.Option(
            "--planner", "-p", metavar="LABEL", help="Report about this planner of a campaign. May be repeated."
        ),
    ] = None,
    metric: Metrics = None,
    against: Against = None,
    allow: Allow = None,
    where: Where = None,
    json: options.Json = False,
) -> int:
    """Write one page about many runs.

    A table to sort and filter, films, figures, and the commands that repeat the runs. Of a campaign: paired comparisons of
    its planners, charts, and all runs.
    """
    campaigns = [folder for folder in folders if is_campaign(folder)]
    if campaigns and len(campaigns) == len(folders):
        words = {"title": title, "metrics": metric or None, "planners": planner or ()}
        return report_campaigns(folders, out, json, allow, where, against, **words)
    other = next(folder for folder in folders if folder not in campaigns)
    if campaigns:
        raise InputError(f"{other}: is no campaign's folder, as {campaigns[0]} is; report about them apart")
    campaigns_only = {"planner": planner, "metric": metric, "against": against, "allow": allow, "where": where}
    for name, given in campaigns_only.items():
        if given:
            raise InputError(f"--{name}: is for the folder of a campaign; {other} is none")
    from antdrive.views.report.report import write_report

    count = write_report(folders, out, title=title, embed_films=embed_films)
    size = out.stat().st_size
    if json:
        print_json({"file": str(out), "runs": count, "bytes": size})
    else:
        print_line(f"{count} runs, {size / 1e6:.2f} MB")
        print_files({"report": str(out)})
    return SUCCEEDED
