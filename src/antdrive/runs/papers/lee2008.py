"""Experiments of Lee et al. (lee2008)."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from antdrive.planners import Cell, Query
from antdrive.runs.papers.experiment import CANDIDATES, MANY_CANDIDATES, Experiment
from antdrive.runs.papers.maps import MoveCount, candidate, winding_candidate


class LeeMap(NamedTuple):
    """A map of the paper, with the printed lengths and search times."""

    shape: tuple[int, int]
    conventional: float  # Table I, length
    improved: float  # Table II, length
    moves: MoveCount  # those of the improved length
    seconds: tuple[int, int]  # search times of both tables

    @property
    def work(self) -> float:
        """Ant steps of both arms: 3 million on map 3, elsewhere in proportion to the printed times."""
        reference = MAPS[3].seconds
        return round(3e6 * sum(s / r for s, r in zip(self.seconds, reference, strict=True)) / 2, -4)


MAPS = {
    1: LeeMap((25, 25), 72.0833, 59.2548, MoveCount(14, 32), (13326, 602)),
    2: LeeMap((50, 44), 83.3970, 64.0833, MoveCount(16, 34), (3926, 274)),
    3: LeeMap((100, 100), 154.2376, 123.6102, MoveCount(43, 57), (16552, 1063)),
    4: LeeMap((100, 100), 175.2376, 135.8234, MoveCount(34, 72), (17953, 1201)),
    5: LeeMap((100, 100), 168.6518, 131.6812, MoveCount(44, 62), (22641, 1593)),
}
FEW, FEWER = 20, 12  # seeds of readings, and of those with ten times the ant steps on the maps of 100 x 100 cells
BACK: dict[str, Any] = {"backtrack": True}
CUT: dict[str, Any] = {"backtrack": True, "shortcut": True}
LETTER: dict[str, Any] = {"form": "letter", "memory": "none"}
#: Section V, with a random initial pheromone (l. 127). Neither Q nor the scale of that pheromone is printed.
ACO: dict[str, Any] = {"ants": 500, "beta": 2.0, "evaporation": 0.01, "ranks": 100, "mix": 1.0, "deposit": 1000.0}
#: Each setting: planner, options, maps (by name, see `lee2008`), most seeds, and factor of the ant steps.
ARMS: dict[str, tuple[str, dict[str, Any], str, int, float]] = {
    "as": ("as", ACO, "12345ew", 10_000, 1),
    "pfaco": ("pfaco", {}, "12345ew", 10_000, 1),
    # Both arms with other walking rules.
    "pfaco, stepping back": ("pfaco", BACK, "123ew", FEW, 1),
    "as, stepping back": ("as", ACO | BACK, "123ew", FEW, 1),
    "pfaco, cut short": ("pfaco", CUT, "123ew", FEW, 1),
    "as, cut short": ("as", ACO | CUT, "123ew", FEW, 1),
    "pfaco, no tabu list": ("pfaco", {"memory": "none"}, "23", FEW, 1),
    "as, no tabu list": ("as", ACO | {"revisit": 1.0}, "23", FEW, 1),
    # Constants and rules of the conventional colony.
    "as, Q = 1": ("as", ACO | {"deposit": 1.0, "mix": 0.0}, "12345e", FEW, 1),
    "as, Q = 100": ("as", ACO | {"deposit": 100.0}, "23", FEW, 1),
    "as, Q = 10000": ("as", ACO | {"deposit": 10_000.0}, "23", FEW, 1),
    "as, alpha = 0": ("as", ACO | {"alpha": 0.0}, "12345", FEW, 1),
    "as, stepping back, Q = 1": ("as", ACO | BACK | {"deposit": 1.0, "mix": 0.0}, "123", FEW, 1),
    "as, stepping back, alpha = 0": ("as", ACO | BACK | {"alpha": 0.0}, "123", FEW, 1),
    "as, cut short, Q = 1": ("as", ACO | CUT | {"deposit": 1.0, "mix": 0.0}, "123", FEW, 1),
    "as, cut short, alpha = 0": ("as", ACO | CUT | {"alpha": 0.0}, "123", FEW, 1),
    "as, all deposit": ("as", ACO | {"ranks": None}, "23", FEW, 1),
    "as, equal initial pheromone": ("as", ACO | {"mix": 0.0}, "23", FEW, 1),
    # More ant steps.
    "as, ten times": ("as", ACO, "123", FEW, 10),
    "pfaco, ten times": ("pfaco", {}, "23", FEW, 10),
    "as, stepping back, ten times": ("as", ACO | BACK, "23", FEW, 10),
    # Readings of the improved colony.
    "pfaco, to the letter": ("pfaco", LETTER, "12345", FEW, 1),
    "pfaco, highest at the goal": ("pfaco", {"field": "goal"}, "23", FEW, 1),
    "pfaco, obstacles attract": ("pfaco", {"repulsion": -10.0}, "23", FEW, 1),
    "pfaco, list of 150": ("pfaco", {"ranks": 150}, "23", FEW, 1),
    "pfaco, alpha = 0": ("pfaco", {f"alpha_{stage}": 0.0 for stage in (1, 2, 3)}, "23", FEW, 1),
    # Each of its four respects taken away (section I), and the reset of section IV-B.
    "pfaco, distance": ("pfaco", {"form": "distance"}, "23", 10_000, 1),
    "pfaco, random initial pheromone": ("pfaco", {"mix": 1.0}, "23", 10_000, 1),
    "pfaco, no ranks": ("pfaco", {"graded": False}, "23", 10_000, 1),
    "pfaco, constant exponents": (
        "pfaco",
        {"alpha_2": 1.0, "beta_2": 2.0, "alpha_3": 1.0, "beta_3": 2.0},
        "23",
        10_000,
        1,
    ),
    "pfaco, generations": ("pfaco", {"generations": True}, "23", 10_000, 1),
    "pfaco, no reset": ("pfaco", {"convergence": 1e-9}, "23", 10_000, 1),
    "pfaco, reset at 20 %": ("pfaco", {"convergence": 0.2}, "23", 10_000, 1),
}


def lee2008() -> list[Experiment]:
    """Return tables I and II: five maps, ant system and potential-field ants, with equal numbers of ant steps.

    Map `e` is map 3 with start and goal on opposite edges, map `w` map 3 with a path that winds.
    """
    return [_experiment(name, label, *arm) for name in "12345ew" for label, arm in ARMS.items() if name in arm[2]]


def _experiment(
    name: str, label: str, planner: str, options: dict[str, Any], _: str, most_seeds: int, share: float
) -> Experiment:
    number = int(name) if name.isdigit() else 3
    printed, winds = MAPS[number], name in "1w"
    query: Callable[[int], Query] = functools.partial(_winding if winds else _drawn, number)
    if name == "e":
        query = functools.partial(_opposite, number)
    long = share > 1
    return Experiment(
        paper="lee2008",
        map=f"{number}: {printed.shape[0]}×{printed.shape[1]}{ {'e': ', opposite edges', 'w': ', winding'}.get(name, '') }",
        planner=planner,
        label=label,
        options=options,
        printed=printed.conventional if planner == "as" else printed.improved,
        query=query,
        worlds=CANDIDATES if winds else MANY_CANDIDATES,
        comparable=True,
        work=share * printed.work,
        slow=number > 3 or long or name == "w",
        most_seeds=min(most_seeds, FEWER if long and number == 3 else FEW if name in "ew" else most_seeds),
    )


@functools.cache
def _winding(number: int, seed: int) -> Query:
    shape, moves = MAPS[number].shape, MAPS[number].moves
    return winding_candidate(shape, moves, 100 * number + seed, largest=max(shape) // 4)


def _drawn(number: int, seed: int) -> Query:
    """Return a candidate whose start and goal are drawn from all placements."""
    drawn = np.random.default_rng((number, seed))
    return _candidate(number, *placement(MAPS[number].shape, MAPS[number].moves, drawn), seed)


def placement(shape: tuple[int, int], moves: MoveCount, rng: np.random.Generator) -> tuple[Cell, Cell]:
    """Draw start and goal from all pairs of cells that a monotone path with these moves connects, each equally likely."""
    (rows, cols), apart = shape, list(_apart(shape, moves))
    counts = np.array([(rows - down) * (cols - right) for down, right in apart])
    down, right = apart[rng.choice(len(apart), p=counts / counts.sum())]
    row, col = int(rng.integers(rows - down)), int(rng.integers(cols - right))
    ends = ((row, col), (row + down, col + right))
    if rng.integers(2):  # up instead of down
        ends = ((row + down, col), (row, col + right))
    return ends if rng.integers(2) else ends[::-1]


def _apart(shape: tuple[int, int], moves: MoveCount) -> Iterator[tuple[int, int]]:
    """Yield the rows and columns between start and goal of monotone paths with these moves."""
    for down in range(shape[0]):
        right = moves.straight + 2 * moves.diagonal - down
        if 0 <= right < shape[1] and moves.monotone(down, right):
            yield down, right


def _opposite(number: int, seed: int) -> Query:
    """Return a candidate with start and goal on opposite edges."""
    shape, moves = MAPS[number].shape, MAPS[number].moves
    right = moves.straight + 2 * moves.diagonal - (shape[0] - 1)
    aside = (shape[1] - 1 - right) // 2
    return _candidate(number, (0, aside), (shape[0] - 1, aside + right), seed)


def _candidate(number: int, start: Cell, goal: Cell, seed: int) -> Query:
    shape, moves = MAPS[number].shape, MAPS[number].moves
    return candidate(shape, start, goal, moves, 100 * number + seed, blocks=20, largest=max(shape) // 6)
