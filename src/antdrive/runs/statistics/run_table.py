"""Table of campaigns' runs as columns: selection by `--where COLUMN=VALUE`, and merging."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError, few
from antdrive.base.types import Flags, Floats
from antdrive.sim.forms import USUAL_CONTROLLER
from antdrive.sim.settings import SETTING_COLUMNS, SETTINGS

LISTED = 20  # most values listed in an error
NONE = "none"  # represents a missing value


def column_named(names: Iterable[str], column: str) -> str:
    """Return the full name of a column."""
    known = list(names)
    for name in (column, f"option.{column}"):
        if name in known:
            return name
    raise FieldError(column, f"no such column; choose from {', '.join(known)}")


def places_of(column: str, values: Sequence[Any], wanted: str) -> list[int]:
    """Return the rows that match a selection, at least one."""
    rows = matching(values, wanted)
    if not rows:
        raise FieldError(column, f"no run with {wanted!r}; the campaign has {described(values)}")
    return rows


def matching(values: Sequence[Any], wanted: str) -> list[int]:
    """Return the rows that match a selection."""
    whole = [k for k, value in enumerate(values) if _text(value) == wanted]
    if whole:  # a name may contain a comma
        return whole
    tests = [_range(part) or part for part in wanted.split(",")]
    return [k for k, value in enumerate(values) if any(_fits(value, test) for test in tests)]


def described(values: Sequence[Any]) -> str:
    """Summarise the values of a column."""
    different = list(dict.fromkeys(values))
    numbers = [value for value in different if isinstance(value, int | float) and not isinstance(value, bool)]
    if len(numbers) > LISTED:
        return f"{min(numbers):g} to {max(numbers):g}"
    texts = [f"{value:g}" if isinstance(value, float) else _text(value) or NONE for value in different]
    return few(texts, LISTED)


def _text(value: Any) -> str:
    return "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _range(text: str) -> tuple[float, float] | None:
    """Return the ends of a range such as "10..20", or None."""
    match = re.fullmatch(r"(.*?)\.\.(.*)", text)
    if match is None or not (match[1] or match[2]):
        return None
    try:
        return float(match[1] or -math.inf), float(match[2] or math.inf)
    except ValueError:
        return None


def _fits(value: Any, test: str | tuple[float, float]) -> bool:
    if isinstance(test, tuple):
        return isinstance(value, int | float) and not isinstance(value, bool) and test[0] <= value <= test[1]
    text = _text(value)
    if text == test or (isinstance(value, bool) and text == test.lower()) or (test == NONE and not text):
        return True
    try:
        return not isinstance(value, bool) and float(text) == float(test)
    except ValueError:
        return False


#: Columns of the place of a run.
PLACE = ("world", "world_hash", "task")
#: Columns of a run's configuration besides planner and place. A table may lack some.
CONFIGURATION = ("robot", "robot_hash", *(name for name in SETTING_COLUMNS if name != "seed"))
#: Columns of the robot's knowledge of the world and of its pose.
SENSING = tuple(one.column for one in SETTINGS.values() if one.setting.group == "Sensing")
#: The margin as requested, such as "auto", and the one used: runs are paired by the first.
ASKED, DRIVEN = "margin_asked", "margin"
#: A world's own cell size is not a setting of the campaign, so it does not separate seeds.
OF_WORLDS = ("cell",)
#: Hashes distinguish equal names; pages show the names.
HASHES = ("world_hash", "robot_hash")


REQUIRED = ("world", "planner", "seed", "outcome", "succeeded")


@dataclass(frozen=True, eq=False)
class RunTable:
    """The runs of a campaign, a row each."""

    # each column's values by run, None if missing; `REQUIRED` columns must exist
    columns: Mapping[str, Sequence[Any]]

    def __post_init__(self) -> None:
        missing = [name for name in REQUIRED if name not in self.columns]
        if missing:
            raise FieldError(missing[0], "missing; a campaign's table has this column")
        if len({len(values) for values in self.columns.values()}) > 1:
            raise FieldError("columns", "must have the same length")

    def __len__(self) -> int:
        return len(self.columns["planner"])

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    @property
    def settings(self) -> tuple[str, ...]:
        """The columns of a run's settings; of the two margins only the requested one."""
        return tuple(
            name for name in CONFIGURATION if name in self.columns and not (name == DRIVEN and ASKED in self.columns)
        )

    def texts(self, name: str) -> list[str]:
        """Return a column as text; empty for missing values."""
        return ["" if value is None else str(value) for value in self.columns.get(name, [None] * len(self))]

    def worded(self, name: str) -> bool:
        """Return whether a column holds text."""
        return any(isinstance(value, str) for value in self.columns.get(name, ()))

    def numbers(self, name: str) -> Floats:
        """Return a column as numbers, (N,); nan for missing values."""
        values = self.columns.get(name, [None] * len(self))
        return np.array([value if isinstance(value, int | float) else np.nan for value in values], dtype=float)

    @property
    def success(self) -> Flags:
        """Whether each run reached the goal and is certified, (N,); false for a crashed run."""
        done = np.array([value is True for value in self.columns["succeeded"]])
        if "certified" in self.columns:
            done &= np.array([value is not False for value in self.columns["certified"]])
        return done

    def where(self, column: str, value: str) -> RunTable:
        """Return the runs that match a selection in a column."""
        return self.take(places_of(column, self.columns[column_named(self.columns, column)], value))

    def of_planners(self, labels: Sequence[str]) -> RunTable:
        """Return the runs of some planners."""
        mine = self.texts("planner")
        for label in labels:
            if label not in mine:
                raise FieldError("planner", f"unknown {label!r}; the campaign has {', '.join(dict.fromkeys(mine))}")
        return self.take([k for k, label in enumerate(mine) if label in labels])

    def by_controller(self) -> RunTable:
        """Return the runs with their controllers in the planners' labels, as "astar with dwa", if there are several."""
        followers = [USUAL_CONTROLLER if name in ("", "default") else name for name in self.texts("controller")]
        if len(set(followers)) < 2:
            return self
        labels = [f"{planner} with {name}" for planner, name in zip(self.texts("planner"), followers, strict=True)]
        others = {name: values for name, values in self.columns.items() if name != "controller"}
        return RunTable({**others, "planner": labels})

    def take(self, rows: Sequence[int]) -> RunTable:
        """Return some of the runs."""
        return RunTable({name: [values[k] for k in rows] for name, values in self.columns.items()})

    def codes(self, name: str) -> npt.NDArray[np.int64]:
        """Return equal numbers for runs with equal texts in a column, (N,)."""
        return np.unique(np.array(self.texts(name), dtype=object), return_inverse=True)[1].astype(np.int64)


