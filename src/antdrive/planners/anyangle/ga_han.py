"""Genetic algorithm on via points (Han, MSc thesis, Missouri 2007, section 4.1)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import require
from antdrive.planners.anyangle.lines import RouteEnds, cells_along, route_ends, terrain
from antdrive.planners.iterative import Iteration, IterativePlanner
from antdrive.planners.plan import Capabilities, Cells, PlanResult, Query


class Incumbent:
    """The best line so far with its leads; the path of cells along it is updated only when the line changes.

    Attributes:
        query: the query
        ends: the ends of the line and its leads
        best: the length of the best line, leads included [m], inf while there is none
        cells: a path of cells along the line (N, 2)
        waypoints: the line in fractional cells (M, 2), None while there is none
    """

    def __init__(self, query: Query, ends: RouteEnds) -> None:
        self.query, self.ends = query, ends
        self.best = math.inf
        self.cells: Cells = np.empty((0, 2), dtype=np.int32)
        self.waypoints: Floats | None = None

    def keep_if_shorter(self, via: Floats, length: float) -> bool:
        """Keep the line over via points (n, 2) [m] if it is the shortest, and return whether it is.

        `length` excludes the leads [m].
        """
        length += self.ends.lead_length
        if length >= self.best:
            return False
        self.best = length
        line = self.ends.with_leads(np.vstack([self.ends.start, via, self.ends.goal]))
        self.waypoints = self.query.grid.fractional(line)
        self.cells = cells_along(self.query, self.waypoints)
        return True

    def report(self, population: Floats, lengths: Floats, *, arrived: int, work: int) -> Iteration:
        """Update the incumbent and return the state after a generation."""
        leads = self.ends.lead_length
        if len(lengths):
            first = int(lengths.argmin())
            self.keep_if_shorter(population[first], float(lengths[first]))
        return Iteration(
            cells=self.cells,
            best=self.best,
            iteration_best=float(lengths.min()) + leads if len(lengths) else math.inf,
            iteration_mean=float(lengths.mean()) + leads if len(lengths) else math.inf,
            arrived=arrived,
            work=work,
            waypoints=self.waypoints,
            field=self._visits(population),
        )

    def _visits(self, population: Floats) -> Floats:
        from antdrive.planners.anyangle import _kernels_lines

        grid = self.query.grid
        lines = np.empty((len(population), population.shape[1] + 2, 2))
        lines[:, 0], lines[:, 1:-1], lines[:, -1] = self.ends.start, population, self.ends.goal
        cells = np.ascontiguousarray(grid.fractional(lines)).reshape(lines.shape)
        return np.asarray(_kernels_lines.visits(cells, grid.shape))


def seeded(rng: np.random.Generator) -> Any:
    """Draw a seed for compiled code."""
    return np.uint64(rng.bit_generator.random_raw()) | np.uint64(1)


@dataclass(frozen=True, kw_only=True)
class GaHan(IterativePlanner):
    """A genetic algorithm on a few via points.

    Han 2007, section 4.1: a chromosome is a sequence of via points on free cells. Each generation selects by
    1 / length, crosses, mutates, eliminates chromosomes that touch an obstacle and refills the population at
    random. The thesis' program also eliminates and refills before it mutates. The defaults are those of its
    first experiments; the elite also breeds, unlike in its program. `field` counts the chromosomes of the last
    population that pass each cell.

    Known weakness, measured (docs/notebook/planner-quality.md): the first feasible line must be found by chance.
    Among many obstacles no line over so few via points may exist, or none is drawn: the status is then `STOPPED`.
    With a quarter of the cells blocked, 6 of 10 runs find a line on 20 x 20 cells, and none on 50 x 50.

    Attributes:
        population: number of chromosomes
        iterations: number of generations
        crossover: Pc, the probability that a chromosome takes part in crossover
        mutation: Pm, the probability that a gene mutates; the thesis uses 0.4 with nine obstacles
        via_points: via points per chromosome, 1 to 6 in the thesis
        elitism: whether the best chromosome always survives
        elite_breeds: whether that chromosome is also a parent; in the thesis' program it is not
        tries: maximum number of random chromosomes in the whole run
        complete: False; the planner may miss an existing path
    """

    population: int = 100
    iterations: int = 100
    crossover: float = 0.25
    mutation: float = 0.2
    via_points: int = 3
    elitism: bool = True
    elite_breeds: bool = True
    tries: int = 1_000_000

    capabilities: ClassVar[Capabilities] = Capabilities(iterative=True, complete=False)
    work_unit: ClassVar[str] = "chromosomes rated"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("population", self.population, at_least=2, at_most=1_000_000)
        require("crossover", self.crossover, at_least=0, at_most=1)
        require("mutation", self.mutation, at_least=0, at_most=1)
        require("via_points", self.via_points, at_least=1, at_most=1000)
        require("tries", self.tries, at_least=1)

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Breed generations as in section 4.1 viii; end only if no feasible chromosome is ever drawn."""
        from antdrive.planners.anyangle import _kernels_ga

        ends, land, state = route_ends(query), terrain(query), seeded(rng)
        fixed = np.array([ends.start, ends.goal])
        points = query.grid.xy(_genes(query))
        population = np.empty((self.population, self.via_points, 2))
        lengths = np.empty(self.population)
        incumbent, tries = Incumbent(query, ends), self.tries
        size = survivors = 0
        while True:
            if size:
                survivors, state = _kernels_ga.next_generation(
                    population,
                    lengths,
                    size,
                    points,
                    fixed,
                    land,
                    self.crossover,
                    self.mutation,
                    self.elitism,
                    self.elite_breeds,
                    np.uint64(state),
                )
                rated = self.population
            else:
                survivors, rated = 0, 0
            size, drawn, state = _kernels_ga.refill(
                population, lengths, survivors, points, fixed, land, tries, np.uint64(state)
            )
            tries -= drawn
            yield incumbent.report(
                population[:size], lengths[:size], arrived=survivors if rated else size, work=rated + drawn
            )
            if not size and not tries:
                return

    def _conclude(self, query: Query, done: list[Iteration], note: str) -> PlanResult:
        result = super()._conclude(query, done, note)
        if result.solved or note:
            return result
        return dataclasses.replace(result, reason=f"no feasible chromosome found within {self.tries} tries")


def _genes(query: Query) -> Cells:
    """Return the free cells except start and goal, on which via points may lie."""
    free = query.grid.free.copy()
    free[query.start] = free[query.goal] = False
    cells = np.argwhere(free) if free.any() else np.array([query.start])
    return np.asarray(cells, dtype=np.int32)
