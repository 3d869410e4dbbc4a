"""MAX-MIN ant system (T. Stützle, H. H. Hoos, *MAX-MIN ant system*, Future Generation Computer Systems 16, 2000)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antdrive.planners.colonies.ant_system import AntSystem
from antdrive.planners.colonies.colony import ColonyGraph, IterationState, Walks
from antdrive.planners.iterative import require
from antdrive.worlds import Floats


@dataclass(frozen=True, kw_only=True)
class MaxMinAnts(AntSystem):
    """Ants of which one deposits an iteration, on trails kept between two bounds: MAX-MIN ant system.

    The paper's problems have no dead ends; on a grid these ants retreat from them, and cutting tours short stands
    in for its local search, with whose settings (section 5) evaporation and schedule agree.
    """

    evaporation: float = 0.2  # the paper retains 0.8 with local search
    initial: float = 1e9  # arbitrarily high (section 3.3): the bounds bring all trails to tau_max at once
    p_best: float = 0.05  # probability of building the best tour once the trails have converged
    patience: int = 50  # iterations without a better tour after which trails begin anew
    retreat: bool = True
    shortcut: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        require("evaporation", self.evaporation, above=0, at_most=1)
        require("p_best", self.p_best, above=0, below=1)
        require("patience", self.patience, at_least=1)

    def update(self, trail: Floats, season: IterationState) -> None:
        """Evaporate, let one ant deposit, keep within the bounds; begin anew where the search stagnates."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        if season.best is None:
            return  # nothing is known of the bounds yet
        least, most = self.bounds(season.ground, season.best)
        if season.since and season.since % self.patience == 0:
            trail.fill(most)  # section 3.4: stagnation
            return
        _kernels_ants.evaporate(trail.ravel(), self.evaporation)
        one = self.depositor(season)
        if one is not None:
            cols = season.ground.shape[1]
            _kernels_ants.deposit_on_arcs(trail, cols, one.cells, one.sizes, self.deposit / one.lengths)
        _kernels_ants.clamp(trail.ravel(), least, most)

    def depositor(self, season: IterationState) -> Walks | None:
        """The best tour of the iteration or, every so many iterations, the best of all."""
        return season.best if season.number % best_every(season.number) == 0 else season.tours.shortest()

    def bounds(self, ground: ColonyGraph, best: Walks) -> tuple[float, float]:
        """tau_min and tau_max, by the best tour so far (eq. 7 and 11)."""
        most = self.deposit / (self.evaporation * float(best.lengths[0]))
        choices = max(1, int(best.sizes[0]) - 1)
        options = float(np.unpackbits(ground.mask).sum()) / max(1, int(np.count_nonzero(ground.mask))) - 1
        right = self.p_best ** (1.0 / choices)  # probability of one right choice
        least = most * (1.0 - right) / (max(options - 1, 1.0) * right)
        return min(least, most), most


def best_every(number: int) -> int:
    """How often the best tour of all deposits: the more often, the longer the search (section 5)."""
    for limit, every in ((25, 25), (75, 5), (125, 3), (250, 2)):
        if number < limit:
            return every
    return 1
