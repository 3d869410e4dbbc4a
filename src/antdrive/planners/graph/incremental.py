"""Replanning on a grid: queries that can be edited while the robot moves, and searches that are repaired."""

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
from antdrive.planners.graph.search import NO_WAY
from antdrive.planners.plan import Capabilities, Cell, Cells, GridPlanner, Planner, PlanResult, PlanStatus, Query

if TYPE_CHECKING:  # importing a grid loads the compiler
    from antdrive.worlds import Grid


@runtime_checkable
class Replanner(Protocol):
    """A query that can be edited, and its answer.

    Report where the robot is and which cells changed, then ask for the path from there.
    """

    @property
    def query(self) -> Query:
        """The query as it stands now. Its grid is read-only and changes with every edit."""
        ...

    def move(self, start: Cell) -> None:
        """Report that the robot is at another cell, `start`, which need not be on the path.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        ...

    def block(self, cells: npt.ArrayLike) -> int:
        """Report that cells (N, 2) are blocked from now on.

        Returns how many cells have other moves than before.
        """
        ...

    def clear(self, cells: npt.ArrayLike) -> int:
        """Report that cells (N, 2) are free from now on.

        Returns how many cells have other moves than before.
        """
        ...

    def change(self, grid: Grid) -> int:
        """Replace the grid by another one of the same shape.

        Returns how many cells have other moves than before.
        """
        ...

    def result(self) -> PlanResult:
        """The planner's path from the robot's cell; `work` and `wall_s` are what this call took."""
        ...


class ReplanningPlanner(Planner, Protocol):
    """A planner that makes a replanner of its own, as it declares by `Capabilities.own_replanner`."""

    def replanner(self, query: Query, rng: np.random.Generator) -> Replanner:
        """A replanner for a query; `rng` serves all its answers."""
        ...


class EditableQuery(abc.ABC):
    """The part that all replanners share: the present query, and the cells changed since the last answer."""

    def __init__(self, query: Query) -> None:
        from antdrive.planners.graph import _kernels_incremental  # imported here because it loads the compiler

        self._common = _kernels_incremental
        self._free, self._moves = query.grid.free.copy(), query.grid.moves.copy()
        # The moves that the grid closes although its cells are free; found when first needed.
        self._closed: npt.NDArray[np.uint8] | None = None
        self._edited = np.empty(self._moves.size, dtype=np.int64)  # kernels list the cells of one edit here
        self._edits: list[npt.NDArray[np.int64]] = []  # the cells of each edit since the last answer
        self._query = dataclasses.replace(query, grid=self._view(query.grid))

    @property
    def query(self) -> Query:
        """The query as it stands now. Its grid is read-only and changes with every edit."""
        return self._query

    def move(self, start: Cell) -> None:
        """Report that the robot is at another cell, `start`, which need not be on the path.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        self._query = dataclasses.replace(self._query, start=start)

    def block(self, cells: npt.ArrayLike) -> int:
        """Report that cells (N, 2) are blocked from now on; returns how many cells have other moves than before.

        Raises:
            ValueError: a cell lies outside the grid.
        """
        return self._mark(cells, False)

    def clear(self, cells: npt.ArrayLike) -> int:
        """Report that cells (N, 2) are free from now on; returns how many cells have other moves than before.

        A move that the grid closed although its cells were free stays closed.

        Raises:
            ValueError: a cell lies outside the grid.
        """
        return self._mark(cells, True)

    def change(self, grid: Grid) -> int:
        """Replace the grid by another one of the same shape; returns how many cells have other moves than before.

        Raises:
            ValueError: the shape is another.
        """
        if grid.shape != self._query.grid.shape:
            raise FieldError("grid", f"must have the shape {self._query.grid.shape}, got {grid.shape}")
        self._free[:] = grid.free
        self._closed = None
        return self._record(int(self._common.adopt(self._moves, grid.moves, self._edited)))

    @abc.abstractmethod
    def result(self) -> PlanResult:
        """The planner's path from the robot's cell; `work` and `wall_s` are what this call took."""

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
        return count

    def _take_edits(self) -> npt.NDArray[np.int64]:
        """The cells whose moves changed since the last call."""
        changed = self._edits[0] if len(self._edits) == 1 else np.concatenate([self._edited[:0], *self._edits])
        self._edits.clear()
        return changed


class IncrementalSearch(EditableQuery):
    """A search that is repaired after an edit. Its last path is kept as long as nothing has changed."""

    def __init__(self, query: Query) -> None:
        super().__init__(query)
        self._path: Cells | None = None  # the last path

    def result(self) -> PlanResult:
        """The shortest path from the robot's cell; `work` and `wall_s` are what this call took."""
        started = time.perf_counter()
        blocked = self._query.blocked_end
        if blocked:
            return PlanResult(status=PlanStatus.NO_PATH, reason=blocked, wall_s=time.perf_counter() - started)
        cells, diagonal, work = self._rest_of_path() or self._repaired_path()
        self._path = cells
        if not len(cells):
            return PlanResult(status=PlanStatus.NO_PATH, reason=NO_WAY, work=work, wall_s=time.perf_counter() - started)
        cost = self._query.grid.cell * (len(cells) - 1 - diagonal + math.sqrt(2.0) * diagonal)
        return PlanResult(
            status=PlanStatus.SOLVED, cells=cells, cost=cost, work=work, wall_s=time.perf_counter() - started
        )

    @abc.abstractmethod
    def _repair(self, changed: npt.NDArray[np.int64], start: int) -> tuple[Cells, int, int]:
        """The path from a cell after other cells changed, its diagonal steps, and how many cells were expanded.

        The path is empty if there is none.
        """

    def _repaired_path(self) -> tuple[Cells, int, int]:
        return self._repair(self._take_edits(), self._index(self._query.start))

    def _rest_of_path(self) -> tuple[Cells, int, int] | None:
        """The rest of the last path, if nothing has changed and the robot is on it."""
        if self._edits or self._path is None:
            return None
        here = np.flatnonzero((self._path == self._query.start).all(axis=1))
        if not len(here):
            return None
        rest = self._path[here[0] :]
        return rest, int((np.diff(rest, axis=0) != 0).all(axis=1).sum()), 0


@dataclass(frozen=True, kw_only=True)
class IncrementalPlanner(GridPlanner):
    """A planner by an incremental search, which is also its replanner."""

    @property
    def capabilities(self) -> Capabilities:
        """What this planner can do and what it needs."""
        return Capabilities(own_replanner=True)

    @abc.abstractmethod
    def replanner(self, query: Query, rng: np.random.Generator) -> IncrementalSearch:
        """A search that can be repaired after its first answer; it draws nothing from `rng`."""

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        return self.replanner(query, rng).result()
