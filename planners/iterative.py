"""The loop that every planner with iterations shares: budget, history, interruption, progress."""

from __future__ import annotations

import abc
import dataclasses
import itertools
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from antdrive.planners.graph.search import NO_WAY, reachable
from antdrive.planners.plan import Cells, GridPlanner, History, PlanResult, PlanStatus, Query, path_cost
from antdrive.worlds import Floats
from antdrive.worlds.errors import FieldError


class Iteration(NamedTuple):
    """Where a planner stands after an iteration. Lengths in metres, inf = none."""

    cells: Cells  # the best path so far (N, 2), empty while there is none
    best: float  # its length
    iteration_best: float
    iteration_mean: float  # over those that arrived
    arrived: int
    work: int  # spent in this iteration
    waypoints: Floats | None = None  # as in PlanResult
    landscape: Floats | None = None  # as in PlanResult


class Progress(NamedTuple):
    """How far a planner has come."""

    done: int  # iterations
    total: int
    best: float  # length of the best path so far [m], inf while there is none


_watcher: ContextVar[Callable[[Progress], None] | None] = ContextVar("_watcher", default=None)


@contextmanager
def watch(see: Callable[[Progress], None]) -> Iterator[None]:
    """Within this block, planners call `see` after every iteration."""
    token = _watcher.set(see)
    try:
        yield
    finally:
        _watcher.reset(token)


_keeping: ContextVar[bool] = ContextVar("_keeping", default=False)


@contextmanager
def keep_best() -> Iterator[None]:
    """Within this block, Ctrl-C makes a planner hand over its best path so far, as `STOPPED`.

    Elsewhere it is raised, so that it ends what plans many times instead of passing for one more result.
    """
    token = _keeping.set(True)
    try:
        yield
    finally:
        _keeping.reset(token)


@dataclass(frozen=True, kw_only=True)
class IterativePlanner(GridPlanner):
    """A planner that improves its answer in iterations.

    It ends after `iterations`, or with the best path so far at the `time_budget`, with a note in `reason`. A time
    budget gives up repeatability: a faster machine gets further. At Ctrl-C within `keep_best` it hands over the best so
    far as `STOPPED`.
    """

    iterations: int = 100
    time_budget: float | None = None  # [s], looked at after each iteration

    def __post_init__(self) -> None:
        require("iterations", self.iterations, at_least=1)
        if self.time_budget is not None:
            require("time_budget", self.time_budget, above=0)

    @abc.abstractmethod
    def iterate(self, query: Query, rng: np.random.Generator) -> Iterator[Iteration]:
        """Improve the answer until nothing more is to be gained, or without end; the goal can be reached."""

    @property
    @abc.abstractmethod
    def work_unit(self) -> str:
        """What `work` counts."""

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        return self.take(query, self.iterate(query, rng))

    def take(self, query: Query, states: Iterator[Iteration]) -> PlanResult:
        """The answer that iterations lead to, as many of them as there are to be; both ends are free."""
        if not reachable(query):
            return PlanResult(status=PlanStatus.NO_PATH, reason=NO_WAY, work_unit=self.work_unit)
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
        deadline = math.inf if self.time_budget is None else time.perf_counter() + self.time_budget
        see = _watcher.get()
        for state in itertools.islice(states, self.iterations):
            done.append(state)
            if see is not None:
                see(Progress(len(done), self.iterations, done[-1].best))
            if time.perf_counter() >= deadline and len(done) < self.iterations:
                spent = f"{len(done)} of {self.iterations} iterations"
                return f"stopped by the time budget of {self.time_budget:g} s after {spent}"
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
        landscape = None if last is None else last.landscape
        if last is None or not len(last.cells):
            return PlanResult(
                status=PlanStatus.STOPPED,
                reason=note or f"nothing arrived within {self.iterations} iterations",
                work=work,
                work_unit=self.work_unit,
                history=history,
                landscape=landscape,
            )
        return PlanResult(
            status=PlanStatus.SOLVED,
            cells=last.cells,
            cost=path_cost(last.cells, query.grid.cell),
            waypoints=last.waypoints,
            reason=note,
            work=work,
            work_unit=self.work_unit,
            history=history,
            landscape=landscape,
        )


def require(
    key: str,
    value: float,
    *,
    at_least: float = -math.inf,
    above: float = -math.inf,
    at_most: float = math.inf,
    below: float = math.inf,
) -> None:
    """Refuse an option outside its range.

    Raises:
        ValueError: names the key and the range.
    """
    bounds = [
        f"{word} {bound:.12g}"
        for word, bound in (("at least", at_least), ("above", above), ("at most", at_most), ("below", below))
        if math.isfinite(bound)
    ]
    if not (at_least <= value <= at_most and above < value < below):
        raise FieldError(key, f"must be {' and '.join(bounds) or 'finite'}, got {value:g}")
