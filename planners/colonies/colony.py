"""The colony: one loop for every ant planner, which differ in how ants choose and how trails change."""

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

from antdrive.planners.iterative import Iteration, IterativePlanner, require
from antdrive.planners.plan import Capabilities, Query
from antdrive.worlds import Floats

Flat = npt.NDArray[np.int32]  # flat cell indices
Weights = npt.NDArray[np.float32]  # (cells, 8)
Desire = npt.NDArray[np.floating[Any]]  # (cells, 8)


@dataclass(frozen=True, eq=False)
class ColonyGraph:
    """What a colony walks on, as compiled code wants it: cells are flat indices."""

    mask: npt.NDArray[np.uint8]  # (cells,) allowed moves
    offset: npt.NDArray[np.int64]  # (8,) what each move adds to an index
    shape: tuple[int, int]
    start: int
    goal: int

    @classmethod
    def of(cls, query: Query) -> ColonyGraph:
        """The ground of a query."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        cols = query.grid.shape[1]
        return cls(
            mask=query.grid.moves.ravel(),
            offset=_kernels_ants.offsets(cols),
            shape=query.grid.shape,
            start=query.start[0] * cols + query.start[1],
            goal=query.goal[0] * cols + query.goal[1],
        )

    def cells(self, walk: Flat) -> npt.NDArray[np.int32]:
        """(row, col) of each cell of a walk, (N, 2)."""
        return np.stack(np.divmod(walk, self.shape[1]), axis=1).astype(np.int32)

    def over_moves(self, value: Floats) -> Floats:
        """Of a value per cell, that of the cell which each allowed move leads to, (cells, 8); -inf where none is."""
        out = np.full((len(self.mask), 8), -np.inf)
        for k in range(8):
            (here,) = np.nonzero(self.mask >> k & 1)
            out[here, k] = value[here + self.offset[k]]
        return out

    def far(self, cell: int) -> Floats:
        """Straight distance from each cell to one of them [cells], (cells,)."""
        rows, cols = np.indices(self.shape)
        row, col = divmod(cell, self.shape[1])
        return np.asarray(np.hypot(rows - row, cols - col).ravel())


@dataclass(frozen=True, eq=False)
class Walks:
    """Where the ants of one iteration went. Rows of those that did not arrive are meaningless."""

    cells: Flat  # (ants, room)
    sizes: npt.NDArray[np.int64]  # (ants,) cells used of each row, 0 where the ant did not arrive
    lengths: Floats  # (ants,) [cells], inf where the ant did not arrive

    def __len__(self) -> int:
        return len(self.sizes)

    def only(self, ant: int) -> Walks:
        """One ant's walk, copied."""
        size = int(self.sizes[ant])
        return Walks(self.cells[ant : ant + 1, :size].copy(), self.sizes[[ant]], self.lengths[[ant]])

    def shortest(self) -> Walks | None:
        """The shortest walk, alone; None if nobody arrived."""
        tally = self.tally()
        return self.only(tally.first) if tally.arrived else None

    def tally(self) -> Tally:
        """How the ants fared."""
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        return Tally(*_kernels_ants.tally(self.lengths))

    @classmethod
    def room(cls, ants: int, room: int) -> Walks:
        """Empty rows to be filled."""
        return cls(np.empty((ants, room), dtype=np.int32), np.zeros(ants, dtype=np.int64), np.empty(ants))


class Tally(NamedTuple):
    """How the ants of an iteration fared."""

    arrived: int
    mean: float  # length of those that arrived [cells], inf if nobody did
    first: int  # who came the shortest way


class ChoiceContext(NamedTuple):
    """For whom weights are asked."""

    caste: int = 0
    chance: float = 0.5  # a random number of this iteration's own, in [0, 1)


@dataclass(eq=False)
class Memory:
    """What a colony leaves to one that walks the same cells after it. Filled in as it walks."""

    trail: Floats | None = None  # as `Colony.lay`
    tour: Walks | None = None  # the best one, alone


class IterationState(NamedTuple):
    """One iteration of a colony, as its trails see it."""

    number: int  # from 0
    ground: ColonyGraph
    walks: Walks  # as walked
    tours: Walks  # without loops, and cut short where the planner's ants do that
    joint: Walks | None  # the tour made of all of them, alone, where the planner makes one
    best: Walks | None  # the best tour so far, alone
    since: int  # iterations since it was found
    rng: np.random.Generator


