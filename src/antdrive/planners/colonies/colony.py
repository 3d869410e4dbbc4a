"""The loop of an ant colony; the ant planners differ in how ants choose moves and how trails change."""

from __future__ import annotations

import abc
import itertools
import math
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import require
from antdrive.planners.iterative import Iteration, IterativePlanner
from antdrive.planners.plan import Capabilities, Query

Flat = npt.NDArray[np.int32]  # flat cell indices
Weights = npt.NDArray[np.float32]  # (cells, 8)
Heuristic = npt.NDArray[np.floating[Any]]  # (cells, 8)


@dataclass(frozen=True, eq=False)
class ColonyGraph:
    """The graph that ants walk on, in the form that compiled code takes: cells are flat indices."""

    mask: npt.NDArray[np.uint8]  # the allowed moves of each cell, one bit per direction (cells,)
    offset: npt.NDArray[np.int64]  # what each of the eight moves adds to a flat index (8,)
    shape: tuple[int, int]  # rows and columns of the grid
    start: int  # the start cell
    goal: int  # the goal cell

    @classmethod
    def of(cls, query: Query) -> ColonyGraph:
        """The graph of a query's grid."""
        from antdrive.planners.colonies import _kernels_colony

        cols = query.grid.shape[1]
        return cls(
            mask=query.grid.moves.ravel(),
            offset=_kernels_colony.offsets(cols),
            shape=query.grid.shape,
            start=query.start[0] * cols + query.start[1],
            goal=query.goal[0] * cols + query.goal[1],
        )

    def cells(self, walk: Flat) -> npt.NDArray[np.int32]:
        """The cells of a walk as (row, col), (N, 2)."""
        return np.stack(np.divmod(walk, self.shape[1]), axis=1).astype(np.int32)

    def at_neighbours(self, values: Floats) -> Floats:
        """`values` (cells,) at the cell that each move leads to, (cells, 8); -inf where the move is not allowed."""
        out = np.full((len(self.mask), 8), -np.inf)
        for k in range(8):
            (here,) = np.nonzero(self.mask >> k & 1)
            out[here, k] = values[here + self.offset[k]]
        return out

    def distance_to(self, cell: int) -> Floats:
        """The straight-line distance from every cell to one cell [cells], (cells,)."""
        rows, cols = np.indices(self.shape)
        row, col = divmod(cell, self.shape[1])
        return np.asarray(np.hypot(rows - row, cols - col).ravel())


@dataclass(frozen=True, eq=False)
class Walks:
    """The walks of one iteration's ants, a row each. A row of an ant that did not arrive has no meaning."""

    cells: Flat  # the cells of each walk in order, as flat indices (ants, room)
    sizes: npt.NDArray[np.int64]  # how many cells of each row are used (ants,), 0 where the ant did not arrive
    lengths: Floats  # the length of each walk [cells] (ants,), inf where the ant did not arrive

    def __len__(self) -> int:
        return len(self.sizes)

    def only(self, ant: int) -> Walks:
        """A copy of the walk of one ant."""
        size = int(self.sizes[ant])
        return Walks(self.cells[ant : ant + 1, :size].copy(), self.sizes[[ant]], self.lengths[[ant]])

    def shortest(self) -> Walks | None:
        """A copy of the shortest walk; None if no ant arrived."""
        summary = self.summary()
        return self.only(summary.shortest) if summary.arrived else None

    def summary(self) -> WalkSummary:
        """How many ants arrived, and how long their walks are."""
        from antdrive.planners.colonies import _kernels_colony

        return WalkSummary(*_kernels_colony.summarise(self.lengths))

    @classmethod
    def allocate(cls, ants: int, room: int) -> Walks:
        """Rows to be filled, one per ant, each for up to `room` cells."""
        return cls(np.empty((ants, room), dtype=np.int32), np.zeros(ants, dtype=np.int64), np.empty(ants))


class WalkSummary(NamedTuple):
    """How the ants of an iteration fared."""

    arrived: int  # how many ants reached the goal
    mean: float  # the mean length of their walks [cells], inf if no ant arrived
    shortest: int  # the row of the shortest walk


