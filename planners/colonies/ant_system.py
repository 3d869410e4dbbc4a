"""Ant system and its two variants for robots: ageing ants, and common beside exploratory ants.

ibraheem2016: I. K. Ibraheem, F. H. Ajeil, *Path planning of an autonomous mobile robot using swarm based
optimization techniques*, Al-Khwarizmi Engineering Journal, 2016. suganthi2019: P. H. Suganthi, K. Subha, *Path
navigation in ACO using mobile robot*, IJTSRD 3(3), 2019. lee2008: J.-W. Lee, J.-J. Kim, B.-S. Choi, J.-J. Lee,
*Improved ant colony optimization algorithm by potential field concept for optimal path planning*, 2008.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from antdrive.planners.colonies.colony import FIRST, ChoiceContext, Colony, ColonyGraph, Desire, IterationState, Weights
from antdrive.planners.iterative import require
from antdrive.worlds import Floats
from antdrive.worlds.errors import FieldError

#: Length of each move [cells].
STEP = np.sqrt([1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 1.0, 2.0])


@dataclass(frozen=True, kw_only=True)
class AntSystem(Colony):
    """Ants drawn by pheromone on arcs and by a heuristic: the ant system, as ibraheem2016 sets it up.

    suganthi2019 has beta 1 and heuristic "step"; lee2008 ants 500, beta 2, evaporation 0.01.
    """

    alpha: float = 1.0  # exponent of the pheromone
    beta: float | None = None  # exponent of the heuristic; None: ibraheem2016's rule, 0.22 N for N x N cells
    evaporation: float = 0.3  # rho; lee2008's rho is what is retained
    deposit: float = 1.0  # Q: an ant leaves Q / length on its arcs
    initial: float = 1.0  # C: pheromone on every arc at the start
    # eta: 1 / distance from the next cell to the goal (ibraheem2016 eq. 6; lee2008), or 1 / length of the step
    # (suganthi2019 eq. 6).
    heuristic: Literal["goal", "step"] = "goal"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("alpha", self.alpha, at_least=0)
        if self.beta is not None:
            require("beta", self.beta, at_least=0)
        require("evaporation", self.evaporation, at_least=0, at_most=1)
        require("deposit", self.deposit, above=0)
        require("initial", self.initial, above=0)
        if self.heuristic not in ("goal", "step"):
            raise FieldError("heuristic", f"must be 'goal' or 'step', got {self.heuristic!r}")

    def lay(self, ground: ColonyGraph, rng: np.random.Generator) -> Floats:
        """tau(0) = C on every arc."""
        return np.full((len(ground.mask), 8), self.initial)

    def desire(self, ground: ColonyGraph) -> Desire:
        """eta^beta, as a share of the largest that a cell has to offer."""
        if self.heuristic == "goal":
            # The goal itself is at distance 0: any ant beside it shall go there.
            eta = ground.over_moves(1.0 / np.maximum(ground.far(ground.goal), 0.01))
        else:
            eta = np.where(np.isfinite(ground.over_moves(np.ones(len(ground.mask)))), 1.0 / STEP, -np.inf)
        beta = ibraheem_beta(max(ground.shape)) if self.beta is None else self.beta
        return shares(eta, beta)

    def weigh(
        self, ground: ColonyGraph, trail: Floats, desire: Desire, weights: Weights, turn: ChoiceContext = FIRST
    ) -> None:
        """p ~ tau^alpha eta^beta (eq. 1 of all three papers)."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        _kernels_ants.arc_weights(trail, desire, self.alpha, weights)

    def update(self, trail: Floats, season: IterationState) -> None:
        """Evaporate; every ant that arrived deposits on the arcs it used (suganthi2019 eq. 2-4)."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        _kernels_ants.evaporate(trail.ravel(), self.evaporation)
        tours = season.tours
        _kernels_ants.deposit_on_arcs(trail, season.ground.shape[1], tours.cells, tours.sizes, self.amounts(season))

    def amounts(self, season: IterationState) -> Floats:
        """What each ant leaves on an arc: Q / L_k, 0 if it did not arrive."""
        return self.deposit / season.tours.lengths


@dataclass(frozen=True, kw_only=True)
class AgeingAnts(AntSystem):
    """An ant system in which older ants leave less pheromone: the modified ACO of ibraheem2016, section 3.2."""

    # Q_max and Q_min; the paper names no values.
    most: float = 1.0
    least: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        require("least", self.least, above=0)
        require("most", self.most, at_least=self.least)

    def amounts(self, season: IterationState) -> Floats:
        """Q_m / L_m with Q_m by eq. 5, kept within its bounds, which as printed it may leave."""
        count = len(season.tours)
        return self.aged(season.rng.random(count)) / season.tours.lengths

    def aged(self, rand: Floats) -> Floats:
        """Q_m of ants m = 1 to M (eq. 5), for a random number of each."""
        span, m = self.most - self.least, np.arange(1, len(rand) + 1)
        amounts = self.most - span / 2 * rand - span / len(rand) * m
        return np.clip(amounts, self.least, self.most)


@dataclass(frozen=True, kw_only=True)
class ExploringAnts(AntSystem):
    """Common ants, exploratory ants that shun pheromone, and an elite: the improved ACO of suganthi2019."""

    ants: int = 25  # common ants
    explorers: int = 75  # exploratory ants
    beta: float | None = 1.0
    elite: float = 1.0  # a of eq. 7: how often more the iteration's best ant deposits
    heuristic: Literal["goal", "step"] = "step"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("explorers", self.explorers, at_least=0, at_most=1_000_000)
        require("elite", self.elite, at_least=0)

    @property
    def castes(self) -> tuple[int, ...]:
        """Common ants first, then exploratory ones."""
        return (self.ants, self.explorers)

    def weigh(
        self, ground: ColonyGraph, trail: Floats, desire: Desire, weights: Weights, turn: ChoiceContext = FIRST
    ) -> None:
        """p ~ eta^beta tau^alpha for common ants (eq. 1), eta^beta / tau^alpha for exploratory ones (eq. 5)."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        _kernels_ants.arc_weights(trail, desire, self.alpha if turn.caste == 0 else -self.alpha, weights)

    def amounts(self, season: IterationState) -> Floats:
        """Q / L_k and, for the best ants of the iteration, a Q / L_best more (eq. 7-8)."""
        lengths = season.tours.lengths
        best = lengths <= lengths.min() + 1e-9
        return np.where(best, 1.0 + self.elite / best.sum(), 1.0) * self.deposit / lengths


def ibraheem_beta(side: int) -> float:
    """The exponent of the heuristic that ibraheem2016, Table 1, gives for a map of side x side cells."""
    return 1.605e-17 * side**2 + 0.22 * side + 6.181e-15


def shares(eta: Floats, beta: float) -> Weights:
    """eta^beta (cells, 8) as a share of each cell's largest: choices stay the same, and no power runs out of range.

    A move that is not allowed has -inf and gets 0.
    """
    most = eta.max(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isfinite(eta), eta / np.where(np.isfinite(most), most, 1.0), 0.0)
    return np.where(ratio > 0, np.maximum(ratio**beta, 1e-30), 0.0).astype(np.float32)