#: The only caste of most planners.
FIRST = ChoiceContext()


@dataclass(frozen=True, kw_only=True)
class Colony(IterativePlanner):
    """Ants that walk from the start towards the goal, drawn by trails that the successful ones leave.

    A planner of this family says where trails begin (`lay`), how much each move attracts (`desire`, `weigh`)
    and how the trails change after an iteration (`update`). It may have ants of several kinds (`castes`), make one
    more tour of those of an iteration (`join`), and know when to end (`finished`). Walking, cutting loops out,
    keeping the best and counting happen here.
    """

    ants: int = 50
    max_steps: int | None = None  # an ant that takes more gives up; None: see `default_steps`
    revisit: float = 0.0  # weight of a cell the ant has already been to; 0: it never goes back
    retreat: bool = False  # an ant in a dead end steps back out of it; else it dies there
    shortcut: bool = False  # tours are cut short wherever they pass next to themselves
    threads: int = 1  # ants walk on that many; the plan is the same

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
        return Capabilities(iterative=True, complete=self.retreat or self.revisit > 0)

    def default_steps(self, rows: int, cols: int) -> int:
        """How long an ant may walk without `max_steps`: a step per cell, within 100 to 20 000.

        Ants that retreat get two steps per cell, in and back out, which takes each of them to the goal.
        """
        return 2 * rows * cols if self.retreat else min(max(100, rows * cols), 20_000)

    @property
    def castes(self) -> tuple[int, ...]:
        """How many ants there are of each kind."""
        return (self.ants,)

    @abc.abstractmethod
    def lay(self, ground: ColonyGraph, rng: np.random.Generator) -> Floats:
        """The trails before the first iteration: (cells,) or, on arcs, (cells, 8)."""

    @abc.abstractmethod
    def desire(self, ground: ColonyGraph) -> Desire:
        """What draws ants along each allowed move whatever the trails are, (cells, 8)."""

    @abc.abstractmethod
    def weigh(
        self, ground: ColonyGraph, trail: Floats, desire: Desire, weights: Weights, turn: ChoiceContext = FIRST
    ) -> None:
        """Fill `weights` (cells, 8): how much each allowed move attracts ants of a caste in the coming iteration."""

    @abc.abstractmethod
    def update(self, trail: Floats, season: IterationState) -> None:
        """Change the trails in place after an iteration."""

    def join(self, ground: ColonyGraph, tours: Walks, best: Walks | None) -> Walks | None:
        """One more tour, made of those of the iteration and the best one before."""
        return None

    def finished(self, season: IterationState) -> bool:
        """Whether nothing more is to be gained."""
        return False

    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Walk, rate, update, until nothing more is to be gained."""
        return self.resume(query, rng, Memory())

    def resume(self, query: Query, rng: np.random.Generator, memory: Memory) -> Iterator[Iteration]:
        """Iterate on the trails of an earlier colony, whose best tour, as far as it can still be walked, is known."""
        ground = ColonyGraph.of(query)
        trail = self.lay(ground, rng) if memory.trail is None else memory.trail
        memory.trail, desire = trail, self.desire(ground)
        walk = _Walk.of(self, ground)
        cell, scene = query.grid.cell, np.empty(ground.shape)  # one picture, always of the latest trails
        best: Walks | None = None
        path, found = ground.cells(np.empty(0, dtype=np.int32)), 0
        with ExitStack() as stack:
            pool = stack.enter_context(ThreadPoolExecutor(self.threads)) if self.threads > 1 else None
            for number in itertools.count():
                for caste, weights in enumerate(walk.weights):
                    self.weigh(ground, trail, desire, weights, ChoiceContext(caste, rng.random()))
                walks, steps = walk.go(rng, pool)
                tours = walk.cut(walks)
                joint = self.join(ground, tours, best or memory.tour)
                tally = tours.tally()
                shortest = float(tours.lengths[tally.first])
                if joint is not None and joint.lengths[0] <= shortest:
                    shortest, first = float(joint.lengths[0]), joint
                else:
                    first = None
                if shortest < (float(best.lengths[0]) - 1e-9 if best else math.inf):
                    best = first or tours.only(tally.first)
                    path, found = ground.cells(best.cells[0]), number
                if best is not None:
                    memory.tour = best
                season = IterationState(number, ground, walks, tours, joint, best, number - found, rng)
                self.update(trail, season)
                _draw(trail, scene)
                yield Iteration(
                    cells=path,
                    best=cell * float(best.lengths[0]) if best else math.inf,
                    iteration_best=cell * shortest,
                    iteration_mean=cell * tally.mean,
                    arrived=tally.arrived,
                    work=steps,
                    field=scene,
                )
                if self.finished(season):
                    return


@dataclass(frozen=True, eq=False)
class _Walk:
    """The walking of one plan, with the memory that its iterations share."""

    planner: Colony
    ground: ColonyGraph
    limit: int  # steps
    weights: tuple[Weights, ...]  # per caste
    walks: Walks
    tours: Walks

    @classmethod
    def of(cls, planner: Colony, ground: ColonyGraph) -> _Walk:
        limit = planner.max_steps or planner.default_steps(*ground.shape)
        # Ants that never go back visit every cell once at most.
        room = 1 + (limit if planner.revisit else min(limit, len(ground.mask)))
        weights = tuple(np.zeros((len(ground.mask), 8), dtype=np.float32) for _ in planner.castes)
        ants = sum(planner.castes)
        return cls(planner, ground, limit, weights, Walks.room(ants, room), Walks.room(ants, room))

    def go(self, rng: np.random.Generator, pool: Executor | None = None) -> tuple[Walks, int]:
        """Send every ant; where they went, and the steps they took."""
        # Each ant draws from a stream of its own, so the order in which ants walk cannot matter.
        seeds = rng.bit_generator.random_raw(len(self.walks)).astype(np.uint64) | np.uint64(1)
        jobs, first = [], 0
        for caste, count in enumerate(self.planner.castes):
            each = max(1, -(-count // (self.planner.threads if pool else 1)))
            jobs += [(caste, first + i, first + min(i + each, count)) for i in range(0, count, each)]
            first += count
        steps = sum((pool.map if pool else map)(lambda job: self._send(seeds, *job), jobs))
        return self.walks, steps

    def _send(self, seeds: npt.NDArray[np.uint64], caste: int, first: int, end: int) -> int:
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        return int(
            _kernels_ants.walk_ants(
                self.weights[caste],
                self.ground.mask,
                self.ground.offset,
                self.ground.start,
                self.ground.goal,
                self.limit,
                float(self.planner.revisit),
                self.planner.retreat,
                seeds[first:end],
                self.walks.cells[first:end],
                self.walks.sizes[first:end],
                self.walks.lengths[first:end],
            )
        )

    def cut(self, walks: Walks) -> Walks:
        """The tours of walks: without loops, and cut short if the planner's ants do that."""
        if self.planner.shortcut:
            return cut_short(walks, self.ground, self.tours)
        return without_loops(walks, self.ground, self.tours) if self.planner.revisit else walks


