"""Runs of the papers' experiments: one planner on one map with one seed, planned at once or decided cell by cell.

As in hasan, obstacles of one cell may move to a random free neighbouring cell at every decision.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import FieldError
from antdrive.base.records import require_choices
from antdrive.planners import (
    Cell,
    OnlineAgent,
    Planner,
    PlannerError,
    PlanResult,
    PlanStatus,
    Query,
    agent_for,
    load_planner,
)
from antdrive.planners.iterative import Iteration, as_iterative
from antdrive.planners.plan import Capabilities, GridPlanner, path_cost
from antdrive.runs.papers import maps
from antdrive.worlds import DIRECTIONS, Grid


@dataclass(frozen=True, kw_only=True)
class FirstTouchDStar(GridPlanner):
    """D* by the listing of hasan's ants (l. 95-158): a cell gets its cost when it is new, and keeps it.

    The paper describes no D*. Its listing sorts the open list (`SortQueue`, l. 115) without the key. With the cost as key
    few paths are longer than the shortest. With the distance to the start, which no text names, paths around concave
    obstacles are. The search stops when it touches the start; the listing (l. 117) when it expands it.

    Attributes:
        order: the key of the open list: the distance to the start, or the cost
    """

    order: Literal["distance", "cost"] = "distance"

    capabilities: ClassVar[Capabilities] = Capabilities(deterministic=True)

    def __post_init__(self) -> None:
        require_choices(self)

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Spread from the goal until the start is touched."""
        from antdrive.planners.colonies import _kernels_mmas_dstar as kernels

        moves, cols = query.grid.moves.ravel(), query.grid.shape[1]
        onward = np.empty(len(moves), dtype=np.int64)
        flat, goal = query.start[0] * cols + query.start[1], query.goal[0] * cols + query.goal[1]
        work = int(kernels.touch(moves, cols, flat, goal, self.order == "distance", onward))
        if onward[flat] < 0:
            return PlanResult(status=PlanStatus.NO_PATH, reason="no path", work=work, work_unit="cells")
        walk = [flat]
        while walk[-1] != goal:
            walk.append(int(onward[walk[-1]]))
        path = np.column_stack(np.divmod(np.array(walk, dtype=np.int32), cols)).astype(np.int32)
        cost = path_cost(path, query.grid.cell)
        return PlanResult(status=PlanStatus.SOLVED, cells=path, cost=cost, work=work, work_unit="cells")


def total_cost(query: Query, result: PlanResult) -> float:
    """Return hasan's total path cost: the sum over all cells of the path of the remaining cost; inf without a path.

    A straight move costs 1 and a diagonal one 1.4, as in the paper; the remaining cost is along the path.
    """
    if not result.solved:
        return math.inf
    diagonal = np.abs(np.diff(result.cells, axis=0)).sum(axis=1) == 2
    steps = np.where(diagonal, 1.4, 1.0)
    return float(np.cumsum(steps[::-1]).sum())


ENDLESS = 1_000_000  # iterations; the limit of ant steps ends a plan much earlier
CLOSE = 0.25  # relative excess length of a path close to the shortest
EXACT = 1e-6  # excess length of a shortest path [%]
NEAR = 0.05  # relative excess length of a path near the shortest
LAST = 10  # iterations over which `unrest` is measured


