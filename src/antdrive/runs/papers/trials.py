"""Single plans of the papers' experiments: one planner, one map, one seed, as many ant steps as wanted."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.planners import Planner, PlanResult, Query, load_planner
from antdrive.planners.iterative import Iteration, as_iterative
from antdrive.runs.papers import maps
from antdrive.runs.papers.baselines import total_cost

ENDLESS = 1_000_000  # iterations; the ant steps end such a plan much earlier
CLOSE = 0.25  # a path is close to the shortest when it is at most this share longer
NEAR = 0.05  # and near to it at this share
LAST = 10  # iterations over which `unrest` is measured


@dataclass(frozen=True)
class Trial:
    """What one plan of an experiment gave. Lengths are in cells."""

    seed: int  # of map and planner
    world: int  # which of the experiment's maps it was
    result: PlanResult
    optimum: float  # the length of the shortest path with the same moves
    cpu_s: float  # processor time of the plan [s]
    total: float  # hasan's total cost of the path; inf if there is none
    concentration: float = (
        math.nan
    )  # the share of the planner's field that lies on the path; nan without a path or a field

    @property
    def length(self) -> float:
        """The length of the path; inf if there is none."""
        return self.result.line_length if self.result.solved else math.inf

    @property
    def gap(self) -> float:
        """How much longer than the shortest path the path is [%]; inf if there is none."""
        return 100.0 * (self.length / self.optimum - 1.0)

    @property
    def steps(self) -> float:
        """How many moves the path has; inf if there is none."""
        return float(len(self.result.cells) - 1) if self.result.solved else math.inf

    @property
    def last(self) -> float:
        """The best path of the last iteration that any ant finished; inf if none did."""
        known = self.result.history.iteration_best
        return float(known[-1]) if len(known) else math.inf

    @property
    def settled(self) -> float:
        """The iteration, from 1, that found the path; inf if there is none."""
        best = self.result.history.best
        return float(np.argmax(best <= best[-1] * (1 + 1e-9)) + 1) if self.result.solved and len(best) else math.inf

    @property
    def near(self) -> float:
        """The iteration, from 1, with which the path was within `NEAR` of the shortest; inf if it never was."""
        near = np.flatnonzero(self.result.history.best <= (1 + NEAR) * self.optimum + 1e-9)
        return float(near[0] + 1) if len(near) else math.inf

    @property
    def effort(self) -> float:
        """How much work it took until the path was within `CLOSE` of the shortest; inf if it never was.

        Every iteration counts as the same share of the work.
        """
        near = np.flatnonzero(self.result.history.best <= (1 + CLOSE) * self.optimum + 1e-9)
        return self.result.work * (near[0] + 1) / len(self.result.history) if len(near) else math.inf

    @property
    def unrest(self) -> float:
        """The standard deviation of the best paths of the last `LAST` iterations; inf where some had none."""
        known = self.result.history.iteration_best[-LAST:]
        return float(known.std()) if len(known) and np.isfinite(known).all() else math.inf

    @property
    def early_unrest(self) -> float:
        """The same of the first `LAST` iterations in which an ant arrived; inf if none did."""
        known = self.result.history.iteration_best
        known = known[np.isfinite(known)][:LAST]
        return float(known.std()) if len(known) else math.inf

    @property
    def cpu_ms(self) -> float:
        """Processor time of the plan, or of all decisions on the way [ms]."""
        return 1000.0 * self.cpu_s

    @property
    def work(self) -> float:
        """What the planner counts as its work: ant steps, cells propagated, chromosomes."""
        return float(self.result.work)


def solve(planner: str | Planner, options: Mapping[str, Any], query: Query, seed: int, work: float = math.inf) -> Trial:
    """Plan once.

    Raises:
        FieldError: `work` is finite and the planner has no iterations.
    """
    chosen = load_planner(planner, **options) if isinstance(planner, str) else planner
    rng = np.random.default_rng(seed)
    started = time.process_time()
    if math.isfinite(work):
        ants = as_iterative(chosen)
        if ants is None:
            raise FieldError("work", f"{type(chosen).__name__} plans at once; its work cannot be limited")
        endless = dataclasses.replace(ants, iterations=ENDLESS)
        result = endless.answer(query, _until(endless.iterate(query, rng), work))
    else:
        result = chosen.plan(query, rng)
    spent = time.process_time() - started
    return Trial(seed, seed, result, maps.optimum(query), spent, total_cost(query, result), concentration(result))


def concentration(result: PlanResult) -> float:
    """The share of a plan's field that lies on the cells of its path; nan without a path or a field."""
    if not result.solved or result.field is None:
        return math.nan
    on_path = np.zeros(result.field.shape, dtype=np.bool_)
    on_path[tuple(result.cells.T)] = True
    return float(result.field[on_path].sum() / result.field.sum())


def _until(states: Iterator[Iteration], work: float) -> Iterator[Iteration]:
    """The iterations up to that in which the work adds up to `work`."""
    done = 0
    for state in states:
        yield state
        done += state.work
        if done >= work:
            return
