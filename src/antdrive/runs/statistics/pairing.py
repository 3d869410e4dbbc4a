"""Runs paired by world, task, settings and seed, to compare planners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.types import Flags, Floats, Ints
from antdrive.runs.statistics.run_table import OF_WORLDS, PLACE, RunTable
from antdrive.sim.log.metrics import WALL_CLOCK


@dataclass(frozen=True, eq=False)
class PairedRuns:
    """Runs by instance and planner. An instance is a world, a task, the settings of `RunTable.settings`, and a seed.

    Attributes:
        table: the runs
        planners: labels of the P planners, in the order of the table
        worlds: names of the W worlds
        world: index of each instance's world, (N,)
        setting_group: equal numbers for instances that differ only in the seed, (N,)
        row: row of each instance and planner in the table, (N, P); -1 if missing
        success: whether the run succeeded, (N, P)
        seeded: whether the seed changes any drive of the planner under the instance's settings, (N, P)
    """

    table: RunTable
    planners: tuple[str, ...]
    worlds: tuple[str, ...]
    world: Ints
    setting_group: Ints
    row: Ints
    success: Flags
    seeded: Flags

    @classmethod
    def of(cls, table: RunTable, planners: Sequence[str] = ()) -> PairedRuns:
        """Arrange the runs of a table, or of some planners in the given order."""
        table = table.of_planners(planners) if planners else table
        if not len(table):
            raise FieldError("runs", "none; the campaign has no finished runs")
        labels = table.texts("planner")
        planners = tuple(dict.fromkeys(planners or labels))
        column = np.array([planners.index(label) for label in labels])
        described = (*PLACE, *table.settings)
        instances, first, place = np.unique(_joint(table, (*described, "seed")), return_index=True, return_inverse=True)
        row = np.full((len(instances), len(planners)), -1, dtype=np.int64)
        row[place, column] = np.arange(len(table))
        if (row >= 0).sum() != len(table):
            twice = next(k for k in range(len(table)) if row[place[k], column[k]] != k)
            raise FieldError("runs", _twice(table, labels[twice]))
        names, world = _worlds(table)
        success = (row >= 0) & table.success[row]
        group = _joint(table, described)[first]
        setting = _joint(table, [name for name in table.settings if name not in OF_WORLDS])[first]
        seeded = _seeded(table, row, group, setting)
        return cls(table, planners, names, world[first], group, row, success, seeded)

    @property
    def present(self) -> Flags:
        """Whether the run exists, (N, P)."""
        return np.asarray(self.row >= 0)

    @property
    def shared(self) -> Flags:
        """The instances that every planner ran, (N,)."""
        return np.asarray(self.present.all(axis=1))

    def values(self, name: str) -> Floats:
        """Return a column of the table by instance and planner, (N, P); nan without success.

        Wall-clock times of a drive that repeats with every seed are the median of its repetitions.
        """
        values = np.where(self.success, self.table.numbers(name)[self.row], np.nan)
        return self._over_repetitions(values) if name in WALL_CLOCK else values

    def _over_repetitions(self, values: Floats) -> Floats:
        """Replace the values (N, P) of repeated drives by their median."""
        medians = values.copy()
        for k in range(len(self.planners)):
            places = np.flatnonzero(~self.seeded[:, k] & np.isfinite(values[:, k]))
            if not len(places):
                continue
            order = places[np.argsort(self.setting_group[places], kind="stable")]
            for same in np.split(order, np.flatnonzero(np.diff(self.setting_group[order])) + 1):
                medians[same, k] = np.median(values[same, k])
        return medians

    def worlds_in(self, mask: Flags) -> int:
        """Return the number of worlds among some instances."""
        return len(np.unique(self.world[mask]))

    def several_in_worlds(self, mask: Flags) -> bool:
        """Return whether some instances cover several worlds, one of them with several instances."""
        sizes = np.bincount(self.world[mask])
        return bool((sizes > 0).sum() > 1 and sizes.max() > 1)

    def counted(self, *planners: int, within: Flags | None = None) -> Flags:
        """Return the instances that all of these planners ran, each distinct drive once, (N,).

        Under settings in which the seed changes no drive of these planners, only the first seed counts: repetitions are no
        evidence.
        """
        chosen = list(planners)
        both: Flags = np.asarray(self.present[:, chosen].all(axis=1))
        if within is not None:
            both &= within
        places = np.flatnonzero(both & ~self.seeded[:, chosen].any(axis=1))
        repeated = np.ones(len(places), dtype=np.bool_)
        repeated[np.unique(self.setting_group[places], return_index=True)[1]] = False
        both[places[repeated]] = False
        return both


def _twice(table: RunTable, label: str) -> str:
    """Explain why a planner has two runs of one instance."""
    lacks = [name for name in ("robot_hash", "margin_asked") if name not in table]
    why = "one is needed to pair them"
    if lacks:
        why = f"the table lacks {' and '.join(lacks)}, which may distinguish them; repeat antdrive sweep to add them"
    return f"{label} has two runs of one world, task, settings and seed; {why}"


def _joint(table: RunTable, names: Sequence[str]) -> Ints:
    """Return equal numbers for runs that agree in all these columns, in the order of the columns."""
    joint = np.zeros(len(table), dtype=np.int64)
    for name in names:
        codes = _seeds(table) if name == "seed" else table.codes(name)
        joint = np.unique(joint * (int(codes.max()) + 1) + codes, return_inverse=True)[1].astype(np.int64)
    return joint


def _seeds(table: RunTable) -> Ints:
    """Return codes of the seeds in numerical order, so the smallest is the first."""
    return np.unique(table.numbers("seed"), return_inverse=True)[1].astype(np.int64)


def _worlds(table: RunTable) -> tuple[tuple[str, ...], Ints]:
    """Return the names of the worlds, and the index of each run's. Tasks in one world share it."""
    names, codes = np.unique(np.array(table.texts("world"), dtype=object), return_inverse=True)
    return tuple(names), codes.astype(np.int64)


def _seeded(table: RunTable, row: Ints, group: Ints, setting: Ints) -> Flags:
    """Return whether a planner's drives under one setting change with the seed, (N, P)."""
    seeded = np.ones(row.shape, dtype=np.bool_)
    if "drive_digest" not in table:
        return seeded
    marks = np.array([f"{a} {b}" for a, b in zip(table.texts("outcome"), table.texts("drive_digest"), strict=True)])
    marks = np.unique(marks, return_inverse=True)[1]
    for k, rows in enumerate(row.T):
        for one in np.unique(setting):
            here = (rows >= 0) & (setting == one)
            groups = len(np.unique(group[here]))
            different = np.unique(np.stack([group[here], marks[rows[here]]]), axis=1).shape[1]
            seeded[here, k] = different > groups
    return seeded
