"""One experiment of a paper: a planner on maps, and the printed value."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from antdrive.planners import Planner, Query
from antdrive.runs.papers.maps import MoveCount, candidate


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
    on_path: bool = False  # movers start on cells of the planner's own plan, not on any free cell
    enter: bool = False  # movers may enter the robot's cell, which ends the drive
    group: str = ""  # experiments of one group on one map are timed together: they alternate on every seed

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


def for_every_seed(query: Query) -> Callable[[int], Query]:
    """Return a function that gives every index the same query."""
    return lambda seed: query


def candidates(size: int, first: int, moves: tuple[int, int], **kind: Any) -> Callable[[int], Query]:
    """Return candidates for a square map from corner to corner, with `moves` = (straight, diagonal) on the shortest path."""
    ends = (0, 0), (size - 1, size - 1)
    return lambda seed: candidate((size, size), *ends, MoveCount(*moves), first + seed, **kind)


#: A planner's setting: name, printed value and options.
Setting: TypeAlias = tuple[str, float | None, dict[str, Any]]