@dataclass(frozen=True)
class PaperRun:
    """The result of one plan of an experiment. Lengths are in cells."""

    seed: int  # of map and planner
    world: int  # index of the map in the experiment
    result: PlanResult
    optimum: float  # length of the shortest path with the same moves
    cpu_s: float  # processor time of the plan [s]
    total: float  # hasan's total cost of the path; inf without a path
    concentration: float = math.nan  # fraction of the planner's field on the path; nan without a field
    ants: float = math.nan  # ants per iteration; nan for other planners
    even: float = math.nan  # length of the best path at the limit of work, see `limits`; nan without a limit
    close: float = math.nan  # work until the path was within `CLOSE` of the shortest, inf if never; nan without a limit

    @property
    def length(self) -> float:
        """The length of the path; inf without a path."""
        return self.result.line_length if self.result.solved else math.inf

    @property
    def gap(self) -> float:
        """The relative excess of the path over the shortest [%]; inf without a path."""
        return 100.0 * (self.length / self.optimum - 1.0)

    @property
    def even_gap(self) -> float:
        """The gap at exactly the limit of work [%]; a first path counts in full, although its iteration may exceed it."""
        return 100.0 * (self.even / self.optimum - 1.0)

    @property
    def steps(self) -> float:
        """The number of moves of the path; inf without a path."""
        return float(len(self.result.cells) - 1) if self.result.solved else math.inf

    @property
    def missing(self) -> float:
        """1 without a path, 0 with one."""
        return float(not self.result.solved)

    @property
    def last(self) -> float:
        """The best path of the last iteration; inf if no ant arrived in it."""
        known = self.result.history.iteration_best
        return float(known[-1]) if len(known) else math.inf

    @property
    def settled(self) -> float:
        """The iteration, from 1, that found the path; inf without a path."""
        best = self.result.history.best
        return float(np.argmax(best <= best[-1] * (1 + 1e-9)) + 1) if self.result.solved and len(best) else math.inf

    @property
    def reached(self) -> float:
        """The iteration, from 1, that found a shortest path; inf if none did."""
        return self.settled if self.gap < EXACT else math.inf

    @property
    def near(self) -> float:
        """The iteration, from 1, when the path came within `NEAR` of the shortest; inf if never."""
        near = np.flatnonzero(self.result.history.best <= (1 + NEAR) * self.optimum + 1e-9)
        return float(near[0] + 1) if len(near) else math.inf

    @property
    def effort(self) -> float:
        """The work until the path was within `CLOSE` of the shortest; inf if never.

        Without a limit of work every iteration counts as an equal fraction.
        """
        if not math.isnan(self.close):
            return self.close
        near = np.flatnonzero(self.result.history.best <= (1 + CLOSE) * self.optimum + 1e-9)
        return self.result.work * (near[0] + 1) / len(self.result.history) if len(near) else math.inf

    @property
    def unrest(self) -> float:
        """The standard deviation of the best paths of the last `LAST` iterations in which an ant arrived; inf without any."""
        known = self.result.history.iteration_best
        known = known[np.isfinite(known)][-LAST:]
        return float(known.std()) if len(known) else math.inf

    @property
    def early_unrest(self) -> float:
        """The same over the first `LAST` iterations in which an ant arrived; inf without any."""
        known = self.result.history.iteration_best
        known = known[np.isfinite(known)][:LAST]
        return float(known.std()) if len(known) else math.inf

    @property
    def share(self) -> float:
        """The share of all iterations' ants that arrived [%]."""
        return 100.0 * float(self.result.history.arrived.mean()) / self.ants

    @property
    def cpu_ms(self) -> float:
        """The processor time of the plan, or of all decisions [ms]."""
        return 1000.0 * self.cpu_s

    @property
    def work(self) -> float:
        """The planner's measure of work: ant steps or propagated cells."""
        return float(self.result.work)

    @property
    def rated(self) -> float:
        """The chromosomes that a genetic algorithm rated."""
        return self.work


def solve(
    planner: str | Planner, options: Mapping[str, Any], query: Query, seed: int, work: float = math.inf
) -> PaperRun:
    """Plan once."""
    chosen = load_planner(planner, **options) if isinstance(planner, str) else planner
    rng, spent_work = np.random.default_rng(seed), [0]
    started = time.process_time()
    if math.isfinite(work):
        ants = as_iterative(chosen)
        if ants is None:
            raise FieldError("work", f"{type(chosen).__name__} plans at once; its work cannot be limited")
        endless = dataclasses.replace(ants, iterations=ENDLESS)
        result = endless.answer(query, _until(endless.iterate(query, rng), work, spent_work))
    else:
        result = chosen.plan(query, rng)
    spent = time.process_time() - started
    optimum, total, concentrated = maps.optimum(query), total_cost(query, result), concentration(result)
    limited = limits(work, np.array(spent_work[1:]), result.history.best, optimum) if math.isfinite(work) else ()
    colony = float(getattr(chosen, "ants", math.nan))
    return PaperRun(seed, seed, result, optimum, spent, total, concentrated, colony, *limited)


