"""Ants on a potential field, without generations.

J.-W. Lee, J.-J. Kim, B.-S. Choi, J.-J. Lee, *Improved ant colony optimization algorithm by potential field
concept for optimal path planning*, 2008 (lee2008), section IV.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import FieldError, require
from antdrive.planners.colonies.colony import ColonyGraph
from antdrive.planners.iterative import Iteration, IterativePlanner
from antdrive.planners.plan import Capabilities, Query

if TYPE_CHECKING:  # importing kernels loads the compiler
    from antdrive.planners.colonies._kernels_pfaco import Ants, Ranking

FORMS, FIELDS, MEMORIES = ("local", "rise", "letter"), ("start", "goal"), ("tabu", "none")


@dataclass(frozen=True, kw_only=True)
class PotentialFieldAnts(IterativePlanner):
    """Ants guided by a potential field, with ranked paths and without generations: lee2008's improved ACO.

    Section IV of lee2008: an ant chooses the next cell by pheromone^alpha U_ij^beta (eq. 13). The potential
    rises away from the start (eq. 9) and falls near obstacles (eq. 11); the first pheromone is a mix of
    potential and chance (eq. 14). All ants move by one cell per tick. An ant that arrives enters its path
    into a ranking list by length times number of cells (eq. 15), deposits by rank and starts again. Where the
    pheromone has converged it is rebuilt from the list (section IV-B). An iteration here is as many ticks as
    it takes for `ants` walks to end.

    The paper leaves three things open, each an option here: what U_ij is (`form`), whether an ant may return
    to a cell (`memory`), and the constants from `attraction` on, for which it gives no values.
    docs/papers/lee2008.md says which readings were tried. Only readings in which U_ij depends on how much
    the potential differs between cells reach the paper's claims on 100 x 100 cells: to the letter, U of two
    neighbours differs by a few per cent far from the start, and ants walk almost at random.

    Known weaknesses, measured on the same page. The potential has no maximum at the goal: where the goal is
    not the cell that is farthest from the start, ants are drawn past it, and paths may be three
    times as long as the shortest; `field="goal"` mends that. Ants start again in dead ends; 9 of 10 runs cross
    100 x 100 cells of which 25 per cent are blocked, and 18 of 50 the winding maps of 25 x 25 cells that lee2008's map 1 stands
    for; all do with `backtrack`. The ranking list soon holds
    copies of one path, and the colony then improves no further.

    Attributes:
        ants: ants, and walks per iteration
        ranks: paths in the ranking list
        evaporation: the share of the pheromone lost per tick; rho of lee2008, 0.99, is the share retained
        mix: k_mix of eq. 14, the share of chance in the first pheromone
        alpha_1: the exponent of the pheromone in stage 1, until the list has been filled twice
        beta_1: the exponent of the potential in stage 1
        alpha_2: the exponent of the pheromone in stage 2, until as many more paths as ants have entered the
            list
        beta_2: the exponent of the potential in stage 2
        alpha_3: the exponent of the pheromone in stage 3
        beta_3: the exponent of the potential in stage 3
        attraction: k_att of eq. 9
        repulsion: k_rep of eq. 11
        influence: d0 of eq. 11, how far obstacles repel [cells]
        deposit: the deposit on each cell of a path of the first rank; it falls linearly with the rank
        min_pheromone: the pheromone of a free cell does not decay below this
        convergence: the pheromone has converged when its sum changes by less than this share in an iteration
        max_steps: a walk ends after this many steps; None: one step per cell, but at least 100 and at most 20
            000
        form: U_ij of eq. 13, of which eq. 9 and 11 define only the value U at a cell. "local": how much U_j
            exceeds the lowest U of cell i and the cells around it; "rise": how much U_j exceeds U_i; both
            with attraction / 2 more, or at least, so that every move attracts; "letter": U_j
        field: what eq. 9 measures from. "start": from the start, as section IV-A says; "goal": the same
            parabola with its highest point at the goal
        memory: allowed_k of eq. 13. "tabu": the cells around that the ant has not visited, as in eq. 1; "none":
            all of them, to the letter; walks then keep their loops in the ranking, and the path loses them
        backtrack: whether an ant in a dead end steps back until it finds another way; otherwise it starts
            again
        shortcut: whether paths are cut short where they pass next to an earlier part of themselves

    Raises:
        FieldError: an option is out of range; names it and what would be right.
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
    min_pheromone: float = 0.001
    convergence: float = 0.02
    max_steps: int | None = None
    form: Literal["local", "rise", "letter"] = "local"
    field: Literal["start", "goal"] = "start"
    memory: Literal["tabu", "none"] = "tabu"
    backtrack: bool = False
    shortcut: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        require("ants", self.ants, at_least=1, at_most=1_000_000)
        require("ranks", self.ranks, at_least=1, at_most=1_000_000)
        require("evaporation", self.evaporation, at_least=0, at_most=1)
        require("mix", self.mix, at_least=0, at_most=1)
        for key in ("alpha_1", "beta_1", "alpha_2", "beta_2", "alpha_3", "beta_3", "repulsion"):
            require(key, getattr(self, key), at_least=0)
        for key in ("attraction", "influence", "deposit", "min_pheromone", "convergence"):
            require(key, getattr(self, key), above=0)
        if self.max_steps is not None:
            require("max_steps", self.max_steps, at_least=1)
        for key, known in (("form", FORMS), ("field", FIELDS), ("memory", MEMORIES)):
            if getattr(self, key) not in known:
                words = [f"{name!r}" for name in known]
                raise FieldError(key, f"must be {', '.join(words[:-1])} or {words[-1]}, got {getattr(self, key)!r}")

    @property
    def work_unit(self) -> str:
        """What `work` counts."""
        return "ant steps"

    @property
    def capabilities(self) -> Capabilities:
        """What this planner can do and what it needs. Ants that start again in dead ends may miss a path that exists."""
        return Capabilities(iterative=True, complete=self.backtrack)

    def potential(self, query: Query) -> Floats:
        """The field that ants climb (cells,), above 0 where free: eq. 9 measured as `field` says, lowered by eq. 11."""
        from antdrive.planners.colonies import _kernels_pfaco

        graph = ColonyGraph.of(query)
        near = _kernels_pfaco.obstacle_distance(query.grid.free, math.floor(self.influence)).ravel()
        near = np.clip(near, 1.0, self.influence)
        away = graph.distance_to(graph.start if self.field == "start" else graph.goal)
        distance = away if self.field == "start" else away.max() - away
        climb = 0.5 * self.attraction * distance**2  # eq. 9
        climb -= 0.5 * self.repulsion * (1.0 / near - 1.0 / self.influence) ** 2  # eq. 11
        free = query.grid.free.ravel()
        # The lowest free cell must still attract a little.
        return np.where(free, climb - climb[free].min() + 0.5 * self.attraction, 0.0)

    def attractions(self, graph: ColonyGraph, field: Floats) -> Floats:
        """U_ij of eq. 13 for each move of `graph` (cells, 8); 0 where the move is not allowed.

        Args:
            graph: the graph to walk on
            field: the potential (cells,)
        """
        there, here, least = graph.at_neighbours(field), field[:, None], 0.5 * self.attraction
        allowed = np.isfinite(there)
        if self.form == "local":
            lowest = np.minimum(here, np.where(allowed, there, np.inf).min(axis=1, keepdims=True))
            there = np.where(allowed, there, 0.0) - lowest + least
        elif self.form == "rise":
            there = np.maximum(there - here, least)
        return np.where(allowed, there, 0.0)

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Run the ants without end, and rebuild the pheromone whenever it has converged."""
        field = self.potential(query)
        free = query.grid.free.ravel()
        trail = self.mix * rng.random(len(field)) + (1 - self.mix) * field / field.max()  # eq. 14
        trail = np.where(free, np.maximum(trail, self.min_pheromone), 0.0)
        graph = ColonyGraph.of(query)
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

    def stage(self, entries: int) -> int:
        """The stage, 1 to 3, after so many `entries` into the ranking list (section IV-B)."""
        twice = 2 * self.ranks
        return 1 if entries < twice else 2 if entries < twice + self.ants else 3

    def rebuild(
        self, trail: Floats, free: npt.NDArray[np.bool_], stage: int, pool: AntPool, rng: np.random.Generator
    ) -> None:
        """Reset converged pheromone: at random, from the best tenth of the list, from all of it (section IV-B).

        Args:
            trail: the pheromone, changed in place (cells,)
            free: whether each cell is free (cells,)
            stage: which of the three ways
            pool: the ants, for their ranking list
            rng: the source of random numbers, for stage 1
        """
        if stage == 1:
            trail[:] = np.where(free, np.maximum(rng.random(len(trail)), self.min_pheromone), 0.0)
            return
        trail[:] = np.where(free, self.min_pheromone, 0.0)
        ranking, listed = pool.ranking, pool.listed
        for rank in range(math.ceil(listed / 10) if stage == 2 else listed):
            row = ranking.order[rank]
            trail[ranking.walks[row, : ranking.sizes[row]]] += self.deposit * (1 - rank / self.ranks)


@dataclass(eq=False)
class AntPool:
    """The ants of one plan and their ranking list, in the form that compiled code takes."""

    planner: PotentialFieldAnts  # the parameters
    graph: ColonyGraph  # the graph that ants walk on
    limit: int  # the steps after which a walk ends
    ants: Ants  # the ants and their unfinished walks
    ranking: Ranking  # the ranking list
    buffer: npt.NDArray[np.int32]  # where compiled code puts a new best walk (room,)
    arrivals: Floats  # where compiled code puts the lengths of the walks that arrived
    shortest: float = math.inf  # the length of the best walk [cells], inf while there is none
    best: npt.NDArray[np.int32] | None = None  # the cells of the best walk, as flat indices

    @classmethod
    def of(cls, planner: PotentialFieldAnts, graph: ColonyGraph, rng: np.random.Generator) -> AntPool:
        """All ants at the start, and an empty list."""
        from antdrive.planners.colonies import _kernels_pfaco

        cells, count, ranks = len(graph.mask), planner.ants, planner.ranks
        limit = planner.max_steps or (2 * cells if planner.backtrack else min(max(100, cells), 20_000))
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
        """How many walks are in the ranking list."""
        from antdrive.planners.colonies._kernels_pfaco import LISTED

        return int(self.ranking.counts[LISTED])

    @property
    def entries(self) -> int:
        """How many walks were ever entered into the ranking list."""
        from antdrive.planners.colonies._kernels_pfaco import ENTRIES

        return int(self.ranking.counts[ENTRIES])

    def run(self, trail: Floats, heuristic: Floats, alpha: float) -> tuple[Floats, int]:
        """Run one iteration: the lengths of the walks that arrived [cells], and the steps of all ants together."""
        from antdrive.planners.colonies import _kernels_pfaco

        planner, graph = self.planner, self.graph
        rules = _kernels_pfaco.Rules(
            alpha=float(alpha),
            evaporation=float(planner.evaporation),
            min_pheromone=float(planner.min_pheromone),
            deposit=float(planner.deposit),
            limit=self.limit,
            tabu=planner.memory == "tabu",
            backtrack=planner.backtrack,
            shortcut=planner.shortcut,
            quota=planner.ants,
        )
        size, self.shortest, steps, arrived = _kernels_pfaco.run_colony(
            trail,
            heuristic,
            _kernels_pfaco.Graph(graph.mask, graph.offset, graph.start, graph.goal),
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
        """The state after an iteration: the results of `run` and the pheromone, for cells of side `cell` [m]."""
        best: Any = np.empty(0, dtype=np.int32) if self.best is None else self.best
        return Iteration(
            cells=self.graph.cells(best),
            best=cell * self.shortest,
            iteration_best=cell * float(arrivals.min(initial=math.inf)),
            iteration_mean=cell * float(arrivals.mean()) if len(arrivals) else math.inf,
            arrived=len(arrivals),
            work=steps,
            field=trail.reshape(self.graph.shape),
        )
