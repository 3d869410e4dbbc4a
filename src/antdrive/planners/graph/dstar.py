"""D* (A. Stentz, *Optimal and efficient path planning for partially-known environments*, ICRA 1994)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.planners.graph.incremental import IncrementalPlanner, IncrementalSearch
from antdrive.planners.plan import Cells, Query


@dataclass(frozen=True, kw_only=True)
class DStar(IncrementalPlanner):
    """The shortest path over the grid's moves by basic D* (Stentz 1994), repaired when the map changes.

    Known weakness, measured (docs/benchmarks.md): the search is not directed. A first plan on 200 x 200 cells
    among discs takes 4.4 ms, four times as long as with D* Lite; the median repair takes 43 us against 30.
    """

    def replanner(self, query: Query, rng: np.random.Generator) -> DStarSearch:
        """A search that can be repaired after its first answer; it draws nothing from `rng`."""
        return DStarSearch(query)


class DStarSearch(IncrementalSearch):
    """D*: Dijkstra's algorithm from the goal, whose RAISE and LOWER states propagate changes."""

    def __init__(self, query: Query) -> None:
        super().__init__(query)
        from antdrive.planners.graph import _kernels_dstar

        self._kernels = _kernels_dstar
        cells = self._moves.size
        self._goal = self._index(query.goal)
        self._state = np.empty(1, dtype=np.int64)  # the length of the OPEN list
        self._h = np.empty(cells, dtype=np.int64)
        self._back = np.empty(cells, dtype=np.uint8)
        self._heap = np.empty((cells, 3), dtype=np.int64)
        self._place = np.empty(cells, dtype=np.int32)
        self._kernels.begin(self._goal, self._state, self._h, self._back, self._heap, self._place)

    def _repair(self, changed: npt.NDArray[np.int64], start: int) -> tuple[Cells, int, int]:
        found: tuple[Cells, int, int] = self._kernels.repair(
            changed,
            self._moves,
            start,
            self._goal,
            self._state,
            self._h,
            self._back,
            self._heap,
            self._place,
        )
        return found
