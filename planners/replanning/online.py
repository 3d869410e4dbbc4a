"""Robots that decide cell by cell while cells are blocked and cleared around them."""

from __future__ import annotations

import abc
import dataclasses
import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.planners.colonies.colony import ColonyGraph
from antdrive.planners.colonies.mmas_dstar import MaxMinDStar
from antdrive.planners.graph.incremental import Replanner
from antdrive.planners.graph.search import NO_WAY, reachable
from antdrive.planners.plan import Cell, Planner, Query
from antdrive.planners.replanning.replanners import replanner_for

SPREAD_ANEW = "spread pheromone anew around what was in the way"
PATIENCE = 4  # decisions without a way on, or visits of one cell, after which pheromone spreads anew


@dataclass
class Tally:
    """What a robot has done so far."""

    steps: int = 0
    waits: int = 0
    decisions: int = 0
    propagated: int = 0  # cells that were given pheromone, or that a search expanded
    cycles: int = 0  # found, and left
    length: float = 0.0  # of the way so far [m]
    # What hasan's table calls total cost: the cost of the way to the goal, in cells, summed over all cells visited, the
    # first one included. (65 steps straight ahead give 65 + 64 + ... + 1.)
    cost: float = 0.0


@runtime_checkable
class OnlinePlanner(Protocol):
    """A robot on its way that is asked for one step after the other."""

    tally: Tally

    @property
    def cell(self) -> Cell:
        """Where it is."""
        ...

    @property
    def arrived(self) -> bool:
        """Whether that is the goal."""
        ...

    @property
    def note(self) -> str:
        """What it had to do to get on, for people; empty if nothing."""
        ...

    def move(self, cell: Cell) -> None:
        """It has come to be in another cell than it chose.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        ...

    def step(self, blocked: npt.ArrayLike) -> Cell | None:
        """The cell to go to now that these cells (N, 2) are blocked too, an allowed move away; None: wait.

        Cells that the grid itself blocks, or that lie outside, may be among them, and the robot's own has no effect.
        """
        ...


def online_for(planner: Planner, query: Query, rng: np.random.Generator) -> OnlinePlanner:
    """A robot that drives online by a planner: hasan's ant by `mmas-dstar`, else one that follows its replanned paths.

    Raises:
        ValueError: the planner does not plan on cells alone.
    """
    if isinstance(planner, MaxMinDStar):
        return OnlineAnt(planner, query)
    return Follower(replanner_for(planner, query, rng))


class Walker(abc.ABC):
    """What robots that decide online share: where they are, and counting."""

    def __init__(self, query: Query) -> None:
        self.tally = Tally()
        self._query = query
        self._cell = query.start

    @property
    def cell(self) -> Cell:
        """Where it is."""
        return self._cell

    @property
    def arrived(self) -> bool:
        """Whether that is the goal."""
        return self._cell == self._query.goal

    @property
    def note(self) -> str:
        """What it had to do to get on, for people; empty if nothing."""
        return ""

    def move(self, cell: Cell) -> None:
        """It has come to be in another cell than it chose.

        Raises:
            ValueError: the cell lies outside the grid.
        """
        self._query = dataclasses.replace(self._query, start=cell)
        self._cell = self._query.start

    def step(self, blocked: npt.ArrayLike) -> Cell | None:
        """The cell to go to now that these cells (N, 2) are blocked too, an allowed move away; None: wait."""
        if self.arrived:
            return None
        cells = np.asarray(blocked, dtype=np.int64).reshape(-1, 2)
        inside = ((cells >= 0) & (cells < self._query.grid.shape)).all(axis=1)
        self.tally.decisions += 1
        to = self._decide(cells[inside & (cells != self._cell).any(axis=1)])
        if to is None:
            self.tally.waits += 1
            return None
        self.tally.steps += 1
        self.tally.length += self._query.grid.cell * math.dist(self._cell, to)
        self._cell = to
        return to

    @abc.abstractmethod
    def _decide(self, blocked: npt.NDArray[np.int64]) -> Cell | None:
        """The next cell; `blocked` (N, 2) lie on the grid."""


class OnlineAnt(Walker):
    """hasan's robot: one decision per cell on pheromone spread once from the goal, and never into a cell that is occupied.

    It goes to the allowed neighbour of the smallest `pheromone^alpha * distance^beta`. The paper tells a pair of
    exponents per environment; here one rule serves all. `alpha` and `beta` begin as the planner has them, at 1.
    When the robot would return to a cell that it has been to under the present exponents, it goes in a circle, and alpha
    doubles; beyond the planner's `alpha_max`, 26, distance is left out: beta is 0, and pheromone alone leads on. What
    keeps it even then, cells blocked for long, is met by spreading the pheromone anew around them.
    """

    def __init__(self, planner: MaxMinDStar, query: Query) -> None:
        from antdrive.planners.colonies import _kernels_mmas_dstar

        super().__init__(query)
        self._kernels = _kernels_mmas_dstar
        self._planner, self._alpha, self._beta = planner, float(planner.alpha), float(planner.beta)
        blocked = query.blocked_end or ("" if reachable(query) else NO_WAY)
        self._ground, self._pheromone, self.tally.propagated, notes = planner.spread(query)
        self._notes = [blocked] if blocked else notes
        self._visits = np.zeros(len(self._pheromone), dtype=np.int64)
        self._idle = 0
        self._enter(self._ground.start)

    @property
    def note(self) -> str:
        """What it had to do to get on, for people; empty if nothing."""
        planner, notes = self._planner, list(self._notes)
        if self.tally.cycles:
            notes.append(f"went in circles {self.tally.cycles} times")
        if self._beta != planner.beta:
            notes.append(f"alpha up to {planner.alpha_max:g} did not help, and beta was set to 0")
        elif self._alpha != planner.alpha:
            notes.append(f"alpha was raised from {planner.alpha:g} to {self._alpha:g}")
        return "; ".join(notes)

    def _decide(self, blocked: npt.NDArray[np.int64]) -> Cell | None:
        mask, cols = self._open(self._ground, blocked), self._ground.shape[1]
        here = self._cell[0] * cols + self._cell[1]
        astray = not math.isfinite(self._pheromone[here]) and not self._idle  # carried to where none was spread
        to = self._cheapest(mask, here)
        visits = int(self._visits[to]) if to >= 0 else 0
        if visits and self._beta:
            self._raise_alpha(here)
            to = self._cheapest(mask, here)
        elif astray or visits >= PATIENCE or self._idle >= PATIENCE - 1:
            self.tally.cycles += visits > 0
            self._idle = 0
            self._spread_anew(blocked, here)
            to = self._cheapest(self._open(self._ground, blocked), here)
        if to < 0:
            self._idle += 1
            return None
        self._idle = 0
        self._enter(to)
        return to // cols, to % cols

    def _cheapest(self, mask: npt.NDArray[np.uint8], here: int) -> int:
        ground = self._ground
        return int(
            self._kernels.decide(
                mask, ground.offset, ground.shape[1], here, ground.goal, self._alpha, self._beta, self._pheromone
            )
        )

    def _enter(self, cell: int) -> None:
        self._visits[cell] += 1
        if math.isfinite(self._pheromone[cell]):
            self.tally.cost += float(self._pheromone[cell]) / (1.0 - self._planner.evaporation)

    def _raise_alpha(self, here: int) -> None:
        self.tally.cycles += 1
        if 2 * self._alpha <= self._planner.alpha_max:
            self._alpha *= 2
        else:
            self._alpha, self._beta = 1.0, 0.0
        self._begin_again(here)

    def _spread_anew(self, blocked: npt.NDArray[np.int64], here: int) -> None:
        """Around what is blocked; where that leaves no way, over gate cells too."""
        retained = 1.0 - self._planner.evaporation
        for ground in (self._ground, ColonyGraph.of(self._query)):
            again, mask = np.empty_like(self._pheromone), self._open(ground, blocked)
            self.tally.propagated += int(
                self._kernels.propagate(mask, ground.offset, here, ground.goal, retained, again)
            )
            if math.isfinite(again[here]):
                self._ground, self._pheromone = ground, again
                self._begin_again(here)
                if SPREAD_ANEW not in self._notes:
                    self._notes.append(SPREAD_ANEW)
                return

    def _open(self, ground: ColonyGraph, blocked: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
        """The moves that are left while cells are blocked, (cells,)."""
        moves = ground.mask.reshape(ground.shape).copy()
        self._kernels.close_cells(moves, blocked)
        return moves.ravel()

    def _begin_again(self, here: int) -> None:
        self._visits.fill(0)
        self._visits[here] = 1


class Follower(Walker):
    """A robot that tells a replanner of the cells blocked now, and goes one step along the path it gets."""

    def __init__(self, replanner: Replanner) -> None:
        super().__init__(replanner.query)
        self._replanner = replanner
        self._free = replanner.query.grid.free.copy()
        self._told: set[Cell] = set()

    def _decide(self, blocked: npt.NDArray[np.int64]) -> Cell | None:
        now = {(int(r), int(c)) for r, c in blocked if self._free[r, c]}
        if gone := sorted(self._told - now):
            self._replanner.clear(gone)
        if new := sorted(now - self._told):
            self._replanner.block(new)
        self._told = now
        if self._replanner.query.start != self._cell:
            self._replanner.move(self._cell)
        result = self._replanner.result()
        self.tally.propagated += result.work
        if len(result.cells) < 2:
            return None
        cell = self._query.grid.cell
        to = (int(result.cells[1][0]), int(result.cells[1][1]))
        if not self.tally.steps:
            self.tally.cost += result.cost / cell
        self.tally.cost += result.cost / cell - math.dist(self._cell, to)
        return to
