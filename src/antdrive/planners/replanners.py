"""Replanners for every planner, and agents that decide cell by cell on a changing grid."""

from __future__ import annotations

import abc
import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, cast, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.guarded import value_text
from antdrive.planners.errors import PlannerError, planner_errors
from antdrive.planners.graph.incremental import CachedReplanner, Replanner, ReplanningPlanner
from antdrive.planners.plan import Cell, Planner, PlanResult, Query, capabilities_of
from antdrive.planners.validation import request_plan

Made = TypeVar("Made")


def replanner_for(planner: Planner, query: Query, rng: np.random.Generator) -> Replanner:
    """Return the replanner of a planner; all its plans draw from `rng`.

    A replanner knows which cells are blocked, not the obstacles. It plans in cells along allowed moves, even for
    any-angle planners. Planners that need discs or motions have none.

    Raises:
        ValueError: the planner needs discs or motions, or the grid has turns and the planner plans for the disc.
        PlannerError: the planner raised an exception.
    """
    can = capabilities_of(planner)
    if query.grid.turns and not can.turns:
        raise FieldError("planner", f"{type(planner).__name__} plans for the disc; the grid has turns")
    for needed, what in ((can.needs_world, "the world's discs"), (can.needs_motions, "known motions")):
        if needed:
            raise FieldError(
                "planner", f"{type(planner).__name__} plans among {what}; it cannot replan by blocked cells"
            )
    if can.own_replanner:
        with planner_errors(planner):
            return _of_kind(Replanner, planner, cast(ReplanningPlanner, planner).replanner(query, rng))
    return ReplanFromScratch(planner, query, rng)


def _of_kind(protocol: Any, planner: Planner, made: Made) -> Made:
    """Return the planner's replanner or agent if it has all methods of the protocol."""
    if isinstance(made, protocol):
        return made
    names = (*protocol.__annotations__, *(name for name in vars(protocol) if not name.startswith("_")))
    missing = [name for name in names if not hasattr(made, name)]
    name, kind = type(planner).__name__, protocol.__name__
    raise PlannerError(name, f"returned {value_text(made)} instead of a {kind}; it lacks {', '.join(missing)}")


class ReplanFromScratch(CachedReplanner):
    """A replanner that plans from scratch after every change."""

    def __init__(self, planner: Planner, query: Query, rng: np.random.Generator) -> None:
        super().__init__(query)
        self._planner, self._rng = planner, rng

    def _replan(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        return dataclasses.replace(request_plan(self._planner, query, self._rng), waypoints=None, length=None)


@dataclass
class AgentStats:
    """Statistics of an agent.

    Attributes:
        steps: moves to another cell
        waits: decisions to wait
        propagated: cells that received pheromone, or that a search expanded
        cycles: cycles detected and broken
        length: length of the path so far [m]
        cost: the "total cost" of hasan's table: the cost of the remaining path in cells, summed over all
            visited cells, the first included. 65 straight steps give 65 + 64 + ... + 1.
    """

    steps: int = 0
    waits: int = 0
    propagated: int = 0
    cycles: int = 0
    length: float = 0.0
    cost: float = 0.0


@runtime_checkable
class OnlineAgent(Protocol):
    """A robot on a grid that decides step by step."""

    stats: AgentStats

    @property
    def cell(self) -> Cell:
        """The robot's cell."""
        ...

    @property
    def arrived(self) -> bool:
        """Whether the robot is at the goal."""
        ...

    @property
    def note(self) -> str:
        """A note on the agent's measures to make progress; may be empty."""
        ...

    def move(self, cell: Cell) -> None:
        """Set the robot's cell if it differs from the agent's choice.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        ...

    def step(self, blocked: npt.ArrayLike) -> Cell | None:
        """Return the next cell, an allowed move away, or None to wait.

        Args:
            blocked: additional blocked cells (N, 2). Cells blocked in the grid, cells outside it and the robot's
                own cell have no effect.
        """
        ...


class CellByCellPlanner(Planner, Protocol):
    """A planner with its own agent, declared by `Capabilities.cell_by_cell`."""

    def agent(self, query: Query, rng: np.random.Generator) -> OnlineAgent:
        """Return an agent at the query's start; all its decisions draw from `rng`."""
        ...


def agent_for(planner: Planner, query: Query, rng: np.random.Generator) -> OnlineAgent:
    """Return the planner's own agent if it has one, else an agent that follows replanned paths.

    Agents know cells, not headings.

    Raises:
        ValueError: the planner needs discs or motions, or the grid has turns.
        PlannerError: the planner raised an exception.
    """
    if query.grid.turns:
        raise FieldError("query", "has a grid with turns; agents know cells, not headings")
    if capabilities_of(planner).cell_by_cell:
        with planner_errors(planner):
            return _of_kind(OnlineAgent, planner, cast(CellByCellPlanner, planner).agent(query, rng))
    return ReplanningAgent(replanner_for(planner, query, rng))


class SteppingAgent(abc.ABC):
    """Base class of agents: the robot's cell and the statistics of its steps."""

    def __init__(self, query: Query) -> None:
        self.stats = AgentStats()
        self._query = query
        self._cell = query.start

    @property
    def cell(self) -> Cell:
        """The robot's cell."""
        return self._cell

    @property
    def arrived(self) -> bool:
        """Whether the robot is at the goal."""
        return self._cell == self._query.goal

    @property
    def note(self) -> str:
        """A note on the agent's measures to make progress; may be empty."""
        return ""

    def move(self, cell: Cell) -> None:
        """Set the robot's cell if it differs from the agent's choice."""
        self._query = dataclasses.replace(self._query, start=cell)
        self._cell = self._query.start

    def step(self, blocked: npt.ArrayLike) -> Cell | None:
        """Return the next cell, an allowed move away, or None to wait."""
        if self.arrived:
            return None
        cells = np.asarray(blocked, dtype=np.int64).reshape(-1, 2)
        inside = ((cells >= 0) & (cells < self._query.grid.shape)).all(axis=1)
        to = self._decide(cells[inside & (cells != self._cell).any(axis=1)])
        if to is None:
            self.stats.waits += 1
            return None
        self.stats.steps += 1
        self.stats.length += self._query.grid.cell * math.dist(self._cell, to)
        self._cell = to
        return to

    @abc.abstractmethod
    def _decide(self, blocked: npt.NDArray[np.int64]) -> Cell | None:
        """Return the next cell, or None to wait; the blocked cells (N, 2) lie on the grid."""


class ReplanningAgent(SteppingAgent):
    """An agent that reports blocked cells to a replanner and takes the first step of its path."""

    def __init__(self, replanner: Replanner) -> None:
        super().__init__(replanner.query)
        self._replanner = replanner
        self._free = replanner.query.grid.free.copy()
        self._reported: set[Cell] = set()

    def _decide(self, blocked: npt.NDArray[np.int64]) -> Cell | None:
        now = {(int(r), int(c)) for r, c in blocked if self._free[r, c]}
        if cleared := sorted(self._reported - now):
            self._replanner.clear(cleared)
        if new := sorted(now - self._reported):
            self._replanner.block(new)
        self._reported = now
        if self._replanner.query.start != self._cell:
            self._replanner.move(self._cell)
        result = self._replanner.result()
        self.stats.propagated += result.work
        if len(result.cells) < 2:
            return None
        cell = self._query.grid.cell
        to = (int(result.cells[1][0]), int(result.cells[1][1]))
        if not self.stats.steps:
            self.stats.cost += result.cost / cell
        self.stats.cost += result.cost / cell - math.dist(self._cell, to)
        return to