def without_loops(walks: Walks, ground: ColonyGraph, into: Walks | None = None) -> Walks:
    """The same walks with their loops cut out."""
    from antdrive.planners.colonies import _kernels_colony as _kernels_ants

    return _cut(_kernels_ants.cut_loops, walks, ground, into)


def cut_short(walks: Walks, ground: ColonyGraph, into: Walks | None = None) -> Walks:
    """The same walks, each going on from every cell to the last of its cells that is one allowed move away."""
    from antdrive.planners.colonies import _kernels_colony as _kernels_ants

    return _cut(_kernels_ants.cut_short, walks, ground, into)


def _cut(kernel: Callable[..., None], walks: Walks, ground: ColonyGraph, into: Walks | None) -> Walks:
    tours = into or Walks.room(*walks.cells.shape)
    kernel(walks.cells, walks.sizes, ground.mask, ground.offset, tours.cells, tours.sizes, tours.lengths)
    return tours


def _draw(trail: Floats, scene: Floats) -> None:
    """Trails as a picture: of arcs, the strongest that leaves each cell."""
    if trail.ndim == 1:
        scene.ravel()[:] = trail
    else:
        from antdrive.planners.colonies import _kernels_colony as _kernels_ants

        _kernels_ants.strongest(trail, scene.ravel())
