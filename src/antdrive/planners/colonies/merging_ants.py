"""MAX-MIN ants and scouts whose tours are merged in each iteration; replans start from existing trails."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import FieldError, require
from antdrive.planners.colonies.ant_system import MaxMinAnts
from antdrive.planners.colonies.colony import (
    FIRST_KIND,
    ChoiceContext,
    ColonyGraph,
    Heuristic,
    IterationState,
    Memory,
    Walks,
    Weights,
)
from antdrive.planners.graph.incremental import CachedReplanner, extended
from antdrive.planners.plan import Capabilities, PlanResult, Query

if TYPE_CHECKING:  # importing a grid loads the compiler
    from antdrive.worlds import Grid


@dataclass(frozen=True, kw_only=True)
class MergingAnts(MaxMinAnts):
    """MAX-MIN ants and scouts; the shortest path over all their arcs.

    Bounds, backtracking, shortcuts and resets are those of `MaxMinAnts`. Additional rules:

    - The heuristic is exp(-greed * detour). The detour of a move is the excess length that it adds to the path
      over open ground to the goal. Unlike a power of the distance, it is equally strong far from the goal.
    - Scouts ignore the trails. They follow a lane parallel to the line from start to goal, redrawn in each
      iteration, and so keep exploring the other side of obstacles.
    - The daemon action is the shortest path over the arcs of this iteration's tours and of the best tour, and
      that path deposits. The search combines the best pieces that ants found. It ignores all other arcs, about
      nine tenths of a grid.
    - The colony stops after `settled` iterations without a better tour, or when the tour is as short as over open
      ground.

    These rules are antdrive's own; no paper describes them.

    Known weaknesses, measured (docs/notebook/planner-quality.md): a path is only as good as the ants' pieces.
    Among cylinders on 200 x 200 cells it is up to 0.2 per cent longer than the shortest, and up to 0.7 per cent
    after replans from kept trails. On 100 x 100 cells it takes 95 to 233 ms, A* 0.07 to 0.17 ms.

    Attributes:
        ants: ants that follow trails
        scouts: ants that follow lanes
        greed: repulsion of detours [1 / cell]
        lane_pull: cells of detour that a scout accepts per cell closer to its lane
        lane_spread: maximum offset of lanes to either side, relative to the distance from start to goal
        evaporation: rho
        patience: iterations without a better tour before all trails return to the upper bound
        iterations: maximum number of iterations
        settled: iterations without a better tour before the colony stops; for short tours 0.6 times their length
            in cells, but at least 20

    Raises:
        FieldError: an option is out of range; names it and the valid range.
    """

    ants: int = 25
    scouts: int = 75
    greed: float = 2.0
    lane_pull: float = 0.6
    lane_spread: float = 0.4
    evaporation: float = 0.1
    patience: int = 10
    iterations: int = 300
    settled: int = 60

    def __post_init__(self) -> None:
        super().__post_init__()
        require("scouts", self.scouts, at_least=0, at_most=1_000_000)
        require("greed", self.greed, at_least=0)
        require("lane_pull", self.lane_pull, at_least=0)
        require("lane_spread", self.lane_spread, at_least=0)
        require("settled", self.settled, at_least=1)
        for key, unset in (("beta", None), ("heuristic", "goal")):
            if getattr(self, key) != unset:
                raise FieldError(
                    key, f"must be {unset!r}, as `greed` is the heuristic of these ants; got {getattr(self, key)!r}"
                )

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities and requirements of this planner."""
        return replace(super().capabilities, own_replanner=True)

    def replanner(self, query: Query, rng: np.random.Generator) -> WarmStartedColony:
        """Return a colony that continues on its trails after every change; all its plans draw from `rng`."""
        return WarmStartedColony(self, query, rng)

    @property
    def kinds(self) -> tuple[int, ...]:
        """Ants that follow trails, then scouts."""
        return (self.ants, self.scouts)

    def heuristic_values(self, graph: ColonyGraph) -> Heuristic:
        """Return exp(-greed * detour) for each move of `graph`."""
        return self._detour_weights(graph, np.empty((len(graph.mask), 8), dtype=np.float32))

    def choice_weights(
        self,
        graph: ColonyGraph,
        trail: Floats,
        heuristic: Heuristic,
        weights: Weights,
        context: ChoiceContext = FIRST_KIND,
    ) -> None:
        """Fill `weights`: `trail` times `heuristic` for ants; for scouts, detours on `graph` from this iteration's lane.

        `context` holds the kind of ant and the random number that places the lane.
        """
        if context.kind == 0:
            super().choice_weights(graph, trail, heuristic, weights)
        else:
            distance = math.dist(graph.cell_of(graph.start), graph.cell_of(graph.goal))
            lane = self.lane_spread * distance * (2.0 * context.uniform - 1.0)
            self._detour_weights(graph, weights, self.lane_pull, lane)

    def _detour_weights(self, graph: ColonyGraph, out: Weights, lane_pull: float = 0.0, lane: float = 0.0) -> Weights:
        from antdrive.planners.colonies import _kernels_colony

        to_goal = np.empty(len(graph.mask))
        _kernels_colony.detour_weights(graph.arrays, self.greed, lane_pull, lane, to_goal, out)
        return out

    def daemon_action(self, graph: ColonyGraph, tours: Walks, best: Walks | None) -> Walks | None:
        """Return the shortest path on `graph` over the arcs of these `tours` and of the `best` one."""
        from antdrive.planners.colonies import _kernels_colony
        from antdrive.planners.graph import _kernels_search

        moves = np.zeros_like(graph.mask)
        for walks in (tours, best):
            if walks is not None:
                _kernels_colony.union_moves(walks.cells, walks.sizes, graph.to, moves)
        moves &= graph.mask  # the best tour may predate the last change of the grid
        moves.setflags(write=False)  # the search is compiled for read-only moves, like a grid's
        cells, straight, diagonal, _ = _kernels_search.shortest_path(
            graph.moves._replace(mask=moves), graph.start, graph.goal, True
        )
        if not len(cells):
            return None
        walk = graph.walk(cells)
        length = straight + math.sqrt(2.0) * diagonal
        return Walks(walk[np.newaxis], np.array([len(walk)]), np.array([length]))

    def depositor(self, state: IterationState) -> Walks | None:
        """Return the merged tour of the iteration in `state`; it may contain parts of the best tour so far."""
        return state.daemon_tour

    def finished(self, state: IterationState) -> bool:
        """Return whether the best tour of `state` has settled or is as short as over open ground."""
        if state.best is None:
            return False
        graph = state.graph
        (r0, c0), (r1, c1) = graph.cell_of(graph.start), graph.cell_of(graph.goal)
        low, high = sorted((abs(r1 - r0), abs(c1 - c0)))
        over_open_ground = high - low + math.sqrt(2.0) * low
        enough = min(self.settled, max(20, round(0.6 * float(state.best.lengths[0]))))
        return state.since >= enough or bool(state.best.lengths[0] <= over_open_ground + 1e-9)


