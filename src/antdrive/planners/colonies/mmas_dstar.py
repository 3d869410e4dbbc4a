"""One ant on pheromone that spreads from the goal.

A. H. Hasan, *Robot path planning based on improved max-min ant colony optimization algorithm in dynamic
environment* (hasan). `MaxMinDStar` plans in a static world; its `PheromoneAgent` drives among movers.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import require
from antdrive.planners.colonies.colony import ColonyGraph, Flat
from antdrive.planners.graph.search import UNREACHABLE, reachable
from antdrive.planners.plan import Capabilities, Cell, GridPlanner, PlanResult, PlanStatus, Query, path_cost
from antdrive.planners.replanners import SteppingAgent

RESPREAD = "spread pheromone anew around what was in the way"
PATIENCE = 4  # waits in a row, or visits of one cell, after which an agent spreads pheromone anew
ONLINE_FACTOR = 2.0  # what an agent multiplies alpha by, as each circle costs it a detour that is really driven


@dataclass(frozen=True, kw_only=True)
class MaxMinDStar(GridPlanner):
    """One ant that follows pheromone spread from the goal as D* spreads costs: hasan's improved max-min algorithm.

    The ant always takes the neighbour of the smallest `pheromone^alpha * distance^beta` (eq. 1, as the
    paper's program reads it). As the straight distance to the goal counts, the ant may walk in circles in
    front of a wall. The author chose other exponents for such maps; here `exponents` is the rule for all of
    them, and it always arrives. The result's `reason` reports what it did.

    Known weaknesses, measured (docs/papers/hasan.md): with alpha 1 and beta 1 alpha must be raised in five of
    the paper's six environments, with the exponents that the paper gives for each in none; paths are up to 11
    per cent longer than the shortest. With a quarter of 50 x 50 cells blocked they are 1.8 per cent longer in
    the median and 44 per cent at worst.

    Attributes:
        alpha: exponent of the pheromone to begin with; in the paper 1 to 26, depending on the environment
        beta: exponent of the distance to begin with; in the paper 0 to 3
        alpha_max: highest alpha that is tried before beta becomes 0
        evaporation: share of the pheromone that is lost; the paper's rho, 0.98, is the share that is kept
        gates: whether cells between two diagonally opposite blocked cells are closed, the paper's gate raise
            state; if that leaves no path, they are opened again
    """

    alpha: float = 1.0
    beta: float = 1.0
    alpha_max: float = 26.0
    evaporation: float = 0.02
    gates: bool = True

    def __post_init__(self) -> None:
        require("alpha", self.alpha, above=0)
        require("beta", self.beta, at_least=0)
        require("alpha_max", self.alpha_max, at_least=self.alpha)
        require("evaporation", self.evaporation, at_least=0, below=1)

    @property
    def capabilities(self) -> Capabilities:
        """What this planner can do and what it needs."""
        return Capabilities(cell_by_cell=True)

    def agent(self, query: Query, rng: np.random.Generator) -> PheromoneAgent:
        """hasan's robot at the query's start; it draws nothing from `rng`."""
        return PheromoneAgent(self, query)

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        unit = "cells propagated"
        if not reachable(query):
            return PlanResult(status=PlanStatus.NO_PATH, reason=UNREACHABLE, work_unit=unit)
        graph, pheromone, work, notes = self.spread(query)
        if query.start == query.goal:
            here = np.array([query.start], dtype=np.int32)
            return PlanResult(status=PlanStatus.SOLVED, cells=here, cost=0.0, work=work, work_unit=unit)
        walk, note = self.walk(graph, pheromone)
        cells = graph.cells(walk)
        return PlanResult(
            status=PlanStatus.SOLVED,
            cells=cells,
            cost=path_cost(cells, query.grid.cell),
            reason="; ".join(filter(None, (*notes, note))),
            work=work,
            work_unit=unit,
            field=_finite(pheromone).reshape(graph.shape),
        )

    def spread(self, query: Query) -> tuple[ColonyGraph, Floats, int, list[str]]:
        """The graph to walk on, the pheromone (cells,), how many cells got some, and remarks on the plan."""
        from antdrive.planners.colonies import _kernels_mmas_dstar as kernels

        graph, work = ColonyGraph.of(query), 0
        notes: list[str] = []
        pheromone = np.empty(len(graph.mask))
        retained = 1.0 - self.evaporation
        if self.gates:
            moves = query.grid.moves.copy()
            closed = kernels.close_gates(query.grid.free, moves, *query.start, *query.goal)
            moves.setflags(write=False)
            gated = dataclasses.replace(graph, mask=moves.ravel())
            work = kernels.propagate(gated.mask, graph.offset, graph.start, graph.goal, retained, pheromone)
            if math.isfinite(pheromone[graph.start]):
                return gated, pheromone, work, notes
            notes.append(f"opened {closed} gate cells again, without which there is no way")
        work += kernels.propagate(graph.mask, graph.offset, graph.start, graph.goal, retained, pheromone)
        return graph, pheromone, work, notes

    def walk(self, graph: ColonyGraph, pheromone: Floats) -> tuple[Flat, str]:
        """The flat cells of the path to the goal, and a remark on how the exponents had to change for it.

        Args:
            graph: the graph to walk on
            pheromone: the pheromone of each cell (cells,), as `spread` returns it
        """
        from antdrive.planners.colonies import _kernels_mmas_dstar as kernels

        walk = np.empty(len(graph.mask), dtype=np.int32)
        size, note = 0, ""
        for circles, (alpha, beta) in enumerate(self.exponents()):
            size = kernels.descend(
                graph.mask, graph.offset, graph.shape[1], graph.start, graph.goal, alpha, beta, pheromone, walk
            )
            if circles:
                note = f"the ant went in circles {circles} times: {self.describe_exponents(alpha, beta)}"
            if size > 0:
                break
        return walk[:size], note

    def exponents(self, *, factor: float = 1.0, increment: float = 1.0) -> Iterator[tuple[float, float]]:
        """alpha and beta in the order in which they are tried; the next ones are due when the ant walks in a circle.

        alpha rises up to `alpha_max`, which makes the straight distance count less and less; at last beta is
        0. That always arrives, as pheromone alone decreases at every step.

        Args:
            factor: what alpha is multiplied by at each circle
            increment: what is then added. A plan raises alpha by 1, as trying again costs next to nothing; an
                agent doubles it (`ONLINE_FACTOR`), as its robot drives the circle.
        """
        alpha, beta = float(self.alpha), float(self.beta)
        while alpha <= self.alpha_max:
            yield alpha, beta
            alpha = factor * alpha + increment
        yield 1.0, 0.0

    def describe_exponents(self, alpha: float, beta: float) -> str:
        """A sentence on how `alpha` and `beta` differ from the exponents to begin with.

        It is empty if they do not.
        """
        if beta != self.beta:
            return f"alpha up to {self.alpha_max:g} did not help, and beta was set to 0"
        return f"alpha was raised from {self.alpha:g} to {alpha:g}" if alpha != self.alpha else ""


class PheromoneAgent(SteppingAgent):
    """hasan's robot: one decision per cell, on pheromone spread once from the goal, and never into an occupied cell.

    The robot goes to the allowed neighbour of the smallest `pheromone^alpha * distance^beta`. When it is
    about to return to a cell that it visited with the current exponents, it is going in a circle and takes
    the next ones of `MaxMinDStar.exponents`. If cells that stay blocked hold it up even then, it spreads
    pheromone anew around them.
    """

    def __init__(self, planner: MaxMinDStar, query: Query) -> None:
        from antdrive.planners.colonies import _kernels_mmas_dstar

        super().__init__(query)
        self._kernels = _kernels_mmas_dstar
        self._planner = planner
        self._exponents = planner.exponents(factor=ONLINE_FACTOR, increment=0.0)
        self._alpha, self._beta = next(self._exponents)
        blocked = query.blocked_end or ("" if reachable(query) else UNREACHABLE)
        self._graph, self._pheromone, self.stats.propagated, notes = planner.spread(query)
        self._notes = [blocked] if blocked else notes
        self._visits = np.zeros(len(self._pheromone), dtype=np.int64)
        self._idle = 0  # waits in a row
        self._enter(self._graph.start)

    @property
    def note(self) -> str:
        """A sentence on what the agent had to change to get on; empty if nothing."""
        circles = f"went in circles {self.stats.cycles} times" if self.stats.cycles else ""
        return "; ".join(
            filter(None, (*self._notes, circles, self._planner.describe_exponents(self._alpha, self._beta)))
        )

    def _decide(self, blocked: npt.NDArray[np.int64]) -> Cell | None:
        mask, cols = self._open_moves(self._graph, blocked), self._graph.shape[1]
        here = self._cell[0] * cols + self._cell[1]
        # A robot that was moved may be where no pheromone was spread.
        astray = not math.isfinite(self._pheromone[here]) and not self._idle
        to = self._best_neighbour(mask, here)
        visits = int(self._visits[to]) if to >= 0 else 0
        if visits and self._beta:
            self._raise_alpha(here)
            to = self._best_neighbour(mask, here)
        elif astray or visits >= PATIENCE or self._idle >= PATIENCE - 1:
            self.stats.cycles += visits > 0
            self._idle = 0
            self._respread(blocked, here)
            to = self._best_neighbour(self._open_moves(self._graph, blocked), here)
        if to < 0:
            self._idle += 1
            return None
        self._idle = 0
        self._enter(to)
        return to // cols, to % cols

    def _best_neighbour(self, mask: npt.NDArray[np.uint8], here: int) -> int:
        graph = self._graph
        return int(
            self._kernels.decide(
                mask, graph.offset, graph.shape[1], here, graph.goal, self._alpha, self._beta, self._pheromone
            )
        )

    def _enter(self, cell: int) -> None:
        self._visits[cell] += 1
        if math.isfinite(self._pheromone[cell]):
            self.stats.cost += float(self._pheromone[cell]) / (1.0 - self._planner.evaporation)

    def _raise_alpha(self, here: int) -> None:
        self.stats.cycles += 1
        self._alpha, self._beta = next(self._exponents)
        self._forget_visits(here)

    def _respread(self, blocked: npt.NDArray[np.int64], here: int) -> None:
        """Spread pheromone around what is blocked; if that leaves no path, over gate cells too."""
        retained = 1.0 - self._planner.evaporation
        for graph in (self._graph, ColonyGraph.of(self._query)):
            pheromone, mask = np.empty_like(self._pheromone), self._open_moves(graph, blocked)
            self.stats.propagated += int(
                self._kernels.propagate(mask, graph.offset, here, graph.goal, retained, pheromone)
            )
            if math.isfinite(pheromone[here]):
                self._graph, self._pheromone = graph, pheromone
                self._forget_visits(here)
                if RESPREAD not in self._notes:
                    self._notes.append(RESPREAD)
                return

    def _open_moves(self, graph: ColonyGraph, blocked: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
        """The moves (cells,) that are left while these cells (N, 2) are blocked."""
        moves = graph.mask.reshape(graph.shape).copy()
        self._kernels.close_cells(moves, blocked)
        return moves.ravel()

    def _forget_visits(self, here: int) -> None:
        self._visits.fill(0)
        self._visits[here] = 1


def _finite(pheromone: Floats) -> Floats:
    """The pheromone, with the highest finite value in cells that got none."""
    most = pheromone[np.isfinite(pheromone)].max()
    return np.asarray(np.minimum(pheromone, most))
