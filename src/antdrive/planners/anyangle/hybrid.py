"""Hybrid of an ant colony and a genetic algorithm (after Han, MSc thesis, Missouri 2007, section 6.3).

The thesis proposes to combine its two planners. Ants reach the goal, but along the grid's moves. Via points give
straight lines, but random ones rarely pass many obstacles. Here every chromosome descends from the ants' path,
pulled straight, so all chromosomes are feasible from the start.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import FieldError, require
from antdrive.base.plane import polyline_length
from antdrive.planners.anyangle.ga_han import Incumbent, seeded
from antdrive.planners.anyangle.lines import RouteEnds, route_ends, terrain
from antdrive.planners.colonies.catalog import colonies
from antdrive.planners.colonies.colony import Colony
from antdrive.planners.iterative import Iteration, IterativePlanner
from antdrive.planners.plan import Cells, Query

ROUNDS = 20  # tightening passes over the via points of a new path


@dataclass(frozen=True, kw_only=True)
class Hybrid(IterativePlanner):
    """Ants find a corridor; a genetic algorithm finds the line in it.

    Section 6.3 of Han 2007 only proposes the combination; the details are antdrive's. `ant_runs` colonies run
    in sequence, each for `ant_iterations` or until its first ant arrives, whichever is later. The best of their
    paths, pulled straight, seeds the population; the remaining `iterations` are generations. The history's means
    and counts and `field` describe first the ants, then the chromosomes. The history's best is always the length
    of the line to drive.

    Known weakness, measured (docs/notebook/planner-quality.md): the line stays in the ants' corridor, which may
    not be the best. With a quarter of 100 x 100 cells blocked, its cells are 3.6 per cent longer than the
    shortest path in the median and 7.5 at worst; among cylinders 0.0 and 1.2.

    Attributes:
        iterations: total of ant iterations and generations
        colony: the name of the ant planner in `antdrive planners`
        ants: ants per iteration; overrides the ant planner's own number
        ant_runs: number of colonies, each with new trails
        ant_iterations: iterations per colony
        population: number of chromosomes
        crossover: the probability that a chromosome is crossed with another
        mutation: the probability that a gene mutates
        degrees_per_point: turn per via point at a corner of the pulled line [deg]
        max_shift: the longest move of a via point in a mutation [cells]

    Raises:
        FieldError: an option is out of range; names it and the valid range.
    """

    iterations: int = 200
    colony: str = "aco-han"
    ants: int = 100
    ant_runs: int = 3
    ant_iterations: int = 10
    population: int = 60
    crossover: float = 0.25
    mutation: float = 0.5
    degrees_per_point: float = 30.0
    max_shift: float = 2.0

    work_unit: ClassVar[str] = "ant steps and chromosomes rated"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.colony not in colonies():
            raise FieldError("colony", f"must be an ant planner, one of {', '.join(colonies())}; got {self.colony!r}")
        require("ants", self.ants, at_least=1, at_most=1_000_000)
        require("ant_runs", self.ant_runs, at_least=1)
        require("ant_iterations", self.ant_iterations, at_least=1)
        require("population", self.population, at_least=2, at_most=1_000_000)
        require("crossover", self.crossover, at_least=0, at_most=1)
        require("mutation", self.mutation, at_least=0, at_most=1)
        require("degrees_per_point", self.degrees_per_point, above=0, at_most=180)
        require("max_shift", self.max_shift, above=0)

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Run the ants, pull their best path straight, then breed lines from it without end."""
        from antdrive.planners.anyangle import _kernels_ga

        ends, land = route_ends(query), terrain(query)
        fixed = np.array([ends.start, ends.goal])
        incumbent = Incumbent(query, ends)
        via = np.empty((0, 2))
        for _ in range(self.ant_runs):
            pulled = b""  # the path of cells that was pulled last
            for number, state in enumerate(self._ants().iterate(query, rng), start=1):
                if len(state.cells) and state.cells.tobytes() != pulled:
                    pulled = state.cells.tobytes()
                    candidate = self._pulled(query, ends, state.cells)
                    # Compare tightened paths: the shortest path of cells need not give the shortest line.
                    length = float(_kernels_ga.tighten_all(candidate, fixed, land, ROUNDS))
                    if incumbent.keep_if_shorter(candidate, length):
                        via = candidate
                yield state._replace(cells=incumbent.cells, best=incumbent.best, waypoints=incumbent.waypoints)
                if number >= self.ant_iterations and pulled:
                    break
        if len(via):
            yield from self._breed(query, incumbent, via, rng)

    def _ants(self) -> Colony:
        return dataclasses.replace(colonies()[self.colony], ants=self.ants)

    def _pulled(self, query: Query, ends: RouteEnds, cells: Cells) -> Floats:
        """Return the via points (n, 2) [m] of a path of cells pulled straight."""
        from antdrive.planners.anyangle import _kernels_lines

        xy = np.vstack([ends.start, query.grid.xy(cells), ends.goal])
        return _via_points(xy[_kernels_lines.pull(terrain(query), xy)], math.radians(self.degrees_per_point))

    def _breed(self, query: Query, incumbent: Incumbent, via: Floats, rng: np.random.Generator) -> Iterator[Iteration]:
        from antdrive.planners.anyangle import _kernels_ga

        land, state = terrain(query), seeded(rng)
        fixed = np.array([incumbent.ends.start, incumbent.ends.goal])
        population = np.repeat(via[None], self.population, axis=0)
        lengths = np.full(self.population, polyline_length(np.vstack([fixed[:1], via, fixed[1:]])))
        max_shift = self.max_shift * query.grid.cell
        while True:
            state = _kernels_ga.breed_feasible(
                population, lengths, fixed, land, self.crossover, self.mutation, max_shift, np.uint64(state)
            )
            yield incumbent.report(population, lengths, arrived=self.population, work=self.population)


def _via_points(xy: Floats, angle: float) -> Floats:
    """Return via points on a polyline (M, 2): its corners, and more beside sharp ones, one per `angle` [rad] of turn."""
    via: list[Floats] = []
    for before, here, after in zip(xy[:-2], xy[1:-1], xy[2:], strict=True):
        a, b = here - before, after - here
        turn = abs(math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b)))
        more = max(1, math.ceil(turn / angle)) - 1
        # All points lie on the line and include all corners, so the line does not change.
        via += [here - a * k / (2 * more + 2) for k in range(more // 2, 0, -1)]
        via.append(here)
        via += [here + b * k / (2 * more + 2) for k in range(1, more - more // 2 + 1)]
    return np.array(via) if via else xy.mean(axis=0, keepdims=True)
