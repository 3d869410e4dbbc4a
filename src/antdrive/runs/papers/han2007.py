"""Experiments of Han's thesis (han2007)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from antdrive.planners import Query
from antdrive.runs.papers import maps
from antdrive.runs.papers.experiment import Experiment, Setting, for_every_seed


def han2007() -> list[Experiment]:
    """Return experiment 6 with ants, elites on simple maps, and the genetic algorithm around one large obstacle."""
    printed = ((10, 45.357), (100, 38.6223), (500, 36.237))
    table: list[Setting] = [(f"{n} ants", mean, {"ants": n}) for n, mean in printed]
    # Section 5.2 prints no means for these; its program runs 500 ants.
    plain: list[Setting] = [(f"{n} ants", None, {"ants": n}) for n, _ in printed]
    few: Setting = ("100 ants, elite", None, {"ants": 100, "elitism": 100})
    elite: Setting = ("500 ants, elite", None, {"ants": 500, "elitism": 100})
    single: Setting = ("1 via point", None, {"via_points": 1, "tries": 20_000})
    listed = maps.han_ants()
    return [
        *_han_experiments("14 obstacles", listed, "aco-han", [*table, few]),
        *_han_experiments("one obstacle of radius 1", maps.han_ants((10.0, 10.0, 1.0)), "aco-han", [*plain, elite]),
        *_han_experiments("no obstacle", maps.han_ants(None), "aco-han", [plain[-1], elite]),
        *_han_experiments(
            "14 obstacles", listed, "ga-han", [("4 via points", None, {"via_points": 4, "mutation": 0.4}), single]
        ),
        *_han_experiments("two walls of obstacles", maps.han_genes(*maps.TWO_WALLS), "ga-han", [single]),
        *_han_experiments(
            "one obstacle of radius 5", maps.han_genes((10.0, 10.0, 5.0)), "ga-han", list(_han_via_points())
        ),
    ]


def _han_via_points() -> Iterator[Setting]:
    """Yield experiments 4 and 5; figure 5.1.9 varies Pc without mutation, figure 5.1.10 Pm without crossover."""
    yield "3 via points", 33.1798, {"via_points": 3}
    yield "2 via points", None, {"via_points": 2}
    yield "1 via point", None, {"via_points": 1}
    yield "3 via points, no elite", None, {"via_points": 3, "elitism": False}
    rates = ((0.0, 0.2, (True, False)), (0.0, 0.8, (True, False)), (0.25, 0.0, (True, False)), (0.5, 0.0, (True,)))
    for pc, pm, elites in (*rates, (0.0, 0.0, (True,))):
        for kept in elites:
            name = f"3 via points, Pc {pc:g}, Pm {pm:g}{'' if kept else ', no elite'}"
            yield name, None, {"via_points": 3, "crossover": pc, "mutation": pm, "elitism": kept}


def _han_experiments(where: str, query: Query, planner: str, settings: Sequence[Setting]) -> list[Experiment]:
    return [
        Experiment(
            paper="han2007",
            map=where,
            planner=planner,
            label=label,
            options=options,
            query=for_every_seed(query),
            printed=printed,
            recreated=False,
        )
        for label, printed, options in settings
    ]
