"""`antdrive report` and `antdrive compare` for the folder of a campaign."""

import dataclasses
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.cli.console import file_lines, show, table
from antdrive.cli.options import option

if TYPE_CHECKING:
    from antdrive.views.pages.campaign_summary import CampaignSummary

#: Files of a campaign's folder, as `runs/campaigns/store` names them; that module would load much more.
CAMPAIGN_FILES = ("manifest.json", "grid.parquet")


@dataclass(frozen=True)
class CampaignQuery:
    """The options that say what is asked about a campaign."""

    metric: Annotated[
        list[str] | None,
        option(
            "NAME",
            "Metric to compare besides success, of a campaign. May be repeated.  "
            "[default: driven_length_m, duration_s, plan_s]",
            "--metric",
        ),
    ] = None
    against: Annotated[
        str | None, option("PLANNER", "Compare this planner with each other one only, of a campaign.")
    ] = None
    allow: Annotated[
        list[str] | None,
        option(
            "MEASURE=DIFFERENCE",
            "By how much a planner may be worse than --against and still count as not worse, such as success=0.02 or "
            "duration_s=1, of a campaign. May be repeated.",
        ),
    ] = None
    where: Annotated[
        list[str] | None,
        option(
            "COLUMN=VALUE",
            "Take only some runs of a campaign, such as noise=1, noise=0,1 or duration_s=10..20. May be repeated.",
        ),
    ] = None

    @property
    def given(self) -> list[str]:
        """The names of the options that were given."""
        return [name for name, value in vars(self).items() if value]

    @property
    def words(self) -> dict[str, Any]:
        """The questions as the library takes them."""
        allowed: dict[str, float] = {}
        for text in self.allow or ():
            if self.against is None:
                raise InputError(f"--allow {text}: needs --against PLANNER, the one that others may not be worse than")
            measure, _, value = text.partition("=")
            try:
                allowed[measure] = float(value)
            except ValueError:
                raise InputError(f"--allow {text}: must be MEASURE=DIFFERENCE, such as success=0.02") from None
        conditions: dict[str, list[str]] = {}  # a run has one of the values named for a column
        for text in self.where or ():
            column, mark, value = text.partition("=")
            if not mark:
                raise InputError(f"--where {text}: must be COLUMN=VALUE, such as noise=1")
            conditions.setdefault(column, []).append(value)
        where = {column: ",".join(values) for column, values in conditions.items()}
        return {"metrics": self.metric or None, "against": self.against, "allow": allowed, "where": where}


#: The options of `antdrive compare` that a campaign's folder takes.
COMPARE_OPTIONS = ("worlds", "planner", *(one.name for one in dataclasses.fields(CampaignQuery)), "json")


def is_campaign(folder: Path) -> bool:
    """Whether a folder is that of a campaign."""
    return all((folder / name).is_file() for name in CAMPAIGN_FILES)


def refuse_campaign_options(names: Iterable[str], folder: str | Path) -> None:
    """Refuse options about campaigns for a folder that is none."""
    for name in names:
        raise InputError(f"--{name}: is for the folder of a campaign; {folder} is none")


def campaign_folders(words: Sequence[str], context: typer.Context, asked: CampaignQuery) -> list[Path]:
    """The campaigns' folders that `antdrive compare` was given, if they are."""
    folders = [Path(word) for word in words if is_campaign(Path(word))]
    if not folders:
        refuse_campaign_options(sorted(asked.given), words[0])
        return []
    if len(folders) < len(words):
        raise InputError(f"{' '.join(words)}: name folders of campaigns, or worlds")
    sources = {name: context.get_parameter_source(name) for name in context.params}
    given = {name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"}
    for name in sorted(given - set(COMPARE_OPTIONS)):
        raise InputError(
            f"--{name.replace('_', '-')}: is for drives; a campaign's folder takes --planner, --metric, --against, --allow, "
            "--where and --json"
        )
    return folders


def compare_campaigns(folders: Sequence[Path], planners: Sequence[str], asked: CampaignQuery, json: bool) -> None:
    """Print success of each planner and the comparison of each pair."""
    from antdrive.views.pages.campaign_report import summarise_campaign

    summary = summarise_campaign(folders, planners=planners, strict=True, **asked.words)
    show(json, summary.as_dict(), _tables(summary))


def _tables(summary: "CampaignSummary") -> Iterator[str]:
    from antdrive.views.pages.tables import all_cells

    for one in all_cells(summary):
        yield one.title
        yield from table(one.headings, one.rows)
        yield ""
    yield from summary.notes
    yield f"Medians are over the {summary.common} instances that every planner solved."


def report_campaigns(
    folders: Sequence[Path], out: Path, json: bool, title: str | None, planners: Sequence[str], asked: CampaignQuery
) -> None:
    """Write the report of a campaign, or of several."""
    from antdrive.views.pages.campaign_report import report_campaign

    files = report_campaign(folders, out, title=title, planners=planners, **asked.words)
    size = sum(path.stat().st_size for path in files)
    facts = {"file": str(files[0]), "files": [str(path) for path in files], "bytes": size}
    names = dict(zip(("report", "pairs"), files, strict=False))
    show(json, facts, [f"{size / 1e6:.2f} MB", *file_lines(names)])
