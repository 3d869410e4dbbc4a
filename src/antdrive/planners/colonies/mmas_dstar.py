"""Single-ant planner on pheromone spread from the goal.

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

RESPREAD = "respread pheromone around blocked cells"
PATIENCE = 4  # consecutive waits, or visits of one cell, before an agent respreads pheromone
ONLINE_FACTOR = 2.0  # factor on alpha per cycle of an agent; large, because the robot has to drive each cycle


@dataclass(frozen=True, kw_only=True)
class MaxMinDStar(GridPlanner):
    """One ant follows pheromone spread from the goal like D*'s costs.

    hasan's improved max-min algorithm: the ant always takes the neighbour with the smallest pheromone^alpha
    distance^beta, the numerator of eq. 1. The paper's listing (l. 193-195) divides this product by itself, for blocked
    cells only; the text (l. 161) has the minimum, for free ones. Because of the straight distance to the goal, the ant
    may cycle in front of a wall. The author chose other exponents for such maps; here the rule `exponents` serves all
    maps, and the ant always arrives. The result's `reason` reports the changes. Max-min ants' bounds, deposits of the
    best ant and random choices (l. 60-82) are not in the paper's procedures, nor here: see `MaxMinAnts`.

    Known weaknesses, measured (docs/papers/hasan.md): with alpha 1 and beta 1 the ant cycles on all candidates for five
    of the paper's six environments; with the paper's exponents it cycles on 40, 2 and 1 of 50 candidates for three. With
    the default exponents paths are up to 13 per cent longer than the shortest. With a quarter of 50 x 50 cells blocked
    they are 1.8 per cent longer in the median and 44 per cent at worst.

    Attributes:
        alpha: initial exponent of the pheromone; in the paper 1 to 26, depending on the environment
        beta: initial exponent of the distance; in the paper 0 to 3
        alpha_max: maximum alpha before beta becomes 0; None: the exponents are fixed as in the paper, and a plan
            whose ant cycles ends without a path
        evaporation: fraction of pheromone lost; the paper's rho, 0.98, is the fraction retained. It scales all pheromone
            alike, so it changes no path
        gates: whether to close cells between two diagonally opposite blocked cells (the paper's
            "gate raise state"); if that leaves no path, they are reopened
        lowers: whether a cheaper way lowers a cell's cost, as in D*; False: the first cost stays, as in the paper's
            listing, which gives costs to new cells only (l. 136)

    Raises:
        FieldError: an option is out of range; names it and the valid range.
    """

    alpha: float = 1.0
    beta: float = 1.0
    alpha_max: float | None = 26.0
    evaporation: float = 0.02
    gates: bool = True
    lowers: bool = True

    def __post_init__(self) -> None:
        require("alpha", self.alpha, above=0)
        require("beta", self.beta, at_least=0)
        if self.alpha_max is not None:
            require("alpha_max", self.alpha_max, at_least=self.alpha)
        require("evaporation", self.evaporation, at_least=0, below=1)

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities and requirements of this planner."""
        return Capabilities(cell_by_cell=True, complete=self.alpha_max is not None, deterministic=True, turns=True)

    def agent(self, query: Query, rng: np.random.Generator) -> PheromoneAgent:
        """Return hasan's robot at the query's start; it does not use `rng`."""
        return PheromoneAgent(self, query)

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Spread pheromone from the goal and descend it from the start."""
        unit = "cells propagated"
        if not reachable(query):
            return PlanResult(status=PlanStatus.NO_PATH, reason=UNREACHABLE, work_unit=unit)
        graph, pheromone, work, notes = self.spread(query)
        if query.start == query.goal:
            here = np.array([query.start], dtype=np.int32)
            return PlanResult(status=PlanStatus.SOLVED, cells=here, cost=0.0, work=work, work_unit=unit)
        walk, note = self.walk(graph, pheromone)
        if not len(walk):
            return PlanResult(status=PlanStatus.STOPPED, reason=note, work=work, work_unit=unit)
        cells = graph.cells(walk)
        return PlanResult(
            status=PlanStatus.SOLVED,
            cells=cells,
            cost=path_cost(cells, query.grid.cell),
            reason="; ".join(filter(None, (*notes, note))),
            work=work,
            work_unit=unit,
            field=-graph.draw(-_finite(pheromone), np.empty(graph.shape)),
        )

    def spread(self, query: Query) -> tuple[ColonyGraph, Floats, int, list[str]]:
        """Return the ant's graph, the pheromone (nodes,), the number of nodes that received some, and remarks."""
        from antdrive.planners.colonies import _kernels_mmas_dstar as kernels

        graph, work = ColonyGraph.of(query), 0
        notes: list[str] = []
        pheromone = np.empty(len(graph.mask))
        retained = 1.0 - self.evaporation
        if self.gates:
            moves, closed = closed_gates(query)
            mask = graph.mask & graph.of_nodes(moves)
            mask.setflags(write=False)  # as a grid's
            gated = dataclasses.replace(graph, mask=mask)
            work = kernels.propagate(gated.moves, graph.start, graph.goal, retained, self.lowers, pheromone)
            if math.isfinite(pheromone[graph.start]):
                return gated, pheromone, work, notes
            notes.append(f"reopened {closed} gate cells; without them there is no path")
        work += kernels.propagate(graph.moves, graph.start, graph.goal, retained, self.lowers, pheromone)
        return graph, pheromone, work, notes

    def walk(self, graph: ColonyGraph, pheromone: Floats) -> tuple[Flat, str]:
        """Return the nodes of the path to the goal on `graph`, none if the ant cycles on, and a remark on the exponents.

        The ant follows the `pheromone` (nodes,) of `spread`.
        """
        from antdrive.planners.colonies import _kernels_mmas_dstar as kernels

        walk = np.empty(len(graph.mask), dtype=np.int32)
        size, note = 0, ""
        for circles, (alpha, beta) in enumerate(self.exponents()):
            size = kernels.descend(graph.arrays, alpha, beta, pheromone, walk)
            if circles:
                note = f"the ant went in circles {circles} times: {self.describe_exponents(alpha, beta)}"
            if size > 0:
                return walk[:size], note
        return walk[:0], f"the ant went in circles with alpha {self.alpha:g} and beta {self.beta:g}"

    def exponents(self, *, factor: float = 1.0, increment: float = 1.0) -> Iterator[tuple[float, float]]:
        """Yield alpha and beta in the order of attempts; each cycle of the ant triggers the next attempt.

        alpha rises up to `alpha_max`, which reduces the influence of the straight distance; finally beta is 0.
        With beta 0 the ant always arrives, since pheromone decreases at every step. Without `alpha_max` there is one
        attempt.

        Args:
            factor: factor on alpha per cycle
            increment: increment of alpha per cycle, after the factor. A plan increments alpha by 1, as attempts are
                cheap; an agent doubles it (`ONLINE_FACTOR`), as its robot drives the cycle.
        """
        alpha, beta = float(self.alpha), float(self.beta)
        if self.alpha_max is None:
            yield alpha, beta
            return
        while alpha <= self.alpha_max:
            yield alpha, beta
            alpha = factor * alpha + increment
        yield 1.0, 0.0

    def describe_exponents(self, alpha: float, beta: float) -> str:
        """Describe how `alpha` and `beta` differ from the initial exponents; empty if they do not."""
        if beta != self.beta:
            return f"alpha up to {self.alpha_max:g} did not help, and beta was set to 0"
        return f"alpha was raised from {self.alpha:g} to {alpha:g}" if alpha != self.alpha else ""


