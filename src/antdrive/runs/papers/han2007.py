"""Experiments of Han's thesis (han2007)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from antdrive.planners import Query
from antdrive.runs.papers import maps
from antdrive.runs.papers.experiment import Experiment, Setting, for_every_seed

PRINTED = {10: 45.357, 100: 38.6223, 500: 36.237}  # Table 5.2.1: mean path length by number of ants
#: The thesis' program differs from its text: raw pheromone, Q = 5, at most 50 steps, no least weight.
PROGRAM = {"form": "listing", "deposit": 5.0, "max_steps": 50, "min_weight": 0.0}
#: An attraction that outweighs any pheromone; the other weights grow with it.
BLIND = {"attraction": 1e6, "min_weight": 1e3, "revisit": 10.0}
ELITE = {"elitism": 100}
GROUP = {"elite_of": "iteration"}
#: Readings of Table 5.2.1 by map, beside ours.
ON_LISTED: Mapping[str, Mapping[str, Any]] = {
    "50 steps": {"max_steps": 50},
    "100 steps": {"max_steps": 100},
    "dot product": {"form": "letter"},
    "elite": ELITE,
    "program": PROGRAM,
}
ON_SINGLE: Mapping[str, Mapping[str, Any]] = {
    "program": PROGRAM,
    "program, 100 steps": {**PROGRAM, "max_steps": 100},
    "program, 400 steps": {**PROGRAM, "max_steps": 400},
    "program, Q 1": {**PROGRAM, "deposit": 1.0},
    "program, Q 3": {**PROGRAM, "deposit": 3.0},
}
#: Arms whose times are compared, by map.
TIMED = {
    *(("14 obstacles", name) for name in ("100 ants", "500 ants", "4 via points")),
    *(("one obstacle of radius 1", name) for name in ("500 ants", "3 via points")),
}
#: Settings of experiments 4 and 5 that are also measured on cells instead of circles.
AS_CELLS = ("3 via points", "2 via points", "1 via point", *(f"3 via points, Pc 0, Pm {pm}" for pm in (0.2, 0.8)))


def han2007() -> list[Experiment]:
    """Return the experiments with ants, then those with the genetic algorithm.

    Ants move to any free neighbour of eight, as in the thesis, and lines keep clear of its circles.
    """
    every = [*_ants(), *_genes(), *_scattered()]
    return [dataclasses.replace(e, group="times") if (e.map, e.name) in TIMED else e for e in every]


def _ants() -> Iterator[Experiment]:
    """Yield section 5.2: Table 5.2.1 in each reading, with the printed means in ours alone, and the elites."""
    listed, single = (
        _as_written(maps.han_ants(circles=True)),
        _as_written(maps.han_ants((10.0, 10.0, 1.0), circles=True)),
    )
    yield from _arms(
        "14 obstacles", listed, "aco-han", [(f"{n} ants", mean, {"ants": n}) for n, mean in PRINTED.items()]
    )
    for name, options in ON_LISTED.items():
        yield from _arms("14 obstacles", listed, "aco-han", _table(name, options))
    hundred: Mapping[str, Mapping[str, Any]] = {
        "elite of the iteration": {**ELITE, **GROUP},
        "no pheromone": BLIND,
        "dot product, no pheromone": {"form": "letter", **BLIND},
        "alpha 0.1": {"attraction": 0.1},
        "alpha 10": {"attraction": 10.0},
        "no attraction": {"attraction": 0.0},
        "no attraction, 100 steps": {"attraction": 0.0, "max_steps": 100},
    }
    yield from _arms("14 obstacles", listed, "aco-han", [_ants_with(100, *one) for one in hundred.items()])
    yield from _arms("14 obstacles", listed, "aco-han", [_ants_with(500, "no pheromone", BLIND)])
    yield from _arms("14 obstacles, no corners cut", maps.han_ants(), "aco-han", _table())
    yield from _arms("one obstacle of radius 1", single, "aco-han", _table())
    for name, options in ON_SINGLE.items():
        yield from _arms("one obstacle of radius 1", single, "aco-han", _table(name, options))
    blind = _ants_with(500, "program, no pheromone", {**PROGRAM, "deposit": 1e-9})
    corners = maps.han_ants((10.0, 10.0, 1.0))
    yield from _arms("one obstacle of radius 1", single, "aco-han", [*_elites(), blind])
    yield from _arms("one obstacle of radius 1, no corners cut", corners, "aco-han", _table("program", PROGRAM))
    yield from _arms("no obstacle", _as_written(maps.han_ants(None)), "aco-han", [*_table()[2:], *_elites()])
    yield from _arms(
        "two walls of obstacles", _walls(), "aco-han", [_table()[1], _ants_with(100, "50 steps", {"max_steps": 50})]
    )


def _genes() -> Iterator[Experiment]:
    """Yield section 5.1 around one large obstacle, and the genetic algorithm and the hybrid on the ants' maps."""
    four: Setting = ("4 via points", None, {"via_points": 4, "mutation": 0.4})
    few: Setting = ("1 via point", None, {"via_points": 1, "tries": 20_000})
    for where, query in (
        ("14 obstacles", _as_written(maps.han_ants(circles=True))),
        ("two walls of obstacles", _walls()),
    ):
        yield from _arms(where, query, "ga-han", [four, few])
        yield from _arms(where, query, "hybrid", [("hybrid", None, {})])
    small = _as_written(maps.han_ants((10.0, 10.0, 1.0), circles=True))
    yield from _arms("one obstacle of radius 1", small, "ga-han", [("3 via points", None, {"via_points": 3})])
    large, cells = (maps.han_genes((10.0, 10.0, 5.0), circles=circles) for circles in (True, False))
    yield from _arms("one obstacle of radius 5", large, "ga-han", list(_rates()))
    as_cells = [setting for setting in _rates() if setting[0] in AS_CELLS]
    yield from _arms("one obstacle of radius 5, as cells", cells, "ga-han", as_cells)