class ChoiceContext(NamedTuple):
    """What choice weights depend on besides trails and heuristic."""

    kind: int = 0  # the kind of ant that the weights are for, an index of `Colony.kinds`
    uniform: float = 0.5  # a random number in [0, 1), drawn once per iteration and kind


@dataclass(eq=False)
class Memory:
    """What a colony hands on to a later colony on the same cells; the colony keeps it up to date."""

    trail: Floats | None = None  # the trails, as `Colony.initial_trail` returns them
    tour: Walks | None = None  # the best tour, a single row


class IterationState(NamedTuple):
    """One iteration of a colony, as the rules that change trails see it."""

    number: int  # the iteration's number, from 0
    graph: ColonyGraph  # the graph that ants walk on
    walks: Walks  # the ants' walks, loops included
    tours: Walks  # the same walks without loops and, with `Colony.shortcut`, cut short
    daemon_tour: Walks | None  # the tour that `Colony.daemon_action` made, a single row
    best: Walks | None  # the best tour so far, a single row
    since: int  # number of iterations since the best tour was found
    rng: np.random.Generator  # the colony's source of random numbers


#: The context of colonies that have one kind of ant.
FIRST_KIND = ChoiceContext()


@dataclass(frozen=True, kw_only=True)
class Colony(IterativePlanner):
    """Ants that walk from the start to the goal, guided by the pheromone trails of ants that arrived before.

    This class runs the iterations: ants walk, loops are cut out of their walks, the best tour is kept, work is
    counted. A planner of the family adds its rules, named as in ACOTSP (Stützle) and in Dorigo & Stützle,
    *Ant Colony Optimization*, 2004:

    - `initial_trail`: tau before the first iteration
    - `heuristic_values`: eta, how much each move attracts ants regardless of the trails
    - `choice_weights`: how trails and heuristic combine into the attraction of each move
    - `update`: how trails evaporate and which ants deposit
    - `kinds`, `daemon_action` and `finished`, where a planner has several kinds of ants, improves on the
      tours of an iteration in one central step, or can stop early

    Attributes:
        ants: ants per iteration
        max_steps: an ant gives up after this many steps; None: see `default_steps`
        revisit: the weight of a cell that the ant has already visited; at 0 ants never visit a cell twice
        backtrack: whether an ant in a dead end steps back until it finds another way; otherwise it dies there
        shortcut: whether tours are cut short where they pass next to an earlier part of themselves
        threads: how many threads the ants walk on; the plan does not depend on it
    """

    ants: int = 50
    max_steps: int | None = None
    revisit: float = 0.0
    backtrack: bool = False
    shortcut: bool = False
    threads: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        require("ants", self.ants, at_least=1, at_most=1_000_000)
        require("threads", self.threads, at_least=1, at_most=256)
        if self.max_steps is not None:
            require("max_steps", self.max_steps, at_least=1)

    @property
    def work_unit(self) -> str:
        """What `work` counts."""
        return "ant steps"

    @property
    def capabilities(self) -> Capabilities:
        """What this planner can do and what it needs. Ants that die in dead ends may miss a path that exists."""
        return Capabilities(iterative=True, complete=self.backtrack or self.revisit > 0)

    def default_steps(self, rows: int, cols: int) -> int:
        """How many steps an ant may take on a grid of `rows` x `cols` where `max_steps` is None.

        One step per cell, but at least 100 and at most 20 000. Ants that backtrack get two steps per cell,
        one in and one out, which suffices for every ant to reach the goal.
        """
        return 2 * rows * cols if self.backtrack else min(max(100, rows * cols), 20_000)

    @property
    def kinds(self) -> tuple[int, ...]:
        """The number of ants of each kind."""
        return (self.ants,)

    @abc.abstractmethod
    def initial_trail(self, graph: ColonyGraph, rng: np.random.Generator) -> Floats:
        """The trails on `graph` before the first iteration: on cells (cells,) or on arcs (cells, 8)."""

    @abc.abstractmethod
    def heuristic_values(self, graph: ColonyGraph) -> Heuristic:
        """Eta of each move of `graph` (cells, 8), which does not depend on the trails; `choice_weights` receives it."""

    @abc.abstractmethod
    def choice_weights(
        self,
        graph: ColonyGraph,
        trail: Floats,
        heuristic: Heuristic,
        weights: Weights,
        context: ChoiceContext = FIRST_KIND,
    ) -> None:
        """Fill in how much each move attracts one kind of ant in the coming iteration.

        Args:
            graph: the graph that ants walk on
            trail: the trails as they are now, on cells (cells,) or on arcs (cells, 8)
            heuristic: the result of `heuristic_values`
            weights: the table to fill (cells, 8); 0 for moves that are not allowed
            context: the kind of ant, and a random number for rules that draw one per iteration
        """

    @abc.abstractmethod
    def update(self, trail: Floats, state: IterationState) -> None:
        """Evaporate and deposit: change `trail` in place after the iteration that `state` describes.

        Args:
            trail: the trails, on cells (cells,) or on arcs (cells, 8)
            state: the iteration, with its tours
        """

    def daemon_action(self, graph: ColonyGraph, tours: Walks, best: Walks | None) -> Walks | None:
        """One more tour, made centrally after the ants have walked; None if there is none.

        Args:
            graph: the graph that ants walk on
            tours: the tours of this iteration
            best: the best tour before this iteration; in the first, that of the memory, if any
        """
        return None

    def finished(self, state: IterationState) -> bool:
        """Whether the colony can stop after the iteration that `state` describes."""
        return False

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Construct tours and update the trails, iteration by iteration, until `finished`."""
        return self.resume(query, rng, Memory())

    def resume(self, query: Query, rng: np.random.Generator, memory: Memory) -> Iterator[Iteration]:
        """Iterate with the trails and the best tour in `memory`, and keep both up to date there.

        If the grid has changed since the memory was filled, only those arcs of the remembered tour are used that are
        still allowed.
        """
        graph = ColonyGraph.of(query)
        if memory.trail is None:
            memory.trail = self.initial_trail(graph, rng)
        trail, heuristic = memory.trail, self.heuristic_values(graph)
        construction = TourConstruction.of(self, graph)
        cell = query.grid.cell
        picture = np.empty(graph.shape)  # one array for all iterations: it always shows the latest trails
        best: Walks | None = None
        best_cells, best_number = graph.cells(np.empty(0, dtype=np.int32)), 0
        with ExitStack() as stack:
            pool = stack.enter_context(ThreadPoolExecutor(self.threads)) if self.threads > 1 else None
            for number in itertools.count():
                for kind, weights in enumerate(construction.weights):
                    self.choice_weights(graph, trail, heuristic, weights, ChoiceContext(kind, rng.random()))
                walks, steps = construction.construct(rng, pool)
                tours = construction.shorten(walks)
                daemon_tour = self.daemon_action(graph, tours, memory.tour if best is None else best)
                summary = tours.summary()
                leader, row = tours, summary.shortest
                if daemon_tour is not None and daemon_tour.lengths[0] <= tours.lengths[row]:
                    leader, row = daemon_tour, 0
                iteration_best = float(leader.lengths[row])
                if iteration_best < (math.inf if best is None else float(best.lengths[0]) - 1e-9):
                    memory.tour = best = leader.only(row)
                    best_cells, best_number = graph.cells(best.cells[0]), number
                state = IterationState(number, graph, walks, tours, daemon_tour, best, number - best_number, rng)
                self.update(trail, state)
                _draw_field(trail, picture)
                yield Iteration(
                    cells=best_cells,
                    best=math.inf if best is None else cell * float(best.lengths[0]),
                    iteration_best=cell * iteration_best,
                    iteration_mean=cell * summary.mean,
                    arrived=summary.arrived,
                    work=steps,
                    field=picture,
                )
                if self.finished(state):
                    return


@dataclass(frozen=True, eq=False)
class TourConstruction:
    """Sends the ants of one plan; the arrays are allocated once and reused in every iteration."""

    planner: Colony  # the colony, for its numbers of ants and rules of walking
    graph: ColonyGraph  # the graph that ants walk on
    limit: int  # the steps after which an ant gives up
    weights: tuple[Weights, ...]  # the choice weights of each kind of ant, to be filled before `construct`
    walks: Walks  # where `construct` puts the walks
    tours: Walks  # where `shorten` puts the tours

    @classmethod
    def of(cls, planner: Colony, graph: ColonyGraph) -> TourConstruction:
        """The arrays that a colony needs on a graph."""
        limit = planner.max_steps or planner.default_steps(*graph.shape)
        # Ants that never revisit a cell visit each cell once at most.
        room = 1 + (limit if planner.revisit else min(limit, len(graph.mask)))
        weights = tuple(np.zeros((len(graph.mask), 8), dtype=np.float32) for _ in planner.kinds)
        ants = sum(planner.kinds)
        return cls(planner, graph, limit, weights, Walks.allocate(ants, room), Walks.allocate(ants, room))

    def construct(self, rng: np.random.Generator, pool: Executor | None = None) -> tuple[Walks, int]:
        """Send every ant, on the threads of `pool` if there is one: their walks, and the steps of all together."""
        # Each ant has a random stream of its own, so the order in which ants walk does not matter.
        seeds = rng.bit_generator.random_raw(len(self.walks)).astype(np.uint64) | np.uint64(1)
        jobs, first = [], 0
        for kind, count in enumerate(self.planner.kinds):
            each = max(1, -(-count // (self.planner.threads if pool else 1)))
            jobs += [(kind, first + i, first + min(i + each, count)) for i in range(0, count, each)]
            first += count
        steps = sum((pool.map if pool else map)(lambda job: self._send(seeds, *job), jobs))
        return self.walks, steps

    def _send(self, seeds: npt.NDArray[np.uint64], kind: int, first: int, end: int) -> int:
        from antdrive.planners.colonies import _kernels_colony

        return int(
            _kernels_colony.walk_ants(
                self.weights[kind],
                self.graph.mask,
                self.graph.offset,
                self.graph.start,
                self.graph.goal,
                self.limit,
                float(self.planner.revisit),
                self.planner.backtrack,
                seeds[first:end],
                self.walks.cells[first:end],
                self.walks.sizes[first:end],
                self.walks.lengths[first:end],
            )
        )

    def shorten(self, walks: Walks) -> Walks:
        """The tours of these walks: without loops and, if the planner says so, cut short."""
        if self.planner.shortcut:
            return cut_short(walks, self.graph, self.tours)
        return without_loops(walks, self.graph, self.tours) if self.planner.revisit else walks


def without_loops(walks: Walks, graph: ColonyGraph, out: Walks | None = None) -> Walks:
    """The same walks with their loops cut out."""
    from antdrive.planners.colonies import _kernels_colony

    return _cut(_kernels_colony.cut_loops, walks, graph, out)


def cut_short(walks: Walks, graph: ColonyGraph, out: Walks | None = None) -> Walks:
    """The same walks, each going straight from every cell to the last of its cells that is one allowed move away."""
    from antdrive.planners.colonies import _kernels_colony

    return _cut(_kernels_colony.cut_short, walks, graph, out)


def _cut(kernel: Callable[..., None], walks: Walks, graph: ColonyGraph, out: Walks | None) -> Walks:
    tours = Walks.allocate(*walks.cells.shape) if out is None else out
    kernel(walks.cells, walks.sizes, graph.mask, graph.offset, tours.cells, tours.sizes, tours.lengths)
    return tours


def _draw_field(trail: Floats, out: Floats) -> None:
    """Fill `out` (R, C) with the trail of each cell; for trails on arcs, the strongest arc that leaves the cell."""
    if trail.ndim == 1:
        out.ravel()[:] = trail
    else:
        from antdrive.planners.colonies import _kernels_colony

        _kernels_colony.strongest(trail, out.ravel())