class PheromoneAgent(SteppingAgent):
    """hasan's robot: it decides once per cell, by pheromone spread once from the goal, and never enters an occupied cell.

    The robot moves to the allowed neighbour with the smallest pheromone^alpha distance^beta. Before it returns
    to a cell visited with the current exponents, it detects a cycle and takes the next exponents of
    `MaxMinDStar.exponents`: alpha doubles. If movers keep it waiting, it respreads pheromone around them. The paper's robot
    has neither rule. It knows cells, not headings, so it moves for the disc around the robot.
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
        self._idle = 0  # consecutive waits
        self._enter(self._graph.start)

    @property
    def note(self) -> str:
        """A remark on the agent's changes to make progress; may be empty."""
        circles = f"went in circles {self.stats.cycles} times" if self.stats.cycles else ""
        return "; ".join(
            filter(None, (*self._notes, circles, self._planner.describe_exponents(self._alpha, self._beta)))
        )

    def _decide(self, blocked: npt.NDArray[np.int64]) -> Cell | None:
        mask, cols = self._open_moves(self._graph, blocked), self._graph.shape[1]
        here = self._cell[0] * cols + self._cell[1]
        # After `move`, the robot may be on a cell without pheromone.
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
        graph = self._graph.arrays._replace(mask=mask)
        return int(self._kernels.decide(graph, here, self._alpha, self._beta, self._pheromone))

    def _enter(self, cell: int) -> None:
        self._visits[cell] += 1
        if math.isfinite(self._pheromone[cell]):
            self.stats.cost += float(self._pheromone[cell]) / (1.0 - self._planner.evaporation)

    def _raise_alpha(self, here: int) -> None:
        self.stats.cycles += 1
        self._alpha, self._beta = next(self._exponents, (self._alpha, self._beta))
        self._forget_visits(here)

    def _respread(self, blocked: npt.NDArray[np.int64], here: int) -> None:
        """Respread pheromone around blocked cells; if that leaves no path, also over gate cells."""
        retained = 1.0 - self._planner.evaporation
        for graph in (self._graph, ColonyGraph.of(self._query)):
            pheromone, mask = np.empty_like(self._pheromone), self._open_moves(graph, blocked)
            moves = graph.moves._replace(mask=mask)
            self.stats.propagated += int(
                self._kernels.propagate(moves, here, graph.goal, retained, self._planner.lowers, pheromone)
            )
            if math.isfinite(pheromone[here]):
                self._graph, self._pheromone = graph, pheromone
                self._forget_visits(here)
                if RESPREAD not in self._notes:
                    self._notes.append(RESPREAD)
                return

    def _open_moves(self, graph: ColonyGraph, blocked: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
        """Return the moves (cells,) that remain while these cells (N, 2) are blocked."""
        moves = graph.mask.reshape(graph.shape).copy()
        self._kernels.close_cells(moves, blocked)
        return moves.ravel()

    def _forget_visits(self, here: int) -> None:
        self._visits.fill(0)
        self._visits[here] = 1


def closed_gates(query: Query) -> tuple[npt.NDArray[np.uint8], int]:
    """Return the moves of each cell (rows, cols) of a query's grid with gate cells closed, and their number."""
    from antdrive.planners.colonies import _kernels_mmas_dstar as kernels

    moves = query.grid.moves.copy()
    return moves, int(kernels.close_gates(query.grid.free, moves, *query.start, *query.goal))


def _finite(pheromone: Floats) -> Floats:
    """Return the pheromone, with the highest finite value in cells without any."""
    most = pheromone[np.isfinite(pheromone)].max()
    return np.asarray(np.minimum(pheromone, most))
