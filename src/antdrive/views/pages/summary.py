"""What is said about a campaign, computed once for pages, tables and the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.runs.statistics.comparison import SUCCESS, PairedComparison, compare_metric, compare_success, pairs_of
from antdrive.runs.statistics.noninferiority import NonInferiority, not_worse
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.runs.statistics.proportions import Interval
from antdrive.runs.statistics.runs import RunTable
from antdrive.runs.statistics.success import PlannerSuccess, common_medians, success_table
from antdrive.sim.log.metrics import METRICS
from antdrive.views.pages.headline import notes_on

DEFAULT_METRICS = ("driven_length_m", "duration_s", "plan_s")
TITLES = {"plan_s": "planning time", "drive_wall_s": "wall time of the drive", "path_length_m": "planned length"}
UNITS = ("_rad_per_m", "_m", "_s")  # that the names of metrics end with


@dataclass(frozen=True, eq=False)
class CampaignSummary:
    """A campaign's runs and its two tables."""

    title: str  # of the page
    paired: PairedRuns  # the runs, by instance and planner
    size: int  # how many runs of these planners the campaign has; fewer may be done
    success: Sequence[PlannerSuccess]  # a row for each planner
    # by measure, "success" first, a row for each pair of planners; empty with one planner
    comparisons: Mapping[str, Sequence[PairedComparison]]
    common: int  # number of instances in which every planner succeeded
    # by metric, the median of each planner over those instances, with its interval
    medians: Mapping[str, Sequence[tuple[float, Interval]]]
    refusal: str = ""  # why planners are not compared; empty where they are
    # whether planners are not worse than one of them by more than was allowed; empty where that is not asked
    allowances: Sequence[NonInferiority] = ()

    @property
    def table(self) -> RunTable:
        """The runs."""
        return self.paired.table

    @property
    def notes(self) -> list[str]:
        """What a reader of the tables must know about this campaign, a sentence each."""
        return notes_on(self)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "runs": len(self.table),
            "size": self.size,
            "planners": [row.as_dict() for row in self.success],
            "comparisons": {name: [row.as_dict() for row in rows] for name, rows in self.comparisons.items()},
            "not_worse": [row.as_dict() for row in self.allowances],
            "common": self.common,
            "medians": {
                name: [
                    {"planner": planner, "median": median, "interval": list(interval)}
                    for planner, (median, interval) in zip(self.paired.planners, rows, strict=True)
                ]
                for name, rows in self.medians.items()
            },
            "notes": self.notes,
        }


def summarise(
    table: RunTable,
    *,
    title: str,
    size: int | None = None,
    metrics: Sequence[str] | None = None,
    against: str | None = None,
    planners: Sequence[str] = (),
    allow: Mapping[str, float] = MappingProxyType({}),
    strict: bool = False,
) -> CampaignSummary:
    """Compute a campaign's tables."""
    paired = PairedRuns.of(table, planners)
    table = paired.table
    chosen = list(metrics) if metrics is not None else known_metrics(paired, DEFAULT_METRICS)
    for name in chosen:
        if name not in METRICS:
            raise FieldError("metric", f"unknown {name!r}; choose from {', '.join(METRICS)}")
    comparisons: dict[str, Sequence[PairedComparison]] = {}
    refusal = ""
    try:
        pairs = pairs_of(paired, against)
    except FieldError as error:
        if strict or against is not None:
            raise
        refusal = error.problem
    else:
        comparisons[SUCCESS] = compare_success(paired, pairs)
        for name in chosen:
            comparisons[name] = compare_metric(paired, pairs, name, METRICS[name].better)
    common, medians = common_medians(paired, chosen)
    rows = success_table(paired)
    allowances = _allowances(paired, against, allow)
    return CampaignSummary(title, paired, size or len(table), rows, comparisons, common, medians, refusal, allowances)


def _allowances(paired: PairedRuns, against: str | None, allow: Mapping[str, float]) -> list[NonInferiority]:
    if allow and against is None:
        raise FieldError("allow", "needs a planner to compare with (against)")
    found = []
    for name, allowed in allow.items():
        if name != SUCCESS and name not in METRICS:
            raise FieldError("allow", f"unknown {name!r}; choose from {', '.join([SUCCESS, *METRICS])}")
        better = "higher" if name == SUCCESS else METRICS[name].better
        found += not_worse(paired, against or "", name, allowed, better)
    return found


def known_metrics(paired: PairedRuns, names: Sequence[str]) -> list[str]:
    """Those of the metrics that some successful run has."""
    return [name for name in names if np.isfinite(paired.values(name)).any()]


def measure_title(name: str) -> str:
    """What a measure is called in headings, with its unit."""
    if name not in METRICS:
        return name.replace("_", " ")
    unit = METRICS[name].unit
    short = next((name.removesuffix(suffix) for suffix in UNITS if name.endswith(suffix)), name)
    plain = TITLES.get(name, short.replace("_", " "))
    return plain if unit == "1" else f"{plain} [{unit}]"
