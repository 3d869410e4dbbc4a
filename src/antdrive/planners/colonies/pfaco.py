"""Ant colony on a potential field, without generations.

J.-W. Lee, J.-J. Kim, B.-S. Choi, J.-J. Lee, *Improved ant colony optimization algorithm by potential field
concept for optimal path planning*, 2008 (lee2008), section IV.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import require
from antdrive.base.records import require_choices
from antdrive.planners.colonies.colony import ColonyGraph
from antdrive.planners.iterative import Iteration, IterativePlanner
from antdrive.planners.plan import Capabilities, Query

if TYPE_CHECKING:  # importing kernels loads the compiler
    from antdrive.planners.colonies._kernels_pfaco import Ants, Ranking


@dataclass(frozen=True, kw_only=True)
class PotentialFieldAnts(IterativePlanner):
    """Ants guided by a potential field, with ranked paths.

    The improved ACO of lee2008, section IV, has no generations: an ant chooses the next cell by pheromone^alpha
    U_ij^beta (eq. 13). The potential rises away from the start (eq. 9) and falls near obstacles (eq. 11); the
    initial pheromone mixes potential and chance (eq. 14). All ants move by one cell per tick. An ant that arrives
    enters its path into a ranking list by length times number of cells (eq. 15), deposits by rank and restarts.
    Converged pheromone is rebuilt from the list (section IV-B). It evaporates each tick; the paper names no time.
    An iteration here ends when `ants` walks have ended.

    The paper leaves these points open, each an option here: the definition of U_ij (`form`), whether an ant may
    return to a cell (`memory`), dead ends (`backtrack`), and the constants from `attraction` to `convergence`.
    docs/papers/lee2008.md compares the interpretations. With U_ij = U_j, two neighbours far from the start differ
    by a few per cent, and ants walk almost at random. The step limit `max_steps` is an addition.

    Known weaknesses, measured on the same page and in docs/notebook/planner-quality.md. The potential has no maximum
    at the goal: unless the goal is the cell farthest from the start, ants are drawn past it, and paths may be
    three times as long as the shortest; `field="goal"` prevents it. Ants restart in dead ends: 9 of 10 runs cross
    100 x 100 cells with 25 per cent blocked, and 18 of 50 the winding maps of 25 x 25 cells that represent
    lee2008's map 1; with `backtrack` all do.

    Attributes:
        ants: ants, and walks per iteration
        ranks: paths in the ranking list
        evaporation: the fraction of pheromone lost per tick; rho of lee2008, 0.99, is the fraction retained
        mix: k_mix of eq. 14, the fraction of chance in the initial pheromone
        alpha_1: the exponent of the pheromone in stage 1, until the list has been filled twice
        beta_1: the exponent of the potential in stage 1
        alpha_2: the exponent of the pheromone in stage 2, until `ants` more paths have entered the list
        beta_2: the exponent of the potential in stage 2
        alpha_3: the exponent of the pheromone in stage 3
        beta_3: the exponent of the potential in stage 3
        attraction: k_att of eq. 9
        repulsion: k_rep of eq. 11; U = U_att - U_rep, as ants climb. If negative, obstacles attract: the sum of eq. 7 by
            the letter
        influence: d0 of eq. 11, the range of the repulsion [cells]
        deposit: the deposit on each cell of a first-rank path; it falls linearly with the rank
        graded: whether the deposit depends on the rank; otherwise every ant that arrives deposits the full amount
        min_pheromone: the lower bound of a free cell's pheromone
        convergence: the pheromone has converged when its sum changes by less than this fraction in an iteration
        max_steps: step limit of a walk; None: one step per cell, but at least 100 and at most 20 000
        form: U_ij of eq. 13; eq. 9 and 11 define only U at a cell. "local": U_j minus the lowest U of cell i and
            its neighbours, plus attraction / 2; "rise": U_j - U_i, at least attraction / 2; "letter": U_j; "distance":
            eta of eq. 1, the reciprocal of the distance from cell j to the goal. All moves attract
        field: the origin of eq. 9. "start": the start, as in section IV-A; "goal": the same parabola with its
            maximum at the goal
        memory: allowed_k of eq. 13. "tabu": the neighbours that the ant has not visited, as in eq. 1; "none":
            all neighbours, taken literally; loops then count in the ranking, and are cut out of the path
        backtrack: whether an ant in a dead end steps back until it finds another path; otherwise it restarts
        shortcut: whether paths are cut short where they pass next to an earlier part of themselves
        generations: whether ants wait at the goal or in a dead end until all walks have ended, then deposit, as in the
            conventional colony; pheromone then evaporates once per iteration

    Raises:
        FieldError: an option is out of range; names it and the valid range.
    """

    ants: int = 500
    ranks: int = 100
    evaporation: float = 0.01
    mix: float = 0.3
    alpha_1: float = 1.0
    beta_1: float = 2.0
    alpha_2: float = 2.0
    beta_2: float = 1.0
    alpha_3: float = 3.0
    beta_3: float = 1.0
    attraction: float = 1.0
    repulsion: float = 10.0
    influence: float = 2.0
    deposit: float = 2.0
    graded: bool = True
    min_pheromone: float = 0.001
    convergence: float = 0.02
    max_steps: int | None = None
    form: Literal["local", "rise", "letter", "distance"] = "local"
    field: Literal["start", "goal"] = "start"
    memory: Literal["tabu", "none"] = "tabu"
    backtrack: bool = False
    shortcut: bool = False
    generations: bool = False

    work_unit: ClassVar[str] = "ant steps"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("ants", self.ants, at_least=1, at_most=1_000_000)
        require("ranks", self.ranks, at_least=1, at_most=1_000_000)
        require("evaporation", self.evaporation, at_least=0, at_most=1)
        require("mix", self.mix, at_least=0, at_most=1)
        for key in ("alpha_1", "beta_1", "alpha_2", "beta_2", "alpha_3", "beta_3"):
            require(key, getattr(self, key), at_least=0)
        require("repulsion", self.repulsion)
        for key in ("attraction", "influence", "deposit", "min_pheromone", "convergence"):
            require(key, getattr(self, key), above=0)
        if self.max_steps is not None:
            require("max_steps", self.max_steps, at_least=1)
        require_choices(self)

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities and requirements of this planner. Ants that restart in dead ends may miss an existing path."""
        return Capabilities(iterative=True, complete=self.backtrack, turns=True)

    def potential(self, query: Query) -> Floats:
        """Return the field that ants climb (nodes,), above 0 where free: eq. 9 by `field`, lowered by eq. 11."""
        from antdrive.planners.colonies import _kernels_pfaco

        graph = ColonyGraph.of(query)
        near = _kernels_pfaco.obstacle_distance(query.grid.free, math.floor(self.influence))
        near = np.clip(graph.of_nodes(near), 1.0, self.influence)
        away = graph.distance_to(graph.start if self.field == "start" else graph.goal)
        distance = away if self.field == "start" else away.max() - away
        climb = 0.5 * self.attraction * distance**2  # eq. 9
        climb -= 0.5 * self.repulsion * (1.0 / near - 1.0 / self.influence) ** 2  # eq. 11
        free = graph.of_nodes(query.grid.free)
        # The lowest free cell must still attract a little.
        return np.where(free, climb - climb[free].min() + 0.5 * self.attraction, 0.0)

    def attractions(self, graph: ColonyGraph, field: Floats) -> Floats:
        """Return U_ij of eq. 13 in a potential `field` (nodes,) for each move of `graph` (nodes, 8); 0 for others."""
        there, here, least = graph.at_neighbours(field), field[:, None], 0.5 * self.attraction
        allowed = np.isfinite(there)
        if self.form == "local":
            lowest = np.minimum(here, np.where(allowed, there, np.inf).min(axis=1, keepdims=True))
            there = np.where(allowed, there, 0.0) - lowest + least
        elif self.form == "rise":
            there = np.maximum(there - here, least)
        elif self.form == "distance":
            there = graph.nearness()
        return np.where(allowed, there, 0.0)

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Run the ants without end, and rebuild the pheromone whenever it converges."""
        field = self.potential(query)
        graph = ColonyGraph.of(query)
        free = graph.of_nodes(query.grid.free)
        trail = self.initial_trail(field, free, rng)
        drawn, pool = self.attractions(graph, field), AntPool.of(self, graph, rng)
        total = math.inf
        while True:
            stage = self.stage(pool.entries)
            alpha = (self.alpha_1, self.alpha_2, self.alpha_3)[stage - 1]
            beta = (self.beta_1, self.beta_2, self.beta_3)[stage - 1]
            arrivals, steps = pool.run(trail, drawn**beta, alpha)
            before, total = total, float(trail.sum())
            if abs(total - before) < self.convergence * before:
                self.rebuild(trail, free, stage, pool, rng)
                total = math.inf
            yield pool.report(query.grid.cell, trail, arrivals, steps)

    def initial_trail(self, field: Floats, free: npt.NDArray[np.bool_], rng: np.random.Generator) -> Floats:
        """Return the first pheromone (nodes,) by eq. 14, from the potential `field` and the `free` nodes (nodes,)."""
        trail = self.mix * rng.random(len(field)) + (1 - self.mix) * field / field.max()
        return np.where(free, np.maximum(trail, self.min_pheromone), 0.0)

    def default_steps(self, nodes: int) -> int:
        """Return the step limit of a walk on a graph of some nodes if `max_steps` is None."""
        return 2 * nodes if self.backtrack else min(max(100, nodes), 20_000)

    def stage(self, entries: int) -> int:
        """Return the stage, 1 to 3, after `entries` paths have entered the ranking list (section IV-B)."""
        twice = 2 * self.ranks
        return 1 if entries < twice else 2 if entries < twice + self.ants else 3

    def rebuild(
        self, trail: Floats, free: npt.NDArray[np.bool_], stage: int, pool: AntPool, rng: np.random.Generator
    ) -> None:
        """Reset a converged `trail` (nodes,), where `free`, by the rule of a `stage` (section IV-B).

        In stage 1 it is random, later from the best tenth of the ranking list of `pool`, then from all of it.
        """
        if stage == 1:
            trail[:] = np.where(free, np.maximum(rng.random(len(trail)), self.min_pheromone), 0.0)
            return
        trail[:] = np.where(free, self.min_pheromone, 0.0)
        ranking, listed = pool.ranking, pool.listed
        for rank in range(math.ceil(listed / 10) if stage == 2 else listed):
            row = ranking.order[rank]
            trail[ranking.walks[row, : ranking.sizes[row]]] += self.deposit * (
                1 - rank / self.ranks if self.graded else 1
            )


@dataclass(eq=False)
class AntPool:
    """The ants of one plan and their ranking list, for compiled code."""

    planner: PotentialFieldAnts  # the parameters
    graph: ColonyGraph  # the ants' graph
    limit: int  # step limit of a walk
    ants: Ants  # the ants and their unfinished walks
    ranking: Ranking  # the ranking list
    buffer: npt.NDArray[np.int32]  # output of kernels: a new best walk (room,)
    arrivals: Floats  # output of kernels: lengths of the walks that arrived
    shortest: float = math.inf  # length of the best walk [cells], inf while there is none
    best: npt.NDArray[np.int32] | None = None  # the cells of the best walk, as flat indices

    @classmethod
    def of(cls, planner: PotentialFieldAnts, graph: ColonyGraph, rng: np.random.Generator) -> AntPool:
        """Place all ants at the start, with an empty list."""
        from antdrive.planners.colonies import _kernels_pfaco

        cells, count, ranks = len(graph.mask), planner.ants, planner.ranks
        limit = planner.max_steps or planner.default_steps(cells)
        room = 1 + (min(limit, cells) if planner.memory == "tabu" else limit)
        ants = _kernels_pfaco.Ants(
            states=rng.bit_generator.random_raw(count).astype(np.uint64) | np.uint64(1),
            walks=np.empty((count, room), dtype=np.int32),
            sizes=np.empty(count, dtype=np.int64),
            taken=np.empty(count, dtype=np.int64),
            lengths=np.empty(count),
            visited=np.empty((count, cells // 8 + 1), dtype=np.uint8),
        )
        ranking = _kernels_pfaco.Ranking(
            walks=np.empty((ranks, room), dtype=np.int32),
            sizes=np.empty(ranks, dtype=np.int64),
            costs=np.empty(ranks),
            order=np.empty(ranks, dtype=np.int64),
            counts=np.zeros(2, dtype=np.int64),
        )
        for ant in range(count):
            _kernels_pfaco.leave(ant, graph.start, ants)
        buffer, arrivals = np.empty(room, dtype=np.int32), np.empty(2 * count)
        return cls(planner, graph, limit, ants, ranking, buffer, arrivals)

    @property
    def listed(self) -> int:
        """Number of walks in the ranking list."""
        from antdrive.planners.colonies._kernels_pfaco import LISTED

        return int(self.ranking.counts[LISTED])

    @property
    def entries(self) -> int:
        """Total number of walks entered into the ranking list."""
        from antdrive.planners.colonies._kernels_pfaco import ENTRIES

        return int(self.ranking.counts[ENTRIES])

    def run(self, trail: Floats, heuristic: Floats, alpha: float) -> tuple[Floats, int]:
        """Run one iteration; returns the lengths of the walks that arrived [cells] and the total number of steps."""
        from antdrive.planners.colonies import _kernels_pfaco

        planner, graph = self.planner, self.graph
        rules = _kernels_pfaco.Rules(
            alpha=float(alpha),
            evaporation=float(planner.evaporation),
            min_pheromone=float(planner.min_pheromone),
            deposit=float(planner.deposit),
            graded=planner.graded,
            generations=planner.generations,
            limit=self.limit,
            tabu=planner.memory == "tabu",
            backtrack=planner.backtrack,
            shortcut=planner.shortcut,
            quota=planner.ants,
        )
        size, self.shortest, steps, arrived = _kernels_pfaco.run_colony(
            trail,
            heuristic,
            graph.arrays,
            rules,
            self.ants,
            self.ranking,
            self.shortest,
            self.buffer,
            self.arrivals,
        )
        if size:
            self.best = self.buffer[:size].copy()
        return self.arrivals[:arrived].copy(), int(steps)

    def report(self, cell: float, trail: Floats, arrivals: Floats, steps: int) -> Iteration:
        """Return the state after an iteration from the results of `run` and the pheromone, for cells of side `cell` [m]."""
        best: Any = np.empty(0, dtype=np.int32) if self.best is None else self.best
        return Iteration(
            cells=self.graph.cells(best),
            best=cell * self.shortest,
            iteration_best=cell * float(arrivals.min(initial=math.inf)),
            iteration_mean=cell * float(arrivals.mean()) if len(arrivals) else math.inf,
            arrived=len(arrivals),
            work=steps,
            field=self.graph.draw(trail, np.empty(self.graph.shape)),
        )
