"""The table of a campaign's runs as columns, however it was stored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.types import Flags, Floats
from antdrive.runs.statistics.selecting import column_named, places_of
from antdrive.sim.settings import SETTING_COLUMNS
from antdrive.sim.settings import SETTINGS as DECLARED

#: Where a run took place.
PLACE = ("world", "world_hash", "task")
#: The rest of what a run is, besides planner and seed. A table may lack some of them.
SETTINGS = ("robot", "robot_hash", *(name for name in SETTING_COLUMNS if name != "seed"))
#: What a robot knows of the world and of its pose.
SENSING = tuple(one.column for one in DECLARED.values() if one.setting.group == "Sensing")
#: The margin as the campaign asks for it, such as "auto", and the one that was driven with: runs are paired by the first.
ASKED, DRIVEN = "margin_asked", "margin"
#: A world's own cell size is no setting of the campaign, so that seeds are not judged apart for each size.
OF_WORLDS = ("cell",)
#: Hashes tell what equal names hide; pages show the names.
HASHES = ("world_hash", "robot_hash")
#: Columns that differ between repetitions of one drive: their median over repetitions is taken.
WALL_TIMES = ("plan_s", "drive_wall_s")


REQUIRED = ("world", "planner", "seed", "outcome", "succeeded")


@dataclass(frozen=True, eq=False)
class RunTable:
    """The runs of a campaign, a row each."""

    # by name the value of each run, None where it has none; `REQUIRED` names those that must be there
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
        """The columns that say what a run is, besides place, planner and seed: of two margins the one that was asked for."""
        return tuple(
            name for name in SETTINGS if name in self.columns and not (name == DRIVEN and ASKED in self.columns)
        )

    def texts(self, name: str) -> list[str]:
        """A column as text; empty where there is no value."""
        return ["" if value is None else str(value) for value in self.columns.get(name, [None] * len(self))]

    def numbers(self, name: str) -> Floats:
        """A column as numbers, (N,); nan where there is none."""
        values = self.columns.get(name, [None] * len(self))
        return np.array([value if isinstance(value, int | float) else np.nan for value in values], dtype=float)

    @property
    def success(self) -> Flags:
        """Whether each run reached the goal and is certified, (N,). A run that crashed did not."""
        done = np.array([value is True for value in self.columns["succeeded"]])
        if "certified" in self.columns:
            done &= np.array([value is not False for value in self.columns["certified"]])
        return done

    def where(self, column: str, value: str) -> RunTable:
        """The runs with some values in a column.

        Raises:
            FieldError: no such column, or no run with this value.
        """
        return self.take(places_of(column, self.columns[column_named(self.columns, column)], value))

    def of_planners(self, labels: Sequence[str]) -> RunTable:
        """The runs of some planners.

        Raises:
            FieldError: no such planner among the runs.
        """
        mine = self.texts("planner")
        for label in labels:
            if label not in mine:
                raise FieldError("planner", f"unknown {label!r}; the campaign has {', '.join(dict.fromkeys(mine))}")
        return self.take([k for k, label in enumerate(mine) if label in labels])

    def take(self, rows: Sequence[int]) -> RunTable:
        """Some of the runs."""
        return RunTable({name: [values[k] for k in rows] for name, values in self.columns.items()})

    def codes(self, name: str) -> npt.NDArray[np.int64]:
        """Equal numbers for runs with equal texts in a column, (N,)."""
        return np.unique(np.array(self.texts(name), dtype=object), return_inverse=True)[1].astype(np.int64)
