"""Experiments of Ibraheem and Ajeil (ibraheem2016)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from antdrive.runs.papers.experiment import MANY_CANDIDATES, Experiment, candidates

#: By size: lengths of ACO and MACO in Table 2, the moves of the shorter, and the random rectangles of a candidate. The
#: paper counts obstacles on the two smaller maps only.
MAPS: dict[int, tuple[float, float, tuple[int, int], dict[str, Any]]] = {
    10: (15.07, 15.07, (8, 5), {"blocks": 5, "largest": 2, "obstacles": 5}),
    20: (28.6274, 28.6274, (6, 16), {"blocks": 10, "largest": 4, "obstacles": 10}),
    30: (45.9411, 45.1127, (14, 22), {"blocks": 9, "largest": 7}),
    40: (62.6690, 61.8406, (18, 31), {"blocks": 12, "largest": 10}),
}
TABLE_1: dict[str, Any] = {"ants": 50, "iterations": 100, "evaporation": 0.3}
#: Ants and iterations of section 7.1, by size.
SECTION_7_1 = {10: {"ants": 20, "iterations": 80}, 20: {"ants": 40, "iterations": 80}}
STEPPING_BACK: dict[str, Any] = {"backtrack": True, "shortcut": True}
#: The flow chart: an update after each ant that arrives, the second also with the initial pheromone in each iteration.
EACH_ANT: dict[str, Any] = {"update_every": 1}
RESET: dict[str, Any] = {"update_every": 1, "restart_every": 1}
#: Mean of Q_m over 50 ants of MACO (eq. 5, clipped): an ACO that deposits as much on average, but without ageing.
MEAN_AGED = 0.356
#: Rounds of fifty runs: for Table 2, for other settings, and for arms that cost ten times as much or differ by far more.
MANY, SOME, FEW = 4, 2, 1


def ibraheem2016() -> list[Experiment]:
    """Return the experiments: four sizes, ant system and ageing ants, each reading of the update and section 7.1."""
    found = []
    for size, (aco, maco, _, rectangles) in MAPS.items():
        for planner, printed in (("as", aco), ("maco", maco)):
            found.append(_experiment(size, planner, "", {}, printed=printed, **rectangles))
            for setting, options, rounds in _settings(size, planner):
                found.append(_experiment(size, planner, setting, options, rounds=rounds, **rectangles))
    fewer = {**MAPS[20][3], "blocks": 5, "obstacles": 5}
    found += [_experiment(20, name, "", {}, place="20×20, 5 obstacles", **fewer) for name in ("as", "maco")]
    return found


def _settings(size: int, planner: str) -> Iterator[tuple[str, dict[str, Any], int]]:
    """Yield name, options and rounds of each setting of a planner on the map of a size."""
    yield "each ant", EACH_ANT, FEW
    yield "reset", RESET, FEW
    yield "reset, Q 100", {**RESET, **_deposit(planner, 100.0)}, FEW
    yield "stepping back", STEPPING_BACK, SOME
    if size in SECTION_7_1:
        yield "§7.1", SECTION_7_1[size], SOME
        yield "80 iterations", {"iterations": 80}, SOME
        yield "10 iterations", {"iterations": 10}, SOME
        for ants in {10: (5, 10, 20), 20: (5, 20, 40)}[size]:
            yield f"{ants} ants", {"ants": ants}, SOME
    else:
        yield "Q 100", _deposit(planner, 100.0), SOME
        if planner == "as":
            yield "mean Q of MACO", {"deposit": MEAN_AGED}, SOME
    if size == 30:
        yield "reset, Q 10", {**RESET, **_deposit(planner, 10.0)}, FEW
    if planner == "maco":
        if size not in SECTION_7_1:
            yield "Q_min 0.5", {"q_min": 0.5}, SOME
        return
    yield "alpha 0", {"alpha": 0.0}, FEW
    if size > 10:  # where ants without pheromone find the shortest path
        yield "stepping back, alpha 0", {**STEPPING_BACK, "alpha": 0.0}, FEW
    for rho in (0.0, 0.1, 0.7, 0.9):
        yield f"rho {rho:g}", {"evaporation": rho}, SOME
    if size in (20, 40):
        for alpha in (0.5, 2.0):
            yield f"alpha {alpha:g}", {"alpha": alpha}, SOME
    if size == 40:
        yield "20 ants", {"ants": 20}, SOME


def _deposit(planner: str, amount: float) -> dict[str, Any]:
    """Return the options that scale a planner's deposit."""
    return {"deposit": amount} if planner == "as" else {"q_max": amount, "q_min": 0.1 * amount}


def _experiment(
    size: int,
    planner: str,
    setting: str,
    options: dict[str, Any],
    *,
    place: str = "",
    printed: float | None = None,
    rounds: int = MANY,
    **rectangles: Any,
) -> Experiment:
    moves = MAPS[size][2]
    return Experiment(
        paper="ibraheem2016",
        map=place or f"{size}×{size}",
        planner=planner,
        label=f"{planner}, {setting}" if setting else planner,
        printed=printed,
        options={**TABLE_1, **options},
        query=candidates(size, 100 * size, moves, margin=2, **rectangles),
        worlds=MANY_CANDIDATES,
        comparable=True,
        slow=size == 40 or "update_every" in options,
        rounds=rounds,
    )