def limits(work: float, spent: npt.NDArray[np.int64], best: Floats, optimum: float) -> tuple[float, float]:
    """Return `PaperRun.even` and `PaperRun.close`.

    Between the last two iterations the length falls linearly with the work. A first path counts in full, although the limit
    may cut its iteration.

    Args:
        work: the limit of work
        spent: the work after each iteration (I,), the last at or above the limit
        best: the length of the best path after each iteration (I,), inf before the first
        optimum: the length of the shortest path
    """
    even = float(np.interp(work, spent[-2:], best[-2:])) if np.isfinite(best[-2:]).all() else float(best[-1])
    near = np.flatnonzero(best <= (1 + CLOSE) * optimum + 1e-9)
    return even, float(min(spent[near[0]], work)) if len(near) else math.inf


#: How often arms that are timed together take turns with each seed, A B B A A B B A, and the least processor time of a turn [s].
TURNS, TURN = 4, 0.003


def interleaved(calls: Sequence[Callable[[], PaperRun]]) -> list[PaperRun]:
    """Return one run of each call; `cpu_s` is the median of `TURNS` turns that alternate with those of the other calls.

    A first call shorter than `TURN` is not counted: a plan of 0.1 ms takes two or three times as long while the processor's
    caches hold the data of the other calls. The median of the calls in the next `TURN` seconds is. Every other round goes
    backwards, so that a steady drift of the machine's speed changes all times alike.
    """
    if len(calls) == 1:
        return [calls[0]()]
    rounds: list[list[PaperRun]] = []
    for number in range(TURNS):
        way = slice(None, None, -1 if number & 1 else 1)
        rounds.append([_turn(call) for call in calls[way]][way])
    return [
        dataclasses.replace(turns[0], cpu_s=statistics.median(run.cpu_s for run in turns))
        for turns in zip(*rounds, strict=True)
    ]


