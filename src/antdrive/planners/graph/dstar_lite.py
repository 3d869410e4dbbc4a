"""D* Lite (S. Koenig and M. Likhachev, *D\\* Lite*, AAAI 2002): A* from the goal, repaired after a change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antdrive.planners.graph.incremental import IncrementalPlanner, IncrementalSearch
from antdrive.planners.plan import Cells, Query


@dataclass(frozen=True, kw_only=True)
class DStarLite(IncrementalPlanner):
    """The shortest path over the grid's moves by D* Lite (Koenig & Likhachev 2002), repaired when the map changes.

    Known weakness, measured (docs/benchmarks.md): some repairs cost nearly as much as a new search. On 200 x 200
    cells among discs one repair in a hundred takes 0.66 ms or more, a plan from scratch 1.0 ms; with D* one in
    a hundred takes 0.12 ms or more.
    """

    def replanner(self, query: Query, rng: np.random.Generator) -> DStarLiteSearch:
        """A search that can be repaired after its first answer; it draws nothing from `rng`."""
        return DStarLiteSearch(query)


class DStarLiteSearch(IncrementalSearch):
    """D* Lite: the optimised version, Figure 4 of the paper, in exact integer costs."""

    def __init__(self, query: Query) -> None:
        super().__init__(query)
        from antdrive.planners.graph import _kernels_dstar_lite

        self._kernels = _kernels_dstar_lite
        cells = self._moves.size
        self._goal = self._index(query.goal)
        self._state = np.empty(3, dtype=np.int64)  # the queue's size, k_m, s_last
        self._g = np.empty(cells, dtype=np.int64)
        self._rhs = np.empty(cells, dtype=np.int64)
        self._heap = np.empty((cells, 3), dtype=np.int64)
        self._place = np.empty(cells, dtype=np.int32)
        self._kernels.begin(
            self._moves,
            self._index(query.start),
            self._goal,
            self._state,
            self._g,
            self._rhs,
            self._heap,
            self._place,
        )

    def _repair(self, changed: npt.NDArray[np.int64], start: int) -> tuple[Cells, int, int]:
        found: tuple[Cells, int, int] = self._kernels.repair(
            changed,
            self._moves,
            start,
            self._goal,
            self._state,
            self._g,
            self._rhs,
            self._heap,
            self._place,
        )
        return found
