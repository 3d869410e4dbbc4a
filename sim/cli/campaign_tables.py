"""`antdrive report` and `antdrive compare` for the folder of a campaign."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from antdrive.sim.cli.console import print_files, print_json, print_line, print_table
from antdrive.sim.cli.exits import SUCCEEDED
from antdrive.worlds.errors import InputError

if TYPE_CHECKING:
    from antdrive.sim.view.campaign.cells import TextTable
    from antdrive.sim.view.campaign.summary import CampaignSummary

Metrics = Annotated[
    list[str] | None,
    typer.Option(
        "--metric",
        metavar="NAME",
        help="Metric to compare besides success, for a campaign's folder. May be repeated.  "
        "[default: driven_length_m, duration_s, plan_s]",
    ),
]
Against = Annotated[
    str | None,
    typer.Option(metavar="PLANNER", help="Compare this planner with each other one only, for a campaign's folder."),
]

Where = Annotated[
    list[str] | None,
    typer.Option(
        metavar="COLUMN=VALUE", help="Take only some runs of a campaign's folder, such as noise=1. May be repeated."
    ),
]

COMPARE_OPTIONS = ("worlds", "planner", "metric", "against", "where", "json")


#: Files of a campaign's folder, as `sim/campaigns/store` names them; that module would load much more.
MARKS = ("manifest.json", "grid.parquet")


def is_campaign(folder: Path) -> bool:
    """Whether a folder is that of a campaign.

    Args:
        folder: the folder
    """
    return all((folder / name).is_file() for name in MARKS)


def campaign_of_words(words: Sequence[str], context: typer.Context) -> Path | None:
    """The campaign's folder that `antdrive compare` was given, if it is one.

    Args:
        words: the worlds named
        context: of the command, to see which options were given

    Raises:
        InputError: options that do not go together.
    """
    folders = [word for word in words if is_campaign(Path(word))]
    given = {name for name in context.params if _is_given(context, name)}
    if not folders:
        for name in sorted(given & {"metric", "against", "where"}):
            raise InputError(f"--{name}: is for the folder of a campaign; {words[0]} is none")
        return None
    if len(words) > 1:
        raise InputError(f"{' '.join(words)}: name one campaign's folder, or worlds")
    for name in sorted(given - set(COMPARE_OPTIONS)):
        option = name.replace("_", "-")
        raise InputError(
            f"--{option}: is for drives; a campaign's folder takes --planner, --metric, --against, --where and --json"
        )
    return Path(folders[0])


def _is_given(context: typer.Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def compare_campaign(
    folder: Path,
    planners: Sequence[str],
    metrics: Sequence[str] | None,
    against: str | None,
    where: Sequence[str] | None,
    json: bool,
) -> int:
    """Print success of each planner and the comparison of each pair.

    Args:
        folder: the campaign's folder
        planners: labels of those to compare; all without
        metrics: to compare besides success
        against: label of the planner that each other one is compared with
        where: COLUMN=VALUE of the runs to take
        json: print one JSON object
    """
    from antdrive.sim.campaigns.reporting import summarise_campaign

    summary = summarise_campaign(
        folder, metrics=metrics or None, against=against, planners=planners, where=_conditions(where), strict=True
    )
    if json:
        print_json(_plain(summary))
        return SUCCEEDED
    from antdrive.sim.view.campaign.cells import all_cells

    for table in all_cells(summary):
        _print_table(table)
        print_line()
    for note in (*summary.notes, f"Medians are over the {summary.common} instances that every planner solved."):
        print_line(note)
    return SUCCEEDED


def report_campaign_folder(folder: Path, out: Path, title: str | None, where: Sequence[str] | None, json: bool) -> int:
    """Write the report of a campaign.

    Args:
        folder: the campaign's folder
        out: the file to write
        title: of the report
        where: COLUMN=VALUE of the runs to take
        json: print one JSON object
    """
    from antdrive.sim.campaigns.reporting import report_campaign

    files = report_campaign(folder, out, title=title, where=_conditions(where))
    size = sum(path.stat().st_size for path in files)
    if json:
        print_json({"file": str(files[0]), "files": [str(path) for path in files], "bytes": size})
    else:
        print_line(f"{size / 1e6:.2f} MB")
        print_files(dict(zip(("report", "pairs"), map(str, files), strict=False)))
    return SUCCEEDED


def _conditions(where: Sequence[str] | None) -> dict[str, str]:
    """What `--where` says, by column."""
    for text in where or ():
        if "=" not in text:
            raise InputError(f"--where {text}: must be COLUMN=VALUE, such as noise=1")
    return {text.partition("=")[0]: text.partition("=")[2] for text in where or ()}


def _print_table(table: "TextTable") -> None:
    print_line(table.title)
    print_table(table.headings, table.rows)


def _plain(summary: "CampaignSummary") -> dict[str, object]:
    return {
        "runs": len(summary.table),
        "size": summary.size,
        "planners": [row.as_dict() for row in summary.success],
        "comparisons": {name: [row.as_dict() for row in rows] for name, rows in summary.comparisons.items()},
        "common": summary.common,
        "medians": {
            name: [
                {"planner": planner, "median": median, "interval": list(interval)}
                for planner, (median, interval) in zip(summary.paired.planners, rows, strict=True)
            ]
            for name, rows in summary.medians.items()
        },
        "notes": summary.notes,
    }
