"""Common loop of iterative planners: budget, history, interruption, progress."""

from __future__ import annotations

import abc
import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import require
from antdrive.base.kernel_cache import clock
from antdrive.base.plane import polyline_length
from antdrive.planners.errors import PlannerError, is_built_in, planner_errors
from antdrive.planners.graph.search import UNREACHABLE, reachable
from antdrive.planners.plan import (
    Capabilities,
    Cells,
    GridPlanner,
    History,
    Planner,
    PlanResult,
    PlanStatus,
    Query,
    capabilities_of,
    path_cost,
)

INHERIT = "inherit antdrive.planners.IterativePlanner and yield an Iteration for each"


class Iteration(NamedTuple):
    """The state of a planner after an iteration. Lengths are in metres; infinite means no path.

    Attributes:
        cells: the best path so far as (row, col) of each cell (N, 2), empty while there is none
        best: length of the best path so far [m]
        iteration_best: length of this iteration's best path [m]
        iteration_mean: mean length of this iteration's complete paths [m]
        arrived: number of ants or chromosomes of this iteration that reached the goal
        work: the work of this iteration, in the planner's `work_unit`
        waypoints: the best path so far as a polyline of fractional (row, col) (M, 2), as in `PlanResult`
        field: the planner's field (R, C), as in `PlanResult`
    """

    cells: Cells
    best: float
    iteration_best: float
    iteration_mean: float
    arrived: int
    work: int
    waypoints: Floats | None = None
    field: Floats | None = None


class Progress(NamedTuple):
    """Progress of a planner.

    Attributes:
        done: completed iterations
        total: maximum number of iterations
        best: length of the best path so far [m], infinite while there is none
    """

    done: int
    total: int
    best: float


_progress_callback: ContextVar[Callable[[Progress], None] | None] = ContextVar("_progress_callback", default=None)


@contextmanager
def on_progress(callback: Callable[[Progress], None]) -> Iterator[None]:
    """Make planners call `callback` after every iteration within this block; an exception that it raises ends planning."""
    token = _progress_callback.set(callback)
    try:
        yield
    finally:
        _progress_callback.reset(token)


_keeping: ContextVar[bool] = ContextVar("_keeping", default=False)


@contextmanager
def keep_best() -> Iterator[None]:
    """Return the best path so far on Ctrl-C within this block, with the status `STOPPED`.

    Outside the block, `KeyboardInterrupt` is raised as usual and ends a series of plans.
    """
    token = _keeping.set(True)
    try:
        yield
    finally:
        _keeping.reset(token)


@dataclass(frozen=True, kw_only=True)
class IterativePlanner(GridPlanner):
    """A planner that improves its answer in iterations.

    It ends after `iterations` or at the `time_budget`, whichever comes first. A time budget makes plans
    irreproducible, as faster machines complete more iterations. Ctrl-C within `keep_best` returns the best
    path so far as `STOPPED`.

    Attributes:
        iterations: maximum number of iterations
        time_budget: planning time after which no further iteration begins [s]; None for no limit
    """

    iterations: int = 100
    time_budget: float | None = None

    def __post_init__(self) -> None:
        require("iterations", self.iterations, at_least=1)
        if self.time_budget is not None:
            require("time_budget", self.time_budget, above=0)

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities and requirements of this planner."""
        return Capabilities(iterative=True)

    @abc.abstractmethod
    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Yield improving plans, until no improvement is possible or without end.

        Only called for queries whose goal is reachable from the start.
        """

    @property
    @abc.abstractmethod
    def work_unit(self) -> str:
        """The unit of `work`."""

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Iterate within the options' limits."""
        return self.answer(query, self.iterate(query, rng))

    def answer(self, query: Query, states: Iterator[Iteration]) -> PlanResult:
        """Return the plan after as many iterations (`states`) as the options allow; both ends of the query are free."""
        if not reachable(query):
            return PlanResult(status=PlanStatus.NO_PATH, reason=UNREACHABLE, work_unit=self.work_unit)
        if query.start == query.goal:
            here = np.array([query.start], dtype=np.int32)
            return PlanResult(status=PlanStatus.SOLVED, cells=here, cost=0.0, work_unit=self.work_unit)
        done: list[Iteration] = []
        note = ""
        try:
            note = self._improve(states, done)
        except KeyboardInterrupt:
            if not _keeping.get():
                raise
            note = f"interrupted after {len(done)} of {self.iterations} iterations"
            return dataclasses.replace(self._conclude(query, done, note), status=PlanStatus.STOPPED)
        return self._conclude(query, done, note)

    def _improve(self, states: Iterator[Iteration], done: list[Iteration]) -> str:
        budget, spent = math.inf if self.time_budget is None else self.time_budget, clock()
        callback = _progress_callback.get()
        for state in itertools.islice(states, self.iterations):
            done.append(state)
            if callback is not None:
                callback(Progress(len(done), self.iterations, done[-1].best))
            if spent() >= budget and len(done) < self.iterations:
                count = f"{len(done)} of {self.iterations} iterations"
                return f"stopped by the time budget of {self.time_budget:g} s after {count}"
        return ""

    def _conclude(self, query: Query, done: list[Iteration], note: str) -> PlanResult:
        last = done[-1] if done else None
        work = sum(state.work for state in done)
        history = History(
            best=np.array([state.best for state in done], dtype=np.float64),
            iteration_best=np.array([state.iteration_best for state in done], dtype=np.float64),
            iteration_mean=np.array([state.iteration_mean for state in done], dtype=np.float64),
            arrived=np.array([state.arrived for state in done], dtype=np.int64),
        )
        field = None if last is None else last.field
        if last is None or not len(last.cells):
            return PlanResult(
                status=PlanStatus.STOPPED,
                reason=note or f"nothing arrived within {self.iterations} iterations",
                work=work,
                work_unit=self.work_unit,
                history=history,
                field=field,
            )
        return PlanResult(
            status=PlanStatus.SOLVED,
            cells=last.cells,
            cost=path_cost(last.cells, query.grid.cell),
            waypoints=last.waypoints,
            length=None if last.waypoints is None else polyline_length(query.grid.xy(last.waypoints)),
            reason=note,
            work=work,
            work_unit=self.work_unit,
            history=history,
            field=field,
        )


def as_iterative(planner: Planner) -> IterativePlanner | None:
    """Return the planner if it declares itself iterative, else None.

    Raises:
        PlannerError: the planner declares itself iterative, but has no iterations.
    """
    if not capabilities_of(planner).iterative:
        return None
    with planner_errors(planner):
        missing = [name for name in ("iterate", "iterations", "time_budget") if not hasattr(planner, name)]
    if missing:
        problem = f"declares itself iterative, but lacks {', '.join(missing)}; {INHERIT}"
        raise PlannerError(type(planner).__name__, problem)
    return cast(IterativePlanner, planner)


def without_iterations(planner: Planner, name: str) -> str:
    """Return a sentence that a planner has no iterations, with what a user's class inherits to have them."""
    return f"{name} does not plan in iterations" + ("" if is_built_in(planner) else f"; {INHERIT}")
