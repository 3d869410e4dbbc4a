"""Artificial potential field of Lee et al. 2008, section III (eq. 5 to 12)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import require
from antdrive.planners.graph.search import UNREACHABLE, reachable
from antdrive.planners.plan import Capabilities, GridPlanner, PlanResult, PlanStatus, Query, path_cost


@dataclass(frozen=True, kw_only=True)
class PotentialField(GridPlanner):
    """Descent in a potential field, which may end in a local minimum.

    The goal attracts and obstacles repel (Lee et al. 2008, III). The planner follows the potential U = 1/2 k_att
    d_goal^2 (eq. 9) + 1/2 k_rep (1/d - 1/d0)^2 for d <= d0 (eq. 11) along the allowed move of steepest descent.
    At a local minimum it stops and reports the cell; it cannot cycle, as every step descends. The paper gives no
    values for the gains and d0; with these defaults, runs arrive most often among random cylinders.

    Known weaknesses, measured (docs/notebook/planner-quality.md): local minima. In forests of cylinders 9 of 10
    runs arrive on 20 x 20 cells and 2 of 10 on 50 x 50 and on 100 x 100; with a quarter of single cells blocked,
    1 of 10 and none. An obstacle near the goal shifts the minimum away from it
    (`tests/planners/graph/test_apf.py`).

    `d` is the distance from the cell's centre to the nearest cylinder, less the grid's inflation; on a grid
    without a world, to the centre of the nearest blocked cell. Walls do not repel.

    Attributes:
        k_att: gain of the attraction
        k_rep: gain of the repulsion
        influence: d0, the range of the repulsion [m]
    """

    k_att: float = 1.0
    k_rep: float = 0.01
    influence: float = 0.5

    def __post_init__(self) -> None:
        require("k_att", self.k_att, above=0)
        require("k_rep", self.k_rep, at_least=0)
        require("influence", self.influence, above=0)

    capabilities: ClassVar[Capabilities] = Capabilities(complete=False, deterministic=True)

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Descend the potential from the start."""
        from antdrive.planners.graph import _kernels_apf  # imported here because it loads the compiler

        if not reachable(query):
            return PlanResult(status=PlanStatus.NO_PATH, reason=UNREACHABLE, work_unit="steps")
        field = self.potential(query)
        cells = _kernels_apf.roll_down(query.grid.moves, field, *query.start, *query.goal)
        last, work = tuple(map(int, cells[-1])), len(cells) - 1
        if last != query.goal:
            left = query.grid.cell * math.dist(last, query.goal)
            reason = f"stuck in a local minimum of the potential at cell {last}, {left:.2f} m from the goal"
            return PlanResult(status=PlanStatus.STOPPED, reason=reason, work=work, work_unit="steps", field=field)
        cost = path_cost(cells, query.grid.cell)
        return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=cost, work=work, work_unit="steps", field=field)

    def potential(self, query: Query) -> Floats:
        """Return the potential U of every cell (R, C), inf where blocked."""
        grid = query.grid
        distance = obstacle_distance(query, self.influence)
        rows, cols = (index - end for index, end in zip(np.indices(grid.shape), query.goal, strict=True))
        attraction = 0.5 * self.k_att * grid.cell * grid.cell * (rows * rows + cols * cols)  # eq. 9
        push = 1.0 / np.maximum(distance, 1e-9) - 1.0 / self.influence
        repulsion = np.where(distance <= self.influence, 0.5 * self.k_rep * push * push, 0.0)  # eq. 11
        return np.where(grid.free, attraction + repulsion, math.inf)  # eq. 7


def obstacle_distance(query: Query, reach: float = math.inf) -> Floats:
    """Return the distance from each cell's centre to the nearest obstacle (R, C) [m]."""
    from antdrive.planners.graph import _kernels_apf

    grid = query.grid
    if query.task is not None:
        distance, discs = np.full(grid.shape, np.inf), query.task.world.discs
        within = min(reach, grid.cell * sum(grid.shape))
        _kernels_apf.disc_distances(discs, *grid.origin, grid.cell, grid.inflate, within, distance)
        return distance
    squared = np.empty(grid.shape, dtype=np.int64)
    some = _kernels_apf.squared_distances(grid.free, squared)
    return grid.cell * np.sqrt(squared) if some else np.full(grid.shape, np.inf)
