"""Tables of several campaigns as one, so that their planners can be compared."""

from __future__ import annotations

from collections.abc import Mapping

from antdrive.base.errors import FieldError
from antdrive.runs.statistics.columns import ASKED, DRIVEN, PLACE, SETTINGS
from antdrive.runs.statistics.runs import RunTable

FOLDER = "folder"  # the column that names the campaign


def merged(tables: Mapping[str, RunTable]) -> RunTable:
    """The runs of several campaigns in one table, with the column `folder`.

    A planner of which two campaigns have a run of the same instance is a planner of its own in each: "astar @today".

    Raises:
        FieldError: the tables describe runs by different columns.
    """
    if len(tables) == 1:
        return next(iter(tables.values()))
    _check(tables)
    names = list(dict.fromkeys(name for table in tables.values() for name in table.columns))
    columns = {
        name: [value for table in tables.values() for value in table.columns.get(name, [None] * len(table))]
        for name in names
    }
    folders = [name for name, table in tables.items() for _ in range(len(table))]
    several = _in_several(RunTable(columns), folders)
    columns["planner"] = [
        f"{label} @{folder}" if label in several else label
        for label, folder in zip(columns["planner"], folders, strict=True)
    ]
    return RunTable({**columns, FOLDER: folders})


def _check(tables: Mapping[str, RunTable]) -> None:
    described = (*PLACE, *SETTINGS)
    every = [name for name in described if any(name in table for table in tables.values())]
    for folder, table in tables.items():
        lacks = [name for name in every if name not in table]
        if lacks:
            raise FieldError(
                folder,
                f"its table lacks {', '.join(lacks)}, which the others have; antdrive sweep of its campaign adds them",
            )


def _in_several(table: RunTable, folders: list[str]) -> set[str]:
    """Labels of planners of which two folders have a run of one instance."""
    described = [name for name in (*PLACE, *SETTINGS, "seed", "planner") if name in table]
    if ASKED in described:
        described.remove(DRIVEN)
    first: dict[tuple[str, ...], str] = {}
    labels = table.texts("planner")
    return {
        label
        for label, folder, *instance in zip(labels, folders, *map(table.texts, described), strict=True)
        if first.setdefault(tuple(instance), folder) != folder
    }
