"""Results of a campaign's folder: as a table, in canonical form, and for statistics."""

from __future__ import annotations

import os
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import open_regular, relative
from antdrive.base.optional import parquet_library
from antdrive.base.tables import table
from antdrive.runs.campaigns.rows import CRASHED, FAULTS, NOT_CANONICAL
from antdrive.runs.campaigns.store import GRID_FILE, TABLE, joined, read_manifest, read_table
from antdrive.runs.statistics.run_table import FOLDER, RunTable, column_named, matching, merged

if TYPE_CHECKING:
    import pyarrow

MEDIANS = {
    "driven_length_m": "length m",
    "duration_s": "duration s",
    "min_clearance_m": "minimum clearance m",
    "plan_s": "planning ms",
}


@dataclass(frozen=True, eq=False, repr=False)
class SweepResults:
    """The results of a campaign.

    Attributes:
        folder: the campaign's folder
        table: Arrow table with a row for each finished run, in the campaign's order
        size: number of runs of the campaign
        made: number of runs made by the call that returned this
    """

    folder: Path
    table: pyarrow.Table
    size: int
    made: int = 0

    @property
    def complete(self) -> bool:
        """Whether all runs of the campaign are finished."""
        return len(self.table) == self.size

    @property
    def path(self) -> Path:
        """The table's file."""
        return self.folder / TABLE

    @property
    def succeeded(self) -> int:
        """The number of runs that stopped at the goal, certified."""
        return sum(self.table["succeeded"].to_pylist())

    @property
    def outcomes(self) -> dict[str, int]:
        """The number of runs by outcome, the most frequent first."""
        return dict(Counter(self.table["outcome"].to_pylist()).most_common())

    @property
    def faults(self) -> dict[str, int]:
        """The number of runs by error of a planner or of antdrive, the most frequent first."""
        prefix = {**dict.fromkeys(FAULTS, ""), CRASHED: "internal error: "}
        rows = zip(self.table["outcome"].to_pylist(), self.table["reason"].to_pylist(), strict=True)
        return dict(Counter(prefix[outcome] + reason for outcome, reason in rows if outcome in prefix).most_common())

    def medians(self) -> Iterator[tuple[str, ...]]:
        """Yield a table row for each planner: its successes, and the median and extremes of `MEDIANS` over them."""
        runs = RunTable(self.table.to_pydict()).by_controller()
        good = [k for k, succeeded in enumerate(runs.columns["succeeded"]) if succeeded]
        for planner in dict.fromkeys(runs.columns["planner"][k] for k in good):
            own = runs.take([k for k in good if runs.columns["planner"][k] == planner])
            cells = []
            for name, unit in MEDIANS.items():
                values = own.numbers(name) * (1000.0 if unit.endswith(" ms") else 1.0)
                cells.append(f"{np.median(values):.3g} ({values.min():.3g} to {values.max():.3g})")
            yield planner, str(len(own)), *cells

    def as_dict(self) -> dict[str, Any]:
        """Return places, numbers of runs, outcomes and faults as plain values."""
        return {
            "folder": str(self.folder),
            "table": str(self.path),
            "runs": self.size,
            "made": self.made,
            "succeeded": self.succeeded,
            "outcomes": self.outcomes,
            "faults": self.faults,
        }

    def lines(self, reports: Sequence[str] = ()) -> Iterator[str]:
        """Yield outcomes, metrics of successful runs, and places as lines.

        Args:
            reports: files of reports that were written
        """
        yield f"{self.size} runs ({self.made} new): {self.succeeded} succeeded, certified"
        yield from table(("outcome", "runs"), ((name, str(count)) for name, count in self.outcomes.items()))
        if medians := list(self.medians()):
            yield ""
            yield "medians of successful runs (minimum to maximum)"
            yield from table(("planner", "runs", *MEDIANS.values()), medians)
        yield f"  table    {self.path}"
        yield from (f"  report   {file}" for file in reports)
        if not reports:
            report = shlex.join(["antdrive", "report", str(self.folder), "-o", str(self.folder / "report.html")])
            yield f"  charts, intervals and all runs: {report}"

    def __repr__(self) -> str:
        return (
            f"<SweepResults of {self.folder}: {len(self.table)} of {self.size} runs done, {self.succeeded} succeeded>"
        )

    def pandas(self) -> Any:
        """Return the table as a pandas DataFrame; needs pandas."""
        return self.table.to_pandas()


