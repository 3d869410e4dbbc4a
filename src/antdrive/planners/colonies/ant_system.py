"""Ant system and variants: ageing ants, exploratory ants and MAX-MIN ants.

ibraheem2016: I. K. Ibraheem, F. H. Ajeil, *Path planning of an autonomous mobile robot using swarm based
optimization techniques*, Al-Khwarizmi Engineering Journal, 2016. suganthi2019: P. H. Suganthi, K. Subha,
*Path navigation in ACO using mobile robot*, IJTSRD 3(3), 2019. lee2008: J.-W. Lee, J.-J. Kim, B.-S. Choi,
J.-J. Lee, *Improved ant colony optimization algorithm by potential field concept for optimal path planning*,
2008. MAX-MIN: T. Stützle, H. H. Hoos, *MAX-MIN ant system*, Future Generation Computer Systems 16, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import require
from antdrive.base.records import require_choices
from antdrive.planners.colonies.colony import (
    FIRST_KIND,
    STEP,
    ChoiceContext,
    Colony,
    ColonyGraph,
    Heuristic,
    IterationState,
    Walks,
    Weights,
)


@dataclass(frozen=True, kw_only=True)
class AntSystem(Colony):
    """Ant system: ants guided by pheromone on arcs and a heuristic.

    Section 3.1 of ibraheem2016: p ~ tau^alpha eta^beta (eq. 1), and every ant that arrives deposits Q / length
    on its arcs. alpha, beta and evaporation are those of ibraheem2016, which gives ranges of ants and iterations
    and no Q. suganthi2019 uses beta 1 and heuristic "step"; lee2008 uses 500 ants, beta 2 and evaporation 0.01.

    Known weaknesses, measured (docs/notebook/planner-quality.md): ants die in dead ends. With a
    quarter of the cells blocked, 6 of 10 runs cross 50 x 50 cells, with paths twice as long as the shortest, and
    none crosses 100 x 100. With `backtrack` and `shortcut` all arrive.

    Attributes:
        alpha: the exponent of the pheromone
        beta: the exponent of the heuristic; None: 0.22 N on a map of N x N cells, the rule of ibraheem2016,
            Table 1, reading its 1.605-17 as 1.605e-17
        evaporation: rho, the fraction of pheromone lost per iteration; rho of lee2008 is the fraction retained
        deposit: Q; an ant deposits Q / length on each of its arcs
        initial: the initial pheromone on every arc
        mix: the fraction of chance in the initial pheromone; the conventional colony of lee2008 has 1 (l. 127)
        heuristic: "goal": eta = 1 / distance from the next cell to the goal (ibraheem2016 eq. 6, lee2008);
            "step": eta = 1 / length of the move (suganthi2019 eq. 6)
        ranks: number of ants that deposit per iteration: the best deposits the full amount of eq. 4, each later
            one 1 / `ranks` of it less; None: all arriving ants deposit the full amount. Section V of lee2008 mentions
            a ranking list of 100 for the conventional colony, without saying how it is used

    Raises:
        FieldError: an option is out of range; names it and the valid range.
    """

    alpha: float = 1.0
    beta: float | None = None
    evaporation: float = 0.3
    deposit: float = 1.0
    initial: float = 1.0
    mix: float = 0.0
    heuristic: Literal["goal", "step"] = "goal"
    ranks: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require("alpha", self.alpha, at_least=0)
        if self.beta is not None:
            require("beta", self.beta, at_least=0)
        require("evaporation", self.evaporation, at_least=0, at_most=1)
        require("deposit", self.deposit, above=0)
        require("initial", self.initial, above=0)
        require("mix", self.mix, at_least=0, at_most=1)
        if self.ranks is not None:
            require("ranks", self.ranks, at_least=1, at_most=1_000_000)
        require_choices(self)

    def initial_trail(self, graph: ColonyGraph, rng: np.random.Generator) -> Floats:
        """Return tau(0) = `initial` (1 - `mix` + `mix` chance) on every arc of `graph`; chance is uniform in (0, 1]."""
        trail = np.full((len(graph.mask), 8), self.initial)
        return trail * (1.0 - self.mix * rng.random(trail.shape)) if self.mix else trail

    def heuristic_values(self, graph: ColonyGraph) -> Heuristic:
        """Return eta^beta for each move of `graph`, relative to the largest value in its cell."""
        if self.heuristic == "goal":
            eta = graph.nearness()  # ibraheem2016 eq. 6
        else:
            eta = np.where(graph.allowed, 1.0 / STEP, -np.inf)  # suganthi2019 eq. 6
        beta = ibraheem_beta(max(graph.shape)) if self.beta is None else self.beta
        return normalised(eta, beta)

    def choice_weights(
        self,
        graph: ColonyGraph,
        trail: Floats,
        heuristic: Heuristic,
        weights: Weights,
        context: ChoiceContext = FIRST_KIND,
    ) -> None:
        """Fill `weights` with p ~ tau^alpha eta^beta (eq. 1 of all three papers).

        `trail` is tau, `heuristic` eta^beta; `graph` and `context` are ignored.
        """
        from antdrive.planners.colonies import _kernels_colony

        _kernels_colony.arc_weights(trail, heuristic, self.alpha, weights)

    def update(self, trail: Floats, state: IterationState) -> None:
        """Evaporate `trail` and deposit on the arcs of the complete tours of `state` (suganthi2019 eq. 2-4)."""
        from antdrive.planners.colonies import _kernels_colony

        tours, amounts = state.tours, self.amounts(state)
        if self.ranks is not None:
            amounts = amounts * ranked(tours.lengths, self.ranks)
        trail *= 1.0 - self.evaporation  # eq. 2, first term
        _kernels_colony.deposit_on_arcs(trail, state.graph.to, tours.cells, tours.sizes, amounts)  # eq. 2-3

    def amounts(self, state: IterationState) -> Floats:
        """Return the deposit per arc of each ant of `state` (ants,): Q / L_k, 0 if the ant did not arrive."""
        return self.deposit / state.tours.lengths  # eq. 4


@dataclass(frozen=True, kw_only=True)
class AgeingAnts(AntSystem):
    """An ant system in which older ants deposit less pheromone.

    The modified ACO of ibraheem2016, section 3.2: ant m of M deposits Q_m / length, and Q_m falls from Q_max
    with m, clipped at Q_min (eq. 5). The paper gives no values for the two bounds. Its text updates the trails after all tours,
    the default; its flow chart after each ant, on trails restarted in each iteration (`update_every=1` and
    `restart_every=1`).

    Known weaknesses, measured (docs/papers/ibraheem2016.md): as in `AntSystem`, ants die in dead ends, and
    ageing does not pay off. On maps of 30 x 30 and 40 x 40 cells paths are longer than those of `AntSystem` in
    158 of 400 runs and shorter in 62; with `q_min` 0.5 they are equally long and only ant steps are more.

    Attributes:
        q_max: Q_max, the deposit of a young ant, in place of `deposit`
        q_min: Q_min, the deposit of an old ant
    """

    q_max: float = 1.0
    q_min: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        require("q_min", self.q_min, above=0)
        require("q_max", self.q_max, at_least=self.q_min)

    def amounts(self, state: IterationState) -> Floats:
        """Return Q_m / L_m for each ant m of `state`, with Q_m by eq. 5."""
        rand = state.rng.random(len(state.tours))
        return self.aged(rand, state.first, sum(self.kinds)) / state.tours.lengths  # eq. 4

    def aged(self, rand: Floats, first: int, count: int) -> Floats:
        """Return Q_m of successive ants m (eq. 5), clipped to its bounds, as eq. 5 as printed falls below Q_min.

        Args:
            rand: a random number in [0, 1) for each of the ants (N,)
            first: the number of these ants' first, from 0
            count: M, the number of all ants
        """
        span, m = self.q_max - self.q_min, first + np.arange(1, len(rand) + 1)
        amounts = self.q_max - span / 2 * rand - span / count * m  # eq. 5
        return np.clip(amounts, self.q_min, self.q_max)


@dataclass(frozen=True, kw_only=True)
class ExploringAnts(AntSystem):
    """Common ants, ants that avoid pheromone, and an elite.

    The improved ACO of suganthi2019, section IV: common ants choose by tau^alpha eta^beta (eq. 1), exploratory
    ants by eta^beta / tau^alpha (eq. 5), and the best ants of an iteration, of either kind, deposit more (eq.
    7-8). According to the text below eq. 7, the second term is the deposit of common ants, and the third has the
    factor alpha, which section V sets to 1. Both are the defaults here. With `depositors="all"` exploratory ants
    deposit like common ones.

    The paper does not define the behaviour in dead ends nor whether loops are cut. With `backtrack=False` and
    `shortcut=False` ants die in dead ends and walk in loops. docs/papers/suganthi2019.md compares the
    interpretations.

    Known weaknesses, measured on the same page: exploratory ants do not pay. They wander, so an iteration takes
    up to ten times as long as with `AntSystem`, and as many common ants in their place find shorter paths on
    maps of 30 x 30 and 50 x 50 cells. A heavier elite helps (`elite=25`): at 50 x 50 cells paths are 7 per cent
    longer than the shortest, with that elite 3.

    Attributes:
        ants: the number of common ants
        explorers: the number of exploratory ants
        beta: the exponent of the heuristic
        elite: the factor alpha of eq. 7, the additional deposit of the iteration's best ants in units of
            Q / length
        depositors: the ants in the second term of eq. 7. "common": common ants only, as in the text; "all": also
            exploratory ants
        ties: the third term of eq. 7 if several ants are best. "arc": each arc of their tours receives one full
            deposit, the letter of eq. 8; "ant": each ant deposits in full; "share": they divide one deposit
        heuristic: as in `AntSystem`
        backtrack: as in `Colony`; undefined in the paper, which only mentions deadlock as a difficulty
        shortcut: as in `Colony`; undefined in the paper

    Raises:
        FieldError: an option is out of range; names it and the valid range.
    """

    ants: int = 25
    explorers: int = 75
    beta: float | None = 1.0
    elite: float = 1.0
    depositors: Literal["common", "all"] = "common"
    ties: Literal["arc", "ant", "share"] = "arc"
    heuristic: Literal["goal", "step"] = "step"
    backtrack: bool = True
    shortcut: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        require("explorers", self.explorers, at_least=0, at_most=1_000_000)
        require("elite", self.elite, at_least=0)

    @property
    def kinds(self) -> tuple[int, ...]:
        """Common ants, then exploratory ants."""
        return (self.ants, self.explorers)

    def choice_weights(
        self,
        graph: ColonyGraph,
        trail: Floats,
        heuristic: Heuristic,
        weights: Weights,
        context: ChoiceContext = FIRST_KIND,
    ) -> None:
        """Fill `weights` with eta^beta tau^alpha for common ants (eq. 1), eta^beta / tau^alpha for exploratory (eq. 5).

        `context` names the kind of ant; `trail` is tau, `heuristic` eta^beta; `graph` is ignored.
        """
        from antdrive.planners.colonies import _kernels_colony

        _kernels_colony.arc_weights(trail, heuristic, self.alpha if context.kind == 0 else -self.alpha, weights)

    def update(self, trail: Floats, state: IterationState) -> None:
        """Update `trail` by `state` as `AntSystem`; with `ties` "arc", add elite Q / L_best once to each arc of best tours."""
        from antdrive.planners.colonies import _kernels_colony

        super().update(trail, state)
        tours, best = state.tours, elite_ants(state.tours)
        if self.ties == "arc":
            moves = np.zeros((len(trail), 1), dtype=np.uint8)
            _kernels_colony.union_moves(tours.cells[best], tours.sizes[best], state.graph.to, moves[:, 0])
            trail += self.elite * self.deposit / tours.lengths.min() * np.unpackbits(moves, axis=1, bitorder="little")

    def amounts(self, state: IterationState) -> Floats:
        """Return Q / L_k for depositors plus, for the best ants of `state`, elite Q / L_best by `ties`."""
        lengths, best = state.tours.lengths, elite_ants(state.tours)
        usual = 1.0 if self.depositors == "all" else state.first + np.arange(len(lengths)) < self.ants
        elite = {"arc": 0.0, "ant": self.elite, "share": self.elite / best.sum()}[self.ties]
        return np.where(best, usual + elite, usual) * self.deposit / lengths  # eq. 4, 7 and 8


def elite_ants(tours: Walks) -> npt.NDArray[np.bool_]:
    """Return for each ant whether its tour is the shortest of the iteration (ants,); all if none arrived."""
    best: npt.NDArray[np.bool_] = tours.lengths <= tours.lengths.min() + 1e-9
    return best


def ranked(lengths: Floats, ranks: int) -> Floats:
    """Return each ant's fraction of its full deposit (ants,): 1 for the best, 1 / ranks less per rank."""
    rank = np.empty(len(lengths), dtype=np.int64)
    rank[np.argsort(lengths, kind="stable")] = np.arange(len(lengths))
    return np.maximum(1.0 - rank / ranks, 0.0)


