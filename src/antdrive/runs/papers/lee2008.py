"""Experiments of Lee et al. (lee2008)."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from antdrive.planners import Query
from antdrive.runs.papers.experiment import CANDIDATES, Experiment, cached_candidate
from antdrive.runs.papers.maps import MoveCount, winding_candidate


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
    return cached_candidate(shape, start, goal, moves, 100 * number + seed, *kind)
