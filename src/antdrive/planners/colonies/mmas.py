"""MAX-MIN ant system (T. Stützle, H. H. Hoos, *MAX-MIN ant system*, Future Generation Computer Systems 16, 2000)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antdrive.base import Floats
from antdrive.planners.colonies.ant_system import AntSystem
from antdrive.planners.colonies.colony import ColonyGraph, IterationState, Walks
from antdrive.planners.iterative import require


@dataclass(frozen=True, kw_only=True)
class MaxMinAnts(AntSystem):
    """MAX-MIN ant system: one ant deposits per iteration, on trails kept between two bounds.

    Stützle & Hoos 2000: the ant is the best of the iteration or the best so far (section 5), the bounds
    follow the best tour (eq. 7 and 11), all trails start at the upper bound (section 3.3) and return there
    when the search stagnates (section 3.4). The paper's problems have no dead ends; on a grid these ants
    backtrack out of them. Cutting tours short takes the place of the paper's local search, and evaporation
    and schedule are those the paper uses with it.

    Known weakness, measured (docs/benchmarks.md): the larger the grid, the longer the paths. With a quarter of
    the cells blocked all of 10 are the shortest at 20 x 20; at 50 x 50 they are 0.4 per cent longer in the
    median and 2.6 at worst, at 100 x 100 1.4 and 3.8.

    Attributes:
        evaporation: rho; the paper retains 0.8 with local search
        initial: the pheromone before the first update; arbitrarily high, so that the bounds bring it to
            tau_max
        p_best: the probability of building the best tour once the trails have converged (eq. 11)
        patience: iterations without a better tour after which all trails return to the upper bound
        backtrack: as in `Colony`
        shortcut: as in `Colony`
    """

    evaporation: float = 0.2
    initial: float = 1e9
    p_best: float = 0.05
    patience: int = 50
    backtrack: bool = True
    shortcut: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        require("evaporation", self.evaporation, above=0, at_most=1)
        require("p_best", self.p_best, above=0, below=1)
        require("patience", self.patience, at_least=1)

    def update(self, trail: Floats, state: IterationState) -> None:
        """Evaporate `trail`, let one ant of `state` deposit, clamp to the bounds; reset when the search stagnates."""
        from antdrive.planners.colonies import _kernels_colony

        if state.best is None:
            return  # the bounds follow the best tour, and there is none yet
        tau_min, tau_max = self.bounds(state.graph, state.best)
        if state.since and state.since % self.patience == 0:
            trail.fill(tau_max)  # section 3.4
            return
        _kernels_colony.evaporate(trail.ravel(), self.evaporation)
        one = self.depositor(state)
        if one is not None:
            cols = state.graph.shape[1]
            _kernels_colony.deposit_on_arcs(trail, cols, one.cells, one.sizes, self.deposit / one.lengths)
        _kernels_colony.clamp(trail.ravel(), tau_min, tau_max)

    def depositor(self, state: IterationState) -> Walks | None:
        """The tour that deposits: the best of the iteration in `state` or, every so often, the best so far."""
        return state.best if state.number % best_so_far_every(state.number) == 0 else state.tours.shortest()

    def bounds(self, graph: ColonyGraph, best: Walks) -> tuple[float, float]:
        """tau_min and tau_max on `graph`, by the `best` tour so far (eq. 7 and 11)."""
        tau_max = self.deposit / (self.evaporation * float(best.lengths[0]))
        steps = max(1, int(best.sizes[0]) - 1)
        choices = float(np.unpackbits(graph.mask).sum()) / max(1, int(np.count_nonzero(graph.mask))) - 1
        p_dec = self.p_best ** (1.0 / steps)  # the probability of one right decision
        tau_min = tau_max * (1.0 - p_dec) / (max(choices - 1, 1.0) * p_dec)
        return min(tau_min, tau_max), tau_max


def best_so_far_every(number: int) -> int:
    """Every how many iterations the best tour so far deposits, at iteration `number`: ever more often (section 5)."""
    for limit, every in ((25, 25), (75, 5), (125, 3), (250, 2)):
        if number < limit:
            return every
    return 1
