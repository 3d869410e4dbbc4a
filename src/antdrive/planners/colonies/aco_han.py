"""Ant colony guided by the direction of the goal (Han, MSc thesis, Missouri 2007, section 4.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

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
    Weights,
)


@dataclass(frozen=True, kw_only=True)
class AcoHan(Colony):
    """Ants led by pheromone on cells and by the goal.

    Han 2007, section 4.2: the weight of a move is the next cell's fraction of the pheromone plus alpha times
    its pull to the goal (eq. 4.2.1). Pheromone evaporates (eq. 4.2.2), every ant that arrives deposits on its
    cells (eq. 4.2.3), and an elite deposits more (eq. 4.2.4). The pull is a dot product with the vector to the
    goal, up to 38 on the thesis' map, where a fraction is at most 1, or with its direction: the text has both. The
    default is the latter, the cosine, at least 0. The thesis' program has a third pull; `form` selects one.

    By the default pull alone a move away from the goal weighs 0, less than a step back, and no ant leaves a dead
    end. A comment in the program lets ants turn back only after visiting every neighbour; `min_weight` gives
    moves to unvisited cells that priority.

    Known weakness, measured (docs/papers/han2007.md): the colony does not learn. Pheromone on cells also pulls
    ants back, so walks grow. In the world `forest` the best path is that of iteration 1 of 50, and the mean walk
    grows from 28 to 38 m; without pheromone it stays at 28 m. `mmas` learns there.

    Attributes:
        ants: ants per iteration
        iterations: iterations
        evaporation: rho
        deposit: an ant deposits deposit / length on its cells; 1 in the thesis' text, 5 in its program
        attraction: alpha of eq. 4.2.1
        elitism: e of eq. 4.2.4, the additional deposit of the best tour in ants; 0: no elite
        elite_of: whose best tour is the elite, the "run" or the "iteration"
        form: "equation": the cosine as pull; "letter": the plain dot product; "listing": as in the program, with
            absolute pheromone, one direction from start to goal for all cells, moves not normalised, and
            evaporation only where ants deposit
        revisit: the weight of a visited cell
        min_weight: the least weight of an unvisited cell; 0 follows the equation literally

    Raises:
        FieldError: an option is out of range; names it and the valid range.
    """

    ants: int = 500
    iterations: int = 50
    evaporation: float = 0.1
    deposit: float = 1.0
    attraction: float = 1.0
    elitism: int = 0
    elite_of: Literal["run", "iteration"] = "run"
    form: Literal["equation", "letter", "listing"] = "equation"
    revisit: float = 1e-5
    min_weight: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        require("evaporation", self.evaporation, at_least=0, at_most=1)
        require("deposit", self.deposit, above=0)
        require("attraction", self.attraction, at_least=0)
        require("elitism", self.elitism, at_least=0)
        require("revisit", self.revisit, at_least=0)
        require("min_weight", self.min_weight, at_least=0)
        require_choices(self)

    def initial_trail(self, graph: ColonyGraph, rng: np.random.Generator) -> Floats:
        """Return tau(0) = 0 on every cell of `graph`."""
        return np.zeros(len(graph.mask))

    def heuristic_values(self, graph: ColonyGraph) -> Heuristic:
        """Return Omega of eq. 4.2.1, the pull of each move of `graph` to the goal."""
        from antdrive.worlds._kernels import DCOL, DROW

        here = np.stack([graph.of_nodes(index) for index in np.indices(graph.shape)])
        ahead = np.array(graph.cell_of(graph.goal))[:, np.newaxis] - here  # (2, nodes)
        if self.form == "listing":
            rows, cols = ahead[:, graph.start].tolist()
            distance = math.hypot(rows, cols)
            pull = np.maximum(0.0, DROW * (rows / distance) + DCOL * (cols / distance))
            return np.where(graph.allowed, pull, 0.0)
        away = np.hypot(*ahead)[:, np.newaxis]
        pull = DROW * ahead[0, :, np.newaxis] + DCOL * ahead[1, :, np.newaxis]
        if self.form != "letter":
            pull = np.maximum(0.0, pull / np.where(away > 0, away, 1.0) / STEP)
        return np.where(graph.allowed & (away > 0), pull, 0.0)

    def choice_weights(
        self,
        graph: ColonyGraph,
        trail: Floats,
        heuristic: Heuristic,
        weights: Weights,
        context: ChoiceContext = FIRST_KIND,
    ) -> None:
        """Fill `weights` with phi = tau_j / sum tau + alpha Omega (eq. 4.2.1) for every move of `graph`.

        `trail` is tau, `heuristic` Omega; `context` is ignored.
        """
        from antdrive.planners.colonies import _kernels_colony

        by_fraction = self.form != "listing"
        _kernels_colony.attracted_weights(
            trail, graph.arrays, heuristic, self.attraction, by_fraction, self.min_weight, weights
        )

    def update(self, trail: Floats, state: IterationState) -> None:
        """Evaporate `trail`, then deposit along the complete walks of `state` and for the elite."""
        from antdrive.planners.colonies import _kernels_colony

        walks, elite = state.walks, None
        amounts = self.deposit / walks.lengths  # eq. 4.2.3; 0 for an ant that did not arrive
        if self.form == "listing":
            _kernels_colony.deposit_in_passing(trail, walks.cells, walks.sizes, amounts, self.evaporation)
        else:
            trail *= 1.0 - self.evaporation  # eq. 4.2.2
            _kernels_colony.deposit_on_cells(trail, walks.cells, walks.sizes, amounts)
        if self.elitism:
            elite = state.best if self.elite_of == "run" else state.tours.shortest()
        if elite is not None:
            amounts = self.elitism * self.deposit / elite.lengths  # eq. 4.2.4
            _kernels_colony.deposit_on_cells(trail, elite.cells, elite.sizes, amounts)
