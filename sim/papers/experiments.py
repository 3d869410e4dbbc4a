"""What each paper printed, and the trials that measure it again: a line per map and planner."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any

from antdrive.planners import Query
from antdrive.sim.papers import maps


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A planner on a map, several seeds, beside a printed figure. Lengths in cells."""

    paper: str
    place: str
    planner: str
    query: Callable[[int], Query]  # by seed; maps that are known are the same for all
    printed: float  # as the paper gives it
    options: Mapping[str, Any] = field(default_factory=dict)
    recreated: bool = True  # the paper's own map is known as a picture only
    what: str = "length"  # what is printed and measured: length or steps


def _same(query: Query) -> Callable[[int], Query]:
    return lambda seed: query


def _of_lee(number: int, rows: int, cols: int, seed: int) -> Query:
    return maps.blocks(rows, cols, 25, max(rows, cols) // 6, 100 * number + seed)


def han2007() -> list[Trial]:
    """Experiment 6 with ants, and the genetic algorithm around one obstacle."""
    ants, single = maps.han_ants(), maps.han_genes((10.0, 10.0, 5.0))
    walked = [
        Trial(paper="han2007", place=f"14 obstacles, {count} ants", planner="aco-han", options={"ants": count},
              query=_same(ants), printed=printed, recreated=False)
        for count, printed in ((10, 45.357), (100, 38.6223), (500, 36.237))
    ]  # fmt: skip
    bred = Trial(paper="han2007", place="one obstacle of radius 5, 3 via points", planner="ga-han",
                 options={"via_points": 3}, query=_same(single), printed=33.1798, recreated=False)  # fmt: skip
    return [*walked, bred]


def suganthi2019() -> list[Trial]:
    """Table 2: four sizes, three planners."""
    common = {"alpha": 1.0, "beta": 1.0, "evaporation": 0.3, "deposit": 1.0, "heuristic": "step", "iterations": 100}
    options: dict[str, dict[str, Any]] = {"as": {"ants": 50, **common}, "pfaco": {"ants": 50, "iterations": 100, "ranks": 15},
               "iaco": {"ants": 25, "explorers": 75, **common}}  # fmt: skip
    printed = {10: (13.899, 13.899, 13.899), 20: (28.627, 38.627, 28.627), 30: (46.527, 59.355, 42.184),
               50: (96.125, 109.761, 94.326)}  # fmt: skip
    return [
        Trial(paper="suganthi2019", place=f"{size}×{size}, 15 % blocked", planner=name, options=options[name], printed=value,
              query=partial(maps.scattered, size, 0.15))
        for size, values in printed.items() for name, value in zip(options, values, strict=True)
    ]  # fmt: skip


def ibraheem2016() -> list[Trial]:
    """Table 2: four sizes, ant system and ageing ants."""
    printed = {
        10: (5, 15.07, 15.07),
        20: (10, 28.6274, 28.6274),
        30: (15, 45.9411, 45.1127),
        40: (20, 62.6690, 61.8406),
    }
    return [
        Trial(paper="ibraheem2016", place=f"{size}×{size}, {count} obstacles", planner=name, printed=value,
              options={"ants": 50, "iterations": 100, "evaporation": 0.3},
              query=partial(maps.blocks, size, size, count, size // 4))
        for size, (count, *values) in printed.items() for name, value in zip(("as", "maco"), values, strict=True)
    ]  # fmt: skip


def lee2008() -> list[Trial]:
    """Tables I and II: five maps, ant system and potential field."""
    printed = {1: (25, 25, 72.0833, 59.2548), 2: (50, 44, 83.3970, 64.0833), 3: (100, 100, 154.2376, 123.6102),
               4: (100, 100, 175.2376, 135.8234), 5: (100, 100, 168.6518, 131.6812)}  # fmt: skip
    options: dict[str, dict[str, Any]] = {
        "as": {"ants": 500, "beta": 2.0, "evaporation": 0.01, "iterations": 100},
        "pfaco": {},
    }
    return [
        Trial(paper="lee2008", place=f"{number}: {rows}×{cols}", planner=name, options=options[name], printed=value,
              query=partial(_of_lee, number, rows, cols))
        for number, (rows, cols, *values) in printed.items() for name, value in zip(options, values, strict=True)
    ]  # fmt: skip


def hasan() -> list[Trial]:
    """Table 1: six environments that stand still; the paper prints steps."""
    printed = (65, 43, 49, 64, 91, 66)
    return [
        Trial(paper="hasan", place=name, planner="mmas-dstar", query=_same(query), printed=float(value), what="steps")
        for (name, query), value in zip(maps.environments().items(), printed, strict=True)
    ]


#: The trials of each paper.
PAPERS: Mapping[str, Callable[[], list[Trial]]] = MappingProxyType(
    {f.__name__: f for f in (han2007, suganthi2019, ibraheem2016, lee2008, hasan)}
)
