"""A replanner for every planner: its own if it has one, else one that plans anew after every change."""

from __future__ import annotations

import abc
import dataclasses
import time
from typing import cast

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.planners.checking import ask, blaming
from antdrive.planners.graph.incremental import EditableQuery, Replanner, ReplanningPlanner
from antdrive.planners.plan import Planner, PlanResult, PlanStatus, Query, capabilities_of, path_cost


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
        with blaming(planner):
            return cast(ReplanningPlanner, planner).replanner(query, rng)
    return ReplanFromScratch(planner, query, rng)


class CachedReplanner(EditableQuery):
    """A replanner that keeps its answer as long as nothing has changed and the robot is on the path."""

    def __init__(self, query: Query) -> None:
        super().__init__(dataclasses.replace(query, task=None))
        self._last: PlanResult | None = None

    def result(self) -> PlanResult:
        """A path from the robot's cell; `work` and `wall_s` are what this call took."""
        started = time.perf_counter()
        blocked = self._query.blocked_end
        if blocked:
            return PlanResult(status=PlanStatus.NO_PATH, reason=blocked, wall_s=time.perf_counter() - started)
        answer = self._rest_of_answer()
        if answer is None:
            answer = self._last = self._plan_anew(self._query, self._take_edits())
        return dataclasses.replace(answer, wall_s=time.perf_counter() - started)

    @abc.abstractmethod
    def _plan_anew(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        """The answer to a query whose ends are free, after the moves of these flat cells changed."""

    def _rest_of_answer(self) -> PlanResult | None:
        """The rest of the last path, if nothing has changed and the robot is on it."""
        if self._edits or self._last is None or not self._last.solved:
            return None
        here = np.flatnonzero((self._last.cells == self._query.start).all(axis=1))
        if not len(here):
            return None
        rest = self._last.cells[here[0] :]
        return dataclasses.replace(self._last, cells=rest, cost=path_cost(rest, self._query.grid.cell), work=0)


class ReplanFromScratch(CachedReplanner):
    """A replanner that asks its planner anew after every change."""

    def __init__(self, planner: Planner, query: Query, rng: np.random.Generator) -> None:
        super().__init__(query)
        self._planner, self._rng = planner, rng

    def _plan_anew(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        return dataclasses.replace(ask(self._planner, query, self._rng), waypoints=None, length=None)
