"""A colony that replans from the trails it already has."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.planners.colonies.colony import Memory
from antdrive.planners.iterative import require
from antdrive.planners.plan import PlanResult, Query
from antdrive.planners.replanning.replanners import CachedReplanner

if TYPE_CHECKING:  # the planner imports this module for its replanner
    from antdrive.planners.colonies.merging_ants import MergingAnts


class WarmStartedColony(CachedReplanner):
    """Ants that continue on their old trails, which are evened out near the cells that changed.

    After a change, the trails of arcs within `reach` cells of it move towards the strongest trail, more so
    the nearer they are (M. Guntsch and M. Middendorf, *Pheromone modification strategies for ant algorithms
    applied to dynamic TSP*, 2001: the strategy by distance). The part of the best tour that can still be
    walked joins the tours of the first iteration. The colony stops after `settled` iterations without
    improvement.

    Args:
        planner: the colony
        query: the query to begin with
        rng: the source of randomness of all answers
        settled: iterations without improvement after which a warm-started colony stops
        reach: how far from a changed cell trails are evened out [cells]

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

    def _plan_anew(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        warm = self._memory.tour is not None
        planner = self._brief if warm else self._planner
        if warm and self._memory.trail is not None and len(changed):
            even_out(self._memory.trail, query.grid.shape, changed, self._reach)
        answer = planner.answer(query, planner.resume(query, self._rng, self._memory))
        return dataclasses.replace(answer, options=dataclasses.asdict(planner))


def even_out(trail: Floats, shape: tuple[int, int], changed: npt.NDArray[np.int64], reach: int) -> None:
    """Move trails near changed cells towards the strongest trail, by a share of 1 - d / (reach + 1)."""
    near = np.zeros(shape, dtype=np.bool_)
    near.ravel()[changed] = True
    share = near / (reach + 1.0)
    for _ in range(reach):  # the neighbourhood grows by one cell per pass, so nearer cells are counted more often
        near[1:] |= near[:-1].copy()
        near[:-1] |= near[1:].copy()
        near[:, 1:] |= near[:, :-1].copy()
        near[:, :-1] |= near[:, 1:].copy()
        share += near / (reach + 1.0)
    here = np.flatnonzero(share)
    strongest = float(trail.max())
    if math.isfinite(strongest):
        trail[here] += share.ravel()[here, np.newaxis] * (strongest - trail[here])