def ibraheem_beta(side: int) -> float:
    """Return the heuristic's exponent of ibraheem2016, Table 1, for a map of side x side cells."""
    return 1.605e-17 * side**2 + 0.22 * side + 6.181e-15


def normalised(eta: Floats, beta: float) -> Weights:
    """Return eta^beta (cells, 8) relative to each cell's largest value; 0 for moves that are not allowed (eta = -inf).

    Ants choose by ratios within a cell, so the scale is irrelevant, and powers stay within float32.
    """
    largest = eta.max(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isfinite(eta), eta / np.where(np.isfinite(largest), largest, 1.0), 0.0)
    return np.where(ratio > 0, np.maximum(ratio**beta, 1e-30), 0.0).astype(np.float32)


@dataclass(frozen=True, kw_only=True)
class MaxMinAnts(AntSystem):
    """MAX-MIN ant system: one ant deposits, on trails between bounds.

    Stützle & Hoos 2000: the depositing ant is the best of the iteration or the best so far (section 5), the
    bounds follow the best tour (eq. 7 and 11), and all trails start at the upper bound (section 3.3) and return
    there when the search stagnates (section 3.4). The paper's problems have no dead ends; on a grid these ants
    backtrack out of them. Shortcutting tours replaces the paper's local search; evaporation and schedule are
    those of the paper with local search.

    Known weakness, measured (docs/notebook/planner-quality.md): paths get longer with the grid's size. With a
    quarter of the cells blocked, 10 of 10 are the shortest at 20 x 20; at 50 x 50 they are 0.4 per cent longer in
    the median and 2.6 at worst, at 100 x 100 1.4 and 3.8.

    Attributes:
        evaporation: rho; the paper retains 0.8 with local search
        initial: the pheromone before the first update; arbitrarily high, so that it is clamped to tau_max
        p_best: the probability of building the best tour after the trails have converged (eq. 11)
        patience: iterations without a better tour before all trails return to the upper bound
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
        """Evaporate `trail`, deposit for one ant of `state`, clamp to the bounds; reset on stagnation."""
        from antdrive.planners.colonies import _kernels_colony

        if state.best is None:
            return  # without a best tour there are no bounds
        tau_min, tau_max = self.bounds(state.graph, state.best)
        if state.since and state.since % self.patience == 0:
            if state.first == 0:
                trail.fill(tau_max)  # section 3.4
            return
        trail *= 1.0 - self.evaporation
        tours = self.depositor(state)
        if tours is not None:
            _kernels_colony.deposit_on_arcs(
                trail, state.graph.to, tours.cells, tours.sizes, self.deposit / tours.lengths
            )
        np.clip(trail, tau_min, tau_max, out=trail)

    def depositor(self, state: IterationState) -> Walks | None:
        """Return the tour that deposits: the best of the iteration in `state` or, periodically, the best so far."""
        return state.best if state.number % best_so_far_every(state.number) == 0 else state.tours.shortest()

    def bounds(self, graph: ColonyGraph, best: Walks) -> tuple[float, float]:
        """Return tau_min and tau_max on `graph` for the `best` tour so far (eq. 7 and 11)."""
        tau_max = self.deposit / (self.evaporation * float(best.lengths[0]))
        steps = max(1, int(best.sizes[0]) - 1)
        choices = float(np.unpackbits(graph.mask).sum()) / max(1, int(np.count_nonzero(graph.mask))) - 1
        p_dec = self.p_best ** (1.0 / steps)  # the probability of one right decision
        tau_min = tau_max * (1.0 - p_dec) / (max(choices - 1, 1.0) * p_dec)
        return min(tau_min, tau_max), tau_max


def best_so_far_every(number: int) -> int:
    """Return the period of deposits by the best tour so far at iteration `number`; it shrinks over time (section 5)."""
    for limit, every in ((25, 25), (75, 5), (125, 3), (250, 2)):
        if number < limit:
            return every
    return 1