FOLDER = "folder"  # column with the campaign's name


def merged(tables: Mapping[str, RunTable]) -> RunTable:
    """Merge the runs of several campaigns into one table, with the column `folder`.

    If two campaigns have a run of the same planner and instance, they become separate planners: "astar @today".
    """
    if len(tables) == 1:
        return next(iter(tables.values()))
    _validate(tables)
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


def _validate(tables: Mapping[str, RunTable]) -> None:
    described = (*PLACE, *CONFIGURATION)
    every = [name for name in described if any(name in table for table in tables.values())]
    for folder, table in tables.items():
        lacks = [name for name in every if name not in table]
        if lacks:
            raise FieldError(
                folder,
                f"its table lacks {', '.join(lacks)}, which the others have; repeat its antdrive sweep to add them",
            )


def _in_several(table: RunTable, folders: list[str]) -> set[str]:
    """Return the planners with runs of one instance in two folders."""
    described = [name for name in (*PLACE, *CONFIGURATION, "seed", "planner") if name in table]
    if ASKED in described:
        described.remove(DRIVEN)
    first: dict[tuple[str, ...], str] = {}
    labels = table.texts("planner")
    return {
        label
        for label, folder, *instance in zip(labels, folders, *map(table.texts, described), strict=True)
        if first.setdefault(tuple(instance), folder) != folder
    }
