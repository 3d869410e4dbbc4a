"""Ant colony loop; the ant planners define how ants choose moves and how trails change."""

from __future__ import annotations

import abc
import itertools
import math
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import require
from antdrive.planners.iterative import Iteration, IterativePlanner
from antdrive.planners.plan import Capabilities, Query

if TYPE_CHECKING:  # importing a grid loads the compiler
    from antdrive.planners.colonies._kernels_colony import AntGraph
    from antdrive.worlds._kernels_turns import MoveGraph
    from antdrive.worlds.grid import Turns

Flat = npt.NDArray[np.int32]  # flat cell indices
Weights = npt.NDArray[np.float32]  # (nodes, 8)
Heuristic = npt.NDArray[np.floating[Any]]  # (nodes, 8)

#: The length of each move [cells].
STEP = np.sqrt([1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 1.0, 2.0])


@dataclass(frozen=True, eq=False)
class ColonyGraph:
    """The ants' graph for compiled code: its nodes are flat cells, or on a grid with turns the grid's nodes."""

    mask: npt.NDArray[np.uint8]  # the allowed moves of each node, one bit per direction (nodes,)
    to: npt.NDArray[np.integer[Any]]  # flat index offset of each move (8,); with turns the node it leads to (nodes, 8)
    shape: tuple[int, int]  # rows and columns of the grid
    start: int  # the start node
    goal: int  # the goal cell, which is a single node
    turns: Turns  # the labels of turns of the grid

    @classmethod
    def of(cls, query: Query) -> ColonyGraph:
        """Build the graph of a query's grid."""
        from antdrive.planners.colonies import _kernels_colony
        from antdrive.planners.graph import _kernels_incremental
        from antdrive.worlds import _kernels_turns

        grid, goal = query.grid, query.goal_cell
        mask, to = grid.moves.ravel(), _kernels_incremental.offsets(grid.shape[1])
        if grid.turns:  # some moves cannot be taken back, so ants keep to nodes that lead to the goal
            kept = _kernels_turns.leads_to(grid.graph, np.array([goal])) >= 0
            mask, to = np.empty(len(kept), dtype=np.uint8), np.empty((len(kept), 8), dtype=np.int32)
            _kernels_colony.table_of(grid.graph, kept, goal, mask, to)
            mask.setflags(write=False)  # as a grid's
        return cls(mask, to, grid.shape, query.start_node, goal, grid.turns)

    @property
    def arrays(self) -> AntGraph:
        """The graph for compiled ants."""
        from antdrive.planners.colonies._kernels_colony import AntGraph

        return AntGraph(self.mask, self.to, self.turns.cell, self.shape[1], self.start, self.goal)

    @property
    def moves(self) -> MoveGraph:
        """Nodes and their moves, for compiled code that follows them both ways."""
        from antdrive.worlds._kernels_turns import MoveGraph

        return MoveGraph(self.mask, self.turns.cell, self.turns.label, self.shape[1])

    def cell_of(self, node: int) -> tuple[int, int]:
        """Return the (row, col) of a node."""
        return divmod(int(self.turns.cell[node]) if self.turns else node, self.shape[1])

    def cells(self, walk: Flat) -> npt.NDArray[np.int32]:
        """Return the cells of a walk as (row, col), (N, 2)."""
        flat = self.turns.cell[walk] if self.turns else walk
        return np.stack(np.divmod(flat, self.shape[1]), axis=1).astype(np.int32)

    def walk(self, cells: npt.NDArray[np.int32]) -> Flat:
        """Return the nodes (N,) of a walk from the start along cells (N, 2)."""
        from antdrive.planners.colonies import _kernels_colony

        return np.asarray(_kernels_colony.nodes_along(self.to, self.shape[1], self.start, cells))

    def draw(self, trail: Floats, out: Floats) -> Floats:
        """Fill and return `out` (R, C) with the strongest trail of each cell's nodes, for trails on arcs of the outgoing arcs.

        Args:
            trail: trails on nodes (nodes,) or arcs (nodes, 8)
            out: the array to fill (R, C)
        """
        nodes = trail
        if trail.ndim == 2:
            from antdrive.planners.colonies import _kernels_colony

            nodes = np.empty(len(trail)) if self.turns else out.ravel()
            _kernels_colony.strongest(trail, nodes)
        out.ravel()[:] = nodes[: out.size]
        np.maximum.at(out.ravel(), self.turns.cell, nodes[: len(self.turns.cell)])
        return out

    def of_nodes(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return the value of each node's cell (nodes,), from those of the cells (R, C)."""
        return values.ravel()[self.turns.cell] if self.turns else values.ravel()

    @property
    def allowed(self) -> npt.NDArray[np.bool_]:
        """Whether each move is allowed (nodes, 8)."""
        return self.mask[:, np.newaxis] >> np.arange(8) & 1 > 0

    def nearness(self) -> Floats:
        """Return 1 / distance from the target of each move to the goal (nodes, 8) [1/cells]; -inf where it is not allowed."""
        # The goal's distance is 0; the bound makes every ant beside the goal step onto it.
        return self.at_neighbours(1.0 / np.maximum(self.distance_to(self.goal), 0.01))

    def at_neighbours(self, values: Floats) -> Floats:
        """Return `values` (nodes,) at the target of each move, (nodes, 8); -inf where the move is not allowed."""
        out = np.full((len(self.mask), 8), -np.inf)
        for k in range(8):
            (here,) = np.nonzero(self.mask >> k & 1)
            out[here, k] = values[self.to[here, k] if self.turns else here + self.to[k]]
        return out

    def distance_to(self, node: int) -> Floats:
        """Return the straight-line distance from every node to one [cells], (nodes,)."""
        rows, cols = np.indices(self.shape)
        row, col = self.cell_of(node)
        return self.of_nodes(np.asarray(np.hypot(rows - row, cols - col)))


@dataclass(frozen=True, eq=False)
class Walks:
    """The walks of one iteration's ants, one row each. Rows of ants that did not arrive are undefined."""

    cells: Flat  # the cells of each walk in order, as flat indices (ants, room)
    sizes: npt.NDArray[np.int64]  # number of cells of each walk (ants,), 0 if the ant did not arrive
    lengths: Floats  # length of each walk [cells] (ants,), inf if the ant did not arrive

    def __len__(self) -> int:
        return len(self.sizes)

    def rows(self, ants: slice) -> Walks:
        """Return a view of some ants' walks."""
        return Walks(self.cells[ants], self.sizes[ants], self.lengths[ants])

    def only(self, ant: int) -> Walks:
        """Return a copy of one ant's walk."""
        size = int(self.sizes[ant])
        return Walks(self.cells[ant : ant + 1, :size].copy(), self.sizes[[ant]], self.lengths[[ant]])

    def shortest(self) -> Walks | None:
        """Return a copy of the shortest walk; None if no ant arrived."""
        summary = self.summary()
        return self.only(summary.shortest) if summary.arrived else None

    def summary(self) -> WalkSummary:
        """Count the ants that arrived and measure their walks."""
        lengths = self.lengths[np.isfinite(self.lengths)]
        mean = float(lengths.cumsum()[-1]) / len(lengths) if len(lengths) else math.inf
        return WalkSummary(len(lengths), mean, int(self.lengths.argmin()))

    @classmethod
    def allocate(cls, ants: int, room: int) -> Walks:
        """Allocate one row per ant for up to `room` cells each."""
        return cls(np.empty((ants, room), dtype=np.int32), np.zeros(ants, dtype=np.int64), np.empty(ants))


class WalkSummary(NamedTuple):
    """Statistics of an iteration's ants."""

    arrived: int  # number of ants that reached the goal
    mean: float  # mean length of their walks [cells], inf if no ant arrived
    shortest: int  # row of the shortest walk


class ChoiceContext(NamedTuple):
    """Inputs of choice weights besides trails and heuristic."""

    kind: int = 0  # the kind of ant, an index of `Colony.kinds`
    uniform: float = 0.5  # a random number in [0, 1), drawn once per iteration and kind


@dataclass(eq=False)
class Memory:
    """State that a colony passes to a later colony on the same cells; the colony updates it in place."""

    trail: Floats | None = None  # the trails, as `Colony.initial_trail` returns them
    tour: Walks | None = None  # the best tour, a single row


class IterationState(NamedTuple):
    """The state of an iteration, for the rules that change trails.

    With `Colony.update_every`, walks and tours are those of the ants since the last update.
    """

    number: int  # the iteration's number, from 0
    graph: ColonyGraph  # the ants' graph
    walks: Walks  # the ants' walks, including loops
    tours: Walks  # the walks without loops and, with `Colony.shortcut`, cut short
    daemon_tour: Walks | None  # the tour of `Colony.daemon_action`, a single row
    best: Walks | None  # the best tour so far, a single row
    since: int  # iterations since the best tour was found
    rng: np.random.Generator  # the colony's source of random numbers
    first: int = 0  # the number of the first of these ants in its iteration, from 0


#: All ants of an iteration.
EVERY = slice(0, None)
#: The context of colonies with one kind of ant.
FIRST_KIND = ChoiceContext()


@dataclass(frozen=True, kw_only=True)
class Colony(IterativePlanner):
    """Ants that walk from start to goal, guided by the pheromone trails of earlier ants that arrived.

    This class runs the iterations: it sends the ants, cuts loops out of their walks, keeps the best tour and
    counts the work. A subclass adds its rules, named as in ACOTSP (Stützle) and in Dorigo & Stützle,
    *Ant Colony Optimization*, 2004:

    - `initial_trail`: tau before the first iteration
    - `heuristic_values`: eta, the attraction of each move regardless of the trails
    - `choice_weights`: combines trails and heuristic into the weight of each move
    - `update`: evaporates trails and deposits
    - `kinds`, `daemon_action` and `finished`, for several kinds of ants, a central improvement step per
      iteration, or an early stop

    Attributes:
        ants: ants per iteration
        max_steps: step limit of an ant; None: see `default_steps`
        revisit: the weight of a visited cell; at 0 ants never visit a cell twice
        backtrack: whether an ant in a dead end steps back until it finds another path; otherwise it dies there
        shortcut: whether tours are cut short where they pass next to an earlier part of themselves
        threads: number of threads; the plan does not depend on it
        update_every: ants that walk between two updates of the trails; None: all ants of an iteration. If none of
            them arrives, there is no update
        restart_every: iterations after which the trails return to their initial values; None: never
    """

    ants: int = 50
    max_steps: int | None = None
    revisit: float = 0.0
    backtrack: bool = False
    shortcut: bool = False
    threads: int = 1
    update_every: int | None = None
    restart_every: int | None = None

    work_unit: ClassVar[str] = "ant steps"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("ants", self.ants, at_least=1, at_most=1_000_000)
        require("threads", self.threads, at_least=1, at_most=256)
        for name in ("max_steps", "update_every", "restart_every"):
            if getattr(self, name) is not None:
                require(name, getattr(self, name), at_least=1)

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities and requirements of this planner. Ants that die in dead ends may miss an existing path."""
        return Capabilities(iterative=True, complete=self.backtrack or self.revisit > 0, turns=True)

    def default_steps(self, nodes: int) -> int:
        """Return the step limit of an ant on a graph of some nodes if `max_steps` is None.

        One step per node, but at least 100 and at most 20 000. Ants that backtrack get two steps per node,
        one in and one out, which suffices for every ant to reach the goal.
        """
        return 2 * nodes if self.backtrack else min(max(100, nodes), 20_000)

    @property
    def kinds(self) -> tuple[int, ...]:
        """The number of ants of each kind."""
        return (self.ants,)

    @abc.abstractmethod
    def initial_trail(self, graph: ColonyGraph, rng: np.random.Generator) -> Floats:
        """Return the trails on `graph` before the first iteration: on cells (nodes,) or on arcs (nodes, 8)."""

    @abc.abstractmethod
    def heuristic_values(self, graph: ColonyGraph) -> Heuristic:
        """Return eta of each move of `graph` (nodes, 8) for `choice_weights`; it does not depend on the trails."""

    @abc.abstractmethod
    def choice_weights(
        self,
        graph: ColonyGraph,
        trail: Floats,
        heuristic: Heuristic,
        weights: Weights,
        context: ChoiceContext = FIRST_KIND,
    ) -> None:
        """Fill in the attraction of each move for one kind of ant in the coming iteration.

        Args:
            graph: the ants' graph
            trail: the current trails, on cells (nodes,) or on arcs (nodes, 8)
            heuristic: the result of `heuristic_values`
            weights: the table to fill (nodes, 8); 0 for moves that are not allowed
            context: the kind of ant, and a random number for rules that draw one per iteration
        """

    @abc.abstractmethod
    def update(self, trail: Floats, state: IterationState) -> None:
        """Evaporate and deposit on `trail` in place after an iteration.

        Args:
            trail: the trails, on cells (nodes,) or on arcs (nodes, 8)
            state: the iteration, with its tours
        """

    def daemon_action(self, graph: ColonyGraph, tours: Walks, best: Walks | None) -> Walks | None:
        """Build one more tour centrally after the ants have walked; None if there is none.

        Args:
            graph: the ants' graph
            tours: the tours of this iteration
            best: the best tour before this iteration; in the first, that of the memory, if any
        """
        return None

    def finished(self, state: IterationState) -> bool:
        """Return whether the colony can stop after the iteration of `state`."""
        return False

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Construct tours and update the trails, iteration by iteration, until `finished`."""
        return self.resume(query, rng, Memory())

    def resume(self, query: Query, rng: np.random.Generator, memory: Memory) -> Iterator[Iteration]:
        """Iterate from the trails and the best tour in `memory`, and update both in place.

        After a change of the grid, only the allowed arcs of the remembered tour are used.
        """
        graph = ColonyGraph.of(query)
        if memory.trail is None:
            memory.trail = self.initial_trail(graph, rng)
        trail, heuristic = memory.trail, self.heuristic_values(graph)
        construction = TourConstruction.of(self, graph)
        cell = query.grid.cell
        picture = np.empty(graph.shape)  # shared by all iterations: always shows the latest trails
        best: Walks | None = None
        best_cells, best_number = graph.cells(np.empty(0, dtype=np.int32)), 0
        with ExitStack() as stack:
            pool = stack.enter_context(ThreadPoolExecutor(self.threads)) if self.threads > 1 else None
            for number in itertools.count():
                if self.restart_every and number and number % self.restart_every == 0:
                    trail[:] = self.initial_trail(graph, rng)
                steps, iteration_best = 0, math.inf
                for ants in construction.batches:
                    for kind, weights in enumerate(construction.weights):
                        self.choice_weights(graph, trail, heuristic, weights, ChoiceContext(kind, rng.random()))
                    walks, taken = construction.construct(rng, pool, ants)
                    tours = construction.shorten(ants)
                    daemon_tour = self.daemon_action(graph, tours, memory.tour if best is None else best)
                    summary = tours.summary()
                    leader, row = tours, summary.shortest
                    if daemon_tour is not None and daemon_tour.lengths[0] <= tours.lengths[row]:
                        leader, row = daemon_tour, 0
                    steps, iteration_best = steps + taken, min(iteration_best, float(leader.lengths[row]))
                    if leader.lengths[row] < (math.inf if best is None else float(best.lengths[0]) - 1e-9):
                        memory.tour = best = leader.only(row)
                        best_cells, best_number = graph.cells(best.cells[0]), number
                    since = number - best_number
                    state = IterationState(number, graph, walks, tours, daemon_tour, best, since, rng, ants.start)
                    if self.update_every is None or summary.arrived:
                        self.update(trail, state)
                summary = construction.shortened.summary()
                graph.draw(trail, picture)
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
    """Tour construction for one plan; its arrays are reused in every iteration."""

    planner: Colony  # the colony, for its numbers of ants and walking rules
    graph: ColonyGraph  # the ants' graph
    limit: int  # step limit of an ant
    weights: tuple[Weights, ...]  # choice weights of each kind of ant, to fill before `construct`
    walks: Walks  # output of `construct`
    tours: Walks  # output of `shorten`

    @classmethod
    def of(cls, planner: Colony, graph: ColonyGraph) -> TourConstruction:
        """Allocate the arrays of a colony on a graph."""
        limit = planner.max_steps or planner.default_steps(len(graph.mask))
        # Without revisits, an ant visits each cell at most once.
        room = 1 + (limit if planner.revisit else min(limit, len(graph.mask)))
        weights = tuple(np.zeros((len(graph.mask), 8), dtype=np.float32) for _ in planner.kinds)
        ants = sum(planner.kinds)
        return cls(planner, graph, limit, weights, Walks.allocate(ants, room), Walks.allocate(ants, room))

    @property
    def batches(self) -> list[slice]:
        """The ants between two updates of the trails, as slices of all ants of an iteration."""
        count = len(self.walks)
        size = self.planner.update_every or count
        return [slice(first, min(first + size, count)) for first in range(0, count, size)]

    @property
    def shortened(self) -> Walks:
        """The tours of all ants of an iteration, once `shorten` has been called for each batch."""
        return self.tours if self.planner.shortcut or self.planner.revisit else self.walks

    def construct(
        self, rng: np.random.Generator, pool: Executor | None = None, ants: slice = EVERY
    ) -> tuple[Walks, int]:
        """Send some ants, on the threads of `pool` if given; returns their walks and the total number of steps."""
        # Each ant has its own random stream, so the order of ants is irrelevant.
        first, end, _ = ants.indices(len(self.walks))
        seeds = rng.bit_generator.random_raw(end - first).astype(np.uint64) | np.uint64(1)
        jobs, earlier = [], 0
        for kind, count in enumerate(self.planner.kinds):
            start, stop = max(first, earlier), min(end, earlier + count)
            each = max(1, -(-count // (self.planner.threads if pool else 1)))
            parts = [slice(i, min(i + each, stop)) for i in range(start, stop, each)]
            jobs += [(seeds[part.start - first : part.stop - first], kind, part) for part in parts]
            earlier += count
        steps = sum((pool.map if pool else map)(lambda job: self._send(*job), jobs))
        return self.walks.rows(ants), steps

    def _send(self, seeds: npt.NDArray[np.uint64], kind: int, ants: slice) -> int:
        from antdrive.planners.colonies import _kernels_colony

        walks, planner = self.walks.rows(ants), self.planner
        rules = self.limit, float(planner.revisit), planner.backtrack
        out = walks.cells, walks.sizes, walks.lengths
        return int(_kernels_colony.walk_ants(self.weights[kind], self.graph.arrays, *rules, seeds, *out))

    def shorten(self, ants: slice) -> Walks:
        """Return the tours of some ants: without loops and, with `Colony.shortcut`, cut short."""
        walks, planner = self.walks.rows(ants), self.planner
        if planner.shortcut or planner.revisit:
            return cut(walks, self.graph, self.tours.rows(ants), short=planner.shortcut)
        return walks


def cut(walks: Walks, graph: ColonyGraph, tours: Walks | None = None, *, short: bool) -> Walks:
    """Return the walks without loops, in `tours` if given.

    Cut `short` they lead from each cell straight to the walk's last cell that is one allowed move away.
    """
    from antdrive.planners.colonies import _kernels_colony

    tours = tours or Walks.allocate(*walks.cells.shape)
    out = tours.cells, tours.sizes, tours.lengths
    _kernels_colony.cut(walks.cells, walks.sizes, graph.arrays, short, *out)
    return tours