def _turn(call: Callable[[], PaperRun]) -> PaperRun:
    first = call()
    runs = [first if first.cpu_s >= TURN else call()]
    while sum(run.cpu_s for run in runs) < TURN:
        runs.append(call())
    return sorted(runs, key=lambda run: run.cpu_s)[len(runs) // 2]


def concentration(result: PlanResult) -> float:
    """Return the fraction of a plan's field on the cells of its path, 0 without a path; nan without a field."""
    if result.field is None:
        return math.nan
    if not result.solved:
        return 0.0
    on_path = np.zeros(result.field.shape, dtype=np.bool_)
    on_path[tuple(result.cells.T)] = True
    return float(result.field[on_path].sum() / result.field.sum())


def _until(states: Iterator[Iteration], work: float, spent: list[int]) -> Iterator[Iteration]:
    """Yield iterations until their work adds up to `work`, and append the work after each to `spent`."""
    for state in states:
        spent.append(spent[-1] + state.work)
        yield state
        if spent[-1] >= work:
            return


DECISIONS = 5000  # limit of a drive


class Strollers:
    """Movers of one cell that move to a random free neighbouring cell in every step.

    Args:
        grid: the free cells and the moves between them
        count: the number of movers
        rng: draws their cells and moves
        away: cells where none starts
        among: cells (N, 2) where they start; None: all free cells
        enter: whether they may move into the robot's cell
    """

    def __init__(
        self,
        grid: Grid,
        count: int,
        rng: np.random.Generator,
        away: tuple[Cell, ...],
        *,
        among: npt.NDArray[np.integer] | None = None,
        enter: bool = False,
    ) -> None:
        self._grid, self._rng, self._enter = grid, rng, enter
        free = [tuple(map(int, cell)) for cell in (np.argwhere(grid.free) if among is None else among)]
        chosen = rng.permutation(len(free))
        self._cells = [free[i] for i in chosen if free[i] not in away][:count]

    @property
    def cells(self) -> npt.NDArray[np.int64]:
        """The movers' cells (N, 2)."""
        return np.array(self._cells, dtype=np.int64).reshape(-1, 2)

    def step(self, robot: Cell) -> None:
        """Move each to a free neighbouring cell without a mover, and without the robot unless they may enter it."""
        for n, (r, c) in enumerate(self._cells):
            moves = int(self._grid.moves[r, c])
            near = [(r + dr, c + dc) for k, (dr, dc) in enumerate(DIRECTIONS) if moves >> k & 1]
            draw = self._rng.random()  # one number per step, independent of the robot
            near = [cell for cell in near if (self._enter or cell != robot) and cell not in self._cells]
            if near:
                self._cells[n] = near[int(draw * len(near))]


def drive(
    robot: OnlineAgent,
    query: Query,
    movers: Strollers,
    name: str = "",
    limit: int = DECISIONS,
    spent: Callable[[float], None] = lambda seconds: None,
) -> list[Cell]:
    """Return the cells of a drive, including the start; the last is the goal if the robot arrives within the limit.

    A drive ends when a mover enters the robot's cell.

    `spent` receives the processor time of each decision, without the movers' steps [s].
    """
    cells, name = [robot.cell], name or type(robot).__name__
    for _ in range(limit):
        if robot.arrived:
            break
        movers.step(robot.cell)
        if list(robot.cell) in movers.cells.tolist():
            break
        before, blocked, started = robot.cell, movers.cells, time.process_time()
        to = robot.step(blocked)
        spent(time.process_time() - started)
        if to is None:
            continue
        step = DIRECTIONS.index((to[0] - before[0], to[1] - before[1]))
        if not int(query.grid.moves[before]) >> step & 1:
            raise PlannerError(name, f"went from {before} to {to}, a forbidden move")
        if list(to) in movers.cells.tolist():
            raise PlannerError(name, f"went from {before} to {to}, into a mover")
        cells.append(to)
    return cells


def drive_among(
    planner: str | Planner,
    options: Mapping[str, Any],
    query: Query,
    seed: int,
    count: int,
    *,
    on_path: bool = False,
    enter: bool = False,
) -> PaperRun:
    """Drive once, cell by cell, among movers; the run's path is the driven one, none after a contact.

    Movers start anywhere, or `on_path` on cells of the planner's own plan, and may `enter` the robot's cell.
    """
    chosen = load_planner(planner, **options) if isinstance(planner, str) else planner
    ends = (query.start, query.goal)
    among = chosen.plan(query, np.random.default_rng(seed)).cells if on_path else None
    movers = Strollers(query.grid, count, np.random.default_rng([seed, count]), ends, among=among, enter=enter)
    started = time.process_time()
    robot = agent_for(chosen, query, np.random.default_rng(seed))
    times = [time.process_time() - started]
    name = planner if isinstance(planner, str) else type(planner).__name__
    path = np.array(drive(robot, query, movers, name, spent=times.append), dtype=np.int32)
    result = PlanResult(
        status=PlanStatus.SOLVED if robot.arrived else PlanStatus.STOPPED,
        cells=path,
        cost=path_cost(path, query.grid.cell),
        reason=robot.note if robot.arrived else f"a mover entered its cell, or {DECISIONS} decisions were made",
        work=robot.stats.propagated,
        work_unit="cells",
    )
    if not result.solved:
        result = dataclasses.replace(result, cells=path[:0], cost=float("inf"))
    return PaperRun(seed, seed, result, maps.optimum(query), sum(times), total_cost(query, result))
