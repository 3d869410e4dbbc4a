"""`antdrive report`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.sim.cli import options
from antdrive.sim.cli.campaign_tables import Where, is_campaign, report_campaign_folder
from antdrive.sim.cli.console import print_files, print_json, print_line
from antdrive.sim.cli.exits import SUCCEEDED
from antdrive.worlds.errors import InputError


def report(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Holds the folders that `antdrive run` wrote, or a campaign.")
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
        str | None, typer.Option(metavar="TEXT", help="Title of the page.  [default: the folder's name]")
    ] = None,
    embed_films: Annotated[
        bool, typer.Option("--embed-films", help="Put films into the page instead of linking to them.")
    ] = False,
    where: Where = None,
    json: options.Json = False,
) -> int:
    """Write one page about many runs.

    A table to sort and filter, films, figures, and the commands that repeat the runs. Of a campaign: paired comparisons of
    its planners, charts, and all runs.
    """
    if is_campaign(folder):
        return report_campaign_folder(folder, out, title, where, json)
    if where:
        raise InputError(f"--where: is for the folder of a campaign; {folder} is none")
    from antdrive.sim.view.report.report import write_report

    count = write_report(folder, out, title=title, embed_films=embed_films)
    size = out.stat().st_size
    if json:
        print_json({"file": str(out), "runs": count, "bytes": size})
    else:
        print_line(f"{count} runs, {size / 1e6:.2f} MB")
        print_files({"report": str(out)})
    return SUCCEEDED
