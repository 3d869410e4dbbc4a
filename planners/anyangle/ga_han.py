"""A genetic algorithm on via points (Han, MSc thesis, Missouri 2007, section 4.1)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from antdrive.planners.anyangle.lines import Ends, cells_along, ends, terrain
from antdrive.planners.iterative import Iteration, IterativePlanner, require
from antdrive.planners.plan import Cells, PlanResult, Query
from antdrive.worlds import Floats
from antdrive.worlds.plane import polyline_length


@dataclass(frozen=True, kw_only=True)
class ViaPlanner(IterativePlanner):
    """A planner whose answer is a line over via points, which need not run along the grid's moves."""

    @property
    def work_unit(self) -> str:
        """What `work` counts."""
        return "chromosomes rated"

    def _conclude(self, query: Query, done: list[Iteration], note: str) -> PlanResult:
        result = super()._conclude(query, done, note)
        if result.waypoints is None:
            return result
        return dataclasses.replace(result, length=polyline_length(query.grid.xy(result.waypoints)))


class Leader:
    """The best line so far; the cells beside it are looked for only when it changes."""

    def __init__(self, query: Query, way: Ends) -> None:
        self.query, self.way = query, way
        self.best = math.inf  # [m], what lies outside the ends that chromosomes know of included
        self.extra = polyline_length([*way.before, way.first]) + polyline_length([way.last, *way.after])
        self.cells: Cells = np.empty((0, 2), dtype=np.int32)
        self.waypoints: Floats | None = None

    def offer(self, via: Floats, length: float) -> None:
        """Take a line over via points (n, 2) [m] for the best if it is."""
        if length + self.extra >= self.best:
            return
        self.best = length + self.extra
        line = self.way.joined(np.vstack([self.way.first, via, self.way.last]))
        self.waypoints = self.query.grid.fractional(line)
        self.cells = cells_along(self.query, self.waypoints)

    def report(self, population: Floats, lengths: Floats, *, arrived: int, work: int) -> Iteration:
        """An iteration's account of a population (P, n, 2) of feasible chromosomes; P may be 0."""
        if len(lengths):
            first = int(lengths.argmin())
            self.offer(population[first], float(lengths[first]))
        return Iteration(
            cells=self.cells,
            best=self.best,
            iteration_best=float(lengths.min()) + self.extra if len(lengths) else math.inf,
            iteration_mean=float(lengths.mean()) + self.extra if len(lengths) else math.inf,
            arrived=arrived,
            work=work,
            waypoints=self.waypoints,
            field=self._visits(population),
        )

    def _visits(self, population: Floats) -> Floats:
        from antdrive.planners.anyangle import _kernels_lines as _kernels_anyangle

        grid = self.query.grid
        lines = np.empty((len(population), population.shape[1] + 2, 2))
        lines[:, 0], lines[:, 1:-1], lines[:, -1] = self.way.first, population, self.way.last
        cells = np.ascontiguousarray(grid.fractional(lines)).reshape(lines.shape)
        return np.asarray(_kernels_anyangle.visits(cells, grid.shape))


def seeded(rng: np.random.Generator) -> Any:
    """A state for compiled code's own random numbers."""
    return np.uint64(rng.bit_generator.random_raw()) | np.uint64(1)


@dataclass(frozen=True, kw_only=True)
class GaHan(ViaPlanner):
    """A genetic algorithm on a few via points, refilled with random chromosomes (Han 2007).

    `iterations` are generations. `field` counts the chromosomes of the last population that pass each cell. A hard
    world may have no chromosome of so few via points, or none that chance finds: then the answer is `STOPPED`.
    """

    population: int = 100
    iterations: int = 100
    crossover: float = 0.25  # Pc
    mutation: float = 0.2  # Pm, of each gene; the thesis takes 0.4 with nine obstacles
    via_points: int = 3  # 1 to 6 in the thesis
    elitism: bool = True
    tries: int = 1_000_000  # random chromosomes drawn at most in the whole run

    complete: ClassVar[bool] = False  # may miss a path that exists

    def __post_init__(self) -> None:
        super().__post_init__()
        require("population", self.population, at_least=2, at_most=1_000_000)
        require("crossover", self.crossover, at_least=0, at_most=1)
        require("mutation", self.mutation, at_least=0, at_most=1)
        require("via_points", self.via_points, at_least=1, at_most=1000)
        require("tries", self.tries, at_least=1)

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """The program sequence of section 4.1 viii; ends where no feasible chromosome is found at all."""
        from antdrive.planners.anyangle import _kernels_ga

        way, land, state = ends(query), terrain(query), seeded(rng)
        fixed = np.array([way.first, way.last])
        points = query.grid.xy(_genes(query))
        population = np.empty((self.population, self.via_points, 2))
        lengths = np.empty(self.population)
        leader, tries = Leader(query, way), self.tries
        size = survivors = 0
        while True:
            if size:
                survivors, state = _kernels_ga.next_generation(
                    population, lengths, size, points, fixed, land,
                    self.crossover, self.mutation, self.elitism, np.uint64(state),
                )  # fmt: skip
                rated = self.population
            else:
                survivors, rated = 0, 0
            size, drawn, state = _kernels_ga.refill(
                population, lengths, survivors, points, fixed, land, tries, np.uint64(state)
            )
            tries -= drawn
            yield leader.report(
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
    """The cells a via point may lie on: all free ones but the start and the goal."""
    free = query.grid.free.copy()
    free[query.start] = free[query.goal] = False
    cells = np.argwhere(free) if free.any() else np.array([query.start])
    return np.asarray(cells, dtype=np.int32)
