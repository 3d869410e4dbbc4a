"""Campaign folders as input of `antdrive report` and `antdrive compare`."""

import dataclasses
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.base.tables import table
from antdrive.cli.console import show
from antdrive.cli.options import option

if TYPE_CHECKING:
    from antdrive.views.pages.campaign_summary import CampaignSummary

#: Files that identify a campaign folder; copies of the names in `runs/campaigns/store`, which is slow to import.
CAMPAIGN_FILES = ("manifest.json", "grid.parquet")


@dataclass(frozen=True)
class CampaignQuery:
    """Options that select what to compare in a campaign."""

    metric: Annotated[
        list[str] | None,
        option(
            "NAME",
            "Campaign: metric to compare besides success. Repeatable.  [default: driven_length_m, duration_s, plan_s]",
            "--metric",
        ),
    ] = None
    against: Annotated[
        str | None, option("PLANNER", "Campaign: planner to compare the others with.  [default: all pairs]")
    ] = None
    allow: Annotated[
        list[str] | None,
        option(
            "MEASURE=DIFFERENCE",
            "Campaign: non-inferiority margin against --against, such as success=0.02 or duration_s=1. Repeatable.",
        ),
    ] = None
    where: Annotated[
        list[str] | None,
        option("COLUMN=VALUE", "Campaign: select runs, such as noise=1, noise=0,1 or duration_s=10..20. Repeatable."),
    ] = None

    @property
    def given(self) -> list[str]:
        """Names of the given options."""
        return [name for name, value in vars(self).items() if value]

    @property
    def arguments(self) -> dict[str, Any]:
        """Keyword arguments for the library."""
        allowed: dict[str, float] = {}
        for text in self.allow or ():
            if self.against is None:
                raise InputError(f"--allow {text}: needs --against PLANNER")
            measure, _, value = text.partition("=")
            try:
                allowed[measure] = float(value)
            except ValueError:
                raise InputError(f"--allow {text}: must be MEASURE=DIFFERENCE, such as success=0.02") from None
        conditions: dict[str, list[str]] = {}  # accepted values by column
        for text in self.where or ():
            column, mark, value = text.partition("=")
            if not mark:
                raise InputError(f"--where {text}: must be COLUMN=VALUE, such as noise=1")
            conditions.setdefault(column, []).append(value)
        where = {column: ",".join(values) for column, values in conditions.items()}
        return {"metrics": self.metric or None, "against": self.against, "allow": allowed, "where": where}


#: Options of `antdrive compare` that apply to campaign folders.
COMPARE_OPTIONS = ("worlds", "planner", *(one.name for one in dataclasses.fields(CampaignQuery)), "json")


def is_campaign(folder: Path) -> bool:
    """Return whether a folder holds a campaign."""
    return all((folder / name).is_file() for name in CAMPAIGN_FILES)


def refuse_campaign_options(names: Iterable[str], folder: str | Path) -> None:
    """Raise an error about campaign options if the folder holds no campaign."""
    for name in names:
        raise InputError(f"--{name}: applies to campaign folders only; {folder} is not one")


def campaign_folders(words: Sequence[str], context: typer.Context, query: CampaignQuery) -> list[Path]:
    """Return the campaign folders given to `antdrive compare`; an empty list for worlds."""
    folders = [Path(word) for word in words if is_campaign(Path(word))]
    if not folders:
        refuse_campaign_options(sorted(query.given), words[0])
        return []
    if len(folders) < len(words):
        raise InputError(f"{' '.join(words)}: mixes campaign folders and worlds; name one kind")
    sources = {name: context.get_parameter_source(name) for name in context.params}
    given = {name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"}
    for name in sorted(given - set(COMPARE_OPTIONS)):
        raise InputError(
            f"--{name.replace('_', '-')}: applies to drives only; campaign folders take --planner, --metric, --against, "
            "--allow, --where and --json"
        )
    return folders


def compare_campaigns(folders: Sequence[Path], planners: Sequence[str], query: CampaignQuery, json: bool) -> None:
    """Print each planner's success and the comparison of each pair."""
    from antdrive.views.pages.report import summarise_campaign

    summary = summarise_campaign(folders, planners=planners, strict=True, **query.arguments)
    show(json, summary.as_dict(), _tables(summary))


def _tables(summary: "CampaignSummary") -> Iterator[str]:
    from antdrive.views.pages.tables import all_cells

    for one in all_cells(summary):
        yield one.title
        yield from table(one.headings, one.rows)
        yield ""
    yield from (*summary.sentences, *summary.notes)
    yield f"Medians are over the {summary.common} instances that every planner solved."