class WarmStartedColony(CachedReplanner):
    """A colony that replans from its old trails, evened out near changed cells.

    After a change, the trails of arcs within `reach` cells of it move towards the strongest trail, more so
    the nearer they are (M. Guntsch and M. Middendorf, *Pheromone modification strategies for ant algorithms
    applied to dynamic TSP*, 2001: the strategy by distance). The passable part of the best tour joins the tours
    of the first iteration. The colony stops after `settled` iterations without improvement.

    Args:
        planner: the colony
        query: the initial query
        rng: the source of randomness of all plans
        settled: iterations without improvement before a warm-started colony stops
        reach: distance from a changed cell within which trails are evened out [cells]

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

    def _replan(self, query: Query, changed: npt.NDArray[np.int64]) -> PlanResult:
        warm = self._memory.tour is not None
        planner = self._brief if warm else self._planner
        if warm and self._memory.trail is not None and len(changed):
            self._memory.trail = even_out(self._memory.trail, query.grid, changed, self._reach)
        answer = planner.answer(query, planner.resume(query, self._rng, self._memory))
        return dataclasses.replace(answer, options=dataclasses.asdict(planner))


def even_out(trail: Floats, grid: Grid, changed: npt.NDArray[np.int64], reach: int) -> Floats:
    """Move trails at distance d from changed cells towards the strongest trail by a fraction 1 - d / (reach + 1).

    Returns the trails, with those of nodes that the grid got since (nodes, 8).
    """
    near = np.zeros(grid.shape, dtype=np.bool_)
    near.ravel()[changed] = True
    fraction = near / (reach + 1.0)
    for _ in range(reach):  # the neighbourhood grows by one cell per pass, so nearer cells count more often
        near[1:] |= near[:-1].copy()
        near[:-1] |= near[1:].copy()
        near[:, 1:] |= near[:, :-1].copy()
        near[:, :-1] |= near[:, 1:].copy()
        fraction += near / (reach + 1.0)
    strongest = float(trail.max())
    of_nodes = fraction.ravel()[grid.turns.cell] if grid.turns else fraction.ravel()
    trail = extended(trail, strongest, len(of_nodes))
    here = np.flatnonzero(of_nodes)
    if math.isfinite(strongest):
        trail[here] += of_nodes[here, np.newaxis] * (strongest - trail[here])
    return trail
