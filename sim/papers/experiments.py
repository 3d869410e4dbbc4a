"""The experiments of each paper with the values that it prints, one experiment per map and planner."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

from antdrive.planners import Query
from antdrive.sim.papers import maps


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """One planner on one map, to be run with several seeds, and the value that the paper prints.

    Attributes:
        paper: the paper's short name
        map: the map in words
        planner: the planner's name
        query: gives the map with start and goal for a seed; a map that the paper specifies is the same for
            every seed
        printed: the paper's value; lengths in cells
        options: the planner's parameters
        recreated: the paper shows its map as a picture only; a random map of the same size and kind takes its
            place
        quantity: the value that is printed and measured: `length` or `steps`
    """

    paper: str
    map: str
    planner: str
    query: Callable[[int], Query]
    printed: float
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    recreated: bool = True
    quantity: str = "length"


def _for_every_seed(query: Query) -> Callable[[int], Query]:
    return lambda seed: query


def _lee_map(number: int, rows: int, cols: int, seed: int) -> Query:
    return maps.blocks(rows, cols, 25, max(rows, cols) // 6, 100 * number + seed)


def han2007() -> list[Experiment]:
    """Experiment 6 with ants, and the genetic algorithm around one obstacle."""
    ants, single = maps.han_ants(), maps.han_genes((10.0, 10.0, 5.0))
    with_ants = [
        Experiment(
            paper="han2007",
            map=f"14 obstacles, {count} ants",
            planner="aco-han",
            options={"ants": count},
            query=_for_every_seed(ants),
            printed=printed,
            recreated=False,
        )
        for count, printed in ((10, 45.357), (100, 38.6223), (500, 36.237))
    ]
    with_genes = Experiment(
        paper="han2007",
        map="one obstacle of radius 5, 3 via points",
        planner="ga-han",
        options={"via_points": 3},
        query=_for_every_seed(single),
        printed=33.1798,
        recreated=False,
    )
    return [*with_ants, with_genes]


def suganthi2019() -> list[Experiment]:
    """Table 2: four sizes, three planners."""
    common = {
        "alpha": 1.0,
        "beta": 1.0,
        "evaporation": 0.3,
        "deposit": 1.0,
        "heuristic": "step",
        "iterations": 100,
    }
    options: dict[str, dict[str, Any]] = {
        "as": {"ants": 50, **common},
        "pfaco": {"ants": 50, "iterations": 100, "ranks": 15},
        "iaco": {"ants": 25, "explorers": 75, **common},
    }
    printed = {
        10: (13.899, 13.899, 13.899),
        20: (28.627, 38.627, 28.627),
        30: (46.527, 59.355, 42.184),
        50: (96.125, 109.761, 94.326),
    }
    return [
        Experiment(
            paper="suganthi2019",
            map=f"{size}×{size}, 15 % blocked",
            planner=name,
            options=options[name],
            printed=value,
            query=partial(maps.scattered, size, 0.15),
        )
        for size, values in printed.items()
        for name, value in zip(options, values, strict=True)
    ]


def ibraheem2016() -> list[Experiment]:
    """Table 2: four sizes, ant system and ageing ants."""
    printed = {
        10: (5, 15.07, 15.07),
        20: (10, 28.6274, 28.6274),
        30: (15, 45.9411, 45.1127),
        40: (20, 62.6690, 61.8406),
    }
    return [
        Experiment(
            paper="ibraheem2016",
            map=f"{size}×{size}, {count} obstacles",
            planner=name,
            printed=value,
            options={"ants": 50, "iterations": 100, "evaporation": 0.3},
            query=partial(maps.blocks, size, size, count, size // 4),
        )
        for size, (count, *values) in printed.items()
        for name, value in zip(("as", "maco"), values, strict=True)
    ]


def lee2008() -> list[Experiment]:
    """Tables I and II: five maps, ant system and ants on a potential field."""
    printed = {
        1: (25, 25, 72.0833, 59.2548),
        2: (50, 44, 83.3970, 64.0833),
        3: (100, 100, 154.2376, 123.6102),
        4: (100, 100, 175.2376, 135.8234),
        5: (100, 100, 168.6518, 131.6812),
    }
    options: dict[str, dict[str, Any]] = {
        "as": {"ants": 500, "beta": 2.0, "evaporation": 0.01, "iterations": 100},
        "pfaco": {},
    }
    return [
        Experiment(
            paper="lee2008",
            map=f"{number}: {rows}×{cols}",
            planner=name,
            options=options[name],
            printed=value,
            query=partial(_lee_map, number, rows, cols),
        )
        for number, (rows, cols, *values) in printed.items()
        for name, value in zip(options, values, strict=True)
    ]


def hasan() -> list[Experiment]:
    """Table 1: six environments without moving obstacles; the paper prints steps."""
    printed = (65, 43, 49, 64, 91, 66)
    return [
        Experiment(
            paper="hasan",
            map=name,
            planner="mmas-dstar",
            query=_for_every_seed(query),
            printed=float(value),
            quantity="steps",
        )
        for (name, query), value in zip(maps.environments().items(), printed, strict=True)
    ]


#: By the short name of each paper, a function that lists its experiments.
PAPERS: Mapping[str, Callable[[], list[Experiment]]] = MappingProxyType(
    {f.__name__: f for f in (han2007, suganthi2019, ibraheem2016, lee2008, hasan)}
)
