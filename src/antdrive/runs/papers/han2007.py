"""Experiments of Han's thesis (han2007)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
FEW = {"via_points": 1, "tries": 20_000}
#: Settings of experiments 4 and 5 that are also measured on cells instead of circles.
AS_CELLS = ("3 via points", "2 via points", "1 via point", *(f"3 via points, Pc 0, Pm {pm}" for pm in (0.2, 0.8)))


def han2007() -> list[Experiment]:
    """Return the experiments with ants, then those with the genetic algorithm.

    Ants move to any free neighbour of eight, as in the thesis, and lines keep clear of its circles.
    """
    return [Experiment(paper="han2007", **arm) for arm in (*_ants(), *_genes(), *_scattered())]


def _ants() -> Iterator[dict[str, Any]]:
    """Yield section 5.2: Table 5.2.1 in each reading, with the printed means in ours alone, and the elites."""
    listed, single = _as_written(maps.han_ants(circles=True)), _as_written(maps.han_ants((10.0, 10.0, 1.0), circles=True))
    table = [(f"{n} ants", mean, {"ants": n}) for n, mean in PRINTED.items()]
    unprinted = [(name, None, options) for name, _, options in table]
    yield from _arms("14 obstacles", listed, "aco-han", table)
    for name, options in {
        "50 steps": {"max_steps": 50},
        "100 steps": {"max_steps": 100},
        "dot product": {"form": "letter"},
        "elite": ELITE,
        "elite of the iteration": {**ELITE, "elite_of": "iteration"},
        "program": PROGRAM,
    }.items():
        yield from _arms("14 obstacles", listed, "aco-han", _varied(name, options))
    blind = [(f"{n} ants, no pheromone", None, {"ants": n, **BLIND}) for n in (100, 500)]
    lost: Setting = ("100 ants, no attraction", None, {"ants": 100, "attraction": 0.0})
    short: Setting = (f"{lost[0]}, 100 steps", None, {**lost[2], "max_steps": 100})
    alphas = [(f"100 ants, alpha {alpha:g}", None, {"ants": 100, "attraction": alpha}) for alpha in (0.1, 10.0)]
    yield from _arms("14 obstacles", listed, "aco-han", [*blind, *alphas, lost, short])
    yield from _arms("14 obstacles, no corners cut", maps.han_ants(), "aco-han", unprinted)
    yield from _arms("one obstacle of radius 1", single, "aco-han", unprinted)
    for name, options in {
        "program": PROGRAM,
        "program, 100 steps": {**PROGRAM, "max_steps": 100},
        "program, 400 steps": {**PROGRAM, "max_steps": 400},
        "program, Q 1": {**PROGRAM, "deposit": 1.0},
        "program, Q 3": {**PROGRAM, "deposit": 3.0},
    }.items():
        yield from _arms("one obstacle of radius 1", single, "aco-han", _varied(name, options))
    blind_program: Setting = (
        "500 ants, program, no pheromone",
        None,
        {"ants": 500, **PROGRAM, "deposit": 1e-9},
    )
    elites = [elite for elite in _varied("elite", ELITE) if elite[2]["ants"] == 500]
    elites += [
        (f"500 ants, elite of the iteration, e {e}", None, {"ants": 500, "elitism": e, "elite_of": "iteration"})
        for e in (1, 100)
    ]
    yield from _arms("one obstacle of radius 1", single, "aco-han", [*elites, blind_program])
    corners = maps.han_ants((10.0, 10.0, 1.0))
    yield from _arms("one obstacle of radius 1, no corners cut", corners, "aco-han", _varied("program", PROGRAM))
    none = _as_written(maps.han_ants(None))
    yield from _arms("no obstacle", none, "aco-han", [unprinted[-1], *elites])
    walls = _as_written(maps.han_genes(*maps.TWO_WALLS, circles=True))
    yield from _arms("two walls of obstacles", walls, "aco-han", [*unprinted[:2], _varied("50 steps", {"max_steps": 50})[1]])


def _genes() -> Iterator[dict[str, Any]]:
    """Yield section 5.1 around one large obstacle, and the genetic algorithm and the hybrid on the ants' maps."""
    four: Setting = ("4 via points", None, {"via_points": 4, "mutation": 0.4})
    single: Setting = ("1 via point", None, FEW)
    listed = _as_written(maps.han_ants(circles=True))
    walls = _as_written(maps.han_genes(*maps.TWO_WALLS, circles=True))
    yield from _arms("14 obstacles", listed, "ga-han", [four, single])
    yield from _arms("14 obstacles", listed, "hybrid", [("hybrid", None, {})])
    yield from _arms("two walls of obstacles", walls, "ga-han", [single, four])
    yield from _arms("two walls of obstacles", walls, "hybrid", [("hybrid", None, {})])
    small = _as_written(maps.han_ants((10.0, 10.0, 1.0), circles=True))
    yield from _arms("one obstacle of radius 1", small, "ga-han", [("3 via points", None, {"via_points": 3})])
    large = maps.han_genes((10.0, 10.0, 5.0), circles=True)
    cells = maps.han_genes((10.0, 10.0, 5.0))
    yield from _arms("one obstacle of radius 5", large, "ga-han", list(_rates()))
    yield from _arms("one obstacle of radius 5, as cells", cells, "ga-han", [r for r in _rates() if r[0] in AS_CELLS])


