"""Columns of a campaign's table, and the row of one run.

A row has two parts. The grid part (`grid_row`) comes from the current campaign, so labels are up to date. The result
part is written once, when the run ends (`run_row`, `failed_row`).
"""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from antdrive.base.optional import parquet_library
from antdrive.base.version import versions
from antdrive.runs.campaigns.job import Job
from antdrive.runs.comparing import FAULTS as FAULTS
from antdrive.runs.statistics.convergence import HISTORY, packed
from antdrive.sim.facts import FACTS, IN_TABLE, facts_of
from antdrive.sim.log.metrics import WALL_CLOCK
from antdrive.sim.pipeline import Run
from antdrive.sim.settings import SETTING_COLUMNS

if TYPE_CHECKING:
    import pyarrow

CRASHED = "crashed"  # outcome of a run whose process died, or in which antdrive raised an error
TOO_SLOW = "too_slow"  # outcome of a run killed after the campaign's run_limit
#: Columns that differ between repetitions of a run; the canonical table omits them.
NOT_CANONICAL = (*WALL_CLOCK, "attempts")
VERSIONS = ("antdrive", "numpy", "pybullet", "numba")
BATCH = 50_000  # rows held as Python objects
OPTION = "option."  # prefix of the columns of a planner's options
#: Grid columns besides options: name and type.
GRID: Mapping[str, str] = {
    "key": "string",
    "world": "string",
    "world_hash": "string",
    "area_m2": "double",
    "task": "string",
    "planner": "string",
    "planner_name": "string",
    "planner_version": "string",
    "options": "string",
    "robot": "string",
    "robot_hash": "string",
    **SETTING_COLUMNS,
    "command": "string",
}
#: Result columns: name and type.
RESULT: Mapping[str, str] = {
    "key": "string",
    **{name: FACTS[name].column for name in IN_TABLE if name not in WALL_CLOCK},
    HISTORY: "string",
    "rollout": "string",
    **{f"version.{name}": "string" for name in VERSIONS},
    **{name: FACTS[name].column for name in WALL_CLOCK},
    "attempts": "int64",
}


def grid_row(job: Job) -> dict[str, Any]:
    """Return the grid columns of a run."""
    case, planner, robot = job.case, job.case.planner, job.case.robot
    x0, y0, x1, y1 = case.place.task.world.bounds
    margin = case.calibration.margin if case.calibration else case.resolved.margin
    return {
        "key": job.key,
        "world": case.place.world,
        "world_hash": case.world_hash,
        "area_m2": (x1 - x0) * (y1 - y0),
        "task": case.place.name,
        "planner": planner.label,
        "planner_name": planner.name,
        "planner_version": planner.version,
        "options": json.dumps(planner.options, sort_keys=True),
        "robot": robot.name,
        "robot_hash": robot.content,
        **case.resolved.columns,
        "margin": None if margin == "auto" else float(margin),
        "cell": float(case.written.settings.get("cell") or case.place.task.cell),
        "seed": job.seed,
        "command": dataclasses.replace(case.written, seed=job.seed).command(),
    }


def run_row(key: str, run: Run, rollout: str | None) -> dict[str, Any]:
    """Return the result columns of a run that ended by itself."""
    facts = {name: None if value != value else value for name, value in facts_of(run, IN_TABLE).items()}
    return _empty(key) | facts | {HISTORY: packed(run.plan), "rollout": rollout}


def failed_row(key: str, outcome: str, reason: str) -> dict[str, Any]:
    """Return the row of a run that did not end by itself."""
    return _empty(key) | {"outcome": outcome, "succeeded": False, "reason": reason}


def too_slow_row(key: str, limit: float) -> dict[str, Any]:
    """Return the row of a run killed after its limit."""
    return failed_row(key, TOO_SLOW, f"took longer than the campaign's run_limit of {limit:g} s")


def _empty(key: str) -> dict[str, Any]:
    return {**dict.fromkeys(RESULT), "key": key, **_version_columns(), "attempts": 1}


@functools.cache  # reading the versions takes milliseconds
def _version_columns() -> dict[str, str]:
    current = versions()
    return {f"version.{name}": current[name] for name in VERSIONS}


def result_table(rows: Sequence[Mapping[str, Any]]) -> pyarrow.Table:
    """Return the results of some runs as an Arrow table."""
    return parquet_library().Table.from_pylist(list(rows), schema=_schema(RESULT))


def grid_table(jobs: Sequence[Job]) -> pyarrow.Table:
    """Return the grid of a campaign as an Arrow table, with a column for each option that the campaign sets."""
    arrow, schema = parquet_library(), _schema(GRID)
    batches = (jobs[first : first + BATCH] for first in range(0, len(jobs), BATCH))
    tables = [arrow.Table.from_pylist([grid_row(job) for job in batch], schema=schema) for batch in batches]
    table = arrow.concat_tables([schema.empty_table(), *tables]).combine_chunks()
    place = table.schema.get_field_index("options") + 1
    for name in sorted({option for job in jobs for option in job.case.planner.given}):
        values = [job.case.planner.options.get(name) for job in jobs]
        table = table.add_column(place, OPTION + name, arrow.array(_alike(values)))
        place += 1
    return table


def _alike(values: list[Any]) -> list[Any]:
    """Give the values of a column one type: numbers stay, mixtures with text become text."""
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float}:
        return [float(value) if float in kinds and value is not None else value for value in values]
    return values if len(kinds) < 2 else [None if value is None else str(value) for value in values]


def _schema(columns: Mapping[str, str]) -> pyarrow.Schema:
    arrow = parquet_library()
    kinds = {"string": arrow.string(), "double": arrow.float64(), "bool": arrow.bool_(), "int64": arrow.int64()}
    return arrow.schema([(name, kinds[kind]) for name, kind in columns.items()])


def result_schema() -> pyarrow.Schema:
    """Return the Arrow schema of results."""
    return _schema(RESULT)