def read_results(folder: str | Path) -> SweepResults:
    """Read the results of a campaign so far, even while it runs or after it was killed.

    Args:
        folder: the campaign's folder

    Raises:
        InputError: the folder holds no campaign, or a file in it is damaged.
    """
    path = Path(folder)
    read_manifest(path)
    table = joined(path)  # a command killed at its start leaves the manifest of another grid: the grid decides the size
    with open_regular(path / GRID_FILE) as stream:
        return SweepResults(path, table, parquet_library().parquet.read_metadata(stream).num_rows)


def canonical_table(folder: str | Path) -> pyarrow.Table:
    """Return the part of the results that every repetition of the campaign reproduces, sorted by key.

    Wall-clock times and attempts are omitted. Processes, machines, order and interruptions leave no trace.

    Args:
        folder: the campaign's folder
    """
    table = read_results(folder).table
    kept = [name for name in table.column_names if name not in NOT_CANONICAL]
    return table.select(kept).sort_by("key").combine_chunks()


Columns = Mapping[str, Sequence[Any]]


def read_runs(folders: Sequence[Path], where: Mapping[str, str], planners: Sequence[str]) -> tuple[RunTable, int]:
    """Return the finished runs that match a selection, and the number of matching runs in the campaigns."""
    base, names = common_folder(folders), _names(folders)
    tables: dict[str, RunTable] = {}
    missing: dict[str, Columns] = {}
    for name, folder in zip(names, folders, strict=True):
        done, missing[name] = _of_one(folder, base)
        tables[name] = RunTable(done)
    table = merged(tables)
    if not len(table):
        raise FieldError("runs", "none; the campaign has no finished runs")
    table, left = _chosen(table, missing, where)
    table = table.by_controller()
    if planners:
        table = table.of_planners(planners)
    return table, len(table) + _count(left, table, planners)


def common_folder(folders: Sequence[Path]) -> Path:
    """Return the common parent of the campaigns' folders, to which logs are relative; a single folder itself."""
    return Path(os.path.commonpath([folder.resolve() for folder in folders]))


def _names(folders: Sequence[Path]) -> list[str]:
    """Return distinct names of the folders: the last part of each path, or the paths."""
    whole = [folder.resolve() for folder in folders]
    for folder in folders:
        if whole.count(folder.resolve()) > 1:
            raise InputError(f"{folder}: name each folder once")
    short = [path.name for path in whole]
    return short if len(set(short)) == len(short) else [str(folder) for folder in folders]


def _of_one(folder: Path, base: Path) -> tuple[dict[str, list[Any]], dict[str, list[Any]]]:
    """Return the columns of a campaign's finished runs, and the grid columns of its other runs."""
    columns = read_results(folder).table.to_pydict()
    done = set(columns["key"])
    grid = read_table(folder / GRID_FILE).to_pydict()
    left = [k for k, key in enumerate(grid["key"]) if key not in done]
    prefix = relative(folder.resolve(), base)
    if prefix != "." and "rollout" in columns:
        columns["rollout"] = [log and f"{prefix}/{log}" for log in columns["rollout"]]
    return columns, {name: [values[k] for k in left] for name, values in grid.items()}


def _chosen(
    table: RunTable, missing: Mapping[str, Columns], where: Mapping[str, str]
) -> tuple[RunTable, dict[str, Columns]]:
    """Select the runs with the wanted values, and the missing runs as far as their grid columns decide."""
    left: dict[str, Columns] = {
        folder: {**columns, FOLDER: [folder] * len(columns["key"])} for folder, columns in missing.items()
    }
    for column, value in where.items():
        name = column_named(table.columns, column)
        table = table.where(column, value)
        for folder, columns in left.items():
            if name in columns:
                rows = matching(columns[name], value)
                left[folder] = {key: [values[k] for k in rows] for key, values in columns.items()}
    return table, left


def _count(left: Mapping[str, Columns], table: RunTable, planners: Sequence[str]) -> int:
    """Count the missing runs; if planners are named, only theirs."""
    if not planners:
        return sum(len(columns["key"]) for columns in left.values())
    labels = set(table.texts("planner"))
    return sum(
        label in labels or f"{label} @{folder}" in labels
        for folder, columns in left.items()
        for label in columns["planner"]
    )
