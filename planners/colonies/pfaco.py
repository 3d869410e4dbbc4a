"""Ants on a potential field, without generations.

J.-W. Lee, J.-J. Kim, B.-S. Choi, J.-J. Lee, *Improved ant colony optimization algorithm by potential field concept
for optimal path planning*, 2008 (lee2008), section IV.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.planners.colonies.colony import ColonyGraph
from antdrive.planners.iterative import Iteration, IterativePlanner, require
from antdrive.planners.plan import Capabilities, Query
from antdrive.worlds import Floats


@dataclass(frozen=True, kw_only=True)
class PotentialFieldAnts(IterativePlanner):
    """Ants drawn by a potential field, which rank their paths and start again one by one: lee2008's improved ACO.

    All ants move a cell per tick; an iteration is as many ticks as it takes for as many walks to end as there are
    ants. Pheromone lies on cells.
    """

    ants: int = 500
    listed: int = 100  # paths in the ranking list
    evaporation: float = 0.01  # per tick; the paper's rho, 0.99, is what is retained
    mix: float = 0.3  # k_mix of eq. 14: share of chance in the first pheromone
    # Exponents of pheromone and potential in the three stages.
    alpha_1: float = 1.0
    beta_1: float = 2.0
    alpha_2: float = 2.0
    beta_2: float = 1.0
    alpha_3: float = 3.0
    beta_3: float = 1.0
    # The paper gives no values for the rest.
    attraction: float = 1.0  # k_att of eq. 9
    repulsion: float = 10.0  # k_rep of eq. 11
    influence: float = 2.0  # d0 of eq. 11 [cells]
    deposit: float = 2.0  # on each cell of a path of the first rank; the last gets next to nothing
    least: float = 0.001  # pheromone does not decay below this
    converged: float = 0.02  # the field has converged when an iteration changes its sum by less than this share
    max_steps: int | None = None  # a walk that takes more ends; None: a step per cell, within 100 to 20 000
    retreat: bool = False  # an ant in a dead end steps back out of it; else it starts again
    shortcut: bool = False  # paths are cut short wherever they pass next to themselves

    def __post_init__(self) -> None:
        super().__post_init__()
        require("ants", self.ants, at_least=1, at_most=1_000_000)
        require("listed", self.listed, at_least=1, at_most=1_000_000)
        require("evaporation", self.evaporation, at_least=0, at_most=1)
        require("mix", self.mix, at_least=0, at_most=1)
        for key in ("alpha_1", "beta_1", "alpha_2", "beta_2", "alpha_3", "beta_3", "repulsion"):
            require(key, getattr(self, key), at_least=0)
        for key in ("attraction", "influence", "deposit", "least", "converged"):
            require(key, getattr(self, key), above=0)
        if self.max_steps is not None:
            require("max_steps", self.max_steps, at_least=1)

    @property
    def work_unit(self) -> str:
        """What `work` counts."""
        return "ant steps"

    @property
    def capabilities(self) -> Capabilities:
        """What this planner can do and what it needs. Ants that die in dead ends may miss a path that exists."""
        return Capabilities(iterative=True, complete=self.retreat)

    def potential(self, query: Query) -> Floats:
        """The field that ants climb, (cells,), above 0 where free: eq. 9 from the start, lowered by eq. 11."""
        from antdrive.planners.colonies import _kernels_pfaco

        ground = ColonyGraph.of(query)
        near = _kernels_pfaco.obstacle_distance(query.grid.free, math.floor(self.influence)).ravel()
        near = np.clip(near, 1.0, self.influence)
        climb = 0.5 * self.attraction * ground.far(ground.start) ** 2
        climb -= 0.5 * self.repulsion * (1.0 / near - 1.0 / self.influence) ** 2
        free = query.grid.free.ravel()
        # The lowest free cell still attracts a little.
        return np.where(free, climb - climb[free].min() + 0.5 * self.attraction, 0.0)

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Run, and rebuild the pheromone wherever it has converged."""
        ground, field = ColonyGraph.of(query), self.potential(query)
        free = query.grid.free.ravel()
        trail = self.mix * rng.random(len(field)) + (1 - self.mix) * field / field.max()  # eq. 14
        trail = np.where(free, np.maximum(trail, self.least), 0.0)
        colony = _Colony.of(self, ground, rng)
        total = math.inf
        while True:
            stage = self.stage(int(colony.counts[1]))
            alpha = (self.alpha_1, self.alpha_2, self.alpha_3)[stage - 1]
            beta = (self.beta_1, self.beta_2, self.beta_3)[stage - 1]
            arrivals, steps = colony.run(trail, field**beta, alpha)
            before, total = total, float(trail.sum())
            if abs(total - before) < self.converged * before:
                self.rebuild(trail, free, stage, colony, rng)
                total = math.inf
            yield _report(query, ground, trail, colony, arrivals, steps)

    def stage(self, entries: int) -> int:
        """1 until the ranking list has been filled anew, 2 until as many entries more as ants, 3 (section IV-B)."""
        anew = 2 * self.listed
        return 1 if entries < anew else 2 if entries < anew + self.ants else 3

    def rebuild(
        self, trail: Floats, free: npt.NDArray[np.bool_], stage: int, colony: _Colony, rng: np.random.Generator
    ) -> None:
        """Reset a converged field: at random, by the best tenth of the list, by all of it (section IV-B)."""
        if stage == 1:
            trail[:] = np.where(free, np.maximum(rng.random(len(trail)), self.least), 0.0)
            return
        trail[:] = np.where(free, self.least, 0.0)
        listed = int(colony.counts[0])
        for rank in range(math.ceil(listed / 10) if stage == 2 else listed):
            row = colony.order[rank]
            trail[colony.ranked[row, : colony.sizes[row]]] += self.deposit * (1 - rank / self.listed)


