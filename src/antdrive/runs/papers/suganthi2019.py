"""Experiments of Suganthi and Subha (suganthi2019)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import partial
from typing import Any

from antdrive.planners import Query
from antdrive.runs.papers.experiment import CANDIDATES, MANY_CANDIDATES, Experiment, candidates
from antdrive.runs.papers.maps import cutting_corners, scattered

#: Table 2 by side of the map [cells]: the lengths of ACO, PFACO and IACO [cells].
TABLE_2 = {
    10: (13.899, 13.899, 13.899),
    20: (28.627, 38.627, 28.627),
    30: (46.527, 59.355, 42.184),
    50: (96.125, 109.761, 94.326),
}
#: The moves of IACO's length, and the kind of candidate map.
KINDS: dict[int, tuple[tuple[int, int], dict[str, Any]]] = {
    10: ((4, 7), {"blocked": 0.15}),
    20: ((6, 16), {"blocked": 0.15}),
    30: ((4, 27), {"blocked": 0.08}),
    50: ((42, 37), {"blocked": 0.05, "blocks": 6, "largest": 35, "thin": True}),
}
STEPS = {30: 7.1e6, 50: 2e7}  # median ant steps of `iaco`
ALL, LARGE = (10, 20, 30, 50), (20, 30, 50)
FEW = 24  # seeds of checks, and of further readings where a plan takes half a second
CHECKS, SLOW = ("alpha = 0", "C = 0.01", "C = 100"), ("all deposit", "ants share", "in full", "no elite", "many steps")


def suganthi2019() -> list[Experiment]:
    """Return Table 2, ablations of the exploratory ants and of the elite, and the readings of open points.

    Ants of all planners step back out of dead ends and cut loops short; where "ants die", they do neither. Of
    `pfaco`'s constants, repulsion and influence are those of Table 1, whose first value is missing in the text; the others
    are lee2008's or ours.
    """
    common = {"alpha": 1.0, "beta": 1.0, "evaporation": 0.3, "deposit": 1.0, "heuristic": "step"}
    walk = {"iterations": 100, "backtrack": True, "shortcut": True}
    planners: dict[str, dict[str, Any]] = {
        "as": {"ants": 50, **common, **walk},
        "pfaco": {"ants": 50, "ranks": 15, "repulsion": 5.0, "influence": 10.0, **walk},
        "iaco": {"ants": 25, "explorers": 75, **common, **walk},
    }
    die = {"backtrack": False, "shortcut": False}
    unlearned = dict.fromkeys(("alpha_1", "alpha_2", "alpha_3"), 0.0)
    initial = {**dict.fromkeys(("alpha_1", "alpha_2", "alpha_3", "beta_1", "deposit"), 1.0), "evaporation": 0.3}
    arms: list[tuple[str, dict[str, Any], tuple[int, ...]]] = [  # label, changed options, sizes
        *((name, {}, ALL) for name in planners),
        *((f"{name}, ants die", die, ALL) for name in planners),
        ("iaco, a = 25", {"elite": 25.0}, LARGE),
        ("iaco, all deposit", {"depositors": "all"}, LARGE),
        ("iaco, best ants share", {"ties": "share"}, LARGE),
        ("iaco, each best ant in full", {"ties": "ant"}, LARGE),
        ("iaco, no elite", {"elite": 0.0}, LARGE),
        ("iaco, 100 common", {"ants": 100, "explorers": 0}, LARGE),
        ("iaco, 100 common, a = 25", {"ants": 100, "explorers": 0, "elite": 25.0}, LARGE),
        ("iaco, 100 common, a = 100", {"ants": 100, "explorers": 0, "elite": 100.0}, LARGE),
        ("iaco, 50 common, a = 50", {"ants": 50, "explorers": 0, "elite": 50.0}, LARGE),
        ("iaco, 25 common", {"explorers": 0}, LARGE),
        ("iaco, 25 common, a = 25", {"explorers": 0, "elite": 25.0}, LARGE),
        ("as, 100 ants", {"ants": 100}, LARGE),
        ("as, as many steps", {}, (30, 50)),
        ("pfaco, 2 cells", {"influence": 2.0}, LARGE),
        *((f"{name}, alpha = 0", {"alpha": 0.0}, LARGE) for name in ("as", "iaco")),
        ("pfaco, alpha = 0", unlearned, LARGE),
        ("pfaco, initial parameters", initial, LARGE),
        *((f"{name}, C = {c:g}", {"initial": c}, (30,)) for name in ("as", "iaco") for c in (0.01, 100.0)),
    ]
    table = [
        Experiment(
            paper="suganthi2019",
            map=f"{size}×{size}",
            planner=planner,
            label=label,
            options={**planners[planner], **changed},
            printed=dict(zip(planners, TABLE_2[size], strict=True))[planner],
            query=candidates(size, 100 * size, KINDS[size][0], **KINDS[size][1]),
            worlds=MANY_CANDIDATES if size < 50 else CANDIDATES,
            comparable=True,
            slow=size >= 30,
            # Two runs with dying ants may differ by a quarter of the length.
            rounds=10 if changed is die and size < 50 else 1,
            most_seeds=FEW if label.endswith(CHECKS if size < 50 else (*CHECKS, *SLOW)) else 10_000,
            work=STEPS[size] if label.endswith("steps") else math.inf,
        )
        for size in TABLE_2
        for label, changed, sizes in arms
        for planner in (label.partition(",")[0],)
        if size in sizes
    ]
    # On maps with as many moves as printed no ant of `as` or `iaco` crosses 50×50 cells if ants die; on these some do.
    crossed = [
        Experiment(
            paper="suganthi2019",
            map="50×50, 10 % blocked",
            planner=planner,
            label=label,
            options={**planners[planner], **die, **changed},
            printed=None,
            query=partial(scattered, 50, 0.1),
            worlds=MANY_CANDIDATES,
        )
        for planner, label, changed in (
            ("as", "as, ants die", {}),
            ("iaco", "iaco, ants die", {}),
            ("as", "as, 100 ants, ants die", {"ants": 100}),
        )
    ]
    cut = [
        dataclasses.replace(
            one, map=f"{one.map}, corners cut", query=partial(_cut, one.query), comparable=False, most_seeds=FEW
        )
        for one in table
        if one.map == "30×30" and one.name in ("as", "pfaco", "iaco", "iaco, 100 common")
    ]
    return table + crossed + cut


def _cut(query: Callable[[int], Query], seed: int) -> Query:
    return cutting_corners(query(seed))
