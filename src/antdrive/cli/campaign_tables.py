"""`antdrive report` and `antdrive compare` for the folder of a campaign."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.cli.console import print_files, print_json, print_line, print_table
from antdrive.cli.exits import SUCCEEDED

if TYPE_CHECKING:
    from antdrive.views.campaign.cells import TextTable
    from antdrive.views.campaign.summary import CampaignSummary

Metrics = Annotated[
    list[str] | None,
    typer.Option(
        "--metric",
        metavar="NAME",
        help="Metric to compare besides success, of a campaign. May be repeated.  "
        "[default: driven_length_m, duration_s, plan_s]",
    ),
]
Against = Annotated[
    str | None,
    typer.Option(metavar="PLANNER", help="Compare this planner with each other one only, of a campaign."),
]

Where = Annotated[
    list[str] | None,
    typer.Option(
        metavar="COLUMN=VALUE",
        help="Take only some runs of a campaign, such as noise=1, noise=0,1 or duration_s=10..20. May be repeated.",
    ),
]

Allow = Annotated[
    list[str] | None,
    typer.Option(
        metavar="MEASURE=DIFFERENCE",
        help="By how much a planner may be worse than --against and still count as not worse, such as success=0.02 or "
        "duration_s=1, of a campaign. May be repeated.",
    ),
]

COMPARE_OPTIONS = ("worlds", "planner", "metric", "against", "allow", "where", "json")


#: Files of a campaign's folder, as `runs/campaigns/store` names them; that module would load much more.
MARKS = ("manifest.json", "grid.parquet")


def is_campaign(folder: Path) -> bool:
    """Whether a folder is that of a campaign."""
    return all((folder / name).is_file() for name in MARKS)


def campaigns_of_words(words: Sequence[str], context: typer.Context) -> list[Path]:
    """The campaigns' folders that `antdrive compare` was given, if they are.

    Raises:
        InputError: options that do not go together.
    """
    folders = [word for word in words if is_campaign(Path(word))]
    given = {name for name in context.params if _is_given(context, name)}
    if not folders:
        for name in sorted(given & {"metric", "against", "allow", "where"}):
            raise InputError(f"--{name}: is for the folder of a campaign; {words[0]} is none")
        return []
    if len(folders) < len(words):
        raise InputError(f"{' '.join(words)}: name folders of campaigns, or worlds")
    for name in sorted(given - set(COMPARE_OPTIONS)):
        option = name.replace("_", "-")
        raise InputError(
            f"--{option}: is for drives; a campaign's folder takes --planner, --metric, --against, --allow, --where and --json"
        )
    return [Path(folder) for folder in folders]


def _is_given(context: typer.Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def compare_campaigns(
    folders: Sequence[Path],
    planners: Sequence[str],
    metrics: Sequence[str] | None,
    against: str | None,
    allow: Sequence[str] | None,
    where: Sequence[str] | None,
    json: bool,
) -> int:
    """Print success of each planner and the comparison of each pair."""
    from antdrive.views.campaign.reporting import summarise_campaign

    words: dict[str, Any] = {"allow": _allowed(allow, against), "where": _conditions(where), "strict": True}
    summary = summarise_campaign(folders, metrics=metrics or None, against=against, planners=planners, **words)
    if json:
        print_json(_plain(summary))
        return SUCCEEDED
    from antdrive.views.campaign.cells import all_cells

    for table in all_cells(summary):
        _print_table(table)
        print_line()
    for note in (*summary.notes, f"Medians are over the {summary.common} instances that every planner solved."):
        print_line(note)
    return SUCCEEDED


def report_campaigns(
    folders: Sequence[Path],
    out: Path,
    json: bool,
    allow: Sequence[str] | None,
    where: Sequence[str] | None,
    against: str | None,
    **words: Any,
) -> int:
    """Write the report of a campaign, or of several."""
    from antdrive.views.campaign.reporting import report_campaign

    words |= {"allow": _allowed(allow, against), "where": _conditions(where), "against": against}
    files = report_campaign(folders, out, **words)
    size = sum(path.stat().st_size for path in files)
    if json:
        print_json({"file": str(files[0]), "files": [str(path) for path in files], "bytes": size})
    else:
        print_line(f"{size / 1e6:.2f} MB")
        print_files(dict(zip(("report", "pairs"), map(str, files), strict=False)))
    return SUCCEEDED


def _allowed(allow: Sequence[str] | None, against: str | None) -> dict[str, float]:
    """What `--allow` says, by measure."""
    found = {}
    for text in allow or ():
        if against is None:
            raise InputError(f"--allow {text}: needs --against PLANNER, the one that others may not be worse than")
        measure, _, value = text.partition("=")
        try:
            found[measure] = float(value)
        except ValueError:
            raise InputError(f"--allow {text}: must be MEASURE=DIFFERENCE, such as success=0.02") from None
    return found


def _conditions(where: Sequence[str] | None) -> dict[str, str]:
    """What `--where` says, by column: a run has one of the values named for it."""
    for text in where or ():
        if "=" not in text:
            raise InputError(f"--where {text}: must be COLUMN=VALUE, such as noise=1")
    found: dict[str, str] = {}
    for column, _, value in (text.partition("=") for text in where or ()):
        found[column] = f"{found[column]},{value}" if column in found else value
    return found


def _print_table(table: "TextTable") -> None:
    print_line(table.title)
    print_table(table.headings, table.rows)


def _plain(summary: "CampaignSummary") -> dict[str, object]:
    return {
        "runs": len(summary.table),
        "size": summary.size,
        "planners": [row.as_dict() for row in summary.success],
        "comparisons": {name: [row.as_dict() for row in rows] for name, rows in summary.comparisons.items()},
        "not_worse": [row.as_dict() for row in summary.allowances],
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