def _rates() -> Iterator[Setting]:
    """Yield experiments 4 and 5; figure 5.1.9 varies Pc without mutation, figure 5.1.10 Pm without crossover."""
    yield "3 via points", 33.1798, {"via_points": 3}
    for n in (1, 2, 4):
        yield f"{n} via point{'s' * (n > 1)}", None, {"via_points": n}
    yield "3 via points, elite no parent", None, {"via_points": 3, "elite_breeds": False}
    rates = [(0.0, pm) for pm in (0.0, 0.2, 0.4, 0.6, 0.8)] + [(0.25, 0.0), (0.5, 0.0)]
    for pc, pm in rates:
        for kept in (True, False):
            name = f"3 via points, Pc {pc:g}, Pm {pm:g}{'' if kept else ', no elite'}"
            yield name, None, {"via_points": 3, "crossover": pc, "mutation": pm, "elitism": kept}


def _scattered() -> Iterator[dict[str, Any]]:
    """Yield experiments 1 to 3 of section 5.1 on placements that section 3 allows, another for each seed."""
    kinds: dict[str, tuple[int, bool | None]] = {
        "two circles beside the line": (2, False),
        "two circles on the line": (2, True),
        "nine circles": (9, None),
    }
    three: dict[str, Any] = {"via_points": 3, "mutation": 0.2}
    four: dict[str, Any] = {"via_points": 4, "mutation": 0.4}
    for where, (count, across) in kinds.items():

        def query(seed: int, count: int = count, across: bool | None = across) -> Query:
            return _as_written(maps.han_genes(*maps.han_scattered(count, seed, across), circles=True))

        settings = [("ga-han, 10 generations", {**three, "iterations": 10}), ("ga-han", three)]
        if count == 9:
            settings += [("ga-han, 4 via points, 10 generations", {**four, "iterations": 10})]
            settings += [("ga-han, 4 via points", four), ("ga-han, 1 via point", {**three, "via_points": 1})]
        arms = [("ga-han", name, options) for name, options in settings]
        for planner, name, options in (*arms, ("aco-han", "100 ants", {"ants": 100})):
            yield {**_arm(where, query, planner, (name, None, options)), "recreated": True, "worlds": 0}


def _as_written(query: Query) -> Query:
    """Return a query with the thesis' moves: "one of its 8 neighbor locations" (section 4.2 i), free or not beside it."""
    return maps.cutting_corners(query)


def _varied(name: str, options: dict[str, Any]) -> list[Setting]:
    return [(f"{n} ants, {name}", None, {"ants": n, **options}) for n in PRINTED]


def _arms(where: str, query: Query, planner: str, settings: list[Setting]) -> list[dict[str, Any]]:
    return [_arm(where, for_every_seed(query), planner, setting) for setting in settings]


def _arm(where: str, query: Callable[[int], Query], planner: str, setting: Setting) -> dict[str, Any]:
    label, printed, options = setting
    named = {"map": where, "query": query, "planner": planner, "label": label}
    return {**named, "options": options, "printed": printed, "recreated": False}
