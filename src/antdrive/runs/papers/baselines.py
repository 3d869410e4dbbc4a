"""A D* that is not optimal, as hasan's baseline must have been: its printed costs are far above those of shortest paths."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np

from antdrive.planners import PlanResult, PlanStatus, Query
from antdrive.planners.plan import Capabilities, Cell, GridPlanner, path_cost
from antdrive.worlds import DIRECTIONS


@dataclass(frozen=True, kw_only=True)
class FirstTouchDStar(GridPlanner):
    """Spreads costs from the goal, nearest to the start first, and never lowers a cost once it is given.

    Both liberties are those of hasan's own listing: a cell gets its cost when it is new, and no order of the
    open list is stated. Paths around concave obstacles are longer than the shortest.
    """

    @property
    def capabilities(self) -> Capabilities:
        """What this planner can do and what it needs."""
        return Capabilities()

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        onward: dict[Cell, Cell] = {query.goal: query.goal}
        queue = [(0.0, query.goal)]
        while queue and query.start not in onward:
            _, cell = heapq.heappop(queue)
            for near in neighbours(query, cell):
                if near not in onward:
                    onward[near] = cell
                    heapq.heappush(queue, (math.dist(near, query.start), near))
        if query.start not in onward:
            return PlanResult(status=PlanStatus.NO_PATH, reason="no path", work=len(onward), work_unit="cells")
        cells = [query.start]
        while cells[-1] != query.goal:
            cells.append(onward[cells[-1]])
        path = np.array(cells, dtype=np.int32)
        cost = path_cost(path, query.grid.cell)
        return PlanResult(status=PlanStatus.SOLVED, cells=path, cost=cost, work=len(onward), work_unit="cells")


def neighbours(query: Query, cell: Cell) -> list[Cell]:
    """The cells to which a move is allowed; all moves of a grid are allowed both ways."""
    moves = int(query.grid.moves[cell])
    return [(cell[0] + dr, cell[1] + dc) for k, (dr, dc) in enumerate(DIRECTIONS) if moves >> k & 1]


def total_cost(query: Query, result: PlanResult) -> float:
    """hasan's total path cost: over all cells that are entered, the sum of what is left to the goal; inf without a path.

    A straight move costs 1 and a diagonal one 1.4, as in the paper; what is left is counted along the path.
    """
    if not result.solved:
        return math.inf
    diagonal = np.abs(np.diff(result.cells, axis=0)).sum(axis=1) == 2
    steps = np.where(diagonal, 1.4, 1.0)
    return float(np.cumsum(steps[::-1]).sum())
