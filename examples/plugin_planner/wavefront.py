"""A minimal custom planner: breadth-first search over the grid's moves."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from antdrive.planners import GridPlanner, PlanResult, PlanStatus, Query, path_cost
from antdrive.worlds import DIRECTIONS


@dataclass(frozen=True, kw_only=True)
class Wavefront(GridPlanner):
    """Breadth-first search for the path with the fewest moves."""

    straight: bool = False  # no diagonal moves

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        before, queue = {query.start: query.start}, deque([query.start])
        while queue and query.goal not in before:
            row, col = here = queue.popleft()
            for k in range(0, 8, 2 if self.straight else 1):
                cell = row + DIRECTIONS[k][0], col + DIRECTIONS[k][1]
                if query.grid.moves[here] >> k & 1 and cell not in before:
                    before[cell] = here
                    queue.append(cell)
        if query.goal not in before:
            return PlanResult(status=PlanStatus.NO_PATH, work=len(before))
        path = [query.goal]
        while path[-1] != query.start:
            path.append(before[path[-1]])
        cells = np.array(path[::-1], dtype=np.int32)
        cost = path_cost(cells, query.grid.cell)
        return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=cost, work=len(before))
