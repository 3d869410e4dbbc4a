"""The colony that serves best here: MAX-MIN ants and scouts, whose tours of an iteration are put together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from antdrive.planners.colonies.colony import FIRST, ChoiceContext, ColonyGraph, Desire, IterationState, Walks, Weights
from antdrive.planners.colonies.mmas import MaxMinAnts
from antdrive.planners.iterative import require
from antdrive.worlds import Floats
from antdrive.worlds.errors import FieldError


@dataclass(frozen=True, kw_only=True)
class MergingAnts(MaxMinAnts):
    """MAX-MIN ants that weigh detours, scouts beside them, and the shortest way over all arcs they used.

    What sets it apart from `MaxMinAnts`, whose bounds, retreats, cut tours and fresh starts it keeps:

    - A move attracts by `exp(-greed * detour)`, the detour being how much longer it makes the way to the goal, as
      over open ground, than it need be. Unlike a power of the distance it is as strong far from the goal.
    - Scouts ignore the trails and keep to a lane beside the straight line, drawn anew each iteration, so that ways
      around the other side of things stay known.
    - After an iteration the shortest way is sought over the arcs that its tours used, and the best tour's: ants
      find the pieces, and what deposits is the best that can be put together of them. Nothing beyond those arcs,
      about a tenth of a grid's, is searched.
    - It ends when so many iterations brought nothing better (`settled`), or the tour cannot be shorter on any grid.
    """

    ants: int = 25
    scouts: int = 75
    greed: float = 2.0  # [1 / cell]
    lane_pull: float = 0.6  # cells of detour that a scout accepts to come a cell nearer to its lane
    lane_spread: float = 0.4  # lanes lie up to this many times the straight distance to either side
    evaporation: float = 0.1
    patience: int = 10
    iterations: int = 300
    settled: int = 60  # at most; where tours are short 0.6 times their length in cells, but 20

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
                    key, f"must be {unset!r}, as these ants are drawn by `greed`; got {getattr(self, key)!r}"
                )

    @property
    def castes(self) -> tuple[int, ...]:
        """Ants that follow trails first, then scouts."""
        return (self.ants, self.scouts)

    def desire(self, ground: ColonyGraph) -> Desire:
        """exp(-greed * detour)."""
        return self._detours(ground, np.empty((len(ground.mask), 8), dtype=np.float32))

    def weigh(
        self, ground: ColonyGraph, trail: Floats, desire: Desire, weights: Weights, turn: ChoiceContext = FIRST
    ) -> None:
        """Trail and desire for ants; desire alone, towards this iteration's lane, for scouts."""
        if turn.caste == 0:
            super().weigh(ground, trail, desire, weights)
        else:
            far = math.dist(*(divmod(cell, ground.shape[1]) for cell in (ground.start, ground.goal)))
            self._detours(ground, weights, self.lane_pull, self.lane_spread * far * (2.0 * turn.chance - 1.0))

    def _detours(self, ground: ColonyGraph, out: Weights, pull: float = 0.0, lane: float = 0.0) -> Weights:
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        height = np.empty(len(ground.mask))
        _kernels_ants.detour_weights(
            ground.mask,
            ground.offset,
            ground.shape[1],
            ground.start,
            ground.goal,
            self.greed,
            pull,
            lane,
            height,
            out,
        )
        return out

    def join(self, ground: ColonyGraph, tours: Walks, best: Walks | None) -> Walks | None:
        """The shortest way over the arcs of these tours."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants
        from antdrive.planners.graph import _kernels_search

        moves = np.zeros_like(ground.mask)
        for walks in (tours, best):
            if walks is not None:
                _kernels_ants.union_moves(walks.cells, walks.sizes, ground.shape[1], moves)
        moves &= ground.mask  # the best may be of before a change
        moves.setflags(write=False)  # as a grid's own are, for which the search is compiled
        cols = ground.shape[1]
        cells, straight, diagonal, _ = _kernels_search.shortest_path(
            moves.reshape(ground.shape), *divmod(ground.start, cols), *divmod(ground.goal, cols), True
        )
        if not len(cells):
            return None
        walk = (cells[:, 0] * cols + cells[:, 1]).astype(np.int32)
        length = straight + math.sqrt(2.0) * diagonal
        return Walks(walk[np.newaxis], np.array([len(walk)]), np.array([length]))

    def depositor(self, season: IterationState) -> Walks | None:
        """The tour put together in this iteration, which the best one before may be part of."""
        return season.joint

    def finished(self, season: IterationState) -> bool:
        """Whether nothing better came up for long, or cannot."""
        if season.best is None:
            return False
        cols = season.ground.shape[1]
        (r0, c0), (r1, c1) = divmod(season.ground.start, cols), divmod(season.ground.goal, cols)
        low, high = sorted((abs(r1 - r0), abs(c1 - c0)))
        shortest = high - low + math.sqrt(2.0) * low
        enough = min(self.settled, max(20, round(0.6 * float(season.best.lengths[0]))))
        return season.since >= enough or bool(season.best.lengths[0] <= shortest + 1e-9)
