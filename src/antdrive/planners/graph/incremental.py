"""Replanning on a grid: editable queries and incremental searches.

D* is that of A. Stentz, *Optimal and efficient path planning for partially-known environments*, ICRA 1994.
"""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.kernel_cache import clock, compiled
from antdrive.planners.graph.search import UNREACHABLE
from antdrive.planners.plan import (
    Capabilities,
    Cell,
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

    def move(self, start: Cell, heading: int = 0) -> None:
        """Set the robot's cell `start`, which need not be on the path.

        On a grid with turns, the start's node is the label of a heading, an index of `DIRECTIONS`. Other replanners need no
        `heading`.

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

    def change(self, grid: Grid, cells: npt.NDArray[np.int64] | None = None) -> int:
        """Replace the grid with another of the same shape, with turns exactly if the first has.

        Only the flat `cells` (K,), in ascending order, may differ from the grid before, themselves or their moves; None: all.
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
        grid, turns = query.grid, query.grid.turns
        self._free, self._moves = grid.free.copy(), grid.moves.copy()
        # With turns, nodes keep their numbers when labels change, unlike those of rasterised grids.
        self._cell, self._label, self._masks = turns.cell, turns.label, turns.moves.copy()
        self._own = self._common.nodes_of_cells(turns.cell, len(turns.label))  # nodes of each cell, also unused ones
        self._heading = next(iter(query.start_headings), 0)
        # Moves that the grid forbids although the cells are free; computed on first use.
        self._closed: npt.NDArray[np.uint8] | None = None
        self._edited = np.empty(self._moves.size, dtype=np.int64)  # buffer for the cells of one edit
        self._edits: list[npt.NDArray[np.int64]] = []  # the cells of each edit since the last answer
        self._query = dataclasses.replace(query, grid=self._view(grid), task=None)
        self._last: PlanResult | None = None
        self._last_start = query.start_node

    @property
    def query(self) -> Query:
        """The current query. Its grid is a read-only view that reflects every edit."""
        return self._query

    def move(self, start: Cell, heading: int = 0) -> None:
        """Set the robot's cell `start`, which need not be on the path, and with turns a heading of its node."""
        self._heading = heading
        if (start, label := self._label_at(start)) != (self._query.start, self._query.start_label):
            self._query = dataclasses.replace(self._query, start=start, start_label=label, unreachable="")

    def block(self, cells: npt.ArrayLike) -> int:
        """Mark cells (N, 2) as blocked; returns the number of cells whose moves changed."""
        return self._mark(cells, False)

    def clear(self, cells: npt.ArrayLike) -> int:
        """Mark cells (N, 2) as free; returns the number of cells whose moves changed.

        Moves that the grid forbids between free cells stay forbidden, with turns also those of cells that it blocks.
        """
        return self._mark(cells, True)

    def change(self, grid: Grid, cells: npt.NDArray[np.int64] | None = None) -> int:
        """Replace the grid with another of the same shape, with turns exactly if the first has.

        Only the flat `cells` (K,), in ascending order, may differ from the grid before, themselves or their moves; None: all.
        With turns all cells are compared, and the robot's node becomes the label of its last heading.
        Returns the number of cells whose moves changed.
        """
        if grid.shape != self._query.grid.shape:
            raise FieldError("grid", f"must have the shape {self._query.grid.shape}, got {grid.shape}")
        if bool(grid.turns) != bool(self._query.grid.turns):
            raise FieldError("grid", "must have turns exactly if the first grid has")
        self._closed = None
        if cells is not None and not grid.turns:
            grids = self._free.ravel(), self._moves.ravel(), grid.free.ravel(), grid.moves.ravel()
            return self._record(int(self._common.adopt_cells(*grids, cells, self._edited)))
        self._free[:] = grid.free
        relabelled = np.empty(len(self._label), dtype=np.bool_)
        if grid.turns:
            self._label = self._label.copy()
            self._cell = self._common.relabel(self._label, grid.turns.label, self._own, self._cell.copy(), relabelled)
            self._masks = np.empty(len(self._cell), dtype=np.uint8)
            self._common.move_masks(grid.moves.ravel(), self._label, self._masks)
            label = self._label_at(self._query.start)
            self._query = dataclasses.replace(self._query, grid=self._view(grid), start_label=label)
        count = int(self._common.adopt(self._moves, grid.moves, relabelled, self._edited))
        return self._record(count)

    @compiled()
    def result(self) -> PlanResult:
        """Return the path from the robot's cell; `work` and `wall_s` are those of this call."""
        spent = clock()
        blocked = self._query.blocked_end
        if blocked:
            return PlanResult(status=PlanStatus.NO_PATH, reason=blocked, wall_s=spent())
        answer = self._remaining_path()
        if answer is None:
            answer = self._last = self._replan(self._query, self._take_edits())
            self._last_start = self._query.start_node
        return dataclasses.replace(answer, wall_s=spent())

    @abc.abstractmethod
    def _replan(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        """Return the plan for a query with free ends; `changed` holds the flat indices of the cells whose moves changed."""

    def _remaining_path(self) -> PlanResult | None:
        """Return the rest of the last path if nothing has changed and the robot is on it."""
        if self._edits or self._last is None or not self._last.solved:
            return None
        nodes = self._query.grid.nodes_along(self._last_start, self._last.cells)
        here = np.flatnonzero(nodes == self._query.start_node)
        if not len(here):
            return None
        rest = self._last.cells[here[0] :]
        return dataclasses.replace(self._last, cells=rest, cost=path_cost(rest, self._query.grid.cell), work=0)

    def _index(self, cell: Cell) -> int:
        return int(cell[0] * self._moves.shape[1] + cell[1])

    def _label_at(self, cell: Cell) -> int:
        """Return the node of a cell's label of the robot's heading on a grid with turns; -1 without one."""
        flat = self._index(cell)
        return int(self._label[flat, self._heading]) if 0 <= flat < len(self._label) else -1

    def _nodes(self, cells: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Return all nodes of flat cells."""
        if not len(self._own):
            return cells
        nodes = self._own[cells].astype(np.int64).ravel()
        return np.asarray(nodes[nodes >= 0])

    def _view(self, like: Grid) -> Grid:
        free, moves, masks = self._free.view(), self._moves.view(), self._masks.view()
        for array in (free, moves, masks, self._cell, self._label):
            array.setflags(write=False)
        turns = dataclasses.replace(like.turns, cell=self._cell, label=self._label, moves=masks)
        grid = dataclasses.replace(like, free=free, moves=moves, turns=turns)
        self._graph = grid.graph
        return grid

    def _mark(self, cells: npt.ArrayLike, free: bool) -> int:
        if self._closed is None:
            self._closed = np.empty_like(self._moves)
            self._common.closed_moves(self._free, self._moves, len(self._label) > 0, self._closed)
        rc = np.asarray(cells, dtype=np.int64).reshape(-1, 2)
        grid = self._free, self._closed, self._moves, self._label, self._masks
        count, outside = map(int, self._common.mark(*grid, rc, free, self._edited))
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
    """A search from the goal that repairs its result after an edit.

    Args:
        query: the initial query
        kernels: the compiled search: D* by Stentz, or D* Lite optimised (Figure 4) in exact integer costs
        state: how many numbers it keeps
        values: type and initial value of each array that it keeps by node, besides its heap
    """

    def __init__(self, query: Query, kernels: Any, state: int, values: Sequence[tuple[type, int]]) -> None:
        super().__init__(query)
        nodes = len(self._graph.mask)
        self._kernels, self._goal = kernels, query.goal_cell
        self._state = np.empty(state, dtype=np.int64)
        self._initial = [initial for _, initial in values] + [0, -1]
        self._arrays: list[npt.NDArray[Any]] = [np.empty(nodes, dtype=kind) for kind, _ in values]
        self._arrays += [np.empty((nodes, 3), dtype=np.int64), np.empty(nodes, dtype=np.int32)]  # the heap, rows in it
        goals = np.array(query.grid.nodes_at(query.goal), dtype=np.int64)
        start, cols = self._index(query.start), query.grid.shape[1]
        kernels.begin(cols, start, self._goal, goals, self._state, *self._arrays)

    def _replan(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        if len(self._graph.mask) > len(self._arrays[0]):  # with turns, cells got more labels
            capacity = len(self._graph.mask) * 5 // 4
            self._arrays = [extended(*pair, capacity) for pair in zip(self._arrays, self._initial, strict=True)]
        nodes, start = self._nodes(changed), query.start_node
        cells, diagonal, work = self._kernels.repair(nodes, self._graph, start, self._goal, self._state, *self._arrays)
        if not len(cells):
            return PlanResult(status=PlanStatus.NO_PATH, reason=UNREACHABLE, work=work)
        cost = query.grid.cell * (len(cells) - 1 - diagonal + math.sqrt(2.0) * diagonal)
        return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=cost, work=work)


def extended(array: npt.NDArray[Any], initial: float, rows: int) -> npt.NDArray[Any]:
    """Return an array with rows of an initial value added up to a number of rows."""
    if len(array) == rows:
        return array
    more = np.full((rows - len(array), *array.shape[1:]), initial, dtype=array.dtype)
    return np.concatenate((array, more))


@dataclass(frozen=True, kw_only=True)
class IncrementalPlanner(GridPlanner):
    """A planner whose incremental search is also its replanner."""

    capabilities: ClassVar[Capabilities] = Capabilities(own_replanner=True, deterministic=True, turns=True)

    @abc.abstractmethod
    def replanner(self, query: Query, rng: np.random.Generator) -> IncrementalSearch:
        """Return a search that can be repaired after its first plan; it does not use `rng`."""

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Search the grid once, without repairs."""
        return self.replanner(query, rng).result()


@dataclass(frozen=True, kw_only=True)
class DStar(IncrementalPlanner):
    """The shortest path, repaired when the map changes, by basic D*.

    The algorithm is that of Stentz 1994.

    Known weakness, measured (docs/notebook/planning-speed.md): the search has no heuristic. A first plan on 200 x
    200 cells among discs takes 4.4 ms, four times as long as with D* Lite; the median repair takes 43 us against
    30.
    """

    def replanner(self, query: Query, rng: np.random.Generator) -> IncrementalSearch:
        """Return a search that can be repaired after its first plan; it does not use `rng`."""
        from antdrive.planners.graph import _kernels_dstar as kernels
        from antdrive.planners.graph._kernels_incremental import NEVER

        return IncrementalSearch(query, kernels, 1, [(np.int64, NEVER), (np.uint8, 8)])


@dataclass(frozen=True, kw_only=True)
class DStarLite(IncrementalPlanner):
    """The shortest path, repaired when the map changes, by D* Lite.

    The algorithm is that of Koenig & Likhachev 2002.

    Known weakness, measured (docs/notebook/planning-speed.md): some repairs cost nearly as much as a new search.
    On 200 x 200 cells among discs one repair in a hundred takes 0.66 ms or more, a plan from scratch 1.0 ms; with
    D* one in a hundred takes 0.12 ms or more.
    """

    def replanner(self, query: Query, rng: np.random.Generator) -> IncrementalSearch:
        """Return a search that can be repaired after its first plan; it does not use `rng`."""
        from antdrive.planners.graph import _kernels_dstar_lite as kernels
        from antdrive.planners.graph._kernels_incremental import NEVER

        return IncrementalSearch(query, kernels, 3, [(np.int64, NEVER)] * 2)
