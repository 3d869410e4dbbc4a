"""One ant on pheromone that spreads from the goal.

A. H. Hasan, *Robot path planning based on improved max-min ant colony optimization algorithm in dynamic
environment* (hasan). This is its plan for a world that stands still.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from antdrive.planners.colonies.colony import ColonyGraph, Flat
from antdrive.planners.graph.search import NO_WAY, reachable
from antdrive.planners.iterative import require
from antdrive.planners.plan import GridPlanner, PlanResult, PlanStatus, Query, path_cost
from antdrive.worlds import Floats


@dataclass(frozen=True, kw_only=True)
class MaxMinDStar(GridPlanner):
    """One ant that follows pheromone spread from the goal as D* spreads costs: hasan's improved max-min algorithm.

    It always takes the neighbour of the smallest `pheromone^alpha * distance^beta`. With the distance to the goal
    in it, it may go in circles before a wall, which the author met by other exponents from map to map; here
    alpha is raised by itself, and in the end beta is 0, which always arrives. `reason` says so.
    """

    alpha: float = 1.0  # the paper: 1 to 26 by environment
    beta: float = 1.0  # the paper: 0 to 3
    alpha_max: float = 26.0  # raised so far before beta is given up
    evaporation: float = 0.02  # the paper's rho, 0.98, is what is retained
    # A cell between two blocked ones that lie diagonally opposite is closed: the paper's gate raise state. Where
    # that closes the way altogether, gates are opened again.
    gates: bool = True

    def __post_init__(self) -> None:
        require("alpha", self.alpha, above=0)
        require("beta", self.beta, at_least=0)
        require("alpha_max", self.alpha_max, at_least=self.alpha)
        require("evaporation", self.evaporation, at_least=0, below=1)

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        unit = "cells propagated"
        if not reachable(query):
            return PlanResult(status=PlanStatus.NO_PATH, reason=NO_WAY, work_unit=unit)
        ground, pheromone, work, notes = self.spread(query)
        if query.start == query.goal:
            here = np.array([query.start], dtype=np.int32)
            return PlanResult(status=PlanStatus.SOLVED, cells=here, cost=0.0, work=work, work_unit=unit)
        walk, note = self.walk(ground, pheromone)
        cells = ground.cells(walk)
        return PlanResult(
            status=PlanStatus.SOLVED,
            cells=cells,
            cost=path_cost(cells, query.grid.cell),
            reason="; ".join(filter(None, (*notes, note))),
            work=work,
            work_unit=unit,
            field=_shown(pheromone).reshape(ground.shape),
        )

    def spread(self, query: Query) -> tuple[ColonyGraph, Floats, int, list[str]]:
        """The ground without its gates, its pheromone, the cells propagated, and what to tell of it."""
        from antdrive.planners.colonies import _kernels_mmas_dstar as kernels

        ground, work = ColonyGraph.of(query), 0
        notes: list[str] = []
        pheromone = np.empty(len(ground.mask))
        retained = 1.0 - self.evaporation
        if self.gates:
            moves = query.grid.moves.copy()
            closed = kernels.close_gates(query.grid.free, moves, *query.start, *query.goal)
            moves.setflags(write=False)
            gated = dataclasses.replace(ground, mask=moves.ravel())
            work = kernels.propagate(gated.mask, ground.offset, ground.start, ground.goal, retained, pheromone)
            if math.isfinite(pheromone[ground.start]):
                return gated, pheromone, work, notes
            notes.append(f"opened {closed} gate cells again, without which there is no way")
        work += kernels.propagate(ground.mask, ground.offset, ground.start, ground.goal, retained, pheromone)
        return ground, pheromone, work, notes

    def walk(self, ground: ColonyGraph, pheromone: Floats) -> tuple[Flat, str]:
        """The cells of the way to the goal, and how the exponents had to change for it."""
        from antdrive.planners.colonies import _kernels_mmas_dstar as kernels

        walk = np.empty(len(ground.mask), dtype=np.int32)
        size, note = 0, ""
        for circles, (alpha, beta) in enumerate(self.exponents()):
            size = kernels.descend(
                ground.mask, ground.offset, ground.shape[1], ground.start, ground.goal, alpha, beta, pheromone, walk
            )
            if circles:
                note = f"the ant went in circles {circles} times: " + (
                    f"alpha was raised from {self.alpha:g} to {alpha:g}"
                    if beta == self.beta
                    else f"alpha up to {self.alpha_max:g} did not help, and beta was set to 0"
                )
            if size > 0:
                break
        return walk[:size], note

    def exponents(self) -> Iterator[tuple[float, float]]:
        """alpha and beta in the order tried; the last always arrives, as pheromone alone only falls on the way."""
        alpha = self.alpha
        while alpha <= self.alpha_max:
            yield alpha, self.beta
            alpha += 1.0
        yield 1.0, 0.0


def _shown(pheromone: Floats) -> Floats:
    """The pheromone, with cells that got none as far up as the highest that did."""
    most = pheromone[np.isfinite(pheromone)].max()
    return np.asarray(np.minimum(pheromone, most))
