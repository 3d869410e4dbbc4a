"""The courier's planner: shortest paths with a penalty near obstacles."""

import heapq
import math
from dataclasses import dataclass

import numpy as np

from antdrive.planners import GridPlanner, PlanResult, PlanStatus, Query, path_cost
from antdrive.worlds import DIRECTIONS

LENGTHS = [1.0 if 0 in step else math.sqrt(2) for step in DIRECTIONS]  # of the eight moves [cells]


@dataclass(frozen=True, kw_only=True)
class WideBerth(GridPlanner):
    """Dijkstra's search with a penalty on cells near obstacles."""

    price: float = 1.5  # relative extra cost of cells next to an obstacle
    reach: int = 3  # distance from obstacles at which the penalty ends [cells]

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        prices, moves = 1.0 + self.price * self._closeness(query.grid.free), query.grid.moves
        best, before = {query.start: 0.0}, {}
        queue, done = [(0.0, query.start)], set()
        while queue and query.goal not in done:
            cost, here = heapq.heappop(queue)
            if here in done:
                continue
            done.add(here)
            for k, (down, right) in enumerate(DIRECTIONS):
                cell = here[0] + down, here[1] + right
                if not moves[here] >> k & 1:
                    continue
                farther = cost + LENGTHS[k] * prices[cell]
                if farther < best.get(cell, math.inf):
                    best[cell], before[cell] = farther, here
                    heapq.heappush(queue, (farther, cell))
        if query.goal not in done:
            return PlanResult(status=PlanStatus.NO_PATH, work=len(done))
        path = [query.goal]
        while path[-1] != query.start:
            path.append(before[path[-1]])
        cells = np.array(path[::-1], dtype=np.int32)
        return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=path_cost(cells, query.grid.cell), work=len(done))

    def _closeness(self, free: np.ndarray) -> np.ndarray:
        """Return 1 on cells next to a blocked one, falling to 0 at `reach` cells."""
        near = np.pad(~free, 1, constant_values=True)
        closeness = np.zeros(free.shape)
        for k in range(self.reach):
            grown = near.copy()
            for down, right in DIRECTIONS:
                grown |= np.roll(near, (down, right), axis=(0, 1))
            closeness[(grown & ~near)[1:-1, 1:-1]] = 1.0 - k / self.reach
            near = grown
        return closeness
