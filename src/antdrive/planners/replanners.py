"""Replanners for every planner, and agents: robots that decide cell by cell while cells are blocked and cleared around them."""

from __future__ import annotations

import abc
import dataclasses
import math
from dataclasses import dataclass
from typing import Protocol, cast, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.planners.graph.incremental import CachedReplanner, Replanner, ReplanningPlanner
from antdrive.planners.plan import Cell, Planner, PlanResult, Query, capabilities_of
from antdrive.planners.validation import planner_errors, request_plan


def replanner_for(planner: Planner, query: Query, rng: np.random.Generator) -> Replanner:
    """The replanner of a planner; `rng` serves all its answers.

    Replanners know which cells are blocked but not by what. So they answer in cells, along allowed moves,
    even for planners that draw lines of their own, and there is none for planners that need discs or motions.

    Raises:
        ValueError: the planner does not plan on cells alone.
        PlannerError: the planner raised something.
    """
    can = capabilities_of(planner)
    for needed, what in ((can.needs_world, "the world's discs"), (can.needs_motions, "known motions")):
        if needed:
            raise FieldError(
                "planner", f"{type(planner).__name__} plans among {what}; it cannot replan by blocked cells"
            )
    if can.own_replanner:
        with planner_errors(planner):
            return cast(ReplanningPlanner, planner).replanner(query, rng)
    return ReplanFromScratch(planner, query, rng)


class ReplanFromScratch(CachedReplanner):
    """A replanner that asks its planner anew after every change."""

    def __init__(self, planner: Planner, query: Query, rng: np.random.Generator) -> None:
        super().__init__(query)
        self._planner, self._rng = planner, rng

    def _replan(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        return dataclasses.replace(request_plan(self._planner, query, self._rng), waypoints=None, length=None)


@dataclass
class AgentStats:
    """What an agent has done so far.

    Attributes:
        steps: moves to another cell
        waits: decisions to wait
        decisions: steps and waits
        propagated: cells that were given pheromone, or that a search expanded
        cycles: circles noticed and left
        length: length of the path so far [m]
        cost: the "total cost" of hasan's table: the cost of the remaining path in cells, summed over all
            cells visited, the first one included. 65 steps straight ahead give 65 + 64 + ... + 1.
    """

    steps: int = 0
    waits: int = 0
    decisions: int = 0
    propagated: int = 0
    cycles: int = 0
    length: float = 0.0
    cost: float = 0.0


@runtime_checkable
class OnlineAgent(Protocol):
    """A robot on a grid that is asked for one step after the other."""

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
        """A sentence on what the agent had to change to get on; empty if nothing."""
        ...

    def move(self, cell: Cell) -> None:
        """Report that the robot is in another cell than the one it chose.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        ...

    def step(self, blocked: npt.ArrayLike) -> Cell | None:
        """The cell to go to, an allowed move away, or None to wait.

        Args:
            blocked: cells (N, 2) that are blocked now, besides those of the grid. Cells that the grid blocks
                and cells outside it may be among them; the robot's own cell has no effect.
        """
        ...


class CellByCellPlanner(Planner, Protocol):
    """A planner that makes an agent of its own, as it declares by `Capabilities.cell_by_cell`."""

    def agent(self, query: Query, rng: np.random.Generator) -> OnlineAgent:
        """An agent at the query's start; `rng` serves all its decisions."""
        ...


def agent_for(planner: Planner, query: Query, rng: np.random.Generator) -> OnlineAgent:
    """The agent that drives by a planner: the planner's own if it has one, else one that follows replanned paths.

    Raises:
        ValueError: the planner does not plan on cells alone.
        PlannerError: the planner raised something.
    """
    if capabilities_of(planner).cell_by_cell:
        with planner_errors(planner):
            return cast(CellByCellPlanner, planner).agent(query, rng)
    return ReplanningAgent(replanner_for(planner, query, rng))


class SteppingAgent(abc.ABC):
    """The part that all agents share: the robot's cell, and the statistics of its steps."""

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
        """A sentence on what the agent had to change to get on; empty if nothing."""
        return ""

    def move(self, cell: Cell) -> None:
        """Report that the robot is in another cell than the one it chose."""
        self._query = dataclasses.replace(self._query, start=cell)
        self._cell = self._query.start

    def step(self, blocked: npt.ArrayLike) -> Cell | None:
        """The cell to go to, an allowed move away, or None to wait."""
        if self.arrived:
            return None
        cells = np.asarray(blocked, dtype=np.int64).reshape(-1, 2)
        inside = ((cells >= 0) & (cells < self._query.grid.shape)).all(axis=1)
        self.stats.decisions += 1
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
        """The next cell, or None to wait; the blocked cells (N, 2) lie on the grid."""


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
