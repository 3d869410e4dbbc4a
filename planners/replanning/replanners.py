"""A replanner for every planner: repaired where its search can be, with its trails kept where it has some, else from scratch."""

from __future__ import annotations

import abc
import dataclasses
import math
import time

import numpy as np
import numpy.typing as npt

from antdrive.planners.colonies.colony import Memory
from antdrive.planners.colonies.merging_ants import MergingAnts
from antdrive.planners.graph.incremental import EditableQuery, Replanner, ReplanningPlanner
from antdrive.planners.iterative import require
from antdrive.planners.plan import Planner, PlanResult, PlanStatus, Query, path_cost
from antdrive.worlds import Floats
from antdrive.worlds.errors import FieldError


def replanner_for(planner: Planner, query: Query, rng: np.random.Generator) -> Replanner:
    """The cheapest way that a planner has to keep its answer to a query right; `rng` serves all its answers.

    Replanners know cells that are blocked, not what blocks them. So they answer in cells, along allowed moves, also where
    the planner itself draws lines of its own; and planners of the plane or of time have none.

    Raises:
        ValueError: the planner does not plan on cells alone.
    """
    for key, instead in (("needs_world", "among the world's discs"), ("needs_motions", "among known motions")):
        if getattr(planner, key, False):
            raise FieldError("planner", f"{type(planner).__name__} plans {instead}; it cannot be told of blocked cells")
    if isinstance(planner, ReplanningPlanner):
        return planner.replanner(query)
    if isinstance(planner, MergingAnts):
        return WarmStartedColony(planner, query, rng)
    return ReplanFromScratch(planner, query, rng)


class CachedReplanner(EditableQuery):
    """An answer in cells that holds on for as long as nothing has changed and the robot is on it."""

    def __init__(self, query: Query) -> None:
        super().__init__(dataclasses.replace(query, task=None))
        self._last: PlanResult | None = None

    def result(self) -> PlanResult:
        """A path from where the robot is; `work` and `wall_s` are those of this answer."""
        started = time.perf_counter()
        blocked = self._query.blocked_end
        if blocked:
            return PlanResult(status=PlanStatus.NO_PATH, reason=blocked, wall_s=time.perf_counter() - started)
        answer = self._onward()
        if answer is None:
            answer = self._last = self._anew(self._query, self._changed())
        return dataclasses.replace(answer, wall_s=time.perf_counter() - started)

    @abc.abstractmethod
    def _anew(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        """The answer after these cells have changed their moves; both ends are free."""

    def _onward(self) -> PlanResult | None:
        """What is left of the last path, if nothing has changed and the robot is on it."""
        if self._news or self._last is None or not self._last.solved:
            return None
        here = np.flatnonzero((self._last.cells == self._query.start).all(axis=1))
        if not len(here):
            return None
        rest = self._last.cells[here[0] :]
        return dataclasses.replace(self._last, cells=rest, cost=path_cost(rest, self._query.grid.cell), work=0)


class ReplanFromScratch(CachedReplanner):
    """A planner that is asked anew after every change."""

    def __init__(self, planner: Planner, query: Query, rng: np.random.Generator) -> None:
        super().__init__(query)
        self._planner, self._rng = planner, rng

    def _anew(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        return dataclasses.replace(self._planner.plan(query, self._rng), waypoints=None, length=None)


class WarmStartedColony(CachedReplanner):
    """Ants that go on with the trails they have, made even again where something has changed.

    After a change arcs within `reach` cells of it move towards the upper bound, the nearer the more (M. Guntsch and
    M. Middendorf, *Pheromone modification strategies for ant algorithms applied to dynamic TSP*, 2001: the strategy
    that goes by distance). What can still be walked of the best tour joins those of the first iteration. The
    colony ends when `settled` iterations brought nothing better.

    Raises:
        ValueError: `settled` or `reach` is below 1.
    """

    def __init__(
        self, planner: MergingAnts, query: Query, rng: np.random.Generator, *, settled: int = 4, reach: int = 10
    ) -> None:
        super().__init__(query)
        require("settled", settled, at_least=1)
        require("reach", reach, at_least=1)
        self._planner, self._rng, self._reach = planner, rng, reach
        self._brief = dataclasses.replace(planner, settled=min(settled, planner.settled))
        self._memory = Memory()

    def _anew(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        warm = self._memory.tour is not None
        planner = self._brief if warm else self._planner
        if warm and self._memory.trail is not None and len(changed):
            even(self._memory.trail, query.grid.shape, changed, self._reach)
        answer = planner.take(query, planner.resume(query, self._rng, self._memory))
        return dataclasses.replace(answer, options=dataclasses.asdict(planner))


def even(trail: Floats, shape: tuple[int, int], changed: npt.NDArray[np.int64], reach: int) -> None:
    """Move trails (cells, 8) towards the strongest of all by 1 - d / (reach + 1), d cells from the nearest change."""
    near = np.zeros(shape, dtype=np.bool_)
    near.ravel()[changed] = True
    share = near / (reach + 1.0)
    for _ in range(reach):  # the neighbourhood grows by a cell a turn; the nearer, the more often it is counted
        near[1:] |= near[:-1].copy()
        near[:-1] |= near[1:].copy()
        near[:, 1:] |= near[:, :-1].copy()
        near[:, :-1] |= near[:, 1:].copy()
        share += near / (reach + 1.0)
    here = np.flatnonzero(share)
    most = float(trail.max())
    if math.isfinite(most):
        trail[here] += share.ravel()[here, np.newaxis] * (most - trail[here])
