"""The papers' claims: each row of `claims.csv` is one sentence that an experiment can refute, and the test that decides it."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

#: The margin of "no longer than" [points]: A = 0.56, where a small effect begins (Vargha & Delaney 2000), is 56 : 44.
SMALL_EFFECT = 12.0


class Arm(NamedTuple):
    """One experiment of a paper: a map's name, and the planner's with its setting."""

    map: str
    name: str


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of a paper, and the test that decides it: `statistic` `relation` `bound`.

    The statistics of `antdrive.runs.papers.verdicts` are of three kinds. One bounds a single planner, one compares two planners
    seed by seed, and one counts the maps on which the first planner is below the second. Some take more than one quantity.
    """

    paper: str
    source: str  # section, table or figure
    sentence: str
    reading: str = "ours"  # how the planner is read where that is not our default
    printed: str  # the paper's figures
    statistic: str  # a key of `STATISTICS`
    quantity: tuple[str, ...] = ("gap",)  # properties of `Trial`; a second one is that of the second planner
    relation: str  # a key of `RELATIONS`
    bound: float
    cases: tuple[tuple[Arm, ...], ...]  # on each map the planners that are measured together
    remark: str = ""  # what the figures do not say, and which margins and thresholds are ours, as the paper prints none

    @property
    def arms(self) -> frozenset[Arm]:
        """The experiments that the test needs."""
        return frozenset(arm for case in self.cases for arm in case)


def _claim(row: dict[str, str]) -> Claim:
    maps, planners = _listed(row.pop("maps")), _listed(row.pop("planners"))
    quantity, bound = _listed(row.pop("quantity")), float(row.pop("bound"))
    cases = tuple(tuple(Arm(name, planner) for planner in planners) for name in maps)
    return Claim(**row, quantity=quantity, bound=bound, cases=cases)


def _listed(cell: str) -> tuple[str, ...]:
    return tuple(cell.split(" | "))


def _claims() -> tuple[Claim, ...]:
    with Path(__file__).with_suffix(".csv").open(newline="", encoding="utf-8") as file:
        return tuple(_claim(row) for row in csv.DictReader(file))


#: All claims, in the order of the papers.
CLAIMS = _claims()
