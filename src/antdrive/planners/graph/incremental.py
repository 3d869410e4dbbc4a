"""Replanning on a grid: editable queries and incremental searches.

D* is that of A. Stentz, *Optimal and efficient path planning for partially-known environments*, ICRA 1994.
"""

from __future__ import annotations

import abc
import dataclasses
import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.planners.graph.search import UNREACHABLE
from antdrive.planners.plan import (
    Capabilities,
    Cell,
    Cells,
    GridPlanner,
    Planner,
    PlanResult,
    PlanStatus,
    Query,
    path_cost,
)

if TYPE_CHECKING:
    from antdrive.worlds import Grid


@runtime_checkable
class Replanner(Protocol):
    """An editable query and its plan.

    Report the robot's cell and the changed cells, then request the path from there.
    """

    @property
    def query(self) -> Query:
        """The current query. Its grid is a read-only view that reflects every edit."""
        ...

    def move(self, start: Cell) -> None:
        """Set the robot's cell `start`, which need not be on the path.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        ...

    def block(self, cells: npt.ArrayLike) -> int:
        """Mark cells (N, 2) as blocked.

        Returns the number of cells whose moves changed.
        """
        ...

    def clear(self, cells: npt.ArrayLike) -> int:
        """Mark cells (N, 2) as free.

        Returns the number of cells whose moves changed.
        """
        ...

    def change(self, grid: Grid) -> int:
        """Replace the grid with another of the same shape.

        Returns the number of cells whose moves changed.
        """
        ...

    def result(self) -> PlanResult:
        """Return the path from the robot's cell; `work` and `wall_s` are those of this call."""
        ...


class ReplanningPlanner(Planner, Protocol):
    """A planner with its own replanner, declared by `Capabilities.own_replanner`."""

    def replanner(self, query: Query, rng: np.random.Generator) -> Replanner:
        """Return a replanner for a query; all its plans draw from `rng`."""
        ...


