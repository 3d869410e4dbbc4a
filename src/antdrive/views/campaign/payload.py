"""The runs of a campaign as JSON for its page: by column, with texts that repeat written once."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

from antdrive.runs.statistics.columns import HASHES
from antdrive.runs.statistics.runs import RunTable
from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.outcome import Outcome
from antdrive.views.campaign.summary import measure_title

#: The columns of the page's table, if they are in the campaign's; a task and settings stand between them where they differ.
SHOWN = ("world", "planner", "outcome", "seed")
MEASURED = ("plan_length_m", "driven_length_m", "duration_s", "min_clearance_m", "plan_s")
SENTENCES = {
    **{outcome.key: outcome.value for outcome in Outcome},
    "crashed": "the process of the run died",
    "planner_fault": "the planner raised an error",
    "too_slow": "the run took longer than the campaign allows",
}
SIGNIFICANT = 6  # digits of numbers in the page


def page_data(table: RunTable, planners: Sequence[str], base: str) -> str:
    """The runs as JSON that may stand in a script element."""
    columns = [_column(name, table.columns[name]) for name in table.columns if name != "command"]
    columns.append({"name": "command", **_commands(table)})
    kept = [column for column in columns if column is not None]
    axes = [name for name in ("folder", "task", *table.settings) if name not in HASHES]
    different = [name for name in axes if len(set(table.columns.get(name, [None]))) > 1]
    options = [name for name in table.columns if name.startswith("option.")]
    order = (*SHOWN[:2], *different, *options, *SHOWN[2:], *MEASURED)
    names = {column["name"] for column in kept}
    data = {
        "rows": len(table),
        "planners": list(planners),
        "columns": kept,
        "shown": [name for name in order if name in names],
        "titles": {name: _title(name) for name in names},
        "sentences": SENTENCES,
        "good": [int(value) for value in table.success],
        "base": base,
    }
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _column(name: str, values: Sequence[Any]) -> dict[str, Any] | None:
    """A column by its kind: numbers, or texts as places in a list of different ones; None if it is empty."""
    if all(value is None for value in values):
        return None
    if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
        return {"name": name, "numbers": [_number(value) for value in values]}
    return {"name": name, **_texts([None if value is None else str(value) for value in values])}


def _texts(values: Sequence[str | None]) -> dict[str, Any]:
    different = {value: k for k, value in enumerate(dict.fromkeys(value for value in values if value is not None))}
    if len(different) == len(values):
        return {"texts": list(values)}
    return {"texts": list(different), "places": [-1 if value is None else different[value] for value in values]}


def _commands(table: RunTable) -> dict[str, Any]:
    """Commands, without the seed at their end where all have it there, so that they repeat."""
    commands: list[str | None] = list(table.columns.get("command", [None] * len(table)))
    tails = [f" --seed {seed}" for seed in table.texts("seed")]
    if all(command is None or command.endswith(tail) for command, tail in zip(commands, tails, strict=True)):
        short = [None if one is None else one.removesuffix(tail) for one, tail in zip(commands, tails, strict=True)]
        return {**_texts(short), "seeded": True}
    return _texts(commands)


def _number(value: Any) -> float | int | None:
    if value is None or not math.isfinite(value):
        return None
    if isinstance(value, int):
        return value
    rounded = float(f"{value:.{SIGNIFICANT}g}")
    return int(rounded) if rounded.is_integer() and abs(rounded) < 1e15 else rounded


def _title(name: str) -> str:
    if name in METRICS or name.endswith("_m"):
        return measure_title(name) if name in METRICS else f"{name.removesuffix('_m').replace('_', ' ')} [m]"
    return name.removeprefix("option.").replace("_", " ") if name.startswith("option.") else name.replace("_", " ")
