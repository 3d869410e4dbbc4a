"""Ants drawn by the goal (Han, MSc thesis, Missouri 2007, section 4.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from antdrive.planners.colonies.colony import FIRST, ChoiceContext, Colony, ColonyGraph, Desire, IterationState, Weights
from antdrive.planners.iterative import require
from antdrive.worlds import Floats
from antdrive.worlds.errors import FieldError


@dataclass(frozen=True, kw_only=True)
class AcoHan(Colony):
    """Ants drawn by pheromone on cells and by the direction of the goal (Han 2007)."""

    ants: int = 500
    iterations: int = 50
    evaporation: float = 0.1  # rho
    deposit: float = 1.0  # an ant leaves deposit / length; the thesis' text has 1, its listing 5
    attraction: float = 1.0  # alpha of eq. 4.2.1
    elitism: int = 0  # e of eq. 4.2.4; 0: no elite
    # "listing" is the thesis' program where it differs from its equations: raw pheromone in place of shares,
    # one fixed direction from start to goal, steps not normalised, and cells that evaporate only when an ant
    # deposits on them.
    form: Literal["equation", "listing"] = "equation"
    revisit: float = 1e-5  # weight of a cell the ant has already been to
    # The least weight of a cell it has not been to. By eq. 4.2.1 alone that is 0 for every move away from the
    # goal, less than for a step back, and no ant leaves a dead end; the listing's comment asks that ants turn
    # back only when every neighbour has been visited. 0 is the equation to the letter.
    least: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        require("evaporation", self.evaporation, at_least=0, at_most=1)
        require("deposit", self.deposit, above=0)
        require("attraction", self.attraction, at_least=0)
        require("elitism", self.elitism, at_least=0)
        require("revisit", self.revisit, at_least=0)
        require("least", self.least, at_least=0)
        if self.form not in ("equation", "listing"):
            raise FieldError("form", f"must be 'equation' or 'listing', got {self.form!r}")

    def lay(self, ground: ColonyGraph, rng: np.random.Generator) -> Floats:
        """No trails: tau(0) = 0."""
        return np.zeros(len(ground.mask))

    def desire(self, ground: ColonyGraph) -> Desire:
        """Omega of eq. 4.2.1."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        pull = np.empty((len(ground.mask), 8))
        cols = ground.shape[1]
        row, col = divmod(ground.goal, cols)
        if self.form == "equation":
            _kernels_ants.goal_pull(ground.mask, cols, row, col, pull)
        else:
            up, right = row - ground.start // cols, col - ground.start % cols
            far = math.hypot(up, right)
            _kernels_ants.fixed_pull(ground.mask, up / far, right / far, pull)
        return pull

    def weigh(
        self, ground: ColonyGraph, trail: Floats, desire: Desire, weights: Weights, turn: ChoiceContext = FIRST
    ) -> None:
        """phi = tau_j / sum tau + alpha Omega (eq. 4.2.1)."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        shares = self.form == "equation"
        _kernels_ants.attracted_weights(
            trail, ground.mask, ground.offset, desire, self.attraction, shares, self.least, weights
        )

    def update(self, trail: Floats, season: IterationState) -> None:
        """Evaporate; every ant that arrived deposits on the cells it walked, then the elite does."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        walks, best = season.walks, season.best
        amounts = self.deposit / walks.lengths  # eq. 4.2.3; 0 for an ant that did not arrive
        if self.form == "listing":
            _kernels_ants.deposit_in_passing(trail, walks.cells, walks.sizes, amounts, self.evaporation)
        else:
            _kernels_ants.evaporate(trail, self.evaporation)  # eq. 4.2.2
            _kernels_ants.deposit_on_cells(trail, walks.cells, walks.sizes, amounts)
        if best is not None and self.elitism:
            elite = self.elitism * self.deposit / best.lengths  # eq. 4.2.4
            _kernels_ants.deposit_on_cells(trail, best.cells, best.sizes, elite)