def _rates() -> Iterator[Setting]:
    """Yield experiments 4 and 5; figure 5.1.9 varies Pc without mutation, figure 5.1.10 Pm without crossover."""
    yield "3 via points", 33.1798, {"via_points": 3}
    for n in (1, 2, 4):
        yield f"{n} via point{'s' * (n > 1)}", None, {"via_points": n}
    yield "3 via points, elite no parent", None, {"via_points": 3, "elite_breeds": False}
    yield "3 via points, Pc 0.5, Pm 0", None, {"via_points": 3, "crossover": 0.5, "mutation": 0.0}
    for pc, pm in ((0.25, 0.0), *((0.0, pm) for pm in (0.0, 0.2, 0.4, 0.6, 0.8))):
        for kept in (True, False):
            name = f"3 via points, Pc {pc:g}, Pm {pm:g}{'' if kept else ', no elite'}"
            yield name, None, {"via_points": 3, "crossover": pc, "mutation": pm, "elitism": kept}


def _scattered() -> Iterator[Experiment]:
    """Yield experiments 1 to 3 of section 5.1 on placements that section 3 allows, another for each seed."""
    kinds: dict[str, tuple[int, bool | None]] = {
        "two circles beside the line": (2, False),
        "two circles on the line": (2, True),
        "nine circles": (9, None),
    }
    ten: dict[str, Any] = {"iterations": 10}
    four: dict[str, Any] = {"via_points": 4, "mutation": 0.4}
    for where, (count, across) in kinds.items():

        def query(seed: int, count: int = count, across: bool | None = across) -> Query:
            return _as_written(maps.han_genes(*maps.han_scattered(count, seed, across), circles=True))

        arms: dict[str, Mapping[str, Any]] = {"ga-han": {}}
        if count == 9:
            arms |= {"ga-han, 4 via points": four, "ga-han, 4 via points, 10 generations": {**four, **ten}}
            arms |= {"ga-han, 1 via point": {"via_points": 1}}
        else:
            arms |= {"ga-han, 10 generations": ten}
        for name, options in arms.items():
            yield _experiment(where, query, "ga-han", (name, None, {**options}), worlds=0)
        yield _experiment(where, query, "aco-han", _ants_with(100, "", {}), worlds=0)


def _as_written(query: Query) -> Query:
    """Return a query with the thesis' moves, to any free neighbour of eight (section 4.2 i)."""
    return maps.cutting_corners(query)


def _walls() -> Query:
    return _as_written(maps.han_genes(*maps.TWO_WALLS, circles=True))


def _ants_with(ants: int, name: str, options: Mapping[str, Any]) -> Setting:
    return f"{ants} ants{', ' * bool(name)}{name}", None, {"ants": ants, **options}


def _table(name: str = "", options: Mapping[str, Any] | None = None) -> list[Setting]:
    return [_ants_with(n, name, options or {}) for n in PRINTED]


def _elites() -> list[Setting]:
    group = [_ants_with(500, f"elite of the iteration, e {e}", {"elitism": e, **GROUP}) for e in (1, 100)]
    return [_ants_with(500, "elite", ELITE), *group]


def _arms(where: str, query: Query, planner: str, settings: list[Setting]) -> list[Experiment]:
    return [_experiment(where, for_every_seed(query), planner, setting) for setting in settings]


def _experiment(
    where: str, query: Callable[[int], Query], planner: str, setting: Setting, worlds: int = 1
) -> Experiment:
    label, printed, options = setting
    return Experiment(
        paper="han2007",
        map=where,
        planner=planner,
        label=label,
        options=options,
        query=query,
        printed=printed,
        recreated=not worlds,
        worlds=worlds,
    )
