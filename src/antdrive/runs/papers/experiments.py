"""Experiments of the papers with their printed values, one per map and planner."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeAlias

from antdrive.planners import Planner, Query
from antdrive.runs.papers import maps
from antdrive.runs.papers.maps import MoveCount, candidate, winding_candidate
from antdrive.runs.papers.paper_runs import FirstTouchDStar


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """One planner on one map, run with several seeds, and the paper's printed value."""

    paper: str
    map: str
    planner: str
    query: Callable[[int], Query]  # returns the map with start and goal for an index
    printed: float | None  # length in cells; None if the paper prints none
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)  # the planner's parameters
    recreated: bool = True  # the paper only pictures its map; random maps of the same size and kind replace it
    comparable: bool = False  # the shortest path on recreated maps has the paper's length, so lengths are comparable
    quantity: str = "length"  # the printed and measured value: a property of `PaperRun`
    label: str = ""  # the planner with its setting, unique on a map
    worlds: int = 1  # number of maps; 0: one for each seed
    work: float = math.inf  # if finite, planning ends after this number of ant steps
    most_seeds: int = 10_000  # more seeds add nothing
    rounds: int = 1  # multiplies the number of seeds if runs vary widely
    slow: bool = False  # takes seconds; omitted from a quick run
    made: Planner | None = None  # the planner itself, if it is not registered
    movers: int = 0  # number of moving obstacles while the robot decides cell by cell; 0: plan once

    @property
    def name(self) -> str:
        """The planner with its setting."""
        return self.label or self.planner

    def world(self, seed: int) -> int:
        """Return the map index of a seed."""
        return seed % self.worlds if self.worlds else seed

    def seeds(self, asked: int) -> range:
        """Return the seeds to run for a requested number."""
        return range(min(asked * self.rounds, self.most_seeds))


#: Number of recreated maps: one per seed, or fewer if making or planning one is slow.
MANY_CANDIDATES, CANDIDATES = 50, 10


#: Only the moving obstacle is random in hasan's environments; the seeds repeat the timing.
HASAN_SEEDS = 20


def _for_every_seed(query: Query) -> Callable[[int], Query]:
    return lambda seed: query


def _candidates(size: int, first: int, moves: tuple[int, int], **kind: Any) -> Callable[[int], Query]:
    """Return candidates for a square map from corner to corner, with `moves` = (straight, diagonal) on the shortest path."""
    return lambda seed: _candidate((size, size), (0, 0), (size - 1, size - 1), moves, first + seed, *kind.items())


@functools.cache
def _candidate(
    shape: tuple[int, int],
    start: tuple[int, int],
    goal: tuple[int, int],
    moves: tuple[int, int],
    seed: int,
    *kind: tuple[str, Any],
) -> Query:
    return candidate(shape, start, goal, MoveCount(*moves), seed, **dict(kind))


#: A planner's setting: name, printed value and options.
Setting: TypeAlias = tuple[str, float | None, dict[str, Any]]


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
            query=_for_every_seed(query),
            printed=printed,
            recreated=False,
        )
        for label, printed, options in settings
    ]


def suganthi2019() -> list[Experiment]:
    """Return table 2: four sizes, three planners, and interpretations of the paper's open points.

    The paper does not state what an ant does in a dead end, whether loops are cut, or whether the elite's factor in eq. 7
    is the alpha of eq. 5. The constants of `pfaco` are those of Table 1, whose first value is missing in the text.
    """
    common = {"alpha": 1.0, "beta": 1.0, "evaporation": 0.3, "deposit": 1.0, "heuristic": "step", "iterations": 100}
    freed, letter = {"backtrack": True, "shortcut": True}, {"backtrack": False, "shortcut": False}
    many: dict[str, Any] = {"ants": 25, "explorers": 75, **common}
    wild = ("as, ants die", "iaco, ants die")  # two of their runs differ by a quarter of the length
    arms: list[tuple[str, str, dict[str, Any]]] = [
        ("as", "as", {"ants": 50, **common, **freed}),
        ("pfaco", "pfaco", {"ants": 50, "iterations": 100, "ranks": 15, "repulsion": 5.0, "influence": 10.0}),
        ("iaco", "iaco", {**many, **freed}),
        ("as", "as, ants die", {"ants": 50, **common, **letter}),
        ("iaco", "iaco, ants die", {**many, **letter}),
        ("iaco", "iaco, a = 25", {**many, **freed, "elite": 25.0}),
        ("iaco", "iaco, all deposit", {**many, **freed, "depositors": "all"}),
    ]
    printed = {
        10: (13.899, 13.899, 13.899),
        20: (28.627, 38.627, 28.627),
        30: (46.527, 59.355, 42.184),
        50: (96.125, 109.761, 94.326),
    }
    kinds: dict[int, tuple[tuple[int, int], dict[str, Any]]] = {
        10: ((4, 7), {"blocked": 0.15}),
        20: ((6, 16), {"blocked": 0.15}),
        30: ((4, 27), {"blocked": 0.08}),
        50: ((42, 37), {"blocked": 0.05, "blocks": 6, "largest": 35, "thin": True}),
    }
    return [
        Experiment(
            paper="suganthi2019",
            map=f"{size}×{size}",
            planner=planner,
            label=label,
            options=options,
            printed=value,
            query=_candidates(size, 100 * size, kinds[size][0], **kinds[size][1]),
            worlds=MANY_CANDIDATES if size < 50 else CANDIDATES,
            comparable=True,
            slow=size >= 30,
            rounds=10 if label in wild and size < 50 else 1,
        )
        for size, values in printed.items()
        for (planner, label, options), value in zip(
            arms, (*values, values[0], values[2], values[2], values[2]), strict=True
        )
    ]


