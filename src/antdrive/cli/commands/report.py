"""`antdrive report`."""

from pathlib import Path
from typing import Annotated

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.campaign_tables import CampaignQuery, is_campaign, refuse_campaign_options, report_campaigns
from antdrive.cli.console import file_lines, show
from antdrive.cli.options import argument, flag, option


@options.with_settings()
def report(
    *,
    folders: Annotated[
        list[Path], argument("FOLDER...", "Holds the folders that `antdrive run` wrote, or a campaign.")
    ],
    out: Annotated[Path, option("FILE", "The page: .html, or .md for a pull request; of a campaign also .tex, .csv.")],
    title: Annotated[str | None, option("TEXT", "Title of the page.  [default: the folders' names]")] = None,
    embed_films: Annotated[bool, flag("Put films into the page instead of linking to them.", "--embed-films")] = False,
    planner: Annotated[
        list[str] | None, option("LABEL", "Report about this planner of a campaign. May be repeated.")
    ] = None,
    asked: CampaignQuery,
    json: options.Json = False,
) -> None:
    """Write one page about many runs.

    A table to sort and filter, films, figures, and the commands that repeat the runs. Of a campaign: paired comparisons of
    its planners, charts, and all runs.
    """
    campaigns = [folder for folder in folders if is_campaign(folder)]
    if campaigns and len(campaigns) == len(folders):
        report_campaigns(folders, out, json, title, planner or (), asked)
        return
    other = next(folder for folder in folders if folder not in campaigns)
    if campaigns:
        raise InputError(f"{other}: is no campaign's folder, as {campaigns[0]} is; report about them apart")
    refuse_campaign_options([*(["planner"] if planner else []), *asked.given], other)
    from antdrive.views.pages.run_report import write_report

    count = write_report(folders, out, title=title, embed_films=embed_films)
    size = out.stat().st_size
    facts = {"file": str(out), "runs": count, "bytes": size}
    show(json, facts, [f"{count} runs, {size / 1e6:.2f} MB", *file_lines({"report": out})])
