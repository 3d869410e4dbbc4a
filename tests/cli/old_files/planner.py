"""A planner of one's own: shortest paths with a penalty beside obstacles."""

import heapq
import math
from dataclasses import asdict, dataclass

import numpy as np

from antdrive.planners import PlanResult, PlanStatus, Query, path_cost
from antdrive.worlds import DIRECTIONS


@dataclass(frozen=True, kw_only=True)
class WideBerth:
    """Dijkstra's search; cells beside an obstacle cost more."""

    price: float = 1.5  # relative extra cost of cells beside an obstacle
    reach: int = 2  # distance from obstacles at which the penalty ends [cells]

    def plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path from the start cell to the goal cell."""
        near = np.pad(~query.grid.free, self.reach, constant_values=True)
        best, before, queue = {query.start: 0.0}, {}, [(0.0, query.start)]
        done = set()
        while queue and query.goal not in done:
            cost, here = heapq.heappop(queue)
            if here in done:
                continue
            done.add(here)
            for k, (down, right) in enumerate(DIRECTIONS):
                if not query.grid.moves[here] >> k & 1:
                    continue
                row, col = here[0] + down, here[1] + right
                beside = near[row : row + 2 * self.reach + 1, col : col + 2 * self.reach + 1].any()
                farther = cost + (math.sqrt(2) if down and right else 1.0) * (1.0 + self.price * float(beside))
                if farther < best.get((row, col), math.inf):
                    best[row, col], before[row, col] = farther, here
                    heapq.heappush(queue, (farther, (row, col)))
        if query.goal not in done:
            return PlanResult(status=PlanStatus.NO_PATH, work=len(done), options=asdict(self))
        path = [query.goal]
        while path[-1] != query.start:
            path.append(before[path[-1]])
        cells = np.array(path[::-1], dtype=np.int32)
        cost = path_cost(cells, query.grid.cell)
        return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=cost, work=len(done), options=asdict(self))
