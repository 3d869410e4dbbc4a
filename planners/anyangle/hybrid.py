"""Ants find the corridor, a genetic algorithm finds the line within it (after Han, MSc thesis, Missouri 2007, 6.3).

The thesis asks for a planner with only the good sides of both of its own: ants always get to the goal, but by steps of
the grid; via points give a straight line, but random ones rarely get past many obstacles. Here the ants' path, pulled
straight, is the ancestor of every chromosome, so all are feasible from the start and none needs to be drawn at random.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from antdrive.planners.anyangle.ga_han import Leader, ViaPlanner, seeded
from antdrive.planners.anyangle.lines import Ends, ends, terrain
from antdrive.planners.colonies.colony import Colony
from antdrive.planners.iterative import Iteration, require
from antdrive.planners.plan import Cells, Query
from antdrive.worlds import Floats, InputError
from antdrive.worlds.plane import polyline_length

ROUNDS = 20  # times that every via point of a new path is pulled taut


@dataclass(frozen=True, kw_only=True)
class Hybrid(ViaPlanner):
    """Ants find the corridor, then a genetic algorithm moves via points freely within it (after Han 2007).

    Of the `iterations` the first `parties` times `foraging` are the ants', or more while none of a party has arrived. For
    these the history's means and counts and `field` are the ants' own; afterwards they are those of the chromosomes. The
    best is always that of the line to be driven: the ants' path is pulled straight at once.
    """

    iterations: int = 200
    colony: str = "aco-han"  # the ant planner, by its name
    ants: int = 100  # in place of its own number
    parties: int = 3  # colonies that start afresh; the best corridor of all counts
    foraging: int = 10  # iterations of each
    population: int = 60
    crossover: float = 0.25
    mutation: float = 0.5  # of each gene
    bend: float = 30.0  # one via point for each so many degrees of a corner of the pulled line [deg]
    reach: float = 2.0  # the longest move of a via point [cells]

    def __post_init__(self) -> None:
        super().__post_init__()
        require("ants", self.ants, at_least=1, at_most=1_000_000)
        require("parties", self.parties, at_least=1)
        require("foraging", self.foraging, at_least=1)
        require("population", self.population, at_least=2, at_most=1_000_000)
        require("crossover", self.crossover, at_least=0, at_most=1)
        require("mutation", self.mutation, at_least=0, at_most=1)
        require("bend", self.bend, above=0, at_most=180)
        require("reach", self.reach, above=0)

    @property
    def work_unit(self) -> str:
        """What `work` counts."""
        return "ant steps and chromosomes rated"

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Forage, pull the ants' path straight, refine it."""
        from antdrive.planners.anyangle import _kernels_ga

        way, land = ends(query), terrain(query)
        fixed = np.array([way.first, way.last])
        leader = Leader(query, way)
        via = np.empty((0, 2))
        for _ in range(self.parties):
            seen = b""
            for number, state in enumerate(self._ants().iterate(query, rng), start=1):
                if len(state.cells) and state.cells.tobytes() != seen:
                    seen = state.cells.tobytes()
                    found = self._pulled(query, way, state.cells)
                    # Which path is the shortest shows only once it is taut.
                    length = float(_kernels_ga.tighten_all(found, fixed, land, ROUNDS))
                    if length + leader.extra < leader.best:
                        leader.offer(found, length)
                        via = found
                yield state._replace(cells=leader.cells, best=leader.best, waypoints=leader.waypoints)
                if number >= self.foraging and seen:
                    break
        if len(via):
            yield from self._refine(query, leader, via, rng)

    def _ants(self) -> Colony:
        from antdrive.planners.registry import PLANNERS, load_planner  # the registry knows this planner too

        found = load_planner(self.colony)
        if not isinstance(found, Colony):
            names = ", ".join(name for name, planner in PLANNERS.items() if isinstance(planner, Colony))
            raise InputError(f"planner.colony: must be an ant planner, one of {names}; got {self.colony!r}")
        return dataclasses.replace(found, ants=self.ants)

    def _pulled(self, query: Query, way: Ends, cells: Cells) -> Floats:
        """Via points (n, 2) [m] of the line that a path of cells becomes when it is pulled straight."""
        from antdrive.planners.anyangle import _kernels_lines as _kernels_anyangle

        xy = np.vstack([way.first, query.grid.xy(cells), way.last])
        return _bent(xy[_kernels_anyangle.pull(terrain(query), xy)], math.radians(self.bend))

    def _refine(self, query: Query, leader: Leader, via: Floats, rng: np.random.Generator) -> Iterator[Iteration]:
        from antdrive.planners.anyangle import _kernels_ga

        land, state = terrain(query), seeded(rng)
        fixed = np.array([leader.way.first, leader.way.last])
        population = np.repeat(via[None], self.population, axis=0)
        lengths = np.full(self.population, polyline_length(np.vstack([fixed[:1], via, fixed[1:]])))
        reach = self.reach * query.grid.cell
        while True:
            state = _kernels_ga.refine_generation(
                population, lengths, fixed, land, self.crossover, self.mutation, reach, np.uint64(state)
            )
            yield leader.report(population, lengths, arrived=self.population, work=self.population)


def _bent(xy: Floats, bend: float) -> Floats:
    """Via points on a line (M, 2): each corner, and beside sharp ones as many more as they turn by `bend` [rad]."""
    via: list[Floats] = []
    for before, here, after in zip(xy[:-2], xy[1:-1], xy[2:], strict=True):
        a, b = here - before, after - here
        turn = abs(math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b)))
        more = max(1, math.ceil(turn / bend)) - 1
        # All points lie on the line, none of its corners is passed over, so the new line is the old one.
        via += [here - a * k / (2 * more + 2) for k in range(more // 2, 0, -1)]
        via.append(here)
        via += [here + b * k / (2 * more + 2) for k in range(1, more - more // 2 + 1)]
    return np.array(via) if via else xy.mean(axis=0, keepdims=True)
