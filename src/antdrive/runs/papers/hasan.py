"""Experiments of Hasan (hasan)."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from antdrive.planners import MaxMinDStar, Query
from antdrive.planners.colonies.mmas_dstar import closed_gates
from antdrive.runs.papers import maps
from antdrive.runs.papers.experiment import Experiment, for_every_seed
from antdrive.runs.papers.paper_runs import FirstTouchDStar, total_cost
from antdrive.worlds import Grid

#: Per environment: the printed steps and total costs of the ant and of D*, and the ant's alpha and beta.
TABLE = {
    "1a curved walls": (65, 2491.8, 3318.4, 7.0, 1.0),
    "2b overlapping curved walls": (43, 1052.4, 2559.8, 5.0, 1.0),
    "3c vertical rows": (49, 1238.6, 1238.6, 1.0, 1.0),
    "4d concentric circles": (64, 2281.2, 5857.8, 5.0, 1.0),
    "5e many shapes": (91, 5086.4, 5380.6, 3.0, 1.0),
    "5f the same, across the wall": (66, 2477.8, 3249.2, 1.0, 0.0),
}
FEW = 20  # seeds of slow arms
Change: TypeAlias = Callable[[Query], Query]  # of a candidate's moves


def hasan() -> list[Experiment]:
    """Return table 1 on random candidates and on maps drawn by hand, and the 10 x 10 environment of figures 3 and 4.

    Both planners have closed gates, unless the name of the arm says otherwise. The paper prints steps for its ants, and total
    costs and times for both planners.
    """
    return [e for name in TABLE for e in (*_candidates(name), *_by_hand(name))] + _figures()


def _candidates(name: str) -> list[Experiment]:
    """Return the arms on candidates for an environment, one per seed."""
    steps, cost, rival, alpha, beta = TABLE[name]
    table: dict[str, Any] = {"alpha": alpha, "beta": beta, "gates": False}

    def arm(label: str, planner: str = "mmas-dstar", change: Change = maps.closing_gates, **facts: Any) -> Experiment:
        facts = {"quantity": "total", "printed": None, "worlds": 0, **facts}
        query = lambda seed: change(maps.environment(name, seed))  # noqa: E731
        return Experiment(paper="hasan", map=name, planner=planner, label=label, query=query, **facts)

    def rivals(then: str = "", **facts: Any) -> list[Experiment]:
        """Return two D*: the optimal one, and the one that keeps first costs, nearest to the robot first."""
        nearest = FirstTouchDStar()
        return [
            arm("dstar" + then, "dstar", printed=rival, **facts),
            arm("D* nearest first" + then, "dstar", printed=rival, made=nearest, **facts),
        ]

    found = [arm("steps", options=table, quantity="steps", printed=float(steps))]
    drives = {"group": "drives", "movers": 1, "most_seeds": FEW}
    for then, facts in (("", {"group": "plans"}), (", moving", drives)):
        found += [
            arm("mmas-dstar" + then, options=table, printed=cost, **facts),
            *rivals(then, **facts),
            arm("D* by the listing" + then, "dstar", made=FirstTouchDStar(order="cost"), **facts),
        ]
    return found + [
        arm("mmas-dstar, listing", options={**table, "lowers": False}),
        arm("mmas-dstar, our rule", options={"gates": False}),
        arm("mmas", "mmas", most_seeds=FEW),
        arm("mmas, alpha 0", "mmas", options={"alpha": 0.0}, most_seeds=FEW),
        arm("mmas-dstar, no gates", options=table, change=_unchanged),
        arm("mmas-dstar, own gates", options={**table, "gates": True}, change=_unchanged, group="own gates"),
        arm("dstar, no gates", "dstar", change=_unchanged, group="own gates"),
        arm("D* nearest first, no gates", "dstar", made=FirstTouchDStar(), change=_unchanged),
        arm("mmas-dstar, corners cut", options=table, change=_cut),
        *rivals(", corners cut", change=_cut),
        arm("mmas-dstar, fixed", options=_fixed(alpha, beta)),
        *(arm(f"alpha {a:g}", options=_fixed(a, 1.0)) for a in (1.0, 25.0, 26.0) if a == 1.0 or name.startswith("5f")),
        arm("mmas-dstar, mover enters", options=table, movers=1, enter=True),
        arm("mmas-dstar, mover on path enters", options=table, movers=1, on_path=True, enter=True),
        arm("dstar, mover on path enters", "dstar", movers=1, on_path=True, enter=True),
    ]


def _unchanged(query: Query) -> Query:
    return query


def _cut(query: Query) -> Query:
    return maps.closing_gates(maps.cutting_corners(query))


def _by_hand(name: str) -> list[Experiment]:
    """Return the arms on the environment drawn by hand, which is that of the catalogue of worlds; no arm is random."""
    *_, alpha, beta = TABLE[name]
    table, drawn = {"alpha": alpha, "beta": beta}, maps.environments()[name]
    shut, opened = for_every_seed(maps.closing_gates(drawn)), for_every_seed(drawn)

    def arm(label: str, planner: str, query: Callable[[int], Query], **facts: Any) -> Experiment:
        facts |= {"printed": None, "quantity": "total", "most_seeds": 1}
        return Experiment(paper="hasan", map=f"{name}, by hand", planner=planner, label=label, query=query, **facts)

    return [
        arm("mmas-dstar", "mmas-dstar", shut, options={**table, "gates": False}),
        arm("dstar", "dstar", shut),
        arm("D* nearest first", "dstar", shut, made=FirstTouchDStar()),
        arm("mmas-dstar, no gates", "mmas-dstar", opened, options={**table, "gates": False}),
        arm("mmas-dstar, own gates", "mmas-dstar", opened, options=table),
        arm("dstar, no gates", "dstar", opened),
        arm("D* nearest first, no gates", "dstar", opened, made=FirstTouchDStar()),
    ]


def _figures() -> list[Experiment]:
    """Return figures 3 and 4: exponents, and a mover on the path."""

    def arm(label: str, alpha: float, beta: float, printed: float, **facts: Any) -> Experiment:
        facts |= {"paper": "hasan", "map": "10×10", "planner": "mmas-dstar", "quantity": "total", "worlds": 0}
        options = _fixed(alpha, beta)
        return Experiment(label=label, query=figure_map, options=options, printed=printed, **facts)

    return [
        arm("alpha 1", 1.0, 1.0, 99.0),
        arm("alpha 2", 2.0, 1.0, 99.0),
        arm("alpha 3", 3.0, 1.0, 98.2),
        arm("alpha 1, beta 3", 1.0, 3.0, 118.6),
        arm("alpha 3, moving", 3.0, 1.0, 98.6, movers=1, on_path=True),
    ]


def _fixed(alpha: float, beta: float) -> dict[str, Any]:
    """Return the ant's options for exponents that stay, on a query with its gates closed."""
    return {"alpha": alpha, "beta": beta, "gates": False, "alpha_max": None}


@functools.cache
def figure_map(seed: int) -> Query:
    """Return a random candidate for the 10 x 10 cells of figures 3 and 4, from (0, 9) to (7, 0).

    It has 3 to 11 rectangles, no gate, and what the paper prints of its first test (l. 218): with alpha 1 and beta 1 the ant
    takes 13 steps of a total of 99.
    """
    rng, ant = np.random.default_rng([3, seed]), MaxMinDStar(**_fixed(1.0, 1.0))
    while True:
        free = np.ones((10, 10), dtype=np.bool_)
        for height, width in rng.integers(1, 6, (rng.integers(3, 12), 2)):
            row, col = rng.integers(0, 11 - height), rng.integers(0, 11 - width)
            free[row : row + height, col : col + width] = False
        if not (free[9, 0] and free[0, 7]):
            continue
        query = Query(Grid.from_free(free), (9, 0), (0, 7))
        if not closed_gates(query)[1]:
            plan = ant.plan(query, rng)
            if len(plan.cells) == 14 and abs(total_cost(query, plan) - 99.0) < 1e-6:
                return query
