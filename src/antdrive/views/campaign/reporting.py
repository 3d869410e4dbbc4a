"""Reports and comparisons of a campaign's folder, or of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from antdrive.base.errors import FieldError, input_error
from antdrive.runs.campaigns.reading import common_folder, read_runs

if TYPE_CHECKING:
    from antdrive.views.campaign.summary import CampaignSummary


def summarise_campaign(
    folder: str | Path | Sequence[str | Path],
    *,
    title: str | None = None,
    metrics: Sequence[str] | None = None,
    against: str | None = None,
    planners: Sequence[str] = (),
    allow: Mapping[str, float] = MappingProxyType({}),
    where: Mapping[str, str] = MappingProxyType({}),
    strict: bool = False,
) -> CampaignSummary:
    """Success of each planner and paired comparisons, from the runs that are done so far.

    Args:
        folder: the campaign's folder, or several: a planner that two of them ran under the same conditions is told apart by
            its folder, as in "astar @today"
        title: of the report; the folders' names without
        metrics: to compare besides success; driven length, duration and planning time without
        against: label of the planner that each other one is compared with; every pair without
        planners: labels of those to look at; all without
        allow: by how much a planner may be worse than `against` and still count as not worse, such as {"success": 0.02}
        where: take only runs with these values, by column, such as {"noise": "1"}; also "0,1" and, for numbers, "10..20"
        strict: refuse where no two planners can be compared, instead of saying so in the report

    Raises:
        InputError: the folder holds no campaign, no finished run, or no such planner or metric.
    """
    from antdrive.views.campaign.summary import summarise

    folders = _folders(folder)
    try:
        table, size = read_runs(folders, where, planners)
        return summarise(
            table,
            title=title or ", ".join(one.resolve().name for one in folders),
            size=size,
            metrics=metrics,
            against=against,
            planners=planners,
            allow=allow,
            strict=strict,
        )
    except FieldError as error:
        raise input_error(" ".join(map(str, folders)), str(error)) from None


def _folders(folder: str | Path | Sequence[str | Path]) -> list[Path]:
    return [Path(one) for one in ([folder] if isinstance(folder, str | Path) else folder)]


def report_campaign(
    folder: str | Path | Sequence[str | Path],
    out: str | Path,
    *,
    title: str | None = None,
    metrics: Sequence[str] | None = None,
    against: str | None = None,
    planners: Sequence[str] = (),
    allow: Mapping[str, float] = MappingProxyType({}),
    where: Mapping[str, str] = MappingProxyType({}),
) -> list[Path]:
    """Write a report about a campaign: a page, or its tables.

    Args:
        folder: the campaign's folder, or several: a planner that two of them ran under the same conditions is told apart by
            its folder, as in "astar @today"
        out: the file to write: .html, .md, .tex or .csv
        title: of the report; the folders' names without
        metrics: to compare besides success; driven length, duration and planning time without
        against: label of the planner that each other one is compared with; every pair without
        planners: labels of those to report about; all without
        allow: by how much a planner may be worse than `against` and still count as not worse, such as {"success": 0.02}
        where: take only runs with these values, by column, such as {"noise": "1"}; also "0,1" and, for numbers, "10..20"

    Returns:
        The files written; for .csv the second holds the pairs.

    Raises:
        InputError: the folder holds no campaign, no finished run, or no such planner or metric; another suffix.
    """
    from antdrive.views.campaign.page import check_suffix, write_campaign_report

    target = Path(out)
    check_suffix(target)
    summary = summarise_campaign(
        folder, title=title, metrics=metrics, against=against, planners=planners, allow=allow, where=where
    )
    return write_campaign_report(summary, common_folder(_folders(folder)), target)
