"""The runs of one campaign's folder, or of several, as a table for statistics."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from antdrive.base.errors import FieldError, InputError
from antdrive.runs.campaigns.extras import parquet_library
from antdrive.runs.campaigns.results import read_results
from antdrive.runs.campaigns.store import GRID_FILE
from antdrive.runs.statistics.merging import FOLDER, merged
from antdrive.runs.statistics.runs import RunTable
from antdrive.runs.statistics.selecting import column_named, matching, places_of

Columns = Mapping[str, Sequence[Any]]


def read_runs(folders: Sequence[Path], where: Mapping[str, str], planners: Sequence[str]) -> tuple[RunTable, int]:
    """The runs that are done so far, and how many of the chosen ones the campaigns have.

    Raises:
        InputError: a folder holds no campaign, or one is named twice.
        FieldError: no finished run, no such planner, or no run with these values.
    """
    base, names = common_folder(folders), _names(folders)
    tables: dict[str, RunTable] = {}
    missing: dict[str, Columns] = {}
    for name, folder in zip(names, folders, strict=True):
        done, missing[name] = _of_one(folder, base)
        tables[name] = RunTable(done)
    table = merged(tables)
    if not len(table):
        raise FieldError("runs", "none; the campaign has no finished run")
    table, left = _chosen(table, missing, where)
    if planners:
        table = table.of_planners(planners)
    return table, len(table) + _count(left, table, planners)


def common_folder(folders: Sequence[Path]) -> Path:
    """The folder to which the logs of all campaigns are relative: the campaign's own if there is one."""
    return Path(os.path.commonpath([folder.resolve() for folder in folders]))


def _names(folders: Sequence[Path]) -> list[str]:
    """Names that tell the folders apart: the last part of their paths, or the paths."""
    whole = [folder.resolve() for folder in folders]
    for folder in folders:
        if whole.count(folder.resolve()) > 1:
            raise InputError(f"{folder}: name each folder once")
    short = [path.name for path in whole]
    return short if len(set(short)) == len(short) else [str(folder) for folder in folders]


def _of_one(folder: Path, base: Path) -> tuple[dict[str, list[Any]], dict[str, list[Any]]]:
    """The columns of the runs that are done, and those of the campaign's other runs, which say what they are."""
    arrow = parquet_library()
    columns = read_results(folder).table.to_pydict()
    done = set(columns["key"])
    grid = arrow.parquet.read_table(folder / GRID_FILE).to_pydict()
    left = [k for k, key in enumerate(grid["key"]) if key not in done]
    prefix = os.path.relpath(folder.resolve(), base)
    if prefix != "." and "rollout" in columns:
        columns["rollout"] = [log and f"{Path(prefix).as_posix()}/{log}" for log in columns["rollout"]]
    return columns, {name: [values[k] for k in left] for name, values in grid.items()}


def _chosen(
    table: RunTable, missing: Mapping[str, Columns], where: Mapping[str, str]
) -> tuple[RunTable, dict[str, Columns]]:
    """The runs with the wanted values, and the missing ones that may have them: only what a run is can be known of these."""
    left: dict[str, Columns] = {
        folder: {**columns, FOLDER: [folder] * len(columns["key"])} for folder, columns in missing.items()
    }
    for column, value in where.items():
        name = column_named(table.columns, column)
        table = table.take(places_of(column, table.columns[name], value))
        for folder, columns in left.items():
            if name in columns:
                rows = matching(columns[name], value)
                left[folder] = {key: [values[k] for k in rows] for key, values in columns.items()}
    return table, left


def _count(left: Mapping[str, Columns], table: RunTable, planners: Sequence[str]) -> int:
    """How many runs are left to do, of some planners only if they are named."""
    if not planners:
        return sum(len(columns["key"]) for columns in left.values())
    labels = set(table.texts("planner"))
    return sum(
        label in labels or f"{label} @{folder}" in labels
        for folder, columns in left.items()
        for label in columns["planner"]
    )
