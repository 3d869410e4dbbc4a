"""Cost of driving without a map: extra time and length relative to the same drives with a map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from antdrive.runs.statistics.intervals import means_by_world
from antdrive.runs.statistics.run_table import DRIVEN, PLACE, SENSING, RunTable

TIME, LENGTH = "arrival_s", "driven_length_m"


class Ratio(NamedTuple):
    """Ratio of a quantity without the map to that with it, over all pairs."""

    mean: float  # geometric mean over the pairs
    low: float  # lower end of its 95 % interval, from a bootstrap over worlds, then pairs
    high: float  # upper end
    most: float  # largest ratio of a pair


@dataclass(frozen=True)
class Price:
    """Drives without a map compared with the same drives with it: same world, task, robot, settings, planner and seed.

    Attributes:
        planner: the planner's name in tables
        robot: the robot's name in tables
        localisation: localisation of the robot without the map
        odometry: factor on the errors of its odometry
        drives: number of drives without a map
        pairs: number of pairs in which both drives succeeded
        worlds: number of worlds of these pairs
        lost: number of pairs in which only the drive with the map succeeded
        won: number of pairs in which only the drive without it succeeded
        unpaired: number of drives without a map that lack a partner with it
        time: ratio of the arrival times
        length: ratio of the driven lengths
    """

    planner: str
    robot: str
    localisation: str
    odometry: float
    drives: int
    pairs: int
    worlds: int
    lost: int
    won: int
    unpaired: int
    time: Ratio
    length: Ratio

    @property
    def sentence(self) -> str:
        """The comparison in words."""
        who = f"{self.planner}, {self.robot}, {self.localisation} with errors x {self.odometry:g}"
        if not self.pairs:
            return f"Cost of driving without the map, {who}: no pair in which both drives arrived."
        parts = (
            f"{name} x {ratio.mean:.3f} ({ratio.low:.3f} to {ratio.high:.3f}; at most {ratio.most:.2f})"
            for name, ratio in (("time", self.time), ("length", self.length))
        )
        return (
            f"Cost of driving without the map, {who}: {', '.join(parts)}; geometric means of {self.pairs} pairs in "
            f"{self.worlds} worlds, 95 % intervals over worlds; arrived only with the map: {self.lost}, only without: {self.won}."
        )

    def as_dict(self) -> dict[str, Any]:
        """Return all fields as plain values; ratios without pairs are null."""
        fields = dataclasses.asdict(self)
        for name in ("time", "length"):
            ratio = getattr(self, name)._asdict()
            fields[name] = {key: value if math.isfinite(value) else None for key, value in ratio.items()}
        return fields


def prices(table: RunTable, *, any_robot: bool = False) -> list[Price]:
    """Return the cost for each planner, robot, localisation and odometry factor that has mapless drives."""
    if "map" not in table:
        return []
    left_out = {*SENSING, DRIVEN, *(("robot", "robot_hash") if any_robot else ())}
    same = (*PLACE, "planner", "seed", *(name for name in table.settings if name not in left_out))
    instances = list(zip(*(table.texts(name) for name in same), strict=True))
    maps = table.texts("map")
    known = {instance: k for k, (instance, kind) in enumerate(zip(instances, maps, strict=True)) if kind == "given"}
    groups: dict[tuple[str, ...], list[int]] = {}
    kinds = ("planner", "robot", "localisation", "odometry")
    for k, group in enumerate(zip(*(table.texts(name) for name in kinds), strict=True)):
        if maps[k] == "none":
            groups.setdefault(group, []).append(k)
    return [_price(table, rows, [known.get(instances[k], -1) for k in rows]) for rows in groups.values()]


def _price(table: RunTable, rows: list[int], partners: list[int]) -> Price:
    """Compare some drives without a map with their partners; -1 means none."""
    there = [k for k, partner in enumerate(partners) if partner >= 0]
    without, with_map = np.array([rows[k] for k in there], int), np.array([partners[k] for k in there], int)
    arrived, known = table.success[without], table.success[with_map]
    both = arrived & known
    world = table.codes("world")[without[both]]
    ratios = list(_ratios(table, without[both], with_map[both]))
    intervals = means_by_world(np.stack(ratios, axis=1), world) if both.any() else []
    time, length = [
        Ratio(*map(math.exp, (float(ratio.mean()), *interval, float(ratio.max()))))
        for ratio, interval in zip(ratios, intervals, strict=False)
    ] or [Ratio(*[math.nan] * 4)] * 2
    first = rows[0]
    return Price(
        planner=table.texts("planner")[first],
        robot=table.texts("robot")[first],
        localisation=table.texts("localisation")[first],
        odometry=float(table.numbers("odometry")[first]),
        drives=len(rows),
        pairs=int(both.sum()),
        worlds=len(np.unique(world)),
        lost=int((known & ~arrived).sum()),
        won=int((arrived & ~known).sum()),
        unpaired=len(rows) - len(there),
        time=time,
        length=length,
    )


def _ratios(table: RunTable, without: np.ndarray[Any, Any], with_map: np.ndarray[Any, Any]) -> Iterator[Any]:
    """Yield the logarithms of the ratios of times and of lengths, one for each pair."""
    for name in (TIME, LENGTH):
        values = table.numbers(name)
        yield np.log(values[without] / values[with_map])