class CachedReplanner(abc.ABC):
    """Base class of replanners: the current query and its cached plan.

    The plan stays valid for any cell on its path until the grid changes.
    """

    def __init__(self, query: Query) -> None:
        from antdrive.planners.graph import _kernels_incremental  # imported here because it loads the compiler

        self._common = _kernels_incremental
        self._free, self._moves = query.grid.free.copy(), query.grid.moves.copy()
        # Moves that the grid forbids although the cells are free; computed on first use.
        self._closed: npt.NDArray[np.uint8] | None = None
        self._edited = np.empty(self._moves.size, dtype=np.int64)  # buffer for the cells of one edit
        self._edits: list[npt.NDArray[np.int64]] = []  # the cells of each edit since the last answer
        self._query = dataclasses.replace(query, grid=self._view(query.grid), task=None)
        self._last: PlanResult | None = None

    @property
    def query(self) -> Query:
        """The current query. Its grid is a read-only view that reflects every edit."""
        return self._query

    def move(self, start: Cell) -> None:
        """Set the robot's cell `start`, which need not be on the path."""
        if start != self._query.start:
            self._query = dataclasses.replace(self._query, start=start, unreachable="")

    def block(self, cells: npt.ArrayLike) -> int:
        """Mark cells (N, 2) as blocked; returns the number of cells whose moves changed."""
        return self._mark(cells, False)

    def clear(self, cells: npt.ArrayLike) -> int:
        """Mark cells (N, 2) as free; returns the number of cells whose moves changed.

        Moves that the grid forbids between free cells stay forbidden.
        """
        return self._mark(cells, True)

    def change(self, grid: Grid) -> int:
        """Replace the grid with another of the same shape; returns the number of cells whose moves changed."""
        if grid.shape != self._query.grid.shape:
            raise FieldError("grid", f"must have the shape {self._query.grid.shape}, got {grid.shape}")
        self._free[:] = grid.free
        self._closed = None
        return self._record(int(self._common.adopt(self._moves, grid.moves, self._edited)))

    def result(self) -> PlanResult:
        """Return the path from the robot's cell; `work` and `wall_s` are those of this call."""
        started = time.perf_counter()
        blocked = self._query.blocked_end
        if blocked:
            return PlanResult(status=PlanStatus.NO_PATH, reason=blocked, wall_s=time.perf_counter() - started)
        answer = self._remaining_path()
        if answer is None:
            answer = self._last = self._replan(self._query, self._take_edits())
        return dataclasses.replace(answer, wall_s=time.perf_counter() - started)

    @abc.abstractmethod
    def _replan(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        """Return the plan for a query with free ends; `changed` holds the flat indices of the cells whose moves changed."""

    def _remaining_path(self) -> PlanResult | None:
        """Return the rest of the last path if nothing has changed and the robot is on it."""
        if self._edits or self._last is None or not self._last.solved:
            return None
        here = np.flatnonzero((self._last.cells == self._query.start).all(axis=1))
        if not len(here):
            return None
        rest = self._last.cells[here[0] :]
        return dataclasses.replace(self._last, cells=rest, cost=path_cost(rest, self._query.grid.cell), work=0)

    def _index(self, cell: Cell) -> int:
        return int(cell[0] * self._moves.shape[1] + cell[1])

    def _view(self, like: Grid) -> Grid:
        free, moves = self._free.view(), self._moves.view()
        free.setflags(write=False)
        moves.setflags(write=False)
        return dataclasses.replace(like, free=free, moves=moves)

    def _mark(self, cells: npt.ArrayLike, free: bool) -> int:
        if self._closed is None:
            self._closed = np.empty_like(self._moves)
            self._common.closed_moves(self._free, self._moves, self._closed)
        rc = np.asarray(cells, dtype=np.int64).reshape(-1, 2)
        count, outside = map(int, self._common.mark(self._free, self._closed, self._moves, rc, free, self._edited))
        if outside >= 0:
            row, col = rc[outside]
            rows, cols = self._moves.shape
            raise FieldError("cells", f"({row}, {col}) is outside the grid of {rows} rows and {cols} columns")
        return self._record(count)

    def _record(self, count: int) -> int:
        if count:
            self._edits.append(self._edited[:count].copy())
            self._query = dataclasses.replace(self._query, unreachable="")  # it was said of the grid before
        return count

    def _take_edits(self) -> npt.NDArray[np.int64]:
        """Return the cells whose moves changed since the last call."""
        changed = self._edits[0] if len(self._edits) == 1 else np.concatenate([self._edited[:0], *self._edits])
        self._edits.clear()
        return changed


class IncrementalSearch(CachedReplanner):
    """A search that repairs its result after an edit."""

    def _replan(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        cells, diagonal, work = self._repair(changed, self._index(query.start))
        if not len(cells):
            return PlanResult(status=PlanStatus.NO_PATH, reason=UNREACHABLE, work=work)
        cost = query.grid.cell * (len(cells) - 1 - diagonal + math.sqrt(2.0) * diagonal)
        return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=cost, work=work)

    @abc.abstractmethod
    def _repair(self, changed: npt.NDArray[np.int64], start: int) -> tuple[Cells, int, int]:
        """Return the path from a cell after edits, its number of diagonal steps, and the number of expanded cells.

        The path is empty if there is none.
        """


@dataclass(frozen=True, kw_only=True)
class IncrementalPlanner(GridPlanner):
    """A planner whose incremental search is also its replanner."""

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities and requirements of this planner."""
        return Capabilities(own_replanner=True, deterministic=True)

    @abc.abstractmethod
    def replanner(self, query: Query, rng: np.random.Generator) -> IncrementalSearch:
        """Return a search that can be repaired after its first plan; it does not use `rng`."""

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        return self.replanner(query, rng).result()


@dataclass(frozen=True, kw_only=True)
class DStar(IncrementalPlanner):
    """The shortest path, repaired when the map changes, by basic D*.

    The algorithm is that of Stentz 1994.

    Known weakness, measured (docs/notebook/planning-speed.md): the search has no heuristic. A first plan on 200 x
    200 cells among discs takes 4.4 ms, four times as long as with D* Lite; the median repair takes 43 us against
    30.
    """

    def replanner(self, query: Query, rng: np.random.Generator) -> DStarSearch:
        """Return a search that can be repaired after its first plan; it does not use `rng`."""
        return DStarSearch(query)


class DStarSearch(IncrementalSearch):
    """D*: Dijkstra's algorithm from the goal, with RAISE and LOWER states that propagate changes."""

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
        path: tuple[Cells, int, int] = self._kernels.repair(
            changed, self._moves, start, self._goal, self._state, self._h, self._back, self._heap, self._place
        )
        return path


@dataclass(frozen=True, kw_only=True)
class DStarLite(IncrementalPlanner):
    """The shortest path, repaired when the map changes, by D* Lite.

    The algorithm is that of Koenig & Likhachev 2002.

    Known weakness, measured (docs/notebook/planning-speed.md): some repairs cost nearly as much as a new search.
    On 200 x 200 cells among discs one repair in a hundred takes 0.66 ms or more, a plan from scratch 1.0 ms; with
    D* one in a hundred takes 0.12 ms or more.
    """

    def replanner(self, query: Query, rng: np.random.Generator) -> DStarLiteSearch:
        """Return a search that can be repaired after its first plan; it does not use `rng`."""
        return DStarLiteSearch(query)


class DStarLiteSearch(IncrementalSearch):
    """D* Lite: the optimised version (Figure 4 of the paper) in exact integer costs."""

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
            self._moves, self._index(query.start), self._goal, self._state, self._g, self._rhs, self._heap, self._place
        )

    def _repair(self, changed: npt.NDArray[np.int64], start: int) -> tuple[Cells, int, int]:
        path: tuple[Cells, int, int] = self._kernels.repair(
            changed, self._moves, start, self._goal, self._state, self._g, self._rhs, self._heap, self._place
        )
        return path
