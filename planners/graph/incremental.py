"""Plans kept right while the robot moves and cells change, at the price of the change alone."""

from __future__ import annotations

import abc
import dataclasses
import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.planners.graph.search import NO_WAY
from antdrive.planners.plan import Cell, Cells, GridPlanner, PlanResult, PlanStatus, Query
from antdrive.worlds.errors import FieldError

if TYPE_CHECKING:  # a grid brings the compiler with it
    from antdrive.worlds import Grid


@runtime_checkable
class Replanner(Protocol):
    """A query that goes on: tell it where the robot is and what has changed, and ask for the path from there."""

    @property
    def query(self) -> Query:
        """The query as it stands now; its grid is read-only and changes with what is told."""
        ...

    def move(self, start: Cell) -> None:
        """The robot is at another cell; any will do.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        ...

    def block(self, cells: npt.ArrayLike) -> int:
        """Cells (N, 2) are blocked from now on; the number of cells whose moves that changes."""
        ...

    def clear(self, cells: npt.ArrayLike) -> int:
        """Cells (N, 2) are free from now on; the number of cells whose moves that changes."""
        ...

    def change(self, grid: Grid) -> int:
        """The grid is another one of the same shape; the number of cells whose moves that changes."""
        ...

    def result(self) -> PlanResult:
        """The planner's path from where the robot is; `work` and `wall_s` are those of this answer."""
        ...


@dataclass(frozen=True, kw_only=True)
class ReplanningPlanner(GridPlanner):
    """A planner whose search can be taken up again when the world has changed."""

    @abc.abstractmethod
    def replanner(self, query: Query) -> Replanner:
        """A search that goes on after its first answer."""

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        return self.replanner(query).result()


class EditableQuery(abc.ABC):
    """What replanners share: the query as it is now, and which cells have changed since the last answer."""

    def __init__(self, query: Query) -> None:
        from antdrive.planners.graph import (
            _kernels_incremental as _kernels_replan,  # here, so that naming a planner does not load the compiler
        )

        self._common = _kernels_replan
        self._free, self._moves = query.grid.free.copy(), query.grid.moves.copy()
        self._closed: npt.NDArray[np.uint8] | None = None  # what else than blocked cells forbids, once needed
        self._seen = np.empty(self._moves.size, dtype=np.int64)  # where kernels list what they changed
        self._news: list[npt.NDArray[np.int64]] = []  # cells whose moves have changed since the last repair
        self._query = dataclasses.replace(query, grid=self._view(query.grid))

    @property
    def query(self) -> Query:
        """The query as it stands now; its grid is read-only and changes with what is told."""
        return self._query

    def move(self, start: Cell) -> None:
        """The robot is at another cell; any will do.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        self._query = dataclasses.replace(self._query, start=start)

    def block(self, cells: npt.ArrayLike) -> int:
        """Cells (N, 2) are blocked from now on; the number of cells whose moves that changes.

        Raises:
            ValueError: a cell lies outside the grid.
        """
        return self._mark(cells, False)

    def clear(self, cells: npt.ArrayLike) -> int:
        """Cells (N, 2) are free from now on; the number of cells whose moves that changes.

        A move that the grid closed although its cells were free stays closed.

        Raises:
            ValueError: a cell lies outside the grid.
        """
        return self._mark(cells, True)

    def change(self, grid: Grid) -> int:
        """The grid is another one of the same shape; the number of cells whose moves that changes.

        Raises:
            ValueError: the shape is another.
        """
        if grid.shape != self._query.grid.shape:
            raise FieldError("grid", f"must have the shape {self._query.grid.shape}, got {grid.shape}")
        self._free[:] = grid.free
        self._closed = None
        return self._tell(int(self._common.adopt(self._moves, grid.moves, self._seen)))

    @abc.abstractmethod
    def result(self) -> PlanResult:
        """A path from where the robot is; `work` and `wall_s` are those of this answer."""

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
        count, outside = map(int, self._common.mark(self._free, self._closed, self._moves, rc, free, self._seen))
        if outside >= 0:
            row, col = rc[outside]
            rows, cols = self._moves.shape
            raise FieldError("cells", f"({row}, {col}) is outside the grid of {rows} rows and {cols} columns")
        return self._tell(count)

    def _tell(self, count: int) -> int:
        if count:
            self._news.append(self._seen[:count].copy())
        return count

    def _changed(self) -> npt.NDArray[np.int64]:
        """The cells whose moves have changed since this was last asked."""
        changed = self._news[0] if len(self._news) == 1 else np.concatenate([self._seen[:0], *self._news])
        self._news.clear()
        return changed


class IncrementalSearch(EditableQuery):
    """A search that is repaired; its last path holds for as long as nothing has changed."""

    def __init__(self, query: Query) -> None:
        super().__init__(query)
        self._path: Cells | None = None  # the last one

    def result(self) -> PlanResult:
        """The shortest path from where the robot is; `work` and `wall_s` are those of this repair."""
        started = time.perf_counter()
        blocked = self._query.blocked_end
        if blocked:
            return PlanResult(status=PlanStatus.NO_PATH, reason=blocked, wall_s=time.perf_counter() - started)
        cells, diagonal, work = self._onward() or self._renew()
        self._path = cells
        if not len(cells):
            return PlanResult(status=PlanStatus.NO_PATH, reason=NO_WAY, work=work, wall_s=time.perf_counter() - started)
        cost = self._query.grid.cell * (len(cells) - 1 - diagonal + math.sqrt(2.0) * diagonal)
        return PlanResult(
            status=PlanStatus.SOLVED, cells=cells, cost=cost, work=work, wall_s=time.perf_counter() - started
        )

    @abc.abstractmethod
    def _repair(self, changed: npt.NDArray[np.int64], start: int) -> tuple[Cells, int, int]:
        """The path, empty if there is none, after these cells have changed; its diagonal steps; the cells expanded."""

    def _renew(self) -> tuple[Cells, int, int]:
        return self._repair(self._changed(), self._index(self._query.start))

    def _onward(self) -> tuple[Cells, int, int] | None:
        """What is left of the path, if nothing has changed and the robot is on it."""
        if self._news or self._path is None:
            return None
        here = np.flatnonzero((self._path == self._query.start).all(axis=1))
        if not len(here):
            return None
        rest = self._path[here[0] :]
        return rest, int((np.diff(rest, axis=0) != 0).all(axis=1).sum()), 0