def ibraheem2016() -> list[Experiment]:
    """Return table 2: four sizes, ant system and ageing ants."""
    printed = {
        10: (5, 15.07, 15.07, (8, 5)),
        20: (10, 28.6274, 28.6274, (6, 16)),
        30: (15, 45.9411, 45.1127, (14, 22)),
        40: (20, 62.6690, 61.8406, (18, 31)),
    }
    table_1: dict[str, Any] = {"ants": 50, "iterations": 100, "evaporation": 0.3}
    varied: dict[int, dict[str, dict[str, Any]]] = {
        10: {"as, 5 ants": {"ants": 5}, "as, 20 ants": {"ants": 20}},
        20: {
            "as, 5 ants": {"ants": 5},
            "as, 40 ants": {"ants": 40},
            **{f"as, rho {share:g}": {"evaporation": share} for share in (0.1, 0.7, 0.9)},
        },
    }
    return [
        Experiment(
            paper="ibraheem2016",
            map=f"{size}×{size}, {count} obstacles",
            planner=planner,
            label=label,
            printed=value,
            options={**table_1, **options},
            query=_candidates(size, 100 * size, moves, blocks=count * 3 // 5, largest=size // 4),
            worlds=MANY_CANDIDATES,
            comparable=True,
            slow=size == 40,
            rounds=4,
        )
        for size, (count, *values, moves) in printed.items()
        for planner, label, value, options in (
            ("as", "as", values[0], {}),
            ("maco", "maco", values[1], {}),
            *(("as", label, None, options) for label, options in varied.get(size, {}).items()),
        )
    ]


def lee2008() -> list[Experiment]:
    """Return tables I and II: five maps, ant system and potential-field ants, with equal numbers of ant steps.

    Ant steps are proportional to the printed search times, averaged over both planners, with 3 million on map 3.
    """
    printed = {
        1: ((25, 25), None, 72.0833, 59.2548, (14, 32), (13326, 602)),
        2: ((50, 44), (49, 35), 83.3970, 64.0833, (16, 34), (3926, 274)),
        3: ((100, 100), (99, 58), 154.2376, 123.6102, (43, 57), (16552, 1063)),
        4: ((100, 100), (99, 79), 175.2376, 135.8234, (34, 72), (17953, 1201)),
        5: ((100, 100), (99, 69), 168.6518, 131.6812, (44, 62), (22641, 1593)),
    }
    conventional: dict[str, Any] = {"ants": 500, "beta": 2.0, "evaporation": 0.01, "ranks": 100}
    back: dict[str, Any] = {"backtrack": True}
    usual: list[tuple[str, str, dict[str, Any], float]] = [
        ("as", "as", conventional, 1.0),
        ("pfaco", "pfaco", {}, 1.0),
        ("pfaco", "pfaco, stepping back", back, 1.0),
        ("as", "as, stepping back", {**conventional, **back}, 1.0),
        ("as", "as, no list", {**conventional, "ranks": None}, 1.0),
        ("pfaco", "pfaco, to the letter", {"form": "letter", "memory": "none"}, 1.0),
        ("as", "as, cut short", {**conventional, **back, "shortcut": True}, 1.0),
        ("pfaco", "pfaco, cut short", {**back, "shortcut": True}, 1.0),
    ]
    brief = [(planner, f"{label}, a tenth", options, 0.1) for planner, label, options, _ in usual[:4]]
    long = [
        (planner, f"{label}, ten times", options, 10.0) for planner, label, options, _ in usual[:4] if planner == "as"
    ]
    others = {1: brief, 3: long}
    experiments = []
    for number, (shape, goal, *values, moves, seconds) in printed.items():
        work = 3e6 * (seconds[0] / printed[3][5][0] + seconds[1] / printed[3][5][1]) / 2
        if goal is None:  # no path of this length is monotone on so small a map
            query: Callable[[int], Query] = functools.partial(_lee_winding, shape, moves, number)
        else:
            query = functools.partial(_lee_candidate, shape, goal, moves, number)
        experiments += [
            Experiment(
                paper="lee2008",
                map=f"{number}: {shape[0]}×{shape[1]}",
                planner=planner,
                label=label,
                options=options,
                printed=values[planner == "pfaco"],
                query=query,
                worlds=CANDIDATES,
                comparable=True,
                work=round(share * work, -4),
                slow=number > 3 or share > 1,
                most_seeds=20 if share > 1 else 10_000,
            )
            for planner, label, options, share in (*usual, *others.get(number, ()))
        ]
    return experiments


@functools.cache
def _lee_winding(shape: tuple[int, int], moves: tuple[int, int], number: int, seed: int) -> Query:
    return winding_candidate(shape, MoveCount(*moves), 100 * number + seed, largest=max(shape) // 4)


def _lee_candidate(
    shape: tuple[int, int], apart: tuple[int, int], moves: tuple[int, int], number: int, seed: int
) -> Query:
    """Return a candidate with start and goal on opposite edges, as far apart as the printed path requires."""
    aside = (shape[1] - 1 - apart[1]) // 2
    start, goal = (0, aside), (apart[0], aside + apart[1])
    kind = (("blocks", 20), ("largest", max(shape) // 6))
    return _candidate(shape, start, goal, moves, 100 * number + seed, *kind)


def hasan() -> list[Experiment]:
    """Return table 1: six environments with and without a moving obstacle, with the paper's alpha and beta for each.

    The paper prints steps for its ants, and total costs and times for both planners.
    """
    printed = {
        "1a curved walls": (65, 2491.8, 3318.4, (7.0, 1.0)),
        "2b overlapping curved walls": (43, 1052.4, 2559.8, (5.0, 1.0)),
        "3c vertical rows": (49, 1238.6, 1238.6, (1.0, 1.0)),
        "4d concentric circles": (64, 2281.2, 5857.8, (5.0, 1.0)),
        "5e many shapes": (91, 5086.4, 5380.6, (3.0, 1.0)),
        "5f the same, across the wall": (66, 2477.8, 3249.2, (1.0, 0.0)),
    }
    environments = maps.environments()
    experiments = []
    for name, (steps, cost, rival, (alpha, beta)) in printed.items():
        query, chosen = _for_every_seed(environments[name]), {"alpha": alpha, "beta": beta}
        common: dict[str, Any] = {"paper": "hasan", "map": name, "query": query}
        ants: dict[str, Any] = {**common, "planner": "mmas-dstar", "options": chosen}
        experiments.append(
            Experiment(**ants, label="steps", printed=float(steps), quantity="steps", most_seeds=HASAN_SEEDS)
        )
        arms: list[tuple[dict[str, Any], str, float, Planner | None]] = [
            (ants, "mmas-dstar", cost, None),
            ({**common, "planner": "dstar"}, "dstar", rival, None),
            ({**common, "planner": "dstar"}, "D* that lowers no cost", rival, FirstTouchDStar()),
            ({**common, "planner": "mmas-dstar"}, "mmas-dstar, our rule", cost, None),
        ]
        experiments += [
            Experiment(
                **what,
                label=label + (", moving" if movers else ""),
                made=made,
                printed=value,
                quantity="total",
                most_seeds=HASAN_SEEDS,
                movers=movers,
            )
            for movers in (0, 1)
            for what, label, value, made in arms[: 3 if movers else 4]
        ]
    return experiments


#: Functions that list a paper's experiments, by its short name.
PAPERS: Mapping[str, Callable[[], list[Experiment]]] = MappingProxyType(
    {f.__name__: f for f in (han2007, suganthi2019, ibraheem2016, lee2008, hasan)}
)