@dataclass(eq=False)
class _Colony:
    """The ants and their ranking list, as compiled code keeps them."""

    planner: PotentialFieldAnts
    ground: ColonyGraph
    limit: int
    states: npt.NDArray[np.uint64]
    walks: npt.NDArray[np.int32]
    ants: npt.NDArray[np.int64]
    lengths: Floats
    been: npt.NDArray[np.uint8]
    ranked: npt.NDArray[np.int32]
    sizes: npt.NDArray[np.int64]
    costs: Floats
    order: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int64]
    buffer: npt.NDArray[np.int32]
    arrivals: Floats
    shortest: float = math.inf
    best: npt.NDArray[np.int32] | None = None

    @classmethod
    def of(cls, planner: PotentialFieldAnts, ground: ColonyGraph, rng: np.random.Generator) -> _Colony:
        from antdrive.planners.colonies import _kernels_pfaco

        cells, ants, listed = len(ground.mask), planner.ants, planner.listed
        limit = planner.max_steps or (2 * cells if planner.retreat else min(max(100, cells), 20_000))
        room = 1 + min(limit, cells)
        colony = cls(
            planner=planner,
            ground=ground,
            limit=limit,
            states=rng.bit_generator.random_raw(ants).astype(np.uint64) | np.uint64(1),
            walks=np.empty((ants, room), dtype=np.int32),
            ants=np.empty((ants, 2), dtype=np.int64),
            lengths=np.empty(ants),
            been=np.empty((ants, cells // 8 + 1), dtype=np.uint8),
            ranked=np.empty((listed, room), dtype=np.int32),
            sizes=np.empty(listed, dtype=np.int64),
            costs=np.empty(listed),
            order=np.empty(listed, dtype=np.int64),
            counts=np.zeros(4, dtype=np.int64),
            buffer=np.empty(room, dtype=np.int32),
            arrivals=np.empty(2 * ants),
        )
        for ant in range(ants):
            _kernels_pfaco.leave(ant, ground.start, colony.walks, colony.ants, colony.lengths, colony.been)
        return colony

    def run(self, trail: Floats, appeal: Floats, alpha: float) -> tuple[Floats, int]:
        """One iteration: the lengths of those that arrived, and the steps of all."""
        from antdrive.planners.colonies import _kernels_pfaco

        planner, before = self.planner, int(self.counts[2])
        size, self.shortest = _kernels_pfaco.run_colony(
            trail,
            appeal,
            self.ground.mask,
            self.ground.offset,
            self.ground.start,
            self.ground.goal,
            alpha,
            planner.evaporation,
            planner.least,
            planner.deposit,
            self.limit,
            planner.retreat,
            planner.shortcut,
            planner.ants,
            self.states,
            self.walks,
            self.ants,
            self.lengths,
            self.been,
            self.ranked,
            self.sizes,
            self.costs,
            self.order,
            self.counts,
            self.shortest,
            self.buffer,
            self.arrivals,
        )
        if size:
            self.best = self.buffer[:size].copy()
        return self.arrivals[: self.counts[3]].copy(), int(self.counts[2]) - before


def _report(
    query: Query, ground: ColonyGraph, trail: Floats, colony: _Colony, arrivals: Floats, steps: int
) -> Iteration:
    cell = query.grid.cell
    nothing: Any = np.empty(0, dtype=np.int32)
    return Iteration(
        cells=ground.cells(nothing if colony.best is None else colony.best),
        best=cell * colony.shortest,
        iteration_best=cell * float(arrivals.min(initial=math.inf)),
        iteration_mean=cell * float(arrivals.mean()) if len(arrivals) else math.inf,
        arrived=len(arrivals),
        work=steps,
        field=trail.reshape(ground.shape),
    )
